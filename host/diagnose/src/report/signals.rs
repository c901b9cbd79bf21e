//! What a report shows of signals: errors, outliers and points for plots.

use crate::judge::far_rows::far_rows_of_signals;
use crate::judge::held_out::HeldOut;
use crate::judge::selected::SelectedSignals;
use crate::least_squares::size;
use crate::linearise::experiment::{Axis, Experiment};
use crate::outcome::{AxisFigure, BeforeAfter, ErrorFigure, Errors, Number, Outlier, Point, Rows};
use crate::prepare::groups::SignalRow;
use crate::report::Summary;
use crate::select::problem::RegressionProblem as _;
use darm_measure::{root_mean_square, without_farthest};

/// Rows that are listed or plotted at most.
const MAX_ROWS: usize = 4000;

/// What a report shows of the rows; `pooled` has the held-out residuals of other searches.
pub(crate) fn summary(selected: &SelectedSignals, pooled: Option<&HeldOut>, seed: u64) -> Summary {
    let (problem, experiment) = (&selected.problem, &selected.problem.experiment);
    let after = experiment.at(&selected.best.fit.values);
    let n_held_out = pooled.map_or(experiment.held_out_rows(&after).len(), |pooled| pooled.after.len());
    Summary {
        kind: experiment.kind,
        model: None,
        rows: Rows { train: problem.groups.training.len(), held_out: n_held_out / experiment.axes.len() },
        held_out: selected.held_out.clone(),
        is_cross_validated: false,
        left_out: problem.groups.left_out,
        error: BeforeAfter {
            before: errors(experiment, &experiment.residuals, pooled.map(|pooled| &pooled.before[..])),
            after: errors(experiment, &after, pooled.map(|pooled| &pooled.after[..])),
        },
        other_reading: selected.agreement.other_reading(),
        outliers: outliers(selected),
        selection_path: selected.path.clone(),
        condition: None,
        points: points(experiment, &after),
        findings: selected.findings.clone(),
        rejected: Vec::new(),
        seed,
    }
}

fn errors(experiment: &Experiment, residuals: &[f64], held_out: Option<&[f64]>) -> Errors {
    let own = experiment.held_out_rows(residuals);
    let zero = Number::new(0.0, experiment.unit());
    let empty = || ErrorFigure { axes: Vec::new(), norm: zero, largest: zero, without_farthest: zero };
    Errors {
        train: figure(experiment, &experiment.training_rows(residuals)).unwrap_or_else(empty),
        held_out: figure(experiment, held_out.unwrap_or(&own)),
    }
}

/// Root mean squares of rows × axes; `None` without rows.
fn figure(experiment: &Experiment, residuals: &[f64]) -> Option<ErrorFigure> {
    let axis = |(k, axis): (usize, &Axis)| {
        let value = experiment.mean_square(residuals, k).sqrt();
        AxisFigure { axis: axis.name.clone(), value, unit: axis.unit }
    };
    let norms: Vec<f64> = residuals.chunks(experiment.axes.len()).map(|row| size(&row[..experiment.n_norm])).collect();
    Some(ErrorFigure {
        norm: Number::new(experiment.norm(residuals)?, experiment.unit()),
        axes: experiment.axes.iter().enumerate().map(axis).collect(),
        largest: Number::new(norms.iter().copied().fold(0.0, f64::max), experiment.unit()),
        without_farthest: Number::new(root_mean_square(&without_farthest(norms)), experiment.unit()),
    })
}

fn outliers(selected: &SelectedSignals) -> Vec<Outlier> {
    let (problem, weighted) = (&selected.problem, selected.problem.under(&selected.best));
    let (n_axes, n_norm) = (problem.experiment.axes.len(), problem.experiment.n_norm);
    let residuals = weighted.training_residuals(&selected.best.fit);
    let outlier = |(row, sigmas): (usize, f64)| {
        let scaled = residuals[row * n_axes..].iter().zip(&weighted.weighting.sigma).take(n_norm);
        let squares = scaled.map(|(r, s)| (r * s).powi(2));
        let line = problem.experiment.rows[problem.groups.training[row]].line;
        Outlier { line, error: Number::new(squares.sum::<f64>().sqrt(), problem.experiment.unit()), sigmas }
    };
    far_rows_of_signals(&residuals, n_axes).into_iter().take(MAX_ROWS).map(outlier).collect()
}

fn points(experiment: &Experiment, after: &[f64]) -> Vec<Point> {
    let n_axes = experiment.axes.len();
    let every = experiment.rows.len().div_ceil(MAX_ROWS).max(1);
    let point = |(k, row): (usize, &SignalRow)| Point {
        time_s: row.time_s,
        held_out: row.held_out,
        before: experiment.residuals[k * n_axes..(k + 1) * n_axes].to_vec(),
        after: after[k * n_axes..(k + 1) * n_axes].to_vec(),
        visit: None,
    };
    experiment.rows.iter().enumerate().step_by(every).map(point).collect()
}
