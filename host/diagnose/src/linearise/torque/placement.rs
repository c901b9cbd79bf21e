//! Errors of a robot's placement as they show in its joint torques: joints that are not where their encoders show them, and
//! a base that is not level.
//!
//! | law | of | values | column |
//! | --- | --- | --- | --- |
//! | `joint-offset` | a joint at q + δ where q is shown | δ, rad or m | ∂τ/∂q at the rates of the row |
//! | `base-tilt` | a base turned by θ about the two axes across gravity, where that shows | θ, rad | torques of the weight in the field −θ×g |
//!
//! ∂τ/∂q is a central difference with h = 1e-4: with τ made of sines of q, its error is about h²/6 of the torque, and
//! that of rounding 1e-16/h, both below 1e-8 of it. A second order in δ and θ is left out: at 0.05 rad (3 deg) 2.5 % of what
//! the effect changes.

use darm_core::actuator::JointKind;
use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_core::tree::TreeError;
use darm_robot::robot::Robot;
use darm_robot::tree::LinkTree;
use darm_robot::tree::spatial::Motion;
use rayon::prelude::{IntoParallelRefIterator as _, ParallelIterator as _};

use crate::effect::{Law, Place, Site};
use crate::linearise::experiment::{Candidate, Value};
use crate::linearise::serial_chain::{OFFSET, TURNS, across};

/// The step of the differences, rad or m.
const STEP: f64 = 1e-4;
/// Units, and how large an angle and a length are before anything is measured.
const TURN: (&str, f64) = ("rad", 0.1);
const SHIFT: (&str, f64) = ("m", 0.02);
/// A column below this share of the largest torque changes nothing: of the first joint about a vertical axis, say.
const NEGLIGIBLE: f64 = 1e-9;

/// Positions, velocities and accelerations of all joints in one row, rad or m.
pub(super) type State<'a> = [&'a [f64]; 3];

/// The candidates that change these torques, given the site of each joint.
pub(super) fn candidates(robot: &Robot, states: &[[Vec<f64>; 3]], sites: &[Site]) -> Result<Vec<Candidate>, TreeError> {
    let tree = robot.link_tree()?;
    let of = |column: &(dyn Fn(State) -> Vec<f64> + Sync)| -> Vec<f64> {
        states.par_iter().flat_map_iter(|[q, v, a]| column([q, v, a])).collect()
    };
    let largest = of(&|state| torques(&tree, state)).iter().fold(0.0, |largest: f64, torque| largest.max(torque.abs()));
    let shows = |column: &[f64]| column.iter().any(|slope| slope.abs() > NEGLIGIBLE * largest);
    let value = |name: &str, (unit, prior): (&str, f64), column: Vec<f64>| Value {
        name: name.into(),
        unit: unit.into(),
        prior,
        min: f64::NEG_INFINITY,
        column,
    };
    let mut candidates = Vec::new();
    for (joint, site) in sites.iter().enumerate() {
        let column = of(&|state| slope(&tree, state, joint));
        let turns = robot.joints[joint].joint.axis.kind == JointKind::Revolute;
        if shows(&column) {
            let values = vec![value(OFFSET[0], if turns { TURN } else { SHIFT }, column)];
            candidates.push(Candidate { law: Law::JointOffset, site: site.clone(), shape: None, values });
        }
    }
    let turned = |about: Vec3<f64>| {
        let mut turned = tree.clone();
        turned.gravity = -about.cross(&tree.gravity);
        turned
    };
    let turns = axes_of_tilt(&robot.gravity).map(turned);
    let turns = turns.map(|tree| of(&|[q, ..]: State| torques(&tree, [q, &[], &[]])));
    // A robot whose axes are parallel shows one turn only.
    let values = TURNS.into_iter().zip(turns).filter(|(_, column)| shows(column));
    let values: Vec<Value> = values.map(|(name, column)| value(name, TURN, column)).collect();
    if !values.is_empty() {
        candidates.push(Candidate {
            law: Law::BaseTilt,
            site: Site::new(Place::Base, "the base"),
            shape: None,
            values,
        });
    }
    Ok(candidates)
}

/// The two axes across gravity about which a base tilts: where gravity is along −z these are x and y.
fn axes_of_tilt(gravity: &Vec3<f64>) -> [Vec3<f64>; 2] {
    across(&gravity.try_normalize(0.0).map_or(Vec3::z(), |down| -down))
}

/// The torques of a state; without its rates, those of the weight.
fn torques(tree: &LinkTree, [q, v, a]: State) -> Vec<f64> {
    tree.inverse_dynamics(&tree.place(&Pose::identity(), q), &Motion::at_rest(&Vec3::zeros()), [v, a]).1
}

/// How the torques change with the position of a joint.
fn slope(tree: &LinkTree, [q, v, a]: State, joint: usize) -> Vec<f64> {
    let moved = |by: f64| {
        let mut moved = q.to_vec();
        moved[joint] += by;
        torques(tree, [&moved, v, a])
    };
    moved(STEP).iter().zip(&moved(-STEP)).map(|(above, below)| (above - below) / (2.0 * STEP)).collect()
}
