//! Is there anything beyond the noise, and what does it depend on?
//!
//! The residual is regressed on one variable at a time, with an offset: the digit of an actuator, whether it stayed
//! (memory of the word before), supply, temperature, time, servo position, and the word as a whole. Each is an F test
//! on all axes together; chances are multiplied by the number of variables. Rows that fit nothing are drawn in first.

use darm_core::actuator::MAX_STATES;
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::fit::{pseudo_inverse, weights};
use super::noise::Noise;
use super::observation::Observations;
use super::significance::{STRUCTURE_LEVEL, f_test};
use crate::arm::Arm;
use crate::measurement::Run;

/// What there is beyond the noise.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Structure {
    /// Mean square of the residual over that of repeats; `None` without repeats.
    pub ratio: Option<f64>,
    /// Chance that this is noise; `None` without repeats.
    pub p: Option<f64>,
    /// Whether there is more than noise.
    pub beyond_noise: bool,
    /// What the residual depends on, the strongest first.
    pub depends_on: Vec<Dependence>,
}

/// A variable that the residual depends on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Dependence {
    /// The variable.
    pub variable: String,
    /// Share of the residual's mean square that it takes up.
    pub share: f64,
    /// Chance of such a share where there is none, times the number of variables.
    pub p: f64,
}

/// The structure in the residuals of some rows, after `fitted` values were fitted to them.
pub fn structure(
    arm: &Arm,
    run: &Run,
    observations: &Observations,
    residuals: &[f64],
    fitted: usize,
    noise: Option<&Noise>,
) -> Structure {
    let n_axes = observations.n_axes();
    let drawn_in = drawn_in(residuals, n_axes);
    let dof = drawn_in.len().saturating_sub(fitted);
    let ratio = drawn_in.iter().map(|r| r * r).sum::<f64>() / dof.max(1) as f64;
    let p = noise.map(|noise| f_test(ratio, dof, noise.dof * n_axes));
    let tested = dependences(arm, run, observations, &drawn_in);
    let depends_on: Vec<Dependence> = tested.into_iter().filter(|d| d.p < STRUCTURE_LEVEL).collect();
    let beyond_noise = p.is_some_and(|p| p < STRUCTURE_LEVEL) || !depends_on.is_empty();
    Structure { ratio: noise.map(|_| ratio), p, beyond_noise, depends_on }
}

/// The residuals with those that are far off brought near.
fn drawn_in(residuals: &[f64], n_axes: usize) -> Vec<f64> {
    let weights = weights(residuals, n_axes);
    residuals.iter().enumerate().map(|(k, r)| r * weights[k / n_axes]).collect()
}

fn dependences(arm: &Arm, run: &Run, observations: &Observations, residuals: &[f64]) -> Vec<Dependence> {
    let variables = variables(arm, run, observations);
    let n = variables.len() as f64;
    let mut tested: Vec<Dependence> = variables
        .into_iter()
        .filter_map(|(variable, columns)| {
            let (share, p) = dependence(&columns, residuals, observations.n_axes())?;
            Some(Dependence { variable, share, p: (p * n).min(1.0) })
        })
        .collect();
    tested.sort_by(|a, b| b.share.total_cmp(&a.share));
    tested
}

/// The variables by name, each as columns with one number a row.
fn variables(arm: &Arm, run: &Run, observations: &Observations) -> Vec<(String, Vec<Vec<f64>>)> {
    let rows = &observations.rows;
    let of_rows = |value: &dyn Fn(&super::observation::Row) -> f64| rows.iter().map(value).collect::<Vec<f64>>();
    let mut all = Vec::new();
    for k in 0..arm.n_actuators() {
        let name = arm.actuator_name(k);
        let states = 1..arm.model.chain.n_states(k) as u8;
        let digit = |state| of_rows(&|row| f64::from(u8::from(observations.condition(row).word.digit(k) == state)));
        all.push((format!("digit of {name}"), states.map(digit).collect()));
        let stayed = of_rows(&|row| {
            let condition = observations.condition(row);
            let stays = condition.previous.is_some_and(|previous| previous.digit(k) == condition.word.digit(k));
            f64::from(u8::from(stays))
        });
        let digits: Vec<u8> = rows.iter().map(|row| observations.condition(row).word.digit(k)).collect();
        let stayed = beside_digit(&stayed, &digits);
        all.push((format!("word before, at {name}"), vec![stayed]));
    }
    for k in 0..arm.n_servos() {
        all.push((format!("position of servo {}", k + 1), vec![of_rows(&|row| observations.condition(row).servos[k])]));
    }
    all.push(("supply".into(), vec![of_rows(&|row| observations.condition(row).supply)]));
    all.push(("temperature".into(), vec![of_rows(&|row| observations.condition(row).temperature_k)]));
    all.push(("time".into(), vec![of_rows(&|row| run.samples[row.sample].time_s)]));
    let word = |group| of_rows(&|row| f64::from(u8::from(row.group == group)));
    all.push(("word".into(), (1..observations.n_groups).map(word).collect()));
    all
}

/// A variable less its mean among the rows with the same digit, and of the other sign where the digit is 0: actuators
/// come off their two stops in opposite directions.
fn beside_digit(values: &[f64], digits: &[u8]) -> Vec<f64> {
    let mean = |digit: u8| {
        let same = || values.iter().zip(digits).filter(|(_, other)| **other == digit);
        same().map(|(value, _)| value).sum::<f64>() / same().count().max(1) as f64
    };
    let means: Vec<f64> = (0..MAX_STATES as u8).map(mean).collect();
    let sign = |digit: u8| if digit == 0 { 1.0 } else { -1.0 };
    values.iter().zip(digits).map(|(value, &digit)| sign(digit) * (value - means[usize::from(digit)])).collect()
}

/// Share of the residual that the columns take up beside an offset, and the chance of it; `None` where the columns are
/// constant or too many.
fn dependence(columns: &[Vec<f64>], residuals: &[f64], n_axes: usize) -> Option<(f64, f64)> {
    let n = residuals.len() / n_axes;
    let centred: Vec<Vec<f64>> =
        columns.iter().map(|column| centre(column)).filter(|c| c.iter().any(|x| x.abs() > 1e-12)).collect();
    let k = centred.len();
    if k == 0 || n < k + 2 {
        return None;
    }
    let design = DMatrix::from_fn(n, k, |row, column| centred[column][row]);
    let inverse = pseudo_inverse(&(design.transpose() * &design));
    let (mut whole, mut taken) = (0.0, 0.0);
    for axis in 0..n_axes {
        let y = centre(&residuals.iter().skip(axis).step_by(n_axes).copied().collect::<Vec<_>>());
        let y = DVector::from_vec(y);
        let projected = design.transpose() * &y;
        whole += y.norm_squared();
        taken += projected.dot(&(&inverse * &projected));
    }
    let (dof, rest_dof) = (k * n_axes, (n - 1 - k) * n_axes);
    let rest = (whole - taken).max(f64::MIN_POSITIVE);
    Some((taken / whole, f_test(taken / dof as f64 / (rest / rest_dof as f64), dof, rest_dof)))
}

fn centre(values: &[f64]) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter().map(|value| value - mean).collect()
}
