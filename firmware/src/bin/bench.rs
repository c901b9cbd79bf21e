//! Exact instruction counts of the real tasks in QEMU: the longest control tick, the longest masked stretch, the stack.
//!
//! The tasks are those of the flashed image. A recorded upload in memory is fed into the console's receive queue as the
//! line would, 12 bytes a millisecond, then the table is played. Started with `-icount shift=6,sleep=off` the counts are
//! the same in every run. Prints `name value unit`, one a line, through semihosting.
#![no_std]
#![no_main]

use core::fmt::Display;

use cortex_m_semihosting::{debug, hprintln};
use darm_core::output::{
    ActuatorWiring, Coil, CoilLimit, Drive, LimitSwitch, MAX_ACTUATORS, MAX_LINES, MAX_SERVOS, ServoWiring, SwitchLimit,
};
use darm_core::sequencer::{Command, ServoSeen};
use darm_core::table::{Record, Row};
use darm_core::units::{Micros, ModelHash, Word};
use darm_core::wire::PROTOCOL;
use darm_core::wire::frame::{self, CRC, Header, MAX_FRAME, MAX_PAYLOAD};
use darm_core::wire::message::{CHUNK, Image, REQUEST, Request};
use darm_firmware::board::measure::Stack;
use darm_firmware::board::tasks::SHARED;
use darm_firmware::board::{self, clocks, death, measure, tasks, time, uart};
use darm_firmware::clock::Clock;
use defmt_rtt as _;

/// The planar arm of four modules, and all that a board drives.
const ARMS: [(&str, usize, usize); 2] = [("arm_12", 12, 0), ("arm_full", MAX_ACTUATORS, MAX_SERVOS)];
const ROWS: u32 = 40;
const ROW_MS: u32 = 20;
/// Uploads that only fill the flash.
const STORES: u32 = 10;
/// Actuators that change in one row.
const CHANGING: usize = 16;
/// What 115 200 baud carry between two wake-ups of the main thread, 500 µs.
const BYTES_PER_WAKE: usize = 6;
const SERVO_RAD: f32 = 0.2;

fn check(what: &str, holds: bool) {
    if !holds {
        hprintln!("failed: {}", what);
        debug::exit(debug::EXIT_FAILURE);
    }
}

/// A table image in the making.
struct Recorded {
    bytes: heapless::Vec<u8, 4096>,
    model: ModelHash,
}

impl Recorded {
    fn push(&mut self, record: &Record) {
        let mut bytes = [0; Record::MAX_BYTES];
        let used = postcard::to_slice(record, &mut bytes).map_or(&[][..], |used| used);
        check("a record fits", !used.is_empty() && self.bytes.extend_from_slice(used).is_ok());
    }

    fn image(&self) -> Image {
        Image { len: self.bytes.len() as u32, crc: CRC.checksum(&self.bytes), model: self.model }
    }
}

/// The recorded upload: as many coils as there are lines for pull in with a peak.
fn record(actuators: usize, servos: usize) -> Recorded {
    let mut table = Recorded { bytes: heapless::Vec::new(), model: ModelHash(actuators as u64) };
    let switch_limit = SwitchLimit { new_coils: CHANGING as u8, window_ms: 5 };
    table.push(&Record::Start { model: table.model, device: None, switch_limit });
    let limit = CoilLimit { max_on_ms: 60_000, duty_percent: 90, window_ms: 120_000 };
    let peaks = MAX_LINES.saturating_sub(actuators).min(CHANGING) as u8;
    for index in 0..actuators as u8 {
        let drive = if index < peaks {
            Drive::PeakHold { pull: index, hold: actuators as u8 + index, peak_ms: 5 }
        } else {
            Drive::Hold { line: index }
        };
        table.push(&Record::Coil(Coil { drive, limit }));
        // Nothing moves the inputs: these switches are open in every state.
        let switch = (index < 32).then_some(LimitSwitch { input: index, closed_in: 0 });
        table.push(&Record::Actuator(ActuatorWiring { states: 2, switch, travel_ms: 10 }));
    }
    for id in 0..servos as u8 {
        let (min_rad, max_rad, max_speed_rad_s, max_torque) = (-1.5, 1.5, 3.0, 0.5);
        table.push(&Record::Servo(ServoWiring { id, min_rad, max_rad, max_speed_rad_s, max_torque, timeout_ms: 500 }));
    }
    push_rows(&mut table, actuators, servos);
    table
}

fn push_rows(table: &mut Recorded, actuators: usize, servos: usize) {
    let mut word = Word::zeros(actuators as u8).unwrap_or_default();
    for row in 0..ROWS {
        let first = row as usize * CHANGING;
        for index in (first..first + CHANGING.min(actuators)).map(|index| index % actuators) {
            word = word.with_digit(index, 1 - word.digit(index));
        }
        let angles = core::iter::repeat_n(SERVO_RAD, servos).collect();
        table.push(&Record::Row(Row { at: Micros::from_millis(row * ROW_MS), word, servos: angles }));
    }
    table.push(&Record::End { at: Micros::from_millis(ROWS * ROW_MS) });
}

/// The host's end of the line.
struct Host {
    number: u16,
}

impl Host {
    /// Feeds a request as the line would bring it.
    fn send(&mut self, request: Request) {
        let (mut payload, mut frame) = ([0; MAX_PAYLOAD], [0; MAX_FRAME]);
        self.number += 1;
        let header = Header { tag: REQUEST, link: 1, number: self.number };
        let payload = postcard::to_slice(&request, &mut payload).map_or(&[][..], |used| used);
        let len = frame::encode(header, payload, &mut frame).unwrap_or(0);
        check("a request fits", len > 0);
        for part in frame[..len].chunks(BYTES_PER_WAKE) {
            uart::CONSOLE.received.push_slice(part);
            wait_a_wake();
        }
    }

    /// Asks now and then while the board runs.
    fn watch(&mut self, millis: u32) {
        for _ in 0..millis / 50 {
            self.send(Request::Status);
            self.send(Request::Events { from: 0 });
            (0..80).for_each(|_| wait_a_wake());
        }
    }

    fn upload(&mut self, table: &Recorded) {
        let image = table.image();
        self.send(Request::Hello { protocol: PROTOCOL });
        self.send(Request::Begin(image));
        for (bytes, offset) in table.bytes.chunks(CHUNK).zip((0u32..).step_by(CHUNK)) {
            self.send(Request::Chunk { offset, bytes });
        }
        self.send(Request::Commit(image));
        self.watch(100);
    }

    fn play(&mut self) {
        self.send(Request::Command(Command::Play));
        self.watch(ROWS * ROW_MS + 200);
    }
}

/// Sleeps until the next interrupt; the servos answer meanwhile.
fn wait_a_wake() {
    let answered = Some(time::BoardClock.now());
    for index in 0..MAX_SERVOS {
        SHARED.see_servo(index, ServoSeen { angle_rad: SERVO_RAD, load: 0.1, error: 0, answered });
    }
    cortex_m::asm::wfi();
}

fn tell(arm: &str, name: impl Display, value: impl Display, unit: &str) {
    hprintln!("{}.{} {} {}", arm, name, value, unit);
}

#[inline(never)]
fn measure_all(stack: &Stack) {
    measure::take();
    critical_section::with(|_| ());
    let overhead = measure::take().masked;
    let mut host = Host { number: 0 };
    for (name, actuators, servos) in ARMS {
        let table = record(actuators, servos);
        host.watch(50);
        measure::take();
        host.upload(&table);
        host.play();
        let measured = measure::take();
        check("every coil was driven", measured.lines_seen.count_ones() as usize >= actuators.min(32));
        check("no fault was latched", measured.enabled);
        tell(name, "control_tick", measured.tick, "instructions");
        tell(name, "masked", measured.masked.saturating_sub(overhead), "instructions");
        tell(name, "systick_handler", measured.handler, "instructions");
    }
    let [.., (_, actuators, servos)] = ARMS;
    let table = record(actuators, servos);
    (0..STORES).for_each(|_| host.upload(&table));
    tell("board", "stack", stack.used(), "bytes");
    tell_lateness();
}

/// Percentiles of how late ticks started, which mean something in free-running QEMU.
fn tell_lateness() {
    for (when, lateness) in ["outside_stores", "during_a_store"].into_iter().zip(&measure::LATENESS) {
        tell("lateness", format_args!("{when}_count"), lateness.ticks(), "ticks");
        for percent in [50, 99, 100] {
            tell("lateness", format_args!("{when}_{percent}_%"), lateness.percentile(percent).0, "us");
        }
    }
}

#[cortex_m_rt::entry]
fn main() -> ! {
    let stack = Stack::paint();
    check("the clock starts", clocks::start().is_ok());
    time::start();
    board::prioritise();
    tasks::start(death::take());
    measure_all(&stack);
    debug::exit(debug::EXIT_SUCCESS);
    loop {
        cortex_m::asm::wfi();
    }
}
