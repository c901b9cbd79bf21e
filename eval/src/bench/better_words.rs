//! What better words alone can do for an arm with one wrong stroke: error before and after on the arm as it is, where the model
//! knows it exactly.
//!
//! The frames are poses that the nominal arm reaches exactly, by words that the wrong stroke touches. An arm of 4096 words is
//! measured beside one of 64⁶, complete poses beside positions alone.

use anyhow::{Context, Result};
use darm_arm::arm::{Arm, ArmScratch};
use darm_arm::reach::exact::{Index, Options};
use darm_arm::reach::{best_words, corrected};
use darm_core::effect::Effect;
use darm_core::se::Pose;
use darm_core::units::Word;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use darm_figures::figure::Figure;
use xtask::setup;

/// Arms with an effect, and frames of each.
const DRAWS: usize = 50;
const FRAMES: usize = 4;
/// The stroke is wrong by these shares of itself.
const SHARES: [f64; 2] = [0.02, 0.1];
/// Arms: what figures call them, and their file.
const ARMS: [(&str, &str); 2] = [("4096 words", "planar4.toml"), ("64^6 words", "spatial6.toml")];

/// Errors of all frames, m.
#[derive(Default)]
struct Errors {
    before: Vec<f64>,
    after: Vec<f64>,
}

/// Medians and largest errors of both arms, for poses and for positions.
pub(super) fn measure(seed: u64) -> Result<Vec<Figure>> {
    let mut figures = Vec::new();
    for (title, file) in ARMS {
        let nominal = Arm::read(&setup::root().join("examples").join(file))?;
        for (what, length_scale_m) in [("pose", nominal.length_scale_m), ("position", 0.0)] {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let nominal = Arm { length_scale_m, ..nominal.clone() };
            let mut errors = Errors::default();
            for _ in 0..DRAWS {
                errors.add(&nominal, &mut random)?;
            }
            figures.extend(errors.figures(&format!("better words, {title}, {what}"))?);
        }
    }
    Ok(figures)
}

impl Errors {
    /// Adds the frames of an arm with one wrong stroke.
    fn add(&mut self, nominal: &Arm, random: &mut ChaCha8Rng) -> Result<()> {
        let (actuator, state) = (random.random_range(0..nominal.n_actuators()), random.random_range(0..2u8));
        let loss_m = random.random_range(SHARES[0]..SHARES[1]) * stroke_m(nominal, actuator)?;
        let mut real = nominal.clone();
        let loss = Effect::StrokeLoss { actuator: actuator as u8, state, loss_m };
        real.model.effects.push(loss).ok().context("an arm with one effect more")?;
        let index = Index::new(&real, &Options::of(&real))?;
        for _ in 0..FRAMES {
            let digits: Vec<u8> = (0..nominal.n_actuators()).map(|_| random.random_range(0..2)).collect();
            let word = Word::new(&digits)?.with_digit(actuator, state);
            let target = pose(nominal, &word)?;
            self.before.push(pose(&real, &word)?.distance(&target, real.length_scale_m));
            self.after.push(nearest_m(&real, &index, &target)?);
        }
        Ok(())
    }

    fn figures(mut self, title: &str) -> Result<Vec<Figure>> {
        self.before.sort_by(f64::total_cmp);
        self.after.sort_by(f64::total_cmp);
        let middle = |errors: &[f64]| errors.get(errors.len() / 2).map_or(f64::NAN, |m| 1e3 * m);
        let largest = self.after.last().map_or(f64::NAN, |m| 1e3 * m);
        Ok(vec![
            Figure::new(&format!("{title}: error of the nominal words, median"), middle(&self.before), "mm")?,
            Figure::new(&format!("{title}: error of the nearest words, median"), middle(&self.after), "mm")?,
            Figure::new(&format!("{title}: error of the nearest words, largest"), largest, "mm")?,
        ])
    }
}

/// How far the nearest word of the arm as it is brings the tool to a target, m.
fn nearest_m(real: &Arm, index: &Index, target: &Pose<f64>) -> Result<f64> {
    let found = match real.n_actuators() {
        few if few <= 16 => best_words(real, target, &real.rest(), 1)?,
        _ => corrected::nearest(real, index, target, &real.rest(), 1)?,
    };
    Ok(found.first().context("no word is found")?.distance_m)
}

/// Where the arm has its tool for a word, coming from rest.
fn pose(arm: &Arm, word: &Word) -> Result<Pose<f64>> {
    Ok(arm.model.predict(&arm.model.working(*word, arm.rest(), &[]), &mut ArmScratch::default())?)
}

/// From one stop of an actuator to the other, m.
fn stroke_m(arm: &Arm, actuator: usize) -> Result<f64> {
    let mut first = 0;
    for stage in &arm.model.chain.stages {
        let n = stage.n_actuators();
        if actuator < first + n {
            let leg = stage.leg(actuator - first).context("an actuator that is no leg")?;
            return Ok((leg.length_m[1] - leg.length_m[0]).abs());
        }
        first += n;
    }
    anyhow::bail!("no actuator {actuator}")
}
