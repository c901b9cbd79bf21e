//! One seed: which arm, which effects, and the run that is diagnosed.

use darm_diagnose::measurement_plan::PlanStep;
use darm_diagnose::truth::{Blind, Kind, TruthError};
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::arms::Subject;

/// Draws of effects before a seed is given up.
const DRAWS: usize = 32;

/// What is drawn for a seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(super) enum Class {
    Clean,
    One,
    Two,
    Outside,
}

impl Class {
    /// Of every ten seeds five, two, two and one.
    pub(super) fn of(seed: u64) -> Self {
        match seed % 10 {
            0..=4 => Self::Clean,
            5 | 6 => Self::One,
            7 | 8 => Self::Two,
            _ => Self::Outside,
        }
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Clean => "clean",
            Self::One => "one",
            Self::Two => "two",
            Self::Outside => "outside",
        }
    }

    fn kinds(self, rng: &mut ChaCha8Rng) -> Vec<Kind> {
        match self {
            Self::Clean => Vec::new(),
            Self::One => vec![Blind::INSIDE[rng.random_range(0..Blind::INSIDE.len())]],
            Self::Two => Blind::INSIDE.sample(rng, 2).copied().collect(),
            Self::Outside => vec![Blind::OUTSIDE[rng.random_range(0..Blind::OUTSIDE.len())]],
        }
    }
}

/// The true arm of a seed; effects that it cannot have are drawn again.
pub(super) fn draw(subject: &Subject, seed: u64) -> Result<Blind, TruthError> {
    draw_from(subject, subject.steps(seed), (Class::of(seed), seed), |_| true)
}

/// The true arm of a class and seed that makes these steps, with effects of the kinds that are allowed.
pub(super) fn draw_from(
    subject: &Subject,
    steps: &[PlanStep],
    (class, seed): (Class, u64),
    allows: impl Fn(Kind) -> bool,
) -> Result<Blind, TruthError> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0xca5e_0000);
    let mut last = TruthError::TooWeak { kind: Kind::Nothing };
    for _ in 0..DRAWS {
        let kinds = class.kinds(&mut rng);
        if [Kind::BaseOffset, Kind::JointOffset].iter().all(|kind| kinds.contains(kind)) {
            // The servo is at the base: both are one turn of it.
            continue;
        }
        if !kinds.iter().all(|kind| allows(*kind)) {
            continue;
        }
        match Blind::draw(&subject.arm, steps, &kinds, seed) {
            Ok(blind) => return Ok(blind),
            Err(error) => last = error,
        }
    }
    Err(last)
}
