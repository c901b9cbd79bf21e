//! Each limit broken by one row, and the records that cannot stand where they stand.

extern crate std;
use std::vec::Vec;

use super::{Board, Checker, Record, Row, RowError, ServoAngles, Table, TableError, wiring};
use crate::nearest::Coordinates;
use crate::output::{ActuatorWiring, Coil, CoilLimit, Drive, LimitSwitch, ServoWiring, SwitchLimit, WiringError};
use crate::profile::{BUILT_IN, Mismatch, Profile};
use crate::units::{ActuatorId, DeviceId, Digest, Micros, ModelHash, Word};

const START: Record = Record::Start {
    model: ModelHash(7),
    device: Some(DeviceId([1; 12])),
    profile: Digest([0; 32]),
    switch_limit: SwitchLimit { new_coils: 2, window_ms: 5 },
};

fn coil(line: u8) -> Record {
    let limit = CoilLimit { max_on_ms: 100, duty_percent: 50, window_ms: 1600 };
    Record::Coil(Coil { output: line, drive: Drive::Hold { line }, limit })
}

fn actuator(states: u8) -> Record {
    Record::Actuator(ActuatorWiring { states, switch: None, travel_ms: 10 })
}

fn row_with(at_ms: u32, digits: &str, servos: &[f32]) -> Record {
    let word = digits.parse().expect("the test's own word is valid");
    let servos = ServoAngles::from_slice(servos).expect("few servos");
    Record::Row(Row { at: Micros::from_millis(at_ms), word, servos })
}

fn row(at_ms: u32, digits: &str) -> Record {
    row_with(at_ms, digits, &[])
}

fn end(at_ms: u32) -> Record {
    Record::End { at: Micros::from_millis(at_ms) }
}

/// The profile that allows just what the records ask for.
fn profile(records: &[Record]) -> Profile {
    Profile::of(&wiring(records).expect("few coils"))
}

/// Admits all records under a profile; the first refusal ends it.
fn check_under(profile: &Profile, records: &[Record]) -> Result<Checker, TableError> {
    let mut checker = Checker::default();
    let board = Board { device: None, profile };
    records.iter().try_for_each(|record| checker.admit(record, &board))?;
    Ok(checker)
}

/// The same under the profile that allows just what they ask for.
fn check(records: &[Record]) -> Result<Checker, TableError> {
    check_under(&profile(records), records)
}

fn three_valves(rows: &[Record]) -> Result<Checker, TableError> {
    let wiring = [START, coil(0), coil(1), coil(2), actuator(2), actuator(2), actuator(2)];
    check(&[&wiring, rows].concat())
}

fn refused(rows: &[Record]) -> (u16, RowError) {
    match three_valves(rows) {
        Err(TableError::Row { row, error }) => (row, error),
        other => panic!("not refused for a row: {other:?}"),
    }
}

#[test]
fn a_good_table_is_complete_at_its_end() {
    let checker = three_valves(&[row(0, "100"), row(50, "010"), end(100)]).unwrap();
    assert!(checker.is_complete());
    assert!(!three_valves(&[row(0, "100")]).unwrap().is_complete());
}

#[test]
fn each_breach_names_its_row() {
    assert_eq!(refused(&[row(5, "100"), row(5, "000")]), (1, RowError::Time));
    assert_eq!(refused(&[row(0, "10")]), (0, RowError::Word));
    assert_eq!(refused(&[row(0, "200")]), (0, RowError::Word));
    assert_eq!(refused(&[row(0, "111")]), (0, RowError::TooManyCoils));
    assert_eq!(refused(&[row(0, "001"), end(101)]), (1, RowError::OnTooLong { output: 2 }));
    assert_eq!(refused(&[row(0, "100"), row(9, "000")]), (1, RowError::Travel { actuator: ActuatorId(0) }));
    assert_eq!(refused(&[row_with(0, "000", &[0.1])]), (0, RowError::Servo { servo: 0 }));
}

#[test]
fn duty_is_counted_along_the_rows() {
    let rows: Vec<_> = (0..40).map(|i| row(50 * i + i / 2 * 20, if i % 2 == 0 { "100" } else { "000" })).collect();
    let slow = three_valves(&rows).map(|_| ());
    assert_eq!(slow, Ok(()), "50 of 120 ms is less than half");
    let rows: Vec<_> = (0..60)
        .map(|i| row(if i % 2 == 0 { 40 * i } else { 40 * i + 20 }, if i % 2 == 0 { "100" } else { "000" }))
        .collect();
    assert_eq!(refused(&rows).1, RowError::Duty { output: 0 }, "60 of 80 ms is more than half");
}

/// The board looks every few milliseconds: most is counted just before an old bucket drops out of the window.
#[test]
fn duty_is_counted_within_a_row_and_not_only_at_its_end() {
    let limit = CoilLimit { max_on_ms: 1000, duty_percent: 50, window_ms: 1600 };
    let coil = Record::Coil(Coil { output: 0, drive: Drive::Hold { line: 0 }, limit });
    let on_again = |from_ms, to_ms| {
        let rows = [row(0, "1"), row(500, "0"), row(from_ms, "1"), row(to_ms, "0"), end(2000)];
        check(&[&[START, coil.clone(), actuator(2)][..], &rows].concat()).map(|_| ())
    };
    let refused = Err(TableError::Row { row: 3, error: RowError::Duty { output: 0 } });
    assert_eq!(on_again(1350, 1740), refused, "790 ms at the end, 850 ms 40 ms before it");
    assert_eq!(on_again(1350, 1600), Ok(()));
}

/// A row goes out with the first tick that is not before it: each time on may be a tick longer.
#[test]
fn each_time_on_counts_a_tick_more() {
    let limit = CoilLimit { max_on_ms: 1000, duty_percent: 50, window_ms: 1600 };
    let coil = Record::Coil(Coil { output: 0, drive: Drive::Hold { line: 0 }, limit });
    let times_on = |count: u32, on_ms: u32| {
        let rows = (0..count).flat_map(|i| [row(i * (on_ms + 4), "1"), row(i * (on_ms + 4) + on_ms, "0")]);
        let valve = Record::Actuator(ActuatorWiring { states: 2, switch: None, travel_ms: 0 });
        let records: Vec<_> = [START, coil.clone(), valve].into_iter().chain(rows).chain([end(1599)]).collect();
        check(&records).map(|_| ())
    };
    assert_eq!(times_on(1, 780), Ok(()));
    assert_eq!(times_on(100, 6), Ok(()), "600 ms in 100 times are at most 700 of 800 ms");
    let refused = times_on(100, 7);
    let is_duty = matches!(refused, Err(TableError::Row { error: RowError::Duty { output: 0 }, .. }));
    assert!(is_duty, "700 ms in 100 times can be 800 ms: {refused:?}");
}

#[test]
fn pulses_of_latches_take_their_share_of_the_time() {
    let limit = CoilLimit { max_on_ms: 100, duty_percent: 40, window_ms: 1600 };
    let latch = Record::Coil(Coil { output: 0, drive: Drive::Latch { set: 0, reset: 1, pulse_ms: 50 }, limit });
    let pulsing_every = |period_ms: u32| {
        let rows = (0..40).map(|number| row(period_ms * number, if number % 2 == 0 { "1" } else { "0" }));
        let records: Vec<_> = [START, latch.clone(), actuator(2)].into_iter().chain(rows).collect();
        check(&records).map(|_| ())
    };
    assert_eq!(pulsing_every(140), Ok(()), "50 of 140 ms are 36 %");
    let refused = pulsing_every(100);
    let is_duty = matches!(refused, Err(TableError::Row { error: RowError::Duty { output: 0 }, .. }));
    assert!(is_duty, "50 of 100 ms are half: {refused:?}");
}

#[test]
fn a_row_whose_peak_comes_too_soon_is_refused() {
    let limit = CoilLimit { max_on_ms: 1000, duty_percent: 100, window_ms: 1600 };
    let actuator = Record::Actuator(ActuatorWiring { states: 2, switch: None, travel_ms: 0 });
    let refused = |drive, rows: &[Record]| {
        let coil = Record::Coil(Coil { output: 0, drive, limit });
        check(&[&[START, coil, actuator.clone()], rows].concat()).err()
    };
    let peak = |peak_ms| Drive::PeakHold { pull: 0, hold: 1, peak_ms };
    let again_at = |at_ms| [row(0, "1"), row(5, "0"), row(8, "0"), row(at_ms, "1"), row(at_ms + 9, "1"), end(900)];
    let too_soon = Some(TableError::Row { row: 3, error: RowError::Duty { output: 0 } });
    assert_eq!(refused(peak(50), &again_at(502)), None, "500 ms, and the first row may be 2 ms late");
    assert_eq!(refused(peak(50), &again_at(501)), too_soon);
    assert_eq!(refused(peak(2), &again_at(22)), None);
    assert_eq!(refused(peak(0), &again_at(11)), too_soon, "full current lasts for a tick at least");
    assert_eq!(refused(Drive::Hold { line: 0 }, &again_at(10)), None, "no peak");
}

#[test]
fn servos_keep_their_range_and_speed() {
    let servo =
        ServoWiring { id: 1, min_rad: -1.0, max_rad: 1.0, max_speed_rad_s: 2.0, max_torque: 0.5, timeout_ms: 20 };
    let with = |rows: &[Record]| check(&[&[START, Record::Servo(servo)], rows].concat()).map(|_| ());
    let error = |row, error| Err(TableError::Row { row, error });
    assert_eq!(with(&[row_with(0, "", &[0.0]), row_with(500, "", &[0.9])]), Ok(()));
    assert_eq!(with(&[row_with(0, "", &[1.1])]), error(0, RowError::Servo { servo: 0 }));
    assert_eq!(with(&[row_with(0, "", &[f32::NAN])]), error(0, RowError::Servo { servo: 0 }));
    let fast = [row_with(0, "", &[0.0]), row_with(500, "", &[-1.0]), row_with(900, "", &[0.0])];
    assert_eq!(with(&fast), error(2, RowError::ServoSpeed { servo: 0 }));
}

#[test]
fn records_stand_in_their_order() {
    assert_eq!(check(&[coil(0)]).err(), Some(TableError::Order));
    assert_eq!(three_valves(&[row(0, "000"), coil(3)]).err(), Some(TableError::Order));
    assert_eq!(three_valves(&[end(1), row(2, "000")]).err(), Some(TableError::Order));
}

#[test]
fn unsafe_wirings_are_refused() {
    let wiring = |records: &[Record]| match check(&[&[START], records, &[end(1)]].concat()) {
        Err(TableError::Wiring(error)) => error,
        other => panic!("not refused for the wiring: {other:?}"),
    };
    assert_eq!(wiring(&[coil(0), coil(0), actuator(2), actuator(2)]), WiringError::Output { output: 0 });
    assert_eq!(wiring(&[coil(0), actuator(3)]), WiringError::CoilCount { coil: 1 });
    assert_eq!(wiring(&[coil(0), actuator(5)]), WiringError::States { actuator: ActuatorId(0) });
    let with_input = |input| {
        let switch = Some(LimitSwitch { input, closed_in: 2 });
        Record::Actuator(ActuatorWiring { states: 2, switch, travel_ms: 1 })
    };
    assert_eq!(wiring(&[coil(0), coil(1), with_input(3), with_input(3)]), WiringError::Input { input: 3 });
    assert_eq!(wiring(&[coil(0), with_input(32)]), WiringError::Input { input: 32 });
    let limit = CoilLimit { max_on_ms: 0, duty_percent: 50, window_ms: 1600 };
    let dead = Record::Coil(Coil { output: 0, drive: Drive::Hold { line: 0 }, limit });
    assert_eq!(wiring(&[dead, actuator(2)]), WiringError::CoilLimit { output: 0 });
}

#[test]
fn a_table_for_another_device_is_refused() {
    let mut table = Table::default();
    let on = |device| Board { device: Some(DeviceId([device; 12])), profile: &BUILT_IN };
    assert_eq!(table.push(&START, &on(2)), Err(TableError::OtherDevice));
    assert_eq!(table.push(&START, &on(1)), Ok(()));
}

#[test]
fn after_a_refusal_the_table_is_empty() {
    let mut table = Table::default();
    let records = [START, coil(0), actuator(2), row(0, "1")];
    let profile = profile(&records);
    let board = Board { device: None, profile: &profile };
    for record in records {
        table.push(&record, &board).unwrap();
    }
    assert!(table.push(&row(0, "1"), &board).is_err());
    assert!(table.rows().is_empty() && table.end().is_none());
    assert_eq!(table.push(&row(5, "1"), &board), Err(TableError::Order));
}

#[test]
fn no_record_is_longer_than_its_buffer() {
    let servos = ServoAngles::from_slice(&[f32::MAX; 4]).unwrap();
    let longest = [
        Record::Row(Row { at: Micros(u64::MAX), word: Word::new(&[3; 64]).unwrap(), servos }),
        Record::Servo(ServoWiring {
            id: 255,
            min_rad: -1.0,
            max_rad: 1.0,
            max_speed_rad_s: 1.0,
            max_torque: 1.0,
            timeout_ms: u16::MAX,
        }),
        Record::Start {
            model: ModelHash(u64::MAX),
            device: Some(DeviceId([255; 12])),
            profile: Digest([255; 32]),
            switch_limit: SwitchLimit { new_coils: 255, window_ms: u16::MAX },
        },
    ];
    for record in longest {
        let mut bytes = [0; Record::MAX_BYTES];
        assert!(postcard::to_slice(&record, &mut bytes).is_ok(), "{record:?}");
    }
}

/// Coordinates of a pose as far along x.
fn at(x: f32) -> Coordinates {
    Coordinates { turn_rad: [0.0; 3], position_m: [x, 0.0, 0.0] }
}

fn module(actuators: u8) -> Record {
    Record::Module { actuators, length_scale_m: 0.5, behind: at(0.0) }
}

fn frame(digits: u16) -> Record {
    Record::Frame { digits, pose: at(1.0) }
}

#[test]
fn modules_have_every_actuator_and_their_frames_stand_in_order() {
    let rows = [row(0, "100"), end(50)];
    let of = |modules: &[Record]| three_valves(&[modules, &rows].concat()).map(|checker| checker.is_complete());
    assert_eq!(of(&[module(2), frame(0), frame(0b0101), module(1), frame(1)]), Ok(true));
    let wrong: [&[Record]; 12] = [
        &[module(0), frame(0)],
        &[module(2), frame(0)],
        &[module(2), module(1), frame(0)],
        &[module(2), frame(0), module(1)],
        &[module(4), frame(0)],
        &[module(2), frame(0), module(2), frame(0)],
        &[module(3), frame(1), frame(1)],
        &[module(3), frame(2)],
        &[module(2), frame(0), module(1), frame(0b100)],
        &[module(3), Record::Frame { digits: 0, pose: at(f32::NAN) }],
        &[module(3), Record::Frame { digits: 0, pose: at(1e4) }],
        &[Record::Module { actuators: 3, length_scale_m: f32::NAN, behind: at(0.0) }, frame(0)],
    ];
    wrong.iter().for_each(|records| assert_eq!(of(records), Err(TableError::Modules), "{records:?}"));
    assert_eq!(of(&[frame(0)]), Err(TableError::Order));
    assert_eq!(of(&[module(3), frame(0), coil(3)]), Err(TableError::Order));
}

#[test]
fn modules_and_frames_are_these_bytes() {
    let mut bytes = [0; Record::MAX_BYTES];
    let module = postcard::to_slice(&module(6), &mut bytes).unwrap();
    assert_eq!(module[..7], [6, 6, 0, 0, 0, 0x3f, 0]);
    assert_eq!(module.len(), 30);
    let frame = postcard::to_slice(&frame(0b0101_0101), &mut bytes).unwrap();
    assert_eq!(frame[..3], [7, 0x55, 0]);
    assert_eq!(frame[14..18], [0, 0, 0x80, 0x3f]);
    assert_eq!(frame.len(), 26);
}

/// A table with one coil of this drive and limit, under a profile for a valve or a latch.
fn with_limit(drive: Drive, limit: CoilLimit) -> Result<Checker, TableError> {
    let of_profile = match drive {
        Drive::Latch { set, reset, .. } => Drive::Latch { set, reset, pulse_ms: 50 },
        other => other,
    };
    let coil = |drive, limit| Record::Coil(Coil { output: 0, drive, limit });
    let profile = profile(&[START, coil(of_profile, LIMIT), actuator(2)]);
    check_under(&profile, &[START, coil(drive, limit), actuator(2), end(1)])
}

const LIMIT: CoilLimit = CoilLimit { max_on_ms: 100, duty_percent: 50, window_ms: 1600 };

#[test]
fn no_sender_sets_limits_that_are_none() {
    let drive = Drive::Hold { line: 0 };
    assert!(with_limit(drive, LIMIT).is_ok());
    assert!(with_limit(drive, CoilLimit { max_on_ms: u32::MAX, ..LIMIT }).is_err(), "on for 49 days");
    assert!(with_limit(drive, CoilLimit { duty_percent: 100, ..LIMIT }).is_err(), "no pause at all");
    assert!(with_limit(drive, CoilLimit { window_ms: 3200, ..LIMIT }).is_err(), "counted over a longer window");
    let latch = |pulse_ms| Drive::Latch { set: 0, reset: 1, pulse_ms };
    assert!(with_limit(latch(50), LIMIT).is_ok());
    assert!(with_limit(latch(65_000), LIMIT).is_err(), "a pulse of 65 s");
    for window_ms in [0, 4] {
        let records = [supply(2, window_ms), coil(0), actuator(2), end(1)];
        assert!(check_under(&profile(&[START, coil(0), actuator(2)]), &records).is_err(), "more coils at once");
    }
}

fn supply(new_coils: u8, window_ms: u16) -> Record {
    let switch_limit = SwitchLimit { new_coils, window_ms };
    Record::Start { model: ModelHash(7), device: None, profile: Digest::default(), switch_limit }
}

fn servo(id: u8, max_speed_rad_s: f32) -> Record {
    let (max_torque, timeout_ms) = (0.5, 100);
    Record::Servo(ServoWiring { id, min_rad: -1.0, max_rad: 1.0, max_speed_rad_s, max_torque, timeout_ms })
}

#[test]
fn no_sender_wires_what_the_board_does_not_have() {
    assert!(check(&[START, servo(1, 1.0), end(1)]).is_ok());
    assert!(check(&[START, servo(254, 1.0), end(1)]).is_err(), "the broadcast address");
    assert!(check(&[START, servo(1, f32::INFINITY), end(1)]).is_err(), "infinitely fast");
    assert!(check(&[START, servo(1, 1.0), servo(1, 1.0), end(1)]).is_err(), "two joints on one servo");
    let slow = profile(&[START, servo(1, 0.5)]);
    assert!(check_under(&slow, &[START, servo(1, 1.0), end(1)]).is_err(), "faster than the profile allows");
    assert!(check_under(&BUILT_IN, &[START, servo(1, 1.0), end(1)]).is_err(), "a servo without a profile");
    let switch = Some(LimitSwitch { input: 31, closed_in: 0b10 });
    let actuator = Record::Actuator(ActuatorWiring { states: 2, switch, travel_ms: 10 });
    assert!(check(&[START, coil(0), actuator, end(1)]).is_err(), "an input that the board does not have");
}

#[test]
fn a_refusal_names_the_output_before_the_digest() {
    let records = [START, coil(0), coil(1), actuator(2), actuator(2), end(1)];
    let mut other = Profile { digest: Digest([9; 32]), ..profile(&records) };
    let refused = |profile: &Profile| check_under(profile, &records).unwrap_err();
    assert!(matches!(refused(&other), TableError::Profile(Mismatch::Digest { .. })));
    other.outputs[1] = None;
    assert_eq!(refused(&other), TableError::Profile(Mismatch::NoOutput { output: 1 }));
    other = profile(&[START, coil(0), coil(1), actuator(2)]);
    other.outputs[1] =
        other.outputs[1].map(|output| crate::profile::Output { drive: Drive::Hold { line: 9 }, ..output });
    assert!(matches!(refused(&other), TableError::Profile(Mismatch::Drive { output: 1, .. })));
}
