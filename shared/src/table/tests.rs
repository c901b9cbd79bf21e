//! Each limit broken by one row, and the records that cannot stand where they stand.

extern crate std;
use std::vec::Vec;

use super::{Checker, Record, Row, RowError, ServoAngles, Table, TableError};
use crate::nearest::Coordinates;
use crate::output::{ActuatorWiring, Coil, CoilLimit, Drive, LimitSwitch, ServoWiring, SwitchLimit, WiringError};
use crate::units::{ActuatorId, DeviceId, Micros, ModelHash, Word};

const START: Record = Record::Start {
    model: ModelHash(7),
    device: Some(DeviceId([1; 12])),
    switch_limit: SwitchLimit { new_coils: 2, window_ms: 5 },
};

fn coil(line: u8) -> Record {
    let limit = CoilLimit { max_on_ms: 100, duty_percent: 50, window_ms: 1600 };
    Record::Coil(Coil { drive: Drive::Hold { line }, limit })
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

/// Admits all records; the first refusal ends it.
fn check(records: &[Record]) -> Result<Checker, TableError> {
    let mut checker = Checker::default();
    records.iter().try_for_each(|record| checker.admit(record, None))?;
    Ok(checker)
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
    assert_eq!(refused(&[row(0, "001"), end(101)]), (1, RowError::CoilOnTooLong { coil: 2 }));
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
    assert_eq!(refused(&rows).1, RowError::CoilDuty { coil: 0 }, "60 of 80 ms is more than half");
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
    assert_eq!(wiring(&[coil(0), coil(0), actuator(2), actuator(2)]), WiringError::Line { line: 0 });
    assert_eq!(wiring(&[coil(64), actuator(2)]), WiringError::Line { line: 64 });
    assert_eq!(wiring(&[coil(0), actuator(3)]), WiringError::CoilCount { coil: 1 });
    assert_eq!(wiring(&[coil(0), actuator(5)]), WiringError::States { actuator: ActuatorId(0) });
    let with_input = |input| {
        let switch = Some(LimitSwitch { input, closed_in: 2 });
        Record::Actuator(ActuatorWiring { states: 2, switch, travel_ms: 1 })
    };
    assert_eq!(wiring(&[coil(0), coil(1), with_input(3), with_input(3)]), WiringError::Input { input: 3 });
    assert_eq!(wiring(&[coil(0), with_input(32)]), WiringError::Input { input: 32 });
    let limit = CoilLimit { max_on_ms: 0, duty_percent: 50, window_ms: 1600 };
    let dead = Record::Coil(Coil { drive: Drive::Hold { line: 0 }, limit });
    assert_eq!(wiring(&[dead, actuator(2)]), WiringError::CoilLimit { coil: 0 });
}

#[test]
fn a_table_for_another_device_is_refused() {
    let mut table = Table::default();
    assert_eq!(table.push(&START, Some(DeviceId([2; 12]))), Err(TableError::OtherDevice));
    assert_eq!(table.push(&START, Some(DeviceId([1; 12]))), Ok(()));
}

#[test]
fn after_a_refusal_the_table_is_empty() {
    let mut table = Table::default();
    for record in [START, coil(0), actuator(2), row(0, "1")] {
        table.push(&record, None).unwrap();
    }
    assert!(table.push(&row(0, "1"), None).is_err());
    assert!(table.rows().is_empty() && table.end().is_none());
    assert_eq!(table.push(&row(5, "1"), None), Err(TableError::Order));
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

/// A table with one coil of this drive and limit.
fn with_limit(drive: Drive, limit: CoilLimit) -> Result<Checker, TableError> {
    check(&[START, Record::Coil(Coil { drive, limit }), actuator(2), end(1)])
}

#[test]
fn no_sender_sets_limits_that_are_none() {
    let drive = Drive::Hold { line: 0 };
    let limit = CoilLimit { max_on_ms: 100, duty_percent: 50, window_ms: 1600 };
    assert!(with_limit(drive, limit).is_ok());
    assert!(with_limit(drive, CoilLimit { max_on_ms: u32::MAX, ..limit }).is_err(), "on for 49 days");
    assert!(with_limit(drive, CoilLimit { duty_percent: 100, ..limit }).is_err(), "no pause at all");
    let latch = Drive::Latch { set: 0, reset: 1, pulse_ms: 65_000 };
    assert!(with_limit(latch, CoilLimit { max_on_ms: 65_000, ..limit }).is_err(), "a pulse of 65 s");
    let no_window = SwitchLimit { new_coils: 16, window_ms: 0 };
    let start = Record::Start { model: ModelHash(7), device: None, switch_limit: no_window };
    assert!(check(&[start, coil(0), actuator(2), end(1)]).is_err(), "all coils at once");
}

#[test]
fn no_sender_wires_what_the_board_does_not_have() {
    let servo = |id, max_speed_rad_s| {
        let (max_torque, timeout_ms) = (0.5, 100);
        Record::Servo(ServoWiring { id, min_rad: -1.0, max_rad: 1.0, max_speed_rad_s, max_torque, timeout_ms })
    };
    assert!(check(&[START, servo(1, 1.0), end(1)]).is_ok());
    assert!(check(&[START, servo(254, 1.0), end(1)]).is_err(), "the broadcast address");
    assert!(check(&[START, servo(1, f32::INFINITY), end(1)]).is_err(), "infinitely fast");
    assert!(check(&[START, servo(1, 1.0), servo(1, 1.0), end(1)]).is_err(), "two joints on one servo");
    let switch = Some(LimitSwitch { input: 31, closed_in: 0b10 });
    let actuator = Record::Actuator(ActuatorWiring { states: 2, switch, travel_ms: 10 });
    assert!(check(&[START, coil(0), actuator, end(1)]).is_err(), "an input that the board does not have");
}
