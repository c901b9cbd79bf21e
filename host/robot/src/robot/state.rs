//! What a robot does in one posture, or at one state of motion, in tables of as many rows as it has joints.

use darm_core::dynamics::{self, floating};
use darm_core::real::{Mat6, Vec3};
use darm_core::se::{Pose, Twist, Wrench};
use darm_core::tree::{Frames, Tree, TreeError};
use nalgebra::{DMatrix, DVector, SMatrix};

use super::{MAX_JOINTS, Robot, RobotFrame};

/// A 6 × [`MAX_JOINTS`] Jacobian, angular rows first; columns past the last joint are zero.
pub type Jacobian = SMatrix<f64, 6, MAX_JOINTS>;

type Joints = [f64; MAX_JOINTS];

/// Where a frame stands, and how it moves.
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
    /// M, n × n.
    pub mass: DMatrix<f64>,
    /// C of Christoffel's symbols, n × n; of a fixed base.
    pub coriolis: DMatrix<f64>,
    /// C q̇: centrifugal and Coriolis torques.
    pub velocity_torque: Vec<f64>,
    /// G: what holds the arm against gravity.
    pub gravity: Vec<f64>,
    /// ½ q̇ᵀ M q̇, J.
    pub kinetic_j: f64,
    /// −Σ m g·c, J.
    pub potential_j: f64,
    /// What the base bears, or, when it floats, takes to stay as it is: M of base and joints.
    pub base: Option<FloatingBase>,
}

/// How a robot accelerates.
#[derive(Clone, Debug, PartialEq)]
pub struct Accelerations {
    /// q̈, rad/s² or m/s².
    pub joints: Vec<f64>,
    /// Rate of the twist of a floating base, told in its frame, rad/s² and m/s².
    pub base: Option<Twist<f64>>,
}

/// What a floating base at rest adds.
#[derive(Clone, Debug, PartialEq)]
pub struct FloatingBase {
    /// The load on the base (moment N·m, force N, in its frame) that the motion takes.
    pub load: Wrench<f64>,
    /// Spatial inertia of the whole robot, 6 × 6, angular part first.
    pub mass: Mat6<f64>,
    /// Momentum of the whole per unit of each joint, 6 × n.
    pub coupling: DMatrix<f64>,
}

/// The state of the joints, and what the environment exerts on a frame.
#[derive(Clone, Copy, Debug)]
pub struct Motion<'a> {
    /// Positions, velocities and accelerations, in rad and m.
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

impl Robot {
    /// Pose and Jacobians of a frame at the positions `q` (rad or m).
    pub fn kinematics(&self, frame: &RobotFrame, q: &[f64]) -> Result<Kinematics, TreeError> {
        let (tree, frames) = self.placed(q)?;
        let tool = frame.in_tree(&tree);
        Ok(Kinematics {
            pose_base_frame: frames.pose(&tool),
            jacobian_base: tree.jacobian_base(&tool, &frames),
            jacobian_tool: tree.jacobian_tool(&tool, &frames),
        })
    }

    /// Pose of every frame in the base at the positions `q` (rad or m), in the order of [`Robot::frames`].
    pub fn poses(&self, q: &[f64]) -> Result<Vec<Pose<f64>>, TreeError> {
        let (tree, frames) = self.placed(q)?;
        Ok(self.frames.iter().map(|frame| frames.pose(&frame.in_tree(&tree))).collect())
    }

    /// The equation of motion at a state. A floating base is at rest, its axes along those of the world.
    pub fn dynamics(&self, motion: &Motion<'_>) -> Result<Dynamics, TreeError> {
        let n = self.joints.len();
        let [q, qd, qdd] = motion.state.map(padded);
        let (tree, frames) = self.placed(&q)?;
        let mut torque = dynamics::inverse_dynamics(&tree, &q, &qd, &qdd, None);
        let mut base = None;
        if self.floating {
            let (load, mass) = (self.base_load(&tree, [&q, &qd, &qdd]), floating::mass(&tree, &frames, &q));
            let coupling = DMatrix::from_fn(6, n, |row, column| mass.coupling[(row, column)]);
            base = Some(FloatingBase { load, mass: mass.base, coupling });
        }
        if let Some((frame, load)) = &motion.load {
            let by_load = darm_core::tree::jacobian::statics(&tree.jacobian_base(&frame.in_tree(&tree), &frames), load);
            torque.iter_mut().zip(&by_load).for_each(|(torque, held)| *torque -= held);
            if let Some(base) = &mut base {
                let arm = frames.pose(&frame.in_tree(&tree)).position;
                base.load = base.load - Wrench { moment: load.moment + arm.cross(&load.force), force: load.force };
            }
        }
        let first = |all: &Joints| all[..n].to_vec();
        Ok(Dynamics {
            torque: first(&torque),
            mass: square(n, &dynamics::mass_matrix(&tree, &q)),
            coriolis: square(n, &dynamics::coriolis_matrix(&tree, &frames, &qd)),
            velocity_torque: first(&dynamics::velocity_torque(&tree, &q, &qd)),
            gravity: first(&dynamics::gravity(&tree, &frames)),
            kinetic_j: dynamics::kinetic_energy(&tree, &frames, &qd),
            potential_j: dynamics::potential_energy(&tree, &frames),
            base,
        })
    }

    fn base_load(&self, tree: &Tree<f64, MAX_JOINTS>, state: [&Joints; 3]) -> Wrench<f64> {
        let (pose, rest) = (Pose::identity(), Twist::zero());
        let still = floating::BaseMotion { pose, twist: rest, twist_rate: rest };
        floating::inverse_dynamics(tree, &still, state, None).0
    }

    /// What `torque` (N·m or N) does at the positions and velocities of a state, whose accelerations do not count.
    ///
    /// M q̈ = τ − C q̇ − G + Jᵀ F; a floating base is at rest and free, and nothing but gravity and the load of the motion
    /// acts on it. `None` when M is singular: a joint that moves no mass.
    pub fn accelerations(&self, motion: &Motion<'_>, torque: &[f64]) -> Result<Option<Accelerations>, TreeError> {
        let [q, qd, _] = motion.state;
        let held = self.dynamics(&Motion { state: [q, qd, &[]], load: motion.load })?;
        let (n, of_base) = (self.joints.len(), if self.floating { 6 } else { 0 });
        let mut mass = DMatrix::zeros(of_base + n, of_base + n);
        let mut right = DVector::zeros(of_base + n);
        mass.view_mut((of_base, of_base), (n, n)).copy_from(&held.mass);
        for (row, (torque, held)) in torque.iter().zip(&held.torque).enumerate() {
            right[of_base + row] = torque - held;
        }
        if let Some(base) = &held.base {
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

    /// Centre of mass and its Jacobian at the positions `q` (rad or m).
    pub fn com(&self, q: &[f64]) -> Result<Com, TreeError> {
        let (tree, frames) = self.placed(q)?;
        let n = self.joints.len();
        let of_joints = |jacobian: &SMatrix<f64, 3, MAX_JOINTS>| DMatrix::from_fn(3, n, |r, c| jacobian[(r, c)]);
        if self.floating {
            let com = floating::com_jacobian(&tree, &frames);
            let jacobian = of_joints(&com.joints);
            return Ok(Com { mass_kg: self.mass(), position: com.position, jacobian, base: Some(com.base) });
        }
        let (position, jacobian) = dynamics::com_jacobian(&tree, &frames);
        Ok(Com { mass_kg: self.mass(), position, jacobian: of_joints(&jacobian), base: None })
    }

    fn placed(&self, q: &[f64]) -> Result<(Tree<f64, MAX_JOINTS>, Frames<f64, MAX_JOINTS>), TreeError> {
        let (tree, mut frames) = (self.tree()?, Frames::default());
        tree.place(&padded(q), &mut frames);
        Ok((tree, frames))
    }
}

/// The numbers of the joints that there are, and zeros.
fn padded(given: &[f64]) -> Joints {
    let mut padded = [0.0; MAX_JOINTS];
    padded.iter_mut().zip(given).for_each(|(to, from)| *to = *from);
    padded
}

fn square(n: usize, matrix: &SMatrix<f64, MAX_JOINTS, MAX_JOINTS>) -> DMatrix<f64> {
    DMatrix::from_fn(n, n, |row, column| matrix[(row, column)])
}
