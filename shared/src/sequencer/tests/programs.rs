//! Programs: rows in their time, latches and peaks before the first, the end, stop and the emergency stop.

extern crate std;
use std::vec::Vec;

use super::{Bench, actuator, coil, end, row, start, two_valves};
use crate::duty::DutyMeters;
use crate::output::{ActuatorWiring, Drive};
use crate::profile::EmergencyStop;
use crate::sequencer::{Command, CommandError, Event, FaultKind, Outputs, Phase, Sequencer};
use crate::table::Record;

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
    assert_eq!(bench.run(2).outputs.lines, 0b10, "the state of the latch is unknown");
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

#[test]
fn a_table_is_handed_over_only_at_rest() {
    let mut bench = Bench::new(&two_valves(&[row(0, "10"), end(50)]));
    bench.command(Command::Play).unwrap();
    assert!(bench.run(5).sequencer.unload().is_none());
    assert!(bench.run(60).sequencer.unload().is_some());
}

#[test]
fn a_broken_chain_latches_until_it_is_whole_again() {
    let mut bench = Bench::new(&two_valves(&[row(0, "10"), end(90)]));
    bench.command(Command::Play).unwrap();
    assert_eq!(bench.run(5).outputs.lines, 1);
    bench.seen.chain_broken = true;
    bench.run(1);
    assert_eq!((bench.outputs.enabled, bench.outputs.lines), (false, 0));
    assert_eq!(bench.fault(), Some(FaultKind::Chain));
    bench.command(Command::Clear).unwrap();
    assert_eq!(bench.run(1).fault(), Some(FaultKind::Chain), "it latches again");
    bench.seen.chain_broken = false;
    bench.run(1).command(Command::Clear).unwrap();
    assert_eq!(bench.run(1).fault(), None);
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
