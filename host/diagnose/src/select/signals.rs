//! Signals as a regression problem: linear fits with priors from sums of products, cross-validated over groups of rows.
//!
//! # Method
//!
//! At the current model the residuals are scaled by the noise of their axes (that of the residuals themselves, less the
//! farthest hundredth), and outliers get less weight (Huber). The products of all columns are summed once for each fold;
//! then any set of effects is a small system of equations, and sets that differ by few effects are solved together
//! (`factored.rs`). The information counts by 1/τ, with τ the autocorrelation time of the residuals in
//! rows, against the priors of the values. Unseen rows are those of a fold: a value of the column that is held out, or a
//! tenth of the pieces of time.
//!
//! `search.rs` calls forward selection, `backward.rs` and `simplify.rs` in their order.

pub mod backward;
mod design_matrix;
pub(crate) mod factored;
mod normal_equations;
mod regression_problem;
pub mod search;
pub mod simplify;

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::{IntoParallelIterator as _, ParallelIterator as _};

use self::design_matrix::DesignMatrix;
use self::normal_equations::{System, solve_with_ridge};
use super::problem::{Trial, Weighted};
use crate::effect::LawName;
use crate::least_squares::{rho, threshold, weights};
use crate::linearise::experiment::{Candidate, Curvature, Experiment};
use crate::prepare::groups::Groups;
use crate::prepare::repeatability::MEDIAN_OF_NORMAL;
use crate::progress::{Cancelled, Progress};

/// Residuals that are off by so little, in squares of the noise, decide nothing.
const NEGLIGIBLE_LOSS: f64 = 1e-2;
/// One row in as many, the farthest off, does not count in the noise. Of a model that holds every law from the start the
/// median gives the noise: it leaves nothing that outliers could be mistaken for.
const TRIMMED: usize = 100;

/// A model: which candidates are in it, and its values.
#[derive(Clone, Debug, PartialEq)]
pub struct SignalFit {
    /// The candidates, in the order in which they were added.
    pub active: Vec<usize>,
    /// The values of all candidates, zero where one is not in the model.
    pub values: Vec<f64>,
}

/// What one step of the selection adds to a model: a candidate by itself, or a law at all its places together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Move(usize);

impl Move {
    /// The move that adds a candidate by itself: these come first, in the order of the candidates.
    pub(crate) fn of_candidate(candidate: usize) -> Self {
        Self(candidate)
    }
}

/// Rows of signals and the candidates that may explain their residuals.
pub struct Signals {
    /// The experiment.
    pub experiment: Experiment,
    /// Rows that fits see, and how they are grouped.
    pub groups: Groups,
    /// The candidates of each [`Move`].
    moves: Vec<Vec<usize>>,
    /// How many values all candidates have together.
    n_values: usize,
    progress: Progress,
    offsets: Vec<usize>,
    /// 1/σ² of the prior of each value.
    priors: Arc<[f64]>,
    /// At the model as it is.
    linearised: Arc<Linearised>,
}

/// Residuals and columns of the training rows near a model.
#[derive(Debug)]
struct Linearised {
    columns: Arc<DesignMatrix>,
    /// Residuals where all values are zero, as far as they are linear.
    zero: Vec<f64>,
}

/// How rows and axes count: the noise, and the equations of all values in units of it.
#[derive(Clone, Debug)]
pub struct Weighting {
    /// Noise of each axis, in the unit of its residuals.
    pub sigma: Vec<f64>,
    /// Autocorrelation time of the residuals, rows.
    pub autocorrelation_time: f64,
    /// Whether noise and weights are those of the residuals that they give.
    pub has_converged: bool,
    linearised: Arc<Linearised>,
    /// Weight of each residual of rows × axes, over σ².
    weights: Arc<Vec<f64>>,
    /// All normal equations: without each fold, then of all rows.
    systems: Arc<Vec<System>>,
    /// The lower triangle of the sums of weighted products of columns over all training rows, the residual last.
    sums: Arc<DMatrix<f64>>,
}

impl Weighting {
    /// This weighting with the residuals of another linearisation, whose columns are the same. `sums` stay as they are: no
    /// cross-validated fit reads them.
    fn at(&self, linearised: Arc<Linearised>) -> Self {
        let zeros = linearised.zero.iter().zip(&self.linearised.zero);
        let more: Vec<f64> = zeros.zip(&*self.weights).map(|((new, old), weight)| weight * (new - old)).collect();
        let columns = &linearised.columns;
        let folds: Vec<DVector<f64>> =
            (0..columns.n_folds()).into_par_iter().map(|fold| columns.products(fold, &more)).collect();
        let all = folds.iter().fold(DVector::zeros(columns.n_values()), |sum, fold| sum + fold);
        let left_out = folds.iter().map(Some).chain([None]);
        let moved = |(system, left_out): (&System, Option<&DVector<f64>>)| {
            system.with(&left_out.map_or_else(|| all.clone(), |left_out| &all - left_out))
        };
        let systems = Arc::new(self.systems.iter().zip(left_out).map(moved).collect());
        Self { linearised, systems, ..self.clone() }
    }

    /// The loss of each residual of rows × axes.
    fn losses<'a>(&'a self, residuals: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        let c = threshold(1);
        residuals.iter().zip(self.sigma.iter().cycle()).map(move |(residual, sigma)| rho((residual / sigma).abs(), c))
    }
}

impl Linearised {
    /// This linearisation with `more` added to its residuals.
    fn with(&self, more: &[f64]) -> Self {
        let zero = self.zero.iter().zip(more).map(|(zero, more)| zero + more).collect();
        Self { columns: Arc::clone(&self.columns), zero }
    }

    /// The residuals at these values.
    fn residuals(&self, values: &[f64]) -> Vec<f64> {
        self.zero.iter().zip(&self.columns.moved_all(values)).map(|(zero, moved)| zero + moved).collect()
    }
}

impl Signals {
    /// The experiment, with its groups.
    pub fn new(experiment: Experiment, groups: Groups) -> Self {
        let (offsets, n_values) = experiment.offsets();
        let n_axes = experiment.axes.len();
        let values = || experiment.candidates.iter().flat_map(|candidate| &candidate.values);
        let columns: Vec<&[f64]> = values().map(|value| &value.column[..]).collect();
        let linearised = Linearised {
            columns: Arc::new(DesignMatrix::new(&groups, n_axes, &columns)),
            zero: experiment.training_rows(&experiment.residuals),
        };
        Self {
            n_values,
            progress: Progress::default(),
            offsets,
            priors: values().map(|value| 1.0 / (value.prior * value.prior)).collect(),
            linearised: Arc::new(linearised),
            groups,
            moves: moves(&experiment.candidates),
            experiment,
        }
    }

    /// Reports to `progress` how far the selection is.
    pub fn with_progress(self, progress: Progress) -> Self {
        Self { progress, ..self }
    }

    /// The model with these candidates, not fitted yet, without a weighting that it could be compared under.
    pub fn start(&self, active: Vec<usize>) -> Trial<Self> {
        let fit = SignalFit { active, values: vec![0.0; self.n_values] };
        let weighting = Arc::new(Weighting {
            sigma: vec![1.0; self.experiment.axes.len()],
            autocorrelation_time: 1.0,
            has_converged: false,
            linearised: Arc::clone(&self.linearised),
            weights: Arc::default(),
            systems: Arc::default(),
            sums: Arc::new(DMatrix::zeros(0, 0)),
        });
        Trial { effect: None, fit, unseen_residuals: Vec::new(), weighting, error: f64::INFINITY }
    }

    /// All moves.
    pub(crate) fn moves(&self) -> impl ExactSizeIterator<Item = Move> {
        (0..self.moves.len()).map(Move)
    }

    /// The candidates that a move adds to a model without any of them.
    pub(crate) fn candidates_of(&self, Move(number): Move) -> &[usize] {
        &self.moves[number]
    }

    /// The numbers of the values of these candidates among all values.
    pub fn indices(&self, active: &[usize]) -> Vec<usize> {
        let of = |&candidate: &usize| {
            let first = self.offsets[candidate];
            first..first + self.experiment.candidates[candidate].values.len()
        };
        active.iter().flat_map(of).collect()
    }

    /// Residuals of the training rows, of a model.
    pub(crate) fn training_residuals(&self, fit: &SignalFit) -> Vec<f64> {
        self.experiment.training_rows(&self.experiment.at(&fit.values))
    }

    /// Root mean square of the norm of residuals, in its unit.
    fn norm(&self, residuals: &[f64]) -> f64 {
        let (n_axes, n_norm) = (self.experiment.axes.len(), self.experiment.n_norm);
        let square = |row: &[f64]| row.iter().take(n_norm).map(|r| r * r).sum::<f64>();
        let rows = (residuals.len() / n_axes).max(1) as f64;
        (residuals.chunks(n_axes).map(square).sum::<f64>() / rows).sqrt()
    }

    /// Residuals and columns of the training rows at these values, in their units.
    fn linearise(&self, values: &[f64]) -> Result<Arc<Linearised>, Cancelled> {
        self.progress.check()?;
        Ok(match &self.experiment.curvature {
            Curvature::None => Arc::clone(&self.linearised),
            Curvature::Beyond(beyond) => match beyond(values) {
                None => Arc::clone(&self.linearised),
                Some(beyond) => Arc::new(self.linearised.with(&self.experiment.training_rows(&beyond))),
            },
            Curvature::Relinearise(relinearise) => {
                let (residuals, columns) = relinearise(values);
                let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
                let columns = DesignMatrix::new(&self.groups, self.experiment.axes.len(), &columns);
                let moved = columns.moved_all(values);
                let own = self.experiment.training_rows(&residuals);
                let zero = own.iter().zip(&moved).map(|(own, moved)| own - moved).collect();
                Arc::new(Linearised { columns: Arc::new(columns), zero })
            }
        })
    }

    /// The linearisation at the values of a model. `None` where the fit of the model assumed nearly the same residuals: where
    /// the squares of their differences, in units of the noise, add up to [`NEGLIGIBLE_LOSS`] at the most.
    fn moved_on(&self, model: &Trial<Self>) -> Result<Option<Arc<Linearised>>, Cancelled> {
        let Curvature::Beyond(_) = &self.experiment.curvature else { return Ok(None) };
        let (linearised, assumed) = (self.linearise(&model.fit.values)?, &model.weighting.linearised);
        // The columns are the same: the residuals differ by as much as they do at zero.
        let differences = linearised.zero.iter().zip(&assumed.zero).map(|(now, assumed)| now - assumed).collect();
        let loss = in_noise(differences, &model.weighting.sigma).iter().map(|off| off * off).sum::<f64>();
        Ok((loss > NEGLIGIBLE_LOSS).then_some(linearised))
    }

    /// Noise of each axis by these residuals.
    fn noise(&self, residuals: &[f64]) -> Vec<f64> {
        let (n_axes, n_norm) = (self.experiment.axes.len(), self.experiment.n_norm);
        let of_axis = |axis: usize| {
            let squares = residuals.iter().skip(axis).step_by(n_axes).map(|r| r * r).collect();
            mean_square(squares, self.experiment.all_priors_informative()).sqrt().max(1e-12)
        };
        let mut sigma: Vec<f64> = (0..n_axes).map(of_axis).collect();
        let of_norm = sigma.iter().take(n_norm).map(|sigma| sigma * sigma).sum::<f64>();
        let of_norm = (of_norm / n_norm as f64).sqrt();
        for (sigma, axis) in sigma.iter_mut().zip(&self.experiment.axes) {
            *sigma = axis.noise_if_repeated.map_or(*sigma, |times| times * of_norm);
        }
        sigma
    }

    /// The weighting that residuals, in units of the noise, give.
    fn weigh(&self, residuals: &[f64], sigma: Vec<f64>, linearised: Arc<Linearised>) -> Result<Weighting, Cancelled> {
        let n_axes = sigma.len();
        let autocorrelation_time = self.groups.autocorrelation_time(residuals, n_axes);
        let of = |(k, weight): (usize, &f64)| weight / (sigma[k % n_axes] * sigma[k % n_axes]);
        let weights = Arc::new(weights(residuals, 1).iter().enumerate().map(of).collect::<Vec<f64>>());
        let sums = |fold: usize| linearised.columns.sums(fold, &weights, &linearised.zero, &self.progress);
        let folds = (0..linearised.columns.n_folds()).into_par_iter().map(sums);
        let folds = folds.collect::<Result<Vec<DMatrix<f64>>, Cancelled>>()?;
        let n = self.n_values + 1;
        let all = Arc::new(folds.iter().fold(DMatrix::zeros(n, n), |sum, fold| sum + fold));
        let left_out = folds.into_iter().map(|fold| Some(Arc::new(fold))).chain([None]);
        let system = |left_out| System::new(&all, left_out, autocorrelation_time, &self.priors);
        let systems = left_out.map(system).collect();
        Ok(Weighting {
            sigma,
            autocorrelation_time,
            has_converged: false,
            linearised,
            weights,
            systems: Arc::new(systems),
            sums: all,
        })
    }
}

/// The mean of squares of noise: by their median, or without the largest of them.
fn mean_square(mut squares: Vec<f64>, by_median: bool) -> f64 {
    squares.sort_unstable_by(f64::total_cmp);
    if by_median {
        return squares.get(squares.len() / 2).map_or(0.0, |median| median / MEDIAN_OF_NORMAL.powi(2));
    }
    squares.truncate(squares.len() - squares.len() / TRIMMED);
    squares.iter().sum::<f64>() / squares.len().max(1) as f64
}

impl Weighted<'_, Signals> {
    /// Residuals of the training rows in units of the noise, of a model.
    pub fn training_residuals(&self, fit: &SignalFit) -> Vec<f64> {
        in_noise(self.problem.training_residuals(fit), &self.weighting.sigma)
    }

    /// Column of a value over the training rows, in units of the noise.
    pub fn column(&self, value: usize) -> Vec<f64> {
        in_noise(self.weighting.linearised.columns.column(value), &self.weighting.sigma)
    }

    /// Information of these values: of independent rows, and of the priors.
    pub fn information(&self, indices: &[usize]) -> DMatrix<f64> {
        self.equations(indices).0
    }

    /// A and g of these values over all training rows, in their units.
    pub(crate) fn equations(&self, indices: &[usize]) -> (DMatrix<f64>, DVector<f64>) {
        let (n, Weighting { sums, autocorrelation_time, .. }) = (indices.len(), &**self.weighting);
        let sum = |a: usize, b: usize| sums[(a.max(b), a.min(b))];
        let mut information = DMatrix::from_fn(n, n, |a, b| sum(indices[a], indices[b]) / autocorrelation_time);
        indices.iter().enumerate().for_each(|(k, &value)| information[(k, k)] += self.problem.priors[value]);
        let gradient = DVector::from_fn(n, |a, _| sums[(self.problem.n_values, indices[a])] / autocorrelation_time);
        (information, gradient)
    }

    /// A model with its values, and what those of the other folds add in the rows of each.
    fn trial(&self, fit: SignalFit, effect: Option<Move>, moved: &[&[f64]]) -> Trial<Signals> {
        let Linearised { columns, zero } = &*self.weighting.linearised;
        let mut unseen_residuals = vec![0.0; zero.len()];
        moved.iter().enumerate().for_each(|(fold, moved)| columns.put(fold, moved, &mut unseen_residuals));
        unseen_residuals.iter_mut().zip(zero).for_each(|(moved, zero)| *moved += zero);
        self.with_residuals(fit, effect, unseen_residuals)
    }

    /// A model that is compared by these residuals of the training rows.
    pub(crate) fn with_residuals(
        &self,
        fit: SignalFit,
        effect: Option<Move>,
        unseen_residuals: Vec<f64>,
    ) -> Trial<Signals> {
        let error = self.problem.norm(&unseen_residuals);
        Trial { effect, fit, unseen_residuals, weighting: Arc::clone(self.weighting), error }
    }

    /// The values of a model that fit all training rows best.
    pub(crate) fn least_squares(&self, active: Vec<usize>) -> SignalFit {
        let indices = self.problem.indices(&active);
        let (information, gradient) = self.equations(&indices);
        let mut values = vec![0.0; self.problem.n_values];
        indices
            .iter()
            .zip(solve_with_ridge(information, &gradient).iter())
            .for_each(|(&index, value)| values[index] = -value);
        SignalFit { active, values }
    }
}

/// Numbers of rows × axes in units of the noise.
fn in_noise(mut numbers: Vec<f64>, sigma: &[f64]) -> Vec<f64> {
    for row in numbers.chunks_mut(sigma.len()) {
        row.iter_mut().zip(sigma).for_each(|(number, sigma)| *number /= sigma);
    }
    numbers
}

/// The candidates of each move. First come the candidates, each by itself. Then come the laws that have several places, each
/// at all of them except what all joints have in common. A law whose candidates differ in shape gives one move for the
/// first shape of every place, one for the second, and so on.
fn moves(candidates: &[Candidate]) -> Vec<Vec<usize>> {
    let mut shapes: BTreeMap<(LawName, usize), Vec<usize>> = BTreeMap::new();
    for (k, candidate) in candidates.iter().enumerate().filter(|(_, candidate)| !candidate.is_common()) {
        let shape = candidates[..k].iter().filter(|other| other.is_same(candidate)).count();
        shapes.entry((candidate.law, shape)).or_default().push(k);
    }
    let single = (0..candidates.len()).map(|k| vec![k]);
    single.chain(shapes.into_values().filter(|all| all.len() > 1)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::{Place, Site};

    #[test]
    fn a_law_at_all_its_places_leaves_out_what_they_have_in_common() {
        let delay = |place| Candidate::one(LawName::Delay, Site::new(place, "here"), ("delay", "s"), Vec::new());
        let candidates = [Place::Joint(0), Place::Joint(1), Place::AllJoints].map(delay);
        assert_eq!(moves(&candidates), [vec![0], vec![1], vec![2], vec![0, 1]]);
    }
}
