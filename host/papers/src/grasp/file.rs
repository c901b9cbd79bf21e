//! Hands and contacts as files.
//!
//! # Hand
//!
//! Keys marked `?` are optional.
//!
//! | key | meaning |
//! | --- | --- |
//! | `format` | version of this format: 1 |
//! | `name` | name of the hand |
//! | `robot` | its URDF, beside this file; the base is the palm |
//! | `lambdas` ? | the trained sequence of λ, the first one first; the paper's Table 1 |
//! | `[[finger]]` | four of them: index, medium, ring, thumb |
//! | `name` | name of the finger |
//! | `tip` | link of the fingertip: its origin is the centre of the sphere, z goes outwards, x to the pad |
//! | `tip_radius_mm` | radius of the sphere |
//! | `bend_deg` ?, `lateral_deg` ? | ranges of the virtual joints φ₅, from z to x, and φ₆: \[0, 90\], \[−45, 45\] |
//! | `[[capsule]]` | a shape that collides |
//! | `link` | the link that it is fixed to |
//! | `from_mm`, `to_mm` | ends of its segment in the frame of the link |
//! | `radius_mm` | its radius |
//!
//! # Contacts
//!
//! | key | meaning |
//! | --- | --- |
//! | `format` | version of this format: 1 |
//! | `[[contact]]` | four of them |
//! | `finger` ? | which finger makes it; of all or of none, and then the assignment is found |
//! | `point_mm` | where the fingertip touches, in the world |
//! | `direction` | which way it pushes, normal to the object's boundary and into it |

use std::ops::Range;
use std::path::Path;

use darm_core::real::Vec3;
use serde::Deserialize;
use toml::Spanned;

use super::contact::{Contact, Contacts};
use super::fault::{ContactFault, ContactsError, HandError, HandFault};
use super::hand::{ANGLES, COORDINATES, Capsule, FINGERS, Finger, FingerJoint, Hand, JOINTS};
use super::referee::Referee;
use super::train::PAPER_LAMBDAS;
use darm_core::actuator::JointKind;
use darm_robot::robot::{Robot, RobotFrame};
use darm_robot::source::Number;
use darm_robot::source::Source;
use darm_robot::urdf::{self, Locks};

const FORMAT: u32 = 1;

/// A hand as its file gives it.
#[derive(Clone, Debug)]
pub struct HandFile {
    /// The hand that computes.
    pub hand: Hand,
    /// The same hand as a robot, which checks every answer.
    pub referee: Referee,
    /// The sequence of λ for the paper's search.
    pub lambdas: Vec<f64>,
}

/// What a file of contacts asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Task {
    /// The contacts: in the order of the fingers where these are named, else in that of the file.
    pub contacts: Contacts,
    /// Whether the file names the fingers.
    pub is_assigned: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawHand {
    format: Spanned<u32>,
    name: String,
    robot: Spanned<String>,
    lambdas: Option<Spanned<Vec<Number>>>,
    #[serde(default)]
    finger: Vec<Spanned<RawFinger>>,
    #[serde(default)]
    capsule: Vec<Spanned<RawCapsule>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFinger {
    name: String,
    tip: Spanned<String>,
    tip_radius_mm: Spanned<Number>,
    bend_deg: Option<Spanned<[Number; 2]>>,
    lateral_deg: Option<Spanned<[Number; 2]>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawCapsule {
    link: Spanned<String>,
    from_mm: [Number; 3],
    to_mm: [Number; 3],
    radius_mm: Spanned<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawTask {
    format: Spanned<u32>,
    #[serde(default)]
    contact: Vec<Spanned<RawContact>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawContact {
    finger: Option<Spanned<String>>,
    point_mm: [Number; 3],
    direction: Spanned<[Number; 3]>,
}

/// What is wrong, and where in the file.
type Wrong<F> = (Range<usize>, F);

/// A finger, its joints' limits, and where it is in the robot.
pub(super) struct Read {
    pub(super) finger: Finger,
    limits: [[f64; 2]; COORDINATES],
    tip: RobotFrame,
    path: [usize; JOINTS],
}

/// Ranges of the virtual joints φ₅ and φ₆ where nobody says others, deg.
pub(super) const VIRTUAL_DEG: [[f64; 2]; 2] = [[0.0, 90.0], [-45.0, 45.0]];

/// Reads a hand.
pub fn read_hand(path: &Path) -> Result<HandFile, HandError> {
    let source = Source::read(path)?;
    let raw: RawHand = source.parse()?;
    let of_file = |(span, fault): Wrong<HandFault>| source.wrong(span, fault);
    if *raw.format.get_ref() != FORMAT {
        return Err(of_file((raw.format.span(), HandFault::Format { found: *raw.format.get_ref() })));
    }
    let robot_path = path.parent().unwrap_or(Path::new("")).join(raw.robot.get_ref());
    let robot = urdf::read(&robot_path, &Locks::new())
        .map_err(|error| of_file((raw.robot.span(), HandFault::Robot(error.to_string()))))?;
    hand_file(&raw, robot).map_err(of_file)
}

fn hand_file(raw: &RawHand, robot: Robot) -> Result<HandFile, Wrong<HandFault>> {
    let fingers: Vec<_> = raw.finger.iter().map(|finger| read_finger(finger, &robot)).collect::<Result<_, _>>()?;
    let found = fingers.len();
    let Ok(read): Result<[Read; FINGERS], _> = fingers.try_into() else {
        return Err((raw.format.span(), HandFault::Fingers { found }));
    };
    if let Some((i, fault)) = shared(&read) {
        return Err((raw.finger[i].span(), fault));
    }
    let capsules = raw.capsule.iter().map(|capsule| read_capsule(capsule, &robot, &read)).collect::<Result<_, _>>()?;
    let lambdas = match &raw.lambdas {
        None => PAPER_LAMBDAS.to_vec(),
        Some(lambdas) => {
            let numbers: Vec<f64> = lambdas.get_ref().iter().map(|number| number.0).collect();
            if numbers.is_empty() || !numbers.iter().all(|lambda| (0.0..=1.0).contains(lambda)) {
                return Err((lambdas.span(), HandFault::Lambdas));
            }
            numbers
        }
    };
    assembled(raw.name.clone(), read, capsules, lambdas, robot).map_err(|fault| (raw.format.span(), fault))
}

/// The first finger that shares a joint with one before it.
fn shared(fingers: &[Read; FINGERS]) -> Option<(usize, HandFault)> {
    fingers.iter().enumerate().find_map(|(i, finger)| {
        let other = fingers[..i].iter().find(|other| other.path.iter().any(|joint| finger.path.contains(joint)))?;
        let (finger, other) = (finger.finger.name.clone(), other.finger.name.clone());
        Some((i, HandFault::Shared { finger, other }))
    })
}

/// Least and greatest of every angle, rad.
pub(super) fn limits(fingers: &[Read; FINGERS]) -> [[f64; 2]; ANGLES] {
    std::array::from_fn(|k| fingers[k / COORDINATES].limits[k % COORDINATES])
}

/// The hand of four fingers, none of which share a joint.
pub(super) fn assembled(
    name: String,
    fingers: [Read; FINGERS],
    capsules: Vec<Capsule>,
    lambdas: Vec<f64>,
    robot: Robot,
) -> Result<HandFile, HandFault> {
    if let Some((_, fault)) = shared(&fingers) {
        return Err(fault);
    }
    let joints = std::array::from_fn(|i| fingers[i].path);
    let tips = std::array::from_fn(|i| fingers[i].tip.clone());
    let limits = limits(&fingers);
    let hand = Hand::new(name, fingers.map(|finger| finger.finger), limits, capsules);
    Ok(HandFile { hand, referee: Referee { robot, joints, tips }, lambdas })
}

fn read_finger(raw: &Spanned<RawFinger>, robot: &Robot) -> Result<Read, Wrong<HandFault>> {
    let RawFinger { name, tip, tip_radius_mm, bend_deg, lateral_deg } = raw.get_ref();
    let tip_frame = robot.frame(tip.get_ref()).ok_or_else(|| (tip.span(), unknown_link(robot, tip.get_ref())))?;
    let mut virtual_deg = VIRTUAL_DEG;
    for (own, range) in virtual_deg.iter_mut().zip([bend_deg, lateral_deg]) {
        let Some(range) = range else { continue };
        let [low, high] = range.get_ref().map(|number| number.0);
        if !(-180.0 <= low && low <= high && high <= 180.0) {
            return Err((range.span(), HandFault::Range { low, high }));
        }
        *own = [low, high];
    }
    finger_at(robot, name, tip_frame.clone(), virtual_deg, length_m(tip_radius_mm)?).map_err(|fault| match fault {
        HandFault::Joints { .. } => (tip.span(), fault),
        _ => (raw.span(), fault),
    })
}

/// The finger with this tip.
pub(super) fn finger_at(
    robot: &Robot,
    name: &str,
    tip: RobotFrame,
    virtual_deg: [[f64; 2]; 2],
    tip_radius_m: f64,
) -> Result<Read, HandFault> {
    let path = robot.path(&tip);
    let found = path.len();
    let path: [usize; JOINTS] = path.try_into().map_err(|_| HandFault::Joints { finger: name.into(), found })?;
    let mut limits = [[0.0; 2]; COORDINATES];
    for (limits, joint) in limits.iter_mut().zip(path.map(|joint| &robot.joints[joint])) {
        *limits = joint
            .limits
            .filter(|_| joint.joint.axis.kind == JointKind::Revolute)
            .ok_or_else(|| HandFault::Unlimited { joint: joint.name.clone() })?;
    }
    for (limits, range) in limits.iter_mut().skip(JOINTS).zip(virtual_deg) {
        *limits = range.map(f64::to_radians);
    }
    let joints = path.map(|joint| {
        let joint = &robot.joints[joint].joint;
        FingerJoint { placement: joint.placement, axis: joint.axis.direction }
    });
    let finger = Finger { name: name.to_owned(), joints, tip: tip.pose, tip_radius_m };
    Ok(Read { finger, limits, tip, path })
}

fn read_capsule(
    raw: &Spanned<RawCapsule>,
    robot: &Robot,
    fingers: &[Read; FINGERS],
) -> Result<Capsule, Wrong<HandFault>> {
    let RawCapsule { link, from_mm, to_mm, radius_mm } = raw.get_ref();
    let wrong = |fault| (link.span(), fault);
    let frame = robot.frame(link.get_ref()).ok_or_else(|| wrong(unknown_link(robot, link.get_ref())))?;
    let of_finger = |joint| {
        let all = fingers.iter().flat_map(|finger| finger.path);
        all.into_iter().position(|other| other == joint)
    };
    let owner = match frame.joint {
        None => None,
        Some(joint) => Some(of_finger(joint).ok_or_else(|| wrong(HandFault::NoFinger { link: frame.name.clone() }))?),
    };
    let point = |mm: &[Number; 3]| frame.pose * Vec3::from(mm.map(|number| 1e-3 * number.0));
    Ok(Capsule { link: owner, from: point(from_mm), to: point(to_mm), radius_m: length_m(radius_mm)? })
}

fn length_m(mm: &Spanned<Number>) -> Result<f64, Wrong<HandFault>> {
    let value = mm.get_ref().0;
    if value > 0.0 { Ok(1e-3 * value) } else { Err((mm.span(), HandFault::NotPositive { value })) }
}

fn unknown_link(robot: &Robot, link: &str) -> HandFault {
    let known = robot.frames.iter().map(|frame| frame.name.clone()).collect();
    HandFault::UnknownLink { link: link.into(), known }
}

/// Reads the contacts that a hand is to make.
pub fn read_contacts(path: &Path, hand: &Hand) -> Result<Task, ContactsError> {
    contacts(&Source::read(path)?, hand)
}

/// The contacts that `text` describes; `path` only serves messages.
pub fn parse_contacts(path: &Path, text: &str, hand: &Hand) -> Result<Task, ContactsError> {
    contacts(&Source::of_text(path, text), hand)
}

fn contacts(source: &Source, hand: &Hand) -> Result<Task, ContactsError> {
    let raw: RawTask = source.parse()?;
    if *raw.format.get_ref() != FORMAT {
        return Err(source.wrong(raw.format.span(), ContactFault::Format { found: *raw.format.get_ref() }));
    }
    task(&raw, hand).map_err(|(span, fault)| source.wrong(span, fault))
}

fn task(raw: &RawTask, hand: &Hand) -> Result<Task, Wrong<ContactFault>> {
    let count = || (raw.format.span(), ContactFault::Count { found: raw.contact.len() });
    let listed: Vec<_> = raw.contact.iter().map(|contact| one_contact(contact.get_ref())).collect::<Result<_, _>>()?;
    let listed: Contacts = listed.try_into().map_err(|_| count())?;
    let named = raw.contact.iter().filter(|contact| contact.get_ref().finger.is_some()).count();
    if named == 0 {
        return Ok(Task { contacts: listed, is_assigned: false });
    }
    let mut contacts = [None; FINGERS];
    for (raw, contact) in raw.contact.iter().zip(listed) {
        let Some(finger) = &raw.get_ref().finger else { return Err((raw.span(), ContactFault::Unnamed)) };
        let index = hand.fingers.iter().position(|known| known.name == *finger.get_ref());
        let index = index.ok_or_else(|| {
            let known = hand.fingers.iter().map(|finger| finger.name.clone()).collect();
            (finger.span(), ContactFault::UnknownFinger { finger: finger.get_ref().clone(), known })
        })?;
        if contacts[index].replace(contact).is_some() {
            return Err((finger.span(), ContactFault::Twice { finger: finger.get_ref().clone() }));
        }
    }
    // Four contacts of four different fingers: there is one for each.
    let contacts = std::array::from_fn(|i| contacts[i].unwrap_or(listed[i]));
    Ok(Task { contacts, is_assigned: true })
}

fn one_contact(raw: &RawContact) -> Result<Contact, Wrong<ContactFault>> {
    let direction = Vec3::from(raw.direction.get_ref().map(|number| number.0));
    let length = direction.amax();
    if length == 0.0 {
        return Err((raw.direction.span(), ContactFault::NoDirection));
    }
    // Divided by its largest number first: the square of a huge one overflows.
    let direction = (direction / length).normalize();
    Ok(Contact { point: Vec3::from(raw.point_mm.map(|number| 1e-3 * number.0)), direction })
}
