//! The effects selected for tool poses, with the confidence intervals of their values.

use super::constancy::Fitted;
use super::selected::SelectedPoses;
use crate::linearise::arm_candidates;
use crate::outcome::{Dependence, Effect, EffectValue, Number};
use crate::prepare::groups::Clusters;
use crate::prepare::observations;
use crate::select::poses::robust_fit::covariance;
use crate::select::poses::{NoTrial, ToolPoses, values};
use crate::select::problem::RegressionProblem as _;
use crate::select::problem::{Neighbours as _, Trial};
use crate::select::significance::quantile_975;

/// The effects selected, with intervals of their values; and of each whether rows that no fit has seen are predicted worse without it.
pub(crate) fn effects(selected: &SelectedPoses) -> Result<(Vec<Effect>, Vec<bool>), NoTrial> {
    let SelectedPoses { arm, problem, best, .. } = *selected;
    let fit = &best.fit;
    let half_widths = half_widths(selected);
    let (mut found, mut is_confirmed) = (Vec::new(), Vec::new());
    for (index, effect) in fit.model.effects.iter().enumerate().skip(selected.n_known()) {
        let value = |(column, &(_, value)): (usize, &observations::ValueIndex)| {
            let half = half_widths[column];
            let (quantity, value) = (effect.quantities()[value], effect.values()[value]);
            let ci95 = Some([value - half, value + half]);
            EffectValue { name: quantity.name.into(), value, unit: quantity.unit.into(), ci95, nominal: None }
        };
        let of_effect = fit.values.iter().enumerate().filter(|(_, (owner, _))| *owner == index);
        let without = without(selected, index)?;
        let gain_m = problem.held_out_m(&without)? - problem.held_out_m(best)?;
        found.push(Effect {
            law: effect.name(),
            site: arm_candidates::site(arm, effect),
            values: of_effect.map(value).collect(),
            held_out_gain: Some(Number::new(gain_m, "m")),
        });
        is_confirmed.push(problem.held_out_falls(&without, best)?);
    }
    Ok((found, is_confirmed))
}

/// Half the width of the interval of each value: by words, or by runs where there are enough and they differ by more.
fn half_widths(selected: &SelectedPoses) -> Vec<f64> {
    let SelectedPoses { problem, best, run, .. } = *selected;
    let (fit, training) = (&best.fit, &problem.training);
    let by = |groups: &[usize], n_groups: usize, dof: usize| -> Vec<f64> {
        let variances = covariance(fit, groups, n_groups).diagonal();
        variances.iter().map(|variance| quantile_975(dof) * variance.max(0.0).sqrt()).collect()
    };
    let by_words = by(&training.groups(), training.n_groups, training.n_groups.saturating_sub(fit.values.len()));
    let runs: Vec<usize> = training.rows.iter().map(|row| run.samples[row.sample].run as usize).collect();
    let Some(Clusters { of_rows, count }) = Clusters::of(&runs) else { return by_words };
    by_words.into_iter().zip(by(&of_rows, count, count - 1)).map(|(words, runs)| words.max(runs)).collect()
}

/// Takes the intervals from values that are not the same all the time; gives what the residual depends on by them.
pub(crate) fn withhold_of_changing(selected: &SelectedPoses, effects: &mut [Effect]) -> Vec<Dependence> {
    let SelectedPoses { problem, best, run, .. } = *selected;
    let (fit, rows) = (&best.fit, &problem.training.rows);
    let time_s: Vec<f64> = rows.iter().map(|row| run.samples[row.sample].time_s).collect();
    let reported = |(owner, _): &(usize, usize)| owner.checked_sub(selected.n_known());
    let owners: Vec<Option<usize>> = fit.values.iter().map(reported).collect();
    // Which value of its effect each one is: an effect has its values in a row.
    let numbers = (0..owners.len()).map(|k| owners[..k].iter().filter(|owner| **owner == owners[k]).count());
    let places: Vec<Option<(usize, usize)>> =
        owners.iter().zip(numbers).map(|(owner, number)| owner.map(|owner| (owner, number))).collect();
    let (groups, level) = (problem.training.groups(), problem.levels.structure);
    let fitted = Fitted { residuals: &fit.residuals, columns: &fit.columns, time_s: &time_s, groups: &groups, level };
    fitted.withhold_intervals(effects, &places).into_iter().map(|(_, dependence)| dependence).collect()
}

/// The best model refitted without one of its effects.
fn without(selected: &SelectedPoses, effect: usize) -> Result<Trial<ToolPoses>, NoTrial> {
    let SelectedPoses { arm, problem, best, .. } = *selected;
    if best.fit.model.effects.len() == selected.n_known() + 1 {
        return problem.fitted(&arm.model);
    }
    problem.neighbours(best)?.with_one_less(effect)
}

/// Values of the effects selected that no row identifies; on a planar arm, offsets out of the plane say.
pub(crate) fn unobservable(best: &Trial<ToolPoses>) -> Vec<String> {
    let name = |&(effect, value): &observations::ValueIndex| {
        let effect = &best.fit.model.effects[effect];
        format!("{} of {} at {}", effect.quantities()[value].name, effect.name(), arm_candidates::place_code(effect))
    };
    values(&best.fit.model).iter().filter(|value| !best.fit.values.contains(value)).map(name).collect()
}
