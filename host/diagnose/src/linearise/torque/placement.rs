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
//! Columns are taken where a model has the joints, the base and the bodies: a heavier body on a base that is not level
//! weighs on joints that a level one would not load.

use std::collections::{BTreeMap, BTreeSet};

use darm_core::actuator::JointKind;
use darm_core::real::Vec3;
use darm_core::se::{Pose, rotation_exp};
use darm_core::tree::{Body, TreeError};
use darm_robot::robot::Robot;
use darm_robot::tree::LinkTree;
use darm_robot::tree::spatial::Motion;
use rayon::prelude::{IndexedParallelIterator as _, IntoParallelRefIterator as _, ParallelIterator as _};

use crate::effect::{LawName, Place, Site};
use crate::linearise::experiment::{Candidate, CandidateValue};
use crate::linearise::model_effects::ModelEffect;
use crate::linearise::serial_chain::{OFFSET, TURNS, across};

/// The step of the differences, rad or m.
const STEP: f64 = 1e-4;
/// Units, and how large an angle and a length are before anything is measured.
const TURN: (&str, f64) = ("rad", 0.1);
const SHIFT: (&str, f64) = ("m", 0.02);
/// The place of a base that is not level.
const BASE: &str = "the base";
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

/// Where joints and base of a robot are, beside where it has them.
pub(super) struct Placement {
    /// Of each joint, rad or m.
    pub(super) offsets: Vec<f64>,
    /// Gravity in the frame of the base, m/s².
    pub(super) gravity: Vec3<f64>,
}

impl Placement {
    /// Where these effects of a model put them; `sites` are those of the joints.
    pub(super) fn of(robot: &Robot, sites: &[Site], effects: &[ModelEffect]) -> Self {
        let size = |law: LawName, place: &str, name: &str| -> f64 {
            let own = effects.iter().filter(|effect| effect.law == law && effect.place == place);
            own.filter_map(|effect| effect.values.get(name)).sum()
        };
        let about = axes_of_tilt(&robot.gravity);
        let turn = about.iter().zip(TURNS).map(|(about, name)| about * size(LawName::BaseTilt, BASE, name)).sum();
        let offsets = sites.iter().map(|site| size(LawName::JointOffset, &site.code, OFFSET[0])).collect();
        Self { offsets, gravity: turned(&robot.gravity, &turn) }
    }

    /// Whether the robot is where it has its base and joints.
    pub(super) fn is_as_modelled(&self, robot: &Robot) -> bool {
        self.gravity == robot.gravity && self.offsets.iter().all(|offset| *offset == 0.0)
    }

    /// Positions of all joints where their encoders show these.
    fn position(&self, shown: &[f64]) -> Vec<f64> {
        shown.iter().zip(&self.offsets).map(|(q, offset)| q + offset).collect()
    }
}

/// A robot along a motion, whose joints and base may not be where the model has them.
pub(super) struct Misplaced {
    tree: LinkTree,
    states: Vec<[Vec<f64>; 3]>,
    carried: Vec<Carried>,
    /// Where the columns are taken, and by how much the robot as it is takes more torque there than where it has its joints
    /// and base; `None` where that is the same.
    near: Placement,
    more: Option<Vec<f64>>,
    /// One for each value of the candidates, with its column.
    moves: Vec<(Moves, Vec<f64>)>,
}

impl Misplaced {
    /// Of a robot in these states, one a row; columns are taken at the placement `near`, where the inertial parameters of the
    /// bodies, ten each, are off by `bodies`.
    pub(super) fn new(
        robot: &Robot,
        states: Vec<[Vec<f64>; 3]>,
        carried: Vec<Carried>,
        near: Placement,
        bodies: &[f64],
    ) -> Result<Self, TreeError> {
        let mut own = Self { tree: robot.link_tree()?, states, carried, near, more: None, moves: Vec::new() };
        let trees = own.trees(bodies, |tree| under(&tree, own.near.gravity));
        let largest = own.rows(&trees, torques).iter().fold(0.0, |largest: f64, tau| largest.max(tau.abs()));
        let at = |q: &[f64]| own.near.position(q);
        let joints = (0..robot.joints.len())
            .map(|joint| (Moves::Joint(joint), own.rows(&trees, |tree, [q, v, a]| slope(tree, [&at(q), v, a], joint))));
        let base = axes_of_tilt(&robot.gravity).into_iter().zip(TURNS).map(|(about, name)| {
            let turned = own.trees(bodies, |tree| under(&tree, -about.cross(&own.near.gravity)));
            (Moves::Base(about, name), own.rows(&turned, |tree, [q, ..]| torques(tree, [&at(q), &[], &[]])))
        });
        let shows = |(_, column): &(Moves, Vec<f64>)| column.iter().any(|slope| slope.abs() > NEGLIGIBLE * largest);
        // A robot whose axes are parallel shows one turn of its base only.
        let moves = joints.chain(base).filter(shows).collect();
        if !own.near.is_as_modelled(robot) {
            let nominal = own.trees(&vec![0.0; bodies.len()], |level| [under(&level, own.near.gravity), level]);
            own.more = Some(own.rows(&nominal, |[there, here], [q, v, a]| {
                let here = torques(here, [q, v, a]);
                torques(there, [&at(q), v, a]).into_iter().zip(here).map(|(there, here)| there - here).collect()
            }));
        }
        own.moves = moves;
        Ok(own)
    }

    /// The candidates, given the site of each joint: values in the order of the moves.
    pub(super) fn candidates(&self, robot: &Robot, sites: &[Site]) -> Vec<Candidate> {
        let value = |name: &str, (unit, prior): (&str, f64), column: &[f64]| CandidateValue {
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
            Some(Candidate { law: LawName::JointOffset, site: sites[joint].clone(), shape: None, values })
        };
        let of_base = |(moves, column): &(Moves, Vec<f64>)| match moves {
            Moves::Base(_, name) => Some(value(name, TURN, column)),
            Moves::Joint(_) => None,
        };
        let values: Vec<CandidateValue> = self.moves.iter().filter_map(of_base).collect();
        let of_joints = self.moves.iter().filter_map(of_joint);
        let site = Site::new(Place::Base, BASE);
        let tilt = (!values.is_empty()).then_some(Candidate { law: LawName::BaseTilt, site, shape: None, values });
        of_joints.chain(tilt).collect()
    }

    /// What these values add to the torques beyond the columns. Of all values those of bodies are the first, ten each, and those
    /// of the candidates are the last.
    ///
    /// With τ(b, p) the torques of bodies b at a placement p, nominal at 0 and columns taken at p₁ it is
    /// [τ(b, p) − τ(0, 0)] − [τ(b, p₁) − τ(0, p₁)] − Σ size·column.
    pub(super) fn beyond(&self, values: &[f64]) -> Option<Vec<f64>> {
        let (others, sizes) = values.split_at(values.len() - self.moves.len());
        if self.more.is_none() && sizes.iter().all(|size| *size == 0.0) {
            return None;
        }
        let (mut offsets, mut turn) = (vec![0.0; self.tree.len()], Vec3::zeros());
        for ((moves, _), size) in self.moves.iter().zip(sizes) {
            match moves {
                Moves::Joint(joint) => offsets[*joint] += size,
                Moves::Base(about, _) => turn += about * *size,
            }
        }
        let placed = Placement { offsets, gravity: turned(&self.tree.gravity, &turn) };
        let trees = self.trees(others, |tree| [under(&tree, placed.gravity), under(&tree, self.near.gravity)]);
        let mut beyond = self.rows(&trees, |[placed_tree, near], [q, v, a]| {
            let near = torques(near, [&self.near.position(q), v, a]);
            let placed = torques(placed_tree, [&placed.position(q), v, a]);
            placed.into_iter().zip(near).map(|(placed, near)| placed - near).collect()
        });
        beyond.iter_mut().zip(self.more.iter().flatten()).for_each(|(beyond, more)| *beyond += more);
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

    /// What is made of the robot with the changes of its bodies, for each body that it carries.
    fn trees<T>(&self, bodies: &[f64], of: impl Fn(LinkTree) -> T) -> BTreeMap<Carried, T> {
        let different: BTreeSet<Carried> = self.carried.iter().copied().collect();
        different.into_iter().map(|carried| (carried, of(self.carrying(carried, bodies)))).collect()
    }

    /// Numbers of all rows, one after the other, each with what it carries.
    fn rows<T: Sync>(&self, trees: &BTreeMap<Carried, T>, of: impl Fn(&T, State) -> Vec<f64> + Sync) -> Vec<f64> {
        let rows = self.states.par_iter().zip(&self.carried);
        rows.flat_map_iter(|([q, v, a], carried)| of(&trees[carried], [q, v, a])).collect()
    }
}

/// The two axes across gravity about which a base tilts: where gravity is along −z these are x and y.
fn axes_of_tilt(gravity: &Vec3<f64>) -> [Vec3<f64>; 2] {
    across(&gravity.try_normalize(0.0).map_or(Vec3::z(), |down| -down))
}

/// Gravity in the frame of a base that turned.
fn turned(gravity: &Vec3<f64>, turn: &Vec3<f64>) -> Vec3<f64> {
    rotation_exp(&-turn) * gravity
}

/// A robot under another gravity.
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
