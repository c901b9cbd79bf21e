//! Robot files of published packages: what is read of them, and its mass matrix, gravity and Jacobian beside those of
//! Pinocchio (URDF) and MuJoCo (MJCF), which the program `foreign.py` computes.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use anyhow::{Context as _, Result, bail};
use darm_figures::figure::Figure;
use darm_robot::description::{DescriptionError, read};
use darm_robot::robot::{Motion, Robot};
use darm_robot::source::{Fault, Place};
use darm_robot::urdf::Locks;
use nalgebra::DMatrix;
use serde::Deserialize;

use crate::python;

/// What computes the reference, and packages that hold robot files.
const PACKAGES: [&str; 9] = [
    "pin==4.1.0",
    "mujoco==4.0.0",
    "example-robot-data==6.0.0",
    "pybullet==3.2.7",
    "dm_control==1.0.50",
    "gymnasium==1.4.0",
    "gymnasium-robotics==1.4.2",
    "robosuite==1.5.1",
    "numpy==2.4.6",
];
/// Larger disagreement is listed.
const AGREES: f64 = 1e-10;

/// Torques of balanced wheels are rounding of larger ones, N·m.
const NO_TORQUE: f64 = 1e-3;

/// A file and its reference values, or why the reference refuses it.
#[derive(Deserialize)]
struct Reference {
    file: String,
    format: String,
    refused: Option<String>,
    #[serde(default)]
    joints: Vec<Option<String>>,
    #[serde(default)]
    q: Vec<f64>,
    #[serde(default)]
    mass: Vec<Vec<f64>>,
    #[serde(default)]
    gravity: Vec<f64>,
    #[serde(default)]
    frame: Option<String>,
    #[serde(default)]
    jacobian: Vec<Vec<f64>>,
}

/// What became of the files of one format.
#[derive(Default)]
struct Tally {
    files: usize,
    read: usize,
    refused: usize,
    without_place: usize,
    compared: usize,
    /// Files that the reference reads and that are compared in vain: joints or frames differ.
    incomparable: usize,
    worst: [f64; 3],
    reasons: BTreeMap<String, usize>,
}

const QUANTITIES: [&str; 3] = ["mass matrix", "gravity", "Jacobian"];

/// Reads and compares all files below the folder.
pub(super) fn measure(folder: &Path) -> Result<Vec<Figure>> {
    let python = python::environment(folder, &PACKAGES)?;
    eprintln!("computing reference values (some minutes)");
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/src/bench/foreign.py");
    let output = Command::new(&python).arg(script).arg(folder).output()?;
    if !output.status.success() {
        bail!("{script} failed:\n{}", String::from_utf8_lossy(&output.stderr));
    }
    let mut tallies: BTreeMap<String, Tally> = BTreeMap::new();
    for line in String::from_utf8_lossy(&output.stdout).lines() {
        let reference: Reference = serde_json::from_str(line).context("foreign.py printed no JSON")?;
        tallies.entry(reference.format.clone()).or_default().add(&reference);
    }
    let mut figures = Vec::new();
    for (format, tally) in &tallies {
        tally.print(format);
        figures.extend(tally.figures(format)?);
    }
    Ok(figures)
}

impl Tally {
    fn add(&mut self, reference: &Reference) {
        self.files += 1;
        match read(Path::new(&reference.file), &Locks::new()) {
            Err(error) => {
                self.refused += 1;
                let place = place(&error);
                self.without_place += usize::from(place.is_none());
                *self.reasons.entry(reason(&error)).or_default() += 1;
                eprintln!("refused: {error}");
            }
            Ok(robot) => {
                self.read += 1;
                match (&reference.refused, compared(&robot, reference)) {
                    (Some(_), _) => {}
                    (None, Ok(found)) => {
                        self.compared += 1;
                        for ((worst, found), quantity) in self.worst.iter_mut().zip(found).zip(QUANTITIES) {
                            *worst = worst.max(found);
                            if found > AGREES {
                                eprintln!("{}: {quantity} off by {found:.1e}", reference.file);
                            }
                        }
                    }
                    (None, Err(why)) => {
                        self.incomparable += 1;
                        eprintln!("{}: {why}", reference.file);
                    }
                }
            }
        }
    }

    fn print(&self, format: &str) {
        println!("{format}: {} files, {} read, {} refused", self.files, self.read, self.refused);
        self.reasons.iter().for_each(|(reason, count)| println!("  {count:4}  {reason}"));
    }

    fn figures(&self, format: &str) -> Result<Vec<Figure>> {
        let count = |what: &str, count: usize| Figure::new(&format!("foreign {format}: {what}"), count as f64, "files");
        let worst = |(what, worst): (&str, f64)| {
            let rounded = format!("{worst:.1e}").parse().unwrap_or(worst);
            Figure::new(&format!("foreign {format}: worst disagreement, {what}"), rounded, "of the largest entry")
        };
        let mut figures = vec![
            count("all", self.files)?,
            count("read", self.read)?,
            count("refused with line and reason", self.refused - self.without_place)?,
            count("refused without a line", self.without_place)?,
            count("compared", self.compared)?,
            count("read with other joints or frames", self.incomparable)?,
        ];
        for quantity in QUANTITIES.into_iter().zip(self.worst) {
            figures.push(worst(quantity)?);
        }
        Ok(figures)
    }
}

fn place(error: &DescriptionError) -> Option<Place> {
    match error {
        DescriptionError::Urdf(error) => error.place,
        DescriptionError::Mjcf(error) => error.place,
        DescriptionError::Table(error) => error.place,
    }
}

/// The reason without the names of one file.
fn reason(error: &DescriptionError) -> String {
    let text = match error {
        DescriptionError::Urdf(error) => match &error.fault {
            Fault::Syntax(_) => "not XML".into(),
            fault => fault.to_string(),
        },
        DescriptionError::Mjcf(error) => match &error.fault {
            Fault::Syntax(_) => "not XML".into(),
            fault => fault.to_string(),
        },
        DescriptionError::Table(_) => error.to_string(),
    };
    let quoted = text.split('`').enumerate().map(|(k, part)| if k % 2 == 0 { part } else { "…" });
    quoted.collect::<Vec<_>>().join("`").chars().take(100).collect()
}

/// The disagreement of each quantity as a part of the largest entry.
fn compared(robot: &Robot, reference: &Reference) -> Result<[f64; 3]> {
    let order = order(robot, reference)?;
    let mut q = vec![0.0; order.len()];
    order.iter().zip(&reference.q).for_each(|(joint, position)| q[*joint] = *position);
    let found = robot.dynamics(&Motion { state: [&q, &[], &[]], load: None })?;
    let base = if found.base.is_some() { 6 } else { 0 };
    let rows: Vec<usize> = (0..base).chain(order.iter().map(|joint| base + joint)).collect();
    let (mut mass, mut gravity) = (found.mass, found.gravity);
    if let Some(floating) = &found.base {
        let n = mass.nrows();
        mass = DMatrix::from_fn(6 + n, 6 + n, |row, column| match (row.checked_sub(6), column.checked_sub(6)) {
            (None, None) => floating.mass[(row, column)],
            (None, Some(joint)) => floating.coupling[(row, joint)],
            (Some(joint), None) => floating.coupling[(column, joint)],
            (Some(row), Some(column)) => mass[(row, column)],
        });
        let on_base = floating.load.moment.iter().chain(floating.load.force.iter());
        gravity = on_base.copied().chain(gravity).collect();
    }
    let unnamed = || robot.frames.iter().rev().find(|frame| frame.name.starts_with("body "));
    let frame = reference.frame.as_deref().map_or_else(unnamed, |name| robot.frame(name));
    let jacobian = robot.kinematics(frame.context("no such frame")?, &q)?.jacobian_base;
    let flat = |matrix: &[Vec<f64>]| matrix.concat();
    let of_rows = |k: &usize| rows.iter().map(|l| mass[(*k, *l)]).collect::<Vec<_>>();
    let twists = (0..6).flat_map(|row| order.iter().map(move |joint| (row, *joint)));
    Ok([
        apart(&rows.iter().flat_map(of_rows).collect::<Vec<_>>(), &flat(&reference.mass), 0.0),
        apart(&rows.iter().map(|k| gravity[*k]).collect::<Vec<_>>(), &reference.gravity, NO_TORQUE),
        apart(&twists.map(|at| jacobian[at]).collect::<Vec<_>>(), &flat(&reference.jacobian), 0.0),
    ])
}

/// The coordinate of each joint of the reference: by name, or in MuJoCo's order, whose joints may have none.
fn order(robot: &Robot, reference: &Reference) -> Result<Vec<usize>> {
    let names: Vec<&str> = robot.coordinates().map(|joint| robot.joints[joint].name.as_str()).collect();
    if names.len() != reference.joints.len() {
        bail!("{} joints, {} of the reference", names.len(), reference.joints.len());
    }
    let at = |(number, name): (usize, &Option<String>)| match name {
        Some(name) => names.iter().position(|own| own == name).with_context(|| format!("no joint {name}")),
        None => Ok(number),
    };
    reference.joints.iter().enumerate().map(at).collect()
}

/// The largest difference as a part of the largest entry, or of the floor where that is larger; infinite of lists of
/// different length.
fn apart(ours: &[f64], theirs: &[f64], floor: f64) -> f64 {
    if ours.len() != theirs.len() {
        return f64::INFINITY;
    }
    let scale = theirs.iter().fold(floor, |scale: f64, x| scale.max(x.abs()));
    let difference = ours.iter().zip(theirs).fold(0.0, |largest: f64, (a, b)| largest.max((a - b).abs()));
    if scale > 0.0 { difference / scale } else { difference }
}
