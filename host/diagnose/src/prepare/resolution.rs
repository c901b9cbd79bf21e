//! The resolution of measured poses: what rounding to the digits of a file, or of an instrument, adds to their noise.

use darm_core::se::{Pose, rotation_log};

use darm_measure::Sample;

/// Numbers are rounded where they are multiples of a step within this share of it.
const EXACT: f64 = 1e-4;
/// Fewer different numbers may be multiples of a step by chance.
const MIN_NUMBERS: usize = 10;
/// Steps between the two nearest numbers, at most.
const MAX_STEPS: u32 = 100;
/// Digits of m, rad or degrees that a file has at most where its numbers are rounded.
const MAX_DIGITS: i32 = 9;
const RAD_PER_DEG: f64 = std::f64::consts::PI / 180.0;

/// Variance of the rounding of angles, rad², and of lengths, m²; 0 of numbers that are not rounded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Resolution {
    angle: f64,
    length: f64,
}

impl Resolution {
    pub(crate) fn of(samples: &[&Sample]) -> Self {
        let widest = |coordinates: &dyn Fn(&Pose<f64>) -> [f64; 3]| {
            let coordinates: Vec<[f64; 3]> = samples.iter().map(|sample| coordinates(&sample.pose)).collect();
            let step = |axis: usize| step(coordinates.iter().map(|all| all[axis]).collect());
            (0..3).map(step).fold(0.0, f64::max)
        };
        let [angle, length] =
            [widest(&|pose| rotation_log(&pose.rotation).into()), widest(&|pose| pose.position.into())].map(rounding);
        Self { angle, length }
    }

    /// The variance of a component of a twist, angles first, as [`with_rounding`].
    pub(crate) fn added_to(&self, axis: usize, variance: f64) -> f64 {
        with_rounding(variance, if axis < 3 { self.angle } else { self.length })
    }
}

/// The variance of rounding to a step: its error is uniform within half a step to either side.
pub(crate) fn rounding(step: f64) -> f64 {
    step.powi(2) / 12.0
}

/// The variance of repeats with that of rounding, where they are too near each other to show it: the same number is rounded the same
/// way each time.
pub(crate) fn with_rounding(variance: f64, rounding: f64) -> f64 {
    if variance < 4.0 * rounding { variance + rounding } else { variance }
}

/// The largest step of which all numbers are multiples, from the least on; 0 where there is none.
pub(crate) fn step(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_unstable_by(f64::total_cmp);
    numbers.dedup();
    if numbers.len() < MIN_NUMBERS {
        return 0.0;
    }
    let nearest = numbers.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
    let is_common = |step: &f64| {
        numbers.iter().map(|number| (number - numbers[0]) / step).all(|steps| (steps - steps.round()).abs() < EXACT)
    };
    let coarse = (1..=MAX_STEPS).map(|steps| nearest / f64::from(steps));
    // The difference of two numbers is not exact enough for the digits of a file.
    let digits = (3..=MAX_DIGITS).flat_map(|digits| [1.0, RAD_PER_DEG].map(|unit| unit * 10f64.powi(-digits)));
    coarse.chain(digits).find(is_common).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::step;

    #[test]
    fn numbers_rounded_to_a_step_have_it_and_others_have_none() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let numbers: Vec<f64> = (0..200).map(|_| rng.random_range(-3.0..3.0)).collect();
        assert_eq!(step(numbers.clone()), 0.0);
        for per_unit in [1e3, 1e6, 1e8] {
            let found = step(numbers.iter().map(|number| (number * per_unit).round() / per_unit).collect());
            assert!((found * per_unit - 1.0).abs() < 1e-4, "{found}");
        }
        assert_eq!(step(vec![0.0; 5]), 0.0);
    }
}
