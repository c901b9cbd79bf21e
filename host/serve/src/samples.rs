//! What was seen over the last hour, for the plots of pages.

use std::borrow::Cow;
use std::collections::VecDeque;

use serde::Serialize;

use crate::measured::MeasuredView;
use crate::view::BoardView;

/// An hour of twenty looks a second: 4 MB for an arm with four servos.
const KEPT: usize = 72_000;
/// Samples of one answer at most: a page that is opened asks again until it has the hour.
const PIECE: usize = 4_000;

/// A curve.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Series {
    /// The plot that it is in.
    pub(crate) plot: Cow<'static, str>,
    /// Its name there.
    pub(crate) name: String,
    /// The unit of the plot.
    pub(crate) unit: &'static str,
}

/// The last samples, of one curve after the other.
#[derive(Debug, Default)]
pub(crate) struct Samples {
    /// Unix time of each, s.
    times_s: VecDeque<f64>,
    values: Vec<VecDeque<f32>>,
    series: Vec<Series>,
    /// Number of the sample that follows the last one.
    next: u64,
}

/// Some of them, by curve. What was not measured is `null`.
#[derive(Debug, Serialize)]
pub(crate) struct SamplesView {
    series: Vec<Series>,
    /// Number of the first one here; larger than asked where older ones are not kept.
    first: u64,
    /// Number of the sample that follows the last one of all.
    next: u64,
    times_s: Vec<f64>,
    values: Vec<Vec<f32>>,
}

impl Samples {
    /// Takes what was seen at this Unix time.
    pub(crate) fn push(&mut self, now_s: f64, board: &BoardView, measured: Option<&MeasuredView>) {
        if self.series.len() != N_FIXED + board.servos.len() {
            *self = Self { next: self.next, ..Self::new(board.servos.len()) };
        }
        self.times_s.push_back(now_s);
        for (values, value) in self.values.iter_mut().zip(values(board, measured)) {
            values.push_back(value);
        }
        self.next += 1;
        if self.times_s.len() > KEPT {
            self.times_s.pop_front();
            for values in &mut self.values {
                values.pop_front();
            }
        }
    }

    /// The samples from this number on, as many as one answer has.
    pub(crate) fn from(&self, number: u64) -> SamplesView {
        let oldest = self.next - self.times_s.len() as u64;
        let first = number.clamp(oldest, self.next);
        let start = (first - oldest) as usize;
        SamplesView {
            series: self.series.clone(),
            first,
            next: self.next,
            times_s: self.times_s.iter().skip(start).take(PIECE).copied().collect(),
            values: self.values.iter().map(|of| of.iter().skip(start).take(PIECE).copied().collect()).collect(),
        }
    }

    fn new(n_servos: usize) -> Self {
        let fixed = FIXED.map(|(plot, name, unit)| Series { plot: plot.into(), name: name.to_owned(), unit });
        let servos =
            (0..n_servos).map(|index| Series { plot: "Servos".into(), name: format!("servo {index}"), unit: "°" });
        let series: Vec<Series> = fixed.into_iter().chain(servos).collect();
        Self { values: vec![VecDeque::new(); series.len()], series, ..Self::default() }
    }
}

const N_FIXED: usize = 9;
/// Plot, name and unit of the curves that every arm has.
const FIXED: [(&str, &str, &str); N_FIXED] = [
    ("Residual", "x", "mm"),
    ("Residual", "y", "mm"),
    ("Residual", "z", "mm"),
    ("Residual, rotation", "angle", "°"),
    ("Supply of the arm", "supply", "bar"),
    ("Temperature", "arm", "°C"),
    ("Supply of the board", "supply", "V"),
    ("Time that outputs may still be on", "least of all", "%"),
    ("Outputs", "on", ""),
];

/// A value for each curve; what was not measured is not a number.
fn values(board: &BoardView, measured: Option<&MeasuredView>) -> Vec<f32> {
    let residual = measured.and_then(|measured| measured.residual);
    let known = |value: Option<f64>| value.map_or(f32::NAN, |value| value as f32);
    let along = |axis: usize| known(residual.map(|residual| 1e3 * residual.position_m[axis]));
    let angle_rad = residual.map(|residual| residual.rotation_rad.iter().map(|rad| rad * rad).sum::<f64>().sqrt());
    let left = board.outputs.iter().map(|output| 100.0 * output.left_s / output.allowed_s.max(f64::MIN_POSITIVE));
    let on = board.outputs.iter().filter(|output| output.is_on == Some(true)).count();
    let fixed = [
        along(0),
        along(1),
        along(2),
        known(angle_rad.map(f64::to_degrees)),
        known(measured.and_then(|measured| measured.supply_bar)),
        known(measured.and_then(|measured| measured.temperature_c)),
        known(board.quality.supply_v),
        known(left.reduce(f64::min)),
        on as f32,
    ];
    let angle_deg = |has_answered, rad: f32| if has_answered { rad.to_degrees() } else { f32::NAN };
    let servos = board.servos.iter().map(|servo| angle_deg(servo.has_answered, servo.angle_rad));
    fixed.into_iter().chain(servos).collect()
}

#[cfg(test)]
mod tests {
    use super::{KEPT, PIECE, Samples};

    #[test]
    fn the_last_hour_is_kept_and_given_in_pieces() {
        let mut samples = Samples::new(0);
        for number in 0..KEPT + 10 {
            samples.times_s.push_back(number as f64);
            samples.values[0].push_back(number as f32);
            samples.next += 1;
        }
        samples.times_s.drain(..10);
        samples.values[0].drain(..10);
        let first = samples.from(0);
        assert_eq!((first.first, first.times_s.len(), first.values[0][0]), (10, PIECE, 10.0));
        let last = samples.from(samples.next - 3);
        assert_eq!((last.times_s.len(), last.next, last.values[0].len()), (3, (KEPT + 10) as u64, 3));
        assert_eq!(samples.from(u64::MAX).times_s.len(), 0);
    }
}
