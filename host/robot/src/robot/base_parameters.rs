//! Base parameters: which combinations of the inertial parameters decide the torques, and so can be identified.
//!
//! The torques are linear in the ten parameters of each link ([`regressor`](darm_core::dynamics::regressor)). A
//! parameter whose column depends on those before it, over many random states, cannot be distinguished from them: it is
//! grouped with them. A column that is always zero has no effect at all.
//!
//! Source: M. Gautier, Numerical calculation of the base inertial parameters of robots, J. of Robotic Systems 8
//! (1991) 485.

use std::fmt;

use darm_core::dynamics::floating::BaseMotion;
use darm_core::real::{Vec3, Vec6};
use darm_core::se::{Pose, Twist};
use darm_core::tree::{Body, TreeError};
use nalgebra::DMatrix;
use rand::{RngExt as _, SeedableRng as _};

use super::{Coupling, Robot};
use crate::tree::spatial::{Motion, SpatialInertia};
use crate::tree::{LinkTree, Links};

/// The inertial parameters of a body, in the order of [`Body::parameters`](darm_core::tree::Body::parameters): mass, first
/// moments, moments of inertia about the origin of its frame.
pub const PARAMETER_SYMBOLS: [&str; 10] = ["m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz"];

/// States per parameter and row of torques, so that a dependence is no accident of the draw.
const STATES_PER_PARAMETER: usize = 3;

/// The remainder of a column that depends on others is rounding: below this part of its length.
const DEPENDENT: f64 = 1e-8;

/// A coefficient below this is rounding.
const TERM: f64 = 1e-7;

/// One inertial parameter of one body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Inertial {
    /// The joint that moves the body; `None`: the base.
    pub joint: Option<usize>,
    /// Which of the [`PARAMETER_SYMBOLS`].
    pub number: usize,
}

/// A sum of inertial parameters that can be identified as one number.
#[derive(Clone, Debug, PartialEq)]
pub struct BaseParameter {
    /// The first of them, with the coefficient 1.
    pub leading: Inertial,
    /// The others, which cannot be distinguished from it, and their coefficients.
    pub grouped: Vec<(f64, Inertial)>,
}

/// What the torques of a robot can determine of its inertial parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct BaseParameters {
    /// The independent ones.
    pub base: Vec<BaseParameter>,
    /// Those that no torque depends on.
    pub without_effect: Vec<Inertial>,
}

impl Robot {
    /// The base parameters, found over random states of the seed within the limits; of a floating base, the load on it
    /// is measured too and its own parameters count.
    ///
    /// # Errors
    ///
    /// As [`link_tree`](Self::link_tree).
    pub fn base_parameters(&self, seed: u64) -> Result<BaseParameters, TreeError> {
        let tree = self.link_tree()?;
        let bodies =
            (if self.floating { Some(None) } else { None }).into_iter().chain((0..self.joints.len()).map(Some));
        let parameters: Vec<Inertial> = bodies
            .flat_map(|joint| (0..PARAMETER_SYMBOLS.len()).map(move |number| Inertial { joint, number }))
            .collect();
        let columns = self.columns(&tree, &parameters, seed);
        Ok(grouped(&parameters, &columns))
    }

    /// One column for each parameter: the torques that it alone causes, one random state under the other.
    fn columns(&self, tree: &LinkTree, parameters: &[Inertial], seed: u64) -> DMatrix<f64> {
        let (on_base, coupling) = (if self.floating { 6 } else { 0 }, self.coupling());
        let rows = coupling.len() + on_base;
        let states = (STATES_PER_PARAMETER * parameters.len()).div_ceil(rows.max(1));
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut columns = DMatrix::zeros(rows * states, parameters.len());
        for state in 0..states {
            let posture = Posture::new(tree, &self.random_state(&coupling, &mut random));
            for (parameter, mut column) in parameters.iter().zip(columns.column_iter_mut()) {
                let mut part = column.rows_mut(state * rows, rows);
                let wrench = posture.unit_wrench(parameter);
                if self.floating {
                    part.rows_mut(0, 6).copy_from(&posture.links.base_screws().tr_mul(&wrench));
                }
                for joint in tree.path(parameter.joint) {
                    let row = coupling.rows()[joint];
                    part[on_base + row.coordinate] += row.factor * posture.screws[joint].dot(&wrench);
                }
            }
        }
        columns
    }

    fn random_state(&self, coupling: &Coupling, random: &mut impl rand::Rng) -> RandomState {
        let mut any = |low: f64, high: f64| random.random_range(low..=high);
        let mut joints: [Vec<f64>; 3] = Default::default();
        for &joint in coupling.coordinates() {
            let [low, high] = self.joints[joint].limits.unwrap_or([-std::f64::consts::PI, std::f64::consts::PI]);
            for (numbers, value) in joints.iter_mut().zip([any(low, high), any(-2.0, 2.0), any(-5.0, 5.0)]) {
                numbers.push(value);
            }
        }
        let rest = Twist::zero();
        let mut base = BaseMotion { pose: Pose::identity(), twist: rest, twist_rate: rest };
        if self.floating {
            let mut three = |size: f64| Vec3::new(any(-size, size), any(-size, size), any(-size, size));
            base.pose = Pose::new(&three(2.0), Vec3::zeros());
            base.twist = Twist { angular: three(2.0), linear: three(1.0) };
            base.twist_rate = Twist { angular: three(5.0), linear: three(5.0) };
        }
        let [q, qd, qdd] = &joints;
        RandomState { base, joints: [coupling.positions(q), coupling.rates(qd), coupling.rates(qdd)] }
    }
}

/// A random state of a robot: its base, and positions, velocities and accelerations of its joints.
struct RandomState {
    base: BaseMotion<f64>,
    joints: [Vec<f64>; 3],
}

/// A tree in one state of motion.
struct Posture {
    links: Links,
    screws: Vec<Vec6<f64>>,
    /// Motion of the base and of the links, with free fall.
    base: Motion,
    motions: Vec<Motion>,
}

impl Posture {
    fn new(tree: &LinkTree, state: &RandomState) -> Self {
        let [q, qd, qdd] = &state.joints;
        let links = tree.place(&state.base.pose, q);
        let screws = links.base_screws();
        let base = Motion {
            velocity: screws * state.base.twist.to_vector(),
            acceleration: screws * state.base.twist_rate.to_vector() + Motion::at_rest(&tree.gravity).acceleration,
        };
        Self { screws: tree.screws(&links), motions: tree.motions(&links, &base, qd, qdd), links, base }
    }

    /// The wrench that a body takes of which this parameter alone is 1.
    fn unit_wrench(&self, parameter: &Inertial) -> Vec6<f64> {
        let unit = std::array::from_fn(|number| if number == parameter.number { 1.0 } else { 0.0 });
        let (pose, motion) = match parameter.joint {
            Some(joint) => (&self.links.poses[joint], &self.motions[joint]),
            None => (&self.links.base, &self.base),
        };
        SpatialInertia::new(&Body::from_parameters(&unit), pose).wrench(motion)
    }
}

/// The first columns that are independent, and how the others depend on them.
///
/// The QR decomposition has no pivots: a pivot would choose which parameter of a group leads it, and that is the first.
///
/// # Panics
///
/// `columns` has fewer columns than there are `parameters`.
pub fn grouped(parameters: &[Inertial], columns: &DMatrix<f64>) -> BaseParameters {
    let lengths: Vec<f64> = columns.column_iter().map(|column| column.norm()).collect();
    let largest = lengths.iter().copied().fold(0.0, f64::max);
    let (effective, ineffective): (Vec<usize>, Vec<usize>) =
        (0..parameters.len()).partition(|k| lengths[*k] > DEPENDENT * largest);
    let mut units = columns.clone();
    units.column_iter_mut().zip(&lengths).for_each(|(mut column, length)| column /= *length);
    let left = units.select_columns(&effective).qr().r().diagonal();
    let (independent, dependent): (Vec<_>, Vec<_>) =
        effective.into_iter().zip(left.iter()).partition(|(_, left)| left.abs() > DEPENDENT);
    let indices = |of: Vec<(usize, &f64)>| of.into_iter().map(|(k, _)| k).collect::<Vec<usize>>();
    let (independent, dependent) = (indices(independent), indices(dependent));
    let decomposition = units.select_columns(&independent).qr();
    let mut combined = units.select_columns(&dependent);
    decomposition.q_tr_mul(&mut combined);
    let combined = combined.rows(0, independent.len());
    let weights = decomposition.r().solve_upper_triangular(&combined).expect("independent columns have a full rank");
    let parameter = |(row, leading): (usize, &usize)| {
        let later = dependent.iter().enumerate().filter(|(_, other)| *other > leading);
        let terms =
            later.map(|(k, other)| (weights[(row, k)] * lengths[*other] / lengths[*leading], parameters[*other]));
        let grouped = terms.filter(|(coefficient, _)| coefficient.abs() > TERM).collect();
        BaseParameter { leading: parameters[*leading], grouped }
    };
    let base = independent.iter().enumerate().map(parameter).collect();
    BaseParameters { base, without_effect: ineffective.into_iter().map(|k| parameters[k]).collect() }
}

impl BaseParameters {
    /// A base parameter as a person reads it: `Izz link_1 + Iyy link_2 + 0.0506 m link_3`.
    pub fn words(parameter: &BaseParameter, robot: &Robot) -> String {
        let mut words = parameter.leading.words(robot);
        for (coefficient, inertial) in &parameter.grouped {
            let sign = if *coefficient < 0.0 { '-' } else { '+' };
            let size = coefficient.abs();
            let factor = if (size - 1.0).abs() < TERM { String::new() } else { format!("{} ", Short(size)) };
            words += &format!(" {sign} {factor}{}", inertial.words(robot));
        }
        words
    }
}

impl Inertial {
    /// The parameter with the name of its link: `mx forearm`.
    pub fn words(&self, robot: &Robot) -> String {
        let base = robot.frames.first().map_or("base", |frame| frame.name.as_str());
        let link = self.joint.and_then(|joint| robot.joints.get(joint)).map_or(base, |joint| joint.link.as_str());
        format!("{} {link}", PARAMETER_SYMBOLS.get(self.number).copied().unwrap_or("?"))
    }

    /// Its unit.
    pub fn unit(&self) -> &'static str {
        match self.number {
            0 => "kg",
            1..=3 => "kg·m",
            _ => "kg·m²",
        }
    }
}

/// A number with five significant digits.
struct Short(f64);

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let decimals = (4.0 - self.0.abs().log10().floor()).clamp(0.0, 9.0) as usize;
        let text = format!("{:.decimals$}", self.0);
        f.write_str(if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text })
    }
}
