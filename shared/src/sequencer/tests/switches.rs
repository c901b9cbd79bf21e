//! Limit switches that contradict the word.

use super::{Bench, actuator, coil, end, row, start, two_valves};
use crate::output::{ActuatorWiring, Drive, LimitSwitch, SwitchLimit};
use crate::sequencer::{Command, CommandError, FaultKind};
use crate::table::Record;
use crate::units::{ActuatorId, Word};

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

/// Two valves that have rested in state 0 after they moved, on a supply that feeds one of them each 60 ms.
fn fed_one_at_a_time() -> Bench {
    let supply = SwitchLimit { new_coils: 1, window_ms: 60 };
    let mut records = two_valves(&[row(0, "10"), end(90)]);
    let Some(Record::Start { switch_limit, .. }) = records.first_mut() else { unreachable!() };
    *switch_limit = supply;
    let mut bench = Bench::with(&records, |profile| profile.supply = supply);
    for coil in [0, 1] {
        bench.command(Command::Coil { coil, on_ms: 30 }).unwrap();
        bench.run(100);
    }
    bench
}

/// The second one waits for the supply.
#[test]
fn a_valve_that_moves_while_the_word_waits_for_the_supply_contradicts_nothing() {
    let mut bench = fed_one_at_a_time();
    bench.command(Command::Word("11".parse().unwrap())).unwrap();
    assert_eq!(bench.run(50).outputs.lines, 0b01);
    assert_eq!(bench.run(40).outputs.lines, 0b11);
    assert_eq!(bench.fault(), None);
    // From then on the switches count again.
    bench.follows = false;
    bench.seen.switches = 0b10;
    bench.run(5);
    let expected = FaultKind::Switch { actuator: ActuatorId(0), expected_closed: true, seen_closed: false };
    assert_eq!(bench.fault(), Some(expected));
}

/// It is still as the word of before says.
#[test]
fn a_valve_that_the_supply_has_not_fed_yet_is_watched() {
    let mut bench = fed_one_at_a_time();
    bench.command(Command::Word("11".parse().unwrap())).unwrap();
    bench.run(5).follows = false;
    bench.seen.switches = 0b11;
    bench.run(5);
    let expected = FaultKind::Switch { actuator: ActuatorId(1), expected_closed: false, seen_closed: true };
    assert_eq!(bench.fault(), Some(expected));
}

/// The second one waits for the supply, and the first one does not move.
#[test]
fn a_valve_that_sticks_while_the_word_waits_for_the_supply_is_found() {
    let mut bench = fed_one_at_a_time();
    bench.follows = false;
    bench.seen.switches = 0;
    bench.command(Command::Word("11".parse().unwrap())).unwrap();
    bench.run(40);
    let expected = FaultKind::Switch { actuator: ActuatorId(0), expected_closed: true, seen_closed: false };
    assert_eq!(bench.fault(), Some(expected));
}

/// A stop makes every digit 0, so that the reset by hand changes none.
#[test]
fn a_latch_that_sticks_when_it_is_reset_by_hand_after_a_stop_is_found() {
    for reset in [Command::Word("0".parse().unwrap()), Command::Coil { coil: 0, on_ms: 0 }] {
        let latch = coil(0, Drive::Latch { set: 0, reset: 1, pulse_ms: 5 });
        let mut bench = Bench::new(&[start(), latch, actuator(0), end(10)]);
        bench.follows = false;
        bench.seen.switches = 1;
        bench.command(Command::Word("1".parse().unwrap())).unwrap();
        assert_eq!(bench.run(60).fault(), None);
        bench.command(Command::Stop).unwrap();
        bench.run(20);
        bench.command(reset).unwrap();
        assert_eq!(bench.run(5).outputs.lines, 0b10, "it gets its pulse");
        let stuck = FaultKind::Switch { actuator: ActuatorId(0), expected_closed: false, seen_closed: true };
        assert_eq!(bench.run(60).fault(), Some(stuck));
    }
}

/// A stop leaves the other latch as it is: it counts in the state with which the switch is compared.
#[test]
fn a_latch_that_a_stop_left_set_counts_when_the_other_one_is_switched_by_hand() {
    let latch = |output: u8| coil(output, Drive::Latch { set: 2 * output, reset: 2 * output + 1, pulse_ms: 5 });
    for (before, on_ms, state) in [("2", 20, "3"), ("3", 0, "2"), ("1", 0, "0")] {
        let state: Word = state.parse().unwrap();
        let switch = Some(LimitSwitch { input: 0, closed_in: 1 << state.digit(0) });
        let of_two = Record::Actuator(ActuatorWiring { states: 4, switch, travel_ms: 10 });
        for is_closed in [true, false] {
            let mut bench = Bench::new(&[start(), latch(0), latch(1), of_two.clone(), end(10)]);
            bench.follows = false;
            bench.command(Command::Word(before.parse().unwrap())).unwrap();
            assert_eq!(bench.run(60).fault(), None);
            bench.command(Command::Stop).unwrap();
            bench.run(20);
            bench.command(Command::Coil { coil: 0, on_ms }).unwrap();
            bench.seen.switches = is_closed.into();
            assert_eq!(bench.run(8).sequencer.word(), state, "{before}");
            let (actuator, expected_closed, seen_closed) = (ActuatorId(0), true, false);
            let contradicts = FaultKind::Switch { actuator, expected_closed, seen_closed };
            assert_eq!(bench.run(10).fault(), (!is_closed).then_some(contradicts), "{before}");
        }
    }
}

/// Of three states none has both latches set.
#[test]
fn a_latch_that_would_make_no_state_with_one_that_a_stop_left_set_is_refused() {
    let latch = |output: u8| coil(output, Drive::Latch { set: 2 * output, reset: 2 * output + 1, pulse_ms: 5 });
    let of_two = Record::Actuator(ActuatorWiring { states: 3, switch: None, travel_ms: 10 });
    let mut bench = Bench::new(&[start(), latch(0), latch(1), of_two, end(10)]);
    let word = |text: &str| -> Word { text.parse().unwrap() };
    bench.command(Command::Word(word("1"))).unwrap();
    bench.run(60);
    bench.command(Command::Stop).unwrap();
    bench.run(20);
    assert_eq!(bench.command(Command::Coil { coil: 1, on_ms: 20 }), Err(CommandError::NoSuchState));
    bench.command(Command::Coil { coil: 0, on_ms: 0 }).unwrap();
    bench.run(20);
    bench.command(Command::Coil { coil: 1, on_ms: 20 }).unwrap();
    assert_eq!(bench.run(8).sequencer.word(), word("2"));
}
