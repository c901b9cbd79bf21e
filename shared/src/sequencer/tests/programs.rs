//! Programs: rows in their time, latches and peaks before the first, the end, stop and the emergency stop.

extern crate std;
use std::vec::Vec;

use super::{Bench, actuator, coil, end, row, start, two_valves};
use crate::duty::DutyMeters;
use crate::output::{ActuatorWiring, Drive};
use crate::profile::{BoardWiring, EmergencyStop};
use crate::sequencer::{Command, CommandError, EnableLevel, Event, FarEnd, FaultKind, Outputs, Phase, Sequencer};
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
fn a_camera_gets_a_pulse_of_one_tick_at_each_row_where_the_profile_has_one() {
    for sync in [true, false] {
        let records = two_valves(&[row(0, "10"), row(20, "10"), row(40, "01"), end(60)]);
        let mut bench = Bench::with(&records, |profile| profile.sync = sync);
        bench.command(Command::Play).unwrap();
        let pulses: Vec<u64> = (0..100).filter(|_| bench.run(1).outputs.sync).collect();
        let rows: &[u64] = if sync { &[0, 20, 40] } else { &[] };
        assert_eq!(pulses, rows);
    }
}

/// The edges of output enable are those of the first and of the last line.
#[test]
fn output_enable_is_driven_low_only_while_a_line_is_high() {
    let drive = Drive::Latch { set: 0, reset: 1, pulse_ms: 5 };
    let quiet = Record::Actuator(ActuatorWiring { states: 2, switch: None, travel_ms: 5 });
    let mut bench = Bench::new(&[start(), coil(0, drive), quiet, row(0, "0"), row(20, "1"), end(40)]);
    let mut edges = Vec::new();
    let mut watch = |bench: &mut Bench, millis: u64| {
        for _ in 0..millis {
            let before = core::mem::take(&mut bench.outputs);
            bench.run(1);
            assert_eq!(bench.outputs.enabled, bench.outputs.lines != 0);
            edges.extend((before.enabled != bench.outputs.enabled).then_some(bench.outputs.enabled));
        }
    };
    watch(&mut bench, 10);
    bench.command(Command::Play).unwrap();
    watch(&mut bench, 60);
    bench.command(Command::Coil { coil: 0, on_ms: 3 }).unwrap();
    watch(&mut bench, 60);
    assert_eq!((bench.sequencer.phase(), bench.outputs.enabled), (Phase::Manual, false));
    assert_eq!(edges, [true, false, true, false, true, false], "two pulses of the program, one by hand");
}

#[test]
fn output_enable_that_does_not_follow_is_a_fault_at_either_level() {
    for (level, kind) in [(EnableLevel::Low, FaultKind::OutputEnable), (EnableLevel::High, FaultKind::OutputEnableHigh)]
    {
        let mut bench = Bench::new(&two_valves(&[row(0, "10"), end(90)]));
        bench.command(Command::Play).unwrap();
        bench.run(5).seen.enable_stuck = Some(level);
        assert_eq!(bench.run(1).fault(), Some(kind));
        assert_eq!((bench.outputs.enabled, bench.outputs.lines), (false, 0));
    }
}

#[test]
fn a_far_end_that_the_profile_demands_has_to_answer_before_anything_is_switched() {
    let with = |chips| {
        Bench::with(&two_valves(&[row(0, "10"), end(90)]), |profile| {
            profile.board = BoardWiring { chips, layout: None }
        })
    };
    let fault = |bench: &mut Bench, far_end| {
        bench.seen.far_end = far_end;
        let _ = bench.run(1).command(Command::Clear);
        let _ = bench.command(Command::Play);
        bench.run(1);
        assert_eq!(bench.outputs.lines, u64::from(bench.fault().is_none()));
        bench.fault()
    };
    let silent = Some(FaultKind::FarEnd { expected: 2, counted: 0 });
    let mut bench = with(Some(2));
    bench.seen.far_end = FarEnd::Trying;
    assert_eq!(bench.run(100).fault(), None, "it has its time");
    assert_eq!(fault(&mut bench, FarEnd::Trying), silent, "and nothing is switched meanwhile");
    assert_eq!(fault(&mut bench, FarEnd::Silent), silent);
    assert_eq!(fault(&mut bench, FarEnd::Chips(1)), Some(FaultKind::FarEnd { expected: 2, counted: 1 }));
    assert_eq!(fault(&mut bench, FarEnd::Chips(2)), None, "repaired and cleared");
    for far_end in [FarEnd::Trying, FarEnd::Silent, FarEnd::Chips(1)] {
        assert_eq!(fault(&mut with(None), far_end), None, "the profile does not say");
    }
    assert_eq!(fault(&mut with(Some(2)), FarEnd::Absent), None, "the board has no input for it");
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
