//! What is left of each axis, held against the noise: the test that needs no list of effects.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::select::significance::f_test;

/// What is left may exceed the noise by this factor (root mean square): fits are not exact, and rows are not all alike.
pub(crate) const MAX_OVER_NOISE: f64 = 1.2;
/// Chance that any axis of what is left, being just so much above the noise, is said to exceed it.
const BOUND_LEVEL: f64 = 0.01;
/// Share of the numbers, the farthest off, that do not count beside those that are as many times the noise off: noise of another
/// distribution than the normal one has more of them. Blunders of an instrument are in few rows: of more the largest share.
const TRIMMED: f64 = 0.02;
const FAR: f64 = 5.0;
const MAX_TRIMMED: f64 = 0.12;
/// What trimming leaves of the degrees of freedom.
const TRIMMED_DOF: f64 = 0.8;

/// What is left of one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AxisLeft {
    /// Its number: other rows of it are beside the same noise.
    pub(crate) axis: usize,
    /// Its mean square in units of the noise's.
    pub(crate) ratio: f64,
    /// Degrees of freedom of what is left, and of the noise.
    pub(crate) dof: [f64; 2],
}

impl AxisLeft {
    /// What residuals leave that `fitted` values were fitted to, beside a noise of this mean square.
    pub(crate) fn over_noise(
        axis: usize,
        residuals: &[f64],
        fitted: f64,
        noise: f64,
        noise_dof: usize,
    ) -> Option<Self> {
        Self::of(axis, residuals, fitted, |_| noise, noise_dof as f64)
    }

    /// What is left of an axis beside a sample of the noise alone: as large a share of the sample does not count.
    pub(crate) fn over_sample(
        axis: usize,
        residuals: &[f64],
        fitted: f64,
        noise: &[f64],
        noise_dof: usize,
    ) -> Option<Self> {
        let sorted = sorted_squares(noise);
        Self::of(axis, residuals, fitted, |share| trimmed_mean(&sorted, share), TRIMMED_DOF * noise_dof as f64)
    }

    fn of(axis: usize, residuals: &[f64], fitted: f64, noise: impl Fn(f64) -> f64, noise_dof: f64) -> Option<Self> {
        let (sorted, n) = (sorted_squares(residuals), residuals.len() as f64);
        let rest = n - fitted;
        let limit = FAR * FAR * noise(TRIMMED);
        let far = sorted.iter().rev().take_while(|square| **square > limit).count();
        let share = (TRIMMED + far as f64 / n).min(MAX_TRIMMED);
        let ratio = trimmed_mean(&sorted, share) / noise(share).max(f64::MIN_POSITIVE);
        (rest >= 1.0).then(|| Self { axis, ratio: ratio * n / rest, dof: [(TRIMMED_DOF * rest).max(1.0), noise_dof] })
    }
}

/// Whether what is left is above the noise by more than [`MAX_OVER_NOISE`], on any axis or on all of them together: the lower bound
/// of the ratio, by the F distribution with the degrees of freedom of both. What is little on each axis is seen on all.
pub(crate) fn exceeds_noise(axes: &[AxisLeft]) -> bool {
    let level = BOUND_LEVEL / axes.len().max(1) as f64;
    axes.iter().any(|axis| chance(axis) < level) || together(axes).is_some_and(|all| chance(&all) < BOUND_LEVEL)
}

/// Chance of as much where the ratio is [`MAX_OVER_NOISE`].
fn chance(left: &AxisLeft) -> f64 {
    let [dof, noise_dof] = left.dof.map(|dof| dof as usize);
    f_test(left.ratio / (MAX_OVER_NOISE * MAX_OVER_NOISE), dof, noise_dof)
}

/// What is left of all axes, each in units of its noise; the noise of an axis counts once.
fn together(axes: &[AxisLeft]) -> Option<AxisLeft> {
    let first = axes.first()?;
    let [sum, dof] = axes.iter().fold([0.0; 2], |[sum, dof], left| [sum + left.ratio * left.dof[0], dof + left.dof[0]]);
    let is_new = |k: &usize| axes[..*k].iter().all(|other| other.axis != axes[*k].axis);
    let noise_dof = (0..axes.len()).filter(is_new).map(|k| axes[k].dof[1]).sum();
    Some(AxisLeft { axis: first.axis, ratio: sum / dof, dof: [dof, noise_dof] })
}

fn sorted_squares(numbers: &[f64]) -> Vec<f64> {
    let mut squares: Vec<f64> = numbers.iter().map(|number| number * number).collect();
    squares.sort_unstable_by(f64::total_cmp);
    squares
}

/// The mean of squares without the largest, in units of what it is of normal numbers of variance 1.
fn trimmed_mean(sorted: &[f64], share: f64) -> f64 {
    let kept = &sorted[..sorted.len() - (sorted.len() as f64 * share) as usize];
    let mean = kept.iter().sum::<f64>() / kept.len().max(1) as f64;
    // Of χ² with one degree of freedom, the mean of what lies below a quantile is F₃/F₁ there.
    let [Ok(chi), Ok(next)] = [1.0, 3.0].map(ChiSquared::new) else { return mean };
    let share = (sorted.len() as f64 * share).floor() / sorted.len().max(1) as f64;
    if share > 0.0 { mean * (1.0 - share) / next.cdf(chi.inverse_cdf(1.0 - share)) } else { mean }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt as _, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal, StudentT};

    use super::*;

    const SEED: u64 = 7;

    /// How many of 300 logs of noise with this number of rows, and repeats, seem to hold more than noise.
    fn alarms(rows: usize, repeats: usize, mut number: impl FnMut(&mut ChaCha8Rng) -> f64) -> usize {
        let mut random = ChaCha8Rng::seed_from_u64(SEED);
        let mut draw = |n: usize| (0..n).map(|_| number(&mut random)).collect::<Vec<f64>>();
        let mut alarm = || {
            let axes = (0..3).map(|axis| {
                let (rows, repeats) = (draw(rows), draw(repeats));
                let noise = repeats.iter().map(|r| r * r).sum::<f64>() / repeats.len() as f64;
                AxisLeft::over_noise(axis, &rows, 0.0, noise, repeats.len()).unwrap()
            });
            exceeds_noise(&axes.collect::<Vec<_>>())
        };
        (0..300).filter(|_| alarm()).count()
    }

    #[test]
    fn noise_of_any_distribution_does_not_exceed_itself() {
        for repeats in [10, 20, 100] {
            let normal = alarms(200, repeats, |random| StandardNormal.sample(random));
            let even = alarms(200, repeats, |random| random.random_range(-1.0..1.0));
            let heavy = alarms(200, repeats, |random| StudentT::new(3.0).unwrap().sample(random));
            let with_blunders = alarms(200, repeats, |random| {
                let normal: f64 = StandardNormal.sample(random);
                if random.random_bool(0.005) { 100.0 * normal } else { normal }
            });
            assert!(
                normal + even + with_blunders <= 3 && heavy <= 6,
                "{repeats}: {normal} {even} {heavy} {with_blunders}"
            );
        }
    }

    #[test]
    fn twice_the_noise_exceeds_it_where_the_noise_is_known_well() {
        let left = |ratio: f64, noise_dof: f64| AxisLeft { axis: 0, ratio, dof: [200.0, noise_dof] };
        assert!(exceeds_noise(&[left(1.0, 100.0), left(4.0, 100.0)]));
        assert!(exceeds_noise(&[left(5.1, 29.0); 3]), "an axis of 2.26 times a repeatability of 29 degrees of freedom");
        assert!(!exceeds_noise(&[left(1.3, 1e4); 3]), "1.14 times");
        assert!(!exceeds_noise(&[left(4.0, 10.0); 3]), "ten degrees of freedom say little");
    }

    #[test]
    fn half_as_much_again_as_the_noise_is_seen_on_three_axes_together() {
        let left = |axis: usize| AxisLeft { axis, ratio: 2.25, dof: [120.0, 33.0] };
        assert!(!exceeds_noise(&[left(0), left(0)]), "a noise of 33 degrees of freedom");
        assert!(exceeds_noise(&[left(0), left(1), left(2), left(0), left(1), left(2)]));
    }

    #[test]
    fn rows_that_are_far_off_decide_nothing() {
        let mut random = ChaCha8Rng::seed_from_u64(SEED);
        let mut rows: Vec<f64> = (0..400).map(|_| StandardNormal.sample(&mut random)).collect();
        rows.iter_mut().step_by(20).for_each(|row| *row = 1e3);
        assert!(!exceeds_noise(&[AxisLeft::over_noise(0, &rows, 4.0, 1.0, 60).unwrap()]));
    }
}
