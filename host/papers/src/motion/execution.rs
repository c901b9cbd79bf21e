//! A planned motion executed by joint control on a simulated robot whose masses are its own.
//!
//! Each joint has a PD loop about its plan, as in the paper, and the plan's torque beforehand where it is given
//! ([`feed_forward`](super::feed_forward)): without it a joint of 10 kN·m/rad sags by 0.04 rad under this robot's weight, and it
//! rocks on the edges of its soles or falls. Nothing looks at the balance while the robot moves: a robot that does
//! not fall was planned so.
//!
//! The ground and the chair push at points: springs and dampers along the vertical, never pulling, with Coulomb friction about an
//! anchor on the ground. The chair is level, and any point of the seat can touch it. Velocities step by the linearly implicit
//! Euler method: stiffness and damping of controller and contacts enter the matrix, so that steps of half a millisecond are
//! stable. A robot that loses its balance falls.

use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_core::tree::TreeError;
use nalgebra::{DMatrix, DVector};

use super::balance::Polygon;
use super::mapping::Mapped;
use super::placed::Placed;
use super::setup::Setup;
use super::{BodyPoint, Posture};
use darm_robot::robot::Robot;

/// Time step, s.
const STEP_S: f64 = 5e-4;
/// Time in which the robot settles into its first posture, s.
const SETTLE_S: f64 = 0.6;
/// Stiffness and damping of each point of the ground, N/m and N·s/m.
const GROUND: (f64, f64) = (4e5, 2e3);
/// Of each point of the chair.
const CHAIR: (f64, f64) = (1e5, 2e3);
/// Friction of sole and ground.
const FRICTION: f64 = 0.8;
/// It has fallen when its centre of mass ends this far from the plan, m.
const FALLEN_M: f64 = 0.15;

/// Gains of every joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// N·m/rad.
    pub stiffness: f64,
    /// N·m·s/rad.
    pub damping: f64,
}

impl Default for Gains {
    /// Those of a stiff hydraulic joint.
    fn default() -> Self {
        Self { stiffness: 1e4, damping: 500.0 }
    }
}

/// What came of it, at the times of the plan.
#[derive(Clone, Debug)]
pub struct Executed {
    /// Postures.
    pub postures: Vec<Posture>,
    /// Centre of pressure of the feet, m.
    pub cop: Vec<[f64; 2]>,
    /// Its least distance from the edge of the soles after lift-off, m: 0 when the robot tips.
    pub cop_margin_m: f64,
    /// What the chair bears, N.
    pub chair_n: Vec<f64>,
    /// Largest distance of a joint from its plan, rad.
    pub worst_joint_rad: f64,
    /// Whether it fell.
    pub fell: bool,
}

/// A point that may touch, and what it touches.
struct Touch {
    at: BodyPoint,
    /// Height of what it touches, m.
    height: f64,
    spring: (f64, f64),
    is_foot: bool,
    anchor: Option<Vec3<f64>>,
}

/// Force of a point, and its share of stiffness and damping.
struct Push {
    force: Vec3<f64>,
    jacobian: DMatrix<f64>,
    stiffness: Vec3<f64>,
    damping: Vec3<f64>,
}

/// Executes a plan on `robot`, with the joints' torques frame by frame, or none.
///
/// # Errors
///
/// The joints of `robot` make no tree that can be computed.
pub fn execute(
    robot: &Robot,
    setup: &Setup,
    plan: &Mapped,
    (gains, torque): (Gains, &[Vec<f64>]),
) -> Result<Executed, TreeError> {
    let mut placed = Placed::new(robot)?;
    let postures = &plan.trajectory.postures;
    placed.place(&postures[0]);
    let mut touches = touches(setup, &placed);
    let posture = postures[0].clone();
    let mut state = State { velocity: DVector::zeros(6 + posture.q.len()), posture };
    let mut executed = Executed {
        postures: Vec::new(),
        cop: Vec::new(),
        cop_margin_m: f64::INFINITY,
        chair_n: Vec::new(),
        worst_joint_rad: 0.0,
        fell: false,
    };
    let start_s = plan.time_s[0] - SETTLE_S;
    let steps = ((plan.time_s[plan.time_s.len() - 1] - start_s) / STEP_S).round() as usize;
    for step in 0..=steps {
        let time_s = start_s + step as f64 * STEP_S;
        placed.place(&state.posture);
        let pushes: Vec<Push> = touches.iter_mut().map(|touch| push(touch, &placed, &state.velocity)).collect();
        if executed.postures.len() < plan.time_s.len() && time_s >= plan.time_s[executed.postures.len()] - 0.5 * STEP_S
        {
            let planned = &postures[executed.postures.len()];
            executed.record(&state.posture, &placed, &touches, &pushes, planned);
        }
        let next = state.advanced(&placed, &pushes, &desired(plan, torque, time_s), gains);
        let Some(next) = next else { break };
        state = next;
    }
    judge(&mut executed, plan, &mut placed);
    Ok(executed)
}

/// Whether it fell, and how near it came to tipping.
fn judge(executed: &mut Executed, plan: &Mapped, placed: &mut Placed) {
    let mut com = |posture: &Posture| {
        placed.place(posture);
        placed.com().0
    };
    let ends = executed.postures.last().zip(plan.trajectory.postures.last());
    let apart = ends.map_or(f64::NAN, |(last, planned)| (com(last) - com(planned)).norm());
    executed.fell = executed.postures.len() < plan.time_s.len() || apart.is_nan() || apart >= FALLEN_M;
    let soles = Polygon::hull(&plan.sole);
    let margins = executed.cop.iter().skip(plan.lift_off).map(|cop| soles.margin(*cop));
    // The feet in the air have no centre of pressure.
    executed.cop_margin_m =
        margins.map(|margin| if margin.is_nan() { 0.0 } else { margin }).fold(f64::INFINITY, f64::min);
}

fn touches(setup: &Setup, placed: &Placed) -> Vec<Touch> {
    let feet = setup.soles().map(|at| Touch { at, height: 0.0, spring: GROUND, is_foot: true, anchor: None });
    let height = setup.seat.iter().map(|at| placed.point(at).z).fold(f64::INFINITY, f64::min);
    let seat = setup.seat.iter().map(|at| Touch { at: *at, height, spring: CHAIR, is_foot: false, anchor: None });
    feet.chain(seat).collect()
}

/// The force on a point.
fn push(touch: &mut Touch, placed: &Placed, velocity: &DVector<f64>) -> Push {
    let point = placed.point(&touch.at);
    let jacobian = placed.jacobian(touch.at.joint, &Pose::at(touch.at.point)).rows(3, 3).into_owned();
    let moving: Vec3<f64> = Vec3::from_iterator((&jacobian * velocity).iter().copied());
    let jacobian = DMatrix::from_iterator(3, jacobian.ncols(), jacobian.iter().copied());
    let (stiffness, damping) = touch.spring;
    let up = stiffness * (touch.height - point.z) - damping * moving.z;
    if point.z >= touch.height || up <= 0.0 {
        touch.anchor = None;
        return Push { force: Vec3::zeros(), jacobian, stiffness: Vec3::zeros(), damping: Vec3::zeros() };
    }
    let anchor = *touch.anchor.get_or_insert(point);
    let pull = |k: usize| stiffness * (anchor[k] - point[k]) - damping * moving[k];
    let (mut force, mut stiff) = (Vec3::new(pull(0), pull(1), up), Vec3::repeat(stiffness));
    let across = force.x.hypot(force.y);
    if across > FRICTION * up {
        let share = FRICTION * up / across;
        (force.x, force.y) = (force.x * share, force.y * share);
        (stiff.x, stiff.y) = (0.0, 0.0);
        // It slides: the anchor follows so that the spring holds what friction bears.
        touch.anchor = Some(Vec3::new(point.x + force.x / stiffness, point.y + force.y / stiffness, point.z));
    }
    Push { force, jacobian, stiffness: stiff, damping: Vec3::repeat(damping) }
}

/// What the joints shall do at one time.
struct Desired {
    q: Vec<f64>,
    rate: Vec<f64>,
    torque: Vec<f64>,
}

/// The plan at a time, linear between frames.
fn desired(plan: &Mapped, torque: &[Vec<f64>], time_s: f64) -> Desired {
    let (times, postures) = (&plan.time_s, &plan.trajectory.postures);
    let last = times.len() - 1;
    let after = times.partition_point(|t| *t <= time_s).min(last);
    let before = after.saturating_sub(1);
    let span = times[after] - times[before];
    let share = if span > 0.0 { ((time_s - times[before]) / span).clamp(0.0, 1.0) } else { 0.0 };
    let between = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a + share * (b - a)).collect();
    let (a, b) = (&postures[before].q, &postures[after].q);
    let moves = (times[0]..times[last]).contains(&time_s);
    let rate = a.iter().zip(b).map(|(a, b)| if moves { (b - a) / span } else { 0.0 }).collect();
    let torque = torque.get(before).zip(torque.get(after));
    Desired { q: between(a, b), rate, torque: torque.map_or(vec![0.0; a.len()], |(a, b)| between(a, b)) }
}

/// Posture and velocity of a robot.
struct State {
    posture: Posture,
    /// Of the base, then of the joints, m/s and rad/s.
    velocity: DVector<f64>,
}

impl State {
    /// One step later; `None` when the mass matrix is singular.
    fn advanced(&self, placed: &Placed, pushes: &[Push], desired: &Desired, gains: Gains) -> Option<Self> {
        let Self { posture, velocity } = self;
        let mut matrix = placed.mass();
        let bias = placed.bias(velocity.as_slice());
        let mut load = -DVector::from_vec(bias);
        let h = STEP_S;
        for (k, q) in posture.q.iter().enumerate() {
            let row = 6 + k;
            load[row] += desired.torque[k]
                + gains.stiffness * (desired.q[k] - q - h * velocity[row])
                + gains.damping * (desired.rate[k] - velocity[row]);
            matrix[(row, row)] += h * gains.damping + h * h * gains.stiffness;
        }
        for push in pushes.iter().filter(|push| push.force.z > 0.0) {
            let moving = &push.jacobian * velocity;
            for k in 0..3 {
                let row = push.jacobian.row(k);
                load += row.transpose() * (push.force[k] - h * push.stiffness[k] * moving[k]);
                matrix += row.transpose() * row * (h * push.damping[k] + h * h * push.stiffness[k]);
            }
        }
        let change = matrix.cholesky()?.solve(&(load * h));
        let velocity = velocity + change;
        Some(Self { posture: posture.moved(&(&velocity * STEP_S)), velocity })
    }
}

impl Executed {
    fn record(&mut self, posture: &Posture, placed: &Placed, touches: &[Touch], pushes: &[Push], planned: &Posture) {
        let (mut sum, mut at, mut chair) = (0.0, [0.0; 2], 0.0);
        for (touch, push) in touches.iter().zip(pushes) {
            let point = placed.point(&touch.at);
            if touch.is_foot {
                sum += push.force.z;
                at[0] += point.x * push.force.z;
                at[1] += point.y * push.force.z;
            } else {
                chair += push.force.z;
            }
        }
        let apart = posture.q.iter().zip(&planned.q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        self.worst_joint_rad = self.worst_joint_rad.max(apart);
        self.cop.push(at.map(|at| if sum > 0.0 { at / sum } else { f64::NAN }));
        self.chair_n.push(chair);
        self.postures.push(posture.clone());
    }
}
