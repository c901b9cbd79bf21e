//! The verdict on tool poses: what else explains them, what the residual depends on, and what is named.

use darm_core::effect::Effect;

use super::fitted_terms::{WithTerms, with_terms};
use super::gate::{self, Evidence, UNEXPLAINED_SHARE};
use super::lack_of_fit::{AxisLeft, MAX_OVER_NOISE, exceeds_noise};
use super::next_words::{self, Proposal};
use super::regression::of_axis;
use super::selected::SelectedPoses;
use super::structure::structure;
use super::{Judgement, far_rows, pose_intervals};
use crate::agreement;
use crate::linearise::arm_candidates;
use crate::outcome::{self, Alternative, AxisFigure, Number, Repeatability, RepeatedIn, Structure, Verdict};
use crate::prepare::observations::{NoPose, axes};
use crate::prepare::repeatability::PoseRepeatability;
use crate::progress::Cancelled;
use crate::select::forward::rivals;
use crate::select::poses::{NoTrial, ToolPoses};
use crate::select::problem::{RegressionProblem as _, Trial};
use darm_arm::arm::{Arm, ArmScratch};

/// Share that may be left by effects which are named beside what remains: laws that only stand for another cause leave more.
const MAX_PARTLY_LEFT: f64 = 0.03;

/// Judges a selection, and keeps what no law explains; `start` is the model without the effects selected, fitted.
pub(crate) fn judge(
    selected: &SelectedPoses,
    start: &Trial<ToolPoses>,
    last_rivals: Vec<Trial<ToolPoses>>,
    how: Proposal,
) -> Result<(Judgement, Option<WithTerms>), NoTrial> {
    let SelectedPoses { arm, problem, best, .. } = *selected;
    let residuals = problem.training.residuals(&arm.model, &mut ArmScratch::default())?;
    let (mut before, mut remaining) = (structure(selected, &residuals, 0)?, structure_after(selected, best)?);
    let mut alternatives = alternatives(selected, last_rivals)?;
    let effects = selected.effects();
    let look = |trial: &Trial<ToolPoses>| structure_after(selected, trial);
    let with = with_terms(problem, best, &mut remaining.depends_on, look)?;
    let is_wrong_in_part = far_rows::are_too_many(far_rows::far_rows(selected).len(), problem.training.rows.len());
    let (mut selected_effects, is_confirmed) = pose_intervals::effects(selected)?;
    let changing = pose_intervals::withhold_of_changing(selected, &mut selected_effects);
    let (named, unconfirmed): (Vec<_>, Vec<_>) =
        selected_effects.into_iter().zip(is_confirmed).partition(|(_, is_confirmed)| *is_confirmed);
    let named: Vec<outcome::Effect> = named.into_iter().map(|(effect, _)| effect).collect();
    let unconfirmed: Vec<String> =
        unconfirmed.iter().map(|(effect, _)| format!("{} at {}", effect.law, effect.site.name)).collect();
    // They help together, and none of them by itself.
    let none_alone = named.is_empty() && effects.len() > 1;
    let explained =
        agreement::poses::explained(arm, selected.run, problem.training.distances_m(&best.unseen_residuals));
    let beyond_repeats = |trial: &Trial<ToolPoses>| Ok::<_, NoPose>(exceeds_noise(&left(selected, trial)?));
    let evidence = Evidence {
        agrees: selected.agreement.allows(effects.len(), explained),
        named: named.len(),
        is_ambiguous: none_alone || alternatives.iter().any(|other| !is_same_part(other, &effects)),
        was_beyond_noise: before.beyond_noise || is_wrong_in_part || beyond_repeats(start)?,
        is_left: is_wrong_in_part
            || !changing.is_empty()
            || beyond_repeats(best)?
            || remaining.beyond_noise
                && (remaining.over_noise > MAX_OVER_NOISE || remaining.excess > UNEXPLAINED_SHARE * before.excess),
        is_mainly_taken: remaining.excess <= MAX_PARTLY_LEFT * before.excess,
        held_out_falls: problem.held_out_falls(start, best)?,
        noise_dof: selected.repeatability.map_or(0, |noise| noise.dof),
    };
    let verdict = gate::verdict(&evidence);
    let mut kept = with.filter(|_| verdict.names_effects() || verdict == Verdict::UnexplainedStructure);
    if verdict == Verdict::UnexplainedStructure
        && let Some(alone) = with_terms(problem, start, &mut before.depends_on, look)?
        && kept.as_ref().is_none_or(|kept| problem.under(kept).is_lower(&alone, kept))
    {
        // What laws stood for in the best model are terms alone: the residual is that of the model as it is.
        kept = Some(alone);
        remaining = before.clone();
    }
    let with_terms = kept.map(|with| WithTerms::of(problem, &with)).transpose()?;
    if verdict.names_effects() {
        remaining.depends_on.splice(0..0, changing);
    }
    let mut next_measurement = None;
    if verdict == Verdict::NotIdentifiable {
        alternatives.splice(0..0, selected_as_alternatives(selected));
        next_measurement = Some(next_words::proposal(selected, &alternatives, how)?);
    }
    let judgement = Judgement {
        verdict,
        effects: if verdict.names_effects() { named } else { Vec::new() },
        alternatives,
        unobservable: pose_intervals::unobservable(best),
        unconfirmed,
        repeatability: selected.repeatability.map(|noise| repeatability(arm, noise)),
        is_noise_known: evidence.is_noise_known(),
        // What the residual correlates with is more, if too little to change the verdict.
        is_more_left: evidence.is_left || remaining.beyond_noise,
        structure: Some(before),
        remaining,
        next_measurement,
    };
    Ok((judgement, with_terms))
}

fn repeatability(arm: &Arm, noise: &PoseRepeatability) -> Repeatability {
    Repeatability {
        norm: Number::new(noise.distance_m, "m"),
        axes: axes(arm).iter().map(|&axis| AxisFigure::of_twist(axis, noise.sigma[axis])).collect(),
        dof: noise.dof,
        repeated_in: RepeatedIn::Rows,
    }
}

/// What a model leaves of each axis beside the noise of repeats, on the rows that fits see and on those that they do not; nothing
/// without repeats.
fn left(selected: &SelectedPoses, trial: &Trial<ToolPoses>) -> Result<Vec<AxisLeft>, NoPose> {
    let SelectedPoses { problem, .. } = *selected;
    let Some(noise) = selected.repeats() else { return Ok(Vec::new()) };
    let n_axes = problem.training.n_axes();
    let held_out = problem.held_out.residuals(&trial.fit.model, &mut ArmScratch::default())?;
    let rows = [(&trial.fit.residuals, trial.fit.values.len()), (&held_out, 0)];
    let left = |axis: usize| {
        rows.iter().filter_map(move |(residuals, fitted)| {
            AxisLeft::over_noise(
                axis,
                &of_axis(residuals, n_axes, axis),
                *fitted as f64 / n_axes as f64,
                1.0,
                noise.dof,
            )
        })
    };
    Ok((0..n_axes).flat_map(left).collect())
}

/// The structure that a model leaves.
fn structure_after(selected: &SelectedPoses, trial: &Trial<ToolPoses>) -> Result<Structure, Cancelled> {
    structure(selected, &trial.fit.residuals, trial.fit.values.len())
}

/// Whether an alternative is the effect that it could replace, up to which end of the part it names.
fn is_same_part(other: &Alternative, effects: &[Effect<f64>]) -> bool {
    let effect = &effects[other.instead_of];
    other.law == effect.name() && other.site.place.part() == crate::effect::Place::of_arm(effect).part()
}

/// For every effect selected: what else explains the measurements as well in its place.
fn alternatives(selected: &SelectedPoses, last_rivals: Vec<Trial<ToolPoses>>) -> Result<Vec<Alternative>, NoTrial> {
    let SelectedPoses { arm, problem, best, .. } = *selected;
    let (n_known, n) = (selected.n_known(), best.fit.model.effects.len());
    let mut all = Vec::new();
    for effect in n_known..n {
        let known = (effect + 1 == n && !last_rivals.is_empty()).then(|| last_rivals.clone());
        let own = best.fit.model.effects[effect];
        for (rival, worse_with) in rivals(problem, best, effect, known)? {
            let Some(other) = rival.effect.filter(|other| !arm_candidates::same(other, &own)) else { continue };
            all.push(Alternative {
                instead_of: effect - n_known,
                law: other.name(),
                site: arm_candidates::site(arm, &other),
                cross_validated: rival.error,
                worse_with,
            });
        }
    }
    Ok(all)
}

/// Of several effects that explain the measurements as well, those selected are listed among the alternatives too.
fn selected_as_alternatives(selected: &SelectedPoses) -> Vec<Alternative> {
    let alternative = |(instead_of, effect): (usize, &Effect<f64>)| Alternative {
        instead_of,
        law: effect.name(),
        site: arm_candidates::site(selected.arm, effect),
        cross_validated: selected.best.error,
        worse_with: 0.0,
    };
    selected.effects().iter().enumerate().map(alternative).collect()
}
