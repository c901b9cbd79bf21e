//! Stamps with jitter, rounded or with rows lost, of a wave that was sampled at an even clock, and truly uneven stamps.

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::*;

const PERIOD_S: f64 = 0.005;

fn wave(time_s: f64) -> f64 {
    (3.0 * time_s).sin() + 0.3 * (7.0 * time_s).cos()
}

/// Rows at an even clock with the stamps that `stamp` makes of their times, those of `lost` left out.
fn rows(stamp: impl Fn(usize, f64) -> f64, lost: impl Fn(usize) -> bool) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let kept = (0..2000).filter(|k| !lost(*k)).map(|k| (k, k as f64 * PERIOD_S));
    let (mut stamps, mut times, mut values) = (Vec::new(), Vec::new(), Vec::new());
    for (k, time_s) in kept {
        stamps.push(stamp(k, time_s));
        times.push(time_s);
        values.push(wave(time_s));
    }
    (stamps, times, values)
}

/// Largest difference of the times found from the true ones, less their mean, and what was found.
fn found((mut stamps, times, values): (Vec<f64>, Vec<f64>, Vec<f64>)) -> (f64, Sampling) {
    let series = vec![0; stamps.len()];
    let sampling = find(&mut stamps, &series, &[&values]);
    let late: Vec<f64> = stamps.iter().zip(&times).map(|(own, time)| own - time).collect();
    let mean = late.iter().sum::<f64>() / late.len() as f64;
    (late.iter().map(|late| (late - mean).abs()).fold(0.0, f64::max), sampling)
}

fn random(k: usize) -> f64 {
    ChaCha8Rng::seed_from_u64(k as u64).random_range(-1.0..1.0)
}

#[test]
fn even_stamps_are_kept_and_nothing_is_said() {
    let (worst_s, sampling) = found(rows(|_, time_s| time_s, |_| false));
    assert!(worst_s < 1e-9 && sampling.sentence().is_none(), "{worst_s} {sampling:?}");
}

#[test]
fn jittered_stamps_give_the_even_clock() {
    for share in [0.01, 0.02, 0.2] {
        let (worst_s, sampling) = found(rows(|k, time_s| time_s + share * PERIOD_S * random(k), |_| false));
        assert_eq!((sampling.clock, sampling.n_lost), (Clock::Even, 0));
        // A line through 2000 stamps: its ends are off by 2·σ/√n, σ = share·T/√3, here within 5 of those.
        assert!(worst_s < 10.0 * share * PERIOD_S / 3f64.sqrt() / 2000f64.sqrt(), "{share} {worst_s}");
    }
}

#[test]
fn lost_rows_are_counted_and_keep_their_times() {
    let (worst_s, sampling) = found(rows(|k, time_s| time_s + 0.02 * PERIOD_S * random(k), |k| random(3 * k) > 0.9));
    let n_lost = (0..2000).filter(|k| random(3 * k) > 0.9).count();
    assert_eq!((sampling.clock, sampling.n_lost), (Clock::Even, n_lost));
    assert!(worst_s < 1e-2 * PERIOD_S && sampling.sentence().is_some_and(|text| text.contains("rows missing")));
}

/// A logger that is late, now and then by more than half a period, and loses rows: whatever of both is drawn.
#[test]
fn late_stamps_with_lost_rows_give_the_even_clock() {
    for draw in 0..40 {
        // A late last row looks like one after lost rows.
        let is_last = |k: usize| k > 1990;
        let late = |k: usize| if is_last(k) { 0.0 } else { 0.6 * PERIOD_S * random(7000 * draw + k).abs().powi(3) };
        let is_lost = |k: usize| random(7000 * draw + 3000 + k) > 0.9;
        let rows = rows(|k, time_s| time_s + late(k), is_lost);
        let between = ((rows.1.last().unwrap() - rows.1[0]) / PERIOD_S).round() as usize + 1;
        let n_lost = between - rows.1.len();
        let (worst_s, sampling) = found(rows);
        assert_eq!((sampling.clock, sampling.n_lost), (Clock::Even, n_lost), "{draw}");
        assert!(worst_s < 0.05 * PERIOD_S, "{draw}: {worst_s}");
    }
}

#[test]
fn rounded_stamps_give_the_even_clock() {
    // To two periods, to a millisecond where a period is 5, and to 4 ms, which is no part of it.
    for resolution_s in [2.0 * PERIOD_S, 1e-3, 4e-3] {
        let (worst_s, sampling) = found(rows(|_, time_s| (time_s / resolution_s).round() * resolution_s, |_| false));
        assert_eq!((sampling.clock, sampling.n_lost), (Clock::Even, 0), "{resolution_s}");
        assert!((sampling.period_s / PERIOD_S - 1.0).abs() < 1e-3, "{sampling:?}");
        assert!(worst_s < 0.05 * PERIOD_S, "{resolution_s} {worst_s}");
    }
}

#[test]
fn true_stamps_of_uneven_rows_are_used() {
    let times: Vec<f64> = (0..2000).map(|k| PERIOD_S * (k as f64 + 0.3 * random(k))).collect();
    let values = times.iter().map(|time_s| wave(*time_s)).collect();
    let (worst_s, sampling) = found((times.clone(), times, values));
    assert!(sampling.clock == Clock::Stamps && worst_s < 1e-12, "{sampling:?}");
}

#[test]
fn few_rows_and_rows_at_one_time_are_left_as_they_are() {
    for stamps in [vec![], vec![1.0], vec![2.0; 50], vec![0.0, 0.1, 0.3]] {
        let (series, mut own) = (vec![0; stamps.len()], stamps.clone());
        assert_eq!((find(&mut own, &series, &[]).clock, own), (Clock::Stamps, stamps));
    }
}
