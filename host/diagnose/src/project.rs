//! Stage 4: projection to what can be: friction that takes power, physically consistent bodies, and the effects that an
//! inconsistent body replaced.
//!
//! Free inertial parameters reproduce much that is no body: a spring on its joint, say. Once the body is constrained to be
//! physically consistent, the rows that it no longer explains show which other effect is there.

use std::sync::Arc;

use darm_robot::rigid_body::cone::{Cone, ConicLeastSquares};
use nalgebra::DVector;

use crate::linearise::experiment::BodyCandidate;
use crate::progress::Cancelled;
use crate::select::problem::{RegressionProblem as _, Trial, Weighted};
use crate::select::signals::factored::judged;
use crate::select::signals::{Move, SignalFit, Signals};
use crate::select::significance::{DISCOVERY_LEVEL, RIVAL_LEVEL};

/// The last μ, in units of the log-likelihood.
const MIN_WEIGHT: f64 = 1e-3;

/// A model of what can be, and what had to go for it.
pub(crate) struct Projected {
    pub(crate) best: Trial<Signals>,
    /// The candidates that fit best with sizes which cannot be.
    pub(crate) impossible: Vec<usize>,
}

/// The model with what can be; the first `n_known` effects stay.
///
/// # Errors
///
/// The diagnosis was given up.
pub(crate) fn project(problem: &Signals, best: Trial<Signals>, n_known: usize) -> Result<Projected, Cancelled> {
    let (best, impossible) = possible(problem, best, n_known)?;
    Ok(Projected { best: with_consistent_bodies(problem, best)?, impossible })
}

/// The model without the effects whose sizes cannot be, and these; the one that is missed least goes first.
fn possible(
    problem: &Signals,
    mut best: Trial<Signals>,
    n_known: usize,
) -> Result<(Trial<Signals>, Vec<usize>), Cancelled> {
    let mut impossible = Vec::new();
    loop {
        let open = best.fit.active[n_known..].iter().copied();
        let cannot_be: Vec<usize> = open.filter(|&k| !can_be(problem, &best.fit, k)).collect();
        let candidates = &problem.experiment.candidates;
        let without = |&k: &usize| {
            let is_other = |other: &usize| !candidates[*other].is_same(&candidates[k]);
            let left = best.fit.active.iter().copied().filter(is_other).collect();
            Ok((k, judged(problem.under(&best), left, best.effect)?))
        };
        let tried = problem.under(&best).lowest(cannot_be.iter().map(without), |(_, trial)| trial)?;
        let Some((gone, next)) = tried else { return Ok((best, impossible)) };
        impossible.push(gone);
        best = next;
    }
}

/// Whether a law at its place, in all its shapes that a model has, is at least as large as is possible.
fn can_be(problem: &Signals, fit: &SignalFit, of: usize) -> bool {
    let candidates = &problem.experiment.candidates;
    let Some(min) = candidates[of].values.first().map(|value| value.min) else { return true };
    let own = fit.active.iter().filter(|&&k| candidates[k].is_same(&candidates[of]));
    own.map(|&k| fit.values[problem.indices(&[k])[0]]).sum::<f64>() >= min
}

/// The model with physically consistent bodies, and with the effects beside them that this asks for.
fn with_consistent_bodies(problem: &Signals, best: Trial<Signals>) -> Result<Trial<Signals>, Cancelled> {
    let weighting = Arc::clone(&best.weighting);
    let weighted = Weighted { problem, weighting: &weighting };
    problem.progress().check()?;
    let Some(consistent) = consistent(weighted, &best.fit) else { return Ok(best) };
    let free = in_sample(weighted, best.fit, best.effect);
    let mut best = in_sample(weighted, consistent, best.effect);
    while weighted.predicts_better(&free, &best, RIVAL_LEVEL) {
        let open: Vec<usize> = open(problem, &best.fit);
        let tried = open.iter().map(|&candidate| {
            problem.progress().check()?;
            let active = [&best.fit.active[..], &[candidate]].concat();
            let free = weighted.least_squares(active);
            let fit = self::consistent(weighted, &free).unwrap_or(free);
            Ok((candidate, in_sample(weighted, fit, Some(Move::of_candidate(candidate)))))
        });
        let is_possible = |tried: &Result<(usize, Trial<Signals>), Cancelled>| {
            tried.as_ref().map_or(true, |(added, trial)| can_be(problem, &trial.fit, *added))
        };
        match weighted.lowest(tried.filter(is_possible), |(_, trial)| trial)? {
            Some((_, next)) if weighted.predicts_better_among(&next, &best, open.len(), DISCOVERY_LEVEL) => best = next,
            _ => break,
        }
    }
    Ok(Trial { fit: best.fit.clone(), ..judged(weighted, best.fit.active, best.effect)? })
}

/// Effects that may be added beside bodies.
fn open(problem: &Signals, fit: &SignalFit) -> Vec<usize> {
    let is_body = |k: &usize| problem.experiment.bodies.iter().any(|body| body.candidate == *k);
    (0..problem.experiment.candidates.len()).filter(|k| !is_body(k) && !fit.active.contains(k)).collect()
}

/// A model judged by the rows that it was fitted to.
fn in_sample(weighted: Weighted<Signals>, fit: SignalFit, effect: Option<Move>) -> Trial<Signals> {
    let seen_residuals = weighted.problem.training_residuals(&fit);
    weighted.with_residuals(fit, effect, seen_residuals)
}

/// The values that fit best with physically consistent bodies; `None` where those of `fit` are consistent already.
fn consistent(weighted: Weighted<Signals>, fit: &SignalFit) -> Option<SignalFit> {
    let problem = weighted.problem;
    let indices = problem.indices(&fit.active);
    let of = |body: &BodyCandidate| {
        let own = problem.indices(&[body.candidate])[0];
        let first = indices.iter().position(|index| *index == own)?;
        Some(Cone::around(first, body.nominal))
    };
    let bodies = problem.experiment.bodies.iter().filter(|body| fit.active.contains(&body.candidate));
    let cones: Vec<Cone> = bodies.filter_map(of).collect();
    let mut values = DVector::from_iterator(indices.len(), indices.iter().map(|&index| fit.values[index]));
    if cones.iter().all(|cone| cone.is_consistent(&values)) {
        return None;
    }
    cones.iter().for_each(|cone| cone.start(&mut values));
    let (information, gradient) = weighted.equations(&indices);
    let problem = ConicLeastSquares { information, gradient, map: None, cones, floors: Vec::new() };
    let values = problem.solve(values, MIN_WEIGHT);
    let mut fit = fit.clone();
    indices.iter().zip(values.iter()).for_each(|(&index, value)| fit.values[index] = *value);
    Some(fit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::{LawName, Place, Site};
    use crate::linearise::experiment::{Axis, Candidate, Curvature, Experiment};
    use crate::measured::Measured;
    use crate::prepare::groups::{Groups, SignalRow};

    /// A joint whose speed waves, and a motor that gives power the more, the faster it turns.
    #[test]
    fn friction_that_would_give_power_goes_and_is_told() {
        let speed = |k: usize| (k as f64 * 0.11).sin();
        let noise = |k: usize| 0.02 * ((k * 7919 % 1013) as f64 / 1013.0 - 0.5);
        let row = |k: usize| SignalRow { line: k, time_s: k as f64, series: 0, motion: 0, key: None, held_out: false };
        let column = (0..600).map(speed).collect();
        let site = Site::new(Place::Joint(0), "joint 1");
        let mut viscous = Candidate::one(LawName::ViscousFriction, site, ("size", "N·m·s"), column);
        let with = |viscous: Candidate| {
            let experiment = Experiment {
                kind: Measured::JointTorque,
                axes: vec![Axis::new("1", "N·m")],
                n_norm: 1,
                rows: (0..600).map(row).collect(),
                residuals: (0..600).map(|k| 0.8 * speed(k) + noise(k)).collect(),
                measured: None,
                candidates: vec![viscous],
                channels: Vec::new(),
                bodies: Vec::new(),
                findings: Vec::new(),
                curvature: Curvature::None,
            };
            let groups = Groups::new(&experiment.rows);
            let problem = Signals::new(experiment, groups);
            let best = problem.fitted(vec![0]).unwrap();
            let Projected { best, impossible } = project(&problem, best, 0).unwrap();
            (best.fit.active, impossible)
        };
        assert_eq!(with(viscous.clone()), (vec![0], vec![]));
        viscous.values[0].min = 0.0;
        assert_eq!(with(viscous.clone()), (vec![], vec![0]));
        // A model that has 1 N·m·s of it may lose 0.8.
        viscous.values[0].min = -1.0;
        assert_eq!(with(viscous), (vec![0], vec![]));
    }
}
