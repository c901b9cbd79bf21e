//! The questions of the protocol, each with the type of its answer.

use darm_core::nearest::{Coordinates, Found};
use darm_core::sequencer::{Command, Event};
use darm_core::units::Micros;
use darm_core::wire::PROTOCOL;
use darm_core::wire::bootstrap::CrashRecord;
use darm_core::wire::health::Health;
use darm_core::wire::inputs::InputChanges;
use darm_core::wire::message::{Answer, Calibration, Events, Hello, Image, OutputState, Request, Status};

use super::AnswerError;

/// A request, and how its answer is read.
pub(super) struct Question<'a, T> {
    /// What messages call it.
    pub(super) name: &'static str,
    pub(super) request: Request<'a>,
    read: fn(Answer) -> Option<T>,
}

impl<T> Question<'_, T> {
    /// What the board says.
    ///
    /// # Errors
    ///
    /// [`AnswerError::Payload`]: the answer to another question.
    pub(super) fn read(&self, answer: Answer) -> Result<T, AnswerError> {
        (self.read)(answer).ok_or(AnswerError::Payload { request: self.name })
    }
}

macro_rules! questions {
    ($($name:ident($($argument:ident: $kind:ty),*) $text:literal -> $type:ty: $request:expr, $($answer:pat => $value:expr),+;)*) => {$(
        pub(super) fn $name<'a>($($argument: $kind),*) -> Question<'a, $type> {
            let read = |answer| match answer {
                $($answer => Some($value),)+
                _ => None,
            };
            Question { name: $text, request: $request, read }
        }
    )*};
}

questions! {
    hello(challenge: u64) "hello" -> Hello: Request::Hello { protocol: PROTOCOL, challenge }, Answer::Hello(hello) => hello;
    status() "status" -> Status: Request::Status, Answer::Status(status) => status;
    events(from: u32) "events" -> Events: Request::Events { from }, Answer::Events(events) => events;
    begin(image: Image) "begin" -> u32: Request::Begin(image), Answer::Upload { next } => next;
    chunk(offset: u32, bytes: &'a [u8]) "chunk" -> u32: Request::Chunk { offset, bytes }, Answer::Upload { next } => next;
    // A profile has no rows.
    commit(image: Image) "commit" -> u16: Request::Commit(image), Answer::Committed { rows } => rows, Answer::Done => 0;
    command(command: Command) "command" -> (): Request::Command(command), Answer::Done => ();
    calibrate(offsets: Calibration) "calibrate" -> (): Request::Calibrate(offsets), Answer::Done => ();
    calibration() "calibration" -> Option<Calibration>: Request::Calibration, Answer::Calibration(stored) => stored;
    nearest(target: Coordinates) "nearest" -> Found<f32>: Request::Nearest(target), Answer::Nearest(found) => found;
    outputs(from: u8) "outputs" -> Vec<OutputState>: Request::Outputs { from }, Answer::Outputs(list) => list.to_vec();
    health() "health" -> Health: Request::Health, Answer::Health(health) => health;
    past_events(skip: u32) "past events" -> Vec<(Micros, Event)>: Request::PastEvents { skip },
        Answer::PastEvents(list) => list.to_vec();
    past_crash(back: u8) "past crash" -> Option<CrashRecord>: Request::PastCrash { back }, Answer::PastCrash(crash) => crash;
    inputs(from: u32) "inputs" -> InputChanges: Request::Inputs { from }, Answer::Inputs(changes) => changes;
}
