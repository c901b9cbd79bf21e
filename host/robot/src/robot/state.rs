//! What a robot does in one posture, or at one state of motion, in tables of as many rows as it has coordinates.

use darm_core::dynamics::floating::BaseMotion;
use darm_core::real::{Mat6, Vec3, Vec6};
use darm_core::se::{Pose, Twist, Wrench};
use darm_core::tree::TreeError;
use nalgebra::{DMatrix, DVector, Matrix6xX, SMatrix};

use super::{Coupling, Robot, RobotFrame};
use crate::tree::dynamics::{CoriolisMatrix, MassMatrix};
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
    /// C of Christoffel's symbols, n × n: the block of the joints when the base moves.
    pub coriolis: DMatrix<f64>,
    /// Centrifugal and Coriolis torques, N·m or N: C q̇ of a base at rest.
    pub velocity_torque: Vec<f64>,
    /// G: what holds the arm against gravity, N·m or N.
    pub gravity: Vec<f64>,
    /// ½ q̇ᵀ M q̇, J.
    pub kinetic_j: f64,
    /// −Σ m g·c of the links, and of a base that floats, J.
    pub potential_j: f64,
    /// When the base floats: the wrench that its motion takes, M and C of base and joints.
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

/// What a floating base adds, in its own frame and about its origin, angular part first.
#[derive(Clone, Debug, PartialEq)]
pub struct FloatingBase {
    /// The load on the base (moment N·m, force N) that the motion takes.
    pub load: Wrench<f64>,
    /// Spatial inertia of the complete robot, 6 × 6.
    pub mass: Mat6<f64>,
    /// Momentum of the complete robot per unit of each joint, 6 × n.
    pub coupling: DMatrix<f64>,
    /// C of Christoffel's symbols of base and joints, (6 + n) × (6 + n): C (V, q̇) is what the velocities take.
    pub coriolis: DMatrix<f64>,
}

/// A base at rest in the origin of the world.
pub fn base_at_rest() -> BaseMotion<f64> {
    BaseMotion { pose: Pose::identity(), twist: Twist::zero(), twist_rate: Twist::zero() }
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
        self.dynamics_on(&base_at_rest(), motion)
    }

    /// The equation of motion on a base that moves; the load of the motion is along the axes of the base.
    ///
    /// # Errors
    ///
    /// As [`kinematics`](Self::kinematics).
    pub fn dynamics_on(&self, base: &BaseMotion<f64>, motion: &Motion<'_>) -> Result<Dynamics, TreeError> {
        let [q, qd, qdd] = motion.state;
        let placed = self.placed_on(&base.pose, q)?;
        let Placed { tree, links, coupling } = &placed;
        let [qd, qdd] = [qd, qdd].map(|rates| coupling.rates(rates));
        let [moving, steady] = [base.twist_rate, Twist::zero()].map(|rate| in_world(links, &base.twist, &rate));
        let (on_base, mut torque) = tree.inverse_dynamics(links, &moving, [&qd, &qdd]);
        let mut mass = tree.mass_matrix(links);
        let gravity = coupling.torques(&tree.gravity_torque(links));
        let (_, biased) = tree.inverse_dynamics(links, &steady, [&qd, &[]]);
        let biased = coupling.torques(&biased);
        for (k, rotor) in self.joints.iter().map(|joint| joint.armature).enumerate() {
            mass.joints[(k, k)] += rotor;
            torque[k] += rotor * qdd[k];
        }
        let coriolis = tree.coriolis_matrix(links, &moving.velocity, &qd);
        let mut equation = Dynamics {
            torque: coupling.torques(&torque),
            coriolis: coupling.square(&coriolis.joints),
            velocity_torque: biased.iter().zip(&gravity).map(|(biased, gravity)| biased - gravity).collect(),
            gravity,
            kinetic_j: mass.kinetic_energy(&moving.velocity, &qd),
            potential_j: tree.potential_energy(links, self.floating),
            base: self.floating.then(|| placed.floating(&on_base, &mass, &coriolis)),
            mass: coupling.square(&mass.joints),
        };
        if let Some(of_base) = &mut equation.base {
            of_base.add_armature(self.base_armature, base);
            equation.kinetic_j += 0.5 * self.base_armature * base.twist.to_vector().norm_squared();
        }
        if let Some((frame, load)) = &motion.load {
            placed.subtract(frame, load, &mut equation);
        }
        Ok(equation)
    }

    /// What `torque` (N·m or N) does at the positions and velocities of a state, whose accelerations do not count.
    ///
    /// M q̈ = τ − C q̇ − G + Jᵀ F; a floating base is at rest and free, and nothing but gravity and the load of the motion
    /// acts on it. `None` when M is singular: a joint that moves no mass, or a base that has none to push against.
    ///
    /// # Errors
    ///
    /// As [`kinematics`](Self::kinematics).
    pub fn accelerations(&self, motion: &Motion<'_>, torque: &[f64]) -> Result<Option<Accelerations>, TreeError> {
        self.accelerations_on(&base_at_rest(), motion, torque)
    }

    /// The same on a base that moves; its own acceleration does not count.
    ///
    /// # Errors
    ///
    /// As [`kinematics`](Self::kinematics).
    pub fn accelerations_on(
        &self,
        base: &BaseMotion<f64>,
        motion: &Motion<'_>,
        torque: &[f64],
    ) -> Result<Option<Accelerations>, TreeError> {
        let [q, qd, _] = motion.state;
        let steady = BaseMotion { twist_rate: Twist::zero(), ..*base };
        let bias = self.dynamics_on(&steady, &Motion { state: [q, qd, &[]], load: motion.load })?;
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
        let Some(rates) = solved(mass, &right) else { return Ok(None) };
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
    pub(super) fn placed(&self, q: &[f64]) -> Result<Placed, TreeError> {
        self.placed_on(&Pose::identity(), q)
    }

    /// The same with this pose of the base.
    pub(super) fn placed_on(&self, base: &Pose<f64>, q: &[f64]) -> Result<Placed, TreeError> {
        let (tree, coupling) = (self.link_tree()?, self.coupling());
        if q.len() > coupling.len() && coupling.len() < tree.len() {
            return Err(TreeError::TooMany { joints: q.len(), max: coupling.len() });
        }
        let links = tree.place(base, &coupling.positions(q));
        Ok(Placed { tree, links, coupling })
    }
}

impl FloatingBase {
    /// Adds the same inertia to each axis: it takes a·ω̇, and a times the acceleration of the origin of the base,
    /// which is v̇ + ω × v in its own axes. So MuJoCo counts the armature of a free joint, whose velocity is along the axes
    /// of the world.
    fn add_armature(&mut self, armature: f64, base: &BaseMotion<f64>) {
        let (Twist { angular, linear }, rate) = (base.twist, base.twist_rate);
        self.mass += Mat6::identity() * armature;
        let mut rates = self.coriolis.fixed_view_mut::<3, 3>(3, 3);
        rates += angular.cross_matrix() * armature;
        self.load.moment += rate.angular * armature;
        self.load.force += (rate.linear + angular.cross(&linear)) * armature;
    }
}

/// The motion of a base about the world's origin, from its twist and the rate of that in its own frame.
pub(super) fn in_world(links: &Links, twist: &Twist<f64>, rate: &Twist<f64>) -> LinkMotion {
    let screws = links.base_screws();
    LinkMotion { velocity: screws * twist.to_vector(), acceleration: screws * rate.to_vector() }
}

/// A tree in one posture, and how its joints follow the coordinates.
pub(super) struct Placed {
    pub(super) tree: LinkTree,
    pub(super) links: Links,
    pub(super) coupling: Coupling,
}

impl Placed {
    /// What a floating base adds, from the wrench on it (about the world's origin) and the matrices of the tree.
    fn floating(&self, on_base: &Vec6<f64>, mass: &MassMatrix, rates: &CoriolisMatrix) -> FloatingBase {
        let (screws, n) = (self.links.base_screws(), self.coupling.len());
        let (moment, force) = halves(&screws.tr_mul(on_base));
        let in_base = |columns: &Jacobian| {
            // Not `from_columns`, which wants one column at least: a single body has none.
            let mut in_base = columns.clone();
            for (index, column) in columns.column_iter().enumerate() {
                in_base.set_column(index, &screws.tr_mul(&column));
            }
            let columns = self.coupling.columns(&in_base);
            DMatrix::from_iterator(6, n, columns.iter().copied())
        };
        let mut coriolis = DMatrix::zeros(6 + n, 6 + n);
        coriolis.view_mut((0, 0), (6, 6)).copy_from(&(screws.tr_mul(&rates.base) * screws));
        coriolis.view_mut((0, 6), (6, n)).copy_from(&in_base(&rates.by_joints));
        coriolis.view_mut((6, 0), (n, 6)).copy_from(&in_base(&rates.by_base).transpose());
        coriolis.view_mut((6, 6), (n, n)).copy_from(&self.coupling.square(&rates.joints));
        FloatingBase {
            load: Wrench { moment, force },
            mass: screws.tr_mul(&mass.base) * screws,
            coupling: in_base(&mass.coupling),
            coriolis,
        }
    }

    /// Leaves to the environment what it exerts on a frame, along the axes of the base.
    fn subtract(&self, frame: &RobotFrame, load: &Wrench<f64>, equation: &mut Dynamics) {
        let Self { tree, links, coupling } = self;
        let turned = |v: &Vec3<f64>| links.base.rotation * v;
        let (moment, force) = (turned(&load.moment), turned(&load.force));
        let jacobian = coupling.columns(&tree.jacobian(links, frame.joint, &frame.pose));
        let by_load = jacobian.tr_mul(&six(&moment, &force));
        equation.torque.iter_mut().zip(&by_load).for_each(|(torque, by_load)| *torque -= by_load);
        if let Some(base) = &mut equation.base {
            let at = links.pose(frame.joint, &frame.pose).position;
            let (moment, force) = halves(&links.base_screws().tr_mul(&six(&(moment + at.cross(&force)), &force)));
            base.load = base.load - Wrench { moment, force };
        }
    }
}

/// M⁻¹ of a symmetric matrix times a column; `None` of a singular one. What is left of a diagonal entry after elimination has an
/// error of up to n roundings of that entry (N. J. Higham, Accuracy and Stability of Numerical Algorithms, theorem 10.3): where it
/// is no larger, it is a rounding of zero, and a body without mass would be accelerated by 10¹⁷ rad/s².
fn solved(matrix: DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    let diagonal = matrix.diagonal();
    let factors = matrix.cholesky()?;
    let rounding = diagonal.len() as f64 * f64::EPSILON;
    let pivots = factors.l_dirty().diagonal().map(|root| root * root);
    let is_regular = pivots.iter().zip(&diagonal).all(|(pivot, entry)| *pivot > rounding * entry);
    is_regular.then(|| factors.solve(right))
}
