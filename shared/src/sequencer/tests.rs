//! Bench experiments on the state machine: a board is wired up, time passes, lines and switches are looked at.

extern crate std;
use std::boxed::Box;
use std::vec::Vec;

use super::{
    Command, CommandError, Event, FaultKind, Outputs, Phase, Seen, Sequencer, ServoAction, ServoSeen, ServoTarget,
};
use crate::duty::MeterLimit;
use crate::output::{ActuatorWiring, Coil, CoilLimit, Drive, LimitSwitch, SwitchLimit};
use crate::profile::Profile;
use crate::table::{Board, Record, Row, Table, wiring};
use crate::units::{Digest, Micros, ModelHash, Word};

mod accepted;
mod by_hand;
mod limits;
mod meters;
mod programs;
mod servos;
mod supply;
mod switches;

const MS: u64 = 1000;

struct Bench {
    sequencer: Sequencer<'static>,
    /// When it began.
    begun: Micros,
    now: Micros,
    seen: Seen,
    outputs: Outputs,
    /// Switches follow the lines, as an arm without faults does.
    follows: bool,
}

impl Bench {
    /// A board whose profile allows just what the table asks for, an hour after it was switched on.
    fn new(records: &[Record]) -> Self {
        Self::with(records, |_| {})
    }

    /// The same with a profile that is changed first.
    fn with(records: &[Record], change: impl FnOnce(&mut Profile)) -> Self {
        let mut profile = profile(records);
        change(&mut profile);
        let profile = Box::leak(Box::new(profile));
        let mut sequencer = Sequencer::new(Box::leak(Box::default()));
        sequencer.configure(profile);
        let mut now = Micros(0);
        rest(&mut sequencer, &mut now, 3600);
        sequencer.load(table(records, profile)).expect("a new sequencer is idle");
        Self { sequencer, begun: now, now, seen: Seen::default(), outputs: Outputs::default(), follows: true }
    }

    /// Lets this many milliseconds pass, in ticks of one.
    fn run(&mut self, millis: u64) -> &mut Self {
        for _ in 0..millis {
            self.now = self.now + Micros(MS);
            self.outputs = self.sequencer.step(self.now, &self.seen);
            if self.follows {
                self.seen.switches = self.outputs.lines as u32;
            }
        }
        self
    }

    /// The servo answers now, from this angle of its shaft.
    fn answer(&mut self, angle_rad: f32) {
        self.seen.servos[0] = ServoSeen { angle_rad, answered: Some(self.now), ..ServoSeen::default() };
    }

    fn target(&self) -> Option<ServoTarget> {
        match self.outputs.servos[0] {
            ServoAction::Go(target) => Some(target),
            ServoAction::Hold | ServoAction::Release => None,
        }
    }

    fn command(&mut self, command: Command) -> Result<(), CommandError> {
        self.sequencer.command(command)
    }

    fn events(&mut self) -> Vec<Event> {
        core::iter::from_fn(|| self.sequencer.next_event()).map(|(_, event)| event).collect()
    }

    fn fault(&self) -> Option<FaultKind> {
        match self.sequencer.phase() {
            Phase::Safe(fault) => Some(fault.kind),
            _ => None,
        }
    }
}

fn profile(records: &[Record]) -> Profile {
    let wiring = wiring(records).expect("the test's own wiring fits");
    Profile { digest: PROFILE, ..Profile::of(&wiring) }
}

fn table(records: &[Record], profile: &Profile) -> &'static mut Table {
    admitted(records, profile).expect("the test's own table is valid")
}

fn admitted(records: &[Record], profile: &Profile) -> Option<&'static mut Table> {
    let table = Box::leak(Box::<Table>::default());
    let board = Board { device: None, profile };
    records.iter().try_for_each(|record| table.push(record, &board)).ok()?;
    Some(table)
}

/// The limit of output 0.
fn limit_of(profile: &Profile) -> MeterLimit {
    MeterLimit::of(&profile.outputs[0].expect("output 0").limit)
}

/// Takes over a profile, in no time.
fn take_over(sequencer: &mut Sequencer) {
    while !sequencer.is_ready() {
        sequencer.step(Micros(0), &Seen::default());
    }
}

/// Lets seconds pass in coarse ticks.
fn rest(sequencer: &mut Sequencer, now: &mut Micros, seconds: u32) {
    for _ in 0..10 * seconds {
        *now = *now + Micros::from_millis(100);
        sequencer.step(*now, &Seen::default());
    }
}

const PROFILE: Digest = Digest([3; 32]);

fn start() -> Record {
    let switch_limit = SwitchLimit { new_coils: 2, window_ms: 5 };
    Record::Start { model: ModelHash(1), device: None, profile: PROFILE, switch_limit }
}

fn coil(output: u8, drive: Drive) -> Record {
    let limit = CoilLimit { max_on_ms: 100, duty_percent: 60, window_ms: 1600 };
    Record::Coil(Coil { output, drive, limit })
}

fn actuator(input: u8) -> Record {
    let switch = Some(LimitSwitch { input, closed_in: 0b10 });
    Record::Actuator(ActuatorWiring { states: 2, switch, travel_ms: 10 })
}

fn word(text: &str) -> Word {
    text.parse().expect("the test's own word is valid")
}

fn row(at_ms: u32, digits: &str) -> Record {
    Record::Row(Row { at: Micros::from_millis(at_ms), word: word(digits), servos: heapless::Vec::new() })
}

fn end(at_ms: u32) -> Record {
    Record::End { at: Micros::from_millis(at_ms) }
}

fn two_valves(rows: &[Record]) -> Vec<Record> {
    let wiring =
        [start(), coil(0, Drive::Hold { line: 0 }), coil(1, Drive::Hold { line: 1 }), actuator(0), actuator(1)];
    wiring.into_iter().chain(rows.iter().cloned()).collect()
}
