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

/// What a coil may still be on, by its meter and by one that counts every tick, of a coil that switches as often as may be, in any
/// tick.
#[test]
fn a_meter_counts_what_flowed_when_however_often_its_coil_switches() {
    let mut coils = coils();
    let (mut exact, mut noise, mut n_seen) = (DutyMeter::default(), 1u32, 0);
    let limit = coils.outputs[0].limit;
    for tick in 1..20_000 {
        let now = Micros::from_millis(tick);
        let flowed = coils.on & 1 == 1;
        exact.pass(Micros::from_millis(1), flowed, &limit).unwrap();
        coils.pass(now).unwrap();
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        if (noise >> 16).is_multiple_of(if tick % 1000 < 300 { 2 } else { 30 }) {
            coils.on ^= 1;
            coils.note_switched(now, 1, flowed).unwrap();
        }
        if coils.is_counted() && coils.outputs[0].counted == now {
            assert_eq!(coils.used.meters[0].left_us(&limit), exact.left_us(&limit), "{tick} ms");
            n_seen += 1;
        }
    }
    assert!(n_seen > 1000 && exact.left_us(&limit) < 1_000_000, "current has flowed");
}
