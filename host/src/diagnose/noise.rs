//! The noise of a measurement: how much the pose differs when everything is repeated.
//!
//! Samples repeat each other when word, word before and servo positions are the same and they follow each other
//! directly, so that supply and temperature had no time to change. Where a run has no such repeats, equal conditions at
//! any time serve.

use darm_core::se::Pose;
use serde::Serialize;

use super::observation::axes;
use crate::arm::Arm;
use crate::measurement::{Run, Sample};

/// The scatter of repeated conditions.
#[derive(Clone, Debug, PartialEq)]
pub struct Noise {
    /// Standard deviation of each component of a twist, rad and m; 1e-12 where the arm does not move.
    pub sigma: [f64; 6],
    /// Repeats less groups: what the standard deviations rest on.
    pub dof: usize,
    /// Standard deviation of the pose as a distance d, m.
    pub distance_m: f64,
}

/// The repeatability as it is reported.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Repeatability {
    /// Standard deviation of the pose as a distance d, m.
    pub distance_m: f64,
    /// Standard deviation of each axis.
    pub axes: Vec<super::outcome::AxisFigure>,
    /// Degrees of freedom that it rests on, per axis.
    pub dof: usize,
}

/// The noise told by repeated conditions; `None` where nothing is repeated.
pub fn repeated(arm: &Arm, run: &Run) -> Option<Noise> {
    let training: Vec<&Sample> = run.training().map(|(_, sample)| sample).collect();
    let mut groups = successive(&training);
    if groups.is_empty() {
        groups = anywhere(&training);
    }
    let mut squares = [0.0; 6];
    let mut dof = 0;
    for group in &groups {
        let twists = deviations(group);
        for twist in &twists {
            squares.iter_mut().zip(twist).for_each(|(sum, part)| *sum += part * part);
        }
        dof += group.len() - 1;
    }
    (dof > 0).then(|| of_variance(arm, squares.map(|sum| sum / dof as f64), dof))
}

/// The noise with these variances of the components of a twist.
pub fn of_variance(arm: &Arm, variance: [f64; 6], dof: usize) -> Noise {
    let mut sigma = [1e-12; 6];
    let mut distance = 0.0;
    for &axis in axes(arm) {
        sigma[axis] = variance[axis].sqrt().max(1e-12);
        let scale = if axis < 3 { arm.length_scale_m } else { 1.0 };
        distance += variance[axis] * scale * scale;
    }
    Noise { sigma, dof, distance_m: distance.sqrt() }
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

/// The deviations from the mean of a group, as twists in the frame of its first pose.
fn deviations(group: &[&Sample]) -> Vec<[f64; 6]> {
    let first: &Pose<f64> = &group[0].pose;
    let twists: Vec<_> = group.iter().map(|sample| first.to(&sample.pose).log().to_vector()).collect();
    let mean = twists.iter().sum::<nalgebra::Vector6<f64>>() / group.len() as f64;
    twists.iter().map(|twist| (twist - mean).into()).collect()
}
