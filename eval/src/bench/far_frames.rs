//! Whether a synthesis finds what can be found, and keeps what it has to keep, as the desired frames move far out.
//!
//! Each draw: three distinct words of planar4, whose own frames are moved out from the base by one factor between 1 and 4;
//! legs of 0.5 to 2 of the base line and strokes of at least 5 mm, as `darm synth --closest` has them. What does not meet its
//! frames with every word assembled is started again from 1 000 drawn arms, as in the [sweep](super::synthesis_sweep), unless a frame lies farther away than the longest
//! legs add up to.
//!
//! Every answer is judged as its user has it: from its file, by its lengths, and by the pose of every one of its 4096 words.

use std::path::Path;

use anyhow::{Context, Result};
use darm_arm::arm::frames::DesiredFrame;
use darm_arm::arm::{Arm, ArmScratch};
use darm_arm::synthesis::{Bounds, Options, Status, synthesize, without_pose};
use darm_core::units::Word;
use darm_figures::figure::Figure;
use darm_figures::items::Job;
use darm_figures::shard::Shard;
use rand::seq::index::sample;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::SEED;
use super::draws::{Own, own_frames};
use super::synthesis_sweep::random_start_solves;

const ARM: &str = "planar4.toml";
const DRAWS: u64 = 1000;
const FRAMES: usize = 3;
const FACTORS: (f64, f64) = (1.0, 4.0);
/// Least stroke, m: the default of `darm synth`.
const STROKE_M: f64 = 5e-3;
/// Starts where a frame lies farther away than the arm reaches, which no start changes.
const STARTS_BEYOND: u32 = 16;
/// Rounding of a stop at its bound, m.
const ROUNDING_M: f64 = 1e-9;

/// All draws; they have no options.
#[derive(Serialize, Deserialize)]
pub(crate) struct FarFrames {}

/// What came of one draw.
#[derive(Serialize, Deserialize)]
pub(crate) struct Outcome {
    is_met: bool,
    /// Met, with every word assembled.
    is_solved: bool,
    /// So by the search or by any of the drawn starts.
    has_solution: bool,
    is_past_bounds: bool,
    is_unreadable: bool,
    /// Words without a pose, and those of them that the answer does not name.
    without_pose: usize,
    unnamed: usize,
    time_s: f64,
}

impl Job for FarFrames {
    const COMMAND: &'static str = "bench --far-frames";
    type Bench = Arm;
    type Outcome = Outcome;

    fn items(&self) -> Result<Vec<String>> {
        Ok((0..DRAWS).map(|draw| format!("draw {draw}")).collect())
    }

    fn bench(&self, _: Shard) -> Result<Arm> {
        Ok(own_frames(ARM, &[])?.arm)
    }

    fn run(&self, arm: &Arm, item: usize) -> Result<Outcome> {
        let own = draw(arm, item as u64)?;
        let bounds = Bounds { stroke: STROKE_M, ..Bounds::default() };
        let started = std::time::Instant::now();
        let is_beyond = is_out_of_reach(arm, &own.frames, bounds);
        let starts = if is_beyond { STARTS_BEYOND } else { Options::default().starts };
        let found = synthesize(arm, &own.frames, &Options { bounds, starts, ..Options::default() })?;
        let time_s = started.elapsed().as_secs_f64();
        let is_solved = found.status == Status::Reached && without_pose(&found.arm).is_empty();
        let has_solution = is_solved || !is_beyond && random_start_solves(&own, &own.frames, item as u64, STROKE_M)?;
        let mut outcome = Outcome {
            is_met: found.status == Status::Reached,
            is_solved,
            has_solution,
            is_past_bounds: is_past_bounds(arm, &found.arm, bounds),
            is_unreadable: false,
            without_pose: 0,
            unnamed: 0,
            time_s,
        };
        let Ok(read) = Arm::parse(Path::new("answer.toml"), &found.arm.to_toml()) else {
            return Ok(Outcome { is_unreadable: true, ..outcome });
        };
        let named = without_pose(&found.arm);
        let mut scratch = ArmScratch::default();
        for number in 0..1 << read.n_actuators() {
            let word = word(&read, number)?;
            if read.model.predict(&read.model.working(word, read.rest(), &[]), &mut scratch).is_ok() {
                continue;
            }
            outcome.without_pose += 1;
            let digits: Vec<u8> = (0..read.n_actuators()).map(|actuator| word.digit(actuator)).collect();
            let is_named = named.iter().any(|module| {
                let first: usize =
                    read.model.chain.stages[..module.stage].iter().map(|stage| stage.n_actuators()).sum();
                module.settings.iter().any(|setting| digits[first..].starts_with(setting))
            });
            outcome.unnamed += usize::from(!is_named);
        }
        Ok(outcome)
    }

    fn figures(&self, outcomes: &[Outcome]) -> Result<Vec<Figure>> {
        let count = |is: fn(&Outcome) -> bool| outcomes.iter().filter(|outcome| is(outcome)).count() as f64;
        let (solved, solvable) = (count(|outcome| outcome.is_solved), count(|outcome| outcome.has_solution));
        let mut times_s: Vec<f64> = outcomes.iter().map(|outcome| outcome.time_s).collect();
        times_s.sort_by(f64::total_cmp);
        let time_s = |share: f64| times_s[((times_s.len() - 1) as f64 * share) as usize];
        let figure = |what: &str, value: f64, unit: &str| Figure::new(&format!("far frames: {what}"), value, unit);
        Ok(vec![
            figure("draws that any start solves", solvable, &format!("of {}", outcomes.len()))?,
            figure("of these solved", 100.0 * solved / solvable.max(1.0), "%")?,
            figure("answers outside a bound", count(|outcome| outcome.is_past_bounds), "")?,
            figure("answers whose file cannot be read", count(|outcome| outcome.is_unreadable), "")?,
            figure("answers without a pose for some word", count(|outcome| outcome.without_pose > 0), "")?,
            figure("the same, frames met", count(|outcome| outcome.is_met && outcome.without_pose > 0), "")?,
            figure("answers with such a word that is not named", count(|outcome| outcome.unnamed > 0), "")?,
            figure("time of a search, median", time_s(0.5), "s")?,
            figure("time of a search, largest", time_s(1.0), "s")?,
        ])
    }

    fn seed(&self) -> u64 {
        SEED
    }
}

fn word(arm: &Arm, number: usize) -> Result<Word> {
    format!("{number:0width$b}", width = arm.n_actuators()).parse().context("binary digits make a word")
}

/// The frames of three words, moved out.
fn draw(arm: &Arm, seed: u64) -> Result<Own> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let words: Vec<String> = sample(&mut rng, 1 << arm.n_actuators(), FRAMES)
        .iter()
        .map(|number| Ok(word(arm, number)?.to_string()))
        .collect::<Result<_>>()?;
    let factor = rng.random_range(FACTORS.0..FACTORS.1);
    let mut own = Own::new(arm.clone(), &words.iter().map(String::as_str).collect::<Vec<_>>())?;
    own.frames.iter_mut().for_each(|frame| frame.pose_base_tool.position *= factor);
    Ok(own)
}

/// The lengths of an actuator's two stops, m.
fn lengths(arm: &Arm) -> impl Iterator<Item = [f64; 2]> {
    let legs = arm.model.chain.actuators().filter_map(|(stage, leg)| arm.model.chain.stages[stage].leg(leg));
    legs.map(|leg| [leg.length_m[0], leg.length_m[1]])
}

/// Whether a length or a stroke of an answer is not what was requested, by the arms alone.
fn is_past_bounds(from: &Arm, to: &Arm, Bounds { shortest, longest, stroke, .. }: Bounds) -> bool {
    lengths(from).zip(lengths(to)).any(|([short, long], now)| {
        let margin_m = (now[0] - shortest * short).min(longest * long - now[1]).min(now[1] - now[0] - stroke);
        margin_m < -ROUNDING_M
    })
}

/// Whether a frame is farther away than any arm within the bounds reaches. The left and the right leg of each of its modules join the
/// same two points of both plates, whose origins lie midway between them: no module is longer than the mean of the two.
fn is_out_of_reach(arm: &Arm, frames: &[DesiredFrame], Bounds { longest, .. }: Bounds) -> bool {
    let legs: Vec<f64> = lengths(arm).map(|[_, long]| longest * long).collect();
    let reach_m: f64 = legs.chunks(3).map(|legs| 0.5 * (legs[0] + legs[2])).sum();
    frames.iter().any(|frame| frame.pose_base_tool.position.norm() > reach_m + arm.model.chain.tool.position.norm())
}
