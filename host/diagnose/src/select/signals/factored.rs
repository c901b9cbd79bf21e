//! A model whose normal equations are factorised once: those with more or with fewer effects follow from it.
//!
//! # Method
//!
//! For the rows without each fold, and for all rows, A·x = −g is solved by A = L·Lᵀ. With more values c beside those b of
//! the model only the Schur complement is solved, A_cc − Wᵀ·W with W = L⁻¹·A_bc; without some of them, u, the others move
//! by V·V_uu⁻¹·x_u with V the columns u of A⁻¹. Source: G. H. Golub, C. F. Van Loan, Matrix Computations, 4th ed., 2013,
//! §4.2.9 and §2.1.4.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::{
    IndexedParallelIterator as _, IntoParallelIterator as _, IntoParallelRefIterator as _, ParallelIterator as _,
};

use super::normal_equations::System;
use super::{Move, SignalFit, Signals};
use crate::progress::Cancelled;
use crate::select::problem::{Trial, Weighted};

/// A model, factorised under a weighting.
pub(crate) struct Factored<'a> {
    /// The problem under the weighting.
    pub(crate) weighted: Weighted<'a, Signals>,
    /// Its candidates.
    pub(crate) active: Vec<usize>,
    indices: Vec<usize>,
    /// One for each system of the kind.
    parts: Vec<Part>,
}

/// The model in one system.
struct Part {
    root: Cholesky<f64, Dyn>,
    /// L⁻¹·g.
    half: DVector<f64>,
    /// x, scaled as the system is.
    values: DVector<f64>,
}

/// The model with these candidates, fitted and cross-validated.
///
/// # Errors
///
/// The diagnosis was given up.
pub(crate) fn judged(
    weighted: Weighted<Signals>,
    active: Vec<usize>,
    effect: Option<Move>,
) -> Result<Trial<Signals>, Cancelled> {
    Ok(Factored::new(weighted, active)?.trial(effect))
}

/// Values beside those of a model in one system.
struct Extension<'a> {
    base: &'a Factored<'a>,
    system: &'a System,
    part: &'a Part,
    open: &'a [usize],
    /// L⁻¹·A_bc and A_bb⁻¹·A_bc for all that are open.
    half: DMatrix<f64>,
    answer: DMatrix<f64>,
}

impl Part {
    fn new(system: &System, indices: &[usize]) -> Self {
        let n = indices.len();
        // The lower triangle is all that a factorisation reads.
        let entry = |a: usize, b: usize| if a < b { 0.0 } else { system.entry(indices[a], indices[b]) };
        let matrix = DMatrix::from_fn(n, n, entry);
        let gradient = DVector::from_fn(n, |a, _| system.gradient[indices[a]]);
        // A value that is not a number does not count.
        let (root, gradient) = match Cholesky::new(matrix) {
            Some(root) => (root, gradient),
            None => (Cholesky::pack_dirty(DMatrix::identity(n, n)), DVector::zeros(n)),
        };
        let half = root.l_dirty().solve_lower_triangular(&gradient).unwrap_or_else(|| gradient.clone());
        let values = -root.solve(&gradient);
        Self { root, half, values }
    }

    /// The values where those at `at` are held at zero; `unit` has a column of the identity for each of these.
    fn without(&self, at: &[usize], unit: &DMatrix<f64>) -> DVector<f64> {
        let spread = self.root.solve(unit);
        let own = self.values.select_rows(at);
        let taken = Cholesky::new(spread.select_rows(at)).map_or(own.clone(), |root| root.solve(&own));
        let mut values = &self.values - spread * taken;
        at.iter().for_each(|&k| values[k] = 0.0);
        values
    }
}

impl<'a> Factored<'a> {
    /// The model with these candidates.
    pub(crate) fn new(weighted: Weighted<'a, Signals>, active: Vec<usize>) -> Result<Self, Cancelled> {
        let indices = weighted.problem.indices(&active);
        let part = |system: &System| {
            weighted.problem.progress.check()?;
            Ok(Part::new(system, &indices))
        };
        let parts = weighted.weighting.systems.par_iter().map(part).collect::<Result<_, Cancelled>>()?;
        Ok(Self { weighted, active, indices, parts })
    }

    /// The model itself.
    pub(crate) fn trial(&self, effect: Option<Move>) -> Trial<Signals> {
        self.cross_validated(self.active.clone(), effect, self.each(|part| part.values.clone()))
    }

    /// The model without some of its candidates.
    pub(crate) fn without(&self, dropped: &[usize]) -> Result<Trial<Signals>, Cancelled> {
        self.weighted.problem.progress.check()?;
        let gone = self.weighted.problem.indices(dropped);
        let at: Vec<usize> = (0..self.indices.len()).filter(|&k| gone.contains(&self.indices[k])).collect();
        let mut unit = DMatrix::zeros(self.indices.len(), at.len());
        at.iter().enumerate().for_each(|(column, &row)| unit[(row, column)] = 1.0);
        let active = self.active.iter().copied().filter(|k| !dropped.contains(k)).collect();
        Ok(self.cross_validated(active, None, self.each(|part| part.without(&at, &unit))))
    }

    /// The models with more candidates, each move's beside this one's.
    pub(crate) fn with(&self, moves: &[(Move, Vec<usize>)]) -> Result<Vec<Trial<Signals>>, Cancelled> {
        let progress = &self.weighted.problem.progress;
        let added: Vec<Vec<usize>> = moves.iter().map(|(_, added)| self.weighted.problem.indices(added)).collect();
        let mut open = added.concat();
        open.sort_unstable();
        open.dedup();
        let place = |value: &usize| open.binary_search(value).expect("open has the values of all moves");
        let places: Vec<Vec<usize>> = added.iter().map(|values| values.iter().map(place).collect()).collect();
        let n_folds = self.weighted.weighting.linearised.columns.n_folds();
        let moved = |fold: usize| {
            progress.check()?;
            self.extension(fold, &open).moved(fold, &places)
        };
        let folds = (0..n_folds).into_par_iter().map(moved).collect::<Result<Vec<Vec<Vec<f64>>>, Cancelled>>()?;
        let extension = self.extension(n_folds, &open);
        let model = |number: usize| {
            progress.check()?;
            let (effect, added) = &moves[number];
            let moved: Vec<&[f64]> = folds.iter().map(|fold| &fold[number][..]).collect();
            let active = [&self.active[..], added].concat();
            let fit = SignalFit { active, values: extension.values(&places[number]) };
            Ok(self.weighted.trial(fit, Some(*effect), &moved))
        };
        (0..moves.len()).into_par_iter().map(model).collect()
    }

    /// Values of all candidates, in their units, from those of the model in each system.
    fn each(&self, values: impl Fn(&Part) -> DVector<f64> + Sync) -> Vec<Vec<f64>> {
        let systems = self.weighted.weighting.systems.par_iter().zip(&self.parts);
        systems.map(|(system, part)| system.unscaled(&self.indices, &values(part))).collect()
    }

    /// A model with its values in each system, cross-validated by those of the systems without a fold.
    fn cross_validated(&self, active: Vec<usize>, effect: Option<Move>, mut values: Vec<Vec<f64>>) -> Trial<Signals> {
        let of_all_rows = values.pop().expect("the last system is that of all rows");
        let columns = &self.weighted.weighting.linearised.columns;
        let moved: Vec<Vec<f64>> =
            values.par_iter().enumerate().map(|(fold, values)| columns.moved(fold, values)).collect();
        let moved: Vec<&[f64]> = moved.iter().map(Vec::as_slice).collect();
        self.weighted.trial(SignalFit { active, values: of_all_rows }, effect, &moved)
    }

    fn extension<'b>(&'b self, number: usize, open: &'b [usize]) -> Extension<'b> {
        let (system, part) = (&self.weighted.weighting.systems[number], &self.parts[number]);
        let cross = DMatrix::from_fn(self.indices.len(), open.len(), |a, b| system.entry(self.indices[a], open[b]));
        let answer = part.root.solve(&cross);
        let half = part.root.l_dirty().solve_lower_triangular(&cross).unwrap_or(cross);
        Extension { base: self, system, part, open, half, answer }
    }
}

impl Extension<'_> {
    /// The values of a move, scaled as the system is.
    fn solved(&self, places: &[usize]) -> DVector<f64> {
        let half = self.half.select_columns(places);
        let of = |k: usize| self.open[places[k]];
        let own = DMatrix::from_fn(places.len(), places.len(), |a, b| self.system.entry(of(a), of(b)));
        let gradient = DVector::from_fn(places.len(), |a, _| self.system.gradient[of(a)]);
        let left = gradient - half.tr_mul(&self.part.half);
        match Cholesky::new(own - half.tr_mul(&half)) {
            Some(root) => -root.solve(&left),
            None => DVector::zeros(places.len()),
        }
    }

    /// Values of all candidates with a move, in their units.
    fn values(&self, places: &[usize]) -> Vec<f64> {
        let new = self.solved(places);
        let old = &self.part.values - self.answer.select_columns(places) * &new;
        let mut values = self.system.unscaled(&self.base.indices, &old);
        places
            .iter()
            .zip(new.iter())
            .for_each(|(&k, value)| values[self.open[k]] = value * self.system.scale[self.open[k]]);
        values
    }

    /// What the model with each move adds in the rows of a fold.
    fn moved(&self, fold: usize, moves: &[Vec<usize>]) -> Result<Vec<Vec<f64>>, Cancelled> {
        let columns = &self.base.weighted.weighting.linearised.columns;
        let scale = &self.system.scale;
        let mut sizes = DMatrix::zeros(scale.len(), self.open.len());
        for (row, &value) in self.base.indices.iter().enumerate() {
            sizes.set_row(value, &(self.answer.row(row) * -scale[value]));
        }
        self.open.iter().enumerate().for_each(|(column, &value)| sizes[(value, column)] = scale[value]);
        let each = columns.moved_by_each(fold, &sizes, &self.base.weighted.problem.progress)?;
        let alone = columns.moved(fold, &self.system.unscaled(&self.base.indices, &self.part.values));
        let with = |places: &Vec<usize>| {
            let mut moved = alone.clone();
            let sizes = self.solved(places);
            places.iter().zip(sizes.iter()).for_each(|(&place, size)| add_column(&mut moved, &each, place, *size));
            moved
        };
        Ok(moves.iter().map(with).collect())
    }
}

/// Adds the column `place` of each axis to rows × axes, times `size`.
fn add_column(rows: &mut [f64], of_axes: &[DMatrix<f64>], place: usize, size: f64) {
    for (axis, numbers) in of_axes.iter().enumerate() {
        let of_axis = rows.iter_mut().skip(axis).step_by(of_axes.len());
        of_axis.zip(numbers.column(place).iter()).for_each(|(sum, number)| *sum += number * size);
    }
}
