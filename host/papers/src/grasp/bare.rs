//! Hands from a bare URDF: fingers are the leaf links that stand on four joints.
//!
//! | of the hand | found as |
//! | --- | --- |
//! | fingers | the leaf links on four joints that turn, with limits, in the order of the file |
//! | thumb | the one with `thumb` in a name; else the one whose pad looks away from the others' in the middle posture |
//! | fingertip | a sphere about the leaf link's origin; z from the last joint to there, x to the side where that joint bends further |
//! | shapes | those of the URDF |
//!
//! A hand's file says the rest better.

use std::path::Path;

use darm_core::real::{Mat3, Vec3};
use darm_core::se::Pose;

use super::assembly::{Described, HandFile, Read, VIRTUAL_DEG, finger_at, limits};
use super::collision::Body;
use super::fault::{HandError, HandFault};
use super::hand::Hand;
use super::layout::{FINGERS, JOINTS, THUMB};
use super::train::PAPER_LAMBDAS;
use darm_robot::robot::{Robot, RobotFrame};
use darm_robot::source::{Fault, FileError};

/// Names of the fingers in their order, as contacts call them.
const NAMES: [&str; FINGERS] = ["index", "medium", "ring", "thumb"];
/// A fingertip nearer to its last joint than this is none, m.
const NEAREST_M: f64 = 1e-3;

/// What is known of the fingers.
#[derive(Clone, Debug, PartialEq)]
pub struct Fingers {
    /// Links of the fingertips, the thumb's last; none: to be found.
    pub tips: Vec<String>,
    /// Radius of the fingertips, m.
    pub tip_radius_m: f64,
}

/// Reads a hand from its URDF alone; the base is the palm.
///
/// # Errors
///
/// The URDF cannot be read; it has not the fingers that `fingers` says, of four turning joints with limits each; or it
/// has no shapes that collide, or one without volume.
pub fn read_bare_hand(path: &Path, fingers: &Fingers) -> Result<HandFile, HandError> {
    let of_file =
        |fault: HandFault| HandError { path: path.into(), place: None, fault: Fault::Content(Box::new(fault)) };
    let described = Described::read(path).map_err(|error| FileError::from(error).map(HandFault::Robot))?;
    bare_hand(described, fingers).map_err(of_file)
}

fn bare_hand(described: Described, given: &Fingers) -> Result<HandFile, HandFault> {
    let robot = &described.robot;
    let links = if given.tips.is_empty() { leaves(robot) } else { named(robot, &given.tips)? };
    let tips: Vec<RobotFrame> = links.iter().map(|link| fingertip(robot, link)).collect::<Result<_, _>>()?;
    let Ok(mut tips): Result<[RobotFrame; FINGERS], _> = tips.try_into() else {
        return Err(HandFault::Leaves {
            found: links.iter().map(|link| link.name.clone()).collect(),
            ends: ends(robot),
        });
    };
    if given.tips.is_empty() {
        let thumb = thumb(robot, &tips, given.tip_radius_m)?;
        tips[thumb..].rotate_left(1);
    }
    let (name, fingers) = (robot.name.clone(), fingers(robot, &tips, given.tip_radius_m)?);
    described.assemble(name, fingers, PAPER_LAMBDAS.to_vec())
}

fn fingers(robot: &Robot, tips: &[RobotFrame; FINGERS], radius_m: f64) -> Result<[Read; FINGERS], HandFault> {
    let finger = |(name, tip): (&str, &RobotFrame)| finger_at(robot, name, tip.clone(), VIRTUAL_DEG, radius_m);
    let read: Vec<Read> = NAMES.into_iter().zip(tips).map(finger).collect::<Result<_, _>>()?;
    let found = read.len();
    read.try_into().map_err(|_| HandFault::Fingers { found })
}

/// The leaf links on four joints of their own.
fn leaves(robot: &Robot) -> Vec<RobotFrame> {
    let ends = robot.frames.iter().filter(|frame| frame.is_end && robot.path(frame).len() == JOINTS);
    ends.cloned().collect()
}

/// Every leaf link with its joints, for a person to choose from.
fn ends(robot: &Robot) -> Vec<String> {
    let ends = robot.frames.iter().filter(|frame| frame.is_end);
    ends.map(|frame| format!("{} ({} joints)", frame.name, robot.path(frame).len())).collect()
}

fn named(robot: &Robot, tips: &[String]) -> Result<Vec<RobotFrame>, HandFault> {
    let known = || robot.frames.iter().map(|frame| frame.name.clone()).collect();
    let frame = |tip: &String| {
        robot.frame(tip).cloned().ok_or_else(|| HandFault::UnknownLink { link: tip.clone(), known: known() })
    };
    tips.iter().map(frame).collect()
}

/// The frame of a fingertip: z outwards from the last joint, x to the side where that joint bends further.
fn fingertip(robot: &Robot, link: &RobotFrame) -> Result<RobotFrame, HandFault> {
    let no_tip = || HandFault::NoTip { link: link.name.clone() };
    let joint = link.joint.and_then(|joint| robot.joints.get(joint)).ok_or_else(no_tip)?;
    let z = link.pose.position.try_normalize(NEAREST_M).ok_or_else(no_tip)?;
    let bends = joint.limits.map_or(1.0, |[low, high]| if high >= -low { 1.0 } else { -1.0 });
    let axis = joint.joint.axis.direction * bends;
    let x = axis.cross(&z).try_normalize(NEAREST_M).ok_or_else(no_tip)?;
    let rotation = Mat3::from_columns(&[x, z.cross(&x), z]);
    Ok(RobotFrame { pose: Pose { rotation, position: link.pose.position }, ..link.clone() })
}

/// Which finger is the thumb.
fn thumb(robot: &Robot, tips: &[RobotFrame; FINGERS], radius_m: f64) -> Result<usize, HandFault> {
    let says = |name: &str| name.to_lowercase().contains("thumb");
    let is_thumb = |tip: &RobotFrame| {
        says(&tip.name) || robot.path(tip).iter().any(|&k| says(&robot.joints[k].name) || says(&robot.joints[k].link))
    };
    if let Some(thumb) = tips.iter().position(is_thumb) {
        return Ok(thumb);
    }
    let read = fingers(robot, tips, radius_m)?;
    let limits = limits(&read);
    let bodies = std::array::from_fn(|_| Body::default());
    let hand = Hand::new(String::new(), read.map(|finger| finger.finger), limits, bodies).map_err(HandFault::Flat)?;
    let links = hand.place(&hand.middle()).links;
    let pads: [Vec3<f64>; FINGERS] =
        std::array::from_fn(|i| (links[JOINTS * i + JOINTS - 1] * tips[i].pose).rotation.column(0).into());
    let alike = |i: usize| pads.iter().map(|pad| pad.dot(&pads[i])).sum::<f64>();
    Ok((0..FINGERS).min_by(|a, b| alike(*a).total_cmp(&alike(*b))).unwrap_or(THUMB))
}
