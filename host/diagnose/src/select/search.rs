//! The selection for signals: forward, backward and simplification, in the order that the kind of priors asks for.

use super::backward::{all_laws, backward_elimination, without_unmissed};
use super::factored::judged;
use super::forward::{SelectionStep, forward_selection};
use super::problem::{RegressionProblem as _, Trial};
use super::signals::Signals;
use super::significance::RIVAL_LEVEL;
use super::simplify::{simplified, smaller_if_as_good};

/// The same where another search near this one selected `before`: the better one of the model that is selected here and of what
/// is left of that one.
pub fn select_again(problem: &Signals, known: Vec<usize>, before: Vec<usize>) -> (Trial<Signals>, Vec<SelectionStep>) {
    let (left, path_left) = without_unmissed(problem, problem.fitted(before), known.len());
    let (selected, path) = select(problem, known);
    let Ok(left) = problem.refitted(&judged(problem.under(&selected), left.fit.active, None));
    if smaller_if_as_good(problem, &selected, &left).fit.active == selected.fit.active {
        return (selected, path);
    }
    let Ok(left) = problem.reweight_until_converged(left);
    (left, path_left)
}

/// The model that was selected, under the weighting of its residuals, and what was tried.
pub fn select(problem: &Signals, known: Vec<usize>) -> (Trial<Signals>, Vec<SelectionStep>) {
    let n_known = known.len();
    let start = problem.start(known);
    let (best, path) = match problem.experiment.all_priors_informative() {
        true => sparse_or_full(problem, &start),
        false => forward_and_backward(problem, &start),
    };
    let Ok(best) = problem.reweight_until_converged(best);
    let Ok(best) = problem.reweight_until_converged(simplified(problem, best, n_known));
    (best, path)
}

/// Where all values have priors: every law at every place, unless a few effects predict unseen rows as well. Each predicts
/// them with the columns near its own values: those of other values may be off by more than the noise.
fn sparse_or_full(problem: &Signals, start: &Trial<Signals>) -> (Trial<Signals>, Vec<SelectionStep>) {
    let Ok(sparse) = forward_selection(problem, start.clone(), Vec::new());
    let (full, path) = all_laws(problem, start);
    match problem.under(&full).reduction(&sparse.best, &full).p > RIVAL_LEVEL {
        true => (sparse.best, sparse.path),
        false => (full, path),
    }
}

/// The better one of two models: that to which effects were added, and that from which they were taken away.
fn forward_and_backward(problem: &Signals, start: &Trial<Signals>) -> (Trial<Signals>, Vec<SelectionStep>) {
    let Ok(grown) = forward_selection(problem, start.clone(), Vec::new());
    let (left, path) = backward_elimination(problem, start);
    let Ok(grown_best) = problem.refitted(&judged(problem.under(&left), grown.best.fit.active, None));
    if smaller_if_as_good(problem, &grown_best, &left).fit.active != left.fit.active {
        return (grown_best, grown.path);
    }
    let Ok(more) = forward_selection(problem, left, path);
    (more.best, more.path)
}
