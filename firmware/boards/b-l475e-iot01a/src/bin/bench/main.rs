//! Exact instruction counts in QEMU of the real tasks: the longest control tick, the longest masked stretch, the stack; and of the
//! search for the nearest word. Those of kinematics and dynamics are in the image `kinematics`: one has no room for all.
//!
//! The tasks are those of the flashed image. A recorded upload in memory is fed into the console's receive queue as the
//! line would, 12 bytes a millisecond, then the table is played. Started with `-icount shift=6,sleep=off` the counts are
//! the same in every run. Prints `name value unit`, one a line, through semihosting.
#![no_std]
#![no_main]

use core::mem::MaybeUninit;

use cortex_m_semihosting::debug;
use darm_b_l475e_iot01a::flash::Flash;
use darm_b_l475e_iot01a::measure::{check, print};
use darm_b_l475e_iot01a::tasks::SHARED;
use darm_b_l475e_iot01a::{board, clocks, measure, tasks, time, uart};
use darm_core::actuator::{Leg, Platform, Stage};
use darm_core::nearest::{self, Coordinates, Frame, Module};
use darm_core::output::{
    ActuatorWiring, Coil, CoilLimit, Drive, LimitSwitch, MAX_ACTUATORS, MAX_INPUTS, MAX_LINES, MAX_SERVOS, ServoWiring,
    SwitchLimit, Wiring,
};
use darm_core::profile::Profile;
use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_core::sequencer::{Command, ServoSeen};
use darm_core::table::nearest_search::NearestSearch;
use darm_core::table::{Record, Row};
use darm_core::units::{Digest, Micros, ModelHash, Word};
use darm_core::wire::PROTOCOL;
use darm_core::wire::frame::{self, Header, MAX_FRAME, MAX_PAYLOAD};
use darm_core::wire::message::{CHUNK, Image, ImageKind, REQUEST, Request};
use darm_firmware::clock::Clock;
use darm_firmware::cortex;
use darm_firmware::life::Start;
use darm_firmware::stack::StackMemory;
use darm_firmware::store::Store;
use defmt_rtt as _;
use serde::Serialize;
use sha2::{Digest as _, Sha256};

/// The planar arm of four modules, and all that a board drives; the last one in bursts: three rows 1 ms apart switch every output
/// on, and one switches all of them off as soon as a table may.
const ARMS: [(&str, usize, usize, bool); 3] = [
    ("arm_12", 12, 0, false),
    ("arm_full", MAX_ACTUATORS, MAX_SERVOS, false),
    ("arm_burst", MAX_ACTUATORS, MAX_SERVOS, true),
];
const ROWS: u32 = 40;
/// An output of the smaller arm has a peak in every second row, and no sooner than 52 ms after the last one.
const ROW_MS: u32 = 30;
/// From the first row of a burst to its last: a turn of the meters of all outputs and the time of a late row behind the third.
const BURST_MS: u32 = 16;
/// Uploads that only fill the flash.
const STORES: u32 = 10;
/// Plays of an arm, and by how many wake-ups of 500 µs each is shifted more than the one before: where windows of the meters,
/// turns of the meters, refreshes of the chain and requests fall into a row is different in each.
const PLAYS: u32 = 24;
const SHIFT_WAKES: u32 = 7;
/// Actuators that change in one row.
const CHANGING: usize = 16;
/// Most actuators of an arm whose modules the recorded upload has room for: it asks for the nearest word, too.
const MODULED: usize = 12;
/// What 115 200 baud carry between two wake-ups of the main thread, 500 µs.
const BYTES_PER_WAKE: usize = 6;
const SERVO_RAD: f32 = 0.2;

/// The recorded upload. The RAM that is cleared at the start has no room for it, see `board.x`.
#[unsafe(link_section = ".above.RECORDED")]
static mut TABLE: MaybeUninit<Recorded> = MaybeUninit::uninit();

/// Modules with six binary legs of the arm for which it is used.
const MODULES: usize = 6;

/// An image in the making.
struct Recorded {
    bytes: heapless::Vec<u8, 2304>,
    kind: ImageKind,
    model: ModelHash,
}

impl Recorded {
    fn new(kind: ImageKind, model: u64) -> Self {
        Self { bytes: heapless::Vec::new(), kind, model: ModelHash(model) }
    }

    fn push(&mut self, record: &impl Serialize) {
        let mut bytes = [0; Record::MAX_BYTES];
        let used = postcard::to_slice(record, &mut bytes).map_or(&[][..], |used| used);
        check("a record fits", !used.is_empty() && self.bytes.extend_from_slice(used).is_ok());
    }

    fn image(&self) -> Image {
        let digest = Digest(Sha256::digest(&self.bytes).into());
        Image { kind: self.kind, len: self.bytes.len() as u32, digest, model: self.model }
    }
}

const LIMIT: CoilLimit = CoilLimit { max_on_ms: 60_000, duty_percent: 90, window_ms: 2_000 };
const SUPPLY: SwitchLimit = SwitchLimit { new_coils: CHANGING as u8, window_ms: 1 };

/// As many coils as there are lines for pull in with a peak.
fn coil(output: u8) -> Coil {
    let peaks = (MAX_LINES - MAX_ACTUATORS).min(CHANGING) as u8;
    let drive = if output < peaks {
        Drive::PeakHold { pull: output, hold: MAX_ACTUATORS as u8 + output, peak_ms: 5 }
    } else {
        Drive::Hold { line: output }
    };
    Coil { output, drive, limit: LIMIT }
}

/// Nothing moves the inputs: the switches are open in every state.
fn actuator(output: u8) -> ActuatorWiring {
    let switch = (usize::from(output) < MAX_INPUTS).then_some(LimitSwitch { input: output, closed_in: 0 });
    ActuatorWiring { states: 2, switch, travel_ms: 1 }
}

fn servo(index: u8) -> ServoWiring {
    let (min_rad, max_rad, max_speed_rad_s, max_torque) = (-1.5, 1.5, 3.0, 0.5);
    ServoWiring { id: 1 + index, min_rad, max_rad, max_speed_rad_s, max_torque, timeout_ms: 500 }
}

/// The profile that allows both arms.
fn profile() -> Recorded {
    let mut wiring = Wiring { switch_limit: SUPPLY, ..Wiring::default() };
    wiring.coils.extend((0..MAX_ACTUATORS as u8).map(coil));
    wiring.actuators.extend((0..MAX_ACTUATORS as u8).map(actuator));
    wiring.servos.extend((0..MAX_SERVOS as u8).map(servo));
    let mut recorded = Recorded::new(ImageKind::Profile, 0);
    Profile::of(&wiring).records().for_each(|record| recorded.push(&record));
    recorded
}

/// Puts the profile where a start finds it.
#[inline(never)]
fn store_profile() -> Digest {
    let recorded = profile();
    let stored = embassy_futures::block_on(async {
        let flash = Flash::open().ok()?;
        let mut store = Store::open(flash).await;
        store.begin(recorded.image()).await.ok()?;
        store.chunk(0, &recorded.bytes).await.ok()?;
        store.commit().await.ok()
    });
    check("the profile is stored", stored.is_some());
    recorded.image().digest
}

/// The recorded upload, in place of the one before: the stack has no room for it.
fn record(table: &mut Recorded, profile: Digest, actuators: usize, servos: usize, in_bursts: bool) {
    table.bytes.clear();
    table.model = ModelHash(actuators as u64);
    table.push(&Record::Start { model: table.model, device: None, profile, switch_limit: SUPPLY });
    for index in 0..actuators as u8 {
        table.push(&Record::Coil(coil(index)));
        table.push(&Record::Actuator(actuator(index)));
    }
    (0..servos as u8).for_each(|index| table.push(&Record::Servo(servo(index))));
    if actuators <= MODULED {
        push_modules(table, actuators);
    }
    push_rows(table, actuators, servos, in_bursts);
}

/// Modules of two actuators, with as many frames as those have words.
fn push_modules(table: &mut Recorded, actuators: usize) {
    let at = |x: f32| Coordinates { turn_rad: [0.0, 0.0, 0.1 * x], position_m: [x, 1.0, 0.0] };
    for left in (0..actuators / 2).rev() {
        table.push(&Record::Module { actuators: 2, length_scale_m: 0.5, behind: at(0.2 * left as f32) });
        for digits in [0b0000, 0b0001, 0b0100, 0b0101] {
            table.push(&Record::Frame { digits, pose: at(0.1 * f32::from(digits)) });
        }
    }
}

fn push_rows(table: &mut Recorded, actuators: usize, servos: usize, in_bursts: bool) {
    let zeros = Word::zeros(actuators as u8).unwrap_or_default();
    let mut word = zeros;
    for row in 0..ROWS {
        let (step, first) = (row % 4, row as usize * CHANGING);
        for index in (first..first + CHANGING.min(actuators)).map(|index| index % actuators) {
            word = word.with_digit(index, if in_bursts { 1 } else { 1 - word.digit(index) });
        }
        word = if in_bursts && step == 3 { zeros } else { word };
        let in_burst_ms = if step == 3 { BURST_MS } else { step };
        let at_ms = if in_bursts { (row - step) * ROW_MS + in_burst_ms } else { row * ROW_MS };
        let angles = core::iter::repeat_n(SERVO_RAD, servos).collect();
        table.push(&Record::Row(Row { at: Micros::from_millis(at_ms), word, servos: angles }));
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
            self.send(Request::Nearest(Coordinates { turn_rad: [0.0; 3], position_m: [1.0, 5.0, 0.0] }));
            (0..80).for_each(|_| wait_a_wake());
        }
    }

    fn upload(&mut self, table: &Recorded) {
        let image = table.image();
        // The first challenge of the first start.
        self.send(Request::Hello { protocol: PROTOCOL, challenge: 1 << 32 });
        self.send(Request::Begin(image));
        for (bytes, offset) in table.bytes.chunks(CHUNK).zip((0u32..).step_by(CHUNK)) {
            self.send(Request::Chunk { offset, bytes });
        }
        self.send(Request::Commit(image));
        self.watch(100);
    }

    fn play(&mut self) {
        for shift in 0..PLAYS {
            (0..SHIFT_WAKES * shift).for_each(|_| wait_a_wake());
            self.send(Request::Command(Command::Play));
            self.watch(ROWS * ROW_MS + 200);
        }
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

/// A six-legged module: pairs of anchors on circles of 0.25 m and 0.18 m, turned by 60°, plates 0.3 m apart.
fn six_legs() -> Stage<f32> {
    let on_circle = |radius: f32, (cosine, sine): (f32, f32)| Vec3::new(radius * cosine, radius * sine, 0.0);
    // Cosine and sine of −15°, 15°, 105°, 135°, 225°, 255° for the base, of −45°, 45°, 75°, 165°, 195°, 285° for the top.
    const BASE: [(f32, f32); 6] =
        [(0.966, -0.259), (0.966, 0.259), (-0.259, 0.966), (-0.707, 0.707), (-0.707, -0.707), (-0.259, -0.966)];
    const TOP: [(f32, f32); 6] =
        [(0.707, -0.707), (0.707, 0.707), (0.259, 0.966), (-0.966, 0.259), (-0.966, -0.259), (0.259, -0.966)];
    let home = Pose::at(Vec3::new(0.0, 0.0, 0.3));
    let legs = core::array::from_fn(|k| {
        let (base, top) = (on_circle(0.25, BASE[k]), on_circle(0.18, TOP[k]));
        let length = (home * top - base).norm();
        Leg { base, top, length_m: [length, 1.25 * length, 0.0, 0.0], states: 2 }
    });
    Stage::Spatial(Platform { legs, home })
}

/// The end frame of a word by look-ups, and the nearest word out of 64⁶ by the board's search.
#[inline(never)]
fn measure_nearest(room: &mut NearestSearch) {
    let (typical, target) = measure_look_up();
    measure_search(room, &typical, &target);
}

/// A pose amid those of a module, and the pose that is looked up.
#[inline(never)]
fn measure_look_up() -> (Pose<f32>, Pose<f32>) {
    let (stage, one) = (six_legs(), Pose::identity());
    let frames: heapless::Vec<Frame<f32>, 64> = nearest::frames(&stage, &one, &one).collect();
    check("a module has 64 frames", frames.len() == 64);
    let module = Module { frames: &frames, actuators: 6, typical: nearest::typical(&frames) };
    let modules = [module; MODULES];
    let word = (0..36).step_by(2).fold(Word::zeros(36).unwrap_or_default(), |word, leg| word.with_digit(leg, 1));
    let mut target = None;
    let look_up = measure::instructions(|| target = nearest::pose_base_tool(&modules, &word));
    print("nearest", "end_frame_of_six_modules", look_up, "instructions");
    print("nearest", "room", size_of::<NearestSearch>(), "bytes");
    (module.typical, target.unwrap_or(one))
}

#[inline(never)]
fn measure_search(room: &mut NearestSearch, typical: &Pose<f32>, target: &Pose<f32>) {
    let (stage, one) = (six_legs(), Pose::identity());
    let (mut piece, mut beam) = (0, 0);
    room.begin(target, 6 * MODULES);
    for behind in (0..MODULES).rev() {
        room.module(6, &(0..behind).fold(one, |tail, _| tail * *typical), 0.5);
        for frame in nearest::frames(&stage, &one, &one) {
            let count = measure::instructions(|| room.offer(&frame));
            (piece, beam) = (piece.max(count), beam + count);
        }
    }
    let distance_mm = |room: &NearestSearch| room.found().map_or(-1.0, |found| 1e3 * found.distance_m);
    print("nearest", "a_frame_behind_all_choices", piece, "instructions");
    print("nearest", "beam_out_of_64^6", beam, "instructions");
    print("nearest", "beam_distance", distance_mm(room), "mm");
    let (mut longest, mut total, mut more) = (0, 0, true);
    while more {
        let count = measure::instructions(|| more = room.step());
        (longest, total) = (longest.max(count), total + count);
    }
    print("nearest", "longest_piece_of_the_wider_search", longest, "instructions");
    print("nearest", "wider_search_out_of_64^6", total, "instructions");
    print("nearest", "distance", distance_mm(room), "mm");
}

#[inline(never)]
fn measure_all(stack: &StackMemory, profile: Digest) {
    measure::take();
    critical_section::with(|_| ());
    let overhead = measure::take().masked;
    let mut host = Host { number: 0 };
    // After power-up every output counts as used to its limit.
    host.watch(2 * LIMIT.window_ms);
    print("start", "control_tick", measure::take().tick, "instructions");
    let table = &raw mut TABLE;
    // SAFETY: nothing else refers to it, as this is called once.
    let table = unsafe { (*table).write(Recorded::new(ImageKind::Table, 0)) };
    for (name, actuators, servos, in_bursts) in ARMS {
        record(table, profile, actuators, servos, in_bursts);
        host.watch(50);
        measure::take();
        host.upload(table);
        host.play();
        let measured = measure::take();
        check("every coil was driven", measured.lines_seen.count_ones() as usize >= actuators.min(32));
        check("no fault was latched", measured.enables >= PLAYS);
        print(name, "control_tick", measured.tick, "instructions");
        print(name, "masked", measured.masked.saturating_sub(overhead), "instructions");
        print(name, "systick_handler", measured.handler, "instructions");
    }
    let [.., (_, actuators, servos, in_bursts)] = ARMS;
    record(table, profile, actuators, servos, in_bursts);
    (0..STORES).for_each(|_| host.upload(table));
    print("board", "stack", stack.usage().used, "bytes");
    print_lateness();
}

/// Percentiles of how late ticks started, which mean something in free-running QEMU.
fn print_lateness() {
    for (when, lateness) in ["outside_stores", "during_a_store"].into_iter().zip(&measure::LATENESS) {
        print("lateness", format_args!("{when}_count"), lateness.ticks(), "ticks");
        for percent in [50, 99, 100] {
            print("lateness", format_args!("{when}_{percent}_%"), lateness.percentile(percent).0, "us");
        }
    }
}

#[cortex_m_rt::entry]
fn main() -> ! {
    let stack = cortex::paint_stack();
    check("the clock starts", clocks::start().is_ok());
    time::start();
    board::prioritise();
    // The stack has no room for a second one.
    let room = tasks::room();
    measure_nearest(room);
    print("nearest", "stack", stack.usage().used, "bytes");
    let profile = store_profile();
    // The measurements above had the stack of the thread to themselves, as no image does.
    let stack = cortex::paint_stack();
    tasks::start(None, Start::Normal, room);
    measure_all(&stack, profile);
    debug::exit(debug::EXIT_SUCCESS);
    loop {
        cortex_m::asm::wfi();
    }
}
