//! The threshold of the board's supply.

use super::*;

const MIN_MV: u16 = 4_500;

/// A board with a threshold whose valve is on by hand.
fn driven() -> Bench {
    let mut bench = Bench::with(&two_valves(&[row(0, "00"), end(100)]), |profile| profile.min_supply_mv = Some(MIN_MV));
    measure(&mut bench, &[5_000]);
    bench.command(Command::Coil { coil: 0, on_ms: 90 }).expect("nothing else is on");
    bench.run(1);
    assert_ne!(bench.outputs.lines, 0);
    bench
}

/// A measurement each 10 ms.
fn measure(bench: &mut Bench, supplies_mv: &[u16]) {
    for mv in supplies_mv {
        bench.seen.supply_mv = Some(*mv);
        bench.run(1);
        bench.seen.supply_mv = None;
        bench.run(9);
    }
}

#[test]
fn four_low_measurements_pass_and_the_fifth_in_a_row_latches_the_safe_state() {
    let mut bench = driven();
    measure(&mut bench, &[MIN_MV - 1; 4]);
    assert_eq!(bench.fault(), None);
    assert_ne!(bench.outputs.lines, 0);
    bench.seen.supply_mv = Some(4_321);
    bench.run(1);
    assert_eq!(bench.fault(), Some(FaultKind::Supply { mv: 4_321, min_mv: MIN_MV }));
    assert_eq!((bench.outputs.lines, bench.outputs.enabled), (0, false), "in the tick of the measurement");
}

#[test]
fn single_dips_of_the_supply_latch_nothing() {
    let mut bench = driven();
    for _ in 0..100 {
        measure(&mut bench, &[0; 4]);
        measure(&mut bench, &[MIN_MV; 80]);
    }
    assert_eq!(bench.fault(), None);
}

#[test]
fn a_supply_that_collapses_again_and_again_latches_the_safe_state() {
    let mut bench = driven();
    measure(&mut bench, &[0, 0, 0, 0, MIN_MV, MIN_MV, MIN_MV, MIN_MV, 4_321]);
    assert_eq!(bench.fault(), None, "it is low for 96 of 100");
    measure(&mut bench, &[0]);
    assert_eq!(bench.fault(), Some(FaultKind::Supply { mv: 0, min_mv: MIN_MV }));
}

#[test]
fn a_supply_that_stays_low_latches_again_before_anything_is_driven() {
    let mut bench = driven();
    measure(&mut bench, &[0; 5]);
    assert_eq!(bench.fault(), Some(FaultKind::Supply { mv: 0, min_mv: MIN_MV }), "a converter that gives nothing");
    bench.command(Command::Clear).expect("it can be tried");
    let _ = bench.command(Command::Coil { coil: 0, on_ms: 10 });
    bench.run(1);
    assert!(bench.fault().is_some() && bench.outputs.lines == 0);
    measure(&mut bench, &[5_000]);
    bench.command(Command::Clear).expect("the supply is back");
    bench.run(100);
    assert_eq!(bench.fault(), None);
}

#[test]
fn without_a_threshold_no_supply_latches_anything() {
    let mut bench = Bench::new(&two_valves(&[row(0, "00"), end(100)]));
    measure(&mut bench, &[0; 20]);
    assert_eq!(bench.fault(), None);
}
