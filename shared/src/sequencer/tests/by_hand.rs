//! Coils and words that are switched by hand.

extern crate std;
use std::vec::Vec;

use super::{Bench, actuator, coil, end, start, two_valves, word};
use crate::output::{ActuatorWiring, Drive};
use crate::sequencer::{Command, CommandError, FaultKind};
use crate::table::Record;

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

/// A stop leaves latches as they are.
#[test]
fn a_coil_by_hand_after_a_stop_moves_no_other_actuator() {
    let latch = coil(0, Drive::Latch { set: 0, reset: 1, pulse_ms: 5 });
    let valve = coil(1, Drive::Hold { line: 2 });
    let quiet = Record::Actuator(ActuatorWiring { states: 2, switch: None, travel_ms: 10 });
    for (command, lines) in [(Command::Coil { coil: 1, on_ms: 20 }, 0b100), (Command::Coil { coil: 1, on_ms: 0 }, 0)] {
        let mut bench = Bench::new(&[start(), latch.clone(), valve.clone(), quiet.clone(), quiet.clone(), end(90)]);
        bench.command(Command::Word(word("10"))).unwrap();
        bench.run(20).command(Command::Stop).unwrap();
        bench.run(20).command(command).unwrap();
        let seen = (0..40).fold(0, |seen, _| seen | bench.run(1).outputs.lines);
        assert_eq!(seen, lines, "{command:?}: line 1 resets the latch");
    }
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
    assert_eq!(bench.run(2).outputs.lines, 0b01, "the latch is set again: its state is unknown");
}
