//! A tree in one posture: points, frames and centre of mass with their Jacobians, and the wrench of a motion on the ground.

use darm_core::dynamics::floating;
use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_core::tree::{Body, Frames, Tree, TreeError};
use nalgebra::{DMatrix, Matrix3xX, Matrix6xX, SVector};

use super::smooth::Smooth;
use super::{Fixed, Posture};
use darm_diagnose::measurement::signal::rate;
use darm_robot::rigid_body::regressor::{BodyMotion, link_motions, wrench_regressor};
use darm_robot::robot::{MAX_JOINTS, Robot};

/// A tree that computes, made once.
pub(super) struct Placed {
    tree: Tree<f64, MAX_JOINTS>,
    frames: Frames<f64, MAX_JOINTS>,
    n: usize,
    base: Pose<f64>,
}

impl Placed {
    /// The tree of a robot, in no posture yet.
    pub(super) fn new(robot: &Robot) -> Result<Self, TreeError> {
        let (tree, frames) = (robot.tree()?, Frames::default());
        Ok(Self { tree, frames, n: robot.joints.len(), base: Pose::identity() })
    }

    /// Moves it to a posture.
    pub(super) fn place(&mut self, posture: &Posture) {
        let q = std::array::from_fn(|k| posture.q.get(k).copied().unwrap_or(0.0));
        self.tree.place_floating(&posture.base, &q, &mut self.frames);
        self.base = posture.base;
    }

    /// Pose of a frame in the world.
    pub(super) fn pose(&self, joint: Option<usize>, pose: &Pose<f64>) -> Pose<f64> {
        self.frames.pose(&self.tree.frame(joint.unwrap_or(usize::MAX), pose))
    }

    /// Where a point is.
    pub(super) fn point(&self, at: &Fixed) -> Vec3<f64> {
        self.pose(at.joint, &Pose::at(at.point)).position
    }

    /// How a frame's origin moves, told in the world, per unit of base and joints: angular rows first, 6 × (6 + n).
    pub(super) fn jacobian(&self, joint: Option<usize>, pose: &Pose<f64>) -> Matrix6xX<f64> {
        let frame = self.tree.frame(joint.unwrap_or(usize::MAX), pose);
        let of_joints = self.tree.jacobian_base(&frame, &self.frames);
        let arm = self.frames.pose(&frame).position - self.base.position;
        let mut jacobian = Matrix6xX::zeros(6 + self.n);
        for k in 0..3 {
            let axis: Vec3<f64> = self.base.rotation.column(k).into();
            jacobian.fixed_view_mut::<3, 1>(0, k).copy_from(&axis);
            jacobian.fixed_view_mut::<3, 1>(3, k).copy_from(&axis.cross(&arm));
            jacobian.fixed_view_mut::<3, 1>(3, 3 + k).copy_from(&axis);
        }
        for k in 0..self.n {
            jacobian.set_column(6 + k, &of_joints.column(k));
        }
        jacobian
    }

    /// Centre of mass, and its Jacobian, 3 × (6 + n).
    pub(super) fn com(&self) -> (Vec3<f64>, Matrix3xX<f64>) {
        let com = floating::com_jacobian(&self.tree, &self.frames);
        let mut jacobian = Matrix3xX::zeros(6 + self.n);
        jacobian.columns_mut(0, 6).copy_from(&com.base);
        for k in 0..self.n {
            jacobian.set_column(6 + k, &com.joints.column(k));
        }
        (com.position, jacobian)
    }

    /// Mass matrix of base and joints in the posture, (6 + n) × (6 + n).
    pub(super) fn mass(&self, q: &[f64]) -> DMatrix<f64> {
        let q = std::array::from_fn(|k| q.get(k).copied().unwrap_or(0.0));
        let blocks = floating::mass(&self.tree, &self.frames, &q);
        DMatrix::from_fn(6 + self.n, 6 + self.n, |row, column| match (row < 6, column < 6) {
            (true, true) => blocks.base[(row, column)],
            (true, false) => blocks.coupling[(row, column - 6)],
            (false, true) => blocks.coupling[(column, row - 6)],
            (false, false) => blocks.joints[(row - 6, column - 6)],
        })
    }

    /// What the velocities and gravity ask of base and joints: the load without acceleration, base first.
    pub(super) fn bias(&self, posture: &Posture, velocity: &[f64]) -> Vec<f64> {
        let part = |from: usize| Vec3::new(velocity[from], velocity[from + 1], velocity[from + 2]);
        let zero = darm_core::se::Twist::zero();
        let twist = darm_core::se::Twist { angular: part(0), linear: part(3) };
        let base = floating::BaseMotion { pose: posture.base, twist, twist_rate: zero };
        let padded =
            |given: &[f64]| -> [f64; MAX_JOINTS] { std::array::from_fn(|k| given.get(k).copied().unwrap_or(0.0)) };
        let (q, qd) = (padded(&posture.q), padded(&velocity[6..]));
        let (load, torque) = floating::inverse_dynamics(&self.tree, &base, [&q, &qd, &[0.0; MAX_JOINTS]], None);
        let base = load.moment.iter().chain(&load.force).copied().collect::<Vec<_>>();
        base.into_iter().chain(torque).take(6 + self.n).collect()
    }
}

/// How base and joints of a trajectory move, frame by frame.
#[derive(Clone, Debug)]
pub(super) struct Dynamic {
    /// The base in each frame.
    pub base: Vec<BodyMotion>,
    /// Positions, velocities and accelerations of the joints in each frame.
    pub state: Vec<[Vec<f64>; 3]>,
}

/// Velocities and accelerations of a trajectory, of positions low-passed at `corner_hz`.
pub(super) fn dynamic(postures: &[Posture], time_s: &[f64], corner_hz: f64, gravity: &Vec3<f64>) -> Dynamic {
    let smooth = Smooth::new(time_s, corner_hz);
    let one = vec![0; time_s.len()];
    let rates = |values: Vec<f64>| {
        let position = smooth.pass(values);
        let velocity = rate(&position, time_s, &one);
        let acceleration = rate(&velocity, time_s, &one);
        [position, velocity, acceleration]
    };
    let n = postures.first().map_or(0, |posture| posture.q.len());
    let joints: Vec<[Vec<f64>; 3]> = (0..n).map(|k| rates(postures.iter().map(|p| p.q[k]).collect())).collect();
    let place: [[Vec<f64>; 3]; 3] =
        std::array::from_fn(|k| rates(postures.iter().map(|p| p.base.position[k]).collect()));
    // ω of the base by central differences of its rotation, told in the world.
    let spin: Vec<Vec3<f64>> = (0..postures.len())
        .map(|k| {
            let (a, b) = (k.saturating_sub(1), (k + 1).min(postures.len() - 1));
            let turn =
                darm_core::se::rotation_log(&(postures[b].base.rotation * postures[a].base.rotation.transpose()));
            turn / (time_s[b] - time_s[a]).max(f64::MIN_POSITIVE)
        })
        .collect();
    let omega: [Vec<f64>; 3] = std::array::from_fn(|k| smooth.pass(spin.iter().map(|w| w[k]).collect()));
    let alpha: [Vec<f64>; 3] = std::array::from_fn(|k| rate(&omega[k], time_s, &one));
    let moving = |row: usize| {
        let three = |of: &[Vec<f64>; 3]| Vec3::new(of[0][row], of[1][row], of[2][row]);
        let order = |k: usize| Vec3::new(place[0][k][row], place[1][k][row], place[2][k][row]);
        BodyMotion {
            pose: Pose { rotation: postures[row].base.rotation, position: order(0) },
            omega: three(&omega),
            alpha: three(&alpha),
            acceleration: order(2) - gravity,
        }
    };
    let state = |row: usize| std::array::from_fn(|order| joints.iter().map(|joint| joint[order][row]).collect());
    Dynamic { base: (0..postures.len()).map(moving).collect(), state: (0..postures.len()).map(state).collect() }
}

/// The wrench that the ground exerts in each frame of a motion per body: moment first, about the world's origin.
pub(super) fn wrench(robot: &Robot, motion: &Dynamic) -> Vec<Vec<SVector<f64, 6>>> {
    let inertias = std::iter::once(&robot.base).chain(robot.joints.iter().map(|joint| &joint.joint.inertia));
    let tens: Vec<SVector<f64, 10>> = inertias.map(|inertia| Body::from(inertia).parameters().into()).collect();
    let frame = |(base, [q, qd, qdd]): (&BodyMotion, &[Vec<f64>; 3])| {
        let moving = link_motions(robot, base, [q, qd, qdd]);
        std::iter::once(base).chain(&moving).zip(&tens).map(|(body, ten)| wrench_regressor(body) * ten).collect()
    };
    motion.base.iter().zip(&motion.state).map(frame).collect()
}
