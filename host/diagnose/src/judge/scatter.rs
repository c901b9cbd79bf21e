//! Repeatability of signals: the scatter of rows in which all that the prediction rests on was the very same; without such
//! rows, of unfiltered signals along a motion, how far rows stand out between those beside them.
//!
//! Repeats that differ by more than what changes from one condition to the next are no noise: something happened between
//! them. Numbers that are rounded to coarse steps scatter less than they are off.

use std::collections::BTreeMap;

use crate::judge::lack_of_fit::AxisLeft;
use crate::judge::regression::of_axis;
use crate::linearise::experiment::{Axis, Experiment};
use crate::outcome::{AxisFigure, Number, Repeatability, RepeatedIn};
use crate::prepare::repeatability::{MEDIAN_OF_NORMAL, MIN_DOF};
use crate::prepare::resolution;
use darm_measure::median;

/// Channels that a condition may differ in.
const NOT_A_CONDITION: [&str; 2] = ["time", "temperature"];
/// A repeat this many standard deviations off the others is a blunder: noise is so once in 10⁹.
const BLUNDER: f64 = 6.0;
/// Variance of r₁ − (r₀ + r₂)/2 of independent r, in units of theirs.
const BETWEEN_NEIGHBOURS: f64 = 1.5;
/// Rows follow a motion where what was measured differs from the mean of the rows before and after by less than this share of how
/// much it varies: of postures in any order it differs as much.
const MOTION: f64 = 0.5;
/// Such differences of successive rows have this part of a degree of freedom each: 1/(1 + 2·(4/9 + 1/36)).
const DOF_OF_DIFFERENCE: f64 = 18.0 / 35.0;

/// Correlation of the deviations of successive repeats, of different conditions, from which on they are no noise, and how many
/// standard errors it is above zero.
const MIN_CORRELATION: f64 = 0.3;
const MIN_ERRORS: f64 = 4.5;

/// The noise of signals.
pub(crate) struct Scatter {
    /// As it is reported.
    pub(crate) figure: Repeatability,
    /// Of neighbouring rows how far each is off the others, in units in which it has the variance of the noise: axis by axis.
    off_neighbours: Vec<Vec<f64>>,
}

impl Scatter {
    /// What is left of each axis that proves something beside the noise: on the rows that fits see, `fitted` values of which
    /// were fitted, and on those that they do not.
    pub(crate) fn left(&self, experiment: &Experiment, after: &[f64], fitted: usize) -> Vec<AxisLeft> {
        let n_axes = experiment.axes.len();
        let of_rows = [experiment.training_rows(after), experiment.held_out_rows(after)];
        let axes = || (0..n_axes).filter(|&axis| experiment.axes[axis].proves());
        let left = |axis: usize, k: usize| {
            let (rows, fitted) = (of_axis(&of_rows[k], n_axes, axis), [fitted as f64 / n_axes as f64, 0.0][k]);
            match self.off_neighbours.get(axis) {
                Some(off) if !off.is_empty() => AxisLeft::over_sample(axis, &rows, fitted, off, self.figure.dof),
                _ => AxisLeft::over_noise(axis, &rows, fitted, self.figure.axes[axis].value.powi(2), self.figure.dof),
            }
        };
        [0, 1].iter().flat_map(|&k| axes().filter_map(move |axis| left(axis, k)).collect::<Vec<_>>()).collect()
    }
}

/// The scatter of repeated rows; of few such rows, and of unfiltered ones, that between neighbours. `after` are the
/// residuals of all rows with the effects selected.
pub(crate) fn scatter(experiment: &Experiment, after: &[f64], is_filtered: bool) -> Option<Scatter> {
    repeated(experiment).or_else(|| if is_filtered { None } else { between_neighbours(experiment, after) })
}

/// Root mean square about the mean of each condition; `None` where few rows repeat others.
fn repeated(experiment: &Experiment) -> Option<Scatter> {
    let conditions = experiment.channels.iter().filter(|(name, _)| !NOT_A_CONDITION.contains(&name.as_str()));
    let conditions: Vec<&Vec<f64>> = conditions.map(|(_, channel)| channel).collect();
    let mut alike: BTreeMap<Vec<u64>, Vec<usize>> = BTreeMap::new();
    for row in (0..experiment.rows.len()).filter(|&row| !experiment.rows[row].held_out) {
        // Zero has two signs.
        let key = conditions.iter().map(|channel| (channel[row] + 0.0).to_bits()).collect();
        alike.entry(key).or_default().push(row);
    }
    let (residuals, n_axes) = (&experiment.residuals, experiment.axes.len());
    if experiment.kind.is_of_tool() {
        leave_blunders(residuals, n_axes, alike.values_mut());
    }
    let dof: usize = alike.values().map(|rows| rows.len().saturating_sub(1)).sum();
    if conditions.is_empty() || dof < MIN_DOF {
        return None;
    }
    let of = |rows: &Vec<usize>, axis| squares_of(residuals, n_axes, rows, axis);
    let square = |axis| alike.values().map(|rows| of(rows, axis)).sum::<f64>() / dof as f64;
    let without_steps = |axis| square(axis) * share_without_steps(&of_axis(residuals, n_axes, axis), alike.values());
    let squares = (0..n_axes).map(|axis| with_rounding(experiment, axis, without_steps(axis))).collect();
    Some(Scatter { figure: figure(experiment, squares, dof, RepeatedIn::Rows), off_neighbours: Vec::new() })
}

/// What share of the scatter of repeats remains without what successive conditions have in common: all of it, unless
/// something changed between the repeats of many conditions at once, such as another robot that repeats a motion.
fn share_without_steps<'a>(of: &[f64], alike: impl Iterator<Item = &'a Vec<usize>>) -> f64 {
    let mut deviations: BTreeMap<usize, (usize, f64)> = BTreeMap::new();
    for (condition, rows) in alike.filter(|rows| rows.len() > 1).enumerate() {
        let mean = rows.iter().map(|&row| of[row]).sum::<f64>() / rows.len() as f64;
        deviations.extend(rows.iter().map(|&row| (row, (condition, of[row] - mean))));
    }
    let deviations: Vec<(usize, f64)> = deviations.into_values().collect();
    let pairs = deviations.windows(2).filter(|pair| pair[0].0 != pair[1].0);
    let [both, squares, n] = pairs.fold([0.0; 3], |[both, squares, n], pair| {
        let (a, b) = (pair[0].1, pair[1].1);
        [both + a * b, squares + 0.5 * (a * a + b * b), n + 1.0]
    });
    let correlation = both / squares.max(f64::MIN_POSITIVE);
    // The deviations of a condition sum to zero: two repeats are one number.
    let errors = correlation * (0.5 * n).sqrt();
    if correlation > MIN_CORRELATION && errors > MIN_ERRORS { 1.0 - correlation.min(1.0) } else { 1.0 }
}

/// A mean square of an axis with that of rounding, where what was measured is rounded to steps that it does not show.
fn with_rounding(experiment: &Experiment, axis: usize, square: f64) -> f64 {
    let Some(measured) = &experiment.measured else { return square };
    let step = resolution::step(of_axis(measured, experiment.axes.len(), axis));
    resolution::with_rounding(square, resolution::rounding(step))
}

/// Leaves the rows that are farther off the median of their condition than noise ever is, as far as the median of the differences
/// of successive ones says how large that is: blunders of an instrument, which would be taken for its noise.
fn leave_blunders<'a>(of: &[f64], n_axes: usize, alike: impl Iterator<Item = &'a mut Vec<usize>>) {
    let mut repeated: Vec<&mut Vec<usize>> = alike.filter(|rows| rows.len() > 1).collect();
    let limits: Vec<f64> = (0..n_axes)
        .map(|axis| {
            let pairs = repeated.iter().flat_map(|rows| rows.windows(2));
            let apart = pairs.map(|pair| (of[pair[1] * n_axes + axis] - of[pair[0] * n_axes + axis]).abs());
            // Rounded numbers may have no difference.
            let sigma = median(apart).map_or(0.0, |apart| apart / MEDIAN_OF_NORMAL / 2f64.sqrt());
            if sigma > 0.0 { BLUNDER * sigma } else { f64::INFINITY }
        })
        .collect();
    for rows in &mut repeated {
        let middle = |axis: usize| median(rows.iter().map(|row| of[row * n_axes + axis])).expect("there are rows");
        let middles: Vec<f64> = (0..n_axes).map(middle).collect();
        let is_near = |axis: usize, row: usize| (of[row * n_axes + axis] - middles[axis]).abs() < limits[axis];
        rows.retain(|row| (0..n_axes).all(|axis| is_near(axis, *row)));
    }
}

/// The sum of the squares of an axis of some rows about their mean, in the unit of the axis squared.
fn squares_of(of: &[f64], n_axes: usize, rows: &[usize], axis: usize) -> f64 {
    let numbers = || rows.iter().map(|row| of[row * n_axes + axis]);
    let mean = numbers().sum::<f64>() / rows.len() as f64;
    numbers().map(|number| (number - mean).powi(2)).sum::<f64>()
}

/// By the median of how far each row is off the mean of its neighbours, so that jumps do not count.
fn between_neighbours(experiment: &Experiment, after: &[f64]) -> Option<Scatter> {
    // Postures in which a tool is measured follow each other in any order.
    if experiment.kind.is_of_tool() {
        return None;
    }
    let (rows, n_axes) = (&experiment.rows, experiment.axes.len());
    let is_inside = |k: &usize| {
        let three = &rows[k - 1..=k + 1];
        three.iter().all(|row| row.series == rows[*k].series && !row.held_out)
    };
    let inside: Vec<usize> = (1..rows.len().saturating_sub(1)).filter(is_inside).collect();
    let dof = (inside.len() as f64 * DOF_OF_DIFFERENCE) as usize;
    if dof < MIN_DOF {
        return None;
    }
    let off = |of: &[f64], axis: usize| -> Vec<f64> {
        let at = |row: usize| of[row * n_axes + axis];
        let off = |&row: &usize| (at(row) - 0.5 * (at(row - 1) + at(row + 1))) / BETWEEN_NEIGHBOURS.sqrt();
        inside.iter().map(off).collect()
    };
    let square = |off: &[f64]| (median(off.iter().map(|off| off.abs())).unwrap_or(0.0) / MEDIAN_OF_NORMAL).powi(2);
    let measured = experiment.measured.as_ref()?;
    let all: Vec<usize> = (0..rows.len()).collect();
    let varies = |axis: usize| squares_of(measured, n_axes, &all, axis) / rows.len() as f64;
    let sum = |of: &dyn Fn(usize) -> f64| (0..experiment.n_norm).map(of).sum::<f64>();
    let is_motion = sum(&|axis| square(&off(measured, axis))) < MOTION * MOTION * sum(&varies);
    if !is_motion {
        return None;
    }
    let mut off_neighbours: Vec<Vec<f64>> = (0..n_axes).map(|axis| off(after, axis)).collect();
    let mut squares = Vec::new();
    for (axis, off) in off_neighbours.iter_mut().enumerate() {
        let own = square(off);
        let rounded = with_rounding(experiment, axis, own);
        if rounded > own {
            // Numbers that stay on one step are nearer to each other than they are right.
            off.clear();
        }
        squares.push(rounded);
    }
    Some(Scatter { figure: figure(experiment, squares, dof, RepeatedIn::Neighbours), off_neighbours })
}

/// The figure of these mean squares of the axes.
fn figure(experiment: &Experiment, squares: Vec<f64>, dof: usize, repeated_in: RepeatedIn) -> Repeatability {
    let axis =
        |(axis, square): (&Axis, &f64)| AxisFigure { axis: axis.name.clone(), value: square.sqrt(), unit: axis.unit };
    let norm = squares.iter().take(experiment.n_norm).sum::<f64>().sqrt();
    Repeatability {
        norm: Number::new(norm, experiment.unit()),
        axes: experiment.axes.iter().zip(&squares).map(axis).collect(),
        dof,
        repeated_in,
    }
}
