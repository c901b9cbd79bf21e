//! What the tool carries: each number of the column `payload` but 0 is a body that is fixed to the last link in the rows which
//! have this number.
//!
//! Its ten inertial parameters are in the frame of that link, as those of the link itself; the columns are the link's, and zero in
//! the other rows. What is carried in all rows cannot be distinguished from the link, and is named as a part of it. A model that has the effects of a payload predicts them in the rows of a log with its number, and nowhere else.

use std::collections::BTreeSet;

use darm_robot::robot::Robot;

use super::Motion;
use crate::effect::{Place, Site};
use crate::linearise::bodies;
use crate::linearise::experiment::{BodyCandidate, Candidate};
use crate::linearise::model_effects::{ModelEffect, PAYLOAD};
use crate::prepare::groups::SignalRow;
use crate::prepare::signals::{PrepareError, Prepared};

/// The number of what is carried in each row; all 0 without the column.
pub(super) fn carried(data: &Prepared) -> Result<Vec<u32>, PrepareError> {
    let Some(numbers) = data.unfiltered(PAYLOAD) else { return Ok(vec![0; data.rows.len()]) };
    let number = |(number, row): (f64, &SignalRow)| {
        let is_number = number.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&number);
        is_number.then_some(number as u32).ok_or_else(|| PrepareError::Row {
            line: row.line,
            what: format!("the payload is {number}; give 0 for none, and 1, 2, … for each body that the tool carries"),
        })
    };
    numbers.into_iter().zip(&data.rows).map(number).collect()
}

/// The candidates of all payloads of a log and of a model, each with its body; they are numbered behind the links.
///
/// `columns` are those of the ten parameters of each link, rows × joints.
pub(super) fn candidates(
    robot: &Robot,
    motion: &Motion,
    known: &[ModelEffect],
    columns: &[[Vec<f64>; 10]],
) -> Result<Vec<(Candidate, BodyCandidate)>, PrepareError> {
    // What is there in all rows is no other body than the last link.
    let of_log = motion.payload.iter().copied().filter(|number| *number != motion.payload[0]);
    let first = of_log.clone().next().and(motion.payload.first().copied());
    let of_model = known.iter().filter_map(ModelEffect::payload);
    let all: BTreeSet<u32> = of_log.chain(first).chain(of_model).filter(|number| *number != 0).collect();
    if all.is_empty() {
        return Ok(Vec::new());
    }
    let link = robot.tool().and_then(|tool| tool.joint).ok_or_else(|| {
        let what =
            "the robot has no end that is its tool, so what carries the payload is not known; leave the column out";
        PrepareError::Nothing(what.into())
    })?;
    let body = |(k, &number): (usize, &u32)| {
        let columns = columns[link].each_ref().map(|column| in_rows_of(number, motion, column));
        let site = Site::new(Place::Payload(number), format!("{PAYLOAD} {number}"));
        bodies::carrying(robot.joints.len() + k, site, &[0.0; 10], robot.mass(), columns)
    };
    Ok(all.iter().enumerate().map(body).collect())
}

/// A column of rows × joints, zero in the rows in which something else is carried.
fn in_rows_of(number: u32, motion: &Motion, column: &[f64]) -> Vec<f64> {
    let n = column.len() / motion.payload.len().max(1);
    let of = |(at, slope): (usize, &f64)| if motion.payload[at / n] == number { *slope } else { 0.0 };
    column.iter().enumerate().map(of).collect()
}
