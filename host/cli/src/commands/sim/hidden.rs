//! Undeclared effect of the simulated arm.

use std::str::FromStr;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use darm_arm::arm::frames::{DesiredFrame, Weights};
use darm_arm::arm::{Arm, ArmScratch};
use darm_diagnose::measurement_plan::{PlanStep, candidates};
use darm_diagnose::truth::{Kind, Truth, TruthError};

/// Number of words at whose frames the effect's size is set.
const WORDS: usize = 5;

/// A kind of effect, or any of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Effect {
    /// Drawn by the seed.
    Any,
    /// This one.
    Of(Kind),
}

impl FromStr for Effect {
    type Err = <Kind as FromStr>::Err;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text == "any" { Ok(Self::Any) } else { text.parse().map(Self::Of) }
    }
}

impl Effect {
    /// Reads a name; a shell completes it.
    pub(crate) fn parser() -> impl TypedValueParser<Value = Self> {
        let kinds = [Kind::Nothing].into_iter().chain(Kind::EFFECTS).map(Kind::name);
        PossibleValuesParser::new(kinds.chain(["any"])).try_map(|name| name.parse::<Self>())
    }

    /// The arm with this effect, large enough to be visible at a few words.
    pub(crate) fn draw(self, arm: &Arm, seed: u64) -> Result<Truth, TruthError> {
        let kind = match self {
            Self::Any => None,
            Self::Of(kind) => Some(kind),
        };
        Truth::draw(arm, &frames(arm, seed), seed, kind)
    }
}

/// The arm's own frames for a few words.
fn frames(arm: &Arm, seed: u64) -> Vec<DesiredFrame> {
    let mut scratch = ArmScratch::default();
    candidates(arm, seed).into_iter().take(WORDS).filter_map(|step| frame(arm, step, &mut scratch)).collect()
}

/// The arm's own frame for a step; `None` where it has no pose.
fn frame(arm: &Arm, step: PlanStep, scratch: &mut ArmScratch) -> Option<DesiredFrame> {
    let pose = arm.model.predict(&arm.model.nominal(step.word, &step.servos_rad), scratch).ok()?;
    Some(DesiredFrame {
        name: step.word.to_string(),
        word: step.word,
        previous: step.previous,
        servos_rad: step.servos_rad,
        pose_base_tool: pose,
        weights: Weights::default(),
    })
}
