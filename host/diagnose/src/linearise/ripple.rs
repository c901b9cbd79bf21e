//! How many periods a turn a torque ripples with, where no gear ratio is known: peaks of a least-squares periodogram.
//!
//! For each number of periods n the sine and the cosine of n·q are added to what any joint may have (an offset, slopes of
//! position, velocity and acceleration, friction that turns round), and the share of the residual that they take up is
//! the power at n (Lomb, Least-squares frequency analysis of unequally spaced data, 1976, with more than a mean taken out).

use std::f64::consts::TAU;

use crate::linearise::laws::{Coordinate, range};
use crate::prepare::repeatability::MEDIAN_OF_NORMAL;
use darm_measure::{median, root_mean_square};

/// Steps of the periodogram for one period more in the range of the position.
const STEPS: f64 = 8.0;
/// Periods in the range, at least and at most: fewer are a spring, more are seldom distinguished from noise. What rises
/// towards either end is no peak.
const PERIODS: [f64; 2] = [0.75, 40.0];
/// Rows that are looked at.
const MAX_ROWS: usize = 4000;
/// v₀ of the friction that is taken out, over the root mean square of v.
const CREEP: f64 = 0.1;
/// A direction shorter than this share of itself is one that the others have.
const DEPENDENT: f64 = 1e-6;
/// Halvings of the step around a peak.
const REFINED: usize = 10;
/// Rows farther than this from a plain motion with a ripple, in units of what is usual, count as so far off; and how often that
/// is looked at again.
const FAR: f64 = 4.0;
const ROUNDS: usize = 3;

/// The periods a turn of the `count` highest peaks of the residual of `seen` rows; fewer where it has fewer.
pub(crate) fn periods_a_turn(
    coordinate: &Coordinate,
    residual: &[f64],
    seen: impl Fn(usize) -> bool,
    count: usize,
) -> Vec<f64> {
    if count == 0 {
        return Vec::new();
    }
    let rows: Vec<usize> = (0..residual.len()).filter(|row| seen(*row)).collect();
    let rows: Vec<usize> = rows.iter().copied().step_by(rows.len().div_ceil(MAX_ROWS).max(1)).collect();
    let of = |channel: &[f64]| -> Vec<f64> { rows.iter().map(|row| channel[*row]).collect() };
    let spectrum = Spectrum::new(&of(coordinate.position), &of(coordinate.velocity), &of(coordinate.acceleration));
    let (torque, mut near) = (of(residual), of(residual));
    let mut found = Vec::new();
    for _ in 0..ROUNDS {
        found = spectrum.peaks(&near, count);
        near = winsorized(&torque, &spectrum.rest(&near, found.first().copied()), &near);
    }
    found
}

/// The torques, none of them farther than usual from those that `rest` is left of.
fn winsorized(torque: &[f64], rest: &[f64], of: &[f64]) -> Vec<f64> {
    let fitted: Vec<f64> = of.iter().zip(rest).map(|(of, rest)| of - rest).collect();
    let off = torque.iter().zip(&fitted).map(|(torque, fitted)| torque - fitted);
    let far = FAR / MEDIAN_OF_NORMAL * median(off.clone().map(f64::abs)).unwrap_or_default();
    off.zip(&fitted).map(|(off, fitted)| fitted + off.max(-far).min(far)).collect()
}

fn is_peak(power: &[f64], k: usize) -> bool {
    let is_lower =
        |other: Option<usize>| other.and_then(|other| power.get(other)).is_some_and(|other| *other < power[k]);
    is_lower(k.checked_sub(1)) && is_lower(Some(k + 1))
}

/// The positions, and orthonormal columns of what any joint may have.
struct Spectrum {
    position: Vec<f64>,
    plain: Vec<Vec<f64>>,
}

impl Spectrum {
    fn new(position: &[f64], velocity: &[f64], acceleration: &[f64]) -> Self {
        let creep = (CREEP * root_mean_square(velocity)).max(f64::MIN_POSITIVE);
        let friction = velocity.iter().map(|v| (v / creep).tanh()).collect();
        let columns = [vec![1.0; position.len()], position.into(), velocity.into(), acceleration.into(), friction];
        let mut spectrum = Self { position: position.into(), plain: Vec::new() };
        for column in columns {
            let column = spectrum.unit_without_plain(column);
            spectrum.plain.extend(column);
        }
        spectrum
    }

    /// The periods a turn of the `count` highest peaks, the highest one first.
    fn peaks(&self, torque: &[f64], count: usize) -> Vec<f64> {
        let (left, reach) = (self.without_plain(torque.to_vec()), range(&self.position));
        if reach <= 0.0 {
            return Vec::new();
        }
        let step = TAU / reach / STEPS;
        let [first, last] = PERIODS.map(|periods| (periods * STEPS) as usize);
        let power: Vec<f64> = (first..=last).map(|k| self.power(&left, k as f64 * step)).collect();
        let mut peaks: Vec<usize> = (0..power.len()).filter(|&k| is_peak(&power, k)).collect();
        peaks.sort_by(|a, b| power[*b].total_cmp(&power[*a]));
        peaks.truncate(count);
        peaks.iter().map(|&k| self.refined(&left, (first + k) as f64 * step, step)).collect()
    }

    /// What is left without the plain columns and a ripple.
    fn rest(&self, torque: &[f64], periods: Option<f64>) -> Vec<f64> {
        let mut rest = self.without_plain(torque.to_vec());
        let waves = periods.map(|periods| self.waves(periods));
        waves.iter().flatten().flatten().for_each(|wave| take_out(&mut rest, wave));
        rest
    }

    /// What a column has beside the plain ones.
    fn without_plain(&self, mut column: Vec<f64>) -> Vec<f64> {
        self.plain.iter().for_each(|plain| take_out(&mut column, plain));
        column
    }

    /// What a column has beside the plain ones, scaled to length one; `None` where it has nothing beside them.
    fn unit_without_plain(&self, column: Vec<f64>) -> Option<Vec<f64>> {
        let before = dot(&column, &column).sqrt();
        unit(self.without_plain(column), before)
    }

    /// The sum of squares of `left` that a ripple of `periods` a turn takes up.
    fn power(&self, left: &[f64], periods: f64) -> f64 {
        self.waves(periods).iter().flatten().map(|wave| dot(wave, left).powi(2)).sum()
    }

    /// Orthonormal columns of a ripple beside the plain ones.
    fn waves(&self, periods: f64) -> [Option<Vec<f64>>; 2] {
        let wave = |shape: fn(f64) -> f64| self.position.iter().map(|q| shape(periods * q)).collect::<Vec<f64>>();
        let sine = self.unit_without_plain(wave(f64::sin));
        let mut cosine = self.without_plain(wave(f64::cos));
        let length = dot(&cosine, &cosine).sqrt();
        sine.iter().for_each(|sine| take_out(&mut cosine, sine));
        let cosine = unit(cosine, length);
        [sine, cosine]
    }

    /// The peak near `periods`, to `step` halved some times.
    fn refined(&self, left: &[f64], mut periods: f64, mut step: f64) -> f64 {
        for _ in 0..REFINED {
            step *= 0.5;
            let [below, at, above] = [-step, 0.0, step].map(|more| self.power(left, periods + more));
            if below.max(above) > at {
                periods += if below > above { -step } else { step };
            }
        }
        periods
    }
}

fn unit(column: Vec<f64>, before: f64) -> Option<Vec<f64>> {
    let length = dot(&column, &column).sqrt();
    (length > DEPENDENT * before).then(|| column.iter().map(|x| x / length).collect())
}

fn take_out(column: &mut [f64], unit: &[f64]) {
    let along = dot(column, unit);
    column.iter_mut().zip(unit).for_each(|(x, u)| *x -= along * u);
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ripple_is_found_beside_friction_and_springs() {
        let time_s: Vec<f64> = (0..800).map(|k| f64::from(k) * 0.05).collect();
        let of = |shape: &dyn Fn(f64) -> f64| time_s.iter().map(|t| shape(*t)).collect::<Vec<f64>>();
        let position = of(&|t| 0.7 * (0.5 * t).sin() + 0.3 * (1.7 * t).cos());
        let velocity = of(&|t| 0.35 * (0.5 * t).cos() - 0.51 * (1.7 * t).sin());
        let acceleration = of(&|t| -0.175 * (0.5 * t).sin() - 0.867 * (1.7 * t).cos());
        let coordinate = Coordinate {
            position: &position,
            velocity: &velocity,
            acceleration: &acceleration,
            load: None,
            temperature: None,
            time_s: &time_s,
            series: &[0; 800],
            motion: &[0; 800],
            units: ["rad", "N·m", "N·m"],
        };
        let ripple = |q: f64| (13.0 * q + 0.4).sin();
        let torque: Vec<f64> =
            position.iter().zip(&velocity).map(|(q, v)| 0.2 * ripple(*q) + 4.0 * q + 3.0 * v.signum() + 2.0).collect();
        let found = periods_a_turn(&coordinate, &torque, |row| row % 4 > 0, 2);
        assert!((found[0] - 13.0).abs() < 0.1, "{found:?}");
        let mut spoiled = torque.clone();
        spoiled
            .iter_mut()
            .step_by(50)
            .enumerate()
            .for_each(|(k, torque)| *torque += if k % 3 == 0 { 8.0 } else { -6.0 });
        let found = periods_a_turn(&coordinate, &spoiled, |row| row % 4 > 0, 2);
        assert!((found[0] - 13.0).abs() < 0.1, "outliers: {found:?}");
        let resting = Coordinate { position: &[1.0; 800], ..coordinate };
        assert!(periods_a_turn(&resting, &torque, |_| true, 2).is_empty());
        assert!(periods_a_turn(&coordinate, &torque, |_| false, 2).is_empty());
        assert!(periods_a_turn(&coordinate, &[f64::NAN; 800], |_| true, 2).is_empty());
    }
}
