//! A tree in one posture: points, frames and centre of mass with their Jacobians, and the wrench of a motion on the ground.

use darm_core::real::{Vec3, Vec6};
use darm_core::se::Pose;
use darm_core::tree::{Body, TreeError};
use nalgebra::{DMatrix, Matrix3xX, Matrix6xX, SVector};

use super::smooth::Smooth;
use super::{BodyPoint, Posture};
use darm_measure::signal::rate;
use darm_robot::rigid_body::regressor::{BodyMotion, link_motions, wrench_regressor};
use darm_robot::robot::Robot;
use darm_robot::tree::spatial::{Motion, six};
use darm_robot::tree::{LinkTree, Links};

/// A tree in one posture, made once.
pub(super) struct Placed {
    tree: LinkTree,
    links: Links,
}

impl Placed {
    /// The tree of a robot at its zero posture.
    pub(super) fn new(robot: &Robot) -> Result<Self, TreeError> {
        let tree = robot.link_tree()?;
        let links = tree.place(&Pose::identity(), &[]);
        Ok(Self { tree, links })
    }

    /// Moves it to a posture.
    pub(super) fn place(&mut self, posture: &Posture) {
        self.links = self.tree.place(&posture.base, &posture.q);
    }

    /// Pose of a frame in the world.
    pub(super) fn pose(&self, joint: Option<usize>, pose: &Pose<f64>) -> Pose<f64> {
        self.links.pose(joint, pose)
    }

    /// Where a point is.
    pub(super) fn point(&self, at: &BodyPoint) -> Vec3<f64> {
        self.pose(at.joint, &Pose::at(at.point)).position
    }

    /// Twist of a frame about its origin in the axes of the world, per unit of the base's twist and of each joint:
    /// 6 × (6 + n), angular rows first.
    pub(super) fn jacobian(&self, joint: Option<usize>, pose: &Pose<f64>) -> Matrix6xX<f64> {
        let arm = self.pose(joint, pose).position - self.links.base.position;
        let mut jacobian = Matrix6xX::zeros(6 + self.tree.len());
        for (k, axis) in self.links.base.rotation.column_iter().enumerate() {
            jacobian.set_column(k, &six(&axis.into(), &axis.cross(&arm)));
            jacobian.set_column(3 + k, &six(&Vec3::zeros(), &axis.into()));
        }
        jacobian.columns_mut(6, self.tree.len()).copy_from(&self.tree.jacobian(&self.links, joint, pose));
        jacobian
    }

    /// Centre of mass, and its Jacobian, 3 × (6 + n).
    pub(super) fn com(&self) -> (Vec3<f64>, Matrix3xX<f64>) {
        let com = self.tree.centre_of_mass(&self.links, true);
        let mut jacobian = Matrix3xX::zeros(6 + self.tree.len());
        if com.mass_kg > 0.0 {
            let arm = com.position - self.links.base.position;
            for (k, axis) in self.links.base.rotation.column_iter().enumerate() {
                jacobian.set_column(k, &axis.cross(&arm));
                jacobian.set_column(3 + k, &axis);
            }
        }
        jacobian.columns_mut(6, self.tree.len()).copy_from(&com.joints);
        (com.position, jacobian)
    }

    /// Mass matrix of base and joints in the posture, (6 + n) × (6 + n).
    pub(super) fn mass(&self) -> DMatrix<f64> {
        let n = self.tree.len();
        let (mass, screws) = (self.tree.mass_matrix(&self.links), self.links.base_screws());
        let coupling = screws.tr_mul(&mass.coupling);
        let mut matrix = DMatrix::zeros(6 + n, 6 + n);
        matrix.view_mut((0, 0), (6, 6)).copy_from(&(screws.tr_mul(&mass.base) * screws));
        matrix.view_mut((0, 6), (6, n)).copy_from(&coupling);
        matrix.view_mut((6, 0), (n, 6)).copy_from(&coupling.transpose());
        matrix.view_mut((6, 6), (n, n)).copy_from(&mass.joints);
        matrix
    }

    /// The wrench on the base and the torques of the joints that velocities and gravity take, without accelerations: base
    /// first.
    pub(super) fn bias(&self, velocity: &[f64]) -> Vec<f64> {
        let screws = self.links.base_screws();
        let (of_base, of_joints) = velocity.split_at(6);
        let base = Motion { velocity: screws * Vec6::from_column_slice(of_base), acceleration: Vec6::zeros() };
        let (wrench, torques) = self.tree.inverse_dynamics(&self.links, &base, [of_joints, &[]]);
        screws.tr_mul(&wrench).iter().copied().chain(torques).collect()
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
    // ω of the base by central differences of its rotation, in world coordinates.
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
        let [omega, alpha] = [&omega, &alpha].map(|of| Vec3::new(of[0][row], of[1][row], of[2][row]));
        let order = |k: usize| Vec3::new(place[0][k][row], place[1][k][row], place[2][k][row]);
        let pose = Pose { rotation: postures[row].base.rotation, position: order(0) };
        BodyMotion { pose, omega, alpha, acceleration: order(2) - gravity }
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
