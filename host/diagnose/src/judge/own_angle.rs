//! A body that adds what its joint's own angle gives: a spring balancer of that joint does the same.
//!
//! On an upright axis, or where nothing else moves, the weight of a link is a torque a·sin q + b·cos q of one joint. So is that of
//! a spring on a lever, or of a counterweight: no motion distinguishes them, but by the inertia of the body where the rows show it.

use crate::effect::{LawName, Place};
use crate::judge::held_out::HeldOut;
use crate::judge::regression::{Design, Term, of_axis};
use crate::judge::selected::SelectedSignals;
use crate::measured::Measured;
use crate::outcome::{Regressor, Shape};
use crate::progress::Cancelled;
use crate::select::problem::{Neighbours as _, RegressionProblem as _};

/// Share of what a body adds, in squares of the noise, that is on one joint where it is that joint's alone.
const ON_ONE_JOINT: f64 = 0.98;

/// The spring of a joint, as a candidate, that does as well as the body with this number in the model.
///
/// # Errors
///
/// The diagnosis was given up.
pub(super) fn balancer(selected: &SelectedSignals, order: usize) -> Result<Option<usize>, Cancelled> {
    let SelectedSignals { problem, best, .. } = selected;
    let (experiment, body) = (&problem.experiment, selected.candidate(order));
    let is_link = matches!(body.site.place, Place::Link(_));
    if experiment.kind != Measured::JointTorque || body.law != LawName::MassDistribution || !is_link {
        return Ok(None);
    }
    let Some(joint) = only_joint(selected, order) else { return Ok(None) };
    let name = format!("position of joint {}", joint + 1);
    let angle = experiment.channels.iter().find(|(channel, _)| *channel == name);
    let Some((_, angle)) = angle else { return Ok(None) };
    let regressor = Regressor::Signals(vec![name]);
    let columns = [f64::sin, f64::cos].map(|of| angle.iter().map(|q| of(*q)).collect()).into();
    let term = Term { regressor, shape: Shape::Straight, columns, kept: Vec::new() };
    let Some(design) = Design::new(&term, &problem.groups.training) else { return Ok(None) };
    let without = problem.neighbours(best)?.with_one_less(order)?;
    let n_axes = experiment.axes.len();
    let (mut by_spring, by_body) = (experiment.at(&without.fit.values), experiment.at(&best.fit.values));
    let left = design.take(&of_axis(&by_spring, n_axes, joint)).left;
    let mean = problem.groups.training.iter().map(|&row| left[row]).sum::<f64>() / problem.groups.training.len() as f64;
    by_spring.iter_mut().skip(joint).step_by(n_axes).zip(left).for_each(|(own, left)| *own = left - mean);
    let is_worse = HeldOut { before: by_spring, after: by_body }.falls(&best.weighting.sigma, experiment.n_norm);
    let spring = |k: &usize| {
        let candidate = &experiment.candidates[*k];
        candidate.law == LawName::Spring && candidate.site.place == Place::Joint(joint)
    };
    Ok((0..experiment.candidates.len()).find(spring).filter(|_| !is_worse))
}

/// The one joint whose torque a body changes; `None` where it changes others as well.
fn only_joint(selected: &SelectedSignals, order: usize) -> Option<usize> {
    let SelectedSignals { problem, best, .. } = selected;
    let (experiment, n_axes) = (&problem.experiment, problem.experiment.axes.len());
    let mut added = vec![0.0; experiment.residuals.len()];
    for (value, index) in selected.candidate(order).values.iter().zip(problem.indices(&[best.fit.active[order]])) {
        added.iter_mut().zip(&value.column).for_each(|(added, slope)| *added += slope * best.fit.values[index]);
    }
    let square = |axis: usize| {
        let noise = best.weighting.sigma[axis].max(f64::MIN_POSITIVE);
        added.iter().skip(axis).step_by(n_axes).map(|added| (added / noise).powi(2)).sum::<f64>()
    };
    let squares: Vec<f64> = (0..n_axes).map(square).collect();
    squares.iter().position(|square| *square > ON_ONE_JOINT * squares.iter().sum::<f64>())
}
