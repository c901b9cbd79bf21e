//! A person's motion on a robot: the centre of mass of the person exactly, the markers as well as they can be followed.
//!
//! 1. The motion is told from the middle between the feet, on the ground, and scaled so that the robot's highest centre of mass
//!    is a little higher than the person's highest one. (The paper's robot had a person's size: scale 1.)
//! 2. The robot sits: the posture nearest to its sitting one whose centre of mass is the person's first one.
//! 3. The markers of the first frame are overlaid on it: each keeps its place in the link that follows it from there.
//! 4. [`trajectory`](super::trajectory): centre of mass, feet and limits hard, markers soft, smooth in time.
//! 5. The balance check of `balance`.
//!
//! An axis along which the robot's centre of mass cannot move (sideways, of a robot in the sagittal plane) is left free and told.

use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_core::tree::TreeError;

use super::balance::balance;
use super::markers::Capture;
use super::person::{CORNER_HZ, Person, com};
use super::placed::{Placed, dynamic, wrench};
use super::setup::Setup;
use super::trajectory::{Foot, Problem, Trajectory, TrajectoryError, solve};
use super::{Balance, Fixed, Posture};
use crate::robot::Robot;

/// Of the robot's highest centre of mass this share is used, so that the knees keep a bend.
const REACHED: f64 = 0.985;
/// The centre of mass can be moved along an axis when the joints move it by this at least, m/rad.
const MOVES_M: f64 = 1e-3;
/// Markers that were overlaid follow this well, m; accelerations of the robot, rad/s².
const FOLLOWS: (f64, f64) = (0.02, 10.0);
/// The person has left the chair when the middle link is this much higher than in the first frame, m.
const LIFTED_M: f64 = 0.015;

/// A motion of a robot.
#[derive(Clone, Debug)]
pub struct Mapped {
    /// Time of each frame, s.
    pub time_s: Vec<f64>,
    /// The robot's motion.
    pub trajectory: Trajectory,
    /// By how much the person's motion was scaled.
    pub scale: f64,
    /// Where the centre of mass shall be: the person's, scaled, m.
    pub target: Vec<Vec3<f64>>,
    /// Where it is with the robot's masses, m.
    pub com: Vec<Vec3<f64>>,
    /// Axes along which it is held.
    pub axes: [bool; 3],
    /// The largest distance between the two along these axes, m.
    pub com_error_m: f64,
    /// The markers on the robot, and which of the capture they are.
    pub markers: Vec<(usize, Fixed)>,
    /// The first frame off the chair, from 0.
    pub lift_off: usize,
    /// The balance check.
    pub balance: Balance,
    /// Corners of the feet on the ground, m.
    pub sole: Vec<[f64; 2]>,
    /// Corners of what sits on the chair, m.
    pub chair: Vec<[f64; 2]>,
}

/// Maps the motion of a person on a robot.
pub fn map(robot: &Robot, setup: &Setup, person: &Person, capture: &Capture) -> Result<Mapped, TrajectoryError> {
    let feet = feet(robot, setup)?;
    let view = View::new(robot, setup, person, &feet)?;
    let target: Vec<Vec3<f64>> = person.com.iter().map(|com| view.at(com)).collect();
    let standing = Stand { robot, feet: &feet, step_s: capture.step_s() };
    let axes = standing.axes(&setup.sitting)?;
    let sitting = standing.near(&standing.posture(&setup.sitting), &target[..1], axes)?;
    let markers = overlaid(robot, setup, &view, (person, capture), &sitting)?;
    let targets: Vec<Vec<Option<Vec3<f64>>>> = capture
        .places
        .iter()
        .map(|places| markers.iter().map(|(k, _)| places[*k].map(|place| view.at(&place))).collect())
        .collect();
    let on_robot: Vec<Fixed> = markers.iter().map(|(_, marker)| *marker).collect();
    let problem = |frames: std::ops::Range<usize>| Problem {
        markers: &on_robot,
        targets: &targets[frames.clone()],
        com: Some((&target[frames], axes)),
        ..standing.problem()
    };
    let mut postures = vec![sitting];
    for frame in 1..targets.len() {
        let one = solve(&problem(frame..frame + 1), &postures[frame - 1..]).map_err(|error| at_frame(error, frame))?;
        postures.extend(one.postures);
    }
    let trajectory = solve(&problem(0..targets.len()), &postures)?;
    told(robot, setup, person, (capture, view.scale, axes), (target, markers, trajectory))
}

/// An error of a problem of one frame, told with the frame's own number.
fn at_frame(error: TrajectoryError, frame: usize) -> TrajectoryError {
    match error {
        TrajectoryError::OutOfReach { off_mm, .. } => TrajectoryError::OutOfReach { frame: frame + 1, off_mm },
        other => other,
    }
}

type Follows = (Vec<Vec3<f64>>, Vec<(usize, Fixed)>, Trajectory);

fn told(
    robot: &Robot,
    setup: &Setup,
    person: &Person,
    (capture, scale, axes): (&Capture, f64, [bool; 3]),
    (target, markers, trajectory): Follows,
) -> Result<Mapped, TrajectoryError> {
    let mut placed = Placed::new(robot)?;
    let mut own = Vec::new();
    for posture in &trajectory.postures {
        placed.place(posture);
        own.push(placed.com().0);
    }
    let off =
        |(a, b): (&Vec3<f64>, &Vec3<f64>)| (0..3).filter(|&k| axes[k]).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>();
    let com_error_m = own.iter().zip(&target).map(off).fold(0.0, f64::max).sqrt();
    let lift_off = lift_off(&person.motion.postures, scale);
    let (sole, chair) = supports(robot, setup, &trajectory.postures[0])?;
    let moving = dynamic(&trajectory.postures, &capture.time_s, CORNER_HZ, &robot.gravity);
    let ground: Vec<_> = wrench(robot, &moving).into_iter().map(|bodies| bodies.into_iter().sum()).collect();
    let smooth = com(robot, &trajectory.postures, &capture.time_s)?;
    Ok(Mapped {
        balance: balance(&ground, &smooth, (&sole, &chair), lift_off),
        time_s: capture.time_s.clone(),
        trajectory,
        scale,
        target,
        com: own,
        axes,
        com_error_m,
        markers,
        lift_off,
        sole,
        chair,
    })
}

/// The first frame in which the base is off the chair; the last frame when it never is.
fn lift_off(postures: &[Posture], scale: f64) -> usize {
    let height = |posture: &Posture| scale * posture.base.position.z;
    let first = postures.first().map_or(0.0, height);
    postures.iter().position(|posture| height(posture) > first + LIFTED_M).unwrap_or(postures.len())
}

/// Corners on the ground, x and y, m.
type Corners = Vec<[f64; 2]>;

/// The soles on the ground, and the seat in the first posture.
fn supports(robot: &Robot, setup: &Setup, first: &Posture) -> Result<(Corners, Corners), TreeError> {
    let mut placed = Placed::new(robot)?;
    placed.place(first);
    let flat = |fixed: &Fixed| {
        let point = placed.point(fixed);
        [point.x, point.y]
    };
    let soles =
        setup.feet.iter().flat_map(|(joint, points)| points.iter().map(|&point| Fixed { joint: *joint, point }));
    Ok((soles.map(|sole| flat(&sole)).collect(), setup.seat.iter().map(flat).collect()))
}

/// Feet flat on the ground, each where the robot's zero posture has it, with its sole at z = 0.
fn feet(robot: &Robot, setup: &Setup) -> Result<Vec<Foot>, TreeError> {
    let mut placed = Placed::new(robot)?;
    placed.place(&Posture { base: Pose::identity(), q: vec![0.0; robot.joints.len()] });
    let foot = |(joint, points): &(Option<usize>, Vec<Vec3<f64>>)| {
        let at = placed.pose(*joint, &Pose::identity()).position;
        let sole = points.iter().map(|point| point.z).fold(f64::INFINITY, f64::min);
        Foot { joint: *joint, pose: Pose::identity(), stands: Pose::at(Vec3::new(at.x, at.y, -sole)) }
    };
    Ok(setup.feet.iter().map(foot).collect())
}

/// A robot on its feet.
struct Stand<'a> {
    robot: &'a Robot,
    feet: &'a [Foot],
    step_s: f64,
}

impl Stand<'_> {
    fn problem(&self) -> Problem<'_> {
        Problem {
            robot: self.robot,
            step_s: self.step_s,
            markers: &[],
            targets: &[],
            feet: self.feet,
            com: None,
            marker_m: FOLLOWS.0,
            acceleration: FOLLOWS.1,
        }
    }

    fn posture(&self, q: &[f64]) -> Posture {
        Posture { base: Pose::identity(), q: q.to_vec() }
    }

    /// The posture near this one with the centre of mass there.
    fn near(&self, start: &Posture, com: &[Vec3<f64>], axes: [bool; 3]) -> Result<Posture, TrajectoryError> {
        let problem = Problem { targets: &[Vec::new()], com: Some((com, axes)), ..self.problem() };
        Ok(solve(&problem, std::slice::from_ref(start))?.postures[0].clone())
    }

    /// Axes along which the joints move the centre of mass while the feet stand.
    fn axes(&self, q: &[f64]) -> Result<[bool; 3], TrajectoryError> {
        let problem = Problem { targets: &[Vec::new()], ..self.problem() };
        let posture = solve(&problem, &[self.posture(q)])?.postures[0].clone();
        let mut placed = Placed::new(self.robot)?;
        placed.place(&posture);
        let (_, of_com) = placed.com();
        let rows: Vec<_> = self.feet.iter().map(|foot| placed.jacobian(foot.joint, &foot.pose)).collect();
        let mut held = nalgebra::DMatrix::zeros(6 * rows.len(), of_com.ncols());
        rows.iter().enumerate().for_each(|(k, block)| held.rows_mut(6 * k, 6).copy_from(block));
        let eigen = held.tr_mul(&held).symmetric_eigen();
        let free: Vec<usize> = (0..of_com.ncols()).filter(|&k| eigen.eigenvalues[k] < 1e-9).collect();
        let moved = of_com * eigen.eigenvectors.select_columns(&free);
        Ok(std::array::from_fn(|k| moved.row(k).norm() > MOVES_M))
    }
}

/// How a place of the person is told for the robot.
struct View {
    from: Vec3<f64>,
    to: Vec3<f64>,
    scale: f64,
}

impl View {
    fn new(robot: &Robot, setup: &Setup, person: &Person, feet: &[Foot]) -> Result<Self, TreeError> {
        let mut placed = Placed::new(&person.tree)?;
        placed.place(&person.motion.postures[0]);
        let on_ground = |sum: Vec3<f64>, count: usize| Vec3::new(sum.x, sum.y, 0.0) / count.max(1) as f64;
        let ankles = setup.person_feet.iter().map(|&joint| placed.pose(joint, &Pose::identity()).position);
        let from = on_ground(ankles.sum(), setup.person_feet.len());
        let to = on_ground(feet.iter().map(|foot| foot.stands.position).sum(), feet.len());
        let mut upright = Placed::new(robot)?;
        let q: Vec<f64> = robot.joints.iter().map(|j| j.limits.map_or(0.0, |[l, h]| 0.0f64.clamp(l, h))).collect();
        upright.place(&Posture { base: Pose::identity(), q });
        let foot =
            feet.first().map_or(0.0, |foot| foot.stands.position.z - upright.pose(foot.joint, &foot.pose).position.z);
        let highest = person.com.iter().map(|com| com.z).fold(f64::NEG_INFINITY, f64::max);
        Ok(Self { from, to, scale: REACHED * (upright.com().0.z + foot) / highest })
    }

    fn at(&self, place: &Vec3<f64>) -> Vec3<f64> {
        self.to + (place - self.from) * self.scale
    }
}

/// The markers of the first frame in the links that follow them; where one is not seen, where the person's tree has it.
fn overlaid(
    robot: &Robot,
    setup: &Setup,
    view: &View,
    (person, capture): (&Person, &Capture),
    sitting: &Posture,
) -> Result<Vec<(usize, Fixed)>, TreeError> {
    let (mut own, mut placed) = (Placed::new(robot)?, Placed::new(&person.tree)?);
    own.place(sitting);
    placed.place(&person.motion.postures[0]);
    let on = |(k, marker): (usize, &super::setup::Marker)| {
        let joint = marker.follower?;
        let place = capture.places[0][k].unwrap_or_else(|| placed.point(&person.markers[k]));
        let point = own.pose(joint, &Pose::identity()).inverse() * view.at(&place);
        Some((k, Fixed { joint, point }))
    };
    Ok(setup.markers.iter().enumerate().filter_map(on).collect())
}
