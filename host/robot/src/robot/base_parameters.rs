//! Base parameters: which combinations of the inertial parameters decide the torques, and so can be identified.
//!
//! The torques are linear in the ten parameters of each link ([`regressor`](darm_core::dynamics::regressor)). A
//! parameter whose column depends on those before it, over many random states, cannot be told apart from them: it is
//! grouped with them. A column that is always zero has no effect at all.
//!
//! Source: M. Gautier, Numerical calculation of the base inertial parameters of robots, J. of Robotic Systems 8 (1991) 485,
//! with the Gram–Schmidt process, done twice, in place of QR.

use std::fmt;

use darm_core::dynamics::floating::{self, BaseMotion};
use darm_core::real::Vec3;
use darm_core::se::{Pose, Twist};
use darm_core::tree::{Body, Tree, TreeError};
use nalgebra::{DMatrix, DVector};
use rand::{RngExt as _, SeedableRng as _};

use super::{MAX_JOINTS, Robot};

/// The ten parameters of a body, in the order of [`Tree::parameters`]: mass, first moments, moments of inertia about the
/// origin of its frame.
pub const PARAMETER_SYMBOLS: [&str; 10] = ["m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz"];

/// States per parameter and row of torques, so that a dependence is no accident of the draw.
const STATES_PER_PARAMETER: usize = 3;

/// What is left of a column that depends on others is rounding: below this part of its length.
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
    /// The others, which cannot be told apart from it, and their coefficients.
    pub grouped: Vec<(f64, Inertial)>,
}

/// What the torques of a robot can tell of its inertial parameters.
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
    pub fn base_parameters(&self, seed: u64) -> Result<BaseParameters, TreeError> {
        let tree = self.tree::<MAX_JOINTS>()?;
        let bodies =
            (if self.floating { Some(None) } else { None }).into_iter().chain((0..self.joints.len()).map(Some));
        let parameters: Vec<Inertial> = bodies
            .flat_map(|joint| (0..PARAMETER_SYMBOLS.len()).map(move |number| Inertial { joint, number }))
            .collect();
        let columns = self.columns(&tree, &parameters, seed);
        Ok(grouped(&parameters, &columns))
    }

    /// One column for each parameter: the torques that it alone causes, one random state under the other.
    fn columns(&self, tree: &Tree<f64, MAX_JOINTS>, parameters: &[Inertial], seed: u64) -> DMatrix<f64> {
        let rows = self.joints.len() + if self.floating { 6 } else { 0 };
        let states = (STATES_PER_PARAMETER * parameters.len()).div_ceil(rows.max(1));
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let states: Vec<_> = (0..states).map(|_| self.random_state(&mut random)).collect();
        let mut bare = *tree;
        bare.base = Body::none();
        (0..MAX_JOINTS).for_each(|link| bare.set_parameters(link, &[0.0; 10]));
        let mut columns = DMatrix::zeros(rows * states.len(), parameters.len());
        for (parameter, mut column) in parameters.iter().zip(columns.column_iter_mut()) {
            let mut alone = bare;
            let ten = std::array::from_fn(|number| if number == parameter.number { 1.0 } else { 0.0 });
            match parameter.joint {
                Some(joint) => alone.set_parameters(joint, &ten),
                None => alone.base = Body::from_parameters(&ten),
            }
            for (state, (base, [q, qd, qdd])) in states.iter().enumerate() {
                let (load, torque) = floating::inverse_dynamics(&alone, base, [q, qd, qdd], None);
                let on_base = load.moment.iter().chain(load.force.iter()).take(if self.floating { 6 } else { 0 });
                let measured = on_base.chain(&torque).take(rows);
                column.rows_mut(state * rows, rows).iter_mut().zip(measured).for_each(|(to, from)| *to = *from);
            }
        }
        columns
    }

    fn random_state(&self, random: &mut impl rand::Rng) -> (BaseMotion<f64>, [[f64; MAX_JOINTS]; 3]) {
        let mut any = |low: f64, high: f64| random.random_range(low..=high);
        let mut state = [[0.0; MAX_JOINTS]; 3];
        for (index, joint) in self.joints.iter().enumerate() {
            let [low, high] = joint.limits.unwrap_or([-std::f64::consts::PI, std::f64::consts::PI]);
            for (numbers, value) in state.iter_mut().zip([any(low, high), any(-2.0, 2.0), any(-5.0, 5.0)]) {
                numbers[index] = value;
            }
        }
        let mut base = BaseMotion { pose: Pose::identity(), twist: Twist::zero(), twist_rate: Twist::zero() };
        if self.floating {
            let mut three = |size: f64| Vec3::new(any(-size, size), any(-size, size), any(-size, size));
            base.pose = Pose::new(&three(2.0), Vec3::zeros());
            base.twist = Twist { angular: three(2.0), linear: three(1.0) };
            base.twist_rate = Twist { angular: three(5.0), linear: three(5.0) };
        }
        (base, state)
    }
}

/// The first columns that are independent, and how the others depend on them.
pub fn grouped(parameters: &[Inertial], columns: &DMatrix<f64>) -> BaseParameters {
    let largest = columns.column_iter().map(|column| column.norm()).fold(0.0, f64::max);
    let (mut base, mut without_effect) = (Vec::<BaseParameter>::new(), Vec::new());
    let mut axes: Vec<DVector<f64>> = Vec::new();
    // How each independent column is made of the axes: upper triangular, column by column.
    let mut made_of: Vec<Vec<f64>> = Vec::new();
    for (parameter, column) in parameters.iter().zip(columns.column_iter()) {
        let length = column.norm();
        if length <= DEPENDENT * largest {
            without_effect.push(*parameter);
            continue;
        }
        let (mut rest, mut along) = (column.clone_owned(), vec![0.0; axes.len()]);
        for _ in 0..2 {
            for (axis, along) in axes.iter().zip(&mut along) {
                let part = axis.dot(&rest);
                rest.axpy(-part, axis, 1.0);
                *along += part;
            }
        }
        let left = rest.norm();
        if left > DEPENDENT * length {
            axes.push(rest / left);
            along.push(left);
            made_of.push(along);
            base.push(BaseParameter { leading: *parameter, grouped: Vec::new() });
            continue;
        }
        for (leading, coefficient) in base.iter_mut().zip(solve(&made_of, along)) {
            if coefficient.abs() > TERM {
                leading.grouped.push((coefficient, *parameter));
            }
        }
    }
    BaseParameters { base, without_effect }
}

/// The solution of an upper triangular system given by columns.
fn solve(columns: &[Vec<f64>], mut right: Vec<f64>) -> Vec<f64> {
    for (k, column) in columns.iter().enumerate().rev() {
        let value = right[k] / column[k];
        right[..k].iter_mut().zip(column).for_each(|(entry, factor)| *entry -= factor * value);
        right[k] = value;
    }
    right
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
