//! `darm synth`: the geometry with which an arm reaches desired frames.

mod answer;

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Context as _;
use darm_arm::arm::frames::{self, DesiredFrame};
use darm_arm::arm::{Arm, ArmModel, ArmScratch};
use darm_arm::draw::{Scene, svg};
use darm_arm::synthesis::{
    Bounds, Dead, Method, Options, Status, Synthesis, Tolerance, Watch, buy, choose_words, expected, least_sensitive,
    read_catalogue, repair, synthesize,
};

use crate::failure::Usage;
use crate::voice::Voice;
use answer::{Extras, Synthesised, not_met};

const EXAMPLES: &str = "\
Examples:
  darm synth planar4.toml planar4-frames.toml -o arm.toml
  darm synth hybrid.toml frames.toml -o arm.toml --frames-out found.toml   servo angles found, too
  darm synth planar4.toml frames.toml -o arm.toml --choose-words --frames-out found.toml
  darm synth planar4.toml frames.toml -o arm.toml --catalogue cylinders.csv
  darm synth planar4.toml frames.toml -o arm.toml --catalogue cylinders.csv --anchors 150
  darm synth planar4.toml frames.toml -o arm.toml --tolerance 0.05,0.1     mm of stops and anchors
  darm synth arm.toml frames.toml -o mended.toml --repair 4=0              actuator 4 stays in state 0
  darm synth planar4.toml frames.toml --method paper --steps 100 -o arm.toml --draw pictures

Lengths in the files are in m, angles in degrees. Ctrl-C takes the nearest geometry so far. `darm stops \
planar4.toml arm.toml` then says by how many mm each stop is to be turned.";

/// Find the geometry with which an arm reaches desired frames
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Synth {
    /// Base-line arm
    #[arg(value_name = "BASE.toml")]
    base: PathBuf,
    /// Desired frames: a word and a pose each; without words where they are chosen
    #[arg(value_name = "FRAMES.toml")]
    frames: PathBuf,
    /// The new arm
    #[arg(short, long, value_name = "NEW.toml")]
    output: PathBuf,
    /// The frames with the servo angles and words that were found
    #[arg(long, value_name = "FILE.toml")]
    frames_out: Option<PathBuf>,
    /// Draw the new arm in each frame: one SVG a frame
    #[arg(long, value_name = "FOLDER")]
    draw: Option<PathBuf>,
    /// Take the nearest geometry where the frames cannot all be met
    #[arg(long)]
    closest: bool,
    /// Choose the words as well: FRAMES.toml needs none
    #[arg(long, group = "task")]
    choose_words: bool,
    /// Take the legs from a list of parts: part,stroke_mm,retracted_mm,force_n,price
    #[arg(long, value_name = "FILE.csv", group = "task")]
    catalogue: Option<PathBuf>,
    /// Make the frames least sensitive to errors of stops and anchors of this size, mm
    #[arg(long, value_name = "STOP[,ANCHOR]", value_parser = tolerance, group = "task")]
    tolerance: Option<Tolerance>,
    /// By how much the stops may be altered to halve those errors, root of the sum of squares, mm
    #[arg(long, value_name = "MM", default_value_t = 1000.0, requires = "tolerance")]
    worth: f64,
    /// Synthesis again around an actuator that stays in one state; actuators count from 0 at the base
    #[arg(long, value_name = "ACTUATOR=STATE", value_parser = dead, group = "task")]
    repair: Option<Dead>,
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
    /// By how much each coordinate of an anchor may be moved where stops alone do not meet the frames, in mm
    #[arg(long, value_name = "MM", default_value_t = 0.0, conflicts_with = "tolerance")]
    anchors: f64,
}

/// Scheme of a synthesis.
#[derive(clap::ValueEnum, Clone, Copy, Debug)]
enum Scheme {
    /// Gauss-Newton on the group with analytic derivatives
    Newton,
    /// The paper's: frames interpolated in steps, derivatives by differences
    Paper,
}

/// Two lengths in mm, the second the same as the first where it is left out.
fn tolerance(text: &str) -> Result<Tolerance, String> {
    let (stop, anchor) = text.split_once(',').unwrap_or((text, text));
    let metres = |text: &str| match text.trim().parse::<f64>() {
        Ok(mm) if mm.is_finite() && mm >= 0.0 => Ok(1e-3 * mm),
        _ => Err(format!("{text:?} is no length; give mm, such as 0.05 or 0.05,0.1")),
    };
    let stop_m = metres(stop)?;
    // A stop of a joint acts at a lever of about a metre.
    Ok(Tolerance { stop_m, stop_rad: stop_m, anchor_m: metres(anchor)?, worth_m: 1.0 })
}

fn dead(text: &str) -> Result<Dead, String> {
    let parts = text.split_once('=').and_then(|(actuator, state)| Some((actuator.parse().ok()?, state.parse().ok()?)));
    let (actuator, state) = parts.ok_or("give an actuator and its state, such as 4=0")?;
    Ok(Dead { actuator, state })
}

impl Synth {
    pub(crate) fn run(&self, voice: Voice) -> anyhow::Result<()> {
        let base = Arm::read(&self.base)?;
        let read = if self.choose_words { frames::read_task_without_words } else { frames::read_task };
        let task = read(&self.frames, &base)?;
        let watch = Watch::default();
        let options = Options { ranges: task.ranges, watch: watch.clone(), ..self.options()? };
        let ended = watch.clone();
        ctrlc::set_handler(move || ended.end()).context("cannot wait for Ctrl-C")?;
        let wheel = voice.wheel("synthesising");
        let (found, extras) = std::thread::scope(|scope| {
            let search = scope.spawn(|| self.search(&base, &task.frames, &options));
            while !search.is_finished() {
                wheel.set_message(format!("synthesising, start {}", watch.starts()));
                std::thread::sleep(Duration::from_millis(20));
            }
            search.join().map_err(|_| anyhow::anyhow!("the search ended by itself; this is an error of darm"))?
        })?;
        wheel.finish_and_clear();
        if watch.is_ended() {
            voice.note("interrupted: this is the nearest geometry so far");
        }
        if found.status == Status::Closest && !self.closest && !watch.is_ended() {
            return Err(not_met(&found).into());
        }
        self.keep(&base.model, &found, voice)?;
        voice.tell(&Synthesised::of(&found, &self.output, extras))
    }

    /// The search that is asked for, and what it tells beside the geometry.
    fn search(&self, base: &Arm, desired: &[DesiredFrame], options: &Options) -> anyhow::Result<(Synthesis, Extras)> {
        let mut extras = Extras::default();
        let found = if self.choose_words {
            choose_words(base, desired, options, &|_| true)?
        } else if let Some(path) = &self.catalogue {
            let (found, parts) = buy(base, desired, &read_catalogue(path)?, options)?;
            extras.price = Some(parts.iter().map(|part| part.price).sum());
            extras.parts = parts;
            found
        } else if let Some(dead) = self.repair {
            check(base, dead)?;
            let (found, cost) = repair(base, desired, dead, options)?;
            extras.repair = Some(cost);
            found
        } else {
            synthesize(base, desired, options)?
        };
        let Some(tolerance) = self.tolerance.filter(|_| found.status == Status::Reached) else {
            return Ok((found, extras));
        };
        let tolerance = Tolerance { worth_m: 1e-3 * self.worth, ..tolerance };
        let reached = |found: &Synthesis| -> Vec<DesiredFrame> {
            found.frames.iter().map(|reached| reached.frame.clone()).collect()
        };
        extras.altered_before_m = Some(found.alteration_m);
        extras.expected_before = expected(&found.arm, &reached(&found), &tolerance, self.seed);
        let found = least_sensitive(base, &found, &tolerance, options)?;
        extras.expected = expected(&found.arm, &reached(&found), &tolerance, self.seed);
        Ok((found, extras))
    }

    /// Writes the files that are asked for.
    fn keep(&self, base: &ArmModel, found: &Synthesis, voice: Voice) -> anyhow::Result<()> {
        found.arm.write(&self.output)?;
        let frames: Vec<_> = found.frames.iter().map(|reached| reached.frame.clone()).collect();
        if let Some(folder) = &self.draw {
            draw(&found.arm, &frames, folder)?;
        }
        if let Some(path) = &self.frames_out {
            return std::fs::write(path, frames::to_toml(&frames))
                .with_context(|| format!("cannot write {}", path.display()));
        }
        if base.chain.n_servos() > 0 {
            voice.note("the servo angles that were found are not kept; --frames-out FILE.toml keeps them");
        }
        if self.choose_words || self.repair.is_some() {
            voice.note("the words that were found are not kept; --frames-out FILE.toml keeps them");
        }
        Ok(())
    }

    fn options(&self) -> Result<Options, Usage> {
        if !(self.shortest > 0.0 && self.longest >= self.shortest) {
            return Err(Usage("--shortest must be above 0 and --longest not below it, in percent".into()));
        }
        if self.steps == 0 || !(self.regularisation >= 0.0 && self.regularisation.is_finite()) {
            return Err(Usage("--steps must be above 0, and --regularisation a number that is not below 0".into()));
        }
        if !(self.worth > 0.0 && self.worth.is_finite()) {
            return Err(Usage("--worth must be above 0 mm".into()));
        }
        if !(self.anchors >= 0.0 && self.anchors.is_finite()) {
            return Err(Usage("--anchors must not be below 0 mm".into()));
        }
        let method = match self.method {
            Scheme::Newton => Method::Newton,
            Scheme::Paper => Method::Paper { steps: self.steps, regularisation: self.regularisation },
        };
        let bounds = Bounds {
            shortest: self.shortest / 100.0,
            longest: self.longest / 100.0,
            anchor_m: 1e-3 * self.anchors,
            ..Options::default().bounds
        };
        Ok(Options { method, bounds, starts: self.starts, seed: self.seed, ..Options::default() })
    }
}

/// Refuses an actuator or state that the arm does not have.
fn check(arm: &Arm, Dead { actuator, state }: Dead) -> Result<(), Usage> {
    let states = arm.model.chain.n_states(actuator);
    if usize::from(state) < states {
        return Ok(());
    }
    Err(Usage(format!(
        "--repair {actuator}={state}: the arm has actuators 0 to {}; this one has {states} states, counted from 0",
        arm.n_actuators().saturating_sub(1)
    )))
}

/// One SVG a frame, named by its number: the arm with its tool, and where that is wanted.
fn draw(arm: &Arm, frames: &[DesiredFrame], folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let mut scratch = ArmScratch::default();
    for (index, frame) in frames.iter().enumerate() {
        let path = folder.join(format!("frame-{:02}-{}.svg", index + 1, frame.word));
        arm.model.predict(&arm.model.working(frame.word, frame.previous, &frame.servos_rad), &mut scratch)?;
        let mut scene = Scene::of_arm(arm, &scratch, frame.word.iter());
        scene.title = format!("{}, {}, word {}", arm.name, frame.name, frame.word);
        scene.axes(&frame.pose_base_tool);
        scene.labels.push(("wanted".to_owned(), frame.pose_base_tool.position));
        std::fs::write(&path, svg(&scene, true)).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}
