//! In how many draws a synthesis is exact, as the desired frames move away from the base-line's own.
//!
//! How desired frames are moved: [`draws`](super::draws).
//!
//! Three sets of bounds: wide ones, strokes of at least 0, and strokes of at least 20 mm, the last two with legs of 0.5 to 2 of
//! the base line. Within the tightest not every draw has a solution: there the share is also that of the draws that the
//! search or any of 1 000 starts solves, each from an arm whose stops are drawn from all that the bounds allow.

use std::collections::BTreeMap;

use anyhow::{Context, Result};
use darm_arm::arm::Arm;
use darm_arm::arm::frames::{DesiredFrame, StopRange};
use darm_arm::synthesis::{
    Bounds, Infeasibility, Method, Options, Status, Synthesis, choose_words, equal_stops, synthesize, without_pose,
};
use darm_core::chain::Parameter;
use darm_figures::figure::Figure;
use darm_figures::items::Job;
use darm_figures::shard::Shard;
use rand::seq::index::sample;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use xtask::setup;

use super::SEED;
use super::draws::{Own, PLANAR_WORDS, moved, own_frames};

const DRAWS: u64 = 200;
/// Draws of frames that any words may serve, and how many frames.
const CHOICES: u64 = 100;
const CHOSEN: usize = 8;
/// Starts of one synthesis, and of one within tight bounds, where most draws have no solution to be found.
const STARTS: u32 = 64;
const BOUNDED_STARTS: u32 = 6;
/// Least stroke of a real actuator, m, and starts that decide whether a draw has a solution.
const STROKE_M: f64 = 0.02;
const RANDOM_STARTS: usize = 1000;
const SHARES: [f64; 3] = [1.0, 0.5, 0.25];
const SERIAL_WORDS: [&str; 3] = ["000000000000", "111111000000", "000000111111"];

/// Sizes by which the frames of each arm move, m.
const PLANAR_SIZES: [f64; 4] = [0.1, 0.3, 0.5, 0.8];
const STROKE_SIZES: [f64; 3] = [0.1, 0.3, 0.5];
const SERIAL_SIZES: [f64; 3] = [0.1, 0.3, 1.0];
const CHOICE: &str = "eight frames";

/// The complete sweep; it has no options.
#[derive(Serialize, Deserialize)]
pub(crate) struct SynthesisSweep {}

/// What stops may be set to.
#[derive(Clone, Copy, PartialEq)]
enum Within {
    Wide,
    /// Strokes of at least 0.
    NoStroke,
    /// Strokes of at least [`STROKE_M`].
    Stroke,
}

/// One arm, moved by one size, under one set of bounds.
struct Case {
    arm: &'static str,
    within: Within,
    size: f64,
}

impl Case {
    /// All cases, in the order of the report.
    fn all() -> Vec<Self> {
        let arms = [("planar", &PLANAR_SIZES[..]), ("serial", &SERIAL_SIZES[..])];
        let of = |within: Within| {
            arms.iter().flat_map(move |(arm, sizes)| sizes.iter().map(move |&size| Self { arm, within, size }))
        };
        let strokes = STROKE_SIZES.iter().map(|&size| Self { arm: "planar", within: Within::Stroke, size });
        of(Within::Wide).chain(of(Within::NoStroke)).chain(strokes).collect()
    }

    fn title(&self) -> String {
        let note = match self.within {
            Within::Wide => "",
            Within::NoStroke => ", stroke >= 0, bounded",
            Within::Stroke => ", stroke >= 20 mm, bounded",
        };
        format!("{} synthesis exact at {}{note}", self.arm, self.size)
    }

    /// Bounds and starts. The wide ones keep leg lengths above zero; a joint turns freely.
    fn options(&self) -> Options {
        let (bounds, starts) = match self.within {
            Within::Wide => (Bounds { shortest: 1e-3, ..Bounds::none() }, STARTS),
            Within::NoStroke => (Bounds::default(), BOUNDED_STARTS),
            Within::Stroke => (Bounds { stroke: STROKE_M, ..Bounds::default() }, Options::default().starts),
        };
        Options { bounds, starts, ..Options::default() }
    }
}

/// The arms with their own frames.
pub(crate) struct Bench {
    cases: Vec<Case>,
    planar: Own,
    serial: Own,
}

/// What came of one item.
#[derive(Serialize, Deserialize)]
pub(crate) enum Outcome {
    /// One draw of one case.
    Draw {
        is_exact_plain: bool,
        is_exact: bool,
        obstacle: Option<String>,
        nearest_mm: f64,
        /// Looked for within the tightest bounds only, as are equal stops.
        has_solution: bool,
        has_equal_stops: bool,
    },
    /// One draw of eight frames.
    Choice { is_exact_chosen: bool, is_exact_fixed: bool },
}

impl Job for SynthesisSweep {
    const COMMAND: &'static str = "bench --synthesis-sweep";
    type Bench = Bench;
    type Outcome = Outcome;

    fn items(&self) -> Result<Vec<String>> {
        let cases = Case::all();
        let draws = cases.iter().flat_map(|case| (0..DRAWS).map(|draw| format!("{}, draw {draw}", case.title())));
        Ok(draws.chain((0..CHOICES).map(|draw| format!("{CHOICE}, draw {draw}"))).collect())
    }

    fn bench(&self, _: Shard) -> Result<Bench> {
        let planar = own_frames("planar4.toml", &PLANAR_WORDS)?;
        let serial = own_frames("serial12.toml", &SERIAL_WORDS)?;
        Ok(Bench { cases: Case::all(), planar, serial })
    }

    fn run(&self, bench: &Bench, item: usize) -> Result<Outcome> {
        let seed = (item as u64) % DRAWS;
        match bench.cases.get(item / DRAWS as usize) {
            Some(case) => draw(if case.arm == "planar" { &bench.planar } else { &bench.serial }, case, seed),
            None => choice(seed),
        }
    }

    fn figures(&self, outcomes: &[Outcome]) -> Result<Vec<Figure>> {
        let mut figures = Vec::new();
        let cases = Case::all();
        for (case, outcomes) in cases.iter().zip(outcomes.chunks(DRAWS as usize)) {
            figures.extend(figures_of(&case.title(), case.within, outcomes)?);
        }
        let chosen = &outcomes[cases.len() * DRAWS as usize..];
        let share =
            |is: fn(&Outcome) -> bool| 100.0 * chosen.iter().filter(|one| is(one)).count() as f64 / CHOICES as f64;
        let words_chosen = share(|one| matches!(one, Outcome::Choice { is_exact_chosen: true, .. }));
        let words_as_drawn = share(|one| matches!(one, Outcome::Choice { is_exact_fixed: true, .. }));
        figures.push(Figure::new("eight frames exact, words chosen", words_chosen, "%")?);
        figures.push(Figure::new("eight frames exact, words as drawn", words_as_drawn, "%")?);
        Ok(figures)
    }

    fn seed(&self) -> u64 {
        SEED
    }
}

/// Whether all frames of a draw are met, by a plain search and by the default; what kept the default from them.
fn draw(own: &Own, case: &Case, seed: u64) -> Result<Outcome> {
    let options = case.options();
    let frames = moved(&own.frames, case.size, own.arm.model.chain.is_planar(), seed);
    let plain = synthesize(&own.arm, &frames, &Options { method: Method::Plain, starts: 1, ..options.clone() })?;
    let ours = synthesize(&own.arm, &frames, &options)?;
    let obstacle = match &ours.obstacle {
        Some(Infeasibility::Bounds(_)) | None => "held back by bounds",
        Some(Infeasibility::Singular { .. }) => "stopped by a singular platform",
        Some(Infeasibility::Words { .. }) => "stopped by words to be assembled",
        Some(Infeasibility::OutOfReach) => "stretched, or in a hollow",
        Some(Infeasibility::Unsettled) => "not at its end",
    };
    let asks = case.within == Within::Stroke;
    Ok(Outcome::Draw {
        is_exact_plain: is_exact(&plain),
        is_exact: is_exact(&ours),
        obstacle: (!is_exact(&ours)).then(|| obstacle.to_owned()),
        nearest_mm: 1e3 * ours.frames.iter().map(|frame| frame.error_m).fold(0.0, f64::max),
        has_solution: asks && (is_exact(&ours) || random_start_solves(own, &frames, seed, STROKE_M)?),
        has_equal_stops: asks && is_exact(&ours) && !equal_stops(&ours.arm).is_empty(),
    })
}

/// What a plain search ends at may break the bounds, or leave words without a pose: then it counts as not found.
fn is_exact(found: &Synthesis) -> bool {
    found.status == Status::Reached && found.kept && without_pose(&found.arm).is_empty()
}

/// Whether any of many starts solves a draw with legs within the default bounds, every word assembled. Each start is an arm whose stops are uniform in all
/// that the bounds allow, or in a half or a quarter of it around the base line; one without a pose for some word solves
/// nothing.
pub(super) fn random_start_solves(own: &Own, frames: &[DesiredFrame], seed: u64, stroke: f64) -> Result<bool> {
    let Bounds { shortest, longest, .. } = Bounds::default();
    let (mut ranges, mut lengths) = (Vec::new(), Vec::new());
    for actuator in 0..own.arm.n_actuators() {
        let length = |state| own.arm.model.chain.get(stop(actuator, state)).context("a leg has two stops");
        let (short, long) = (length(0)?, length(1)?);
        let value = (shortest * short, longest * long);
        ranges.push(StopRange { value, stroke: (stroke, f64::INFINITY), ..StopRange::any(actuator) });
        lengths.push((short, long));
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(1);
    let options = Options { bounds: Bounds::none(), ranges: ranges.clone(), starts: 1, ..Options::default() };
    // The closest geometry is of no interest.
    options.handle.end();
    for share in SHARES.into_iter().cycle().take(RANDOM_STARTS) {
        let mut start = own.arm.clone();
        for (StopRange { actuator, value: (low, high), .. }, (short, long)) in ranges.iter().zip(&lengths) {
            let (low, high) = (short - share * (short - low), long + share * (high - long));
            let short = rng.random_range(low..high - stroke);
            start.model.chain.set(stop(*actuator, 0), short)?;
            start.model.chain.set(stop(*actuator, 1), rng.random_range(short + stroke..high))?;
        }
        if synthesize(&start, frames, &options).is_ok_and(|found| is_exact(&found)) {
            return Ok(true);
        }
    }
    Ok(false)
}

fn stop(actuator: usize, state: u8) -> Parameter {
    Parameter::Stop { actuator: actuator as u8, state }
}

/// Whether eight frames of any eight words, moved by 0.1, are met: with chosen words, and with the words as drawn.
fn choice(seed: u64) -> Result<Outcome> {
    let arm = Arm::read(&setup::root().join("examples/planar4.toml"))?;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let words: Vec<String> = sample(&mut rng, 1 << arm.n_actuators(), CHOSEN)
        .iter()
        .map(|word| format!("{word:0width$b}", width = arm.n_actuators()))
        .collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let own = own_frames("planar4.toml", &words)?;
    let desired = moved(&own.frames, 0.1, true, seed);
    let chosen = choose_words(&arm, &desired, &Options::default(), &|_| true)?;
    let fixed = synthesize(&arm, &desired, &Options::default())?;
    let [is_exact_chosen, is_exact_fixed] = [&chosen, &fixed].map(|found| found.status == Status::Reached);
    Ok(Outcome::Choice { is_exact_chosen, is_exact_fixed })
}

/// The shares of one case, and why the others are not exact.
fn figures_of(title: &str, within: Within, outcomes: &[Outcome]) -> Result<Vec<Figure>> {
    let share = 100.0 / outcomes.len() as f64;
    let [mut plain, mut exact, mut solvable, mut equal] = [0; 4];
    let (mut obstacles, mut missed_mm) = (BTreeMap::<&str, usize>::new(), Vec::new());
    for outcome in outcomes {
        let Outcome::Draw { is_exact_plain, is_exact, obstacle, nearest_mm, has_solution, has_equal_stops } = outcome
        else {
            continue;
        };
        plain += usize::from(*is_exact_plain);
        exact += usize::from(*is_exact);
        solvable += usize::from(*has_solution);
        equal += usize::from(*has_equal_stops);
        if let Some(obstacle) = obstacle {
            *obstacles.entry(obstacle).or_default() += 1;
            missed_mm.push(*nearest_mm);
        }
    }
    let mut figures = vec![
        Figure::new(&format!("{title}, plain Gauss-Newton"), share * plain as f64, "%")?,
        Figure::new(title, share * exact as f64, "%")?,
    ];
    if within == Within::Stroke {
        let of_solvable = 100.0 * exact as f64 / solvable.max(1) as f64;
        figures.push(Figure::new(&format!("{title}: of draws that any start solves"), of_solvable, "%")?);
        figures.push(Figure::new(&format!("{title}: draws that any start solves"), share * solvable as f64, "%")?);
        figures.push(Figure::new(&format!("{title}: answers with equal stops"), equal as f64, "")?);
    }
    for (obstacle, count) in obstacles {
        figures.push(Figure::new(&format!("{title}: {obstacle}"), share * count as f64, "%")?);
    }
    missed_mm.sort_by(f64::total_cmp);
    if let Some(median) = missed_mm.get(missed_mm.len() / 2) {
        figures.push(Figure::new(&format!("{title}: largest error of the nearest, median"), *median, "mm")?);
    }
    Ok(figures)
}
