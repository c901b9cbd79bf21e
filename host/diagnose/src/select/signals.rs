//! The search's view of an [`Experiment`]: linear fits with priors from sums of products, cross-validated over groups.
//!
//! # Method
//!
//! At the model as it stands the residuals are scaled by the noise of their axes (that of the residuals themselves,
//! less the farthest hundredth) and what is far off are given less weight (Huber). The products of all columns are summed once for each
//! fold; then any set of effects is a small system of equations, and sets that differ by few effects are solved together
//! (`factored`). The information counts by 1/τ, with τ how many rows repeat each other (the integral of
//! the residuals' autocorrelation), against the priors of the values. Unseen rows are those of a fold: a value of the
//! column that is held out, or a tenth of the pieces of time.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::{IntoParallelIterator as _, IntoParallelRefIterator as _, ParallelIterator as _};

use crate::linearise::experiment::{Candidate, Experiment};
use crate::prepare::groups::Groups;
use crate::prepare::repeatability::MEDIAN_OF_NORMAL;
use crate::select::columns::Design;
use crate::select::factored::Factored;
use crate::select::problem::{Kind, Trial};
use crate::select::robust_fit::{losses, weights};
use crate::select::significance::{Fall, paired};

/// The most effects of one model.
const MOST: usize = 60;
/// Rounds of weights and noise: until no axis's noise changes by more than this share.
const LEAST_ROUNDS: usize = 2;
const MOST_ROUNDS: usize = 50;
const SETTLED: f64 = 1e-3;
/// Candidates times folds up to which exchanges are worth their time.
const MOST_TO_EXCHANGE: usize = 1200;
/// Share of the information that is added to each value's own, so that what is not told stays small.
const LEAST: f64 = 1e-9;
/// One row in as many, the farthest off, does not count in the noise. Of a model that holds every law from the start the
/// median tells it: it leaves nothing that outliers could be mistaken for.
const TRIMMED: usize = 100;

/// A model: which candidates are in it, and its values.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// The candidates, in the order in which they came.
    pub active: Vec<usize>,
    /// The values of all candidates, zero where one is not in the model.
    pub values: Vec<f64>,
}

/// An experiment as a kind of observation.
pub struct Channels {
    /// The experiment.
    pub experiment: Experiment,
    /// Rows that fits see, and how they are grouped.
    pub groups: Groups,
    /// Noise of each axis.
    pub sigma: Vec<f64>,
    /// How many rows repeat each other.
    pub repeats: f64,
    /// What a step of the search may add: each candidate by itself, and each law at all its places together.
    pub moves: Vec<Vec<usize>>,
    /// Columns of the training rows.
    pub(crate) design: Design,
    /// All normal equations: without each fold, then of all rows.
    pub(crate) systems: Vec<System>,
    /// How many values all candidates have together.
    pub(crate) n_values: usize,
    offsets: Vec<usize>,
    /// 1/σ² of the prior of each value.
    priors: Vec<f64>,
    /// Residuals of the training rows where all values are zero, as far as they are linear.
    zero: Vec<f64>,
    /// Sums of weighted products of columns over all training rows, the residual last.
    whole: DMatrix<f64>,
    /// The model that was looked at last.
    last: Option<Factored>,
}

/// The normal equations A·x = −g of all values, each scaled by its own information and made safe by a share of [`LEAST`].
pub(crate) struct System {
    /// A, its diagonal about 1.
    pub(crate) matrix: DMatrix<f64>,
    /// g.
    pub(crate) gradient: DVector<f64>,
    /// What x is multiplied by to be in the values' units.
    pub(crate) scale: DVector<f64>,
}

impl System {
    /// All values in their units, from those with these numbers.
    pub(crate) fn unscaled(&self, indices: &[usize], values: &DVector<f64>) -> Vec<f64> {
        let mut all = vec![0.0; self.scale.len()];
        indices.iter().zip(values.iter()).for_each(|(&k, value)| all[k] = value * self.scale[k]);
        all
    }
}

impl Channels {
    /// The experiment, with its groups.
    pub fn new(experiment: Experiment, groups: Groups) -> Self {
        let (offsets, n_values) = experiment.offsets();
        let n_axes = experiment.axes.len();
        let values = || experiment.candidates.iter().flat_map(|candidate| &candidate.values);
        let columns: Vec<&[f64]> = values().map(|value| &value.column[..]).collect();
        Self {
            design: Design::new(&groups, n_axes, &columns),
            systems: Vec::new(),
            n_values,
            offsets,
            priors: values().map(|value| 1.0 / (value.prior * value.prior)).collect(),
            zero: training(&groups, n_axes, &experiment.residuals),
            whole: DMatrix::zeros(0, 0),
            last: None,
            groups,
            sigma: vec![1.0; n_axes],
            repeats: 1.0,
            moves: moves(&experiment.candidates),
            experiment,
        }
    }

    /// The model with these candidates and no values yet.
    pub fn start(&self, active: Vec<usize>) -> Trial<Self> {
        let fit = Fit { active, values: vec![0.0; self.n_values] };
        Trial { effect: None, fit, predicted: Vec::new(), loss: f64::INFINITY, error: f64::INFINITY }
    }

    /// Where the values of these candidates stand among all values.
    pub fn indices(&self, active: &[usize]) -> Vec<usize> {
        let of = |&candidate: &usize| {
            let first = self.offsets[candidate];
            first..first + self.experiment.candidates[candidate].values.len()
        };
        active.iter().flat_map(of).collect()
    }

    /// Residuals of the training rows in units of the noise, of a model.
    pub fn training_residuals(&self, fit: &Fit) -> Vec<f64> {
        self.in_noise(training(&self.groups, self.sigma.len(), &self.experiment.at(&fit.values)))
    }

    /// Column of a value over the training rows, in units of the noise.
    pub fn column(&self, value: usize) -> Vec<f64> {
        self.in_noise(self.design.column(value))
    }

    /// Information of these values: what the rows tell, of independent rows, and the priors.
    pub fn information(&self, indices: &[usize]) -> DMatrix<f64> {
        self.equations(indices).0
    }

    /// Numbers of rows × axes in units of the noise.
    fn in_noise(&self, mut numbers: Vec<f64>) -> Vec<f64> {
        for row in numbers.chunks_mut(self.sigma.len()) {
            row.iter_mut().zip(&self.sigma).for_each(|(number, sigma)| *number /= sigma);
        }
        numbers
    }

    /// Residuals of the training rows at these values, in their units; what is not linear is told anew there.
    fn linearise(&mut self, values: &[f64]) -> Vec<f64> {
        let n_axes = self.sigma.len();
        let at = self.experiment.relinearise.as_ref().map(|relinearise| relinearise(values));
        let own = at.map(|(residuals, columns)| {
            let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
            self.design = Design::new(&self.groups, n_axes, &columns);
            training(&self.groups, n_axes, &residuals)
        });
        let mut moved = vec![0.0; self.zero.len()];
        for fold in 0..self.design.n_folds() {
            self.design.put(fold, &self.design.moved(fold, values), &mut moved);
        }
        match own {
            Some(own) => {
                self.zero = own.iter().zip(&moved).map(|(own, moved)| own - moved).collect();
                own
            }
            None => self.zero.iter().zip(&moved).map(|(zero, moved)| zero + moved).collect(),
        }
    }

    /// The equations of all values, with the weights that these residuals give the rows.
    fn accumulate(&mut self, residuals: &[f64]) {
        let n_axes = self.sigma.len();
        let of = |(k, weight): (usize, &f64)| weight / (self.sigma[k % n_axes] * self.sigma[k % n_axes]);
        let weights: Vec<f64> = weights(residuals, 1).iter().enumerate().map(of).collect();
        let n_folds = self.design.n_folds();
        let sums = |fold: usize| self.design.sums(fold, &weights, &self.zero);
        let folds: Vec<DMatrix<f64>> = (0..n_folds).into_par_iter().map(sums).collect();
        let n = self.n_values + 1;
        self.whole = folds.iter().fold(DMatrix::zeros(n, n), |sum, fold| sum + fold);
        self.systems = folds.par_iter().map(|fold| self.system(&self.whole - fold)).collect();
        self.systems.push(self.system(self.whole.clone()));
        self.last = None;
    }

    fn system(&self, mut sums: DMatrix<f64>) -> System {
        let n = self.n_values;
        sums /= self.repeats;
        self.priors.iter().enumerate().for_each(|(k, prior)| sums[(k, k)] += prior);
        let scale = DVector::from_fn(n, |k, _| if sums[(k, k)] > 0.0 { 1.0 / sums[(k, k)].sqrt() } else { 0.0 });
        let least = |k: usize| if scale[k] > 0.0 { LEAST } else { 1.0 };
        let matrix =
            DMatrix::from_fn(n, n, |a, b| sums[(a, b)] * scale[a] * scale[b] + if a == b { least(a) } else { 0.0 });
        let gradient = DVector::from_fn(n, |k, _| sums[(k, n)] * scale[k]);
        System { matrix, gradient, scale }
    }

    /// A and g of these values over all training rows, in their units.
    pub(crate) fn equations(&self, indices: &[usize]) -> (DMatrix<f64>, DVector<f64>) {
        let n = indices.len();
        let mut information = DMatrix::from_fn(n, n, |a, b| self.whole[(indices[a], indices[b])] / self.repeats);
        indices.iter().enumerate().for_each(|(k, &value)| information[(k, k)] += self.priors[value]);
        let gradient = DVector::from_fn(n, |a, _| self.whole[(indices[a], self.n_values)] / self.repeats);
        (information, gradient)
    }

    /// A model with these candidates, fitted and cross-validated.
    pub fn judged(&self, active: Vec<usize>, effect: Option<usize>) -> Trial<Self> {
        Factored::new(self, active).trial(self, effect)
    }

    /// A model with its values, and what those of the other folds add in the rows of each.
    pub(crate) fn trial(
        &self,
        active: Vec<usize>,
        effect: Option<usize>,
        values: Vec<f64>,
        moved: &[&[f64]],
    ) -> Trial<Self> {
        let mut predicted = vec![0.0; self.zero.len()];
        moved.iter().enumerate().for_each(|(fold, moved)| self.design.put(fold, moved, &mut predicted));
        predicted.iter_mut().zip(&self.zero).for_each(|(moved, zero)| *moved += zero);
        self.predicting(Fit { active, values }, effect, self.in_noise(predicted))
    }

    /// A model that predicts these residuals, in units of the noise.
    pub(crate) fn predicting(&self, fit: Fit, effect: Option<usize>, predicted: Vec<f64>) -> Trial<Self> {
        let loss = losses(&predicted, 1).iter().sum();
        let error = self.norm(&predicted);
        Trial { effect, fit, predicted, loss, error }
    }

    /// The model with these candidates, factorised; taken from where it was kept.
    fn factored(&mut self, active: &[usize]) -> Factored {
        let last = self.last.take().filter(|last| last.active == active);
        last.unwrap_or_else(|| Factored::new(self, active.to_vec()))
    }

    /// The candidates that a move adds to a model; `None` where it adds nothing, or where another move adds the same.
    fn added(&self, number: usize, fit: &Fit) -> Option<Vec<usize>> {
        let all = &self.moves[number];
        let place = |k: &usize| (self.experiment.candidates[*k].law, &self.experiment.candidates[*k].place);
        let added: Vec<usize> = match &all[..] {
            [one] => (!fit.active.contains(one)).then_some(*one).into_iter().collect(),
            several => {
                several.iter().filter(|k| !fit.active.iter().any(|other| place(other) == place(k))).copied().collect()
            }
        };
        (added.len() >= all.len().min(2)).then_some(added)
    }

    /// The values of a model that fit all training rows best.
    pub(crate) fn least_squares(&self, active: Vec<usize>) -> Fit {
        let indices = self.indices(&active);
        let (information, gradient) = self.equations(&indices);
        let mut values = vec![0.0; self.n_values];
        indices.iter().zip(solve(information, &gradient).iter()).for_each(|(&index, value)| values[index] = -value);
        Fit { active, values }
    }

    /// Root mean square of the norm of scaled residuals, in its unit.
    pub fn norm(&self, scaled: &[f64]) -> f64 {
        let (n_axes, n_norm) = (self.sigma.len(), self.experiment.n_norm);
        let square = |row: &[f64]| row.iter().zip(&self.sigma).take(n_norm).map(|(r, s)| (r * s).powi(2)).sum::<f64>();
        let rows = (scaled.len() / n_axes).max(1) as f64;
        (scaled.chunks(n_axes).map(square).sum::<f64>() / rows).sqrt()
    }

    /// Noise of the axes and repeats of the rows as these residuals tell them; the residuals in units of that noise.
    fn rescale(&mut self, residuals: Vec<f64>) -> Vec<f64> {
        let n_axes = self.sigma.len();
        for axis in 0..n_axes {
            let mut squares: Vec<f64> = residuals.iter().skip(axis).step_by(n_axes).map(|r| r * r).collect();
            squares.sort_unstable_by(f64::total_cmp);
            let mean = if self.experiment.is_held_by_priors() {
                squares.get(squares.len() / 2).copied().unwrap_or_default() / MEDIAN_OF_NORMAL.powi(2)
            } else {
                squares.truncate(squares.len() - squares.len() / TRIMMED);
                squares.iter().sum::<f64>() / squares.len().max(1) as f64
            };
            self.sigma[axis] = mean.sqrt().max(1e-12);
        }
        let of_norm = self.sigma.iter().take(self.experiment.n_norm).map(|sigma| sigma * sigma).sum::<f64>();
        let of_norm = (of_norm / self.experiment.n_norm as f64).sqrt();
        for (sigma, axis) in self.sigma.iter_mut().zip(&self.experiment.axes) {
            *sigma = axis.noise_if_repeated.map_or(*sigma, |times| times * of_norm);
        }
        let residuals = self.in_noise(residuals);
        self.repeats = self.groups.repeats(&residuals, n_axes);
        residuals
    }
}

/// The numbers of the training rows, of those of all rows × axes.
fn training(groups: &Groups, n_axes: usize, all: &[f64]) -> Vec<f64> {
    groups.training.iter().flat_map(|row| &all[row * n_axes..(row + 1) * n_axes]).copied().collect()
}

/// Each candidate by itself, then each law that has several places at all of them; of a law with several shapes the first
/// of each place together, the second, and so on.
fn moves(candidates: &[Candidate]) -> Vec<Vec<usize>> {
    let mut shapes: BTreeMap<(&str, usize), Vec<usize>> = BTreeMap::new();
    for (k, candidate) in candidates.iter().enumerate() {
        let alike = |other: &&Candidate| other.law == candidate.law && other.place == candidate.place;
        let shape = candidates[..k].iter().filter(alike).count();
        shapes.entry((candidate.law, shape)).or_default().push(k);
    }
    let single = (0..candidates.len()).map(|k| vec![k]);
    single.chain(shapes.into_values().filter(|all| all.len() > 1)).collect()
}

/// x with A·x = b for an information matrix A, scaled to its diagonal and made safe by a share of [`LEAST`] of it.
pub(crate) fn solve(mut information: DMatrix<f64>, gradient: &DVector<f64>) -> DVector<f64> {
    let scale = information.diagonal().map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
    for (column, by) in scale.iter().enumerate() {
        for (row, other) in scale.iter().enumerate() {
            information[(row, column)] *= by * other;
        }
        information[(column, column)] += if *by > 0.0 { LEAST } else { 1.0 };
    }
    match information.cholesky() {
        Some(root) => root.solve(&gradient.component_mul(&scale)).component_mul(&scale),
        None => DVector::zeros(gradient.len()),
    }
}

impl Kind for Channels {
    type Effect = usize;
    type Fit = Fit;
    type Error = std::convert::Infallible;

    fn n_effects(&self, fit: &Fit) -> usize {
        fit.active.len()
    }

    fn n_values(&self, fit: &Fit) -> usize {
        self.indices(&fit.active).len()
    }

    fn most(&self) -> usize {
        MOST
    }

    fn overlaps(&self) -> bool {
        true
    }

    fn exchanges(&self) -> bool {
        self.moves.len() * self.groups.n_folds < MOST_TO_EXCHANGE
    }

    fn name(&self, effect: &usize) -> (&'static str, String) {
        let all = &self.moves[*effect];
        let candidate = &self.experiment.candidates[all[0]];
        let shape =
            candidate.shape.as_ref().map_or(String::new(), |(name, value, unit)| format!(", {name} {value:.3} {unit}"));
        let place = if all.len() > 1 { format!("{} places", all.len()) } else { candidate.place.clone() };
        (candidate.law, place + &shape)
    }

    fn settled(&mut self, current: Trial<Self>) -> Result<Trial<Self>, Self::Error> {
        let mut best = current;
        for round in 0..MOST_ROUNDS {
            let residuals = self.linearise(&best.fit.values);
            let before = self.sigma.clone();
            let residuals = self.rescale(residuals);
            let is_same = |(now, before): (&f64, &f64)| (now / before - 1.0).abs() < SETTLED;
            if round >= LEAST_ROUNDS && self.sigma.iter().zip(&before).all(is_same) {
                break;
            }
            self.accumulate(&residuals);
            let model = Factored::new(self, best.fit.active);
            best = model.trial(self, best.effect);
            self.last = Some(model);
        }
        Ok(best)
    }

    fn screened(&mut self, current: &Trial<Self>) -> Result<Vec<Trial<Self>>, Self::Error> {
        let open: Vec<(usize, Vec<usize>)> =
            (0..self.moves.len()).filter_map(|number| Some((number, self.added(number, &current.fit)?))).collect();
        let model = self.factored(&current.fit.active);
        let trials = model.with(self, &open);
        self.last = Some(model);
        Ok(trials)
    }

    fn refined(&mut self, trial: &Trial<Self>) -> Result<Trial<Self>, Self::Error> {
        Ok(trial.clone())
    }

    fn without(&mut self, best: &Trial<Self>, dropped: usize) -> Result<Trial<Self>, Self::Error> {
        let model = self.factored(&best.fit.active);
        let mut without = model.without(self, &[best.fit.active[dropped]]);
        without.effect = without.fit.active.last().copied();
        self.last = Some(model);
        Ok(without)
    }

    fn fall(&self, before: &Trial<Self>, after: &Trial<Self>) -> Fall {
        let n_axes = self.sigma.len();
        let mut cells = vec![[0.0; 2]; self.groups.n_blocks * n_axes];
        let pairs = losses(&before.predicted, 1).into_iter().zip(losses(&after.predicted, 1));
        let is_own = |(k, _): &(usize, _)| self.experiment.axes[k % n_axes].proves();
        for (k, (before, after)) in pairs.enumerate().filter(is_own) {
            let cell = &mut cells[self.groups.blocks[k / n_axes] * n_axes + k % n_axes];
            cell[0] += before;
            cell[1] += after;
        }
        cells.retain(|[before, after]| before != after);
        paired(&cells)
    }

    /// Rows that are held out take no part, so that the error told on them is of rows that nothing saw.
    fn confirmed(&mut self, _without: &Trial<Self>, _with: &Trial<Self>) -> Result<bool, Self::Error> {
        Ok(true)
    }
}
