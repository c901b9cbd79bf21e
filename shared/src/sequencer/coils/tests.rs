//! The turn of the meters: how late each may be.

extern crate std;
use std::boxed::Box;

use super::{Coils, MAX_COILS, TICKS_A_TURN};
use crate::output::{CoilLimit, Drive};
use crate::profile::{Output, Profile};
use crate::units::Micros;

#[test]
fn every_meter_counts_in_its_turn_although_rows_are_due() {
    let limit = CoilLimit { max_on_ms: 100, duty_percent: 50, window_ms: 1600 };
    let mut profile = Profile::empty();
    for (line, output) in (0..).zip(&mut profile.outputs) {
        *output = Some(Output { drive: Drive::Hold { line }, limit, input: None });
    }
    let mut coils = Coils::new(Box::leak(Box::default()));
    coils.configure(Micros(0), &profile);
    coils.take_outputs(Micros(0), &profile, MAX_COILS);
    for period in 1..20 {
        for tick in 1..100 {
            let now = Micros::from_millis(100 * period + tick);
            coils.pass(now, tick % period == 0).unwrap();
            let latest = coils.outputs.iter().map(|output| now - output.counted).max();
            let is_settled = tick > TICKS_A_TURN.into();
            assert!(!is_settled || latest < Some(Micros::from_millis(TICKS_A_TURN.into())), "{tick}: {latest:?}");
        }
    }
}
