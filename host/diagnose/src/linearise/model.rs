//! The model of an experiment that is no arm of words: a small TOML, or the file of a robot alone, URDF or MJCF.
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
//! | all | `lock_deg`, `lock_mm` | positions of joints that do not move, by their names: the columns of a table are those of the others |
//!
//! `number` and `[[effect]]` (see [`model_effects`]) are what `darm diagnose --write-model` adds.
//!
//! The file of a robot alone is one whose torques are observed, or its contact wrench where the table has `Fz`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::DMatrix;
use serde::Deserialize;

use crate::linearise::measured_tool::MeasuredTool;
use crate::linearise::model_effects::{self, ModelEffect};
use crate::linearise::model_error::ModelError;
use crate::linearise::point_contact::Points;
use crate::linearise::torque::Transmission;
use darm_robot::description;
use darm_robot::robot::Robot;
use darm_robot::urdf::Locks;

/// A model of an experiment: what predicts, and the effects known so far.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// What predicts.
    pub what: What,
    /// What was found before.
    pub effects: Vec<ModelEffect>,
}

/// What predicts.
#[derive(Clone, Debug, PartialEq)]
pub enum What {
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

/// A model as a file has it.
#[derive(Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
enum Raw {
    Cylinder { bore_mm: f64 },
    Servo {},
    Robot(Box<RawRobot>),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawRobot {
    urdf: PathBuf,
    observed: Observed,
    transmission: Option<Vec<Vec<f64>>>,
    offset_deg: Option<Vec<f64>>,
    #[serde(default)]
    point: Vec<String>,
    pair: Option<String>,
    distance_mm: Option<f64>,
    tool: Option<String>,
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
    #[serde(alias = "closure")]
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
    /// Reads a model; `None` where the file is an arm of words.
    ///
    /// # Errors
    ///
    /// The file cannot be read; its robot file cannot be read; or it has a `kind`, but a key, frame or number of it is
    /// wrong.
    pub fn read(path: &Path) -> Result<Option<Self>, ModelError> {
        Self::read_locked(path, &Locks::new())
    }

    /// The same with some joints of its robot locked, besides those that the file locks.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read); also where the robot of the file has no such joint.
    pub fn read_locked(path: &Path, locks: &Locks) -> Result<Option<Self>, ModelError> {
        if is_robot_file(path) {
            return Ok(Some(What::Any(description::read(path, locks)?).into()));
        }
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|error| ModelError::Io(name.clone(), error))?;
        let Some(mut table) =
            text.parse::<toml::Table>().ok().filter(|t| t.get("kind").is_some_and(toml::Value::is_str))
        else {
            return Ok(None);
        };
        let is_raw = !table.contains_key("number") && !table.contains_key("effect");
        let effects = model_effects::extract_effects(&name, &mut table)?;
        // Parsed from the text where that can be, so that an error has its line.
        let raw: Result<Raw, _> = if is_raw { toml::from_str(&text) } else { table.try_into() };
        let what = what(path, raw.map_err(|error| ModelError::Toml(name.clone(), error))?, locks)?;
        Ok(Some(Self { what, effects }))
    }
}

/// Whether a file describes a robot, by its name.
pub(crate) fn is_robot_file(path: &Path) -> bool {
    path.extension().is_some_and(|end| ["urdf", "xml"].iter().any(|known| end.eq_ignore_ascii_case(known)))
}

impl What {
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

impl From<What> for Model {
    fn from(what: What) -> Self {
        Self { what, effects: Vec::new() }
    }
}

/// What a file describes.
fn what(path: &Path, raw: Raw, locks: &Locks) -> Result<What, ModelError> {
    let wrong = |what: &str| ModelError::Value(path.display().to_string(), what.into());
    Ok(match raw {
        Raw::Cylinder { bore_mm } if bore_mm > 0.0 && bore_mm.is_finite() => What::Cylinder { bore_m: bore_mm * 1e-3 },
        Raw::Cylinder { .. } => return Err(wrong("bore_mm must be more than 0")),
        Raw::Servo {} => What::Servo,
        Raw::Robot(raw) => {
            let RawRobot {
                urdf,
                observed,
                transmission,
                offset_deg,
                point,
                pair,
                distance_mm,
                tool,
                frame,
                lock_deg,
                lock_mm,
            } = *raw;
            let mut locks = locks.clone();
            locks.extend(lock_deg.into_iter().map(|(joint, deg)| (joint, deg.to_radians())));
            locks.extend(lock_mm.into_iter().map(|(joint, mm)| (joint, 1e-3 * mm)));
            let robot = description::read(&path.parent().unwrap_or(Path::new("")).join(urdf), &locks)?;
            match observed {
                Observed::Torque => {
                    let n = robot.joints.len();
                    let transmission = transmission.map(|rows| matrix(&rows, n, offset_deg)).transpose();
                    What::Torque(robot, transmission.map_err(|what| wrong(&what))?)
                }
                Observed::Wrench => What::Wrench(robot),
                Observed::PointContact => {
                    let points = points(&robot, point, (pair, distance_mm), tool);
                    What::PointContact(robot, points.map_err(|what| wrong(&what))?)
                }
                Observed::ToolPosition | Observed::ToolPose => {
                    known_frame(&robot, tool.as_deref()).map_err(|what| wrong(&what))?;
                    let oriented = matches!(observed, Observed::ToolPose);
                    let in_base_frame = frame == InstrumentFrame::Base;
                    What::Tool(robot, MeasuredTool { tool, oriented, in_base_frame })
                }
            }
        }
    })
}

fn points(
    robot: &Robot,
    point: Vec<String>,
    pair: (Option<String>, Option<f64>),
    tool: Option<String>,
) -> Result<Points, String> {
    let pair = match pair {
        (None, None) => None,
        (Some(column), Some(mm)) if mm > 0.0 && mm.is_finite() => Some((column, mm * 1e-3)),
        (Some(_), Some(_)) => return Err("distance_mm must be more than 0".into()),
        _ => {
            return Err(
                "pair and distance_mm go together: in which column two points differ, how far apart they are".into()
            );
        }
    };
    if point.is_empty() {
        return Err("point must name the columns that name a point".into());
    }
    if let Some((column, _)) = pair.as_ref().filter(|(column, _)| !point.contains(column)) {
        return Err(format!("pair = {column:?} must be one of the columns of point"));
    }
    known_frame(robot, tool.as_deref())?;
    Ok(Points { point, pair, tool })
}

fn known_frame(robot: &Robot, name: Option<&str>) -> Result<(), String> {
    match name.filter(|name| robot.frame(name).is_none()) {
        Some(name) => Err(format!("the robot has no frame {name}; it has {}", robot.frame_names())),
        None => Ok(()),
    }
}

fn matrix(rows: &[Vec<f64>], n: usize, offset_deg: Option<Vec<f64>>) -> Result<Transmission, String> {
    if rows.len() != n || rows.iter().any(|row| row.len() != n) {
        return Err(format!("transmission must have {n} rows of {n} numbers"));
    }
    let offset = offset_deg.unwrap_or_else(|| vec![0.0; n]);
    if offset.len() != n {
        return Err(format!("offset_deg must have {n} numbers"));
    }
    let matrix = DMatrix::from_fn(n, n, |row, column| rows[row][column]);
    Ok(Transmission { matrix, offset: offset.into_iter().map(f64::to_radians).collect() })
}
