//! The exact nearest word out of 64⁶, beside a beam search and a genetic algorithm, and its agreement with trying all.

use std::iter;
use std::time::Instant;

use anyhow::{Context, Result};
use darm_arm::arm::{Arm, ArmScratch};
use darm_arm::reach::exact::{Index, Options};
use darm_arm::reach::{best_words, board};
use darm_core::actuator::{MAX_LEGS, Setting};
use darm_core::nearest::{Beam, Frame, Module, frames, nearest, typical};
use darm_core::se::Pose;
use darm_core::units::Word;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::replan;
use darm_figures::figure::Figure;
use darm_figures::items::Job;
use darm_figures::shard::Shard;
use serde::{Deserialize, Serialize};
use xtask::setup;

/// Targets of each kind.
const TARGETS: usize = 100;
/// Most tails of the index: four of the six modules.
const MAX_TAILS: usize = 1 << 24;
/// By how much anchors and lengths of the arm depart from the drawing, m: modules differ.
const DEPARTURE_M: f64 = 5e-3;

/// Arms on which the exact search is held beside trying all words, and most digits of their words.
const ARMS: usize = 1000;
const MAX_DIGITS: usize = 20;
/// The index is built and as many keys are sorted so often, in turn.
const INDEX_RUNS: usize = 3;
/// A time is the best of this many runs: the machine may be shared.
const RUNS: usize = 5;
/// Choices that the beam search keeps.
const WIDTH: usize = 256;

/// The searches over the large arm, and arms on which all words are tried.
#[derive(Serialize, Deserialize)]
pub(crate) struct Reach {
    pub(super) seed: u64,
}

/// What came of one item.
#[derive(Serialize, Deserialize)]
pub(crate) enum Outcome {
    /// Times and errors of the searches: name, value, unit.
    Searches(Vec<(String, f64, String)>),
    /// Whether trying all words finds another distance on one arm.
    Arm { is_wrong: bool },
}

impl Job for Reach {
    const COMMAND: &'static str = "bench --reach";
    type Bench = Arm;
    type Outcome = Outcome;

    fn items(&self) -> Result<Vec<String>> {
        Ok(iter::once("searches".to_owned()).chain((0..ARMS).map(|arm| format!("arm {arm}"))).collect())
    }

    fn bench(&self, _: Shard) -> Result<Arm> {
        Ok(Arm::read(&setup::root().join("examples/planar4.toml"))?)
    }

    fn run(&self, planar: &Arm, item: usize) -> Result<Outcome> {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        // The searches have the first stream, each arm has its own.
        random.set_stream(item as u64);
        match item {
            0 => Ok(Outcome::Searches(
                all_searches(&mut random)?.into_iter().map(|f| (f.name, f.value, f.unit)).collect(),
            )),
            _ => Ok(Outcome::Arm { is_wrong: is_another_distance(planar, &mut random)? }),
        }
    }

    /// The searches measure times.
    fn runs_alone(&self, item: usize) -> bool {
        item == 0
    }

    fn figures(&self, outcomes: &[Outcome]) -> Result<Vec<Figure>> {
        let (mut figures, mut wrong) = (Vec::new(), 0);
        for outcome in outcomes {
            match outcome {
                Outcome::Searches(rows) => {
                    for (name, value, unit) in rows {
                        figures.push(Figure::new(name, *value, unit)?);
                    }
                }
                Outcome::Arm { is_wrong } => wrong += usize::from(*is_wrong),
            }
        }
        figures.push(Figure::new("reach: arms where trying all finds another distance", wrong as f64, "")?);
        Ok(figures)
    }

    fn seed(&self) -> u64 {
        self.seed
    }
}

/// Times and errors over the large arm.
fn all_searches(random: &mut ChaCha8Rng) -> Result<Vec<Figure>> {
    let arm = spatial(random)?;
    let options = Options { max_tails: MAX_TAILS, ..Options::of(&arm) };
    // In turn, so that both have the same machine.
    let (mut built_ms, mut sorted_ms) = (f64::INFINITY, f64::INFINITY);
    let mut index = Index::new(&arm, &options)?;
    for _ in 0..INDEX_RUNS {
        let mut keys: Vec<u64> = (0..MAX_TAILS).map(|_| random.random()).collect();
        sorted_ms = best_of(1, || keys.sort_unstable()).1.min(sorted_ms);
        let (built, ms) = best_of(1, || Index::new(&arm, &options));
        (index, built_ms) = (built?, ms.min(built_ms));
    }
    let mut figures = vec![
        Figure::new("reach: index built over sorting as many 64-bit keys", built_ms / sorted_ms, "")?,
        Figure::new("reach: words", index.words(), "")?,
        Figure::new("reach: index built", built_ms * 1e-3, "s")?,
        Figure::new("reach: index", index.bytes() as f64 / 1e6, "MB")?,
    ];
    for (kind, continuous) in [("reachable", false), ("continuous legs", true)] {
        let targets: Vec<_> = (0..TARGETS).map(|_| target(&arm, continuous, random)).collect::<Result<_>>()?;
        figures.extend(searches(&arm, &index, kind, &targets, random)?);
    }
    figures.extend(replan::measure(random)?);
    Ok(figures)
}

/// What `run` gives, and the time of the fastest run, ms.
pub(super) fn best_of<T>(runs: usize, mut run: impl FnMut() -> T) -> (T, f64) {
    let mut timed = || {
        let start = Instant::now();
        (run(), start.elapsed().as_secs_f64() * 1e3)
    };
    let first = timed();
    (1..runs).fold(first, |best, _| {
        let next = timed();
        if next.1 < best.1 { next } else { best }
    })
}

/// Error and time of the searches; the board's own is timed on this machine.
fn searches(
    arm: &Arm,
    index: &Index,
    kind: &str,
    targets: &[Pose<f64>],
    random: &mut ChaCha8Rng,
) -> Result<Vec<Figure>> {
    let tables = Tables::new(arm);
    let modules = tables.modules();
    let mut beam = Beam::<f64, WIDTH>::default();
    let scale_m = arm.length_scale_m;
    let records = board::records(arm)?;
    let mut rows: [(&str, Vec<f64>, Vec<f64>); 4] =
        ["exact", "beam 256", "genetic", "board"].map(|name| (name, vec![], vec![]));
    for target in targets {
        let (exact, exact_ms) = best_of(RUNS, || index.nearest(target, 1, &[]).first().map(|near| near.distance_m));
        let (beam, beam_ms) = best_of(1, || nearest(&modules, target, scale_m, &mut beam).map(|near| near.distance_m));
        let (genetic, genetic_ms) = best_of(1, || genetic(&modules, target, scale_m, random));
        let (board, board_ms) = best_of(1, || board::nearest(&records, arm.n_actuators(), target));
        let board = board.context("the board finds no word")?.word;
        let board = arm.model.chain.pose_base_tool(&board, &[], &mut ArmScratch::default())?.distance(target, scale_m);
        for (row, (error_m, ms)) in rows.iter_mut().zip([
            (exact, exact_ms),
            (beam, beam_ms),
            (Some(genetic), genetic_ms),
            (Some(board), board_ms),
        ]) {
            row.1.push(1e3 * error_m.context("no word is found")?);
            row.2.push(ms);
        }
    }
    let mut figures = Vec::new();
    let mut medians_ms = Vec::new();
    for (name, mut errors, mut times) in rows {
        errors.sort_by(f64::total_cmp);
        times.sort_by(f64::total_cmp);
        let share = |sorted: &[f64], percent: usize| sorted[(sorted.len() * percent / 100).min(sorted.len() - 1)];
        medians_ms.push(share(&times, 50));
        figures.push(Figure::new(&format!("reach, {kind}, {name}: time, median"), share(&times, 50), "ms")?);
        figures.push(Figure::new(&format!("reach, {kind}, {name}: time, 99th percentile"), share(&times, 99), "ms")?);
        figures.push(Figure::new(&format!("reach, {kind}, {name}: error, median"), share(&errors, 50), "mm")?);
        figures.push(Figure::new(&format!("reach, {kind}, {name}: error, largest"), share(&errors, 100), "mm")?);
    }
    // The first two rows: the exact search and the beam.
    let name = format!("reach, {kind}, exact over beam {WIDTH}: time, median");
    figures.push(Figure::new(&name, medians_ms[0] / medians_ms[1], "")?);
    Ok(figures)
}

/// The frames of each module.
pub(super) struct Tables(Vec<Vec<Frame<f64>>>);

impl Tables {
    pub(super) fn new(arm: &Arm) -> Self {
        let one = Pose::identity();
        Self(arm.model.chain.stages.iter().map(|stage| frames(stage, &one, &one).collect()).collect())
    }

    pub(super) fn modules(&self) -> Vec<Module<'_, f64>> {
        let module = |frames: &'_ Vec<Frame<f64>>| frames.len().ilog2() as u8;
        self.0.iter().map(|frames| Module { frames, actuators: module(frames), typical: typical(frames) }).collect()
    }
}

/// A plain genetic algorithm: tournaments of three, uniform crossover, one mutation a child, the best survives.
fn genetic(modules: &[Module<f64>], target: &Pose<f64>, scale_m: f64, random: &mut ChaCha8Rng) -> f64 {
    const POPULATION: usize = 200;
    const GENERATIONS: usize = 200;
    let distance_m = |genes: &[usize]| {
        let pose =
            genes.iter().zip(modules).fold(Pose::identity(), |pose, (gene, module)| pose * module.frames[*gene].pose);
        pose.distance(target, scale_m)
    };
    let born = |genes: Vec<usize>| (distance_m(&genes), genes);
    let any = |module: &Module<f64>, random: &mut ChaCha8Rng| random.random_range(0..module.frames.len());
    let mut all: Vec<_> =
        (0..POPULATION).map(|_| born(modules.iter().map(|module| any(module, random)).collect())).collect();
    for _ in 0..GENERATIONS {
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        // Sorted: of three contestants the one with the least number wins.
        let winner = |random: &mut ChaCha8Rng| (0..3).map(|_| random.random_range(0..POPULATION)).min().unwrap_or(0);
        let mut next = vec![all[0].clone()];
        while next.len() < POPULATION {
            let (one, other) = (winner(random), winner(random));
            let pick = |(a, b): (&usize, &usize)| if random.random_range(0..2) == 0 { *a } else { *b };
            let mut genes: Vec<usize> = all[one].1.iter().zip(&all[other].1).map(pick).collect();
            // Of a frame's bits one leg switches; in every third child a complete module.
            let changed = random.random_range(0..genes.len());
            let module = &modules[changed];
            genes[changed] = match random.random_range(0..3) {
                0 => any(module, random),
                _ => (genes[changed] ^ 1 << random.random_range(0..u32::from(module.actuators))) % module.frames.len(),
            };
            next.push(born(genes));
        }
        all = next;
    }
    all.iter().fold(f64::INFINITY, |best, (distance_m, _)| best.min(*distance_m))
}

/// Whether a random arm has a nearer or a farther word by the search than by trying all.
fn is_another_distance(planar: &Arm, random: &mut ChaCha8Rng) -> Result<bool> {
    let spatial = spatial(random)?;
    let mut arm = planar.clone();
    arm.model.chain.stages.clear();
    let digits = random.random_range(3..=MAX_DIGITS);
    while arm.n_actuators() + 3 <= digits {
        let from = if random.random_range(0..2) == 0 && arm.n_actuators() + 6 <= digits { &spatial } else { planar };
        let stages = &from.model.chain.stages;
        let stage = stages[random.random_range(0..stages.len())];
        arm.model.chain.stages.push(stage).ok().context("the arm has too many stages")?;
    }
    let target = target(&arm, true, random)?;
    let max_tails = 1 << random.random_range(0..=MAX_DIGITS);
    let index = Index::new(&arm, &Options { max_tails, ..Options::of(&arm) })?;
    let all = best_words(&arm, &target, &arm.rest(), 1)?;
    let found = index.nearest(&target, 1, &[]);
    let (found, all) = (found.first().context("no word")?.distance_m, all.first().context("no word")?.distance_m);
    Ok((found - all).abs() > 1e-9)
}

/// The six-module arm of the examples as it may be built: every anchor and length a little off.
pub(super) fn spatial(random: &mut ChaCha8Rng) -> Result<Arm> {
    let mut arm = Arm::read(&setup::root().join("examples/spatial6.toml"))?;
    for stage in &mut arm.model.chain.stages {
        for leg in (0..MAX_LEGS).filter(|leg| stage.leg(*leg).is_some()).collect::<Vec<_>>() {
            let Some(leg) = stage.leg_mut(leg) else { continue };
            let mut off = || random.random_range(-DEPARTURE_M..DEPARTURE_M);
            leg.base.iter_mut().chain(leg.top.iter_mut()).for_each(|coordinate| *coordinate += off());
            leg.length_m.iter_mut().for_each(|length| *length += off());
        }
    }
    Ok(arm)
}

/// The pose of the arm for a random word, or with each leg of any length between its shortest and its longest.
fn target(arm: &Arm, continuous: bool, random: &mut ChaCha8Rng) -> Result<Pose<f64>> {
    let digits: Vec<u8> = (0..arm.n_actuators()).map(|_| random.random_range(0..2)).collect();
    let mut scratch = ArmScratch::default();
    let chain = &arm.model.chain;
    chain.configure(&Word::new(&digits)?, &[], &mut scratch)?;
    if continuous {
        for (stage, settings) in chain.stages.iter().zip(&mut scratch.settings) {
            for (leg, setting) in settings.iter_mut().enumerate() {
                if let Some(leg) = stage.leg(leg) {
                    let [short, long, ..] = leg.length_m;
                    *setting = Setting { value: random.random_range(short..long), ..*setting };
                }
            }
        }
    }
    Ok(chain.assemble(&mut scratch)?)
}
