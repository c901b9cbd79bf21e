//! The selection for signals: forward, backward and simplification, in the order that the kind of priors asks for.

use super::Signals;
use super::backward::{Selected, all_laws, backward_elimination, eliminate};
use super::factored::judged;
use super::simplify::{simpler_of, simplified};
use crate::select::forward::forward_selection;
use crate::select::problem::{RegressionProblem as _, Trial};
use crate::select::significance::RIVAL_LEVEL;

/// Selects a model as [`select`] does, and compares it with what elimination leaves of `before`, the effects that the search
/// before selected near another model. Returns the better one of the two.
///
/// # Errors
///
/// The diagnosis was given up.
pub fn select_again(problem: &Signals, known: Vec<usize>, before: Vec<usize>) -> Selected {
    let (left, path_left) = eliminate(problem, problem.fitted(before)?, known.len())?;
    let (selected, path) = select(problem, known)?;
    let left = problem.refitted(&judged(problem.under(&selected), left.fit.active, None)?)?;
    if simpler_of(problem, &selected, &left).fit.active == selected.fit.active {
        return Ok((selected, path));
    }
    Ok((problem.reweight_until_converged(left)?, path_left))
}

/// The model that was selected, under the weighting of its residuals, and what was tried.
///
/// # Errors
///
/// The diagnosis was given up.
pub fn select(problem: &Signals, known: Vec<usize>) -> Selected {
    let n_known = known.len();
    let start = problem.start(known);
    let (best, path) = match problem.experiment.all_priors_informative() {
        true => sparse_or_full(problem, &start)?,
        false => forward_and_backward(problem, &start)?,
    };
    let best = problem.reweight_until_converged(best)?;
    let best = problem.reweight_until_converged(simplified(problem, best, n_known)?)?;
    Ok((best, path))
}

/// Where all values have priors: every law at every place, unless a few effects predict unseen rows as well. Each predicts
/// them with the columns near its own values: those of other values may be off by more than the noise.
fn sparse_or_full(problem: &Signals, start: &Trial<Signals>) -> Selected {
    let sparse = forward_selection(problem, start.clone(), Vec::new())?;
    let (full, path) = all_laws(problem, start)?;
    Ok(match problem.under(&full).predicts_better(&full, &sparse.best, RIVAL_LEVEL) {
        true => (full, path),
        false => (sparse.best, sparse.path),
    })
}

/// The better one of two models: that to which effects were added, and that from which they were taken away.
fn forward_and_backward(problem: &Signals, start: &Trial<Signals>) -> Selected {
    let grown = forward_selection(problem, start.clone(), Vec::new())?;
    let (left, path) = backward_elimination(problem, start)?;
    let grown_best = problem.refitted(&judged(problem.under(&left), grown.best.fit.active, None)?)?;
    if simpler_of(problem, &grown_best, &left).fit.active != left.fit.active {
        return Ok((grown_best, grown.path));
    }
    let more = forward_selection(problem, left, path)?;
    Ok((more.best, more.path))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;
    use crate::effect::{LawName, Place, Site};
    use crate::linearise::experiment::{Axis, Candidate, Curvature, Experiment};
    use crate::measured::Measured;
    use crate::prepare::groups::{Groups, SignalRow};
    use crate::progress::{Cancelled, Progress};

    const ROWS: usize = 600;

    /// A joint whose speed waves. Whoever waits gives up when the model is asked for the n-th time.
    fn given_up_at(n: usize, n_asked: &Arc<AtomicUsize>) -> Signals {
        let speed = |k: usize| (k as f64 * 0.11).sin();
        let column = |of: fn(f64) -> f64| (0..ROWS).map(|k| of(speed(k))).collect::<Vec<f64>>();
        let shapes: [fn(f64) -> f64; 3] = [|v| v, |v| (v / 0.05).tanh(), |_| 1.0];
        let columns = shapes.map(column).to_vec();
        let laws = [LawName::ViscousFriction, LawName::CoulombFriction, LawName::Offset];
        let candidates = laws.into_iter().zip(&columns).map(|(law, column)| {
            Candidate::one(law, Site::new(Place::Joint(0), "joint 1"), ("size", "N·m"), column.clone())
        });
        let noise = |k: usize| 0.02 * ((k * 7919 % 1013) as f64 / 1013.0 - 0.5);
        let residuals: Vec<f64> = (0..ROWS).map(|k| noise(k) - 0.8 * speed(k) - 0.1).collect();
        let progress = Progress::default();
        let (of_model, asked, measured) = (progress.clone(), Arc::clone(n_asked), residuals.clone());
        let all_columns = columns.clone();
        let relinearise = move |values: &[f64]| {
            if asked.fetch_add(1, Ordering::Relaxed) + 1 == n {
                of_model.cancel();
            }
            let moved = |k: usize| all_columns.iter().zip(values).map(|(column, value)| column[k] * value).sum::<f64>();
            ((0..ROWS).map(|k| measured[k] + moved(k)).collect(), all_columns.clone())
        };
        let row = |k: usize| SignalRow { line: k, time_s: k as f64, series: 0, motion: 0, key: None, held_out: false };
        let experiment = Experiment {
            kind: Measured::JointTorque,
            axes: vec![Axis::new("1", "N·m")],
            n_norm: 1,
            rows: (0..ROWS).map(row).collect(),
            residuals,
            measured: None,
            candidates: candidates.collect(),
            channels: Vec::new(),
            bodies: Vec::new(),
            findings: Vec::new(),
            curvature: Curvature::Relinearise(Box::new(relinearise)),
        };
        let groups = Groups::new(&experiment.rows);
        Signals::new(experiment, groups).with_progress(progress)
    }

    #[test]
    fn a_search_that_is_given_up_asks_the_model_no_more() {
        let n_asked = Arc::default();
        let problem = given_up_at(usize::MAX, &n_asked);
        assert_eq!(select(&problem, Vec::new()).unwrap().0.fit.active, [0, 2]);
        let all = n_asked.load(Ordering::Relaxed);
        assert!(all > 10, "{all}");
        // After the last time nothing is left to be done.
        for n in 1..all {
            let n_asked = Arc::default();
            let problem = given_up_at(n, &n_asked);
            assert_eq!(select(&problem, Vec::new()).err(), Some(Cancelled), "{n} of {all}");
            assert_eq!(n_asked.load(Ordering::Relaxed), n, "of {all}");
        }
    }
}
