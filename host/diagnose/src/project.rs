//! Stage 4: projection to physically consistent bodies, and the effects that an inconsistent body replaced.
//!
//! Free inertial parameters reproduce much that is no body: a spring on its joint, say. Once the body is constrained to be
//! physically consistent, the rows that it no longer explains show which other effect is there.

use std::sync::Arc;

use darm_robot::rigid_body::cone::{Cone, ConicLeastSquares};
use nalgebra::DVector;

use crate::linearise::experiment::BodyCandidate;
use crate::select::factored::judged;
use crate::select::problem::{RegressionProblem as _, Trial};
use crate::select::signals::{Fit, Signals, Weighted};
use crate::select::significance::{DISCOVERY_LEVEL, RIVAL_LEVEL};

/// The last μ, in units of the log-likelihood.
const MIN_WEIGHT: f64 = 1e-3;

/// The model with physically consistent bodies, and with the effects beside them that this asks for.
pub fn project(problem: &Signals, best: Trial<Signals>) -> Trial<Signals> {
    let weighting = Arc::clone(best.weighting());
    let weighted = Weighted { problem, weighting: &weighting };
    let Some(consistent) = consistent(weighted, &best.fit) else { return best };
    let free = in_sample(weighted, best.fit, best.effect);
    let mut best = in_sample(weighted, consistent, best.effect);
    while problem.loss_reduction(&best, &free).p < RIVAL_LEVEL {
        let open: Vec<usize> = open(problem, &best.fit);
        let tried = open.iter().map(|&candidate| {
            let active = [&best.fit.active[..], &[candidate]].concat();
            let free = weighted.least_squares(active);
            in_sample(weighted, self::consistent(weighted, &free).unwrap_or(free), Some(candidate))
        });
        match tried.min_by(|a, b| a.loss.order(&b.loss)) {
            Some(next) if problem.loss_reduction(&best, &next).p * (open.len() as f64) < DISCOVERY_LEVEL => best = next,
            _ => break,
        }
    }
    Trial { fit: best.fit.clone(), ..judged(weighted, best.fit.active, best.effect) }
}

/// Effects that may be added beside bodies.
fn open(problem: &Signals, fit: &Fit) -> Vec<usize> {
    let is_body = |k: &usize| problem.experiment.bodies.iter().any(|body| body.candidate == *k);
    (0..problem.experiment.candidates.len()).filter(|k| !is_body(k) && !fit.active.contains(k)).collect()
}

/// A model judged by the rows that it was fitted to.
fn in_sample(weighted: Weighted, fit: Fit, effect: Option<usize>) -> Trial<Signals> {
    let predicted = weighted.training_residuals(&fit);
    weighted.predicting(fit, effect, predicted)
}

/// The values that fit best with physically consistent bodies; `None` where those of `fit` are consistent already.
fn consistent(weighted: Weighted, fit: &Fit) -> Option<Fit> {
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
