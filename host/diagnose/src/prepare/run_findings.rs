//! What is suspicious about the conditions of a run.

use darm_measure::{Finding, FindingKind, Run, median};

/// The median of temperatures in °C, of an arm of solenoids and valves, from which on they may be degrees Fahrenheit, and up to which.
const FAHRENHEIT: std::ops::Range<f64> = 60.0..140.0;

/// Temperatures that no room has and that a room has in degrees Fahrenheit.
pub(crate) fn temperature(run: &Run) -> Option<Finding> {
    let usual = median(run.samples.iter().filter_map(|sample| sample.temperature_c))?;
    let text = format!(
        "the temperature is usually {usual:.1} °C: are these degrees Fahrenheit, {:.1} °C? convert them, (x - 32) / 1.8, and diagnose \
         again: what grows with temperature and its interval hold in °C only",
        celsius(usual)
    );
    FAHRENHEIT.contains(&usual).then(|| Finding::note(FindingKind::SuspectedUnit, text))
}

/// The run with its temperatures taken for degrees Fahrenheit.
pub(crate) fn in_fahrenheit(run: &Run) -> Run {
    let mut read = run.clone();
    for sample in &mut read.samples {
        sample.temperature_c = sample.temperature_c.map(celsius);
    }
    read
}

fn celsius(fahrenheit: f64) -> f64 {
    (fahrenheit - 32.0) / 1.8
}

#[cfg(test)]
mod tests {
    use darm_core::se::Pose;

    use super::*;
    use darm_measure::Sample;

    #[test]
    fn a_room_in_fahrenheit_is_questioned() {
        let run = |celsius: f64| Run {
            samples: vec![Sample {
                time_s: 0.0,
                word: "0".parse().unwrap(),
                previous: None,
                servos_rad: Vec::new(),
                pose: Pose::identity(),
                supply: None,
                temperature_c: Some(celsius),
                load_kg: None,
                strokes_s: Vec::new(),
                run: 0,
                visit: 0,
                held_out: false,
            }],
            ..Run::default()
        };
        assert!(temperature(&run(72.2)).is_some_and(|finding| finding.text.contains("22.3 °C")));
        assert!(temperature(&run(35.0)).is_none());
    }
}
