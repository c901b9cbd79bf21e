//! The exact nearest word out of 64⁶, beside a beam search and a genetic algorithm, and its agreement with trying all.

use std::time::Instant;

use anyhow::{Context, Result};
use darm::arm::{Arm, ArmScratch};
use darm::reach::exact::{Index, Options};
use darm_core::actuator::{MAX_LEGS, Setting};
use darm_core::se::Pose;
use darm_core::units::Word;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use crate::figures::Figure;
use crate::setup;

/// Targets of each kind.
const TARGETS: usize = 100;
/// Most tails of the index: four of the six modules.
const MAX_TAILS: usize = 1 << 24;
/// By how much anchors and lengths of the arm depart from the drawing, m: modules differ.
const DEPARTURE_M: f64 = 5e-3;

/// Times and agreements.
pub(super) fn measure(seed: u64) -> Result<Vec<Figure>> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let arm = spatial(&mut random)?;
    let start = Instant::now();
    let index = Index::new(&arm, &Options { max_tails: MAX_TAILS, ..Options::of(&arm) })?;
    let built_s = start.elapsed().as_secs_f64();
    let mut figures = vec![
        Figure::new("reach: words", index.words(), "")?,
        Figure::new("reach: index built", built_s, "s")?,
        Figure::new("reach: index", index.bytes() as f64 / 1e6, "MB")?,
    ];
    for (kind, continuous) in [("reachable", false), ("continuous legs", true)] {
        let targets: Vec<_> = (0..TARGETS).map(|_| target(&arm, continuous, &mut random)).collect::<Result<_>>()?;
        let mut times = Vec::new();
        let mut errors = Vec::new();
        for target in &targets {
            let start = Instant::now();
            let found = index.nearest(target, 1, &[]);
            times.push(start.elapsed().as_secs_f64() * 1e3);
            errors.push(1e3 * found.first().context("no word is found")?.distance_m);
        }
        times.sort_by(f64::total_cmp);
        errors.sort_by(f64::total_cmp);
        figures.push(Figure::new(&format!("reach, {kind}: query, median"), times[TARGETS / 2], "ms")?);
        figures.push(Figure::new(&format!("reach, {kind}: query, 99th percentile"), times[TARGETS * 99 / 100], "ms")?);
        figures.push(Figure::new(&format!("reach, {kind}: error, median"), errors[TARGETS / 2], "mm")?);
        figures.push(Figure::new(&format!("reach, {kind}: error, largest"), errors[TARGETS - 1], "mm")?);
    }
    Ok(figures)
}

/// The six-module arm of the examples as it may be built: every anchor and length a little off.
fn spatial(random: &mut ChaCha8Rng) -> Result<Arm> {
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

/// Where the arm stands for a random word, or with each leg of any length between its shortest and its longest.
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
