//! Joins visits and pictures by time: one sample for each visit that the board completed and the camera saw.

use darm::measurement::Sample;
use darm_core::real::Vec3;
use darm_core::se::{Pose, Twist};

use crate::commands::camera::{BAR, Picture};
use crate::commands::visits::{Rest, Visits};

/// The board ends a program at most two ticks before its time.
const TICK_S: f64 = 2e-3;

/// A moment of the program, and how the camera's clock stood to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Mark {
    /// After row 0 went out, on the board's clock.
    pub(crate) program_s: f64,
    /// Unix time less the time of the program.
    pub(crate) offset_s: f64,
    /// How far that may be wrong.
    pub(crate) uncertainty_s: f64,
}

/// The samples, their times after the start of the program; visits that the program did not complete, or that the
/// camera did not surely see, have none.
pub(crate) fn join(visits: &Visits, marks: &[Mark], pictures: &[Picture]) -> Vec<Sample> {
    let ended_s = marks.last().map_or(0.0, |mark| mark.program_s);
    let complete = visits.rests.iter().enumerate().take_while(|(_, rest)| rest.to_s <= ended_s + TICK_S);
    let mut samples = Vec::new();
    for (visit, rest) in complete {
        let (from_unix_s, to_unix_s) = surely_within(marks, rest);
        let seen = between(pictures, from_unix_s, to_unix_s);
        if !seen.is_empty() {
            let sample = sample(rest, visit, seen);
            samples.push(Sample { time_s: rest.from_s + sample.time_s - from_unix_s, ..sample });
        }
    }
    samples
}

/// How far the board's clock and the camera's have departed from each other during the program.
pub(crate) fn departure_s(marks: &[Mark]) -> f64 {
    let offsets = || marks.iter().map(|mark| mark.offset_s);
    (offsets().fold(f64::MIN, f64::max) - offsets().fold(f64::MAX, f64::min)).max(0.0)
}

/// The span of Unix time in which the arm rests there for sure, though the board's clock may run unevenly: the latest
/// start and the earliest end by any of the marks around it.
fn surely_within(marks: &[Mark], rest: &Rest) -> (f64, f64) {
    let first = marks.partition_point(|mark| mark.program_s <= rest.from_s).saturating_sub(2);
    let last = (marks.partition_point(|mark| mark.program_s < rest.to_s) + 2).min(marks.len());
    let around = marks.get(first..last).unwrap_or_default();
    let latest = around.iter().map(|mark| mark.offset_s + mark.uncertainty_s).fold(f64::MIN, f64::max);
    let earliest = around.iter().map(|mark| mark.offset_s - mark.uncertainty_s).fold(f64::MAX, f64::min);
    (rest.from_s + latest, rest.to_s + earliest)
}

/// The pictures of a span; a camera sends them in order of time.
fn between(pictures: &[Picture], from_s: f64, to_s: f64) -> &[Picture] {
    let from = pictures.partition_point(|picture| picture.time_s < from_s);
    let to = pictures.partition_point(|picture| picture.time_s < to_s);
    pictures.get(from..to).unwrap_or_default()
}

fn sample(rest: &Rest, visit: usize, seen: &[Picture]) -> Sample {
    Sample {
        time_s: mean(seen.iter().map(|picture| picture.time_s)).unwrap_or_default(),
        word: rest.word,
        previous: Some(rest.previous),
        servos_rad: rest.servos_rad.clone(),
        pose: mean_pose(seen),
        supply: mean(seen.iter().filter_map(|picture| picture.supply_bar)).map(|bar| BAR * bar),
        temperature_c: mean(seen.iter().filter_map(|picture| picture.temperature_c)),
        run: 0,
        visit: visit as u32,
        held_out: rest.held_out,
    }
}

/// The mean of poses that are close together: of their twists from the first.
fn mean_pose(seen: &[Picture]) -> Pose<f64> {
    let Some(first) = seen.first() else { return Pose::identity() };
    let twists = seen.iter().map(|picture| first.pose.to(&picture.pose).log());
    let count = seen.len() as f64;
    let sum = twists.fold(Twist { angular: Vec3::zeros(), linear: Vec3::zeros() }, |sum, twist| Twist {
        angular: sum.angular + twist.angular / count,
        linear: sum.linear + twist.linear / count,
    });
    first.pose * Pose::exp(&sum)
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0u32), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

#[cfg(test)]
mod tests {
    use darm_core::se::{Pose, Pose2};
    use darm_core::units::ModelHash;

    use super::{Mark, join, surely_within};
    use crate::commands::camera::Picture;
    use crate::commands::visits::{Rest, Visits};

    fn rest(from_s: f64, to_s: f64) -> Rest {
        let word = "01".parse().unwrap();
        Rest { label: "A".into(), from_s, to_s, row: 0, word, previous: word, servos_rad: vec![], held_out: false }
    }

    fn picture(time_s: f64, x_m: f64, angle_rad: f64) -> Picture {
        Picture { time_s, pose: Pose2::new(x_m, 0.0, angle_rad).into(), supply_bar: Some(6.0), temperature_c: None }
    }

    fn mark(program_s: f64, offset_s: f64) -> Mark {
        Mark { program_s, offset_s, uncertainty_s: 0.0 }
    }

    #[test]
    fn a_clock_that_jumps_narrows_the_span() {
        let marks = [mark(0.0, 100.0), mark(1.0, 100.0), mark(2.0, 100.3), mark(3.0, 100.3), mark(4.0, 100.3)];
        assert_eq!(surely_within(&marks, &rest(1.2, 1.9)), (101.5, 101.9));
        assert_eq!(surely_within(&marks, &rest(3.2, 3.9)), (103.5, 104.2));
    }

    #[test]
    fn a_visit_is_the_mean_of_its_pictures() {
        let visits = Visits { model: ModelHash(1), rests: vec![rest(1.0, 2.0), rest(3.0, 4.0), rest(5.0, 6.0)] };
        let pictures = [picture(100.5, 9.0, 0.0), picture(101.2, 1.0, 0.1), picture(101.4, 3.0, 0.3), picture(105.5, 0.0, 0.0)];
        let marks = [mark(0.0, 100.0), mark(5.5, 100.0)];
        let samples = join(&visits, &marks, &pictures);
        assert_eq!(samples.len(), 1, "the second was not seen, the third not completed");
        assert!((samples[0].time_s - 1.3).abs() < 1e-9);
        assert_eq!((samples[0].supply, samples[0].temperature_c), (Some(6e5), None));
        let mean = Pose::from(Pose2::new(2.0, 0.0, 0.2));
        assert!(samples[0].pose.distance(&mean, 0.5) < 0.05, "{:?}", samples[0].pose);
    }
}
