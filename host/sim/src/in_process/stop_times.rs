//! How long each form of a stop takes in each state of the board, in virtual ms: the table of docs/safety.md.
//!
//! `cargo xtask faults --stop-times COUNT` has COUNT stops of each form in each state. The time runs from the last byte of the stop, or from
//! the contact of the emergency input.

use darm_core::nearest::Coordinates;
use darm_core::output::{ActuatorWiring, Coil, CoilLimit, Drive, ServoWiring, Wiring};
use darm_core::profile::{EmergencyStop, Profile};
use darm_core::sequencer::Command;
use darm_core::table::{Record, Row, head};
use darm_core::units::{Micros, ModelHash, Word};
use darm_core::wire::PROTOCOL;
use darm_core::wire::bootstrap;
use darm_core::wire::frame::{self, Header, MAX_FRAME, MAX_PAYLOAD};
use darm_core::wire::message::{CHUNK, REQUEST, Refusal, Reply, Request};

use super::{Bench, MemoryFlash, Physical};
use crate::plant::{Broken, Plant};
use darm_arm::board_profile::BoardProfile;
use darm_arm::image::UploadImage;

/// Input of the emergency stop, which is pressed while it is closed.
const EMERGENCY: u8 = 7;
const SERVOS: u8 = 4;
/// Longest wait for what a stop is to do.
const LIMIT_MS: u32 = 400;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    Typed,
    Bootstrap,
    Message,
    Emergency,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    Idle,
    Playing,
    Uploading,
    Printing,
    Searching,
    BusyBus,
    OtherHost,
    Starting,
}

const FORMS: [Form; 4] = [Form::Typed, Form::Bootstrap, Form::Message, Form::Emergency];
const STATES: [State; 8] = [
    State::Idle,
    State::Playing,
    State::Uploading,
    State::Printing,
    State::Searching,
    State::BusyBus,
    State::OtherHost,
    State::Starting,
];

impl Form {
    const fn name(self) -> &'static str {
        match self {
            Self::Typed => "typed",
            Self::Bootstrap => "bootstrap",
            Self::Message => "message",
            Self::Emergency => "emergency input",
        }
    }
}

impl State {
    const fn name(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Playing => "playing",
            Self::Uploading => "uploading",
            Self::Printing => "printing help",
            Self::Searching => "searching",
            Self::BusyBus => "three servos silent",
            Self::OtherHost => "other host connected",
            Self::Starting => "starting",
        }
    }
}

fn wiring() -> Wiring {
    let mut wiring = Wiring::default();
    for line in 0..4 {
        let drive = Drive::Hold { line };
        let limit = CoilLimit { duty_percent: 100, ..drive.default_limit() };
        wiring.coils.push(Coil { output: line, drive, limit }).unwrap();
        wiring.actuators.push(ActuatorWiring { states: 2, switch: None, travel_ms: 100 }).unwrap();
    }
    for id in 1..=SERVOS {
        let (max_speed_rad_s, max_torque, timeout_ms) = (2.0, 0.8, 200);
        let joint = ServoWiring { id, min_rad: -1.5, max_rad: 1.5, max_speed_rad_s, max_torque, timeout_ms };
        wiring.servos.push(joint).unwrap();
    }
    wiring
}

fn profile() -> BoardProfile {
    let emergency_stop = Some(EmergencyStop { input: EMERGENCY, opens: false });
    BoardProfile::new("stop times", Profile { emergency_stop, ..Profile::of(&wiring()) })
}

fn along(x: f32) -> Coordinates {
    Coordinates { turn_rad: [0.0; 3], position_m: [x, 0.0, 0.0] }
}

/// Rows every 100 ms in which something is always on and the servos go to and fro; frames of four modules.
fn table() -> UploadImage {
    let (wiring, model) = (wiring(), ModelHash(9));
    let mut records: Vec<Record> = head(&wiring, model, None, profile().profile.digest).collect();
    for module in 0..4 {
        records.push(Record::Module { actuators: 1, length_scale_m: 0.5, behind: along(1.5 * (3 - module) as f32) });
        records.extend([0, 1].map(|digits| Record::Frame { digits, pose: along(1.0 + f32::from(digits)) }));
    }
    for row in 0..40u64 {
        let word = Word::new(&[1, (row & 1) as u8, (row >> 1 & 1) as u8, 0]).unwrap();
        let servos = [0.1 * (row / 10 % 2) as f32; SERVOS as usize].into_iter().collect();
        records.push(Record::Row(Row { at: Micros(100_000 * row), word, servos }));
    }
    records.push(Record::End { at: Micros(4_000_000) });
    UploadImage::table(&records, model)
}

fn framed(header: Header, payload: &[u8]) -> Vec<u8> {
    let mut bytes = [0; MAX_FRAME];
    let len = frame::encode(header, payload, &mut bytes).unwrap();
    bytes[..len].to_vec()
}

struct Random(u64);

impl Random {
    fn below(&mut self, n: u32) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as u32 % n
    }
}

struct Rig {
    bench: Bench,
    link: u32,
    number: u16,
    random: Random,
}

/// Times in ms.
#[derive(Clone, Copy, Debug, Default)]
struct Times {
    pins: u32,
    servos: u32,
    answer: u32,
}

impl Rig {
    fn new(seed: u64) -> Self {
        let plant = Plant::new(&wiring(), &[]);
        let bench = Bench::new(plant, MemoryFlash::with_profile(&profile().image()));
        let mut rig = Self { bench, link: 1, number: 0, random: Random(seed) };
        rig.pass(100);
        rig.connect();
        rig.upload();
        rig
    }

    fn pass(&mut self, millis: u32) {
        (0..millis).for_each(|_| self.bench.step());
        self.bench.take_happened();
        self.bench.received().clear();
    }

    fn request(&mut self, request: Request<'_>) -> Vec<u8> {
        self.number = self.number.wrapping_add(1);
        let mut payload = [0; MAX_PAYLOAD];
        let used = postcard::to_slice(&request, &mut payload).unwrap();
        framed(Header { tag: REQUEST, link: self.link, number: self.number }, used)
    }

    fn send(&mut self, request: Request<'_>) {
        let bytes = self.request(request);
        self.bench.send(&bytes);
    }

    /// Sends it and lets it be done.
    fn done(&mut self, request: Request<'_>, millis: u32) {
        self.send(request);
        self.pass(millis);
    }

    fn connect(&mut self) {
        self.link += 1;
        self.open(self.link, 5);
    }

    /// Opens a connection as a client does, with the challenge that it is refused with first.
    fn open(&mut self, link: u32, millis: u32) {
        let hello = |challenge| {
            let mut payload = [0; MAX_PAYLOAD];
            let used = postcard::to_slice(&Request::Hello { protocol: PROTOCOL, challenge }, &mut payload).unwrap();
            framed(Header { tag: REQUEST, link, number: 1 }, used)
        };
        self.bench.received().clear();
        self.bench.send(&hello(0));
        (0..5).for_each(|_| self.bench.step());
        let received = self.bench.received().make_contiguous().to_vec();
        let refused = received.split(|byte| *byte == 0).find_map(|encoded| {
            let mut body = encoded.to_vec();
            let (header, payload) = frame::decode(&mut body).ok()?;
            let reply = postcard::from_bytes::<Reply>(payload).ok()?;
            if let (true, Err(Refusal::Challenge { challenge })) = (header.link == link, reply.result) {
                Some(challenge)
            } else {
                None
            }
        });
        self.bench.send(&hello(refused.expect("a `Hello` without a challenge is refused with it")));
        self.pass(millis);
    }

    fn upload(&mut self) {
        let table = table();
        self.done(Request::Begin(table.image()), 200);
        for (chunk, offset) in table.bytes().chunks(CHUNK).zip((0u32..).step_by(CHUNK)) {
            self.done(Request::Chunk { offset, bytes: chunk }, 20);
        }
        self.done(Request::Commit(table.image()), 400);
    }

    /// One output is on and the servos are on their way.
    fn move_by_hand(&mut self) {
        self.done(Request::Command(Command::Coil { coil: 0, on_ms: 1_000 }), 5);
        for servo in 0..SERVOS {
            let now_rad = self.bench.plant().state().servos_rad[usize::from(servo)];
            let angle_rad = if now_rad > 0.0 { -1.0 } else { 1.0 };
            self.done(Request::Command(Command::Servo { servo, angle_rad }), 5);
        }
        self.pass(40);
    }

    /// Brings the board into a state.
    fn enter(&mut self, state: State) {
        self.connect();
        self.done(Request::Command(Command::Clear), 5);
        match state {
            State::Idle => {}
            State::Playing => {
                self.done(Request::Command(Command::Play), 1_500);
                assert_ne!(self.bench.plant().lines(), 0, "the program runs");
            }
            State::Uploading => {
                let table = table();
                self.done(Request::Begin(table.image()), 200);
            }
            State::Printing | State::Searching | State::BusyBus | State::OtherHost | State::Starting => {
                self.move_by_hand();
            }
        }
        let wait_ms = self.random.below(30);
        match state {
            State::Uploading => {
                let bytes = table().bytes().to_vec();
                for offset in [0, CHUNK] {
                    let chunk = &bytes[offset..(offset + CHUNK).min(bytes.len())];
                    self.send(Request::Chunk { offset: offset as u32, bytes: chunk });
                }
                self.pass(wait_ms % 4);
            }
            State::Printing => {
                self.bench.send(b"help\r");
                self.pass(wait_ms % 12);
            }
            State::Searching => {
                (0..8).for_each(|number| self.send(Request::Nearest(along(4.0 + 0.3 * number as f32))));
                self.pass(wait_ms % 4);
            }
            State::BusyBus => {
                let now_s = self.bench.now_s();
                self.bench.plant_mut().set_broken(now_s, Broken { servos_silent: 0b1110, ..Broken::default() });
                self.pass(wait_ms + 30);
            }
            State::OtherHost => {
                self.open(0xffff_0000, wait_ms + 2);
            }
            // The lines went off with the reset; the servos are still on their way.
            State::Starting => {
                self.bench.reset();
                self.pass(wait_ms % 8);
            }
            State::Idle | State::Playing => self.pass(wait_ms),
        }
    }

    /// Stops, and sees when what has happened.
    fn stop(&mut self, form: Form, state: State) -> Times {
        self.bench.take_happened();
        self.bench.received().clear();
        let number = self.random.below(1 << 16) as u16;
        let bytes = match form {
            Form::Typed => b"stop\r".to_vec(),
            Form::Bootstrap => framed(Header { tag: bootstrap::Request::Stop.tag(), link: 0, number }, &[]),
            Form::Message => framed(Header { tag: REQUEST, link: self.link, number }, &[6, 1]),
            Form::Emergency => Vec::new(),
        };
        let answer = match form {
            Form::Typed => b"ok\r\n".to_vec(),
            Form::Bootstrap => {
                let tag = bootstrap::Request::Stop.tag() | bootstrap::ANSWER;
                framed(Header { tag, link: 0, number }, &[0, 1])
            }
            // Its time is not known: see `has_done`.
            Form::Message => vec![0],
            Form::Emergency => Vec::new(),
        };
        let moves = !matches!(state, State::Idle | State::Uploading);
        self.bench.send(&bytes);
        if form == Form::Emergency {
            self.bench.invert_switches(1 << EMERGENCY);
        }
        let (mut times, mut said) = (Times { pins: 0, servos: 0, answer: 0 }, Vec::new());
        let (mut is_low, mut is_ordered, mut is_answered) = (false, !moves, answer.is_empty());
        for ms in 1..=LIMIT_MS {
            self.bench.step();
            if !is_low && self.bench.plant().lines() == 0 {
                let is_safe_before = !moves || state == State::Starting;
                (is_low, times.pins) = (true, if is_safe_before { 0 } else { ms });
            }
            for happened in self.bench.take_happened() {
                if let Physical::Bus { to_servos: true, bytes } = happened {
                    // A write of a goal, with the torque in front of it or without.
                    let is_order = bytes.starts_with(&[0xff, 0xff, 1]) && matches!(bytes.get(4..6), Some([3, 40 | 41]));
                    if is_order && !is_ordered {
                        (is_ordered, times.servos) = (true, ms);
                    }
                }
            }
            said.extend(self.bench.received().drain(..));
            let is_heard = match form {
                Form::Message => has_done(&said, number),
                _ => said.windows(answer.len().max(1)).any(|window| window == answer),
            };
            if !is_answered && is_heard {
                (is_answered, times.answer) = (true, ms);
            }
            if is_low && is_ordered && is_answered {
                break;
            }
        }
        assert!(is_low && is_ordered && is_answered, "{form:?} while {state:?}: {is_low} {is_ordered} {is_answered}");
        times
    }

    /// At rest again.
    fn rest(&mut self) {
        self.bench.invert_switches(0);
        let now_s = self.bench.now_s();
        self.bench.plant_mut().set_broken(now_s, Broken::default());
        self.pass(300);
    }
}

/// Whether a reply with this number is among these bytes.
fn has_done(said: &[u8], number: u16) -> bool {
    said.split(|byte| *byte == 0).any(|encoded| {
        let mut encoded = encoded.to_vec();
        frame::decode(&mut encoded).is_ok_and(|(header, _)| header.tag == REQUEST | 0x80 && header.number == number)
    })
}

#[test]
fn every_form_of_a_stop_acts_in_every_state() {
    let count = std::env::var("DARM_STOP_TIMES").map_or(2, |count| count.parse().unwrap());
    for state in STATES {
        for form in FORMS {
            let mut rig = Rig::new(17 + 31 * state as u64 + form as u64);
            let mut worst = Times::default();
            for _ in 0..count {
                rig.enter(state);
                let Times { pins, servos, answer } = rig.stop(form, state);
                worst.pins = worst.pins.max(pins);
                worst.servos = worst.servos.max(servos);
                worst.answer = worst.answer.max(answer);
                rig.rest();
            }
            let name = format!("stop: {}, {}", form.name(), state.name());
            println!("FIGURE {name}: pins safe = {} ms", worst.pins);
            println!("FIGURE {name}: servos ordered = {} ms", worst.servos);
            println!("FIGURE {name}: answered = {} ms", worst.answer);
            assert!(worst.pins <= 5, "{name}: {worst:?}");
            assert!(worst.servos <= 100, "{name}: {worst:?}");
        }
    }
}
