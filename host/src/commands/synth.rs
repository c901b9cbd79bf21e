//! `darm synth`: the geometry with which an arm reaches desired frames.

use std::path::PathBuf;

use anyhow::Context as _;
use darm::arm::{Arm, frames};
use darm::synthesis::{Bounds, Method, Options, Reached, Status, Synthesis, synthesize};
use serde::Serialize;

use crate::failure::Usage;
use crate::voice::{Answer, Voice, columns};

const EXAMPLES: &str = "\
Examples:
  darm synth planar4.toml planar4-frames.toml -o arm.toml
  darm synth hybrid.toml frames.toml -o arm.toml --frames-out found.toml   servo angles found, too
  darm synth planar4.toml frames.toml --method paper --steps 100 -o arm.toml

Lengths in the files are in m, angles in degrees. `darm stops planar4.toml arm.toml` then says by
how many mm each stop is to be turned.";

/// Find the geometry with which an arm reaches desired frames
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Synth {
    /// Base-line arm
    #[arg(value_name = "BASE.toml")]
    base: PathBuf,
    /// Desired frames: a word and a pose each
    #[arg(value_name = "FRAMES.toml")]
    frames: PathBuf,
    /// The new arm
    #[arg(short, long, value_name = "NEW.toml")]
    output: PathBuf,
    /// The frames with the servo angles that were found
    #[arg(long, value_name = "FILE.toml")]
    frames_out: Option<PathBuf>,
    /// Take the nearest geometry where the frames cannot all be met
    #[arg(long)]
    closest: bool,
    /// Scheme
    #[arg(long, value_enum, default_value_t = Scheme::Newton)]
    method: Scheme,
    /// Steps of the paper's scheme
    #[arg(long, value_name = "N", default_value_t = 100)]
    steps: u32,
    /// Tikhonov's parameter of the paper's scheme, for more frames than can be met
    #[arg(long, value_name = "SHARE", default_value_t = 1e-3)]
    regularisation: f64,
    /// Starts that are tried before the nearest geometry is taken
    #[arg(long, value_name = "N", default_value_t = 16)]
    starts: u32,
    /// Seed of the starts
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Shortest length of a leg, in percent of its shortest in the base-line
    #[arg(long, value_name = "PERCENT", default_value_t = 50.0)]
    shortest: f64,
    /// Longest length of a leg, in percent of its longest in the base-line
    #[arg(long, value_name = "PERCENT", default_value_t = 200.0)]
    longest: f64,
}

/// Scheme of a synthesis.
#[derive(clap::ValueEnum, Clone, Copy, Debug)]
enum Scheme {
    /// Gauss-Newton on the group with analytic derivatives
    Newton,
    /// The paper's: frames interpolated in steps, derivatives by differences
    Paper,
}

#[derive(Serialize)]
struct Synthesised {
    output: PathBuf,
    model: String,
    reached: bool,
    case: String,
    iterations: u32,
    starts: u32,
    took_s: f64,
    alteration_m: f64,
    frames: Vec<FrameReport>,
}

#[derive(Serialize)]
struct FrameReport {
    name: String,
    word: String,
    servos_deg: Vec<f64>,
    before_m: f64,
    before_rad: f64,
    error_m: f64,
    error_rad: f64,
}

/// Frames that are not met.
#[derive(Debug, thiserror::Error)]
#[error(
    "not met: {frames} (up to {worst_mm:.3} mm, {worst_deg:.3} deg); {case}; ask for fewer or nearer frames, or take the nearest geometry with --closest"
)]
struct NotMet {
    frames: String,
    worst_mm: f64,
    worst_deg: f64,
    case: String,
}

impl Synth {
    pub(crate) fn run(&self, voice: Voice) -> anyhow::Result<()> {
        let base = Arm::read(&self.base)?;
        let task = frames::read_task(&self.frames, &base)?;
        let wheel = voice.wheel("synthesising");
        let options = Options { ranges: task.ranges, ..self.options()? };
        let found = synthesize(&base, &task.frames, &options);
        wheel.finish_and_clear();
        let found = found?;
        if found.status == Status::Closest && !self.closest {
            return Err(not_met(&found).into());
        }
        found.arm.write(&self.output)?;
        if let Some(path) = &self.frames_out {
            let frames: Vec<_> = found.frames.iter().map(|reached| reached.frame.clone()).collect();
            std::fs::write(path, frames::to_toml(&frames))
                .with_context(|| format!("cannot write {}", path.display()))?;
        } else if base.n_servos() > 0 {
            voice.note("the servo angles that were found are not kept; --frames-out FILE.toml keeps them");
        }
        voice.tell(&self.report(&found))
    }

    fn options(&self) -> Result<Options, Usage> {
        if !(self.shortest > 0.0 && self.longest >= self.shortest) {
            return Err(Usage("--shortest must be above 0 and --longest not below it, in percent".into()));
        }
        let method = match self.method {
            Scheme::Newton => Method::Newton,
            Scheme::Paper => Method::Paper { steps: self.steps, regularisation: self.regularisation },
        };
        let bounds =
            Bounds { shortest: self.shortest / 100.0, longest: self.longest / 100.0, ..Options::default().bounds };
        Ok(Options { method, bounds, starts: self.starts, seed: self.seed, ..Options::default() })
    }

    fn report(&self, found: &Synthesis) -> Synthesised {
        Synthesised {
            output: self.output.clone(),
            model: found.arm.hash().to_string(),
            reached: found.status == Status::Reached,
            case: found.case.to_string(),
            iterations: found.iterations,
            starts: found.starts,
            took_s: found.time.as_secs_f64(),
            alteration_m: found.alteration_m,
            frames: found.frames.iter().map(frame_report).collect(),
        }
    }
}

fn frame_report(reached: &Reached) -> FrameReport {
    FrameReport {
        name: reached.frame.name.clone(),
        word: reached.frame.word.to_string(),
        servos_deg: reached.frame.servos_rad.iter().map(|angle| angle.to_degrees()).collect(),
        before_m: reached.error_before_m,
        before_rad: reached.error_before_rad,
        error_m: reached.error_m,
        error_rad: reached.error_rad,
    }
}

fn not_met(found: &Synthesis) -> NotMet {
    let missed = |reached: &&Reached| {
        reached.error_m > darm::synthesis::REACHED_M || reached.error_rad > darm::synthesis::REACHED_RAD
    };
    let worst = |error: fn(&Reached) -> f64| found.frames.iter().map(error).fold(0.0, f64::max);
    let names: Vec<_> = found.frames.iter().filter(missed).map(|reached| reached.frame.name.as_str()).collect();
    NotMet {
        frames: names.join(", "),
        worst_mm: 1e3 * worst(|reached| reached.error_m),
        worst_deg: worst(|reached| reached.error_rad).to_degrees(),
        case: found.case.to_string(),
    }
}

impl Answer for Synthesised {
    fn text(&self) -> String {
        let mut rows = vec![["frame", "word", "before", "", "after", ""].map(str::to_owned).to_vec()];
        rows.extend(self.frames.iter().map(|frame| {
            vec![
                frame.name.clone(),
                frame.word.clone(),
                format!("{:.1} mm", 1e3 * frame.before_m),
                format!("{:.2} deg", frame.before_rad.to_degrees()),
                format!("{:.1e} m", frame.error_m),
                format!("{:.1e} rad", frame.error_rad),
            ]
        }));
        format!(
            "{}\n\n{}\n{} in {:.3} s: {} iterations, {} start{}; stops altered by {:.1} mm (root of the sum of squares)\n\
             model {} in {}",
            columns(&rows),
            self.case,
            if self.reached { "every frame is met" } else { "the nearest geometry" },
            self.took_s,
            self.iterations,
            self.starts,
            if self.starts == 1 { "" } else { "s" },
            1e3 * self.alteration_m,
            self.model,
            self.output.display()
        )
    }
}
