//! Laws of kinematics and dynamics on arms and trees drawn at random: derivatives against dual numbers, energy, symmetry, virtual work.
//!
//! A tolerance of 1e-10 of the largest term leaves four digits for the sums of a dozen joints in `f64`.

use std::array::from_fn;

use darm_core::actuator::{Axis, JointKind};
use darm_core::dynamics::{self, floating};
use darm_core::real::{Mat3, Real, Vec3, real};
use darm_core::se::{Pose, Twist, Wrench};
use darm_core::tree::euler::{PoseVector, analytic_jacobian};
use darm_core::tree::jacobian::{statics, twist};
use darm_core::tree::{Body, Frames, Inertia, Joint, LinkFrame, Tree, singular};
use nalgebra::{SMatrix, SVector};
use num_dual::Dual64;

/// Joints of the trees that are drawn.
const N: usize = 7;
const SEEDS: u64 = 60;
const NEAR: f64 = 1e-10;

/// Numbers within ±1 from a seed.
struct Draw(u64);

impl Draw {
    fn one(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self) -> Vec3<f64> {
        Vec3::from_fn(|_, _| self.one())
    }

    fn joints(&mut self, size: f64) -> [f64; N] {
        from_fn(|_| size * self.one())
    }

    fn pose(&mut self) -> Pose<f64> {
        Pose::new(&(self.vector() * 3.0), self.vector())
    }

    /// Mass points, so that the moments of inertia are those of a body.
    fn inertia(&mut self) -> Inertia<f64> {
        (0..4).fold(Inertia::none(), |body, _| {
            let point = Inertia { mass: 1.5 + self.one(), com: self.vector(), about_com: Mat3::zeros() };
            body.joined(&point)
        })
    }

    /// An axis of the frame, or any.
    fn axis(&mut self) -> Vec3<f64> {
        match (self.one() * 2.0 + 2.0) as u32 {
            0 => Vec3::x(),
            1 => Vec3::y(),
            2 => Vec3::z(),
            _ => self.vector().normalize(),
        }
    }

    /// Any tree: joints that turn or slide, on the one before or on another.
    fn tree(&mut self) -> [Joint<f64>; N] {
        from_fn(|index| {
            let before = index.checked_sub(1);
            let parent =
                if self.one() < 0.4 { before } else { before.filter(|_| self.one() < 0.7).map(|last| last / 2) };
            let kind = if self.one() < 0.4 { JointKind::Revolute } else { JointKind::Prismatic };
            Joint {
                parent,
                axis: Axis { kind, direction: self.axis() },
                placement: self.pose(),
                inertia: self.inertia(),
            }
        })
    }
}

/// A tree in a posture, in numbers of type `T`.
struct Case<T: Real> {
    tree: Tree<T, N>,
    tool: LinkFrame<T>,
    frames: Frames<T, N>,
    q: [T; N],
}

impl<T: Real> Case<T> {
    fn new(joints: &[Joint<f64>; N], tool: &Pose<f64>, q: &[T; N]) -> Self {
        let tree = Tree::new(&joints.map(|joint| joint.cast()), Vec3::new(0.3, -2.0, -9.81).map(real)).expect("a tree");
        let mut frames = Frames::default();
        tree.place(q, &mut frames);
        Self { tool: tree.frame(N - 1, &tool.cast()), tree, frames, q: *q }
    }
}

/// One drawn state with everything that a law may ask for.
struct State {
    joints: [Joint<f64>; N],
    tool: Pose<f64>,
    q: [f64; N],
    qd: [f64; N],
    qdd: [f64; N],
    case: Case<f64>,
}

fn states() -> impl Iterator<Item = State> {
    (1..=SEEDS).map(|seed| {
        let mut draw = Draw(seed * 7919);
        let (joints, tool) = (draw.tree(), draw.pose());
        let [q, qd, qdd] = [3.0, 2.0, 2.0].map(|size| draw.joints(size));
        State { case: Case::new(&joints, &tool, &q), joints, tool, q, qd, qdd }
    })
}

impl State {
    /// The case at q + ε·q̇ with ε² = 0: derivative parts are rates.
    fn moving(&self) -> Case<Dual64> {
        let q = from_fn(|k| Dual64::new(self.q[k], self.qd[k]));
        Case::new(&self.joints, &self.tool, &q)
    }
}

#[track_caller]
fn near<const R: usize, const C: usize>(a: &SMatrix<f64, R, C>, b: &SMatrix<f64, R, C>, size: f64) {
    let error = (a - b).amax();
    assert!(error <= NEAR * (1.0 + size + b.amax()), "{a} is not {b}: off by {error:e}");
}

fn column<const K: usize>(numbers: [f64; K]) -> SVector<f64, K> {
    SVector::from(numbers)
}

#[test]
fn the_jacobian_is_the_derivative_of_the_pose() {
    for state in states() {
        let dual = state.moving();
        let end = dual.frames.pose(&dual.tool);
        let (value, rate) = (end.rotation.map(|x| x.re), end.rotation.map(|x| x.eps));
        let turn = rate * value.transpose();
        let jacobian = state.case.tree.jacobian_base(&state.case.tool, &state.case.frames);
        let moving = twist(&jacobian, &state.qd);
        near(&moving.angular, &Vec3::new(turn.m32, turn.m13, turn.m21), 0.0);
        near(&moving.linear, &end.position.map(|x| x.eps), 0.0);
        let tool = state.case.tree.jacobian_tool(&state.case.tool, &state.case.frames);
        near(&(value * twist(&tool, &state.qd).linear), &moving.linear, 0.0);
    }
}

#[test]
fn the_jacobian_rate_is_the_derivative_of_the_jacobian() {
    for state in states() {
        let dual = state.moving();
        let jacobian = dual.tree.jacobian_base(&dual.tool, &dual.frames);
        let rate = state.case.tree.jacobian_rate(&state.case.tool, &state.qd, &state.case.frames);
        near(&rate, &jacobian.map(|x| x.eps), 0.0);
    }
}

#[test]
fn the_analytic_jacobian_is_the_derivative_of_the_pose_vector() {
    for state in states() {
        let dual = state.moving();
        let vector = PoseVector::from(&dual.frames.pose(&dual.tool));
        let pose = state.case.frames.pose(&state.case.tool);
        let jacobian = state.case.tree.jacobian_base(&state.case.tool, &state.case.frames);
        let analytic = analytic_jacobian(&jacobian, &PoseVector::from(&pose)).expect("no gimbal lock");
        let rates = twist(&analytic, &state.qd);
        near(&rates.angular, &vector.angles.map(|x| x.eps), rates.angular.amax());
        near(&rates.linear, &vector.position.map(|x| x.eps), 0.0);
        near(&Pose::from(&PoseVector::from(&pose)).rotation, &pose.rotation, 0.0);
    }
}

#[test]
fn statics_does_the_work_of_the_load() {
    for (number, state) in states().enumerate() {
        let mut draw = Draw(number as u64 + 5);
        let load = Wrench { moment: draw.vector(), force: draw.vector() };
        let jacobian = state.case.tree.jacobian_base(&state.case.tool, &state.case.frames);
        let work = load.power(&twist(&jacobian, &state.qd));
        let torque = statics(&jacobian, &load);
        let joints = column(torque).dot(&column(state.qd));
        assert!((work - joints).abs() < NEAR * (1.0 + work.abs()), "{work} is not {joints}");
    }
}

#[test]
fn mass_matrix_is_symmetric_positive_and_made_of_unit_accelerations() {
    for State { q, case, .. } in states() {
        let mass = dynamics::mass_matrix(&case.tree, &case.q);
        near(&mass, &mass.transpose(), 0.0);
        assert!(mass.cholesky().is_some(), "{mass} is not positive");
        let mut weightless = case.tree;
        weightless.gravity = Vec3::zeros();
        for k in 0..N {
            let unit = from_fn(|j| if j == k { 1.0 } else { 0.0 });
            let torque = dynamics::inverse_dynamics(&weightless, &q, &[0.0; N], &unit, None);
            near(&column(torque), &mass.column(k).into_owned(), mass.amax());
        }
    }
}

#[test]
fn mass_rate_less_twice_coriolis_is_skew() {
    for state in states() {
        let dual = state.moving();
        let rate = dynamics::mass_matrix(&dual.tree, &dual.q).map(|x| x.eps);
        let coriolis = dynamics::coriolis_matrix(&state.case.tree, &state.case.frames, &state.qd);
        let rest = rate - coriolis * 2.0;
        near(&rest, &-rest.transpose(), rate.amax());
        let torque = dynamics::velocity_torque(&state.case.tree, &state.q, &state.qd);
        near(&(coriolis * column(state.qd)), &column(torque), coriolis.amax());
    }
}

#[test]
fn state_space_form_is_inverse_dynamics() {
    for State { q, qd, qdd, case, .. } in states() {
        let form = dynamics::state_space(&case.tree, &q, &qd);
        let torque = form.mass * column(qdd) + column(form.velocity) + column(form.gravity);
        near(&column(dynamics::inverse_dynamics(&case.tree, &q, &qd, &qdd, None)), &torque, form.mass.amax());
    }
}

#[test]
fn forward_dynamics_undoes_inverse_dynamics() {
    for State { q, qd, qdd, case, .. } in states() {
        let torque = dynamics::inverse_dynamics(&case.tree, &q, &qd, &qdd, None);
        let back = dynamics::forward_dynamics(&case.tree, &q, &qd, &torque).expect("a regular mass matrix");
        near(&column(back), &column(qdd), 100.0);
    }
}

#[test]
fn power_is_the_rate_of_energy() {
    for state in states() {
        let dual = state.moving();
        let qd: [Dual64; N] = from_fn(|k| Dual64::new(state.qd[k], state.qdd[k]));
        let energy = dynamics::kinetic_energy(&dual.tree, &dual.frames, &qd)
            + dynamics::potential_energy(&dual.tree, &dual.frames);
        let torque = dynamics::inverse_dynamics(&state.case.tree, &state.q, &state.qd, &state.qdd, None);
        let power = column(torque).dot(&column(state.qd));
        let size: f64 = torque.iter().map(|x| x.abs()).sum();
        assert!((energy.eps - power).abs() < NEAR * (1.0 + size), "{} is not {power}", energy.eps);
        let mass = dynamics::mass_matrix(&state.case.tree, &state.case.q);
        let kinetic = column(state.qd).dot(&(mass * column(state.qd))) / 2.0;
        assert!(
            (energy.re - dynamics::potential_energy(&state.case.tree, &state.case.frames) - kinetic).abs()
                < NEAR * (1.0 + size)
        );
    }
}

#[test]
fn gravity_is_the_gradient_of_potential_energy() {
    for state in states() {
        let dual = state.moving();
        let rate = dynamics::potential_energy(&dual.tree, &dual.frames).eps;
        let held = column(dynamics::gravity(&state.case.tree, &state.case.frames));
        let at_rest = dynamics::inverse_dynamics(&state.case.tree, &state.q, &[0.0; N], &[0.0; N], None);
        near(&held, &column(at_rest), held.amax());
        assert!((held.dot(&column(state.qd)) - rate).abs() < NEAR * (1.0 + held.amax()));
    }
}

#[test]
fn com_jacobian_is_the_derivative_of_the_centre_of_mass() {
    for state in states() {
        let dual = state.moving();
        let (_, com) = dynamics::center_of_mass(&dual.tree, &dual.frames);
        let (position, jacobian) = dynamics::com_jacobian(&state.case.tree, &state.case.frames);
        near(&position, &com.map(|x| x.re), 0.0);
        near(&(jacobian * column(state.qd)), &com.map(|x| x.eps), 0.0);
        let momentum = dynamics::momentum(&state.case.tree, &state.case.frames, &Twist::zero(), &state.qd);
        let mass = dynamics::center_of_mass(&state.case.tree, &state.case.frames).0;
        near(&(jacobian * column(state.qd) * mass), &momentum.linear, momentum.linear.amax());
    }
}

#[test]
fn regressor_times_parameters_is_inverse_dynamics() {
    for State { q, qd, qdd, case, .. } in states() {
        let mut y = [[[0.0; 10]; N]; N];
        dynamics::regressor(&case.tree, &case.frames, [&q, &qd, &qdd], &mut y);
        let mut draw = Draw(11);
        let phi: [[f64; 10]; N] = from_fn(|_| from_fn(|_| draw.one()));
        let mut other = case.tree;
        (0..N).for_each(|link| other.set_parameters(link, &phi[link]));
        let torque = column(dynamics::inverse_dynamics(&other, &q, &qd, &qdd, None));
        near(&column(dynamics::torque_of(&y, &phi)), &torque, 100.0);
    }
}

#[test]
fn a_floating_base_obeys_the_same_equation() {
    for (number, State { q, qd, qdd, mut case, .. }) in states().enumerate() {
        let mut draw = Draw(number as u64 + 17);
        case.tree.base = Body::from(&draw.inertia());
        let six = |draw: &mut Draw| Twist { angular: draw.vector(), linear: draw.vector() };
        let base = floating::BaseMotion { pose: draw.pose(), twist: six(&mut draw), twist_rate: six(&mut draw) };
        case.tree.place_floating(&base.pose, &q, &mut case.frames);
        let (load, torque) = floating::inverse_dynamics(&case.tree, &base, [&q, &qd, &qdd], None);
        let still = floating::BaseMotion { twist_rate: Twist::zero(), ..base };
        let (bias, rest) = floating::inverse_dynamics(&case.tree, &still, [&q, &qd, &[0.0; N]], None);
        let mass = floating::mass(&case.tree, &case.frames, &q);
        near(&mass.base, &mass.base.transpose(), mass.base.amax());
        let rate = base.twist_rate.to_vector();
        let six = |wrench: Wrench<f64>| Twist { angular: wrench.moment, linear: wrench.force }.to_vector();
        near(&(mass.base * rate + mass.coupling * column(qdd) + six(bias)), &six(load), mass.base.amax());
        let joints = mass.coupling.transpose() * rate + mass.joints * column(qdd) + column(rest);
        near(&joints, &column(torque), mass.base.amax());
    }
}

#[test]
fn singular_values_are_those_of_the_gram_matrix() {
    for State { case, .. } in states() {
        let jacobian = case.tree.jacobian_base(&case.tool, &case.frames);
        let ellipsoid = singular::manipulability_ellipsoid(&jacobian);
        let squares = SMatrix::<f64, 6, 6>::from_diagonal(&column(ellipsoid.lengths.map(|length| length * length)));
        near(&(ellipsoid.axes * squares * ellipsoid.axes.transpose()), &(jacobian * jacobian.transpose()), 0.0);
        near(&(ellipsoid.axes.transpose() * ellipsoid.axes), &SMatrix::identity(), 0.0);
        let determinant = (jacobian * jacobian.transpose()).determinant().max(0.0).sqrt();
        let size = ellipsoid.lengths.iter().product::<f64>();
        assert!((singular::manipulability(&jacobian) - determinant).abs() < 1e-6 * (1.0 + size));
    }
}
