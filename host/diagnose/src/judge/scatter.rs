//! Repeatability: the scatter of rows in which all that the prediction rests on was the very same.

use std::collections::BTreeMap;

use crate::linearise::experiment::Experiment;
use crate::outcome_signals::Number;

/// Repeats less conditions from which on there is a figure.
const LEAST: usize = 10;
/// Channels that a condition may differ in.
const NOT_A_CONDITION: [&str; 2] = ["time", "temperature"];

/// Root mean square of the norm about the mean of each condition; `None` where few rows repeat others.
pub(crate) fn scatter(experiment: &Experiment) -> Option<Number> {
    let conditions = experiment.channels.iter().filter(|(name, _)| !NOT_A_CONDITION.contains(&name.as_str()));
    let conditions: Vec<&Vec<f64>> = conditions.map(|(_, channel)| channel).collect();
    let mut alike: BTreeMap<Vec<u64>, Vec<usize>> = BTreeMap::new();
    for row in 0..experiment.rows.len() {
        // Zero has two signs.
        let key = conditions.iter().map(|channel| (channel[row] + 0.0).to_bits()).collect();
        alike.entry(key).or_default().push(row);
    }
    let repeats: usize = alike.values().map(|rows| rows.len() - 1).sum();
    let n_axes = experiment.axes.len();
    let squares = |rows: &Vec<usize>| -> f64 {
        let of_axis = |axis: usize| {
            let numbers = || rows.iter().map(|row| experiment.residuals[row * n_axes + axis]);
            let mean = numbers().sum::<f64>() / rows.len() as f64;
            numbers().map(|number| (number - mean).powi(2)).sum::<f64>()
        };
        (0..experiment.n_norm).map(of_axis).sum()
    };
    let value = (alike.values().map(squares).sum::<f64>() / repeats.max(1) as f64).sqrt();
    let unit = experiment.axes.first().map_or("", |axis| axis.unit).into();
    (!conditions.is_empty() && repeats >= LEAST).then_some(Number { value, unit })
}
