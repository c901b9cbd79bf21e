//! How the selection searches among models of signals: weights until they converge, neighbours, and how two models compare.

use std::sync::Arc;

use super::factored::{Factored, judged};
use super::{Move, NEGLIGIBLE_LOSS, SignalFit, Signals, Weighting, in_noise};
use crate::progress::{Cancelled, Progress};
use crate::select::problem::{CandidateName, Loss, Neighbours, Policy, RegressionProblem, Trial, Weighted};
use crate::select::significance::{DISCOVERY_LEVEL, LossReduction, SIGNAL_RIVAL_LEVEL, paired_t_test};

/// The most effects of one model.
const MAX_EFFECTS: usize = 60;
/// Rounds of weights and noise: until the noise of no axis changes by more than this share.
const MIN_ROUNDS: usize = 2;
const MAX_ROUNDS: usize = 50;
const NOISE_REL_TOL: f64 = 1e-3;
/// Fits of a candidate to residuals that are not linear: each takes an error of a share x to about x².
const MAX_REFITS: usize = 3;
/// Candidates times folds up to which exchanges are worth their time.
const MAX_TO_EXCHANGE: usize = 1200;

/// A model whose neighbours are to be computed, factorised.
pub struct SignalNeighbourhood<'a> {
    factored: Factored<'a>,
    fit: &'a SignalFit,
}

impl Neighbours<Signals> for SignalNeighbourhood<'_> {
    fn with_one_more(&self) -> Result<Vec<Trial<Signals>>, Cancelled> {
        let problem = self.factored.weighted.problem;
        let open: Vec<(Move, Vec<usize>)> =
            problem.moves().filter_map(|one| Some((one, added(problem, one, self.fit)?))).collect();
        self.factored.with(&open)
    }

    fn with_one_less(&self, effect: usize) -> Result<Trial<Signals>, Cancelled> {
        let mut without = self.factored.without(&[self.fit.active[effect]])?;
        without.effect = without.fit.active.last().copied().map(Move::of_candidate);
        Ok(without)
    }
}

impl Signals {
    /// The name of one candidate, or of one law at several places.
    pub(super) fn name_of(&self, candidates: &[usize]) -> CandidateName {
        let first = &self.experiment.candidates[candidates[0]];
        let shape = first.shape.as_ref();
        let text = if candidates.len() > 1 { format!("{} places", candidates.len()) } else { first.site.code.clone() };
        CandidateName {
            law: first.law,
            places: candidates.iter().map(|&k| self.experiment.candidates[k].site.place).collect(),
            constant: shape.map(|(_, constant, _)| *constant),
            text: text
                + &shape.map_or(String::new(), |(name, value, unit)| format!(", {name} {} {unit}", digits(*value))),
        }
    }

    /// The model with these candidates, under the weighting that its residuals give.
    ///
    /// # Errors
    ///
    /// The diagnosis was given up.
    pub(crate) fn fitted(&self, active: Vec<usize>) -> Result<Trial<Self>, Cancelled> {
        self.reweight_until_converged(self.start(active))
    }
}

impl RegressionProblem for Signals {
    type Effect = Move;
    type Fit = SignalFit;
    type Weighting = Weighting;
    type Neighbours<'a> = SignalNeighbourhood<'a>;
    type Error = Cancelled;

    fn policy(&self) -> Policy {
        let exchanges = self.moves().len() * self.groups.n_folds < MAX_TO_EXCHANGE;
        Policy {
            max_effects: MAX_EFFECTS,
            laws_overlap: true,
            exchanges,
            discovery_level: DISCOVERY_LEVEL,
            rival_level: SIGNAL_RIVAL_LEVEL,
        }
    }

    fn progress(&self) -> &Progress {
        &self.progress
    }

    fn n_effects(&self, fit: &SignalFit) -> usize {
        fit.active.len()
    }

    fn n_values(&self, fit: &SignalFit) -> usize {
        self.indices(&fit.active).len()
    }

    fn name(&self, effect: &Move) -> CandidateName {
        self.name_of(self.candidates_of(*effect))
    }

    fn reweight_until_converged(&self, model: Trial<Self>) -> Result<Trial<Self>, Cancelled> {
        let (mut best, mut before) = (model, Vec::new());
        for round in 0..MAX_ROUNDS {
            let linearised = self.linearise(&best.fit.values)?;
            let residuals = linearised.residuals(&best.fit.values);
            let sigma = self.noise(&residuals);
            let residuals = in_noise(residuals, &sigma);
            let is_same = |(now, before): (&f64, &f64)| (now / before - 1.0).abs() < NOISE_REL_TOL;
            if round >= MIN_ROUNDS && sigma.iter().zip(&before).all(is_same) {
                // The equations are those of the round before, the noise is the last one: they differ by the tolerance.
                best.weighting = Arc::new(Weighting {
                    autocorrelation_time: self.groups.autocorrelation_time(&residuals, sigma.len()),
                    sigma,
                    has_converged: true,
                    linearised,
                    ..Weighting::clone(&best.weighting)
                });
                return Ok(best);
            }
            before.clone_from(&sigma);
            let weighting = Arc::new(self.weigh(&residuals, sigma, linearised)?);
            let under = Weighted { problem: self, weighting: &weighting };
            best = judged(under, best.fit.active, best.effect)?;
        }
        Ok(best)
    }

    fn neighbours<'a>(&'a self, model: &'a Trial<Self>) -> Result<SignalNeighbourhood<'a>, Cancelled> {
        Ok(SignalNeighbourhood {
            factored: Factored::new(self.under(model), model.fit.active.clone())?,
            fit: &model.fit,
        })
    }

    /// Where the residuals are linear, a linear fit is a full one.
    fn refitted(&self, trial: &Trial<Self>) -> Result<Trial<Self>, Cancelled> {
        let mut refitted = trial.clone();
        for _ in 0..MAX_REFITS {
            let Some(linearised) = self.moved_on(&refitted)? else { break };
            let weighting = Arc::new(trial.weighting.at(linearised));
            let under = Weighted { problem: self, weighting: &weighting };
            refitted = judged(under, refitted.fit.active, refitted.effect)?;
        }
        // It is compared under the weighting that the others have.
        Ok(Trial { weighting: Arc::clone(&trial.weighting), ..refitted })
    }

    fn loss(&self, weighting: &Weighting, unseen: &[f64]) -> Loss {
        Loss::new(weighting.losses(unseen).sum())
    }

    fn loss_reduction(&self, weighting: &Weighting, before: &[f64], after: &[f64]) -> LossReduction {
        let n_axes = self.experiment.axes.len();
        let mut cells = vec![[0.0; 2]; self.groups.n_blocks * n_axes];
        let pairs = weighting.losses(before).zip(weighting.losses(after));
        let is_own = |(k, _): &(usize, _)| self.experiment.axes[k % n_axes].proves();
        for (k, (before, after)) in pairs.enumerate().filter(is_own) {
            let cell = &mut cells[self.groups.blocks[k / n_axes] * n_axes + k % n_axes];
            cell[0] += before;
            cell[1] += after;
        }
        cells.retain(|[before, after]| before != after);
        let sum: f64 = cells.iter().map(|[before, after]| before - after).sum();
        // Models that predict the same differ by rounding, always to one side.
        match paired_t_test(&cells) {
            reduction if sum.abs() < NEGLIGIBLE_LOSS => LossReduction { p: 1.0, ..reduction },
            reduction => reduction,
        }
    }
}

/// The candidates that a move adds to a model; `None` where it adds nothing, or where another move adds the same.
fn added(problem: &Signals, one: Move, fit: &SignalFit) -> Option<Vec<usize>> {
    let all = problem.candidates_of(one);
    let candidates = &problem.experiment.candidates;
    let added: Vec<usize> = match all {
        [one] => (!fit.active.contains(one)).then_some(*one).into_iter().collect(),
        several => {
            let is_open = |k: &&usize| !fit.active.iter().any(|&other| candidates[other].is_same(&candidates[**k]));
            several.iter().filter(is_open).copied().collect()
        }
    };
    (added.len() >= all.len().min(2)).then_some(added)
}

/// A constant of a law with two digits at least: a creep speed may be a hundredth of a millimetre a second.
fn digits(value: f64) -> String {
    if value >= 0.1 { format!("{value:.3}") } else { format!("{value:.1e}") }
}
