//! What a mapping needs to know of person and robot, from a TOML file.
//!
//! | key | holds |
//! | --- | --- |
//! | `person.feet` | links of the person that stand on the ground; the motion is measured from the middle between them |
//! | `person.markers.NAME` | `link` and `at` (m, in the link's frame) of a marker on the average person |
//! | `robot.feet.LINK` | points of a link that touch the ground, m, in its frame: they stand at z = 0 |
//! | `robot.seat.LINK` | points of a link that touch the chair, m: their middle stays where it is until lift-off |
//! | `robot.sitting_deg.JOINT` | joint positions near which the robot sits, deg or mm; 0 without |
//! | `robot.links.LINK` | which link of the robot follows a link of the person |

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use darm_core::actuator::JointKind;
use darm_core::real::Vec3;
use serde::Deserialize;
use toml::Spanned;

use super::BodyPoint;
use darm_robot::robot::{Robot, RobotFrame};
use darm_robot::source::{FileError, Source};

/// The file as it is written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    person: RawPerson,
    robot: RawRobot,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPerson {
    feet: Spanned<Vec<Spanned<String>>>,
    markers: BTreeMap<String, RawMarker>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMarker {
    link: Spanned<String>,
    at: [f64; 3],
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawRobot {
    feet: Spanned<BTreeMap<Spanned<String>, Vec<[f64; 3]>>>,
    #[serde(default)]
    seat: BTreeMap<Spanned<String>, Vec<[f64; 3]>>,
    #[serde(default)]
    sitting_deg: BTreeMap<Spanned<String>, f64>,
    links: Spanned<BTreeMap<Spanned<String>, Spanned<String>>>,
}

/// A marker by name, on the person and, where a link follows, on the robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Marker {
    /// Its name.
    pub name: String,
    /// Where it is on the average person.
    pub on_person: BodyPoint,
    /// The link of the robot that follows, by the joint that moves it; `None`: no link follows.
    pub follower: Option<Option<usize>>,
}

/// What a mapping needs to know.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// The markers.
    pub markers: Vec<Marker>,
    /// Links of the person that stand on the ground, by the joints that move them.
    pub person_feet: Vec<Option<usize>>,
    /// Links of the robot with the points that touch the ground.
    pub feet: Vec<(Option<usize>, Vec<Vec3<f64>>)>,
    /// Points of the robot that sit on the chair.
    pub seat: Vec<BodyPoint>,
    /// Joint positions near which the robot sits, rad or m.
    pub sitting: Vec<f64>,
}

/// Why a file is no setup: with file, line and column.
pub type SetupError = FileError<SetupFault>;

/// What is wrong with a setup, and what to do about it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SetupFault {
    /// A name that its tree does not have.
    #[error("{tree} has no {what} `{name}`; give one of {known}")]
    Unknown {
        /// The tree.
        tree: String,
        /// Link or joint.
        what: &'static str,
        /// The name.
        name: String,
        /// Those that there are.
        known: String,
    },
    /// A foot of fewer points than make a plane.
    #[error("the sole of {link} has {points} points; give at least 3")]
    Sole {
        /// The link.
        link: String,
        /// How many.
        points: usize,
    },
    /// Nothing follows.
    #[error("{markers} marker(s) are on links that the robot follows; give at least 3")]
    Followers {
        /// How many.
        markers: usize,
    },
    /// No foot at all.
    #[error("no foot is named; name a link, a motion is measured from the feet")]
    NoFeet,
}

/// What is wrong, and where in the file.
type Wrong = (Range<usize>, SetupFault);

impl Setup {
    /// Names of the markers, as columns of a capture have them.
    pub fn marker_names(&self) -> Vec<String> {
        self.markers.iter().map(|marker| marker.name.clone()).collect()
    }

    /// Where the markers are on the person.
    pub fn on_person(&self) -> Vec<BodyPoint> {
        self.markers.iter().map(|marker| marker.on_person).collect()
    }

    /// Reads the setup of a person and a robot.
    ///
    /// # Errors
    ///
    /// The file cannot be read; or as [`parse`](Self::parse).
    pub fn read(path: &Path, person: &Robot, robot: &Robot) -> Result<Self, SetupError> {
        Self::of_source(&Source::read(path)?, person, robot)
    }

    /// The same of text; `path` only serves messages.
    ///
    /// # Errors
    ///
    /// The text is not TOML of this form, names a link or joint that its tree does not have, has fewer than three
    /// markers that the robot follows, a sole of fewer than three points, or no foot.
    pub fn parse(path: &Path, text: &str, person: &Robot, robot: &Robot) -> Result<Self, SetupError> {
        Self::of_source(&Source::of_text(path, text), person, robot)
    }

    fn of_source(source: &Source, person: &Robot, robot: &Robot) -> Result<Self, SetupError> {
        let raw: Raw = source.parse()?;
        Self::of_raw(&raw, person, robot).map_err(|(span, fault)| source.wrong(span, fault))
    }

    fn of_raw(raw: &Raw, person: &Robot, robot: &Robot) -> Result<Self, Wrong> {
        let links = raw.robot.links.get_ref();
        let mut markers = Vec::new();
        for (name, marker) in &raw.person.markers {
            let on_person = fixed(link(person, &marker.link)?, marker.at);
            let followed = links.get(marker.link.get_ref().as_str());
            let follower = followed.map(|name| link(robot, name)).transpose()?.map(|link| link.joint);
            markers.push(Marker { name: name.clone(), on_person, follower });
        }
        for name in links.keys() {
            link(person, name)?;
        }
        let followed = markers.iter().filter(|marker| marker.follower.is_some()).count();
        if followed < 3 {
            return Err((raw.robot.links.span(), SetupFault::Followers { markers: followed }));
        }
        let (mut feet, mut seat) = (Vec::new(), Vec::new());
        for (name, points) in raw.robot.feet.get_ref() {
            if points.len() < 3 {
                let link = name.get_ref().clone();
                return Err((name.span(), SetupFault::Sole { link, points: points.len() }));
            }
            let foot = link(robot, name)?;
            feet.push((foot.joint, points.iter().map(|point| fixed(foot, *point).point).collect()));
        }
        for (name, points) in &raw.robot.seat {
            let sits = link(robot, name)?;
            seat.extend(points.iter().map(|point| fixed(sits, *point)));
        }
        let own = &raw.person.feet;
        let person_feet =
            own.get_ref().iter().map(|name| Ok(link(person, name)?.joint)).collect::<Result<Vec<_>, _>>()?;
        if person_feet.is_empty() {
            return Err((own.span(), SetupFault::NoFeet));
        }
        if feet.is_empty() {
            return Err((raw.robot.feet.span(), SetupFault::NoFeet));
        }
        Ok(Self { markers, person_feet, feet, seat, sitting: sitting(robot, &raw.robot.sitting_deg)? })
    }
}

impl Setup {
    /// The points that touch the ground.
    pub fn soles(&self) -> impl Iterator<Item = BodyPoint> {
        self.feet.iter().flat_map(|(joint, points)| points.iter().map(|&point| BodyPoint { joint: *joint, point }))
    }
}

fn sitting(robot: &Robot, given: &BTreeMap<Spanned<String>, f64>) -> Result<Vec<f64>, Wrong> {
    let mut q = vec![0.0; robot.joints.len()];
    for (name, value) in given {
        let Some(at) = robot.joints.iter().position(|joint| joint.name == *name.get_ref()) else {
            return Err(unknown(robot, "joint", name, robot.joints.iter().map(|joint| joint.name.as_str())));
        };
        q[at] = match robot.joints[at].joint.axis.kind {
            JointKind::Revolute => value.to_radians(),
            JointKind::Prismatic => 1e-3 * value,
        };
    }
    Ok(q)
}

/// A link by its name: the joint that moves it, and its frame there.
fn link<'a>(tree: &'a Robot, name: &Spanned<String>) -> Result<&'a RobotFrame, Wrong> {
    let known = || tree.frames.iter().map(|frame| frame.name.as_str());
    tree.frame(name.get_ref()).ok_or_else(|| unknown(tree, "link", name, known()))
}

fn unknown<'a>(
    tree: &Robot,
    what: &'static str,
    name: &Spanned<String>,
    known: impl Iterator<Item = &'a str>,
) -> Wrong {
    let known = known.collect::<Vec<_>>().join(", ");
    (name.span(), SetupFault::Unknown { tree: tree.name.clone(), what, name: name.get_ref().clone(), known })
}

/// A point of a link.
fn fixed(link: &RobotFrame, point: [f64; 3]) -> BodyPoint {
    BodyPoint { joint: link.joint, point: link.pose * Vec3::from(point) }
}
