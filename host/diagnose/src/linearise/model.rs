//! The model of an experiment that is no arm of words: a small TOML, or the file of a robot alone, URDF, MJCF or Denavit–Hartenberg table.
//!
//! ```toml
//! kind = "cylinder"        # force of one fluid actuator: p·A
//! bore_mm = 25.0
//! ```
//!
//! | kind | keys | observed |
//! | --- | --- | --- |
//! | `cylinder` | `bore_mm` | force against gauge pressure |
//! | `servo` | | position against target |
//! | `robot` | `urdf` (a URDF, MJCF or Denavit–Hartenberg table, relative to this file), `observed` = `torque`, `wrench`, `point-contact`, `tool-position` or `tool-pose` | see below |
//!
//! | of a robot | key | meaning |
//! | --- | --- | --- |
//! | torque | `transmission`, `offset_deg` | N (rows) and q where the motors are at zero: motor = N·(q − offset), τ = Nᵀ·motor torque |
//! | point contact | `point` | columns whose values name the point that is touched |
//! | point contact | `pair`, `distance_mm` | the one of them in which two points differ that are so far apart |
//! | point contact, tool | `tool` | the frame that touches or is measured; without it the robot's end |
//! | tool | `frame` | `base` (the default): what was measured is in the robot's base frame, nearly; `unknown`: anywhere |
//! | all | `root` | the body or link with which the robot's tree begins, of a file that has several |
//! | all | `lock_deg`, `lock_mm` | positions of joints that do not move, by their names: the columns of a table are those of the others |
//!
//! `number` and `[[effect]]` (see [`model_effects`](super::model_effects)) are what `darm diagnose -o` adds.
//!
//! The file of a robot alone is one whose torques are observed, or its contact wrench where the table has `Fz`.

use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::DMatrix;
use serde::Deserialize;
use serde::de::IgnoredAny;

use crate::linearise::measured_tool::MeasuredTool;
use crate::linearise::model_effects::ModelEffect;
use crate::linearise::point_contact::Points;
use crate::linearise::torque::Transmission;
use darm_robot::description::{self, DescriptionError};
use darm_robot::robot::Robot;
use darm_robot::source::{FileError, ModelKind, Source};
use darm_robot::urdf::Selection;
use toml::Spanned;

/// Why a file is no model: with file, line and column.
pub type ModelError = FileError<String>;

/// A model of an experiment: what predicts, and the effects known so far.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// What predicts.
    pub what: Predictor,
    /// What was found before.
    pub effects: Vec<ModelEffect>,
}

/// What predicts.
#[derive(Clone, Debug, PartialEq)]
pub enum Predictor {
    /// One fluid actuator with this bore.
    Cylinder {
        /// Diameter of its piston, m.
        bore_m: f64,
    },
    /// One joint that holds its target.
    Servo,
    /// Torques of a robot on a fixed base.
    Torque(Robot, Option<Transmission>),
    /// What a robot that moves freely exerts on a plate.
    Wrench(Robot),
    /// Points that a robot touches again and again.
    PointContact(Robot, Points),
    /// The tool of a robot, measured from outside.
    Tool(Robot, MeasuredTool),
    /// A robot: torques, or the wrench where the table has one.
    Any(Robot),
}

/// The key that says which others a file has.
#[derive(Debug, Deserialize)]
struct RawKind {
    kind: Kind,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Kind {
    Cylinder,
    Servo,
    Robot,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawServo {
    #[serde(rename = "kind")]
    _kind: IgnoredAny,
    #[serde(rename = "number")]
    _number: Option<IgnoredAny>,
    #[serde(default)]
    effect: Vec<ModelEffect>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawCylinder {
    #[serde(rename = "kind")]
    _kind: IgnoredAny,
    #[serde(rename = "number")]
    _number: Option<IgnoredAny>,
    #[serde(default)]
    effect: Vec<ModelEffect>,
    bore_mm: Spanned<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawRobot {
    #[serde(rename = "kind")]
    _kind: IgnoredAny,
    #[serde(rename = "number")]
    _number: Option<IgnoredAny>,
    #[serde(default)]
    effect: Vec<ModelEffect>,
    urdf: Spanned<String>,
    observed: Spanned<Observed>,
    transmission: Option<Spanned<Vec<Vec<f64>>>>,
    offset_deg: Option<Spanned<Vec<f64>>>,
    #[serde(default)]
    point: Vec<String>,
    pair: Option<Spanned<String>>,
    distance_mm: Option<Spanned<f64>>,
    tool: Option<Spanned<String>>,
    root: Option<String>,
    #[serde(default)]
    frame: InstrumentFrame,
    #[serde(default)]
    lock_deg: BTreeMap<String, f64>,
    #[serde(default)]
    lock_mm: BTreeMap<String, f64>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Observed {
    Torque,
    Wrench,
    PointContact,
    ToolPosition,
    ToolPose,
}

/// The frame that a tool was measured in.
#[derive(Debug, Default, Deserialize, PartialEq)]
#[serde(rename_all = "kebab-case")]
enum InstrumentFrame {
    #[default]
    Base,
    Unknown,
}

impl Model {
    /// The model of a file in the repository.
    #[cfg(test)]
    pub(crate) fn read(path: &std::path::Path) -> Self {
        Self::of_source(&Source::read::<String>(path).unwrap(), &Selection::default()).unwrap()
    }

    /// The model of a file that is no arm of words, with some joints of its robot locked, besides those that the file locks, and of a part of
    /// its robot's file.
    ///
    /// # Errors
    ///
    /// Its robot's file cannot be read, or has no such joint or root; or a key, frame or number of it is wrong.
    pub fn of_source(source: &Source, selection: &Selection) -> Result<Self, ModelError> {
        if source.kind() == ModelKind::Robot {
            return Ok(Predictor::Any(description::of_source(source, selection)?).into());
        }
        let RawKind { kind } = source.parse()?;
        let (what, effects) = match kind {
            Kind::Cylinder => {
                let RawCylinder { bore_mm, effect, .. } = source.parse()?;
                let bore_m = length_m(&bore_mm).map_err(|wrong| wrong.at(source))?;
                (Predictor::Cylinder { bore_m }, effect)
            }
            Kind::Servo => (Predictor::Servo, source.parse::<RawServo, _>()?.effect),
            Kind::Robot => {
                let mut raw: RawRobot = source.parse()?;
                let effects = std::mem::take(&mut raw.effect);
                (robot(source, raw, selection)?, effects)
            }
        };
        Ok(Self { what, effects })
    }
}

impl Predictor {
    /// The robot, where it is one.
    pub fn robot(&self) -> Option<&Robot> {
        match self {
            Self::Cylinder { .. } | Self::Servo => None,
            Self::Torque(robot, _) | Self::Wrench(robot) | Self::PointContact(robot, _) => Some(robot),
            Self::Tool(robot, _) | Self::Any(robot) => Some(robot),
        }
    }

    /// The robot whose weight the prediction depends on; `None` where it does not.
    pub(crate) fn weighing_robot_mut(&mut self) -> Option<&mut Robot> {
        match self {
            Self::Cylinder { .. } | Self::Servo | Self::PointContact(..) | Self::Tool(..) => None,
            Self::Torque(robot, _) | Self::Wrench(robot) | Self::Any(robot) => Some(robot),
        }
    }
}

impl From<Predictor> for Model {
    fn from(what: Predictor) -> Self {
        Self { what, effects: Vec::new() }
    }
}

/// What is wrong, and at which value of the file.
struct Wrong(Range<usize>, String);

impl Wrong {
    fn at(self, source: &Source) -> ModelError {
        source.wrong(self.0, self.1)
    }
}

/// A length above zero, in m.
fn length_m(mm: &Spanned<f64>) -> Result<f64, Wrong> {
    match *mm.get_ref() {
        length if length > 0.0 && length.is_finite() => Ok(1e-3 * length),
        length => Err(Wrong(mm.span(), format!("the length is {length} mm; give a number above 0"))),
    }
}

/// What a model of a robot describes.
fn robot(source: &Source, raw: RawRobot, selection: &Selection) -> Result<Predictor, ModelError> {
    let mut locks = selection.locks.clone();
    locks.extend(raw.lock_deg.iter().map(|(joint, deg)| (joint.clone(), deg.to_radians())));
    locks.extend(raw.lock_mm.iter().map(|(joint, mm)| (joint.clone(), 1e-3 * mm)));
    let root = selection.root.clone().or(raw.root.clone());
    let path = source.companion(raw.urdf.get_ref());
    let named = |error: DescriptionError| source.wrong(raw.urdf.span(), error.to_string());
    let robot = description::read_selected(source.files().file(&path), &Selection { locks, root }).map_err(named)?;
    observed(robot, raw).map_err(|wrong| wrong.at(source))
}

fn observed(robot: Robot, raw: RawRobot) -> Result<Predictor, Wrong> {
    if let Some(tool) = &raw.tool {
        known_frame(&robot, tool)?;
    }
    Ok(match raw.observed.get_ref() {
        Observed::Torque => {
            let transmission = transmission(raw.transmission, raw.offset_deg, robot.joints.len())?;
            Predictor::Torque(robot, transmission)
        }
        Observed::Wrench => Predictor::Wrench(robot),
        Observed::PointContact => Predictor::PointContact(robot, points(raw)?),
        Observed::ToolPosition | Observed::ToolPose => {
            let oriented = matches!(raw.observed.get_ref(), Observed::ToolPose);
            let in_base_frame = raw.frame == InstrumentFrame::Base;
            Predictor::Tool(robot, MeasuredTool { tool: raw.tool.map(Spanned::into_inner), oriented, in_base_frame })
        }
    })
}

fn points(raw: RawRobot) -> Result<Points, Wrong> {
    let apart =
        "pair and distance_mm go together: in which column two points differ, how far apart they are; add the other";
    let pair = match (raw.pair, &raw.distance_mm) {
        (None, None) => None,
        (Some(column), Some(mm)) if raw.point.contains(column.get_ref()) => Some((column.into_inner(), length_m(mm)?)),
        (Some(column), Some(_)) => {
            let what = format!("pair is {:?}; give one of the columns of `point`", column.get_ref());
            return Err(Wrong(column.span(), what));
        }
        (Some(column), None) => return Err(Wrong(column.span(), apart.into())),
        (None, Some(mm)) => return Err(Wrong(mm.span(), apart.into())),
    };
    if raw.point.is_empty() {
        let what = "the key `point` is missing; give the columns whose values name the point that is touched";
        return Err(Wrong(raw.observed.span(), what.into()));
    }
    Ok(Points { point: raw.point, pair, tool: raw.tool.map(Spanned::into_inner) })
}

fn known_frame(robot: &Robot, name: &Spanned<String>) -> Result<(), Wrong> {
    match robot.frame(name.get_ref()) {
        Some(_) => Ok(()),
        None => {
            let what = format!("the robot has no frame {}; give one of {}", name.get_ref(), robot.frame_names());
            Err(Wrong(name.span(), what))
        }
    }
}

/// The transmission of a robot of `n` joints.
fn transmission(
    rows: Option<Spanned<Vec<Vec<f64>>>>,
    offset_deg: Option<Spanned<Vec<f64>>>,
    n: usize,
) -> Result<Option<Transmission>, Wrong> {
    let Some(rows) = rows else { return Ok(None) };
    let (span, rows) = (rows.span(), rows.into_inner());
    if rows.len() != n || rows.iter().any(|row| row.len() != n) {
        return Err(Wrong(span, format!("the robot has {n} joints; give {n} rows of {n} numbers")));
    }
    let offset = match offset_deg {
        None => vec![0.0; n],
        Some(offset) if offset.get_ref().len() == n => offset.into_inner(),
        Some(offset) => return Err(Wrong(offset.span(), format!("the robot has {n} joints; give {n} numbers"))),
    };
    let matrix = DMatrix::from_fn(n, n, |row, column| rows[row][column]);
    Ok(Some(Transmission { matrix, offset: offset.into_iter().map(f64::to_radians).collect() }))
}
