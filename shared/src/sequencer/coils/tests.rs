//! The turn of the meters: how late each may be.

extern crate std;
use std::boxed::Box;

use super::meters::METERS_A_TICK;
use super::{Coils, MAX_COILS};
use crate::duty::DutyMeter;
use crate::output::{CoilLimit, Drive};
use crate::profile::{Output, Profile};
use crate::units::Micros;

/// Every meter counts once in this many ticks.
const TICKS_A_TURN: u32 = MAX_COILS.div_ceil(METERS_A_TICK) as u32;

const LIMIT: CoilLimit = CoilLimit { max_on_ms: 10_000, duty_percent: 99, window_ms: 1600 };

/// All outputs of a board, none of which was on before.
fn coils() -> Coils<'static> {
    let mut profile = Profile::empty();
    for (line, output) in (0..).zip(&mut profile.outputs) {
        *output = Some(Output { drive: Drive::Hold { line }, limit: LIMIT, input: None });
    }
    let mut coils = Coils::new(Box::leak(Box::default()));
    coils.configure(Micros(0), &profile);
    coils.take_outputs(Micros(0), &profile, MAX_COILS);
    coils.used.meters.fill(DutyMeter::default());
    coils
}

#[test]
fn every_meter_counts_in_its_turn() {
    let mut coils = coils();
    for tick in 1..100 {
        let now = Micros::from_millis(tick);
        coils.pass(now).unwrap();
        let latest = coils.outputs.iter().map(|output| now - output.counted).max();
        assert!(tick < TICKS_A_TURN || latest < Some(Micros::from_millis(TICKS_A_TURN)), "{tick}: {latest:?}");
    }
}

/// What a coil may still be on, by its meter and by one that counts every tick, where its current begins or ends after at least
/// `apart` ticks.
fn left_beside_exact(apart: u32, mut see: impl FnMut(u64, u64)) {
    let mut coils = coils();
    let (mut exact, mut noise, mut last) = (DutyMeter::default(), 1u32, 0);
    let limit = coils.outputs[0].limit;
    for tick in 1..20_000 {
        let now = Micros::from_millis(tick);
        let flowed = coils.on & 1 == 1;
        exact.pass(Micros::from_millis(1), flowed, &limit).unwrap();
        coils.pass(now).unwrap();
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        // Now and then as often as may be.
        if tick - last >= apart && (noise >> 16).is_multiple_of(if tick % 1000 < 300 { 2 } else { 30 }) {
            coils.on ^= 1;
            coils.note_switched(now, 1, flowed);
            last = tick;
        }
        if coils.is_counted() && coils.outputs[0].counted == now {
            see(coils.used.meters[0].left_us(&limit).into(), exact.left_us(&limit).into());
        }
    }
    assert!(exact.left_us(&limit) < 1_000_000, "current has flowed");
}

#[test]
fn a_meter_counts_in_its_turn_what_flowed_when() {
    let mut n_seen = 0;
    left_beside_exact(TICKS_A_TURN / 2, |left_us, exact_us| {
        assert_eq!(left_us, exact_us);
        n_seen += 1;
    });
    assert!(n_seen > 1000);
}

#[test]
fn of_a_coil_that_switches_faster_than_its_meter_has_a_turn_no_current_is_missed() {
    let mut n_less = 0;
    left_beside_exact(1, |left_us, exact_us| {
        assert!(left_us <= exact_us);
        n_less += u32::from(left_us < exact_us);
    });
    assert!(n_less > 0, "pauses count as current");
}
