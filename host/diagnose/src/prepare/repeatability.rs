//! The noise of a measurement: how much the pose differs when everything is repeated.
//!
//! Samples repeat each other when word, word before and servo positions are the same and they follow each other
//! directly, so that supply and temperature had no time to change. Where a run has few such repeats, equal conditions at
//! any time serve.

use darm_core::se::Pose;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::prepare::observations::{Observations, axes};
use crate::prepare::resolution::Resolution;
use darm_arm::arm::Arm;
use darm_measure::{Run, Sample, median};

/// The median of |x| of a normal x, in units of its standard deviation.
pub(crate) const MEDIAN_OF_NORMAL: f64 = 0.674_489_75;
/// Degrees of freedom from which on the scatter of repeats is known.
pub(crate) const MIN_DOF: usize = 10;
/// Chance that any repeat of a run without outliers is taken for one.
const FAR_OFF: f64 = 0.01;

/// The scatter of repeated conditions.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseRepeatability {
    /// Standard deviation of each component of a twist, rad and m; 1e-12 where the arm does not move.
    pub sigma: [f64; 6],
    /// Repeats less groups: what the standard deviations rest on.
    pub dof: usize,
    /// Standard deviation of the pose as a distance d, m.
    pub distance_m: f64,
    /// Whether rounding is most of it: the same pose is then off by the same each time, so that the error depends on the word.
    pub is_rounded: bool,
}

impl PoseRepeatability {
    /// Whether it rests on enough repeats to weigh measurements by it.
    pub(crate) fn is_known(&self) -> bool {
        self.dof >= MIN_DOF
    }
}

/// The noise by repeated conditions; `None` where nothing is repeated.
///
/// Repeats that are far off by a first estimate, which rests on medians, do not count in the second.
pub fn repeated(arm: &Arm, run: &Run) -> Option<PoseRepeatability> {
    let training: Vec<&Sample> = run.training().map(|(_, sample)| sample).collect();
    let groups = groups(&training);
    if groups.is_empty() {
        return None;
    }
    let groups: Vec<Vec<[f64; 6]>> = groups.iter().map(|group| twists(group)).collect();
    let resolution = Resolution::of(&training);
    let with_rounding = |variance: [f64; 6]| std::array::from_fn(|axis| resolution.added_to(axis, variance[axis]));
    let rough: [f64; 6] = with_rounding(rough_variance(&groups));
    let n_repeats = groups.iter().map(Vec::len).sum::<usize>();
    let axes = axes(arm);
    let limit = ChiSquared::new(axes.len() as f64).ok()?.inverse_cdf(1.0 - FAR_OFF / n_repeats.max(1) as f64);
    let near = |deviation: &[f64; 6]| {
        let square = |&axis: &usize| deviation[axis].powi(2) / rough[axis].max(f64::MIN_POSITIVE);
        axes.iter().map(square).sum::<f64>() < limit
    };
    let (mut squares, mut dof) = ([0.0; 6], 0);
    for group in &groups {
        let middle = middle(group);
        let kept: Vec<[f64; 6]> = group.iter().filter(|twist| near(&minus(twist, &middle))).copied().collect();
        let mean = mean(&kept);
        for twist in &kept {
            squares.iter_mut().zip(minus(twist, &mean)).for_each(|(sum, part)| *sum += part * part);
        }
        dof += kept.len().saturating_sub(1);
    }
    (dof > 0).then(|| {
        let repeated = squares.map(|sum| sum / dof as f64);
        let variance = with_rounding(repeated);
        let is_rounded = axes.iter().any(|&axis| variance[axis] > 2.0 * repeated[axis]);
        PoseRepeatability { is_rounded, ..of_variance(arm, variance, dof) }
    })
}

/// The variance of each component by the median of the differences of successive twists of a group: these have twice the
/// variance, however large the group is, and no middle that is one of the twists.
fn rough_variance(groups: &[Vec<[f64; 6]>]) -> [f64; 6] {
    let of_axis = |axis: usize| {
        let successive = groups.iter().flat_map(|group| group.windows(2));
        let sizes = successive.map(|pair| (pair[1][axis] - pair[0][axis]).abs());
        (median(sizes).expect("a word was repeated") / MEDIAN_OF_NORMAL).powi(2) / 2.0
    };
    std::array::from_fn(of_axis)
}

fn middle(twists: &[[f64; 6]]) -> [f64; 6] {
    std::array::from_fn(|axis| median(twists.iter().map(|twist| twist[axis])).expect("a group holds repeats"))
}

fn mean(twists: &[[f64; 6]]) -> [f64; 6] {
    std::array::from_fn(|axis| twists.iter().map(|twist| twist[axis]).sum::<f64>() / twists.len().max(1) as f64)
}

fn minus(a: &[f64; 6], b: &[f64; 6]) -> [f64; 6] {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

/// The noise with these variances of the components of a twist.
pub fn of_variance(arm: &Arm, variance: [f64; 6], dof: usize) -> PoseRepeatability {
    let mut sigma = [1e-12; 6];
    let mut distance = 0.0;
    for &axis in axes(arm) {
        sigma[axis] = variance[axis].sqrt().max(1e-12);
        let scale = if axis < 3 { arm.length_scale_m } else { 1.0 };
        distance += variance[axis] * scale * scale;
    }
    PoseRepeatability { sigma, dof, distance_m: distance.sqrt(), is_rounded: false }
}

/// The noise that residuals would be of, if they were noise alone: by the median of their sizes, so that rows which are
/// far off do not count.
pub fn of_residuals(arm: &Arm, observations: &Observations, residuals: &[f64]) -> PoseRepeatability {
    let mut variance = [0.0; 6];
    for (k, &axis) in observations.axes.iter().enumerate() {
        let sizes = residuals.iter().skip(k).step_by(observations.n_axes()).map(|r| r.abs());
        let median = median(sizes).unwrap_or_default();
        variance[axis] = (median * observations.sigma[axis] / MEDIAN_OF_NORMAL).powi(2);
    }
    of_variance(arm, variance, 0)
}

/// Samples under the same conditions: those that follow each other directly; where these are few, those at any time.
pub(crate) fn groups<'a>(samples: &[&'a Sample]) -> Vec<Vec<&'a Sample>> {
    let groups = successive(samples);
    let dof = groups.iter().map(|group| group.len() - 1).sum::<usize>();
    if dof < MIN_DOF { anywhere(samples) } else { groups }
}

fn alike(a: &Sample, b: &Sample) -> bool {
    a.word == b.word && a.previous == b.previous && a.servos_rad == b.servos_rad && a.run == b.run
}

/// Runs of samples that follow each other under the same conditions.
fn successive<'a>(samples: &[&'a Sample]) -> Vec<Vec<&'a Sample>> {
    samples.chunk_by(|a, b| alike(a, b)).filter(|group| group.len() > 1).map(<[_]>::to_vec).collect()
}

/// Samples under the same conditions at any time.
fn anywhere<'a>(samples: &[&'a Sample]) -> Vec<Vec<&'a Sample>> {
    let mut sorted = samples.to_vec();
    sorted.sort_by(|a, b| {
        let servos = || a.servos_rad.iter().zip(&b.servos_rad).map(|(a, b)| a.total_cmp(b)).find(|o| o.is_ne());
        (a.run, a.word, a.previous)
            .cmp(&(b.run, b.word, b.previous))
            .then_with(|| servos().unwrap_or(a.time_s.total_cmp(&b.time_s)))
    });
    successive(&sorted)
}

/// The poses of a group as twists in the frame of its first one.
fn twists(group: &[&Sample]) -> Vec<[f64; 6]> {
    let first: &Pose<f64> = &group[0].pose;
    group.iter().map(|sample| first.to(&sample.pose).log().to_vector().into()).collect()
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// The median of n half-normal numbers scatters by about 0.8/√n of itself: 2 % here, where differences share a twist.
    #[test]
    fn the_first_estimate_is_the_variance_whatever_the_size_of_the_groups() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        for size in 2..6 {
            let mut twist = || std::array::from_fn(|_| StandardNormal.sample(&mut random));
            let groups: Vec<Vec<[f64; 6]>> = (0..2000).map(|_| (0..size).map(|_| twist()).collect()).collect();
            let rough = rough_variance(&groups);
            assert!(rough.iter().all(|variance| (variance - 1.0).abs() < 0.1), "groups of {size}: {rough:?}");
        }
    }
}
