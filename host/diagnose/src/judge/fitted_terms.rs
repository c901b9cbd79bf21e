//! What no law explains, kept in the model as fitted terms of what the residual depends on.

use darm_core::effect::fitted_term::FittedTerm;
use darm_core::effect::{Effect, Frame};

use crate::linearise::sensitivity::Sensitivity;
use crate::outcome::{Dependence, Number, Structure};
use crate::prepare::observations::NoPose;
use crate::progress::Cancelled;
use crate::rejection::is_of_one_law;
use crate::select::poses::{NoTrial, ToolPoses};
use crate::select::problem::{RegressionProblem as _, Trial};
use crate::select::significance::DISCOVERY_LEVEL;
use darm_arm::arm::ArmScratch;

/// A model with fitted terms.
#[derive(Clone, Debug, PartialEq)]
pub struct WithTerms {
    /// All its effects.
    pub effects: Vec<Effect<f64>>,
    /// Its held-out error as a distance d, m.
    pub held_out_m: f64,
}

impl WithTerms {
    /// As a fit left it.
    pub(crate) fn of(problem: &ToolPoses, trial: &Trial<ToolPoses>) -> Result<Self, NoPose> {
        let effects = trial.fit.model.effects.iter().copied().collect();
        Ok(Self { effects, held_out_m: problem.held_out_m(trial)? })
    }
}

/// A model with what remains of it as fitted terms, until nothing remains that may be kept; `depends_on` is what is available
/// before, with what each term gains put in, and `structure` finds it. `None` where no term is worth it.
pub(crate) fn with_terms(
    problem: &ToolPoses,
    base: &Trial<ToolPoses>,
    depends_on: &mut [Dependence],
    structure: impl Fn(&Trial<ToolPoses>) -> Result<Structure, Cancelled>,
) -> Result<Option<Trial<ToolPoses>>, NoTrial> {
    let n_effects = |trial: &Trial<ToolPoses>| problem.n_effects(&trial.fit);
    let mut before = n_effects(base);
    let mut with = add_terms(problem, base, depends_on)?;
    let is_any = n_effects(&with) > before;
    while n_effects(&with) > before {
        before = n_effects(&with);
        with = add_terms(problem, &with, &mut structure(&with)?.depends_on)?;
    }
    Ok(is_any.then_some(with))
}

/// A model with a term of each dependence that predicts unseen rows better than by chance; what that gains is noted at the
/// dependence.
fn add_terms(
    problem: &ToolPoses,
    base: &Trial<ToolPoses>,
    depends_on: &mut [Dependence],
) -> Result<Trial<ToolPoses>, NoTrial> {
    let (mut with, n_tried) = (base.clone(), depends_on.len());
    let mut held_out_m = problem.held_out_m(base)?;
    for dependence in depends_on.iter_mut().filter(|dependence| !dependence.terms.is_empty()) {
        let frame = dependence.frame.unwrap_or(Frame::Tool);
        let mut model = with.fit.model.clone();
        let terms = dependence.terms.iter().map(|&(of, square)| FittedTerm { of, square, frame, values: [0.0; 6] });
        let has_room = terms.map(|term| model.effects.push(Effect::FittedTerm(term))).all(|pushed| pushed.is_ok());
        // A term that leaves the arm without a pose somewhere is not the one.
        let trial = has_room.then(|| problem.fitted(&model).ok()).flatten();
        problem.progress().check()?;
        let Some(trial) = trial else { continue };
        let is_gain = problem.under(&with).predicts_better_among(&trial, &with, n_tried, DISCOVERY_LEVEL);
        if is_gain && !replaces_rejected(problem, &with, &trial)? {
            let left_m = problem.held_out_m(&trial)?;
            dependence.held_out_gain = Some(Number::new(held_out_m - left_m, "m"));
            (with, held_out_m) = (trial, left_m);
        }
    }
    Ok(with)
}

/// Whether a term changes what a rejected effect would.
fn replaces_rejected(problem: &ToolPoses, before: &Trial<ToolPoses>, after: &Trial<ToolPoses>) -> Result<bool, NoPose> {
    if problem.rejected.is_empty() {
        return Ok(false);
    }
    let residuals = before.fit.residuals.iter().zip(&after.fit.residuals);
    let change: Vec<f64> = residuals.map(|(before, after)| after - before).collect();
    let sensitivity = Sensitivity::new(&before.fit.model, &problem.training, &mut ArmScratch::default())?;
    let columns = problem.rejected.iter().flat_map(|effect| {
        let column = |value: usize| Some((effect.name(), sensitivity.column(effect, value)?));
        (0..effect.values().len()).filter_map(column).collect::<Vec<_>>()
    });
    Ok(is_of_one_law(&change, columns.collect()))
}
