//! `darm synth`: kinematic synthesis, the geometry with which an arm reaches desired frames.

mod answer;

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Context as _;
use darm_arm::arm::frames::{self, DesiredFrame, StopRange};
use darm_arm::arm::{Arm, ArmModel};
use darm_arm::draw::{Scene, svg};
use darm_arm::synthesis::{
    Bounds, Method, MinStroke, NeededWords, Options, Scheme as PaperScheme, SearchHandle, Status, StuckActuator,
    Synthesis, Tolerance, buy, choose_words, equal_stops, expected, min_strokes, minimize_sensitivity, read_catalogue,
    repair, short_strokes, stops_as_they_are, synthesize_by_few,
};

use darm_core::units::Word;

use crate::failure::Usage;
use crate::output_file::{self, Syntax};
use crate::overwrite::OutputFile;
use crate::ui::Ui;
use answer::{Extras, Synthesised, not_met};

const EXAMPLES: &str = "\
Examples:
  darm synth planar4.toml planar4-frames.toml -o arm.toml
  darm synth planar4-hybrid.toml planar4-hybrid-frames.toml -o hybrid.toml --write-frames found.toml
  darm synth planar4.toml planar4-poses.toml -o chosen.toml --choose-words --write-frames words.toml
  darm synth planar4.toml planar4-frames.toml -o bought.toml --catalogue cylinders.csv --anchors 150
  darm synth planar4.toml planar4-frames.toml -o robust.toml --part-error 0.05,0.1
  darm synth platform3.toml platform3-anchors.toml -o moved.toml --anchors 200   # beyond the stops
  darm synth arm.toml planar4-frames.toml -o repaired.toml --stuck 4=0   # actuator 4 in state 0
  darm synth arm.toml planar4-frames.toml -o jammed.toml --stuck 4=0 --keep-stop   # its stops stay
  darm synth planar4.toml planar4-frames.toml -o paper.toml --method paper --plot plots

Lengths in the files are in m, angles in degrees. Ctrl-C ends the search with the closest geometry so far. `darm adjust \
planar4.toml arm.toml` lists by how many mm to adjust each stop.";

/// Find the geometry with which an arm reaches desired frames: kinematic synthesis
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Synth {
    /// Initial arm
    #[arg(value_name = "BASE.toml")]
    base: PathBuf,
    /// Desired frames, each a word and a pose; with --choose-words a pose
    #[arg(value_name = "FRAMES.toml")]
    frames: PathBuf,
    /// Arm file to write
    #[arg(short, long, value_name = "NEW.toml")]
    output: OutputFile,
    /// Write the frames with the servo angles and words that were found
    #[arg(long, value_name = "FRAMES.toml")]
    write_frames: Option<OutputFile>,
    /// Draw the new arm in each frame, as SVG files in this folder
    #[arg(long, value_name = "FOLDER")]
    plot: Option<PathBuf>,
    /// Accept the closest geometry where not all frames can be reached
    #[arg(long)]
    closest: bool,
    /// Choose the words too: FRAMES.toml needs none
    #[arg(long, group = "task")]
    choose_words: bool,
    /// Choose the legs from a list of parts with the columns part,stroke_mm,retracted_mm,force_n,price
    #[arg(long, value_name = "FILE.csv", group = "task")]
    catalogue: Option<PathBuf>,
    /// Minimise the sensitivity of the frames to errors of stops and anchors of this size, mm
    #[arg(long, value_name = "STOP[,ANCHOR]", value_parser = tolerance, group = "task")]
    part_error: Option<Tolerance>,
    /// Adjustment of the stops that is accepted for halving the sensitivity (RSS, mm)
    #[arg(long, value_name = "MM", default_value_t = 1000.0, requires = "part_error")]
    adjustment_per_halving: f64,
    /// Repair: repeat the synthesis with an actuator that is stuck in one state
    #[arg(long, value_name = "ACTUATOR=STATE", value_parser = stuck_actuator, group = "task")]
    stuck: Option<StuckActuator>,
    /// Words that tables will use: the arm can be assembled in these, in those of the frames, at rest and fully extended.
    /// Without this option in every word, where any start leads there
    #[arg(long, value_name = "WORD", num_args = 1..)]
    table_words: Vec<String>,
    /// Keep the stops of the stuck actuator: it is jammed, and no screw moves it
    #[arg(long, requires = "stuck")]
    keep_stop: bool,
    /// Numerical method
    #[arg(long, value_enum, default_value_t = Scheme::Newton)]
    method: Scheme,
    /// Steps of the paper's method
    #[arg(long, value_name = "N", default_value_t = 100)]
    steps: u32,
    /// Tikhonov parameter of the paper's method, for more frames than can be reached
    #[arg(long, value_name = "SHARE", default_value_t = 1e-3)]
    regularisation: f64,
    /// Starts before the closest geometry is accepted
    #[arg(long, value_name = "N", default_value_t = 256)]
    starts: u32,
    /// Seed of the starts
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Shortest length of a leg, in percent of its shortest in the initial arm
    #[arg(long, value_name = "PERCENT", default_value_t = 50.0)]
    shortest: f64,
    /// Longest length of a leg, in percent of its longest in the initial arm
    #[arg(long, value_name = "PERCENT", default_value_t = 200.0)]
    longest: f64,
    /// Least stroke between two states, in mm: small solenoids have 5. Where the frames cannot be reached so, actuators all
    /// of whose states the frames use may have a tenth of it; 0 accepts equal stops, with which an actuator does not move. A
    /// revolute joint turns the tool as far at the length scale of the arm. Strokes that FRAMES.toml bounds come first; the
    /// paper's method has no bounds
    #[arg(long = "least-stroke", value_name = "MM", default_value_t = 5.0)]
    min_stroke: f64,
    /// Largest change of each coordinate of an anchor, in mm, used where stops alone do not reach the frames
    #[arg(long, value_name = "MM", default_value_t = 0.0, conflicts_with = "part_error")]
    anchors: f64,
}

/// Share of the least stroke that an actuator may have where the frames need it so.
const SHORTER: f64 = 0.1;

/// Method of a synthesis.
#[derive(clap::ValueEnum, Clone, Copy, Debug)]
enum Scheme {
    /// Gauss-Newton on the group with analytic derivatives
    Newton,
    /// The paper's method: frames interpolated in steps, derivatives by finite differences
    Paper,
}

/// Two lengths in mm; the second defaults to the first.
fn tolerance(text: &str) -> Result<Tolerance, String> {
    let (stop, anchor) = text.split_once(',').unwrap_or((text, text));
    let metres = |text: &str| match text.trim().parse::<f64>() {
        Ok(mm) if mm.is_finite() && mm >= 0.0 => Ok(1e-3 * mm),
        _ => Err(format!("{text:?} is not a length; give one or two in mm, such as 0.05 or 0.05,0.1")),
    };
    let stop_m = metres(stop)?;
    // A stop of a joint acts at a lever of about a metre.
    Ok(Tolerance { stop_m, stop_rad: stop_m, anchor_m: metres(anchor)?, worth_m: 1.0 })
}

fn stuck_actuator(text: &str) -> Result<StuckActuator, String> {
    let parts = text.split_once('=').and_then(|(actuator, state)| Some((actuator.parse().ok()?, state.parse().ok()?)));
    let (actuator, state) = parts.ok_or("give ACTUATOR=STATE, such as 4=0")?;
    Ok(StuckActuator { actuator, state })
}

impl Synth {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        for path in [Some(&*self.output), self.write_frames.as_deref()].into_iter().flatten() {
            output_file::refuse_other_than_toml(path, &[&self.base, &self.frames])?;
        }
        let base = Arm::read(&self.base)?;
        let read = if self.choose_words { frames::read_task_without_words } else { frames::read_task };
        let task = read(&self.frames, &base)?;
        let handle = SearchHandle::default();
        let options = Options {
            ranges: task.ranges,
            words: self.needed_words(&base)?,
            handle: handle.clone(),
            ..self.options()?
        };
        let base = &base;
        let ended = handle.clone();
        ctrlc::set_handler(move || ended.end()).context("cannot wait for Ctrl-C")?;
        let spinner = ui.spinner("synthesising");
        let (found, extras) = std::thread::scope(|scope| {
            let search = scope.spawn(|| self.search_with_strokes(base, &task.frames, &options));
            while !search.is_finished() {
                spinner.set_message(format!("synthesising, start {}", handle.starts()));
                std::thread::sleep(Duration::from_millis(20));
            }
            search
                .join()
                .map_err(|_| anyhow::anyhow!("the search thread panicked; please report this error of darm"))?
        })?;
        spinner.finish_and_clear();
        if handle.is_ended() {
            ui.note("interrupted: this is the closest geometry so far");
        }
        if found.status == Status::Closest && !self.closest && !handle.is_ended() {
            return Err(not_met(&found, options.method).into());
        }
        self.warn_of_strokes(&found.arm, ui);
        self.write_files(&base.model, &found, ui)?;
        ui.print(&Synthesised::of(&found, &self.output, extras))
    }

    /// Searches with the least stroke of every actuator, then with a tenth of it where the frames need the states.
    fn search_with_strokes(
        &self,
        base: &Arm,
        desired: &[DesiredFrame],
        options: &Options,
    ) -> anyhow::Result<(Synthesis, Extras)> {
        let kept = self.stuck.filter(|_| self.keep_stop).map(|dead| stops_as_they_are(base, dead.actuator));
        let ranges: Vec<StopRange> = options.ranges.iter().copied().chain(kept.into_iter().flatten()).collect();
        let with = |min| {
            let strokes = min_strokes(base, desired, &ranges, min);
            let ranges = ranges.iter().copied().chain(strokes).collect();
            self.search(base, desired, &Options { ranges, ..options.clone() })
        };
        let min_m = 1e-3 * self.min_stroke;
        let all = with(MinStroke::of_all(min_m))?;
        let has_bounds = options.method == Method::Newton && min_m > 0.0;
        if all.0.status == Status::Reached || !has_bounds || options.handle.is_ended() {
            return Ok(all);
        }
        let shorter = with(MinStroke { free_m: min_m, used_m: SHORTER * min_m })?;
        Ok(if shorter.0.status == Status::Reached { shorter } else { all })
    }

    /// Names actuators that do not move, and those that move less than the least stroke.
    fn warn_of_strokes(&self, arm: &Arm, ui: Ui) {
        let equal = equal_stops(arm);
        for actuator in short_strokes(arm, 1e-3 * self.min_stroke).into_iter().filter(|short| !equal.contains(short)) {
            let (name, min) = (arm.actuator_name(actuator), self.min_stroke);
            ui.note(&format!(
                "warning: actuator {actuator} ({name}) has a stroke below {min} mm; the frames need it so"
            ));
        }
        for actuator in equal {
            let name = arm.actuator_name(actuator);
            ui.note(&format!(
                "warning: actuator {actuator} ({name}) has equal stops: it does not move; increase --least-stroke"
            ));
        }
    }

    /// Runs the requested search; its result and what is reported with it.
    fn search(&self, base: &Arm, desired: &[DesiredFrame], options: &Options) -> anyhow::Result<(Synthesis, Extras)> {
        let mut extras = Extras::default();
        let found = if self.choose_words {
            choose_words(base, desired, options, &|_| true)?
        } else if let Some(path) = &self.catalogue {
            let (found, parts) = buy(base, desired, &read_catalogue(path)?, options)?;
            extras.price = Some(parts.iter().map(|part| part.price).sum());
            extras.parts = parts;
            found
        } else if let Some(stuck) = self.stuck {
            check(base, stuck)?;
            let (found, cost) = repair(base, desired, stuck, options)?;
            extras.repair = Some(cost);
            found
        } else {
            synthesize_by_few(base, desired, options)?
        };
        let Some(tolerance) = self.part_error.filter(|_| found.status == Status::Reached) else {
            return Ok((found, extras));
        };
        let tolerance = Tolerance { worth_m: 1e-3 * self.adjustment_per_halving, ..tolerance };
        let reached = |found: &Synthesis| -> Vec<DesiredFrame> {
            found.frames.iter().map(|reached| reached.frame.clone()).collect()
        };
        extras.alteration_before_m = Some(found.alteration_m);
        extras.expected_before = expected(&found.arm, &reached(&found), &tolerance, self.seed);
        let found = minimize_sensitivity(base, &found, &tolerance, options)?;
        extras.expected = expected(&found.arm, &reached(&found), &tolerance, self.seed);
        Ok((found, extras))
    }

    /// Writes the requested files.
    fn write_files(&self, base: &ArmModel, found: &Synthesis, ui: Ui) -> anyhow::Result<()> {
        found.arm.write(&self.output)?;
        let frames: Vec<_> = found.frames.iter().map(|reached| reached.frame.clone()).collect();
        if let Some(folder) = &self.plot {
            draw(&found.arm, &frames, folder)?;
        }
        if let Some(path) = &self.write_frames {
            return output_file::write_text(path, Syntax::Toml, &frames::to_toml(&frames));
        }
        if base.chain.n_servos() > 0 {
            ui.note("the servo angles that were found are not saved; --write-frames FRAMES.toml saves them");
        }
        if self.choose_words || self.stuck.is_some() {
            ui.note("the words that were found are not saved; --write-frames FRAMES.toml saves them");
        }
        Ok(())
    }

    fn needed_words(&self, arm: &Arm) -> Result<NeededWords, Usage> {
        if self.table_words.is_empty() {
            return Ok(NeededWords::All);
        }
        let word = |text: &String| -> Result<Word, Usage> {
            let word: Word = text.parse().map_err(|error| Usage(format!("--table-words {text}: {error}")))?;
            frames::check_word(&word, arm).map_err(|fault| Usage(format!("--table-words {text}: {fault}")))?;
            Ok(word)
        };
        Ok(NeededWords::These(self.table_words.iter().map(word).collect::<Result<_, _>>()?))
    }

    fn options(&self) -> Result<Options, Usage> {
        if !(self.shortest > 0.0 && self.longest >= self.shortest) {
            let (shortest, longest) = (self.shortest, self.longest);
            return Err(Usage(format!(
                "--shortest {shortest} --longest {longest}: give percent with 0 < shortest <= longest"
            )));
        }
        if self.steps == 0 || !(self.regularisation >= 0.0 && self.regularisation.is_finite()) {
            let (steps, regularisation) = (self.steps, self.regularisation);
            return Err(Usage(format!(
                "--steps {steps} --regularisation {regularisation}: give steps of at least 1 and a parameter of at least 0"
            )));
        }
        if !(self.adjustment_per_halving > 0.0 && self.adjustment_per_halving.is_finite()) {
            return Err(Usage(format!(
                "--adjustment-per-halving {}: give a length above 0 mm",
                self.adjustment_per_halving
            )));
        }
        if !(self.min_stroke >= 0.0 && self.min_stroke.is_finite()) {
            return Err(Usage(format!("--least-stroke {}: give a length of at least 0 mm", self.min_stroke)));
        }
        if !(self.anchors >= 0.0 && self.anchors.is_finite()) {
            return Err(Usage(format!("--anchors {}: give a length of at least 0 mm", self.anchors)));
        }
        let method = match self.method {
            Scheme::Newton => Method::Newton,
            Scheme::Paper => {
                Method::Paper(PaperScheme { regularisation: self.regularisation, ..PaperScheme::of(self.steps) })
            }
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

/// Rejects an actuator or state that the arm does not have.
fn check(arm: &Arm, StuckActuator { actuator, state }: StuckActuator) -> Result<(), Usage> {
    let states = arm.model.chain.n_states(actuator);
    if usize::from(state) < states {
        return Ok(());
    }
    Err(Usage(format!(
        "--stuck {actuator}={state}: the arm has actuators 0 to {}, and actuator {actuator} has {states} states, numbered from 0",
        arm.n_actuators().saturating_sub(1)
    )))
}

/// One SVG per frame, named by its number: the arm with its tool, and the desired position.
fn draw(arm: &Arm, frames: &[DesiredFrame], folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot create the folder {}", folder.display()))?;
    for (index, frame) in frames.iter().enumerate() {
        let path = folder.join(format!("frame-{:02}-{}.svg", index + 1, frame.word));
        let scene = Scene::of_frame(arm, frame)?;
        output_file::write_text(&path, Syntax::Svg, &svg(&scene, true))?;
    }
    Ok(())
}
