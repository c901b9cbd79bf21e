//! Postures from the command line or a table.

use std::path::Path;

use darm_core::actuator::JointKind;
use darm_core::units::Word;
use darm_robot::csv_table::{CsvFault, CsvTable};

use super::{Coordinate, Subject, SubjectArgs};
use crate::failure::Usage;

/// A posture with optional velocities, accelerations and torques; in rad and m.
#[derive(Clone, Debug)]
pub(crate) struct Posture {
    /// Digits of the discrete actuators.
    pub(crate) word: Word,
    /// Positions of joints or servos.
    pub(crate) q: Vec<f64>,
    /// Velocities.
    pub(crate) qd: Vec<f64>,
    /// Accelerations.
    pub(crate) qdd: Vec<f64>,
    /// Torques (N·m) or forces (N); empty where none are given.
    pub(crate) torque: Vec<f64>,
    /// Time, s; the number of the row where the table has no time.
    pub(crate) time_s: f64,
}

/// Meaning of a column.
#[derive(Clone, Copy)]
enum Column {
    Word,
    Time,
    /// Of this coordinate: position, velocity, acceleration or torque, times the factor.
    Number(usize, Quantity, f64),
}

impl Column {
    /// Which quantity of which coordinate it has.
    fn number(&self) -> Option<(usize, Quantity)> {
        match self {
            Self::Number(index, quantity, _) => Some((*index, *quantity)),
            Self::Word | Self::Time => None,
        }
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Quantity {
    Position,
    Velocity,
    Acceleration,
    Torque,
}

/// Names of the column of time.
const TIMES: [&str; 3] = ["t", "t_s", "time_s"];
/// Endings of column names and their meaning, the longest first.
const ENDINGS: [(&str, JointKind, Quantity, f64); 14] = {
    use JointKind::{Prismatic, Revolute};
    use Quantity::{Acceleration, Position, Torque, Velocity};
    const DEG: f64 = std::f64::consts::PI / 180.0;
    [
        ("_rad_s2", Revolute, Acceleration, 1.0),
        ("_deg_s2", Revolute, Acceleration, DEG),
        ("_mm_s2", Prismatic, Acceleration, 1e-3),
        ("_m_s2", Prismatic, Acceleration, 1.0),
        ("_rad_s", Revolute, Velocity, 1.0),
        ("_deg_s", Revolute, Velocity, DEG),
        ("_mm_s", Prismatic, Velocity, 1e-3),
        ("_m_s", Prismatic, Velocity, 1.0),
        ("_rad", Revolute, Position, 1.0),
        ("_deg", Revolute, Position, DEG),
        ("_mm", Prismatic, Position, 1e-3),
        ("_nm", Revolute, Torque, 1.0),
        ("_m", Prismatic, Position, 1.0),
        ("_n", Prismatic, Torque, 1.0),
    ]
};

impl Posture {
    /// All zero.
    fn rest(subject: &Subject) -> Self {
        let zeros = vec![0.0; subject.coordinates().len()];
        let word = match subject {
            Subject::Arm(arm) => arm.rest(),
            Subject::Robot(_) => Word::default(),
        };
        Self { word, q: zeros.clone(), qd: zeros.clone(), qdd: zeros, torque: Vec::new(), time_s: 0.0 }
    }
}

impl SubjectArgs {
    /// The requested postures, and notes on positions beyond their limits.
    pub(crate) fn postures(&self, subject: &Subject) -> anyhow::Result<(Vec<Posture>, Vec<String>)> {
        let postures = match &self.postures {
            Some(path) => read(path, subject)?,
            None => vec![self.one(subject)?],
        };
        let notes = match subject {
            Subject::Robot(robot) => beyond_limits(robot, &postures),
            Subject::Arm(_) => Vec::new(),
        };
        Ok((postures, notes))
    }

    fn one(&self, subject: &Subject) -> anyhow::Result<Posture> {
        let mut posture = Posture::rest(subject);
        if let Some(q) = &self.q {
            posture.q = listed(q, &subject.coordinates(), "--q")?;
        }
        if let Some(word) = &self.word {
            posture.word = word_of(word, subject)?;
        }
        Ok(posture)
    }
}

/// Numbers separated by commas, one per coordinate.
pub(crate) fn listed(text: &str, coordinates: &[Coordinate], option: &str) -> Result<Vec<f64>, Usage> {
    let cells: Vec<_> = text.split(',').collect();
    if cells.len() != coordinates.len() {
        let names: Vec<_> = coordinates.iter().map(|c| format!("{} ({})", c.name, c.unit())).collect();
        let expected = if names.is_empty() { "it has no joints or servos".into() } else { names.join(", ") };
        return Err(Usage(format!("{option} has {} numbers, expected {}: {expected}", cells.len(), names.len())));
    }
    cells.iter().zip(coordinates).map(|(cell, coordinate)| coordinate.typed(cell)).collect()
}

fn word_of(text: &str, subject: &Subject) -> Result<Word, Usage> {
    let Subject::Arm(arm) = subject else {
        return Err(Usage("--word needs an arm file; a robot has no discrete actuators".into()));
    };
    let word = text.parse().map_err(|error| Usage(format!("{error}")))?;
    darm_arm::arm::frames::check_word(&word, arm).map_err(|fault| Usage(fault.to_string()))?;
    Ok(word)
}

fn beyond_limits(robot: &darm_robot::robot::Robot, postures: &[Posture]) -> Vec<String> {
    let outside = |index: usize, [low, high]: [f64; 2]| {
        let count = postures.iter().filter_map(|p| p.q.get(index)).filter(|q| **q < low || **q > high).count();
        (count > 0).then_some(count)
    };
    let joints = robot.coordinates().map(|joint| &robot.joints[joint]).enumerate();
    let beyond = joints.filter_map(|(index, joint)| {
        let count = outside(index, joint.limits?)?;
        Some(format!("joint {} is beyond its limits in {count} of {} postures", joint.name, postures.len()))
    });
    beyond.collect()
}

fn read(path: &Path, subject: &Subject) -> anyhow::Result<Vec<Posture>> {
    let table = CsvTable::read(path)?;
    let coordinates = subject.coordinates();
    let columns: Vec<_> = table.header().map(|name| column(name, &coordinates)).collect();
    let given =
        |index| columns.iter().flatten().any(|c| matches!(c, Column::Number(k, Quantity::Position, _) if *k == index));
    if let Some((index, missing)) = coordinates.iter().enumerate().find(|(index, _)| !given(*index)) {
        let unit = missing.unit();
        return Err(table.no_column(format!("{}_{unit} (or q{}_{unit})", missing.name, index + 1)).into());
    }
    let number = |k: usize| columns[k].as_ref().and_then(Column::number);
    if let Some(k) = (1..columns.len()).find(|&k| number(k).is_some() && (0..k).any(|j| number(j) == number(k))) {
        let name = table.header().nth(k).unwrap_or_default();
        return Err(table
            .wrong(CsvFault::Row(format!("{name} gives the same quantity as another column; remove one")))
            .into());
    }
    let mut postures = Vec::new();
    for (index, row) in table.rows().enumerate() {
        let mut posture = Posture { time_s: index as f64, ..Posture::rest(subject) };
        for (at, column) in columns.iter().enumerate() {
            match column {
                Some(Column::Word) => {
                    let word = word_of(row.cell(at), subject);
                    posture.word = word.map_err(|error| row.wrong(at, CsvFault::Row(error.0)))?;
                }
                Some(Column::Time) => posture.time_s = row.number(at)?,
                Some(Column::Number(index, quantity, factor)) => {
                    posture.put(*index, *quantity, row.number(at)? * factor);
                }
                None => {}
            }
        }
        postures.push(posture);
    }
    if postures.is_empty() {
        return Err(table.wrong(CsvFault::Empty { what: "posture" }).into());
    }
    Ok(postures)
}

impl Posture {
    fn put(&mut self, index: usize, quantity: Quantity, number: f64) {
        let numbers = match quantity {
            Quantity::Position => &mut self.q,
            Quantity::Velocity => &mut self.qd,
            Quantity::Acceleration => &mut self.qdd,
            Quantity::Torque => {
                self.torque.resize(self.q.len(), 0.0);
                &mut self.torque
            }
        };
        if let Some(slot) = numbers.get_mut(index) {
            *slot = number;
        }
    }
}

/// Meaning of the column with this name; `None` for other columns.
fn column(header: &str, coordinates: &[Coordinate]) -> Option<Column> {
    if header == "word" {
        return Some(Column::Word);
    }
    if TIMES.contains(&header) {
        return Some(Column::Time);
    }
    ENDINGS.iter().find_map(|(ending, kind, quantity, factor)| {
        let name = header.strip_suffix(ending)?;
        let number = |index: usize| name.strip_prefix('q').is_some_and(|n| n == (index + 1).to_string());
        let index =
            coordinates.iter().enumerate().position(|(k, c)| c.kind == *kind && (c.name == name || number(k)))?;
        Some(Column::Number(index, *quantity, *factor))
    })
}
