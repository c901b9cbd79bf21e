//! What a robot does in one posture, or at one state of motion, in tables of as many rows as it has coordinates.

use darm_core::real::{Mat6, Vec3};
use darm_core::se::{Pose, Twist, Wrench};
use darm_core::tree::TreeError;
use nalgebra::{DMatrix, DVector, Matrix6xX, SMatrix};

use super::{Coupling, Robot, RobotFrame};
use crate::tree::spatial::{Motion as LinkMotion, halves, six};
use crate::tree::{LinkTree, Links};

/// A 6 × n Jacobian, angular rows first.
pub type Jacobian = Matrix6xX<f64>;

/// The pose of a frame, and how it moves.
#[derive(Clone, Debug, PartialEq)]
pub struct Kinematics {
    /// Pose of the frame in the base.
    pub pose_base_frame: Pose<f64>,
    /// Its twist along the axes of the base at its own origin, per unit of each joint.
    pub jacobian_base: Jacobian,
    /// The same along its own axes.
    pub jacobian_tool: Jacobian,
}

/// The equation of motion at one state: τ = M q̈ + C q̇ + G − Jᵀ F.
#[derive(Clone, Debug, PartialEq)]
pub struct Dynamics {
    /// τ that the accelerations take, N·m or N.
    pub torque: Vec<f64>,
    /// M, n × n; kg·m² of joints that turn, kg of those that slide.
    pub mass: DMatrix<f64>,
    /// C of Christoffel's symbols, n × n; of a fixed base.
    pub coriolis: DMatrix<f64>,
    /// C q̇: centrifugal and Coriolis torques, N·m or N.
    pub velocity_torque: Vec<f64>,
    /// G: what holds the arm against gravity, N·m or N.
    pub gravity: Vec<f64>,
    /// ½ q̇ᵀ M q̇, J.
    pub kinetic_j: f64,
    /// −Σ m g·c of the links, and of a base that floats, J.
    pub potential_j: f64,
    /// What the base bears, or, when it floats, takes to stay as it is: M of base and joints.
    pub base: Option<FloatingBase>,
}

/// How a robot accelerates.
#[derive(Clone, Debug, PartialEq)]
pub struct Accelerations {
    /// q̈, rad/s² or m/s².
    pub joints: Vec<f64>,
    /// Rate of the twist of a floating base, expressed in its frame, rad/s² and m/s².
    pub base: Option<Twist<f64>>,
}

/// What a floating base at rest adds.
#[derive(Clone, Debug, PartialEq)]
pub struct FloatingBase {
    /// The load on the base (moment N·m, force N, in its frame) that the motion takes.
    pub load: Wrench<f64>,
    /// Spatial inertia of the complete robot, 6 × 6, angular part first.
    pub mass: Mat6<f64>,
    /// Momentum of the complete robot per unit of each joint, 6 × n.
    pub coupling: DMatrix<f64>,
}

/// The state of the joints, and what the environment exerts on a frame.
#[derive(Clone, Copy, Debug)]
pub struct Motion<'a> {
    /// Positions, velocities and accelerations of the coordinates, in rad and m.
    pub state: [&'a [f64]; 3],
    /// A frame, and the wrench that the environment exerts on it: moment and force along the axes of the base, about the
    /// frame's origin. A tool that pushes on its environment exerts the opposite wrench, which is what
    /// [`statics`](darm_core::tree::jacobian::statics) takes.
    pub load: Option<(&'a RobotFrame, Wrench<f64>)>,
}

/// The centre of mass and how it moves.
#[derive(Clone, Debug, PartialEq)]
pub struct Com {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in the base, m.
    pub position: Vec3<f64>,
    /// Per unit of each joint, 3 × n.
    pub jacobian: DMatrix<f64>,
    /// Per unit of a floating base's twist, 3 × 6, angular part first.
    pub base: Option<SMatrix<f64, 3, 6>>,
}

impl Kinematics {
    /// τ = Jᵀ F: the torques (N·m) and forces (N) of the joints that hold a frame which exerts `wrench` on its
    /// environment, along the axes of the base.
    pub fn statics(&self, wrench: &Wrench<f64>) -> Vec<f64> {
        self.jacobian_base.tr_mul(&six(&wrench.moment, &wrench.force)).iter().copied().collect()
    }

    /// A matrix of six columns with the same left singular vectors and singular values as the Jacobian in the base, for
    /// [`singular`](darm_core::tree::singular): the L of J = L Q.
    pub fn compact_jacobian(&self) -> Mat6<f64> {
        if self.jacobian_base.is_empty() {
            return Mat6::zeros();
        }
        let upper = self.jacobian_base.transpose().qr().r();
        Mat6::from_fn(|row, column| if column < upper.nrows() { upper[(column, row)] } else { 0.0 })
    }
}

impl Robot {
    /// Pose and Jacobians of a frame at the coordinates `q` (rad or m).
    ///
    /// # Errors
    ///
    /// As [`link_tree`](Self::link_tree); or, where joints follow others, `q` has more coordinates than the robot.
    pub fn kinematics(&self, frame: &RobotFrame, q: &[f64]) -> Result<Kinematics, TreeError> {
        let Placed { tree, links, coupling } = self.placed(q)?;
        let pose_base_frame = links.pose(frame.joint, &frame.pose);
        let jacobian_base = coupling.columns(&tree.jacobian(&links, frame.joint, &frame.pose));
        let mut jacobian_tool = jacobian_base.clone();
        for mut column in jacobian_tool.column_iter_mut() {
            let (angular, linear) = halves(&column.clone_owned());
            let turned = |v: &Vec3<f64>| pose_base_frame.rotation.tr_mul(v);
            column.copy_from(&six(&turned(&angular), &turned(&linear)));
        }
        Ok(Kinematics { pose_base_frame, jacobian_base, jacobian_tool })
    }

    /// Pose of every frame in the base at the coordinates `q` (rad or m), in the order of [`Robot::frames`].
    ///
    /// # Errors
    ///
    /// As [`kinematics`](Self::kinematics).
    pub fn poses(&self, q: &[f64]) -> Result<Vec<Pose<f64>>, TreeError> {
        let links = self.placed(q)?.links;
        Ok(self.frames.iter().map(|frame| links.pose(frame.joint, &frame.pose)).collect())
    }

    /// The equation of motion at a state. A floating base is at rest, its axes along those of the world.
    ///
    /// # Errors
    ///
    /// As [`kinematics`](Self::kinematics).
    pub fn dynamics(&self, motion: &Motion<'_>) -> Result<Dynamics, TreeError> {
        let [q, qd, qdd] = motion.state;
        let Placed { tree, links, coupling } = self.placed(q)?;
        let [qd, qdd] = [qd, qdd].map(|rates| coupling.rates(rates));
        let rest = LinkMotion::at_rest(&Vec3::zeros());
        let (on_base, mut torque) = tree.inverse_dynamics(&links, &rest, [&qd, &qdd]);
        let mut mass = tree.mass_matrix(&links);
        let gravity = coupling.torques(&tree.gravity_torque(&links));
        let (_, biased) = tree.inverse_dynamics(&links, &rest, [&qd, &[]]);
        let biased = coupling.torques(&biased);
        let mut kinetic_j = tree.kinetic_energy(&links, &qd);
        for (k, rotor) in self.joints.iter().map(|joint| joint.armature).enumerate() {
            mass.joints[(k, k)] += rotor;
            torque[k] += rotor * qdd[k];
            kinetic_j += 0.5 * rotor * qd[k] * qd[k];
        }
        let mut torque = coupling.torques(&torque);
        let (moment, force) = halves(&on_base);
        let momenta = coupling.columns(&mass.coupling);
        let mut base = self.floating.then(|| FloatingBase {
            load: Wrench { moment, force },
            mass: mass.base,
            coupling: DMatrix::from_iterator(6, coupling.len(), momenta.iter().copied()),
        });
        if let Some((frame, load)) = &motion.load {
            let jacobian = coupling.columns(&tree.jacobian(&links, frame.joint, &frame.pose));
            let by_load = jacobian.tr_mul(&six(&load.moment, &load.force));
            torque.iter_mut().zip(&by_load).for_each(|(torque, by_load)| *torque -= by_load);
            if let Some(base) = &mut base {
                let arm = links.pose(frame.joint, &frame.pose).position;
                base.load = base.load - Wrench { moment: load.moment + arm.cross(&load.force), force: load.force };
            }
        }
        Ok(Dynamics {
            torque,
            mass: coupling.square(&mass.joints),
            coriolis: coupling.square(&tree.coriolis_matrix(&links, &qd)),
            velocity_torque: biased.iter().zip(&gravity).map(|(biased, gravity)| biased - gravity).collect(),
            gravity,
            kinetic_j,
            potential_j: tree.potential_energy(&links, self.floating),
            base,
        })
    }

    /// What `torque` (N·m or N) does at the positions and velocities of a state, whose accelerations do not count.
    ///
    /// M q̈ = τ − C q̇ − G + Jᵀ F; a floating base is at rest and free, and nothing but gravity and the load of the motion
    /// acts on it. `None` when M is singular: a joint that moves no mass.
    ///
    /// # Errors
    ///
    /// As [`kinematics`](Self::kinematics).
    pub fn accelerations(&self, motion: &Motion<'_>, torque: &[f64]) -> Result<Option<Accelerations>, TreeError> {
        let [q, qd, _] = motion.state;
        let bias = self.dynamics(&Motion { state: [q, qd, &[]], load: motion.load })?;
        let (n, of_base) = (bias.torque.len(), if self.floating { 6 } else { 0 });
        let mut mass = DMatrix::zeros(of_base + n, of_base + n);
        let mut right = DVector::zeros(of_base + n);
        mass.view_mut((of_base, of_base), (n, n)).copy_from(&bias.mass);
        for (row, (torque, bias)) in torque.iter().zip(&bias.torque).enumerate() {
            right[of_base + row] = torque - bias;
        }
        if let Some(base) = &bias.base {
            mass.fixed_view_mut::<6, 6>(0, 0).copy_from(&base.mass);
            mass.view_mut((0, 6), (6, n)).copy_from(&base.coupling);
            mass.view_mut((6, 0), (n, 6)).copy_from(&base.coupling.transpose());
            let Wrench { moment, force } = base.load;
            right.fixed_rows_mut::<6>(0).copy_from(&-Twist { angular: moment, linear: force }.to_vector());
        }
        let Some(rates) = mass.cholesky().map(|factors| factors.solve(&right)) else { return Ok(None) };
        let joints = rates.rows(of_base, n).iter().copied().collect();
        let base = self.floating.then(|| Twist::from_vector(&rates.fixed_rows::<6>(0).into_owned()));
        Ok(Some(Accelerations { joints, base }))
    }

    /// Centre of mass and its Jacobian at the coordinates `q` (rad or m).
    ///
    /// # Errors
    ///
    /// As [`kinematics`](Self::kinematics).
    pub fn com(&self, q: &[f64]) -> Result<Com, TreeError> {
        let Placed { tree, links, coupling } = self.placed(q)?;
        let com = tree.centre_of_mass(&links, self.floating);
        let mut of_base = SMatrix::<f64, 3, 6>::zeros();
        if com.mass_kg > 0.0 {
            of_base.fixed_view_mut::<3, 3>(0, 0).copy_from(&-com.position.cross_matrix());
            of_base.fixed_view_mut::<3, 3>(0, 3).fill_with_identity();
        }
        let joints = coupling.columns(&com.joints);
        Ok(Com {
            mass_kg: self.mass(),
            position: com.position,
            jacobian: DMatrix::from_iterator(3, coupling.len(), joints.iter().copied()),
            base: self.floating.then_some(of_base),
        })
    }

    /// All links at the coordinates `q`; more numbers than coordinates are an error.
    fn placed(&self, q: &[f64]) -> Result<Placed, TreeError> {
        let (tree, coupling) = (self.link_tree()?, self.coupling());
        if q.len() > coupling.len() && coupling.len() < tree.len() {
            return Err(TreeError::TooMany { joints: q.len(), max: coupling.len() });
        }
        let links = tree.place(&Pose::identity(), &coupling.positions(q));
        Ok(Placed { tree, links, coupling })
    }
}

/// A tree in one posture, and how its joints follow the coordinates.
struct Placed {
    tree: LinkTree,
    links: Links,
    coupling: Coupling,
}
