//! A desired frame as rows of the equations.

use darm_core::chain::Parameter;
use darm_core::se::{Pose, Twist, rotation_log};
use darm_core::units::Word;

use crate::arm::frames::DesiredFrame;

/// A desired frame, or any word, whose pose is part of the problem.
pub(in crate::synthesis) struct Target {
    pub(in crate::synthesis) name: String,
    pub(in crate::synthesis) word: Word,
    pub(in crate::synthesis) previous: Word,
    pub(in crate::synthesis) pose: Pose<f64>,
    /// Components of (ω, v) that the frame is judged by, and what each weighs.
    pub(in crate::synthesis) rows: Vec<(usize, f64)>,
    /// Whether the error is that of the rotation vector and of the position, whose sum of squares is the distance that is
    /// reported, and whose gradient is exact. Otherwise it is the screw, along which Gauss–Newton takes fewer steps.
    pub(in crate::synthesis) by_parts: bool,
    /// The stops that its word uses, with their columns.
    pub(in crate::synthesis) used: Vec<(usize, Parameter)>,
}

impl Target {
    /// Writes the weighted error of the frame with the tool at `pose`; how many rows that is.
    pub(in crate::synthesis) fn error(&self, pose: &Pose<f64>, into: &mut [f64]) -> usize {
        let apart = pose.to(&self.pose);
        let six = if self.by_parts {
            Twist { angular: rotation_log(&apart.rotation), linear: apart.position }
        } else {
            apart.log()
        };
        let six = numbers(&six);
        for (row, &(component, weight)) in into.iter_mut().zip(&self.rows) {
            *row = weight * six[component];
        }
        self.rows.len()
    }

    /// The rows that the frame is judged by, of one twist.
    pub(in crate::synthesis) fn weighted(&self, twist: &Twist<f64>) -> impl Iterator<Item = f64> {
        let six = numbers(twist);
        self.rows.iter().map(move |&(component, weight)| weight * six[component])
    }

    /// How the error of the frame falls, row by row, when the tool at `pose` moves with `twist`.
    pub(in crate::synthesis) fn seen(&self, twist: &Twist<f64>, pose: &Pose<f64>) -> [f64; 6] {
        let mut twist = *twist;
        if self.by_parts {
            twist.linear += twist.angular.cross(&pose.to(&self.pose).position);
        }
        numbers(&twist)
    }
}

fn numbers(twist: &Twist<f64>) -> [f64; 6] {
    let (w, v) = (&twist.angular, &twist.linear);
    [w.x, w.y, w.z, v.x, v.y, v.z]
}

/// The components that a frame is judged by.
pub(super) fn rows(frame: &DesiredFrame, planar: bool, length_scale_m: f64) -> Vec<(usize, f64)> {
    let components: &[usize] = match (planar, frame.weights.orientation == 0.0) {
        (true, false) => &[2, 3, 4],
        (true, true) => &[3, 4],
        (false, false) => &[0, 1, 2, 3, 4, 5],
        (false, true) => &[3, 4, 5],
    };
    let weight = |component| {
        if component < 3 { frame.weights.orientation * length_scale_m } else { frame.weights.position }
    };
    components.iter().map(|&component| (component, weight(component))).collect()
}
