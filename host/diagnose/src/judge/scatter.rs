//! Repeatability: the scatter of rows in which all that the prediction rests on was the very same.

use std::collections::BTreeMap;

use crate::linearise::experiment::{Axis, Experiment};
use crate::outcome::{AxisFigure, Number, Repeatability};

/// Degrees of freedom from which on there is a figure.
const MIN_DOF: usize = 10;
/// Channels that a condition may differ in.
const NOT_A_CONDITION: [&str; 2] = ["time", "temperature"];

/// Root mean square about the mean of each condition; `None` where few rows repeat others.
pub(crate) fn scatter(experiment: &Experiment) -> Option<Repeatability> {
    let conditions = experiment.channels.iter().filter(|(name, _)| !NOT_A_CONDITION.contains(&name.as_str()));
    let conditions: Vec<&Vec<f64>> = conditions.map(|(_, channel)| channel).collect();
    let mut alike: BTreeMap<Vec<u64>, Vec<usize>> = BTreeMap::new();
    for row in 0..experiment.rows.len() {
        // Zero has two signs.
        let key = conditions.iter().map(|channel| (channel[row] + 0.0).to_bits()).collect();
        alike.entry(key).or_default().push(row);
    }
    let dof: usize = alike.values().map(|rows| rows.len() - 1).sum();
    if conditions.is_empty() || dof < MIN_DOF {
        return None;
    }
    let n_axes = experiment.axes.len();
    let square = |axis: usize| {
        let of_rows = |rows: &Vec<usize>| {
            let numbers = || rows.iter().map(|row| experiment.residuals[row * n_axes + axis]);
            let mean = numbers().sum::<f64>() / rows.len() as f64;
            numbers().map(|number| (number - mean).powi(2)).sum::<f64>()
        };
        alike.values().map(of_rows).sum::<f64>() / dof as f64
    };
    let figure =
        |(k, axis): (usize, &Axis)| AxisFigure { axis: axis.name.clone(), value: square(k).sqrt(), unit: axis.unit };
    Some(Repeatability {
        norm: Number { value: (0..experiment.n_norm).map(square).sum::<f64>().sqrt(), unit: experiment.unit() },
        axes: experiment.axes.iter().enumerate().map(figure).collect(),
        dof,
    })
}
