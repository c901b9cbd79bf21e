//! The search's view of an [`Experiment`]: linear fits with priors from sums of products, cross-validated over groups.
//!
//! # Method
//!
//! At the model as it stands the residuals are scaled by the noise of their axes (that of the residuals themselves,
//! less the farthest hundredth) and what is far off are given less weight (Huber). The products of all columns are summed once for each
//! fold; then any set of effects is a small system of equations. The information counts by 1/τ, with τ how many rows
//! repeat each other (the integral of the residuals' autocorrelation), against the priors of the values. Unseen rows
//! are those of a fold: a value of the column that is held out, or a tenth of the pieces of time.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::{IntoParallelIterator as _, IntoParallelRefIterator as _, ParallelIterator as _};

use super::experiment::{Candidate, Experiment};
use super::groups::Groups;
use crate::diagnose::fit::{losses, weights};
use crate::diagnose::kind::{Kind, Trial};
use crate::diagnose::significance::{Fall, paired};

/// The most effects of one model.
const MOST: usize = 60;
/// Rounds of weights and noise until they settle.
const ROUNDS: usize = 2;
/// Candidates times folds up to which exchanges are worth their time.
const MOST_TO_EXCHANGE: usize = 1200;
/// Share of the information that is added to each value's own, so that what is not told stays small.
const LEAST: f64 = 1e-9;
/// One row in as many, the farthest off, does not count in the noise.
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
    offsets: Vec<usize>,
    n_values: usize,
    /// Scaled residuals and columns of the training rows, where all values are `origin`.
    residuals: Vec<f64>,
    columns: Vec<Vec<f64>>,
    origin: Vec<f64>,
    /// Sums of weighted products of columns, the residual last, for each fold, and of all.
    folds: Vec<DMatrix<f64>>,
    whole: DMatrix<f64>,
}

impl Channels {
    /// The experiment, with its groups.
    pub fn new(experiment: Experiment, groups: Groups) -> Self {
        let (offsets, n_values) = experiment.offsets();
        let sigma = vec![1.0; experiment.axes.len()];
        Self {
            groups,
            sigma,
            repeats: 1.0,
            moves: moves(&experiment.candidates),
            offsets,
            n_values,
            residuals: Vec::new(),
            columns: Vec::new(),
            origin: Vec::new(),
            folds: Vec::new(),
            whole: DMatrix::zeros(0, 0),
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
        self.scaled(&self.experiment.at(&fit.values))
    }

    /// Columns of these values over the training rows, in units of the noise.
    pub fn column(&self, value: usize) -> &[f64] {
        &self.columns[value]
    }

    /// Information of these values: what the rows tell, of independent rows, and the priors.
    pub fn information(&self, indices: &[usize]) -> DMatrix<f64> {
        self.system(&self.whole, indices).0
    }

    /// 1/σ² of the prior of a value.
    pub fn prior(&self, value: usize) -> f64 {
        let mut all = self.experiment.candidates.iter().flat_map(|candidate| &candidate.values);
        all.nth(value).map_or(0.0, |v| 1.0 / (v.prior * v.prior))
    }

    fn scaled(&self, all: &[f64]) -> Vec<f64> {
        let n = self.sigma.len();
        let of_row = |row: usize| (0..n).map(move |axis| (row * n + axis, axis));
        self.groups.training.iter().copied().flat_map(of_row).map(|(k, axis)| all[k] / self.sigma[axis]).collect()
    }

    /// Columns at these values, and what the residuals would be at zero if they were linear.
    fn linearise(&mut self, values: &[f64]) {
        let (residuals, columns) = match &self.experiment.relinearise {
            Some(relinearise) => relinearise(values),
            None => {
                let all = self.experiment.candidates.iter().flat_map(|candidate| &candidate.values);
                let columns: Vec<Vec<f64>> = all.map(|value| self.scaled(&value.column)).collect();
                self.residuals = self.scaled(&self.experiment.residuals);
                self.columns = columns;
                self.origin = vec![0.0; self.n_values];
                return;
            }
        };
        self.residuals = self.scaled(&residuals);
        self.columns = columns.iter().map(|column| self.scaled(column)).collect();
        self.origin = values.to_vec();
    }

    /// Residuals after a model's values, as far as they are linear.
    fn linear(&self, values: &[f64]) -> Vec<f64> {
        let mut after = self.residuals.clone();
        for (k, column) in self.columns.iter().enumerate() {
            let step = values[k] - self.origin[k];
            if step != 0.0 {
                after.iter_mut().zip(column).for_each(|(after, slope)| *after += slope * step);
            }
        }
        after
    }

    /// Sums of products for each fold under these row weights; the residual is told at the values zero.
    fn accumulate(&mut self, entry_weights: &[f64]) {
        let n_axes = self.sigma.len();
        let zero = self.linear(&vec![0.0; self.n_values]);
        let p = self.n_values;
        let of_fold = |fold: usize| {
            let rows: Vec<usize> = (0..self.groups.folds.len()).filter(|&row| self.groups.folds[row] == fold).collect();
            let mut transposed = DMatrix::zeros(p + 1, rows.len() * n_axes);
            for (at, &row) in rows.iter().enumerate() {
                for axis in 0..n_axes {
                    let k = row * n_axes + axis;
                    let root = entry_weights[k].sqrt();
                    let mut entry = transposed.column_mut(at * n_axes + axis);
                    for (value, column) in self.columns.iter().enumerate() {
                        entry[value] = root * column[k];
                    }
                    entry[p] = root * zero[k];
                }
            }
            &transposed * transposed.transpose()
        };
        self.folds = (0..self.groups.n_folds).into_par_iter().map(of_fold).collect();
        self.whole = self.folds.iter().fold(DMatrix::zeros(p + 1, p + 1), |sum, fold| sum + fold);
    }

    fn system(&self, sums: &DMatrix<f64>, indices: &[usize]) -> (DMatrix<f64>, DVector<f64>) {
        let n = indices.len();
        let mut information = DMatrix::from_fn(n, n, |a, b| sums[(indices[a], indices[b])] / self.repeats);
        for (k, &value) in indices.iter().enumerate() {
            information[(k, k)] += self.prior(value);
        }
        let gradient = DVector::from_fn(n, |a, _| sums[(indices[a], self.n_values)] / self.repeats);
        (information, gradient)
    }

    fn solved(&self, sums: &DMatrix<f64>, indices: &[usize]) -> DVector<f64> {
        let (information, gradient) = self.system(sums, indices);
        -solve(information, &gradient)
    }

    /// A model with these candidates, fitted and cross-validated.
    pub fn judged(&self, active: Vec<usize>, effect: Option<usize>) -> Trial<Self> {
        let indices = self.indices(&active);
        let mut values = vec![0.0; self.n_values];
        let solved = self.solved(&self.whole, &indices);
        indices.iter().zip(solved.iter()).for_each(|(&k, value)| values[k] = *value);
        let n_axes = self.sigma.len();
        let mut predicted = self.residuals.clone();
        for (&k, column) in self.origin.iter().zip(&self.columns).filter(|(value, _)| **value != 0.0) {
            predicted.iter_mut().zip(column).for_each(|(p, slope)| *p -= slope * k);
        }
        for (fold, sums) in self.folds.iter().enumerate() {
            let of_others = self.solved(&(&self.whole - sums), &indices);
            for row in (0..self.groups.folds.len()).filter(|&row| self.groups.folds[row] == fold) {
                for (&k, value) in indices.iter().zip(of_others.iter()) {
                    let column = &self.columns[k];
                    for at in row * n_axes..(row + 1) * n_axes {
                        predicted[at] += column[at] * value;
                    }
                }
            }
        }
        let loss = losses(&predicted, 1).iter().sum();
        let error = self.norm(&predicted);
        Trial { effect, fit: Fit { active, values }, predicted, loss, error }
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

    /// Fits the values of a model anew, beside those that are held where they are.
    pub fn refit(&self, fit: &mut Fit, held: &[usize]) {
        let indices = self.indices(&fit.active);
        let (information, gradient) = self.system(&self.whole, &indices);
        let (fixed, free): (Vec<usize>, Vec<usize>) = (0..indices.len()).partition(|&k| held.contains(&indices[k]));
        let of_fixed = |a: usize| fixed.iter().map(|&b| information[(a, b)] * fit.values[indices[b]]).sum::<f64>();
        let rest = DVector::from_iterator(free.len(), free.iter().map(|&a| gradient[a] + of_fixed(a)));
        let solved = -solve(information.select_rows(&free).select_columns(&free), &rest);
        free.iter().zip(solved.iter()).for_each(|(&k, value)| fit.values[indices[k]] = *value);
    }

    /// Root mean square of the norm of scaled residuals, in its unit.
    pub fn norm(&self, scaled: &[f64]) -> f64 {
        let (n_axes, n_norm) = (self.sigma.len(), self.experiment.n_norm);
        let square = |row: &[f64]| row.iter().zip(&self.sigma).take(n_norm).map(|(r, s)| (r * s).powi(2)).sum::<f64>();
        let rows = (scaled.len() / n_axes).max(1) as f64;
        (scaled.chunks(n_axes).map(square).sum::<f64>() / rows).sqrt()
    }

    /// Noise of the axes and repeats of the rows as these residuals tell them.
    fn rescale(&mut self, residuals: &[f64]) {
        let n_axes = self.sigma.len();
        for axis in 0..n_axes {
            let of_axis = residuals.iter().skip(axis).step_by(n_axes);
            let mut squares: Vec<f64> = of_axis.map(|r| (r * self.sigma[axis]).powi(2)).collect();
            squares.sort_unstable_by(f64::total_cmp);
            squares.truncate(squares.len() - squares.len() / TRIMMED);
            let mean = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
            self.sigma[axis] = mean.sqrt().max(1e-12);
        }
        self.repeats = self.groups.repeats(residuals, n_axes);
    }
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
fn solve(mut information: DMatrix<f64>, gradient: &DVector<f64>) -> DVector<f64> {
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
        for _ in 0..ROUNDS {
            let residuals = self.training_residuals(&best.fit);
            self.rescale(&residuals);
            self.linearise(&best.fit.values);
            let residuals = self.training_residuals(&best.fit);
            self.accumulate(&weights(&residuals, 1));
            best = self.judged(best.fit.active, best.effect);
        }
        Ok(best)
    }

    fn screened(&mut self, current: &Trial<Self>) -> Result<Vec<Trial<Self>>, Self::Error> {
        let open: Vec<(usize, Vec<usize>)> =
            (0..self.moves.len()).filter_map(|number| Some((number, self.added(number, &current.fit)?))).collect();
        let with = |(number, added): &(usize, Vec<usize>)| {
            self.judged([&current.fit.active[..], added].concat(), Some(*number))
        };
        Ok(open.par_iter().map(with).collect())
    }

    fn refined(&mut self, trial: &Trial<Self>) -> Result<Trial<Self>, Self::Error> {
        Ok(trial.clone())
    }

    fn without(&mut self, best: &Trial<Self>, dropped: usize) -> Result<Trial<Self>, Self::Error> {
        let mut active = best.fit.active.clone();
        active.remove(dropped);
        let last = active.last().copied();
        Ok(self.judged(active, last))
    }

    fn fall(&self, before: &Trial<Self>, after: &Trial<Self>) -> Fall {
        let n_axes = self.sigma.len();
        let mut cells = vec![[0.0; 2]; self.groups.n_blocks * n_axes];
        let pairs = losses(&before.predicted, 1).into_iter().zip(losses(&after.predicted, 1));
        for (k, (before, after)) in pairs.enumerate() {
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
