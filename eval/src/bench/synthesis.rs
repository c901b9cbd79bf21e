//! The examples of the synthesis paper, by its method and by ours: errors, steps and time.

use std::time::Duration;

use anyhow::{Context, Result};
use darm_arm::arm::Arm;
use darm_arm::arm::frames;
use darm_arm::synthesis::{CaseKind, Method, Options, Synthesis, synthesize};

use darm_figures::figure::Figure;
use xtask::setup;

/// So often a synthesis is timed; the median counts.
const REPEATS: usize = 21;

/// One example: its arm and frames among `examples/`, and n_div of the paper's method.
struct Example {
    name: &'static str,
    arm: &'static str,
    frames: &'static str,
    steps: u32,
}

const fn example(name: &'static str, arm: &'static str, frames: &'static str, steps: u32) -> Example {
    Example { name, arm, frames, steps }
}

/// The paper takes 10³ steps in the plane and 10⁵ in space; 10³ serve here in space as well.
const EXAMPLES: [Example; 8] = [
    example("platform, 3 bits", "platform3.toml", "platform3-frames.toml", 1000),
    example("serial, 2 bits of 3 states", "serial2.toml", "serial2-frames.toml", 1000),
    example("planar 4 modules, sufficient", "planar4.toml", "planar4-frames.toml", 1000),
    example("spatial 3 modules, sufficient", "spatial3.toml", "spatial3-sufficient.toml", 1000),
    example("spatial 3 modules, insufficient", "spatial3.toml", "spatial3-insufficient.toml", 1000),
    example("spatial 3 modules, redundant", "spatial3.toml", "spatial3-redundant.toml", 1000),
    example("serial 12 joints, sufficient", "serial12.toml", "serial12-frames.toml", 1000),
    example("hybrid 6 x 6 bits, sufficient", "hybrid6.toml", "hybrid6-frames.toml", 1000),
];

pub(super) fn measure() -> Result<Vec<Figure>> {
    let mut figures = Vec::new();
    for example in &EXAMPLES {
        let folder = setup::root().join("examples");
        let arm = Arm::read(&folder.join(example.arm))?;
        let task = frames::read_task(&folder.join(example.frames), &arm)?;
        let solve = |method| {
            let options = Options { method, ranges: task.ranges.clone(), ..Options::default() };
            synthesize(&arm, &task.frames, &options).with_context(|| example.name)
        };
        let paper = solve(Method::Paper { steps: example.steps, regularisation: 1e-3 })?;
        rows(&format!("{}, paper's method", example.name), &paper, paper.time, &mut figures)?;
        let found: Vec<Synthesis> = (0..REPEATS).map(|_| solve(Method::Newton)).collect::<Result<_>>()?;
        let mut times: Vec<Duration> = found.iter().map(|found| found.time).collect();
        times.sort_unstable();
        rows(&format!("{}, default", example.name), &found[0], times[REPEATS / 2], &mut figures)?;
    }
    Ok(figures)
}

fn rows(name: &str, found: &Synthesis, time: Duration, figures: &mut Vec<Figure>) -> Result<()> {
    let worst = |error: fn(&darm_arm::synthesis::Reached) -> f64| found.frames.iter().map(error).fold(0.0, f64::max);
    let free = found.frames.iter().all(|reached| reached.frame.weights.orientation == 0.0);
    let mut add = |what: &str, value: f64, unit: &str| -> Result<()> {
        figures.push(Figure::new(&format!("{name}: {what}"), value, unit)?);
        Ok(())
    };
    add("position error", worst(|reached| reached.error_m), "m")?;
    if !free {
        add("orientation error", worst(|reached| reached.error_rad).to_degrees(), "deg")?;
    }
    if found.case.kind == CaseKind::Redundant {
        add("alteration", found.alteration_m, "m")?;
    }
    add("steps", found.iterations.into(), "")?;
    add("time", 1e3 * time.as_secs_f64(), "ms")
}
