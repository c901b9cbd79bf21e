//! What no law explains, kept in the model as fitted terms of what the residual depends on.

use darm_core::effect::Effect;
use darm_core::effect::fitted_term::{FittedTerm, Frame};

use crate::judge::structure::{Dependence, Structure};
use crate::prepare::observations::NoPose;
use crate::select::forward::Search;
use crate::select::problem::{Kind as _, Trial};
use crate::select::significance::DISCOVERY_LEVEL;
use crate::select::tool_pose::ToolPose;

/// A model with fitted terms.
#[derive(Clone, Debug, PartialEq)]
pub struct WithTerms {
    /// All its effects.
    pub effects: Vec<Effect<f64>>,
    /// Its error on rows that no fit saw, as a distance d, m.
    pub unseen_m: f64,
}

impl WithTerms {
    /// As a fit left it.
    pub(crate) fn of(search: &mut Search<ToolPose>, trial: &Trial<ToolPose>) -> Result<Self, NoPose> {
        let effects = trial.fit.model.effects.iter().copied().collect();
        Ok(Self { effects, unseen_m: search.kind.unseen_m(trial)? })
    }
}

/// A model with what remains of it as fitted terms, until nothing remains that may be kept; `structure` is what there is
/// before, and `look` finds it. `None` where no term is worth it.
pub(crate) fn kept(
    search: &mut Search<ToolPose>,
    base: &Trial<ToolPose>,
    structure: &mut Structure,
    look: impl Fn(&Search<ToolPose>, &Trial<ToolPose>) -> Structure,
) -> Result<Option<Trial<ToolPose>>, NoPose> {
    let mut before = search.kind.n_effects(&base.fit);
    let mut with = added(search, base, &mut structure.depends_on)?;
    let any = search.kind.n_effects(&with.fit) > before;
    while search.kind.n_effects(&with.fit) > before {
        before = search.kind.n_effects(&with.fit);
        let mut left = look(search, &with).depends_on;
        with = added(search, &with, &mut left)?;
    }
    Ok(any.then_some(with))
}

/// A model with a term of each dependence that predicts unseen rows better than by chance; what that gains is told beside
/// the dependence.
fn added(
    search: &mut Search<ToolPose>,
    base: &Trial<ToolPose>,
    depends_on: &mut [Dependence],
) -> Result<Trial<ToolPose>, NoPose> {
    let (mut with, n_tried) = (base.clone(), depends_on.len() as f64);
    let mut unseen_m = search.kind.unseen_m(base)?;
    for dependence in depends_on.iter_mut().filter(|dependence| !dependence.kept.is_empty()) {
        let frame = if dependence.frame == "base" { Frame::Base } else { Frame::Tool };
        let mut model = with.fit.model.clone();
        let terms = dependence.kept.iter().map(|&(of, square)| FittedTerm { of, square, frame, values: [0.0; 6] });
        let room = terms.map(|term| model.effects.push(term.into())).all(|pushed| pushed.is_ok());
        // A term that leaves the arm without a pose somewhere is not the one.
        let Some(trial) = room.then(|| search.kind.fitted(&model).ok()).flatten() else { continue };
        let found = search.kind.fall(&with, &trial).p * n_tried < DISCOVERY_LEVEL;
        if found && search.kind.confirmed(&with, &trial)? {
            let left_m = search.kind.unseen_m(&trial)?;
            dependence.heldout_gain_m = Some(unseen_m - left_m);
            (with, unseen_m) = (trial, left_m);
        }
    }
    Ok(with)
}
