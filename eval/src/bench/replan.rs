//! Words for desired frames by the nominal model and by the one that a diagnosis corrected, tried on the arm as it is.

use anyhow::{Context, Result};
use darm_arm::arm::{Arm, ArmScratch};
use darm_arm::reach::exact::{Index, Options};
use darm_arm::reach::{board, corrected};
use darm_core::se::{Pose, Twist};
use darm_core::units::Word;
use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;

use darm_figures::figure::Figure;
use xtask::setup;

/// Desired frames.
const FRAMES: usize = 100;
/// They are the poses of the arm for a random word, and this far off in every direction, m and rad.
const OFF: f64 = 0.02;

/// Root mean square errors that are measured on the arm: see `tests/data/corrected`.
pub(super) fn measure(random: &mut ChaCha8Rng) -> Result<Vec<Figure>> {
    let [found, real] =
        ["corrected", "real"].map(|name| setup::root().join(format!("tests/data/corrected/{name}.toml")));
    let (found, real) = (Arm::read(&found)?, Arm::read(&real)?);
    let mut nominal = found.clone();
    nominal.model.effects.clear();
    let index = Index::new(&nominal, &Options::of(&nominal))?;
    let (flat, bent) = (board::records(&nominal)?, board::records(&found)?);
    let mut squares = [0.0; 4];
    for _ in 0..FRAMES {
        let digits: Vec<u8> = (0..real.n_actuators()).map(|_| random.random_range(0..2)).collect();
        let mut off = || random.random_range(-OFF..OFF);
        let off = Twist { angular: [off(), off(), off()].into(), linear: [off(), off(), off()].into() };
        let target = pose_at_rest(&real, &Word::new(&digits)?)? * Pose::exp(&off);
        let on_board =
            |records: &[_]| board::nearest(records, digits.len(), &target).context("the board finds no word");
        let words = [
            index.nearest(&target, 1, &[]).first().context("no word is found")?.word,
            corrected::nearest(&found, &index, &target, &found.rest(), 1)?.first().context("no word is found")?.word,
            on_board(&flat)?.word,
            on_board(&bent)?.word,
        ];
        for (square, word) in squares.iter_mut().zip(words) {
            *square += pose_at_rest(&real, &word)?.distance(&target, real.length_scale_m).powi(2);
        }
    }
    let [nominal, corrected, flat, bent] = squares.map(|square: f64| 1e3 * (square / FRAMES as f64).sqrt());
    Ok(vec![
        Figure::new("nominal model: measured error of its words", nominal, "mm")?,
        Figure::new("corrected model: measured error of its words", corrected, "mm")?,
        Figure::new("corrected model: measured error of its words over the nominal model's", corrected / nominal, "")?,
        Figure::new("nominal model: measured error of the board's words", flat, "mm")?,
        Figure::new("corrected model: measured error of the board's words", bent, "mm")?,
    ])
}

/// Where the arm has its tool for a word, coming from rest.
fn pose_at_rest(arm: &Arm, word: &Word) -> Result<Pose<f64>> {
    Ok(arm.model.predict(&arm.model.working(*word, arm.rest(), &[]), &mut ArmScratch::default())?)
}
