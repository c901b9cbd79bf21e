//! A person's motion on a robot: the centre of mass of the person exactly, the markers as well as they can be followed.
//!
//! 1. The motion is measured from the middle between the feet, on the ground, and scaled so that the robot's highest centre of mass
//!    is a little higher than the person's highest one. (The paper's robot had a person's size: scale 1.)
//! 2. The robot sits: the posture nearest to its sitting one whose centre of mass is the person's first one.
//! 3. The markers of the first frame are overlaid on it: each keeps its place in the link that follows it from there.
//! 4. [`trajectory`](super::trajectory): centre of mass, feet, limits and until lift-off the seat hard, markers soft, smooth in
//!    time. A robot that sits has its centre of mass as high as the chair lets it: the height is followed there, and what it
//!    differs fades after lift-off.
//! 5. Where the zero-moment point comes too near to the edge of what bears the robot, the centre of mass moves by the least
//!    that brings it back (`balance`), and 4 again. The paper leaves this undone: its dynamics are not considered. A
//!    person's zero-moment point may be where the robot's cannot, for its feet and masses are others.
//! 6. The balance check of `balance`.
//!
//! An axis along which the robot's centre of mass cannot move (sideways, of a robot in the sagittal plane) is left
//! free and reported.

use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_core::tree::TreeError;
use nalgebra::SVector;

use super::balance::{Support, cart, zmp};
use super::lift_off::{LiftOffBy, lift_off};
use super::markers::Capture;
use super::person::{CORNER_HZ, Person, com};
use super::placed::{Placed, dynamic, wrench};
use super::setup::Setup;
use super::trajectory::{Chair, Foot, Problem, Trajectory, TrajectoryError, solve};
use super::{Balance, BodyPoint, Posture};
use darm_robot::robot::Robot;

/// Of the robot's highest centre of mass this share is used, so that the knees keep a bend.
const REACHED: f64 = 0.985;
/// The centre of mass can be moved along an axis when the joints move it by this at least, m/rad.
const MOVES_M: f64 = 1e-3;
/// Markers that were overlaid follow this well, m; accelerations of the robot, rad/s².
const FOLLOWS: (f64, f64) = (0.02, 3.0);
/// After lift-off the height that the chair gave the centre of mass becomes the person's within this, s.
const FADES_S: f64 = 1.0;
/// Frames over which the speed at lift-off is given.
const SLOPE: usize = 3;
/// The centre of mass is moved in this many rounds at most, and until the zero-moment point misses less than this of
/// its margin, m.
const ROUNDS: (usize, f64) = (8, 0.002);

/// A motion of a robot.
#[derive(Clone, Debug)]
pub struct Mapped {
    /// Time of each frame, s.
    pub time_s: Vec<f64>,
    /// The robot's motion.
    pub trajectory: Trajectory,
    /// By how much the person's motion was scaled.
    pub scale: f64,
    /// The person's centre of mass, scaled, m.
    pub person: Vec<Vec3<f64>>,
    /// Where the robot's shall be: there, but for what its balance needs and the chair gives, m.
    pub target: Vec<Vec3<f64>>,
    /// The largest distance between the two along the ground, which is for balance, m.
    pub moved_m: f64,
    /// The largest distance in height, which is the chair's, m.
    pub raised_m: f64,
    /// Where it is with the robot's masses, m.
    pub com: Vec<Vec3<f64>>,
    /// Axes along which it is fixed.
    pub axes: [bool; 3],
    /// The largest distance between the two along these axes, m.
    pub com_error_m: f64,
    /// The markers on the robot, and which of the capture they are.
    pub markers: Vec<(usize, BodyPoint)>,
    /// The first frame off the chair, from 0.
    pub lift_off: usize,
    /// What it was read from.
    pub lift_off_by: LiftOffBy,
    /// The balance check.
    pub balance: Balance,
    /// Corners of the feet on the ground, m.
    pub sole: Vec<[f64; 2]>,
    /// Corners of what sits on the chair, m.
    pub chair: Vec<[f64; 2]>,
}

/// Maps the motion of a person on a robot.
///
/// # Errors
///
/// The joints of `robot` make no tree, or a frame has no posture that holds the constraints within the limits.
pub fn map(robot: &Robot, setup: &Setup, person: &Person, capture: &Capture) -> Result<Mapped, TrajectoryError> {
    let feet = feet(robot, setup)?;
    let view = View::new(robot, setup, person, &feet)?;
    let com: Vec<Vec3<f64>> = person.com.iter().map(|com| view.at(com)).collect();
    let standing = OnFeet { robot, feet: &feet, step_s: capture.step_s() };
    let axes = standing.axes(&setup.sitting)?;
    let sitting = standing.near(&standing.posture(&setup.sitting), &com[..1], axes)?;
    let markers = view.markers_on(robot, setup, person, capture, &sitting)?;
    let targets: Vec<Vec<Option<Vec3<f64>>>> = capture
        .places
        .iter()
        .map(|places| markers.iter().map(|(k, _)| places[*k].map(|place| view.at(&place))).collect())
        .collect();
    let (off_at, lift_off_by) = lift_off(capture, &person.motion.postures, view.scale);
    let ground = Ground::new(robot, setup, &sitting, (off_at, capture.step_s()))?;
    let on_robot: Vec<BodyPoint> = markers.iter().map(|(_, marker)| *marker).collect();
    let follow = Follow { standing: &standing, markers: &on_robot, targets: &targets, ground: &ground, axes };
    let mut target = com.clone();
    let mut plan = follow.walk(&mut target, sitting)?;
    for _ in 0..ROUNDS.0 {
        let pulls = ground.support.pulls(&zero_moment(robot, &plan.postures, &capture.time_s), [axes[0], axes[1]]);
        if pulls.iter().flatten().all(|pull| pull.abs() < ROUNDS.1) {
            break;
        }
        shift(&mut target, &pulls, capture.step_s(), robot.gravity.norm());
        plan = follow.solve_all(&target, &plan.postures)?;
    }
    let followed = Followed { scale: view.scale, axes, person: com, target, markers, trajectory: plan, lift_off_by };
    followed.mapped(robot, capture, ground)
}

/// Moves the centre of mass so that the zero-moment point is pulled so far.
fn shift(com: &mut [Vec3<f64>], pulls: &[[f64; 2]], step_s: f64, gravity: f64) {
    let height = com.iter().map(|com| com.z).sum::<f64>() / com.len().max(1) as f64;
    for axis in 0..2 {
        let pull: Vec<f64> = pulls.iter().map(|pull| pull[axis]).collect();
        let moved = cart(&pull, step_s, height / gravity).into_iter().flatten();
        com.iter_mut().zip(moved).for_each(|(com, moved)| com[axis] += moved);
    }
}

/// What the ground has to exert on each body of a robot that moves so, frame by frame: moment first, about the world's
/// origin.
pub(super) fn ground_wrench(robot: &Robot, postures: &[Posture], time_s: &[f64]) -> Vec<Vec<SVector<f64, 6>>> {
    wrench(robot, &dynamic(postures, time_s, CORNER_HZ, &robot.gravity))
}

/// Zero-moment point of each frame, m.
fn zero_moment(robot: &Robot, postures: &[Posture], time_s: &[f64]) -> Vec<[f64; 2]> {
    ground_wrench(robot, postures, time_s).iter().map(|bodies| zmp(&bodies.iter().sum())).collect()
}

/// Feet and chair.
struct Ground {
    sole: Vec<[f64; 2]>,
    chair: Vec<[f64; 2]>,
    support: Support,
    seat: Vec<BodyPoint>,
    /// Where the middle of the seat is, m.
    middle: Vec3<f64>,
    lift_off: usize,
}

impl Ground {
    fn new(
        robot: &Robot,
        setup: &Setup,
        sitting: &Posture,
        (lift_off, step_s): (usize, f64),
    ) -> Result<Self, TreeError> {
        let mut placed = Placed::new(robot)?;
        placed.place(sitting);
        let flat = |point: Vec3<f64>| [point.x, point.y];
        let sole: Vec<[f64; 2]> = setup.soles().map(|sole| flat(placed.point(&sole))).collect();
        let seat: Vec<Vec3<f64>> = setup.seat.iter().map(|at| placed.point(at)).collect();
        let chair: Vec<[f64; 2]> = seat.iter().copied().map(flat).collect();
        let middle = seat.iter().sum::<Vec3<f64>>() / seat.len().max(1) as f64;
        let support = Support::new(&sole, &chair, lift_off, step_s);
        Ok(Self { sole, chair, support, seat: setup.seat.clone(), middle, lift_off })
    }
}

/// What the robot follows while it is on its feet.
struct Follow<'a> {
    standing: &'a OnFeet<'a>,
    markers: &'a [BodyPoint],
    targets: &'a [Vec<Option<Vec3<f64>>>],
    ground: &'a Ground,
    axes: [bool; 3],
}

impl Follow<'_> {
    fn problem<'b>(&'b self, com: &'b [Vec3<f64>], frames: std::ops::Range<usize>) -> Problem<'b> {
        let sits = self.ground.lift_off.saturating_sub(frames.start);
        Problem {
            markers: self.markers,
            targets: &self.targets[frames.clone()],
            com: Some((&com[frames], self.axes)),
            chair: Some(Chair { seat: &self.ground.seat, at: self.ground.middle, frames: sits }),
            ..self.standing.problem()
        }
    }

    /// The trajectory with the centre of mass there, first frame by frame: what the chair did to its height fades from lift-off.
    fn walk(&self, com: &mut [Vec3<f64>], sitting: Posture) -> Result<Trajectory, TrajectoryError> {
        let mut postures = vec![sitting];
        for frame in 1..com.len() {
            if frame == self.ground.lift_off && frame > SLOPE && self.axes[2] && !self.ground.seat.is_empty() {
                let above = self.above(com, &postures[..frame])?;
                com[frame..].iter_mut().zip(above).for_each(|(com, above)| com.z += above);
            }
            let one = solve(&self.problem(com, frame..frame + 1), &postures[frame - 1..]);
            postures.extend(one.map_err(|error| at_frame(error, frame))?.postures);
        }
        self.solve_all(com, &postures)
    }

    /// How far the centre of mass shall be above the person's from lift-off on, m: as on the chair at first, in place and speed.
    fn above(&self, com: &[Vec3<f64>], seated: &[Posture]) -> Result<impl Iterator<Item = f64> + use<>, TreeError> {
        let mut placed = Placed::new(self.standing.robot)?;
        let [last, before] = [1, 1 + SLOPE].map(|back| {
            placed.place(&seated[seated.len() - back]);
            placed.com().0.z - com[seated.len() - back].z
        });
        let (step, speed) = (self.standing.step_s / FADES_S, (last - before) / SLOPE as f64 / self.standing.step_s);
        Ok((1..).map(move |k| {
            let s = (f64::from(k) * step).min(1.0);
            let left = (1.0 - s).powi(3);
            left * (last * (1.0 + 3.0 * s + 6.0 * s * s) + speed * FADES_S * s * (1.0 + 3.0 * s))
        }))
    }

    /// The same near a trajectory that there is.
    fn solve_all(&self, com: &[Vec3<f64>], start: &[Posture]) -> Result<Trajectory, TrajectoryError> {
        solve(&self.problem(com, 0..com.len()), start)
    }
}

/// An error of a problem of one frame, given with the frame's own number.
fn at_frame(error: TrajectoryError, frame: usize) -> TrajectoryError {
    match error {
        TrajectoryError::OutOfReach { what, off_mm, .. } => {
            TrajectoryError::OutOfReach { frame: frame + 1, what, off_mm }
        }
        other => other,
    }
}

/// A trajectory, and what it follows; the fields are those of [`Mapped`].
struct Followed {
    scale: f64,
    axes: [bool; 3],
    person: Vec<Vec3<f64>>,
    target: Vec<Vec3<f64>>,
    markers: Vec<(usize, BodyPoint)>,
    trajectory: Trajectory,
    lift_off_by: LiftOffBy,
}

impl Followed {
    fn mapped(self, robot: &Robot, capture: &Capture, ground: Ground) -> Result<Mapped, TrajectoryError> {
        let Self { scale, axes, person, mut target, markers, trajectory, lift_off_by } = self;
        let mut placed = Placed::new(robot)?;
        let mut own = Vec::new();
        for posture in &trajectory.postures {
            placed.place(posture);
            own.push(placed.com().0);
        }
        let sits = if ground.seat.is_empty() { 0 } else { ground.lift_off };
        target.iter_mut().zip(&own).take(sits).for_each(|(target, own)| target.z = own.z);
        let apart = |a: &[Vec3<f64>], of: std::ops::Range<usize>| {
            let own = |(a, b): (&Vec3<f64>, &Vec3<f64>)| -> f64 {
                of.clone().filter(|&k| axes[k]).map(|k| (a[k] - b[k]).powi(2)).sum()
            };
            a.iter().zip(&target).map(own).fold(0.0, f64::max).sqrt()
        };
        let (com_error_m, moved_m, raised_m) = (apart(&own, 0..3), apart(&person, 0..2), apart(&person, 2..3));
        let smooth = com(robot, &trajectory.postures, &capture.time_s)?;
        Ok(Mapped {
            balance: ground.support.balance(zero_moment(robot, &trajectory.postures, &capture.time_s), &smooth),
            time_s: capture.time_s.clone(),
            trajectory,
            scale,
            person,
            target,
            moved_m,
            raised_m,
            com: own,
            axes,
            com_error_m,
            markers,
            lift_off: ground.lift_off,
            lift_off_by,
            sole: ground.sole,
            chair: ground.chair,
        })
    }
}

/// Feet on the ground, each where the robot's zero posture has it and turned as there, with its sole at z = 0.
fn feet(robot: &Robot, setup: &Setup) -> Result<Vec<Foot>, TreeError> {
    let mut placed = Placed::new(robot)?;
    placed.place(&Posture { base: Pose::identity(), q: vec![0.0; robot.joints.len()] });
    let foot = |(joint, points): &(Option<usize>, Vec<Vec3<f64>>)| {
        let mut placed_foot = placed.pose(*joint, &Pose::identity());
        let sole = points.iter().map(|point| (placed_foot * *point).z).fold(f64::INFINITY, f64::min);
        placed_foot.position.z -= sole;
        Foot { joint: *joint, pose: Pose::identity(), placed: placed_foot }
    };
    Ok(setup.feet.iter().map(foot).collect())
}

/// A robot on its feet.
struct OnFeet<'a> {
    robot: &'a Robot,
    feet: &'a [Foot],
    step_s: f64,
}

impl OnFeet<'_> {
    fn problem(&self) -> Problem<'_> {
        Problem {
            robot: self.robot,
            step_s: self.step_s,
            markers: &[],
            targets: &[],
            feet: self.feet,
            chair: None,
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
        let mut fixed = nalgebra::DMatrix::zeros(6 * rows.len(), of_com.ncols());
        rows.iter().enumerate().for_each(|(k, block)| fixed.rows_mut(6 * k, 6).copy_from(block));
        let eigen = fixed.tr_mul(&fixed).symmetric_eigen();
        let free: Vec<usize> = (0..of_com.ncols()).filter(|&k| eigen.eigenvalues[k] < 1e-9).collect();
        let moved = of_com * eigen.eigenvectors.select_columns(&free);
        Ok(std::array::from_fn(|k| moved.row(k).norm() > MOVES_M))
    }
}

/// How a place of the person is mapped to the robot.
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
        let to = on_ground(feet.iter().map(|foot| foot.placed.position).sum(), feet.len());
        let mut upright = Placed::new(robot)?;
        let q: Vec<f64> = robot.joints.iter().map(|j| j.limits.map_or(0.0, |[l, h]| 0.0f64.clamp(l, h))).collect();
        upright.place(&Posture { base: Pose::identity(), q });
        let foot =
            feet.first().map_or(0.0, |foot| foot.placed.position.z - upright.pose(foot.joint, &foot.pose).position.z);
        let highest = person.com.iter().map(|com| com.z).fold(f64::NEG_INFINITY, f64::max);
        Ok(Self { from, to, scale: REACHED * (upright.com().0.z + foot) / highest })
    }

    fn at(&self, place: &Vec3<f64>) -> Vec3<f64> {
        self.to + (place - self.from) * self.scale
    }

    /// The markers of the first frame in the links that follow them; where one is not seen, where the person's tree has it.
    fn markers_on(
        &self,
        robot: &Robot,
        setup: &Setup,
        person: &Person,
        capture: &Capture,
        sitting: &Posture,
    ) -> Result<Vec<(usize, BodyPoint)>, TreeError> {
        let (mut own, mut placed) = (Placed::new(robot)?, Placed::new(&person.tree)?);
        own.place(sitting);
        placed.place(&person.motion.postures[0]);
        let on = |(k, marker): (usize, &super::setup::Marker)| {
            let joint = marker.follower?;
            let place = capture.places[0][k].unwrap_or_else(|| placed.point(&person.markers[k]));
            let point = own.pose(joint, &Pose::identity()).inverse() * self.at(&place);
            Some((k, BodyPoint { joint, point }))
        };
        Ok(setup.markers.iter().enumerate().filter_map(on).collect())
    }
}
