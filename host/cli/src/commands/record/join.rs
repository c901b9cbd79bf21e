//! Joins a visit with camera measurements by time.

use darm_core::real::Vec3;
use darm_core::se::{Pose, Twist};
use darm_measure::Sample;

use crate::commands::camera_lines::{BAR, Picture};
use darm_measure::visits::Rest;

/// Time span in which the arm certainly rested at a visit, on the camera's clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Span {
    /// Latest start, Unix time.
    pub(crate) from_s: f64,
    /// Earliest end, Unix time.
    pub(crate) to_s: f64,
}

/// The sample of a visit, its time after the start of the program; `None` where the camera certainly saw nothing.
pub(crate) fn join(rest: &Rest, visit: usize, span: &Span, pictures: &[Picture]) -> Option<Sample> {
    let seen = between(pictures, span);
    let sample = (!seen.is_empty()).then(|| sample(rest, visit, seen))?;
    Some(Sample { time_s: rest.from_s + sample.time_s - span.from_s, ..sample })
}

/// The camera measurements of a span; they are in order of time.
fn between<'p>(pictures: &'p [Picture], span: &Span) -> &'p [Picture] {
    let from = pictures.partition_point(|picture| picture.time_s < span.from_s);
    let to = pictures.partition_point(|picture| picture.time_s < span.to_s);
    pictures.get(from..to).unwrap_or_default()
}

fn sample(rest: &Rest, visit: usize, seen: &[Picture]) -> Sample {
    Sample {
        time_s: mean(seen.iter().map(|picture| picture.time_s)).expect("a sample has a picture"),
        word: rest.word,
        previous: Some(rest.previous),
        servos_rad: rest.servos_rad.clone(),
        pose: mean_pose(seen),
        supply: mean(seen.iter().filter_map(|picture| picture.supply_bar)).map(|bar| BAR * bar),
        temperature_c: mean(seen.iter().filter_map(|picture| picture.temperature_c)),
        load_kg: None,
        strokes_s: Vec::new(),
        run: 0,
        visit: visit as u32,
        held_out: rest.held_out,
    }
}

/// The mean of poses that are close together: of their twists from the first.
fn mean_pose(seen: &[Picture]) -> Pose<f64> {
    let first = seen.first().expect("a sample has a picture");
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

    use super::{Span, join};
    use crate::commands::camera_lines::Picture;
    use darm_measure::visits::Rest;

    fn rest(from_s: f64, to_s: f64) -> Rest {
        let word = "01".parse().unwrap();
        Rest { label: "A".into(), from_s, to_s, row: 0, word, previous: word, servos_rad: vec![], held_out: false }
    }

    fn picture(time_s: f64, x_m: f64, angle_rad: f64) -> Picture {
        Picture { time_s, pose: Pose2::new(x_m, 0.0, angle_rad).into(), supply_bar: Some(6.0), temperature_c: None }
    }

    #[test]
    fn a_visit_is_the_mean_of_its_camera_measurements() {
        let pictures = [
            picture(100.5, 9.0, 0.0),
            picture(101.2, 1.999, 0.199),
            picture(101.4, 2.001, 0.201),
            picture(105.5, 0.0, 0.0),
        ];
        let span = |from_s, to_s| Span { from_s, to_s };
        let sample = join(&rest(1.0, 2.0), 7, &span(101.0, 102.0), &pictures).unwrap();
        assert_eq!(join(&rest(3.0, 4.0), 8, &span(103.0, 104.0), &pictures), None, "not seen");
        assert_eq!(join(&rest(3.0, 4.0), 8, &span(105.9, 105.1), &pictures), None, "not certainly at rest");
        assert!((sample.time_s - 1.3).abs() < 1e-9);
        assert_eq!((sample.supply, sample.temperature_c, sample.visit), (Some(6e5), None, 7));
        let mean = Pose::from(Pose2::new(2.0, 0.0, 0.2));
        assert!(sample.pose.distance(&mean, 0.5) < 1e-6, "{:?}", sample.pose);
    }
}
