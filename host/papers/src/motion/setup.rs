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
use std::path::{Path, PathBuf};

use darm_core::actuator::JointKind;
use darm_core::real::Vec3;
use serde::Deserialize;

use super::BodyPoint;
use darm_robot::robot::{Robot, RobotFrame};

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
    feet: Vec<String>,
    markers: BTreeMap<String, RawMarker>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMarker {
    link: String,
    at: [f64; 3],
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawRobot {
    feet: BTreeMap<String, Vec<[f64; 3]>>,
    #[serde(default)]
    seat: BTreeMap<String, Vec<[f64; 3]>>,
    #[serde(default)]
    sitting_deg: BTreeMap<String, f64>,
    links: BTreeMap<String, String>,
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

/// Why a file is no setup.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    /// It cannot be read.
    #[error("{path} cannot be read: {error}")]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        error: std::io::Error,
    },
    /// It is no TOML of this shape.
    #[error("{path}: {error}")]
    Syntax {
        /// The file.
        path: PathBuf,
        /// Where and why.
        error: Box<toml::de::Error>,
    },
    /// A name that its tree does not have.
    #[error("{key}: {tree} has no {what} `{name}`; there are {known}")]
    Unknown {
        /// The key of the file.
        key: &'static str,
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
    #[error("robot.feet.{link}: {points} points are no sole, 3 at least are needed")]
    Sole {
        /// The link.
        link: String,
        /// How many.
        points: usize,
    },
    /// Nothing follows.
    #[error("robot.links: {markers} marker(s) are on links that the robot follows, 3 at least are needed")]
    Followers {
        /// How many.
        markers: usize,
    },
    /// No foot at all.
    #[error("{key} names no link: a motion is measured from the feet")]
    NoFeet {
        /// The key of the file.
        key: &'static str,
    },
}

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
        let text = std::fs::read_to_string(path).map_err(|error| SetupError::Read { path: path.into(), error })?;
        Self::parse(path, &text, person, robot)
    }

    /// The same of text; `path` only serves messages.
    ///
    /// # Errors
    ///
    /// The text is not TOML of this form, names a link or joint that its tree does not have, has fewer than three
    /// markers that the robot follows, a sole of fewer than three points, or no foot.
    pub fn parse(path: &Path, text: &str, person: &Robot, robot: &Robot) -> Result<Self, SetupError> {
        let syntax = |error| SetupError::Syntax { path: path.into(), error: Box::new(error) };
        let raw: Raw = toml::from_str(text).map_err(syntax)?;
        let mut markers = Vec::new();
        for (name, marker) in &raw.person.markers {
            let on_person = fixed(link(person, "person.markers", &marker.link)?, marker.at);
            let followed = raw.robot.links.get(&marker.link);
            let follower = followed.map(|name| link(robot, "robot.links", name)).transpose()?.map(|link| link.joint);
            markers.push(Marker { name: name.clone(), on_person, follower });
        }
        for name in raw.robot.links.keys() {
            link(person, "robot.links", name)?;
        }
        let followed = markers.iter().filter(|marker| marker.follower.is_some()).count();
        if followed < 3 {
            return Err(SetupError::Followers { markers: followed });
        }
        let person_feet: Result<Vec<_>, _> =
            raw.person.feet.iter().map(|name| Ok(link(person, "person.feet", name)?.joint)).collect();
        let (mut feet, mut seat) = (Vec::new(), Vec::new());
        for (name, points) in &raw.robot.feet {
            if points.len() < 3 {
                return Err(SetupError::Sole { link: name.clone(), points: points.len() });
            }
            let foot = link(robot, "robot.feet", name)?;
            feet.push((foot.joint, points.iter().map(|point| fixed(foot, *point).point).collect()));
        }
        for (name, points) in &raw.robot.seat {
            let sits = link(robot, "robot.seat", name)?;
            seat.extend(points.iter().map(|point| fixed(sits, *point)));
        }
        let person_feet = person_feet?;
        for (key, none) in [("person.feet", person_feet.is_empty()), ("robot.feet", feet.is_empty())] {
            if none {
                return Err(SetupError::NoFeet { key });
            }
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

fn sitting(robot: &Robot, given: &BTreeMap<String, f64>) -> Result<Vec<f64>, SetupError> {
    let mut q = vec![0.0; robot.joints.len()];
    for (name, value) in given {
        let Some(at) = robot.joints.iter().position(|joint| joint.name == *name) else {
            let known = robot.joints.iter().map(|joint| joint.name.as_str()).collect::<Vec<_>>().join(", ");
            let (tree, name) = (robot.name.clone(), name.clone());
            return Err(SetupError::Unknown { key: "robot.sitting_deg", tree, what: "joint", name, known });
        };
        q[at] = match robot.joints[at].joint.axis.kind {
            JointKind::Revolute => value.to_radians(),
            JointKind::Prismatic => 1e-3 * value,
        };
    }
    Ok(q)
}

/// A link by its name: the joint that moves it, and its frame there.
fn link<'a>(tree: &'a Robot, key: &'static str, name: &str) -> Result<&'a RobotFrame, SetupError> {
    tree.frame(name).ok_or_else(|| {
        let known = tree.frames.iter().map(|frame| frame.name.as_str()).collect::<Vec<_>>().join(", ");
        SetupError::Unknown { key, tree: tree.name.clone(), what: "link", name: name.to_owned(), known }
    })
}

/// A point of a link.
fn fixed(link: &RobotFrame, point: [f64; 3]) -> BodyPoint {
    BodyPoint { joint: link.joint, point: link.pose * Vec3::from(point) }
}
