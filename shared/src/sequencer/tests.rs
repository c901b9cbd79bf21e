//! Bench experiments on the state machine: a board is wired up, time passes, lines and switches are looked at.

extern crate std;
use std::boxed::Box;
use std::vec::Vec;

use super::{
    Command, CommandError, Event, FaultKind, Outputs, Phase, Seen, Sequencer, ServoAction, ServoSeen, ServoTarget,
};
use crate::duty::{DutyMeters, MeterLimit};
use crate::output::{ActuatorWiring, Coil, CoilLimit, Drive, LimitSwitch, ServoWiring, SwitchLimit};
use crate::profile::{EmergencyStop, Fallback, Profile};
use crate::table::{Board, Record, Row, Table, wiring};
use crate::units::{ActuatorId, Digest, Micros, ModelHash, Word};

mod limits;

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

    /// Lets so many milliseconds pass, in ticks of one.
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

fn row_with_servo(at_ms: u32, digits: &str, angle_rad: f32) -> Record {
    let servos = [angle_rad].into_iter().collect();
    Record::Row(Row { at: Micros::from_millis(at_ms), word: word(digits), servos })
}

fn end(at_ms: u32) -> Record {
    Record::End { at: Micros::from_millis(at_ms) }
}

fn two_valves(rows: &[Record]) -> Vec<Record> {
    let wiring =
        [start(), coil(0, Drive::Hold { line: 0 }), coil(1, Drive::Hold { line: 1 }), actuator(0), actuator(1)];
    wiring.into_iter().chain(rows.iter().cloned()).collect()
}

#[test]
fn rows_go_out_at_their_time_and_the_end_rests() {
    let mut bench = Bench::new(&two_valves(&[row(0, "10"), row(20, "11"), row(40, "01"), end(60)]));
    bench.command(Command::Play).unwrap();
    assert_eq!(bench.run(2).outputs.lines, 0b01);
    assert_eq!(bench.run(18).outputs.lines, 0b01);
    assert_eq!(bench.run(1).outputs.lines, 0b11);
    assert_eq!(bench.run(20).outputs.lines, 0b10);
    assert_eq!(bench.run(20).outputs.lines, 0);
    assert_eq!(bench.sequencer.phase(), Phase::Idle);
    let rows: Vec<_> = bench.events().into_iter().filter(|event| matches!(event, Event::Row { .. })).collect();
    assert_eq!(rows.len(), 3);
}

#[test]
fn nothing_is_enabled_before_the_first_command() {
    let mut bench = Bench::new(&two_valves(&[end(10)]));
    assert_eq!(bench.run(5).outputs, Outputs::default());
}

#[test]
fn a_switch_that_contradicts_latches_the_safe_state() {
    let mut bench = Bench::new(&two_valves(&[row(0, "10"), row(20, "11"), end(90)]));
    bench.follows = false;
    bench.seen.switches = 0b01;
    bench.command(Command::Play).unwrap();
    bench.run(25);
    assert_eq!(bench.fault(), None, "actuator 1 still travels");
    bench.run(20);
    let expected = FaultKind::Switch { actuator: ActuatorId(1), expected_closed: true, seen_closed: false };
    assert_eq!(bench.fault(), Some(expected));
    assert_eq!((bench.outputs.lines, bench.outputs.enabled), (0, false));
    assert_eq!(bench.command(Command::Play), Err(CommandError::Safe));
    bench.command(Command::Clear).unwrap();
    bench.command(Command::Play).unwrap();
}

#[test]
fn a_bounce_of_two_ticks_is_no_fault() {
    let mut bench = Bench::new(&two_valves(&[row(0, "10"), end(90)]));
    bench.command(Command::Play).unwrap();
    bench.run(30).follows = false;
    bench.seen.switches = 0;
    bench.run(1).follows = true;
    assert_eq!(bench.run(40).fault(), None);
}

#[test]
fn a_coil_left_on_by_hand_is_switched_off_at_its_limit() {
    let mut bench = Bench::new(&two_valves(&[end(10)]));
    bench.run(1).command(Command::Word(word("10"))).unwrap();
    assert_eq!(bench.run(102).outputs.lines, 0b01, "ticks may be 2 ms late");
    bench.run(2);
    assert_eq!(bench.fault(), Some(FaultKind::OnTooLong { output: 0 }));
    assert_eq!(bench.outputs.lines, 0);
}

#[test]
fn a_coil_by_hand_goes_off_by_itself() {
    let mut bench = Bench::new(&two_valves(&[end(10)]));
    bench.run(1).command(Command::Coil { coil: 1, on_ms: 20 }).unwrap();
    assert_eq!(bench.run(20).outputs.lines, 0b10);
    assert_eq!(bench.run(1).outputs.lines, 0);
    let too_long = bench.command(Command::Coil { coil: 1, on_ms: 101 });
    assert_eq!(too_long, Err(CommandError::OnTooLong { max_ms: 100 }));
    assert_eq!(bench.command(Command::Coil { coil: 2, on_ms: 1 }), Err(CommandError::NotWired));
}

#[test]
fn a_word_by_hand_is_fed_as_the_supply_allows() {
    let wiring = (0..4).map(|line| coil(line, Drive::Hold { line }));
    let records: Vec<_> = core::iter::once(start()).chain(wiring).chain((0..4).map(actuator)).collect();
    let mut bench = Bench::new(&[&records[..], &[end(10)]].concat());
    bench.run(1).command(Command::Word(word("1111"))).unwrap();
    assert_eq!(bench.run(1).outputs.lines, 0b0011);
    assert_eq!(bench.run(5).outputs.lines, 0b1111);
}

#[test]
fn peak_then_hold() {
    let drive = Drive::PeakHold { pull: 3, hold: 5, peak_ms: 8 };
    let mut bench = Bench::new(&[start(), coil(0, drive), actuator(5), row(0, "1"), end(50)]);
    bench.command(Command::Play).unwrap();
    assert_eq!(bench.run(2).outputs.lines, 0b10_1000);
    assert_eq!(bench.run(8).outputs.lines, 0b10_0000);
    assert_eq!(bench.run(50).outputs.lines, 0);
}

#[test]
fn a_latch_gets_pulses_and_is_set_whatever_it_was() {
    let drive = Drive::Latch { set: 0, reset: 1, pulse_ms: 5 };
    let quiet = Record::Actuator(ActuatorWiring { states: 2, switch: None, travel_ms: 5 });
    let mut bench = Bench::new(&[start(), coil(0, drive), quiet, row(0, "0"), row(20, "1"), end(40)]);
    bench.command(Command::Play).unwrap();
    assert_eq!(bench.run(2).outputs.lines, 0b10, "nobody knows how the latch stands");
    assert_eq!(bench.run(5).outputs.lines, 0);
    assert_eq!(bench.run(20).outputs.lines, 0b01);
    assert_eq!(bench.run(5).outputs.lines, 0, "no current between");
}

#[test]
fn more_latches_than_the_supply_feeds_at_once_are_set_before_the_first_row() {
    let latch = |index: u8| coil(index, Drive::Latch { set: 2 * index, reset: 2 * index + 1, pulse_ms: 3 });
    let quiet = |_| Record::Actuator(ActuatorWiring { states: 2, switch: None, travel_ms: 5 });
    let records: Vec<_> = core::iter::once(start()).chain((0..5).map(latch)).chain((0..5).map(quiet)).collect();
    let mut bench = Bench::new(&[&records[..], &[row(0, "10101"), end(20)]].concat());
    bench.command(Command::Play).unwrap();
    assert_eq!(bench.run(1).outputs.lines, 0b00_00_00_10_01);
    assert_eq!(bench.run(5).outputs.lines, 0b00_10_01_00_00, "two every 5 ms");
    assert_eq!(bench.run(5).outputs.lines, 0b01_00_00_00_00);
    assert_eq!(bench.sequencer.phase(), Phase::Approaching { since: bench.begun });
    bench.run(5);
    assert!(bench.events().contains(&Event::Started));
    assert_eq!(bench.run(30).fault(), None);
}

#[test]
fn stop_switches_off_at_once_and_a_fault_survives_it() {
    let mut bench = Bench::new(&two_valves(&[row(0, "11"), end(90)]));
    bench.command(Command::Play).unwrap();
    bench.run(5).command(Command::Stop).unwrap();
    assert_eq!(bench.run(1).outputs.lines, 0);
    assert!(bench.events().contains(&Event::Stopped));
    bench.command(Command::Play).unwrap();
    bench.follows = false;
    bench.seen.switches = 0;
    bench.run(30).command(Command::Stop).unwrap();
    assert!(bench.fault().is_some());
}

#[test]
fn without_a_table_nothing_plays() {
    let mut used = DutyMeters::default();
    let mut sequencer = Sequencer::new(&mut used);
    assert_eq!(sequencer.command(Command::Play), Err(CommandError::NoTable));
    assert_eq!(sequencer.command(Command::Coil { coil: 0, on_ms: 1 }), Err(CommandError::NoTable));
}

fn servo_arm() -> Bench {
    let servo =
        ServoWiring { id: 1, min_rad: -1.0, max_rad: 1.0, max_speed_rad_s: 2.0, max_torque: 0.5, timeout_ms: 20 };
    let at = |at_ms, angle| {
        let servos = heapless::Vec::from_slice(&[angle]).expect("one fits");
        Record::Row(Row { at: Micros::from_millis(at_ms), word: Word::default(), servos })
    };
    Bench::new(&[start(), Record::Servo(servo), at(0, 0.5), at(500, -0.4), end(900)])
}

impl Bench {
    fn servo(&mut self, angle_rad: f32) -> &mut Self {
        self.seen.servos[0] = ServoSeen { angle_rad, load: 0.1, error: 0, answered: Some(self.now) };
        self
    }
}

#[test]
fn rows_wait_until_the_servos_have_come_slowly_to_the_first() {
    let mut bench = servo_arm();
    bench.command(Command::Play).unwrap();
    for _ in 0..50 {
        bench.servo(0.0).run(1);
    }
    let target = bench.target().unwrap();
    assert_eq!((target.angle_rad, target.speed_rad_s), (0.5, 0.5));
    assert!(matches!(bench.sequencer.phase(), Phase::Approaching { .. }));
    bench.servo(0.495).run(2);
    assert!(matches!(bench.sequencer.phase(), Phase::Playing { .. }));
    assert_eq!(bench.target().unwrap().speed_rad_s, 2.0);
}

#[test]
fn a_silent_overloaded_or_faulty_servo_latches_the_safe_state() {
    type Break = fn(&mut ServoSeen);
    let faults: [(Break, FaultKind); 3] = [
        (|_| {}, FaultKind::ServoSilent { servo: 0 }),
        (|seen| seen.load = 0.9, FaultKind::ServoTorque { servo: 0, load: 0.9 }),
        (|seen| seen.error = 4, FaultKind::ServoError { servo: 0, bits: 4 }),
    ];
    for (break_it, expected) in faults {
        let mut bench = servo_arm();
        bench.command(Command::Play).unwrap();
        bench.servo(0.5).run(5);
        break_it(&mut bench.seen.servos[0]);
        assert_eq!(bench.run(25).fault(), Some(expected));
        assert_eq!(bench.outputs.servos[0], ServoAction::Hold);
    }
}

#[test]
fn a_table_is_handed_over_only_at_rest() {
    let mut bench = Bench::new(&two_valves(&[row(0, "10"), end(50)]));
    bench.command(Command::Play).unwrap();
    assert!(bench.run(5).sequencer.unload().is_none());
    assert!(bench.run(60).sequencer.unload().is_some());
}

fn servo(id: u8) -> Record {
    let (max_speed_rad_s, max_torque, timeout_ms) = (1.0, 0.5, 100);
    Record::Servo(ServoWiring { id, min_rad: 0.5, max_rad: 1.5, max_speed_rad_s, max_torque, timeout_ms })
}

fn one_servo() -> Bench {
    Bench::new(&[start(), servo(1), end(10)])
}

#[test]
fn a_manual_coil_goes_off_at_its_own_time() {
    let mut bench = Bench::new(&two_valves(&[end(10)]));
    bench.command(Command::Coil { coil: 0, on_ms: 20 }).unwrap();
    bench.run(5);
    bench.command(Command::Coil { coil: 1, on_ms: 20 }).unwrap();
    assert_eq!(bench.run(2).outputs.lines, 0b11);
    assert_eq!(bench.run(16).outputs.lines, 0b10, "the second command has not touched the first coil");
    assert_eq!(bench.run(10).outputs.lines, 0);
}

#[test]
fn a_coil_by_hand_does_not_oppose_the_other_coil_of_its_actuator() {
    let three_states = Record::Actuator(ActuatorWiring { states: 3, switch: None, travel_ms: 0 });
    let hold = |line| coil(line, Drive::Hold { line });
    let mut bench = Bench::new(&[start(), hold(0), hold(1), three_states, end(10)]);
    bench.command(Command::Coil { coil: 0, on_ms: 20 }).unwrap();
    bench.run(5);
    assert_eq!(bench.command(Command::Coil { coil: 1, on_ms: 20 }), Err(CommandError::NoSuchState));
    assert_eq!(bench.run(5).outputs.lines, 0b01);
    bench.run(20).command(Command::Coil { coil: 1, on_ms: 20 }).unwrap();
    assert_eq!(bench.run(5).outputs.lines, 0b10);
}

#[test]
fn a_manual_coil_is_on_for_its_time_however_long_the_supply_lets_it_wait() {
    let mut bench = Bench::new(&two_valves(&[end(10)]));
    bench.follows = false;
    bench.seen.switches = 0b11;
    bench.command(Command::Word(word("11"))).unwrap();
    bench.run(1).command(Command::Stop).unwrap();
    // The supply feeds two coils in 5 ms: the next one waits for longer than it is to be on.
    bench.run(1).command(Command::Coil { coil: 0, on_ms: 2 }).unwrap();
    let on_ms: u64 = (0..20).map(|_| bench.run(1).outputs.lines & 1).sum();
    assert_eq!(on_ms, 2);
}

#[test]
fn stop_ends_the_motion_of_a_servo() {
    let mut bench = one_servo();
    bench.answer(0.6);
    bench.command(Command::Servo { servo: 0, angle_rad: 1.4 }).unwrap_err();
    bench.run(1).command(Command::Servo { servo: 0, angle_rad: 1.4 }).unwrap();
    assert!(bench.run(5).target().is_some());
    bench.command(Command::Stop).unwrap();
    assert_eq!(bench.run(1).outputs.servos[0], ServoAction::Hold);
}

#[test]
fn a_servo_that_never_answered_gets_no_target() {
    let mut bench = one_servo();
    let refused = bench.command(Command::Servo { servo: 0, angle_rad: 1.0 });
    assert_eq!(refused, Err(CommandError::ServoSilent { servo: 0 }));
    assert_eq!(bench.run(5).target(), None);
}

#[test]
fn the_safe_state_has_no_target() {
    for (fallback, action) in [(Fallback::Hold, ServoAction::Hold), (Fallback::Release, ServoAction::Release)] {
        let records = two_valves(&[servo(1), row_with_servo(0, "10", 1.0), end(90)]);
        let mut bench = Bench::with(&records, |profile| profile.servos[0].fallback = fallback);
        bench.follows = false;
        bench.command(Command::Play).unwrap();
        bench.run(31_000);
        assert_eq!(bench.fault(), Some(FaultKind::ServoStalled { servo: 0 }));
        assert_eq!(bench.outputs.servos[0], action);
    }
}

#[test]
fn a_calibration_moves_no_servo_and_widens_no_range() {
    let mut bench = one_servo();
    bench.answer(1.0);
    bench.run(1).command(Command::Servo { servo: 0, angle_rad: 1.2 }).unwrap();
    assert_eq!(bench.sequencer.calibrate([0.4, 0.0, 0.0, 0.0]), Ok(()));
    assert_eq!(bench.run(1).outputs.servos[0], ServoAction::Hold);
    let refused = bench.command(Command::Servo { servo: 0, angle_rad: 1.2 });
    assert!(matches!(refused, Err(CommandError::ServoRange { .. })), "the shaft would turn to 1.6 rad: {refused:?}");
    bench.command(Command::Servo { servo: 0, angle_rad: 1.0 }).unwrap();
    assert!(bench.run(1).target().is_some_and(|target| (target.angle_rad - 1.4).abs() < 1e-6));
}

#[test]
fn a_table_whose_rows_leave_the_profile_range_does_not_play() {
    let mut bench = Bench::new(&[start(), servo(1), row_with_servo(0, "", 1.4), end(10)]);
    bench.sequencer.calibrate([0.2, 0.0, 0.0, 0.0]).unwrap();
    assert!(matches!(bench.command(Command::Play), Err(CommandError::ServoRange { .. })));
}

#[test]
fn a_pulse_that_is_cut_leaves_its_latch_unknown() {
    let latch = coil(0, Drive::Latch { set: 0, reset: 1, pulse_ms: 20 });
    let mut bench = Bench::new(&[start(), latch, actuator(0), end(10)]);
    bench.follows = false;
    bench.command(Command::Word(word("1"))).unwrap();
    bench.run(5);
    bench.command(Command::Stop).unwrap();
    bench.run(1);
    bench.command(Command::Word(word("1"))).unwrap();
    assert_eq!(bench.run(2).outputs.lines, 0b01, "the latch is set again: nobody knows how it stands");
}

/// Two tables for the same two outputs, the second with the actuators swapped.
#[test]
fn an_output_has_its_limit_whatever_table_drives_it() {
    let limit = CoilLimit { max_on_ms: 50_000, duty_percent: 50, window_ms: 100_000 };
    let coil = |output| Record::Coil(Coil { output, drive: Drive::Hold { line: output }, limit });
    let actuator = Record::Actuator(ActuatorWiring { states: 2, switch: None, travel_ms: 10 });
    let valves =
        |outputs: [u8; 2]| [start(), coil(outputs[0]), coil(outputs[1]), actuator.clone(), actuator.clone(), end(10)];
    let profile = profile(&valves([0, 1]));
    let profile = Box::leak(Box::new(profile));
    let mut sequencer = Sequencer::new(Box::leak(Box::default()));
    let (mut now, mut on_ms) = (Micros(0), 0);
    sequencer.configure(profile);
    rest(&mut sequencer, &mut now, 200);
    for (outputs, digits) in [([0, 1], "10"), ([1, 0], "01")] {
        let _ = sequencer.unload();
        sequencer.load(table(&valves(outputs), profile)).expect("nothing runs");
        let _ = sequencer.command(Command::Word(word(digits)));
        for _ in 0..45_000 {
            now = now + Micros(MS);
            on_ms += (sequencer.step(now, &Seen::default()).lines & 1) as u32;
        }
        let _ = sequencer.command(Command::Stop);
        sequencer.step(now, &Seen::default());
    }
    assert!(on_ms <= 50_000, "line 0 may be on for 50 of 100 s, it was on for {on_ms} ms");
}

#[test]
fn after_power_up_outputs_recover_with_time() {
    let records = two_valves(&[end(10)]);
    let profile = Box::leak(Box::new(profile(&records)));
    let mut sequencer = Sequencer::new(Box::leak(Box::default()));
    let mut now = Micros(0);
    sequencer.configure(profile);
    sequencer.load(table(&records, profile)).expect("a new sequencer is idle");
    let on = Command::Coil { coil: 0, on_ms: 20 };
    let refused = sequencer.command(on);
    assert_eq!(refused, Err(CommandError::Recovering { output: 0, left_ms: 0, wait_ms: 1600 }));
    rest(&mut sequencer, &mut now, 2);
    assert_eq!(sequencer.command(on), Ok(()));
}

#[test]
fn a_reset_forgets_no_current() {
    let records = two_valves(&[end(10)]);
    let profile = profile(&records);
    let profile: &'static Profile = Box::leak(Box::new(profile));
    let mut used = DutyMeters::default();
    let left = |used: &DutyMeters| used.meters[0].left_us(&limit_of(profile));
    let before = {
        let memory: &'static mut DutyMeters = Box::leak(Box::new(used.clone()));
        let mut sequencer = Sequencer::new(memory);
        let mut now = Micros(0);
        sequencer.configure(profile);
        rest(&mut sequencer, &mut now, 5);
        sequencer.load(table(&records, profile)).expect("idle");
        sequencer.command(Command::Coil { coil: 0, on_ms: 9 }).unwrap();
        for _ in 0..12 {
            now = now + Micros(MS);
            sequencer.step(now, &Seen::default());
        }
        used = sequencer.used().clone();
        left(&used)
    };
    assert_eq!(before, 960_000 - 9_000);
    let mut sequencer = Sequencer::new(Box::leak(Box::new(used)));
    sequencer.configure(profile);
    take_over(&mut sequencer);
    assert_eq!(left(sequencer.used()), before);
    let other = Box::leak(Box::new(Profile { digest: Digest([4; 32]), ..profile.clone() }));
    let mut sequencer = Sequencer::new(Box::leak(Box::new(sequencer.used().clone())));
    sequencer.configure(other);
    take_over(&mut sequencer);
    assert_eq!(left(sequencer.used()), 0, "what another profile's meters counted says nothing");
}

#[test]
fn the_emergency_stop_latches_within_one_tick() {
    let mut bench = Bench::with(&two_valves(&[row(0, "10"), end(90)]), |profile| {
        profile.emergency_stop = Some(EmergencyStop { input: 12, opens: true });
    });
    bench.follows = false;
    let released = 1 << 12;
    bench.seen.switches = released;
    bench.command(Command::Play).unwrap_err();
    bench.run(1).command(Command::Clear).unwrap();
    bench.command(Command::Play).unwrap();
    bench.seen.switches = released | 1;
    assert_eq!(bench.run(5).outputs.lines, 1);
    bench.seen.switches = 0;
    bench.run(1);
    assert_eq!((bench.outputs.enabled, bench.outputs.lines), (false, 0));
    assert_eq!(bench.fault(), Some(FaultKind::EmergencyStop));
    assert_eq!(bench.command(Command::Clear), Err(CommandError::EmergencyStop));
    bench.seen.switches = released;
    bench.run(1).command(Command::Clear).unwrap();
    assert_eq!(bench.sequencer.phase(), Phase::Idle);
}

#[test]
fn a_program_is_rehearsed_after_what_has_flowed() {
    let records = two_valves(&[row(0, "10"), row(90, "00"), end(100)]);
    let profile = profile(&records);
    let table = table(&records, &profile);
    let mut used = DutyMeters::default();
    let limit = &limit_of(&profile);
    for meter in &mut used.meters {
        let _ = meter.pass(Micros(1), false, limit);
    }
    table.recall(&used);
    assert_eq!(table.rehearse(0..2), Ok(()));
    used.meters[0].exhaust(limit);
    table.recall(&used);
    assert!(table.rehearse(0..2).is_err());
}
