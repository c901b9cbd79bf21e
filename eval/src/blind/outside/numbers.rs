//! Shapes along time and along other numbers, that generators share.

use std::f64::consts::TAU;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Numbers less their mean, of root mean square 1.
pub(super) fn centred(numbers: &[f64]) -> Vec<f64> {
    let mean = numbers.iter().sum::<f64>() / numbers.len().max(1) as f64;
    let square = numbers.iter().map(|number| (number - mean).powi(2)).sum::<f64>() / numbers.len().max(1) as f64;
    numbers.iter().map(|number| (number - mean) / square.sqrt().max(1e-300)).collect()
}

/// Where each number is among all, from 0 to 1 along their range.
pub(super) fn ranks(numbers: &[f64]) -> Vec<f64> {
    let (low, high) = numbers.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), n| (l.min(*n), h.max(*n)));
    numbers.iter().map(|number| (number - low) / (high - low).max(1e-300)).collect()
}

pub(super) fn quantile(numbers: &[f64], share: f64) -> f64 {
    let mut sorted = numbers.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted[(share * (sorted.len() - 1) as f64) as usize]
}

/// Standard normal: the sum of twelve even numbers.
pub(super) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| rng.random_range(-0.5..0.5)).sum()
}

/// A wave in time: 4 to 12 periods in the log.
pub(super) fn hum(times: &[f64], rng: &mut ChaCha8Rng) -> Vec<f64> {
    let (periods, phase) = (rng.random_range(4.0..12.0), rng.random_range(0.0..TAU));
    ranks(times).iter().map(|share| (TAU * periods * share + phase).sin()).collect()
}

/// On and off again, in two to four windows of the log.
pub(super) fn on_and_off(times: &[f64], rng: &mut ChaCha8Rng) -> Vec<f64> {
    let (windows, phase) = (rng.random_range(2.0..4.0), rng.random_range(0.0..1.0));
    ranks(times).iter().map(|share| f64::from(u8::from((windows * share + phase).fract() < 0.5))).collect()
}

/// A walk by chance, of 60 steps in the log.
pub(super) fn walk(times: &[f64], rng: &mut ChaCha8Rng) -> Vec<f64> {
    let mut at = vec![0.0; 62];
    (1..at.len()).for_each(|k| at[k] = at[k - 1] + normal(rng));
    let between = |share: f64| {
        let (full, part) = ((60.0 * share) as usize, (60.0 * share).fract());
        at[full] + part * (at[full + 1] - at[full])
    };
    ranks(times).into_iter().map(between).collect()
}

/// Short pulses, 8 to 16 in the log.
pub(super) fn pulses(times: &[f64], rng: &mut ChaCha8Rng) -> Vec<f64> {
    let (pulses, phase) = (rng.random_range(8.0..16.0), rng.random_range(0.0..1.0));
    ranks(times).iter().map(|share| f64::from(u8::from((pulses * share + phase).fract() < 0.15))).collect()
}
