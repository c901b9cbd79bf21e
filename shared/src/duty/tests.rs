//! Output limits at their edges, and the counter against an exact one.

use super::*;
extern crate std;

const LIMIT: MeterLimit = limit(100, 50, 1600);

const fn limit(max_on_ms: u32, duty_percent: u8, window_ms: u32) -> MeterLimit {
    MeterLimit::of(&CoilLimit { max_on_ms, duty_percent, window_ms })
}

#[test]
fn an_output_may_be_on_for_its_longest_time_and_no_longer() {
    let mut meter = DutyMeter::default();
    assert_eq!(meter.pass(Micros::from_millis(100), true, &LIMIT), Ok(()));
    assert_eq!(meter.pass(Micros(2_001), true, &LIMIT), Err(Breach::OnTooLong), "a tick may be 2 ms late");
    assert_eq!(meter.pass(Micros(1), false, &LIMIT), Ok(()));
    assert_eq!(meter.pass(Micros::from_millis(100), true, &LIMIT), Ok(()));
}

#[test]
fn duty_counts_over_a_sliding_window() {
    let mut meter = DutyMeter::default();
    // 60 ms on, 40 ms off is 60 % of the window: too much when the window is half full of current.
    let breach = (0..32).find(|_| {
        let on = meter.pass(Micros::from_millis(60), true, &LIMIT);
        meter.pass(Micros::from_millis(40), false, &LIMIT).unwrap();
        on == Err(Breach::Duty)
    });
    assert_eq!(breach, Some(13), "13 × 60 ms fill half of 1.6 s");
    assert_eq!(meter.pass(Micros::from_millis(4000), false, &LIMIT), Ok(()));
    assert_eq!(meter.pass(Micros::from_millis(60), true, &LIMIT), Ok(()), "the window forgets");
}

#[test]
fn one_long_span_equals_many_short_ones() {
    let (mut long, mut short) = (DutyMeter::default(), DutyMeter::default());
    for (millis, on) in [(37, true), (411, false), (90, true), (13, false), (5000, false), (77, true)] {
        let _ = long.pass(Micros::from_millis(millis), on, &LIMIT);
        (0..millis).for_each(|_| {
            let _ = short.pass(Micros::from_millis(1), on, &LIMIT);
        });
    }
    assert_eq!(long, short);
}

#[test]
fn a_meter_counts_no_less_than_an_exact_one() {
    let mut noise = 1u32;
    let mut meter = DutyMeter::default();
    let mut on_ms = std::vec::Vec::new();
    for _ in 0..400 {
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let (millis, on) = (1 + (noise >> 16) % 90, noise >> 31 == 1);
        let _ = meter.pass(Micros::from_millis(millis), on, &LIMIT);
        on_ms.extend((0..millis).map(|_| u32::from(on)));
        let exact_us: u32 = on_ms.iter().rev().take(1600).sum::<u32>() * 1000;
        let counted_us = meter.used_us(&LIMIT);
        assert!(counted_us >= exact_us, "{counted_us} < {exact_us}");
        assert!(counted_us <= exact_us + 100_000 + 1600 * 1000 / 255 + 4080, "{counted_us} > {exact_us}");
    }
}

#[test]
fn an_exhausted_meter_recovers_within_its_window() {
    let mut meter = DutyMeter::default();
    meter.exhaust(&LIMIT);
    assert!(meter.is_valid());
    assert_eq!(meter.left_us(&LIMIT), 0);
    assert_eq!(meter.pass(Micros::from_millis(10), true, &LIMIT), Err(Breach::Duty));
    meter.exhaust(&LIMIT);
    let recovery = Micros(meter.recovery_us(&LIMIT).into());
    assert_eq!(recovery, Micros::from_millis(1600));
    meter.pass(recovery, false, &LIMIT).unwrap();
    assert_eq!((meter.left_us(&LIMIT), meter.recovery_us(&LIMIT)), (800_000, 0));
    let unlimited = limit(100, 100, 1600);
    meter.exhaust(&unlimited);
    assert_eq!((meter.left_us(&unlimited), meter.recovery_us(&unlimited)), (1_600_000, 0));
}

#[test]
fn any_flipped_bit_makes_a_meter_invalid() {
    let mut meter = DutyMeter::default();
    let _ = meter.pass(Micros::from_millis(333), true, &LIMIT);
    assert!(meter.is_valid() && !DutyMeter::default().is_valid(), "memory of zeros is no meter");
    for bit in 0..32 {
        assert!(!DutyMeter { filled_us: meter.filled_us ^ 1 << bit, ..meter }.is_valid());
        assert!(!DutyMeter { on_us: meter.on_us ^ 1 << bit, ..meter }.is_valid());
        assert!(!DutyMeter { check: meter.check ^ 1 << bit, ..meter }.is_valid());
    }
}

#[test]
fn the_longest_window_fits_the_counters() {
    let limit = limit(3_600_000, 99, CoilLimit::MAX_WINDOW_MS);
    let mut meter = DutyMeter::default();
    let hour = Micros::from_millis(3_600_000);
    assert_eq!(meter.pass(Micros(hour.0 * 98 / 100), true, &limit), Ok(()));
    assert_eq!(meter.pass(Micros(hour.0 / 50), true, &limit), Err(Breach::Duty));
}
