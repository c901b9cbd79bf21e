//! A simulated person who rises from a chair: where the truth is known, and where nobody has recorded one.
//!
//! The tree is that of `person.urdf` (links with x forward, y up, z to the right), with lengths and masses drawn about the
//! average, markers that are not quite where they should be, and noise. The motion is made of absolute angles of shank, thigh,
//! pelvis and trunk with the feet flat on the ground, shanks and thighs at rest until the chair is left; the plates under feet
//! and chair together measure what inverse dynamics computes. The chair bears what feet that press about their middle do not,
//! and a small share of the weight at least; its cushion follows the hips for a few millimetres as the thighs begin to turn. The elderly style bends deeper and longer before it
//! lifts off, as Papa and Cappozzo (J. Biomechanics 33, 2000, 1113) describe, and sways back at the end.

use darm_core::real::{Mat3, Vec3};
use darm_core::se::{Pose, rotation_exp};
use darm_core::tree::TreeError;
use rand::{Rng, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use serde::Serialize;

use super::Posture;
use super::markers::{Capture, Plate};
use super::person::{CORNER_HZ, Groups};
use super::placed::{Placed, dynamic, wrench};
use super::setup::Setup;
use darm_robot::robot::Robot;

/// Frames a second.
const RATE_HZ: f64 = 50.0;
/// Standard deviations of what is drawn: lengths, masses (shares), places of markers and their noise (m), plates (N m, N).
const LENGTHS: f64 = 0.05;
const MASSES: f64 = 0.2;
const MISPLACED_M: f64 = 0.006;
const MARKER_NOISE_M: f64 = 0.001;
const PLATE_NOISE: [f64; 2] = [2.0, 2.0];
/// The middle of the soles ahead of the ankles, m, and the smallest and largest share of the weight on a chair.
const MIDFOOT_M: f64 = 0.06;
const CHAIR_SHARE: [f64; 2] = [0.08, 0.95];
/// The chair is left when the hips are this much higher than at first, m.
const CUSHION_M: f64 = 0.005;
/// Height of the ankle joint of the average person, m.
const ANKLE_M: f64 = 0.08;

/// How a person rises from a chair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Style {
    /// As a healthy person does.
    Natural,
    /// As an actor imitates an elderly person.
    Elderly,
}

/// A motion, and the truth behind it.
#[derive(Clone, Debug)]
pub struct Demonstration {
    /// What cameras and plates saw.
    pub capture: Capture,
    /// The person's tree, which nobody but the one who draws it knows.
    pub tree: Robot,
    /// The person's true centre of mass, m.
    pub com: Vec<Vec3<f64>>,
    /// What the chair exerts, frame by frame: Fz (N), Mx and My (N·m, about the world's origin), without noise.
    pub chair: Vec<[f64; 3]>,
}

/// An angle that goes from one value to another between two times, rad, s.
struct Turn {
    from: f64,
    to: f64,
    between: [f64; 2],
}

/// Absolute angles about the axis to the right, rad: positive brings what is below forward.
struct Angles {
    shank: f64,
    thigh: f64,
    pelvis: f64,
    trunk: f64,
}

impl Style {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Natural => "natural",
            Self::Elderly => "elderly",
        }
    }

    /// How long it takes, s.
    fn lasts_s(self) -> f64 {
        match self {
            Self::Natural => 3.4,
            Self::Elderly => 5.2,
        }
    }

    /// Shank, thigh, pelvis and trunk: each a sum of turns.
    fn angles(self, time_s: f64) -> Angles {
        let turns = match self {
            Self::Natural => [
                vec![turn(-26.0, -32.0, 1.25, 1.8), turn(0.0, 31.0, 1.6, 2.7)],
                vec![turn(88.0, 1.0, 1.25, 2.7)],
                vec![turn(-2.0, -40.0, 0.3, 1.4), turn(0.0, 38.5, 1.5, 2.8)],
                vec![turn(-4.0, -50.0, 0.3, 1.4), turn(0.0, 48.0, 1.5, 2.8)],
            ],
            Self::Elderly => [
                vec![turn(-26.0, -34.0, 2.0, 2.8), turn(0.0, 32.0, 2.4, 3.9), turn(0.0, 1.0, 3.9, 4.6)],
                vec![turn(88.0, 4.0, 2.0, 4.1)],
                vec![turn(-2.0, -44.0, 0.3, 2.0), turn(0.0, 39.0, 2.4, 4.4)],
                vec![turn(-6.0, -62.0, 0.3, 2.0), turn(0.0, 54.0, 2.4, 4.5)],
            ],
        };
        let [shank, thigh, pelvis, trunk] = turns.map(|turns| turns.iter().map(|turn| turn.at(time_s)).sum::<f64>());
        Angles { shank, thigh, pelvis, trunk }
    }
}

fn turn(from_deg: f64, to_deg: f64, start_s: f64, end_s: f64) -> Turn {
    Turn { from: from_deg.to_radians(), to: to_deg.to_radians(), between: [start_s, end_s] }
}

impl Turn {
    /// Along the path of least jerk.
    fn at(&self, time_s: f64) -> f64 {
        let [start, end] = self.between;
        let s = ((time_s - start) / (end - start)).clamp(0.0, 1.0);
        self.from + (self.to - self.from) * s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s)
    }
}

/// Draws a person from the seed, with the markers and feet of the set-up, and lets it stand up.
///
/// # Errors
///
/// The joints of `tree` make no tree that can be computed.
pub fn demonstrate(tree: &Robot, setup: &Setup, style: Style, seed: u64) -> Result<Demonstration, TreeError> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let groups = Groups::new(tree);
    let lengths = groups.drawn(&mut random, LENGTHS);
    let masses = groups.drawn(&mut random, MASSES);
    let own = groups.scaled(tree, &lengths, &masses);
    let mut worn = groups.markers(&setup.on_person(), &lengths);
    for marker in &mut worn {
        marker.point += three(&mut random, MISPLACED_M);
    }
    let frames = (style.lasts_s() * RATE_HZ) as usize + 1;
    let time_s: Vec<f64> = (0..frames).map(|k| k as f64 / RATE_HZ).collect();
    let mut placed = Placed::new(&own)?;
    let postures: Vec<Posture> =
        time_s.iter().map(|&t| stood(&mut placed, &own, &setup.person_feet, &style.angles(t))).collect();
    let (mut places, mut com) = (Vec::new(), Vec::new());
    for posture in &postures {
        placed.place(posture);
        com.push(placed.com().0);
        places.push(worn.iter().map(|m| Some(placed.point(m) + three(&mut random, MARKER_NOISE_M))).collect());
    }
    let motion = dynamic(&postures, &time_s, 2.0 * CORNER_HZ, &own.gravity);
    let totals: Vec<nalgebra::SVector<f64, 6>> =
        wrench(&own, &motion).into_iter().map(|bodies| bodies.into_iter().sum()).collect();
    let hips: Vec<Vec3<f64>> = postures.iter().map(|posture| hip(&mut placed, &own, posture)).collect();
    let chair: Vec<[f64; 3]> =
        totals.iter().zip(&hips).map(|(total, hip)| on_chair(total, hip.x, hip.z - hips[0].z)).collect();
    let [moment, force] = PLATE_NOISE;
    let plates = totals.iter().map(|total| {
        let mut any = |size: f64| size * random.sample::<f64, _>(StandardNormal);
        let (fz, mx, my) = (total[5] + any(force), total[0] + any(moment), total[1] + any(moment));
        Plate { cop: [-my / fz, mx / fz], force_n: fz }
    });
    let plates = plates.collect();
    let measured = chair.iter().map(|[fz, ..]| fz + force * random.sample::<f64, _>(StandardNormal));
    let chair_n = Some(measured.collect());
    let (names, findings) = (setup.marker_names(), Vec::new());
    let capture = Capture { names, time_s, places, plates, chair_n, hands_n: None, findings };
    Ok(Demonstration { capture, tree: own, com, chair })
}

/// The middle between the hip joints; the base where there is none.
fn hip(placed: &mut Placed, tree: &Robot, posture: &Posture) -> Vec3<f64> {
    placed.place(posture);
    let hips = || tree.joints.iter().enumerate().filter(|(_, joint)| joint.name.ends_with("hip_Z"));
    let sum: Vec3<f64> = hips().map(|(k, _)| placed.pose(Some(k), &Pose::identity()).position).sum();
    match hips().count() {
        0 => posture.base.position,
        count => sum / count as f64,
    }
}

/// What the chair bears of a wrench, straight up at `seat` ahead of the ankles (m), so that the feet press about their middle;
/// less as the hips rise (m), and nothing when they have left the cushion.
fn on_chair(total: &nalgebra::SVector<f64, 6>, seat: f64, risen: f64) -> [f64; 3] {
    let pressed = -total[1] / total[5];
    let share = ((MIDFOOT_M - pressed) / (MIDFOOT_M - seat)).clamp(CHAIR_SHARE[0], CHAIR_SHARE[1]);
    let force = share * total[5] * (1.0 - risen / CUSHION_M).clamp(0.0, 1.0);
    [force, 0.0, -seat * force]
}

impl Demonstration {
    /// The first frame in which the chair bears nothing to the end.
    pub fn lift_off(&self) -> usize {
        self.chair.iter().rposition(|[force, ..]| *force > 0.0).map_or(0, |last| last + 1)
    }
}

fn three(random: &mut impl Rng, size: f64) -> Vec3<f64> {
    Vec3::from_fn(|_, _| size * random.sample::<f64, _>(StandardNormal))
}

/// The posture of these angles with the ankles over the origin of the ground.
fn stood(placed: &mut Placed, tree: &Robot, feet: &[Option<usize>], angles: &Angles) -> Posture {
    let within = |joint: &darm_robot::robot::RobotJoint| {
        let angle = angles.of_joint(&joint.name);
        joint.limits.map_or(angle, |[low, high]| angle.clamp(low, high))
    };
    // The pelvis has x forward and y up; the world z up.
    let upright = Mat3::new(1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0);
    let rotation = upright * rotation_exp(&Vec3::new(0.0, 0.0, angles.pelvis));
    let mut posture =
        Posture { base: Pose { rotation, position: Vec3::zeros() }, q: tree.joints.iter().map(within).collect() };
    placed.place(&posture);
    let ankles: Vec3<f64> = feet.iter().map(|&foot| placed.pose(foot, &Pose::identity()).position).sum();
    posture.base.position = Vec3::new(0.0, 0.0, ANKLE_M) - ankles / feet.len().max(1) as f64;
    posture
}

impl Angles {
    /// The angle of the joint with this name, rad.
    fn of_joint(&self, name: &str) -> f64 {
        match name.split_once('_').map_or(name, |(_, joint)| joint) {
            "hip_Z" => self.thigh - self.pelvis,
            "knee" => self.thigh - self.shank,
            "ankle_Z" => -self.shank,
            "lumbar_Z" | "thoracic_Z" => 0.5 * (self.trunk - self.pelvis),
            "cervical_Z" => -0.5 * self.trunk,
            _ => 0.0,
        }
    }
}
