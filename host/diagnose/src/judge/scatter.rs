//! Repeatability of signals: the scatter of rows in which all that the prediction rests on was the very same; without such
//! rows, of unfiltered signals along a motion, how far rows stand out between those beside them.

use std::collections::BTreeMap;

use crate::linearise::experiment::{Axis, Experiment};
use crate::measurement::median;
use crate::outcome::{AxisFigure, Number, Repeatability, RepeatedIn};
use crate::prepare::repeatability::{MEDIAN_OF_NORMAL, MIN_DOF};

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

/// The scatter of repeated rows; of few such rows, and of unfiltered ones, that between neighbours. `after` are the
/// residuals of all rows with the effects selected.
pub(crate) fn scatter(experiment: &Experiment, after: &[f64], is_filtered: bool) -> Option<Repeatability> {
    repeated(experiment).or_else(|| if is_filtered { None } else { between_neighbours(experiment, after) })
}

/// Root mean square about the mean of each condition; `None` where few rows repeat others.
fn repeated(experiment: &Experiment) -> Option<Repeatability> {
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
    Some(figure(experiment, (0..experiment.axes.len()).map(square).collect(), dof, RepeatedIn::Rows))
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
fn between_neighbours(experiment: &Experiment, after: &[f64]) -> Option<Repeatability> {
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
    let square = |of: &[f64], axis: usize| {
        let at = |row: usize| of[row * n_axes + axis];
        let off = inside.iter().map(|&row| (at(row) - 0.5 * (at(row - 1) + at(row + 1))).abs());
        (median(off).expect("degrees of freedom come from rows inside") / MEDIAN_OF_NORMAL).powi(2) / BETWEEN_NEIGHBOURS
    };
    let measured = experiment.measured.as_ref()?;
    let all: Vec<usize> = (0..rows.len()).collect();
    let varies = |axis: usize| squares_of(measured, n_axes, &all, axis) / rows.len() as f64;
    let sum = |of: &dyn Fn(usize) -> f64| (0..experiment.n_norm).map(of).sum::<f64>();
    let is_motion = sum(&|axis| square(measured, axis)) < MOTION * MOTION * sum(&varies);
    let squares = (0..n_axes).map(|axis| square(after, axis)).collect();
    is_motion.then(|| figure(experiment, squares, dof, RepeatedIn::Neighbours))
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
