//! Errors of a robot's placement as they show in its joint torques: joints that are not where their encoders show them, and
//! a base that is not level.
//!
//! | law | of | values | column |
//! | --- | --- | --- | --- |
//! | `joint-offset` | a joint at q + δ where q is shown | δ, rad or m | ∂τ/∂q at the rates of the row |
//! | `base-tilt` | a base turned by θ about the two axes across gravity, where that shows | θ, rad | torques of the weight in the field −θ×g |
//!
//! ∂τ/∂q is a central difference with h = 1e-4: with τ made of sines of q, its error is about h²/6 of the torque, and
//! that of rounding 1e-16/h, both below 1e-8 of it. At 0.05 rad (3 deg) the column misses 2.5 % of what the effect changes,
//! which is far above the noise of a good sensor: [`Misplaced::beyond`] gives the rest from the inverse dynamics itself.

use std::collections::{BTreeMap, BTreeSet};

use darm_core::actuator::JointKind;
use darm_core::real::Vec3;
use darm_core::se::{Pose, rotation_exp};
use darm_core::tree::{Body, TreeError};
use darm_robot::robot::Robot;
use darm_robot::tree::LinkTree;
use darm_robot::tree::spatial::Motion;
use rayon::prelude::{IndexedParallelIterator as _, IntoParallelRefIterator as _, ParallelIterator as _};

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

/// A value of a candidate: what it moves.
#[derive(Clone, Copy)]
enum Moves {
    Joint(usize),
    /// The base turns about this axis across gravity, the value with this name.
    Base(Vec3<f64>, &'static str),
}

/// What the tool carries in a row: the number of its body, and the link that it is fixed to.
pub(super) type Carried = Option<(usize, usize)>;

/// A robot along a motion, whose joints and base may not be where the model has them.
pub(super) struct Misplaced {
    tree: LinkTree,
    states: Vec<[Vec<f64>; 3]>,
    carried: Vec<Carried>,
    /// One for each value of the candidates, with its column.
    moves: Vec<(Moves, Vec<f64>)>,
}

impl Misplaced {
    /// Of a robot in these states, one a row.
    pub(super) fn new(robot: &Robot, states: Vec<[Vec<f64>; 3]>, carried: Vec<Carried>) -> Result<Self, TreeError> {
        let mut own = Self { tree: robot.link_tree()?, states, carried, moves: Vec::new() };
        let largest =
            own.rows(|state| torques(&own.tree, state)).iter().fold(0.0, |largest: f64, tau| largest.max(tau.abs()));
        let joints = (0..robot.joints.len())
            .map(|joint| (Moves::Joint(joint), own.rows(|state| slope(&own.tree, state, joint))));
        let base = axes_of_tilt(&robot.gravity).into_iter().zip(TURNS).map(|(about, name)| {
            let tree = under(&own.tree, -about.cross(&own.tree.gravity));
            (Moves::Base(about, name), own.rows(|[q, ..]| torques(&tree, [q, &[], &[]])))
        });
        let shows = |(_, column): &(Moves, Vec<f64>)| column.iter().any(|slope| slope.abs() > NEGLIGIBLE * largest);
        // A robot whose axes are parallel shows one turn of its base only.
        own.moves = joints.chain(base).filter(shows).collect();
        Ok(own)
    }

    /// The candidates, given the site of each joint: values in the order of the moves.
    pub(super) fn candidates(&self, robot: &Robot, sites: &[Site]) -> Vec<Candidate> {
        let value = |name: &str, (unit, prior): (&str, f64), column: &[f64]| Value {
            name: name.into(),
            unit: unit.into(),
            prior,
            min: f64::NEG_INFINITY,
            column: column.into(),
        };
        let of_joint = |(moves, column): &(Moves, Vec<f64>)| {
            let Moves::Joint(joint) = *moves else { return None };
            let turns = robot.joints[joint].joint.axis.kind == JointKind::Revolute;
            let values = vec![value(OFFSET[0], if turns { TURN } else { SHIFT }, column)];
            Some(Candidate { law: Law::JointOffset, site: sites[joint].clone(), shape: None, values })
        };
        let of_base = |(moves, column): &(Moves, Vec<f64>)| match moves {
            Moves::Base(_, name) => Some(value(name, TURN, column)),
            Moves::Joint(_) => None,
        };
        let values: Vec<Value> = self.moves.iter().filter_map(of_base).collect();
        let of_joints = self.moves.iter().filter_map(of_joint);
        let site = Site::new(Place::Base, "the base");
        let tilt = (!values.is_empty()).then_some(Candidate { law: Law::BaseTilt, site, shape: None, values });
        of_joints.chain(tilt).collect()
    }

    /// What these values add to the torques beyond the columns. Of all values those of bodies are the first, ten each, and those
    /// of the candidates are the last.
    pub(super) fn beyond(&self, values: &[f64]) -> Option<Vec<f64>> {
        let (others, sizes) = values.split_at(values.len() - self.moves.len());
        if sizes.iter().all(|size| *size == 0.0) {
            return None;
        }
        let (mut offsets, mut turn) = (vec![0.0; self.tree.len()], Vec3::zeros());
        for ((moves, _), size) in self.moves.iter().zip(sizes) {
            match moves {
                Moves::Joint(joint) => offsets[*joint] += size,
                Moves::Base(about, _) => turn += about * *size,
            }
        }
        let gravity = rotation_exp(&-turn) * self.tree.gravity;
        let trees = |carried: Carried| {
            let level = self.carrying(carried, others);
            (carried, [under(&level, gravity), level])
        };
        let different: BTreeSet<Carried> = self.carried.iter().copied().collect();
        let trees: BTreeMap<Carried, [LinkTree; 2]> = different.into_iter().map(trees).collect();
        let of_row = |([q, v, a], carried): (&[Vec<f64>; 3], &Carried)| {
            let [turned, level] = &trees[carried];
            let moved: Vec<f64> = q.iter().zip(&offsets).map(|(q, offset)| q + offset).collect();
            let shown = torques(level, [q, v, a]);
            torques(turned, [&moved, v, a]).into_iter().zip(shown).map(|(moved, shown)| moved - shown)
        };
        let mut beyond: Vec<f64> = self.states.par_iter().zip(&self.carried).flat_map_iter(of_row).collect();
        for ((_, column), size) in self.moves.iter().zip(sizes) {
            beyond.iter_mut().zip(column).for_each(|(beyond, slope)| *beyond -= size * slope);
        }
        Some(beyond)
    }

    /// The robot with the changes of its bodies, and with what it carries.
    fn carrying(&self, carried: Carried, values: &[f64]) -> LinkTree {
        let mut tree = self.tree.clone();
        let links = (0..tree.len()).map(|link| (link, link));
        for (body, link) in links.chain(carried) {
            let changed: [f64; 10] = tree.bodies[link].parameters();
            let changed = std::array::from_fn(|k| changed[k] + values[10 * body + k]);
            tree.bodies[link] = Body::from_parameters(&changed);
        }
        tree
    }

    /// Numbers of all rows, one after the other.
    fn rows(&self, of: impl Fn(State) -> Vec<f64> + Sync) -> Vec<f64> {
        self.states.par_iter().flat_map_iter(|[q, v, a]| of([q, v, a])).collect()
    }
}

/// The two axes across gravity about which a base tilts: where gravity is along −z these are x and y.
fn axes_of_tilt(gravity: &Vec3<f64>) -> [Vec3<f64>; 2] {
    across(&gravity.try_normalize(0.0).map_or(Vec3::z(), |down| -down))
}

/// The same robot where another gravity pulls.
fn under(tree: &LinkTree, gravity: Vec3<f64>) -> LinkTree {
    let mut tree = tree.clone();
    tree.gravity = gravity;
    tree
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
