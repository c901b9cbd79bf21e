//! A serial arm as a table of Denavit and Hartenberg in TOML.
//!
//! # Format
//!
//! Keys marked `?` are optional; the default of a number is 0.
//!
//! | key | meaning |
//! | --- | --- |
//! | `format` | version of this format: 1 |
//! | `name` | name of the arm |
//! | `notation` | `standard` or `modified`: see [`darm_core::tree::dh`] |
//! | `gravity_m_s2` ? | acceleration of free fall in the base frame, \[0, 0, −9.81\] |
//! | `[[row]]` | one joint and its link, from the base on |
//! | `name` ? | name of the joint |
//! | `motion` ? | `revolute` or `prismatic` |
//! | `theta_deg`, `d_m`, `a_m`, `alpha_deg` ? | the four parameters at position zero |
//! | `min_deg`, `max_deg` or `min_m`, `max_m` ? | limits of the position |
//! | `mass_kg`, `center_m` ? | of the link, in the frame of the row |
//! | `inertia_kg_m2` ? | moments of inertia about the centre of mass: `[xx, yy, zz]` or `[xx, xy, yy, xz, yz, zz]` |

use std::ops::Range;
use std::path::Path;

use darm_core::actuator::JointKind;
use darm_core::real::{Mat3, Vec3};
use darm_core::se::Pose;
use darm_core::tree::Inertia;
use darm_core::tree::dh::{Row, modified_joints, standard_joints};
use serde::Deserialize;
use toml::Spanned;

use crate::robot::{Robot, RobotFrame, RobotJoint};
use crate::source::{Fault, FileError, Number, Source};

const FORMAT: u32 = 1;

/// Why a file gives no table.
pub type TableError = FileError<TableFault>;

/// What is wrong with a table, and what to do about it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TableFault {
    /// The file has another format than this program reads.
    #[error("format {found} is not known, this program reads {FORMAT}")]
    Format {
        /// The number in the file.
        found: u32,
    },
    /// There is no row.
    #[error("the table has no rows; add one [[row]] per joint")]
    Rows,
    /// A limit of the other kind of joint, one limit without the other, or the lower one above.
    #[error("the limits of a {0} joint are {1}; give both, the lower one first")]
    Limits(&'static str, &'static str),
    /// Neither three nor six moments of inertia.
    #[error("{found} moments of inertia, give 3 (xx, yy, zz) or 6 (xx, xy, yy, xz, yz, zz)")]
    Moments {
        /// How many there are.
        found: usize,
    },
    /// A mass below zero.
    #[error("the mass {mass} kg is below zero; give at least 0")]
    Mass {
        /// The mass.
        mass: f64,
    },
    /// Joints of a table are not locked.
    #[error("joint {joint} cannot be locked in a Denavit-Hartenberg table; give a URDF")]
    Locked {
        /// The joint.
        joint: String,
    },
    /// A table has one chain, no trees to choose from.
    #[error("a table has one chain and no body `{root}`; leave --root out")]
    Rooted {
        /// The name.
        root: String,
    },
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Notation {
    Standard,
    Modified,
}

#[derive(Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Motion {
    #[default]
    Revolute,
    Prismatic,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawTable {
    format: Spanned<u32>,
    name: String,
    notation: Notation,
    gravity_m_s2: Option<[Number; 3]>,
    #[serde(default)]
    row: Vec<Spanned<RawRow>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawRow {
    name: Option<String>,
    #[serde(default)]
    motion: Motion,
    theta_deg: Option<Number>,
    d_m: Option<Number>,
    a_m: Option<Number>,
    alpha_deg: Option<Number>,
    min_deg: Option<Number>,
    max_deg: Option<Number>,
    min_m: Option<Number>,
    max_m: Option<Number>,
    mass_kg: Option<Number>,
    center_m: Option<[Number; 3]>,
    inertia_kg_m2: Option<Spanned<Vec<Number>>>,
}

/// The error that a joint of a table is to be locked.
pub(crate) fn locked(path: &Path, joint: &str) -> TableError {
    Source::of_text(path, "").error(None, Fault::Content(Box::new(TableFault::Locked { joint: joint.into() })))
}

/// The error that a part of a table is to be read.
pub(crate) fn rooted(path: &Path, root: &str) -> TableError {
    Source::of_text(path, "").error(None, Fault::Content(Box::new(TableFault::Rooted { root: root.into() })))
}

/// Reads a table.
///
/// # Errors
///
/// The file cannot be read; or as [`parse`].
pub fn read(path: &Path) -> Result<Robot, TableError> {
    of_source(&Source::read(path)?)
}

/// The arm that `text` describes; `path` only serves messages.
///
/// # Errors
///
/// The text is not TOML of this format, has no row, or a row has limits, a mass or moments of inertia that cannot be.
/// The error names line and column.
pub fn parse(path: &Path, text: &str) -> Result<Robot, TableError> {
    of_source(&Source::of_text(path, text))
}

/// The arm of what was read already.
pub(crate) fn of_source(source: &Source) -> Result<Robot, TableError> {
    let raw: RawTable = source.parse()?;
    if *raw.format.get_ref() != FORMAT {
        return Err(source.wrong(raw.format.span(), TableFault::Format { found: *raw.format.get_ref() }));
    }
    if raw.row.is_empty() {
        return Err(source.wrong(raw.format.span(), TableFault::Rows));
    }
    let mut rows = Vec::new();
    for raw in &raw.row {
        rows.push(row(raw).map_err(|(span, fault)| source.wrong(span, fault))?);
    }
    let notation = raw.notation;
    let joints: Vec<_> = match notation {
        Notation::Standard => standard_joints(&rows).collect(),
        Notation::Modified => modified_joints(&rows).collect(),
    };
    let mut robot = Robot {
        name: raw.name.clone(),
        frames: vec![RobotFrame { name: "base".into(), joint: None, pose: Pose::identity(), is_end: false }],
        gravity: raw.gravity_m_s2.map_or(Vec3::new(0.0, 0.0, -9.81), |gravity| gravity.map(|number| number.0).into()),
        ..Robot::empty()
    };
    for (index, ((joint, row), raw)) in joints.into_iter().zip(&rows).zip(&raw.row).enumerate() {
        let limits = limits(raw.get_ref()).map_err(|fault| source.wrong(raw.span(), fault))?;
        let name = raw.get_ref().name.clone().unwrap_or_else(|| format!("joint {}", index + 1));
        let link = format!("link {}", index + 1);
        let pose = match notation {
            Notation::Standard => row.far_end(),
            Notation::Modified => Pose::identity(),
        };
        robot.frames.push(RobotFrame { name: link.clone(), joint: Some(index), pose, is_end: index + 1 == rows.len() });
        robot.joints.push(RobotJoint { limits, ..RobotJoint::new(name, link, joint) });
    }
    Ok(robot)
}

fn row(raw: &Spanned<RawRow>) -> Result<Row<f64>, (Range<usize>, TableFault)> {
    let of = |number: Option<Number>| number.map_or(0.0, |number| number.0);
    let (span, raw) = (raw.span(), raw.get_ref());
    let mass = of(raw.mass_kg);
    if mass < 0.0 {
        return Err((span, TableFault::Mass { mass }));
    }
    let about_com = match &raw.inertia_kg_m2 {
        None => Mat3::zeros(),
        Some(moments) => {
            let numbers: Vec<f64> = moments.get_ref().iter().map(|number| number.0).collect();
            match numbers[..] {
                [xx, yy, zz] => Mat3::from_diagonal(&Vec3::new(xx, yy, zz)),
                [xx, xy, yy, xz, yz, zz] => Mat3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
                _ => return Err((moments.span(), TableFault::Moments { found: numbers.len() })),
            }
        }
    };
    Ok(Row {
        kind: match raw.motion {
            Motion::Revolute => JointKind::Revolute,
            Motion::Prismatic => JointKind::Prismatic,
        },
        theta_rad: of(raw.theta_deg).to_radians(),
        d_m: of(raw.d_m),
        a_m: of(raw.a_m),
        alpha_rad: of(raw.alpha_deg).to_radians(),
        inertia: Inertia { mass, com: raw.center_m.map_or(Vec3::zeros(), |c| c.map(|x| x.0).into()), about_com },
    })
}

fn limits(raw: &RawRow) -> Result<Option<[f64; 2]>, TableFault> {
    let (own, other, fault, factor) = match raw.motion {
        Motion::Revolute => {
            let fault = TableFault::Limits("revolute", "min_deg and max_deg");
            ([raw.min_deg, raw.max_deg], [raw.min_m, raw.max_m], fault, std::f64::consts::PI / 180.0)
        }
        Motion::Prismatic => {
            let fault = TableFault::Limits("prismatic", "min_m and max_m");
            ([raw.min_m, raw.max_m], [raw.min_deg, raw.max_deg], fault, 1.0)
        }
    };
    match (own, other) {
        ([None, None], [None, None]) => Ok(None),
        ([Some(low), Some(high)], [None, None]) if low.0 <= high.0 => Ok(Some([low.0 * factor, high.0 * factor])),
        _ => Err(fault),
    }
}
