//! The measurement that would distinguish explanations: rows of this one, chosen by D-optimality.

use nalgebra::DMatrix;

use crate::least_squares::pseudo_inverse;
use crate::linearise::experiment::Experiment;
use crate::measurement_plan::optimal_design::informative_first;
use crate::outcome::{NextMeasurement, NextRow};
use crate::select::problem::{RegressionProblem as _, Trial};
use crate::select::signals::Signals;

/// Rows that are proposed.
const ROWS: usize = 12;
/// Rows that are looked at, at most.
const LOOKED_AT: usize = 3000;
/// Weight of the information of the rows so far: small, so that new rows are chosen for what these do not determine.
const FLOOR: f64 = 1e-6;

/// The conditions under which one more row is most informative about all values of these candidates together, under the
/// weighting of `best`.
pub(crate) fn proposal(problem: &Signals, best: &Trial<Signals>, candidates: &[usize]) -> NextMeasurement {
    let (weighted, experiment) = (problem.under(best), &problem.experiment);
    let indices = problem.indices(candidates);
    let n_axes = experiment.axes.len();
    let information = weighted.information(&indices);
    let floor = DMatrix::from_diagonal(&information.diagonal().map(|d| FLOOR * d.max(f64::MIN_POSITIVE)));
    let training = &problem.groups.training;
    let rows: Vec<usize> = (0..training.len()).step_by(training.len().div_ceil(LOOKED_AT).max(1)).collect();
    let columns: Vec<Vec<f64>> = indices.iter().map(|&value| weighted.column(value)).collect();
    let measurement =
        |&row: &usize| DMatrix::from_fn(n_axes, indices.len(), |axis, value| columns[value][row * n_axes + axis]);
    let measurements: Vec<DMatrix<f64>> = rows.iter().map(measurement).collect();
    let chosen = informative_first(pseudo_inverse(&(information + floor)), &measurements, ROWS);
    let row = |&k: &usize| next_row(experiment, training[rows[k]]);
    let named =
        candidates.iter().map(|&k| format!("{} at {}", experiment.candidates[k].law, experiment.candidates[k].site));
    NextMeasurement {
        words: Vec::new(),
        conditions: None,
        rows: chosen.iter().map(row).collect(),
        distinguishes: named.collect::<Vec<_>>().join(" from "),
    }
}

/// Rows over all of the measurement, whose repeats show the noise.
pub(crate) fn to_repeat(problem: &Signals) -> NextMeasurement {
    let training = &problem.groups.training;
    let rows = training.iter().step_by(training.len().div_ceil(ROWS).max(1));
    NextMeasurement {
        words: Vec::new(),
        conditions: None,
        rows: rows.map(|&row| next_row(&problem.experiment, row)).collect(),
        distinguishes: "noise from what else may be missing".into(),
    }
}

fn next_row(experiment: &Experiment, row: usize) -> NextRow {
    let conditions = experiment.channels.iter().map(|(name, values)| (name.clone(), values[row])).collect();
    NextRow { line: experiment.rows[row].line, conditions }
}
