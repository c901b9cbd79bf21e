//! Stage 4: projection to physically consistent bodies, and the effects that an inconsistent body replaced.
//!
//! Free inertial parameters reproduce much that is no body: a spring on its joint, say. Once the body is constrained to be
//! physically consistent, the rows that it no longer explains show which other effect is there.

use std::sync::Arc;

use darm_robot::rigid_body::inertia::{self, project_physically_consistent};
use nalgebra::{DMatrix, DVector, Matrix4, SMatrix, SVector};

use crate::linearise::experiment::BodyCandidate;
use crate::select::factored::judged;
use crate::select::problem::{RegressionProblem as _, Trial};
use crate::select::signals::{Fit, Signals, Weighted, solve};
use crate::select::significance::{DISCOVERY_LEVEL, RIVAL_LEVEL};

/// μ, in units of the log-likelihood.
const WEIGHTS: [f64; 6] = [1e2, 1e1, 1.0, 1e-1, 1e-2, 1e-3];
/// Steps of Newton's method for each μ, halvings of one, and the fall below which there is none.
const NEWTON: usize = 40;
const SHORTEST: i32 = 40;
const LEAST_FALL: f64 = 1e-6;
/// Share of a body's inertia that is added to begin inside the cone.
const INSIDE: f64 = 1e-2;

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
///
/// A body is consistent when its pseudo-inertia is positive definite, which is linear in its inertial parameters: the least
/// squares are solved in the cone by an interior-point method, −μ·log det for each body, with μ falling until it does not
/// matter. Source: P. M. Wensing, S. Kim, J.-J. Slotine, IEEE Robotics and Automation Letters 3 (2018) 60.
fn consistent(weighted: Weighted, fit: &Fit) -> Option<Fit> {
    let problem = weighted.problem;
    let indices = problem.indices(&fit.active);
    let of = |body: &BodyCandidate| {
        let own = problem.indices(&[body.candidate])[0];
        let first = indices.iter().position(|index| *index == own)?;
        Some(Cone { first, nominal: body.nominal })
    };
    let bodies = problem.experiment.bodies.iter().filter(|body| fit.active.contains(&body.candidate));
    let cones: Vec<Cone> = bodies.filter_map(of).collect();
    let mut values = DVector::from_iterator(indices.len(), indices.iter().map(|&index| fit.values[index]));
    let is_consistent = |cone: &Cone| {
        let body = cone.body(&values);
        project_physically_consistent(&body, &cone.nominal) == body
    };
    if cones.iter().all(is_consistent) {
        return None;
    }
    cones.iter().for_each(|cone| cone.start(&mut values));
    let (information, gradient) = weighted.equations(&indices);
    for weight in WEIGHTS {
        for _ in 0..NEWTON {
            let Some(next) = newton(&information, &gradient, &cones, weight, &values) else { break };
            values = next;
        }
    }
    let mut fit = fit.clone();
    indices.iter().zip(values.iter()).for_each(|(&index, value)| fit.values[index] = *value);
    Some(fit)
}

/// A body among the values of a model.
struct Cone {
    /// Where its values begin.
    first: usize,
    /// What they are changes of.
    nominal: [f64; 10],
}

impl Cone {
    fn body(&self, values: &DVector<f64>) -> [f64; 10] {
        std::array::from_fn(|k| self.nominal[k] + values[self.first + k])
    }

    /// Puts the body where it was, made possible, so far inside that Newton's method can begin there.
    fn start(&self, values: &mut DVector<f64>) {
        let mut body = project_physically_consistent(&self.nominal, &self.nominal);
        let inside = INSIDE * (body[4] + body[6] + body[9] + f64::MIN_POSITIVE);
        [4, 6, 9].iter().for_each(|&k| body[k] += inside);
        (0..10).for_each(|k| values[self.first + k] = body[k] - self.nominal[k]);
    }

    /// −log det of the pseudo-inertia −log of what the mass is above the least; `None` outside.
    fn barrier(&self, values: &DVector<f64>) -> Option<f64> {
        let body = self.body(values);
        let root = inertia::pseudo_inertia(&body).cholesky()?;
        let spare = self.spare_kg(&body);
        (spare > 0.0).then(|| -2.0 * root.l().diagonal().map(f64::ln).sum() - spare.ln())
    }

    /// Its gradient and Hessian.
    fn slopes(&self, values: &DVector<f64>) -> Option<(SVector<f64, 10>, SMatrix<f64, 10, 10>)> {
        let body = self.body(values);
        let root = inertia::pseudo_inertia(&body).cholesky()?;
        let of_mass = 1.0 / self.spare_kg(&body);
        let unit =
            |k: usize| root.solve(&inertia::pseudo_inertia(&std::array::from_fn(|j| f64::from(u8::from(j == k)))));
        let units: [Matrix4<f64>; 10] = std::array::from_fn(unit);
        let mut gradient = SVector::from_fn(|k, _| -units[k].trace());
        let mut hessian = SMatrix::from_fn(|a, b| (units[a] * units[b]).trace());
        gradient[0] -= of_mass;
        hessian[(0, 0)] += of_mass * of_mass;
        Some((gradient, hessian))
    }

    /// By how much the mass is above the least, kg.
    fn spare_kg(&self, body: &[f64; 10]) -> f64 {
        body[0] - inertia::MIN_MASS_SHARE * self.nominal[0]
    }
}

/// One step of Newton's method on ½xᵀAx + gᵀx + μ·barriers, short enough to stay inside and to fall; `None` at the end.
fn newton(
    information: &DMatrix<f64>,
    gradient: &DVector<f64>,
    cones: &[Cone],
    weight: f64,
    values: &DVector<f64>,
) -> Option<DVector<f64>> {
    let (mut slope, mut curvature) = (information * values + gradient, information.clone());
    for cone in cones {
        let (of_slope, of_curvature) = cone.slopes(values)?;
        let mut slope = slope.fixed_rows_mut::<10>(cone.first);
        slope += of_slope * weight;
        let mut curvature = curvature.fixed_view_mut::<10, 10>(cone.first, cone.first);
        curvature += of_curvature * weight;
    }
    let step = -solve(curvature, &slope);
    let fall = -slope.dot(&step);
    if fall < LEAST_FALL {
        return None;
    }
    let at = |values: &DVector<f64>| -> Option<f64> {
        let barriers: Option<f64> = cones.iter().map(|cone| cone.barrier(values)).sum();
        Some(0.5 * values.dot(&(information * values)) + values.dot(gradient) + weight * barriers?)
    };
    let height = at(values)?;
    let mut steps = (0..SHORTEST).map(|k| (0.5f64.powi(k), values + &step * 0.5f64.powi(k)));
    let lower = |(share, next): &(f64, DVector<f64>)| at(next).is_some_and(|new| new < height - 0.1 * share * fall);
    steps.find(lower).map(|(_, next)| next)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_body_in_the_cone_is_on_its_border() {
        // A ball of 2 kg; the data want its first inertia at −1 kg·m² and all else as it is, each to 0.01 of its unit.
        let cone = Cone { first: 0, nominal: [2.0, 0.0, 0.0, 0.0, 0.02, 0.0, 0.02, 0.0, 0.0, 0.02] };
        let information = DMatrix::identity(10, 10) * 1e4;
        let mut wanted = DVector::zeros(10);
        wanted[4] = -1.02;
        let gradient = &information * &wanted * -1.0;
        let mut values = DVector::zeros(10);
        cone.start(&mut values);
        for weight in WEIGHTS {
            while let Some(next) = newton(&information, &gradient, std::slice::from_ref(&cone), weight, &values) {
                values = next;
            }
        }
        let body = cone.body(&values);
        // Nearest to (−1, 0.02, 0.02) with Iyy ≤ Ixx + Izz, Izz ≤ Ixx + Iyy and Ixx ≥ 0 is (0, 0.02, 0.02).
        assert!(body[4].abs() < 1e-4 && (body[6] - 0.02).abs() < 1e-4 && (body[9] - 0.02).abs() < 1e-4, "{body:?}");
        assert!(inertia::pseudo_inertia(&body).cholesky().is_some());
    }
}
