//! The whole board in a process: console bytes in and out, lines and switches, flash in memory.
mod calibration;
pub(crate) mod fakes;
mod frames;
mod nearest;
mod profiles;
mod servos;
mod stops;
mod wear;

use core::cell::{Cell, RefCell};

use darm_core::profile::Profile;
use darm_core::sequencer::{Command, CommandError, Event, FaultKind, Outputs, Phase, ServoSeen};
use darm_core::units::{ActuatorId, DeviceId, Digest, Micros};
use darm_core::wire::PROTOCOL;
use darm_core::wire::bootstrap::{self, Identity};
use darm_core::wire::frame::{self, Header, MAX_FRAME, MAX_PAYLOAD};
use darm_core::wire::health::{Health, StackUse};
use darm_core::wire::message::{Answer, CHUNK, Calibration, Hello, Image, REQUEST, Refusal, Reply, Request, Status};

use crate::app::serve;
use crate::control::{Control, Inputs, Shared, TICK};
use crate::dispatch::{Board, Dispatcher};
use crate::kept::Kept;
use crate::pipe::{Pipe, PipeReader, PipeWriter};
use fakes::{Cells, HandClock, MockFlash, caps, profile, profile_image, run, table};

const LINK: u32 = 77;

type OnBench = Dispatcher<'static, 'static, MockFlash, &'static HandClock>;

/// A board, and an arm that follows its lines at once.
struct Bench {
    cells: Cells,
    clock: &'static HandClock,
    shared: &'static Shared<'static>,
    control: RefCell<Control<'static>>,
    outputs: Cell<Outputs>,
    /// Switches that do not follow: the bits are what they show instead.
    stuck: Cell<Option<u32>>,
    /// The first servo answers, from where it is.
    has_servo: Cell<bool>,
    /// A person holds the button.
    button: Cell<bool>,
    /// Supply that the converter gives in the next tick, mV.
    supply_mv: Cell<Option<u16>>,
    /// When a stop comes that goes past the dispatcher, us.
    stop_at: Cell<Option<u64>>,
    dispatcher: RefCell<Option<OnBench>>,
    number: Cell<u16>,
}

/// What the board of a bench reports of itself.
fn health() -> Health {
    Health { load_permille: Some(123), stack: Some(StackUse { used: 4_000, size: 14_336 }), ..Health::default() }
}

impl Bench {
    /// A board that was switched on a minute ago.
    fn new(cells: Cells) -> Self {
        let bench = Self::switched_on(cells);
        bench.pass_ms(60_000);
        bench
    }

    /// A board that was just switched on.
    fn switched_on(cells: Cells) -> Self {
        Self::reset(cells, None)
    }

    /// A board after a reset, with what memory has kept.
    fn reset(cells: Cells, kept: Option<&'static Kept>) -> Self {
        let shared: &'static Shared = Box::leak(Box::default());
        let clock: &'static HandClock = Box::leak(Box::default());
        let bench = Self {
            clock,
            shared,
            control: RefCell::new(Control::new(Micros(0), shared, Box::leak(Box::default()))),
            outputs: Cell::default(),
            stuck: Cell::default(),
            has_servo: Cell::new(true),
            button: Cell::default(),
            supply_mv: Cell::default(),
            stop_at: Cell::default(),
            dispatcher: RefCell::default(),
            number: Cell::new(0),
            cells,
        };
        let identity = Identity { device: DeviceId([7; 12]), board: heapless::String::try_from("bench").unwrap() };
        let board = Board { identity, crash: None, caps: caps(), guards_loader: true, health, kept };
        let mut dispatcher =
            Dispatcher::new(board, bench.clock, bench.shared, Box::leak(Box::default()), Box::leak(Box::default()));
        let profile = Box::leak(Box::new(Profile::empty()));
        let opening = dispatcher.open(Some(bench.cells.flash(u32::MAX)), Box::leak(Box::default()), profile);
        run(opening, || bench.tick());
        *bench.dispatcher.borrow_mut() = Some(dispatcher);
        bench
    }

    fn tick(&self) {
        let now = self.clock.0.get() + TICK.0;
        self.clock.0.set(now);
        if Some(now) == self.stop_at.get() {
            self.shared.stop();
        }
        if self.has_servo.get() {
            let seen = self.shared.servo_seen(0);
            self.shared.see_servo(0, ServoSeen { answered: Some(Micros(now)), ..seen });
        }
        let switches = self.stuck.get().unwrap_or(self.outputs.get().lines as u32);
        let (button, supply_mv) = (self.button.get(), self.supply_mv.take());
        let inputs = Inputs { switches, button, supply_mv, ..Inputs::default() };
        self.outputs.set(self.control.borrow_mut().tick(Micros(now), Micros(now), inputs, self.shared));
    }

    /// A servo has answered so, and answers no more.
    fn see_servo(&self, seen: ServoSeen) {
        self.has_servo.set(false);
        self.shared.see_servo(0, seen);
    }

    fn pass_ms(&self, millis: u32) {
        (0..millis).for_each(|_| self.tick());
    }

    /// Sends a body as it stands; the answer's payload.
    fn send(&self, header: Header, payload: &[u8]) -> Option<Vec<u8>> {
        let mut encoded = [0; MAX_FRAME];
        let len = frame::encode(header, payload, &mut encoded).unwrap();
        self.frame(&mut encoded[1..len - 1])
    }

    fn frame(&self, encoded: &mut [u8]) -> Option<Vec<u8>> {
        let mut dispatcher = self.dispatcher.borrow_mut();
        let dispatcher = dispatcher.as_mut().unwrap();
        dispatcher.begin_item();
        let mut answer = match run(dispatcher.answer(encoded), || self.tick()) {
            None if dispatcher.pending_search.is_some() => run(dispatcher.seek(), || self.tick()),
            answer => answer?,
        };
        let len = answer.len();
        Some(frame::decode(&mut answer[1..len - 1]).unwrap().1.to_vec())
    }

    fn ask_as(&self, link: u32, number: u16, request: Request) -> Option<Result<Answer, Refusal>> {
        let mut bytes = [0; MAX_PAYLOAD];
        let payload = postcard::to_slice(&request, &mut bytes).unwrap();
        let answer = self.send(Header { tag: REQUEST, link, number }, payload)?;
        Some(postcard::from_bytes::<Reply>(&answer).unwrap().result)
    }

    fn ask(&self, request: Request) -> Result<Answer, Refusal> {
        self.number.set(self.number.get().wrapping_add(1));
        self.ask_as(LINK, self.number.get(), request).unwrap()
    }

    fn command(&self, command: Command) -> Result<Answer, Refusal> {
        self.ask(Request::Command(command))
    }

    /// Opens a connection as a client does, with the challenge that it is refused with first.
    fn open(&self, link: u32, number: u16) -> Result<Answer, Refusal> {
        let hello = |challenge| self.ask_as(link, number, Request::Hello { protocol: PROTOCOL, challenge }).unwrap();
        match hello(0) {
            Err(Refusal::Challenge { challenge }) => hello(challenge),
            answer => answer,
        }
    }

    fn connect(&self) {
        self.number.set(self.number.get().wrapping_add(1));
        assert!(matches!(self.open(LINK, self.number.get()), Ok(Answer::Hello(_))));
    }

    fn status(&self) -> Status {
        match self.ask(Request::Status) {
            Ok(Answer::Status(status)) => status,
            other => panic!("{other:?}"),
        }
    }

    fn upload(&self, (image, bytes): &(Image, Vec<u8>)) -> Result<Answer, Refusal> {
        self.ask(Request::Begin(*image))?;
        for (chunk, offset) in bytes.chunks(CHUNK).zip((0u32..).step_by(CHUNK)) {
            self.ask(Request::Chunk { offset, bytes: chunk })?;
        }
        self.ask(Request::Commit(*image))
    }

    fn events(&self) -> Vec<Event> {
        let mut events = vec![];
        while let Ok(Answer::Events(next)) = self.ask(Request::Events { from: events.len() as u32 }) {
            if next.list.is_empty() {
                break;
            }
            events.extend(next.list.iter().map(|(_, event)| *event));
        }
        events
    }

    /// What the board prints for a line.
    fn type_line(&self, line: &str) -> String {
        let pipe = Pipe::<4096>::new();
        let mut dispatcher = self.dispatcher.borrow_mut();
        dispatcher.as_mut().unwrap().begin_item();
        run(dispatcher.as_mut().unwrap().execute(line, &mut PipeWriter(&pipe)), || self.tick()).unwrap();
        core::iter::from_fn(|| pipe.pop()).map(char::from).collect()
    }
}

/// A board with a table of ten rows.
fn loaded() -> Bench {
    let bench = Bench::new(Cells::with_profile());
    bench.connect();
    assert_eq!(bench.upload(&table(1, 10, false)), Ok(Answer::Committed { rows: 10 }));
    bench
}

#[test]
fn a_table_is_uploaded_played_and_still_there_after_a_start() {
    let bench = loaded();
    assert_eq!(bench.command(Command::Play), Ok(Answer::Done));
    bench.pass_ms(1100);
    let rows = bench.events().iter().filter(|event| matches!(event, Event::Row { .. })).count();
    assert_eq!((rows, bench.events().last()), (10, Some(&Event::Finished)));
    let again = Bench::new(bench.cells);
    again.connect();
    assert_eq!(again.status().rows, 10);
}

#[test]
fn rows_reach_the_lines() {
    let bench = loaded();
    bench.command(Command::Play).unwrap();
    bench.tick();
    let lines: Vec<_> = (0..4)
        .map(|_| {
            bench.pass_ms(100);
            bench.outputs.get().lines
        })
        .collect();
    assert_eq!(lines, [1, 2, 3, 0]);
}

#[test]
fn a_switch_that_contradicts_latches_the_safe_state_and_both_languages_say_so() {
    let bench = loaded();
    bench.command(Command::Play).unwrap();
    bench.stuck.set(Some(0));
    bench.pass_ms(300);
    let Phase::Safe(fault) = bench.status().phase else { panic!("not safe") };
    let actuator = ActuatorId(0);
    assert_eq!(fault.kind, FaultKind::Switch { actuator, expected_closed: true, seen_closed: false });
    assert!(!bench.outputs.get().enabled);
    let text = bench.type_line("status");
    assert!(text.contains("safe state: actuator 0: limit switch expected closed, seen open at 60."), "{text}");
    assert_eq!(bench.type_line("play"), "? a fault is latched; look at it, then clear it\r\n");
    assert_eq!(bench.type_line("clear"), "ok\r\n");
    assert_eq!(bench.status().phase, Phase::Idle);
}

#[test]
fn the_status_says_load_and_stack() {
    let text = loaded().type_line("status");
    assert!(text.contains("load 12.3 % of the last second\r\nstack: 4000 of 14336 bytes were in use\r\n"), "{text}");
}

#[test]
fn a_change_runs_once() {
    let bench = loaded();
    let play = Request::Command(Command::Play);
    assert_eq!(bench.ask_as(LINK, 1000, play), Some(Ok(Answer::Done)));
    bench.pass_ms(200);
    assert_eq!(bench.ask_as(LINK, 1001, Request::Command(Command::Stop)), Some(Ok(Answer::Done)));
    assert_eq!(bench.ask_as(LINK, 1000, play), Some(Ok(Answer::Done)), "the answer is kept");
    assert_eq!(bench.ask_as(LINK, 1001, Request::Command(Command::Stop)), Some(Ok(Answer::Done)));
    assert!(bench.open(LINK, 900).is_ok());
    assert_eq!(bench.ask_as(LINK, 1000, play), Some(Ok(Answer::Done)), "the answer is kept");
    assert_eq!(bench.ask_as(LINK, 1002, play), Some(Err(Refusal::Command(CommandError::Stopped))));
    assert_eq!(bench.status().phase, Phase::Idle);
    assert_eq!(bench.events().iter().filter(|event| **event == Event::Started).count(), 1);
}

#[test]
fn a_change_whose_number_has_gone_half_round_is_refused_and_a_new_connection_helps() {
    let bench = loaded();
    let (clear, late) = (Request::Command(Command::Clear), 100u16.wrapping_add(33_000));
    assert_eq!(bench.ask_as(LINK, 100, clear), Some(Ok(Answer::Done)));
    assert_eq!(bench.ask_as(LINK, late, clear), Some(Err(Refusal::NotConnected)));
    assert!(bench.open(9, late).is_ok());
    assert_eq!(bench.ask_as(9, late.wrapping_add(1), clear), Some(Ok(Answer::Done)));
}

#[test]
fn only_the_host_that_connected_last_is_heard() {
    let bench = loaded();
    let stop = Request::Command(Command::Stop);
    let clear = Request::Command(Command::Clear);
    assert_eq!(bench.ask_as(1, 1, clear), Some(Err(Refusal::NotConnected)));
    assert!(bench.open(1, 2).is_ok());
    assert_eq!(bench.ask_as(1, 3, clear), Some(Ok(Answer::Done)));
    assert_eq!(bench.ask(clear), Err(Refusal::NotConnected));
    assert_eq!(bench.ask(stop), Ok(Answer::Done), "a stop is never refused");
    let other = bench.ask_as(5, 4, Request::Hello { protocol: PROTOCOL + 1, challenge: 0 });
    assert_eq!(other, Some(Err(Refusal::Protocol { board: PROTOCOL })));
}

/// `Hello` of protocol version 4: request 0, version 4, nothing more.
#[test]
fn a_host_of_another_version_learns_that_of_the_board_whatever_its_hello_carries() {
    let bench = loaded();
    for payload in [&[0, 4][..], &[0, 6, 1, 2, 3]] {
        let answer = bench.send(Header { tag: REQUEST, link: 5, number: 4 }, payload).unwrap();
        let refused = Err(Refusal::Protocol { board: PROTOCOL });
        assert_eq!(postcard::from_bytes::<Reply>(&answer).unwrap().result, refused);
    }
}

#[test]
fn nothing_is_stored_while_a_program_runs() {
    let bench = loaded();
    bench.command(Command::Play).unwrap();
    bench.pass_ms(10);
    assert_eq!(bench.upload(&table(2, 4, false)), Err(Refusal::Busy));
    let calibration = Calibration::try_from([0.1; 4]).unwrap();
    assert_eq!(bench.ask(Request::Calibrate(calibration)), Err(Refusal::Busy));
    bench.command(Command::Stop).unwrap();
    let ask = |number, request| bench.ask_as(LINK + 1, number, request).unwrap();
    assert!(bench.open(LINK + 1, 0).is_ok());
    assert_eq!(ask(2, Request::Calibrate(calibration)), Ok(Answer::Done));
    assert_eq!(ask(3, Request::Calibration), Ok(Answer::Calibration(Some(calibration))));
}

#[test]
fn a_refused_table_leaves_the_old_one_loaded() {
    let bench = loaded();
    let (image, bytes) = table(2, 4, false);
    let damaged = (Image { digest: Digest([1; 32]), ..image }, bytes);
    assert_eq!(bench.upload(&damaged), Err(Refusal::Damaged));
    assert_eq!(bench.status().model, Some(table(1, 10, false).0.model));
    assert_eq!(bench.ask(Request::Commit(image)), Err(Refusal::NoUpload));
    assert_eq!(bench.command(Command::Play), Ok(Answer::Done));
}

#[test]
fn the_bootstrap_set_needs_no_connection() {
    let bench = loaded();
    bench.command(Command::Play).unwrap();
    bench.pass_ms(150);
    assert_ne!(bench.outputs.get().lines, 0);
    let send = |request: bootstrap::Request| {
        bench.send(Header { tag: request.tag(), link: 0, number: 9 }, request.payload()).unwrap()
    };
    assert_eq!(send(bootstrap::Request::Stop), [0, 1]);
    bench.tick();
    assert_eq!(bench.outputs.get().lines, 0);
    assert_eq!(Identity::decode(&send(bootstrap::Request::Identify)).unwrap().board, "bench");
    assert_eq!(bootstrap::Version::decode(&send(bootstrap::Request::Version)).unwrap().protocol, PROTOCOL);
    assert_eq!(bootstrap::CrashRecord::decode(&send(bootstrap::Request::ReadFault)), Some(None));
}

#[test]
fn typed_commands_act_under_the_same_limits() {
    let bench = loaded();
    assert_eq!(bench.type_line("coil 1 on 6000"), "? this coil may be on for at most 5000 ms\r\n");
    assert_eq!(bench.type_line("coil 1 on 100"), "ok\r\n");
    bench.pass_ms(50);
    assert_eq!(bench.outputs.get().lines, 2);
    bench.pass_ms(60);
    assert_eq!(bench.outputs.get().lines, 0);
    assert_eq!(bench.type_line("word 11"), "ok\r\n");
    bench.pass_ms(5);
    assert_eq!(bench.outputs.get().lines, 3);
    assert_eq!(bench.type_line("word 111"), "? no such coil, servo or word in the loaded wiring\r\n");
    assert!(bench.type_line("log").contains("booted"));
    let limits = bench.type_line("limits");
    assert!(limits.contains("coil 1: line 1; on for 5000 ms, 90 % of 60000 ms, 53"), "{limits}");
    assert!(bench.type_line("profile").contains("output 1: line 1; on for 5000 ms"));
    assert!(bench.type_line("table").contains("10 rows in 1.000 s"));
    assert!(bench.type_line("help").lines().count() > 12);
    assert_eq!(bench.type_line("? ok"), "");
}

#[test]
fn the_console_serves_both_languages_until_it_starts_anew() {
    let bench = loaded();
    let (input, output) = (Pipe::<1024>::new(), Pipe::<1024>::new());
    input.push_slice(b"\0\x01garbage\0id\rreboot\rid\r");
    let mut dispatcher = bench.dispatcher.borrow_mut();
    let served = async {
        let into = serve(dispatcher.as_mut().unwrap(), &mut PipeReader(&input), &mut PipeWriter(&output)).await;
        assert_eq!(into, bootstrap::RebootTarget::Application);
    };
    let text = RefCell::new(String::new());
    run(served, || {
        bench.tick();
        text.borrow_mut().extend(core::iter::from_fn(|| output.pop()).map(char::from));
    });
    assert!(text.borrow().starts_with("board bench, device 0707") && text.borrow().ends_with("ok, restarting\r\n"));
}

#[test]
fn a_word_that_is_none_does_not_reach_the_control_tick() {
    let bench = loaded();
    // Command, Word, 2 digits as the arm has actuators, and digit 63.
    let mut payload = [0; MAX_PAYLOAD];
    let used = postcard::to_slice(&(6u8, 4u8, 2u8, 3u128 << 126), &mut payload).unwrap();
    let answer = bench.send(Header { tag: REQUEST, link: LINK, number: 999 }, used).unwrap();
    assert_eq!(postcard::from_bytes::<Reply>(&answer).unwrap().result, Err(Refusal::Unknown));
    bench.pass_ms(5);
}

#[test]
fn a_store_that_cannot_be_read_can_be_used_again() {
    let cells = Cells::with_profile();
    cells.spoil_records();
    let bench = Bench::new(cells);
    bench.connect();
    assert!(bench.type_line("status").contains("writing the profile erases them"));
    assert_eq!(bench.upload(&table(1, 4, false)), Err(Refusal::Storage));
    assert_eq!(bench.upload(&profile_image(&profile())), Err(Refusal::NobodyPresent));
    bench.button.set(true);
    assert_eq!(bench.upload(&profile_image(&profile())), Ok(Answer::Done));
    let again = Bench::new(bench.cells);
    again.connect();
    assert_eq!(again.upload(&table(1, 4, false)), Ok(Answer::Committed { rows: 4 }));
}

#[test]
fn nobody_restarts_a_board_whose_program_runs() {
    let bench = loaded();
    bench.command(Command::Play).unwrap();
    bench.pass_ms(150);
    assert!(bench.type_line("reboot").starts_with('?'));
    let request = bootstrap::Request::Reboot(bootstrap::RebootTarget::Application);
    bench.send(Header { tag: request.tag(), link: 0, number: 9 }, request.payload());
    assert_eq!(bench.dispatcher.borrow_mut().as_mut().unwrap().restart_due(false), None);
}

fn hello(bench: &Bench) -> Hello {
    match bench.open(LINK, 1) {
        Ok(Answer::Hello(hello)) => hello,
        other => panic!("{other:?}"),
    }
}
