//! The examples of Miyahara, Chirikjian, General Kinematic Synthesis Method for a Discretely Actuated Robotic Manipulator
//! (D-ARM): what the paper prints of each, what a run of its scheme gives, and the table of both.
//!
//! # What the paper prints
//!
//! Orders of magnitude of two examples; all other figures are pictures. Table I sorts actuators and Figure 4 is a flowchart:
//! neither has numbers.
//!
//! # Where it is silent or contradicts itself
//!
//! - H_k(d) of eq. (11) is a frame of the interpolation before eq. (1) and the frame of the arm in eq. (5), see
//!   [`Feedback`]. The error of the planar example needs the second reading, that of the example in space fits the first.
//! - Dimensions of the serial arm, and the desired frames of all examples but as pictures.
//! - The weights of the generalized inverse, and the regularisation parameter.

pub mod pictures;

use std::fmt::Write as _;

use darm_arm::synthesis::{Feedback, Synthesis};
use serde::{Deserialize, Serialize};

/// An example of the paper: files among `examples/`, and what is printed.
#[derive(Clone, Copy, Debug)]
pub struct Example {
    /// What it is called here.
    pub name: &'static str,
    /// Where it is in the paper.
    pub place: &'static str,
    /// The arm file.
    pub arm: &'static str,
    /// The file of desired frames.
    pub frames: &'static str,
    /// The most steps that are run here: the larger arms take a tenth of a second for ten.
    pub max_steps: u32,
    /// Whether the scheme is run from the frames of the interpolation too.
    pub both_readings: bool,
    /// Whether stops remain free, so that the least alteration is chosen.
    pub is_redundant: bool,
    /// What the paper prints.
    pub printed: Option<Printed>,
}

/// Orders of magnitude that the paper prints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Printed {
    /// Steps of the interpolation, n_div.
    pub steps: u32,
    /// Error of the positions, m.
    pub position_m: f64,
    /// Error of the orientations, degrees.
    pub orientation_deg: f64,
    /// Time, s.
    pub time_s: f64,
}

/// Steps of the runs: those of the paper are 10³ in the plane and 10⁵ in space.
pub const STEPS: [u32; 5] = [10, 100, 1000, 10_000, 100_000];

const fn example(name: &'static str, place: &'static str, files: [&'static str; 2], max_steps: u32) -> Example {
    let [arm, frames] = files;
    Example { name, place, arm, frames, max_steps, both_readings: false, is_redundant: false, printed: None }
}

/// The examples in the order of the paper.
pub const EXAMPLES: [Example; 8] = [
    example("platform, 3 bits", "Figure 1", ["platform3.toml", "platform3-frames.toml"], 100_000),
    example("serial, 2 bits of 3 states", "Figure 2", ["serial2.toml", "serial2-frames.toml"], 100_000),
    Example {
        both_readings: true,
        printed: Some(Printed { steps: 1000, position_m: 1e-7, orientation_deg: 1e-9, time_s: 1e2 }),
        ..example("planar 4 modules, sufficient", "Figures 5 and 6", ["planar4.toml", "planar4-frames.toml"], 100_000)
    },
    Example {
        both_readings: true,
        printed: Some(Printed { steps: 100_000, position_m: 1e-5, orientation_deg: 1e-5, time_s: 1e5 }),
        ..example(
            "spatial 3 modules, sufficient",
            "section III",
            ["spatial3.toml", "spatial3-sufficient.toml"],
            100_000,
        )
    },
    example("spatial 3 modules, insufficient", "Figure 7", ["spatial3.toml", "spatial3-insufficient.toml"], 10_000),
    Example {
        is_redundant: true,
        ..example("spatial 3 modules, redundant", "Figure 8", ["spatial3.toml", "spatial3-redundant.toml"], 10_000)
    },
    example("serial 12 joints, sufficient", "Figure 9", ["serial12.toml", "serial12-frames.toml"], 100_000),
    example("hybrid 6 x 6 bits, sufficient", "Figure 3", ["hybrid6.toml", "hybrid6-frames.toml"], 1000),
];

/// What one run of a scheme gives.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Run {
    /// Steps taken.
    pub steps: u32,
    /// Whether steps start from the frames of the interpolation.
    pub is_interpolated: bool,
    /// Largest error of a position, m.
    pub position_m: f64,
    /// Largest error of an orientation, rad; `None` where all are free.
    pub orientation_rad: Option<f64>,
    /// Root of the sum of squares of what the stops were altered by, m.
    pub alteration_m: f64,
    /// Time, s.
    pub time_s: f64,
}

impl Run {
    /// The run that `found` came of.
    pub fn new(found: &Synthesis, feedback: Feedback, time_s: f64) -> Self {
        let fixed = || found.frames.iter().filter(|reached| reached.frame.weights.orientation > 0.0);
        let largest = |errors: &mut dyn Iterator<Item = f64>| errors.fold(0.0, f64::max);
        Self {
            steps: found.iterations,
            is_interpolated: feedback == Feedback::Interpolated,
            position_m: largest(&mut found.frames.iter().map(|reached| reached.error_m)),
            orientation_rad: fixed().next().map(|_| largest(&mut fixed().map(|reached| reached.error_rad))),
            alteration_m: found.alteration_m,
            time_s,
        }
    }
}

/// The runs of one example by the paper's scheme, and that of the default.
#[derive(Clone, Debug)]
pub struct Runs {
    /// The example.
    pub example: Example,
    /// By the paper's scheme.
    pub paper: Vec<Run>,
    /// By the default.
    pub default: Run,
}

/// The table for people: ours beside what the paper prints.
pub fn text(all: &[Runs]) -> String {
    let mut text = String::new();
    for Runs { example, paper, default } in all {
        let _ = writeln!(text, "\n{}: {}", example.place, example.name);
        let _ = writeln!(text, "{:34} {:>10} {:>12} {:>12} {:>10}", "", "steps", "position", "orientation", "time");
        let mut line = |name: &str, run: &Run| {
            let orientation =
                run.orientation_rad.map_or("free".to_owned(), |rad| format!("{:.1e} deg", rad.to_degrees()));
            let (steps, position, time) = (run.steps, run.position_m, run.time_s);
            let _ = writeln!(text, "{name:34} {steps:10} {position:10.1e} m {orientation:>12} {time:8.1e} s");
        };
        for run in paper {
            line(if run.is_interpolated { "paper's, interpolated frames" } else { "paper's scheme" }, run);
        }
        line("default", default);
        if let Some(Printed { steps, position_m, orientation_deg, time_s }) = example.printed {
            let (head, degrees) = ("printed in the paper", format!("{orientation_deg:.0e} deg"));
            let _ = writeln!(text, "{head:34} {steps:10} {position_m:10.0e} m {degrees:>12} {time_s:8.0e} s");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::{EXAMPLES, STEPS};

    #[test]
    fn every_printed_number_of_steps_is_run() {
        for example in EXAMPLES {
            let is_run = |steps: &u32| STEPS.contains(steps) && *steps <= example.max_steps;
            assert!(example.printed.is_none_or(|printed| is_run(&printed.steps)), "{}", example.name);
        }
    }
}
