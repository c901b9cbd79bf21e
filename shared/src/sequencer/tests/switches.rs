//! Limit switches that contradict the word.

use super::{Bench, end, row, two_valves};
use crate::sequencer::{Command, CommandError, FaultKind};
use crate::units::ActuatorId;

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
