//! The nearest word and servo angles of an arm with servo joints, to a stated gap.
//!
//! For fixed angles a the exact search gives f(a), the distance of the nearest word. Turning servo i by δ moves the
//! tool by δ about an axis that is no further away than r_i, the stages behind it stretched out: the distance to any
//! pose changes by Λ_i δ at most, Λ_i = √(r_i² + ℓ²) of a turning joint and 1 of a sliding one. So f ≥ f(c) − Σ Λ_i h_i
//! within a box of angles with centre c and half edges h, for all words at once. Boxes are halved, the one with the
//! least bound first, until no box can hold anything nearer by more than the gap; what is found is made better by
//! Gauss–Newton steps for its word.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use darm_core::actuator::{JointKind, Stage};
use darm_core::se::Pose;

use super::ReachError;
use super::exact::{Index, Near, Options, Query};
use super::refine::{range, refine};
use super::steps::{Step, tabulate};
use crate::arm::{Arm, ArmScratch};

/// When a search ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// No word and angles are closer than what is found by more than this, m.
    pub gap_m: f64,
    /// Most boxes that are looked at, whether or not the gap is closed.
    pub max_boxes: usize,
}

impl Gap {
    /// A gap with as many boxes as take seconds for an arm of a few thousand words.
    pub fn of_m(gap_m: f64) -> Self {
        Self { gap_m, max_boxes: 4000 }
    }
}

/// What was found, and what cannot be.
#[derive(Clone, Debug, PartialEq)]
pub struct WithServos {
    /// The nearest words at the angles below, nearest first.
    pub nearest: Vec<Near>,
    /// Where the servo joints stand, rad.
    pub servos_rad: Vec<f64>,
    /// No word at any angles within the servos' ranges is closer than this, m.
    pub lower_bound_m: f64,
    /// How many boxes were looked at.
    pub boxes: usize,
}

/// Angles from `center − half` to `center + half`, and the distance below which none of them can be, m.
#[derive(Clone, Debug, PartialEq)]
struct Angles {
    bound_m: f64,
    center: Vec<f64>,
    half: Vec<f64>,
}

/// The nearest words at the best angles of the servos; those of `options` are not read.
///
/// `go_on` hears how many boxes were looked at; where it says no, the search ends with what is found and proven.
///
/// # Errors
///
/// As [`Index::new`], at some angles of the servos.
pub fn with_servos(
    arm: &Arm,
    query: &Query<'_>,
    options: &Options,
    gap: &Gap,
    mut go_on: impl FnMut(usize) -> bool,
) -> Result<WithServos, ReachError> {
    let &Query { target, count, forbidden } = query;
    let at = |servos: &[f64]| Index::new(arm, &Options { servos_rad: servos.to_vec(), ..options.clone() });
    let growth = growth_per_rad(arm, options.length_scale_m);
    let (center, half): (Vec<_>, Vec<_>) = (0..arm.n_servos())
        .map(|servo| range(arm, servo))
        .map(|(min, max)| (0.5 * (min + max), 0.5 * (max - min)))
        .unzip();
    let mut found: Option<(f64, Vec<f64>)> = None;
    let mut boxes = 0;
    let mut open = BinaryHeap::from([Angles { bound_m: 0.0, center, half }]);
    let mut lower_bound_m = 0.0;
    while let Some(angles) = open.pop() {
        lower_bound_m = angles.bound_m;
        let best_m = found.as_ref().map_or(f64::INFINITY, |(best_m, _)| *best_m);
        if lower_bound_m >= best_m - gap.gap_m || boxes >= gap.max_boxes || !go_on(boxes) {
            break;
        }
        boxes += 1;
        let Some(near) = at(&angles.center)?.nearest(target, 1, forbidden).into_iter().next() else { break };
        let better = refined(arm, target, &near, &angles.center, options.length_scale_m);
        if better.0 < best_m {
            found = Some(better);
        }
        let slack: f64 = growth.iter().zip(&angles.half).map(|(growth, half)| growth * half).sum();
        halve(&angles, &growth, angles.bound_m.max(near.distance_m - slack), &mut open);
    }
    let servos_rad = found.map_or_else(|| vec![0.0; arm.n_servos()], |(_, servos_rad)| servos_rad);
    let nearest = at(&servos_rad)?.nearest(target, count, forbidden);
    let lower_bound_m = nearest.first().map_or(lower_bound_m, |near| near.distance_m.min(lower_bound_m));
    Ok(WithServos { nearest, servos_rad, lower_bound_m, boxes })
}

/// The two halves of a box, across the edge that moves the tool most.
fn halve(angles: &Angles, growth: &[f64], bound_m: f64, open: &mut BinaryHeap<Angles>) {
    let moves = |servo: &usize| growth[*servo] * angles.half[*servo];
    let Some(servo) = (0..growth.len()).max_by(|a, b| moves(a).total_cmp(&moves(b))) else { return };
    for side in [-0.5, 0.5] {
        let mut part = Angles { bound_m, ..angles.clone() };
        part.center[servo] += side * angles.half[servo];
        part.half[servo] *= 0.5;
        open.push(part);
    }
}

/// By how much the distance to any pose can change with each servo, m per rad or per m.
fn growth_per_rad(arm: &Arm, length_scale_m: f64) -> Vec<f64> {
    let mut lever_m = arm.model.chain.tool.position.norm();
    let mut growth = Vec::new();
    for (stage, step) in arm.model.chain.stages.iter().zip(tabulate(arm)).rev() {
        match (step, stage) {
            (Step::Poses(poses), _) => {
                lever_m += poses.iter().fold(0.0, |largest: f64, (_, pose)| largest.max(pose.position.norm()));
            }
            (Step::Servo { .. }, Stage::Servo(joint)) if joint.axis.kind == JointKind::Prismatic => {
                let (min, max) = range(arm, arm.n_servos() - 1 - growth.len());
                growth.push(1.0);
                lever_m += (min + joint.offset).abs().max((max + joint.offset).abs());
            }
            (Step::Servo { .. }, _) => growth.push(lever_m.hypot(length_scale_m)),
        }
    }
    growth.reverse();
    growth
}

/// The angles made better for the word that was found, and the distance there.
fn refined(arm: &Arm, target: &Pose<f64>, near: &Near, servos_rad: &[f64], length_scale_m: f64) -> (f64, Vec<f64>) {
    let chain = &arm.model.chain;
    let mut scratch = ArmScratch::default();
    let mut look = |servos: &[f64]| {
        let pose = chain.pose_base_tool(&near.word, servos, &mut scratch).ok()?;
        Some((pose, chain.servo_jacobian(&scratch).collect::<Vec<_>>()))
    };
    let better = refine(arm, target, servos_rad.to_vec(), &mut look);
    let distance_m = look(&better).map_or(f64::INFINITY, |(pose, _)| pose.distance(target, length_scale_m));
    if distance_m < near.distance_m { (distance_m, better) } else { (near.distance_m, servos_rad.to_vec()) }
}

impl Eq for Angles {}

impl PartialOrd for Angles {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// The least bound is the greatest, as a heap wants it.
impl Ord for Angles {
    fn cmp(&self, other: &Self) -> Ordering {
        other.bound_m.total_cmp(&self.bound_m)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::{Gap, with_servos};
    use crate::arm::{Arm, ArmScratch};
    use crate::reach::exact::{Options, Query};

    #[test]
    fn the_gap_is_closed_and_the_bound_holds() {
        let arm = Arm::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/planar4-hybrid.toml")).unwrap();
        let word = "010110011101".parse().unwrap();
        let target = arm.model.chain.pose_base_tool(&word, &[0.31], &mut ArmScratch::default()).unwrap();
        let found = with_servos(
            &arm,
            &Query { target: &target, count: 1, forbidden: &[] },
            &Options::of(&arm),
            &Gap::of_m(0.02),
            |_| true,
        )
        .unwrap();
        assert!(found.nearest[0].distance_m - found.lower_bound_m <= 0.02, "{found:?}");
        assert!(found.nearest[0].distance_m <= 0.02 && found.boxes < 4000, "{found:?}");
    }
}
