//! The measurement that would tell explanations apart: rows of this one, chosen by D-optimality.

use nalgebra::DMatrix;

use crate::measurement_plan::optimal_design::most_informative;
use crate::outcome_signals::{NextMeasurement, NextRow};
use crate::select::robust_fit::pseudo_inverse;
use crate::select::signals::Channels;

/// Rows that are proposed.
const ROWS: usize = 12;
/// Rows that are looked at, at most.
const LOOKED_AT: usize = 3000;
/// What the rows told so far counts by so little, so that new rows are chosen for what these did not tell.
const FLOOR: f64 = 1e-6;

/// Conditions under which one more row tells most of all values of these candidates together.
pub(crate) fn proposal(kind: &Channels, candidates: &[usize]) -> NextMeasurement {
    let indices = kind.indices(candidates);
    let n_axes = kind.sigma.len();
    let information = kind.information(&indices);
    let floor = DMatrix::from_diagonal(&information.diagonal().map(|d| FLOOR * d.max(f64::MIN_POSITIVE)));
    let rows: Vec<usize> =
        (0..kind.groups.training.len()).step_by(kind.groups.training.len().div_ceil(LOOKED_AT).max(1)).collect();
    let columns: Vec<Vec<f64>> = indices.iter().map(|&value| kind.column(value)).collect();
    let measurement =
        |&row: &usize| DMatrix::from_fn(n_axes, indices.len(), |axis, value| columns[value][row * n_axes + axis]);
    let measurements: Vec<DMatrix<f64>> = rows.iter().map(measurement).collect();
    let chosen = most_informative(pseudo_inverse(&(information + floor)), &measurements, ROWS);
    let row = |&k: &usize| {
        let row = kind.groups.training[rows[k]];
        let channels = kind.experiment.channels.iter().map(|(name, values)| (name.clone(), values[row]));
        NextRow { line: kind.experiment.rows[row].line, conditions: channels.collect() }
    };
    let named = candidates.iter().map(|&k| {
        let candidate = &kind.experiment.candidates[k];
        format!("{} at {}", candidate.law, candidate.place)
    });
    NextMeasurement { rows: chosen.iter().map(row).collect(), tells: named.collect::<Vec<_>>().join(" from ") }
}
