//! The curves of a recording for plots: what its columns hold, and the residual.

use std::borrow::Cow;

use darm_measure::Sample;

use crate::measured::Residual;
use crate::samples::Series;

/// Strokes of one plot: as many colours as curves have.
const STROKES_OF_PLOT: usize = 4;
pub(super) const PA_PER_BAR: f64 = 1e5;

/// A curve with a value for each row.
pub(super) struct Curve {
    pub(super) series: Series,
    /// What was not measured is not a number.
    pub(super) values: Vec<f32>,
}

/// Those that have a value. The residual is predicted less measured.
pub(super) fn curves(samples: &[Sample], residuals: &[Option<Residual>], is_planar: bool) -> Vec<Curve> {
    let mut curves = Vec::new();
    let mut add = |plot: Cow<'static, str>, name: String, unit, value: &dyn Fn(usize) -> Option<f64>| {
        let values = (0..samples.len()).map(|row| value(row).map_or(f32::NAN, |value| value as f32));
        let values: Vec<f32> = values.collect();
        if values.iter().any(|value| value.is_finite()) {
            curves.push(Curve { series: Series { plot, name, unit }, values });
        }
    };
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate().take(if is_planar { 2 } else { 3 }) {
        add("Residual".into(), name.into(), "mm", &|row| Some(1e3 * residuals[row]?.position_m[axis]));
    }
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate().skip(if is_planar { 2 } else { 0 }) {
        let name = if is_planar { "angle" } else { name };
        let degrees = |row: usize| Some(residuals[row]?.rotation_rad[axis].to_degrees());
        add("Residual, rotation".into(), name.into(), "°", &degrees);
    }
    add("Supply of the arm".into(), "supply".into(), "bar", &|row| Some(samples[row].supply? / PA_PER_BAR));
    add("Temperature".into(), "arm".into(), "°C", &|row| samples[row].temperature_c);
    add("Load".into(), "at the tool".into(), "kg", &|row| samples[row].load_kg);
    let count = |of: fn(&Sample) -> usize| samples.iter().map(of).max().unwrap_or(0);
    let n_strokes = count(|sample| sample.strokes_s.len());
    for actuator in 0..n_strokes {
        let first = actuator - actuator % STROKES_OF_PLOT;
        let last = (first + STROKES_OF_PLOT).min(n_strokes) - 1;
        let plot = format!("Strokes, actuators {first} to {last}");
        let stroke_ms = |row: usize| Some(1e3 * (*samples[row].strokes_s.get(actuator)?)?);
        add(plot.into(), format!("actuator {actuator}"), "ms", &stroke_ms);
    }
    for servo in 0..count(|sample| sample.servos_rad.len()) {
        let degrees = |row: usize| Some(samples[row].servos_rad.get(servo)?.to_degrees());
        add("Servos".into(), format!("servo {servo}"), "°", &degrees);
    }
    curves
}
