//! Supply and temperature while a table is played, expected from what was measured shortly before.
//!
//! Both drift. What they settle to is right for an arm that is used later; the frames are measured at once.

use darm_arm::arm::{Arm, ZERO_CELSIUS};
use darm_measure::{Run, Sample};

/// An arm, what the sensors measured last, and how long the next table will be played.
pub(super) struct Trend<'r> {
    /// The arm, at the conditions that it has settled to.
    pub(super) arm: &'r Arm,
    /// The measurement, its times since the start of its table.
    pub(super) run: &'r Run,
    /// When that was, on the host's clock.
    pub(super) start_s: f64,
    /// Time from the start of the next table to its end.
    pub(super) next_s: f64,
}

impl Trend<'_> {
    /// The arm at the conditions in the middle of a table that is played now: on the straight line through as much of the end
    /// of the measurement as the table takes. A line is continued for at most that long; later the arm stays as it is.
    pub(super) fn continued(&self, now_s: f64) -> Arm {
        let at_s = now_s - self.start_s + self.next_s / 2.0;
        let end_s = self.run.samples.last().map_or(0.0, |sample| sample.time_s);
        let mut arm = self.arm.clone();
        if at_s - end_s > self.next_s {
            return arm;
        }
        let last = || self.run.samples.iter().filter(|sample| sample.time_s >= end_s - self.next_s);
        let at = |value: fn(&Sample) -> Option<f64>| {
            line(last().filter_map(|sample| Some((sample.time_s - at_s, value(sample)?))))
        };
        arm.model.working_supply = at(|sample| sample.supply).unwrap_or(arm.model.working_supply);
        let temperature_k = at(|sample| sample.temperature_c).map(|celsius| celsius + ZERO_CELSIUS);
        arm.model.working_temperature_k = temperature_k.unwrap_or(arm.model.working_temperature_k);
        arm
    }
}

/// The value at x = 0 of the straight line that fits points best by least squares; `None` without two different x.
fn line(points: impl Iterator<Item = (f64, f64)>) -> Option<f64> {
    let points: Vec<(f64, f64)> = points.collect();
    let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / points.len() as f64;
    let (x, y) = (mean(|point| point.0), mean(|point| point.1));
    let squares: f64 = points.iter().map(|point| (point.0 - x).powi(2)).sum();
    let products: f64 = points.iter().map(|point| (point.0 - x) * (point.1 - y)).sum();
    (squares > 0.0).then(|| y - x * products / squares)
}

#[cfg(test)]
mod tests {
    use darm_arm::arm::Arm;
    use darm_core::se::Pose;
    use darm_measure::{Run, Sample};

    use super::Trend;
    use crate::ArmKind;

    /// An arm that warms by 0.1 K in each second.
    fn warming(arm: &Arm) -> Run {
        let sample = |second: u32| Sample {
            time_s: f64::from(second),
            word: arm.rest(),
            previous: None,
            servos_rad: Vec::new(),
            pose: Pose::identity(),
            supply: None,
            temperature_c: Some(20.0 + 0.1 * f64::from(second)),
            load_kg: None,
            strokes_s: Vec::new(),
            run: 0,
            visit: second,
            held_out: false,
        };
        Run { samples: (0..50).map(sample).collect(), ..Run::default() }
    }

    #[test]
    fn a_drift_is_continued_for_as_long_as_it_was_measured() {
        let arm = ArmKind::Planar.task(1, None).unwrap().base_line;
        let run = warming(&arm);
        let trend = Trend { arm: &arm, run: &run, start_s: 100.0, next_s: 10.0 };
        let soon = trend.continued(150.0).model;
        assert_eq!(soon.working_supply, arm.model.working_supply, "it was not measured");
        assert!((soon.working_temperature_k - 273.15 - 25.5).abs() < 1e-9, "{}", soon.working_temperature_k);
        assert_eq!(trend.continued(160.0), arm, "10 s of measurement say nothing about a table 16 s later");
    }
}
