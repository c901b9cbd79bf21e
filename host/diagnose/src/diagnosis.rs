//! Diagnosis: what a model lacks, traced from predicted minus measured, and how sure that is.
//!
//! ```text
//! samples ─► noise (repeats) ─► residual ─► structure: is there more than noise?
//!                                  │
//!            candidates ─► linear fits, cross-validated over words ─► the best in full ─► proven on held-out words
//!                                  ▲                                                          │ kept
//!                                  └──────────────── residual again ◄─────────────────────────┘
//! ```
//!
//! A cause is named only when no other explains the measurements as well, and only when it takes up most of what is
//! beyond the noise. The levels of all tests stand in [`significance`].

use std::fmt;

use darm_core::chain::ChainError;
use darm_core::effect::Effect;

use crate::judge::fitted_terms::{self as terms, WithTerms};
use crate::judge::structure::{Structure, structure};
use crate::linearise::arm_candidates as candidate;
use crate::measurement::{Run, check};
use crate::outcome::{Alternative, Diagnosis, Verdict};
use crate::prepare::observations::{NoPose, Observations};
use crate::prepare::repeatability::{self as noise, Noise};
use crate::report::{poses as summary, sentences as words};
use crate::select::forward::Search;
use crate::select::problem::Trial;
use crate::select::robust_fit::{self as fit, condition, folds};
use crate::select::tool_pose::ToolPose;
use darm_arm::arm::{Arm, ArmScratch};

pub use words::effect_sentence;

/// Share of what is beyond the noise that a named effect may leave.
pub const UNEXPLAINED_SHARE: f64 = 0.1;
/// Training words without which nothing can be said.
const FEWEST_WORDS: usize = 2 * fit::FOLDS;

/// How a diagnosis is made.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Shuffles the words into folds.
    pub seed: u64,
    /// How many words a proposed measurement has.
    pub next_words: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self { seed: 1, next_words: 12 }
    }
}

/// Why there is no diagnosis.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DiagnoseError {
    /// A row does not fit the arm.
    #[error("line {line}: {what}")]
    Row {
        /// Line of the file, the header being 1.
        line: usize,
        /// What is wrong.
        what: String,
    },
    /// The model has no pose for a row.
    #[error("line {line}: the model has no pose for this row: {error}")]
    NoPose {
        /// Line of the file, the header being 1.
        line: usize,
        /// Why.
        error: ChainError,
    },
    /// Nothing is left to fit when the only part is left out.
    #[error("all rows that count are of one part ({told}): choose a column with several values")]
    OnePart {
        /// How the parts were chosen.
        told: String,
    },
    /// Too few words to hold any of them out.
    #[error(
        "{words} words are not enough to tell an effect from chance: measure at least {FEWEST_WORDS} that are not held out"
    )]
    TooFewWords {
        /// Words that a fit may see.
        words: usize,
    },
}

/// What `run` tells about what `arm`'s model lacks.
pub fn diagnose(arm: &Arm, run: &Run, options: &Options) -> Result<Diagnosis, DiagnoseError> {
    fits_arm(arm, run)?;
    let no_pose = |NoPose { sample, error }| DiagnoseError::NoPose { line: run.line(sample), error };
    let repeats = noise::repeated(arm, run);
    let mut search = search(arm, run, repeats.as_ref(), options).map_err(no_pose)?;
    let words = search.kind.training.n_groups;
    if words < FEWEST_WORDS {
        return Err(DiagnoseError::TooFewWords { words });
    }
    if search.kind.folds.iter().all(|fold| *fold == search.kind.folds[0]) {
        return Err(DiagnoseError::OnePart { told: run.choice.told.clone() });
    }
    if repeats.is_none() {
        search = rescaled(arm, search).map_err(no_pose)?;
    }
    conclude(arm, run, &mut search, repeats, options).map_err(no_pose)
}

/// The first thing that makes the run unfit for the arm.
fn fits_arm(arm: &Arm, run: &Run) -> Result<(), DiagnoseError> {
    let fatal = |what: &str| ["digit", "the word", "servo positions"].iter().any(|start| what.contains(start));
    match check(arm, run).into_iter().find(|finding| finding.line.is_some() && fatal(&finding.what)) {
        Some(finding) => Err(DiagnoseError::Row { line: finding.line.unwrap_or_default(), what: finding.what }),
        None => Ok(()),
    }
}

fn search(arm: &Arm, run: &Run, repeats: Option<&Noise>, options: &Options) -> Result<Search<ToolPose>, NoPose> {
    let mut scratch = ArmScratch::default();
    let sigma = match repeats {
        Some(noise) => noise.sigma,
        None => scatter(arm, run, &mut scratch)?.sigma,
    };
    let training = Observations::new(arm, run, sigma, |sample| !sample.held_out);
    let heldout = Observations::new(arm, run, sigma, |sample| sample.held_out);
    let of_rows = |parts: &[usize]| -> Vec<usize> { training.rows.iter().map(|row| parts[row.sample]).collect() };
    let folds = match (run.choice.parts_in_turn(), &run.choice.parts) {
        (Some(parts), _) => of_rows(parts),
        (None, Some(parts)) => folds(&of_rows(parts), options.seed),
        (None, None) => folds(&training.groups(), options.seed),
    };
    Ok(Search::new(ToolPose { training, heldout, folds, scratch }))
}

/// Without repeats: the model's own residuals tell the noise to weigh the axes by, though they hold more than noise.
fn scatter(arm: &Arm, run: &Run, scratch: &mut ArmScratch) -> Result<Noise, NoPose> {
    let plain = Observations::new(arm, run, [1.0; 6], |sample| !sample.held_out);
    let residuals = plain.residuals(&arm.model, scratch)?;
    Ok(noise::of_residuals(arm, &plain, &residuals))
}

/// The same search in the noise that the residuals tell once the effects that are found first are taken out.
fn rescaled(arm: &Arm, mut search: Search<ToolPose>) -> Result<Search<ToolPose>, NoPose> {
    let start = search.kind.fitted(&arm.model)?;
    let (best, _) = search.run(start)?;
    let sigma = noise::of_residuals(arm, &search.kind.training, &best.fit.residuals).sigma;
    let ToolPose { training, heldout, folds, scratch } = search.kind;
    let (training, heldout) = (training.with_noise(sigma), heldout.with_noise(sigma));
    Ok(Search::new(ToolPose { training, heldout, folds, scratch }))
}

fn conclude(
    arm: &Arm,
    run: &Run,
    search: &mut Search<ToolPose>,
    repeats: Option<Noise>,
    options: &Options,
) -> Result<Diagnosis, NoPose> {
    let n_known = arm.model.effects.len();
    let before = search.kind.training.residuals(&arm.model, &mut search.kind.scratch)?;
    let start = search.kind.fitted(&arm.model)?;
    let (best, rivals) = search.run(start.clone())?;
    let found = best.fit.model.effects.len() - n_known;
    let look = |search: &Search<ToolPose>, residuals: &[f64], fitted: usize| {
        structure(arm, run, &search.kind.training, residuals, fitted, repeats.as_ref())
    };
    let left =
        |search: &Search<ToolPose>, trial: &Trial<ToolPose>| look(search, &trial.fit.residuals, trial.fit.values.len());
    let mut structure = look(search, &before, 0);
    let mut remaining = left(search, &best);
    let alternatives = alternatives(arm, search, &best, rivals, n_known)?;
    let effects: Vec<Effect<f64>> = best.fit.model.effects.iter().skip(n_known).copied().collect();
    let ambiguous = alternatives.iter().any(|other| !same_part(other, &effects));
    let verdict = verdict(found, ambiguous, &structure, &remaining);
    let mut with_terms = Vec::new();
    if matches!(verdict, Verdict::EffectFound | Verdict::UnexplainedStructure) {
        with_terms.extend(terms::kept(search, &best, &mut remaining, left)?);
    }
    if verdict == Verdict::UnexplainedStructure {
        // What laws stand in for in the best model may be terms alone.
        with_terms.extend(terms::kept(search, &start, &mut structure, left)?);
    }
    let with_terms = with_terms.into_iter().min_by(|a, b| a.loss.total_cmp(&b.loss));
    let with_terms = with_terms.map(|with| WithTerms::of(search, &with)).transpose()?;
    let condition = condition(&best.fit, &search.kind.training);
    let summary = summary::Summary { arm, run, search, best: &best, n_known };
    let mut diagnosis = summary.diagnosis(verdict, repeats, (structure, remaining), alternatives, options)?;
    diagnosis.condition = condition;
    diagnosis.with_terms = with_terms;
    diagnosis.plain = words::sentences(arm, &diagnosis, &effects);
    Ok(diagnosis)
}

/// Whether an alternative is the effect that it could replace, up to which end of the part it names.
fn same_part(other: &Alternative, effects: &[Effect<f64>]) -> bool {
    let effect = &effects[other.instead_of];
    let part = |place: &str| place.split(',').next().map(str::to_string);
    other.law == effect.law().name() && part(&other.place) == part(&candidate::place_code(effect))
}

fn verdict(found: usize, ambiguous: bool, before: &Structure, after: &Structure) -> Verdict {
    let excess = |structure: &Structure| structure.ratio.map_or(0.0, |ratio| ratio - 1.0).max(0.0);
    let left = excess(after) > UNEXPLAINED_SHARE * excess(before) && after.beyond_noise;
    match found {
        0 if before.beyond_noise => Verdict::UnexplainedStructure,
        0 => Verdict::NoEffect,
        _ if left => Verdict::UnexplainedStructure,
        _ if ambiguous => Verdict::NotIdentifiable,
        _ => Verdict::EffectFound,
    }
}

/// For every effect found: what else explains the measurements as well in its place.
fn alternatives(
    arm: &Arm,
    search: &mut Search<ToolPose>,
    best: &Trial<ToolPose>,
    last_rivals: Vec<Trial<ToolPose>>,
    n_known: usize,
) -> Result<Vec<Alternative>, NoPose> {
    let n = best.fit.model.effects.len();
    let mut all = Vec::new();
    for effect in n_known..n {
        let known = (effect + 1 == n && !last_rivals.is_empty()).then(|| last_rivals.clone());
        let own = best.fit.model.effects[effect];
        for (rival, worse_with) in search.rivals(best, effect, effect, known)? {
            let Some(other) = rival.effect.filter(|other| !candidate::same(other, &own)) else { continue };
            all.push(Alternative {
                instead_of: effect - n_known,
                law: other.law().name(),
                place: candidate::place_code(&other),
                place_name: candidate::place_name(arm, &other),
                cross_validated: rival.error,
                worse_with,
            });
        }
    }
    Ok(all)
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::EffectFound => "effect-found",
            Self::NoEffect => "no-effect",
            Self::UnexplainedStructure => "unexplained-structure",
            Self::NotIdentifiable => "not-identifiable",
        })
    }
}

#[cfg(test)]
mod tests;
