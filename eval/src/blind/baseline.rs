//! Baselines on the same data: what a plain regression over the same laws would answer.
//!
//! Both see the same candidates as columns, linearised at the model, in units of the same noise. A step has one
//! column for each of a few moments. Neither has robust weights, a confirmation, alternatives or `unexplained-structure`:
//! whatever they take in is named.
//!
//! - **Stepwise**: least squares; the law that lowers the squares most is taken in while the Bayesian information criterion
//!   n·ln(RSS/n) + k·ln n falls.
//! - **Sparse**: sequentially thresholded least squares over the complete dictionary, columns scaled to a root mean square of
//!   one, ridge 0.05 as PySINDy has it; the threshold is the one that predicts left-out words best. Source: S. L. Brunton,
//!   J. L. Proctor, J. N. Kutz, PNAS 113 (2016) 3932.

use anyhow::{Context, Result};
use darm_arm::arm::{Arm, ArmScratch};
use darm_core::effect::Effect;
use darm_diagnose::effect::Place;
use darm_diagnose::linearise::arm_candidates::{all, beginning};
use darm_diagnose::linearise::sensitivity::Sensitivity;
use darm_diagnose::prepare::observations::{NoPose, Observations};
use darm_diagnose::prepare::repeatability::{PoseRepeatability, repeated};
use darm_diagnose::truth::Blind;
use darm_measure::root_mean_square;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::case::Class;
use super::judge::{Mark, Named, pairs, right};

/// Moments that a step may be at.
const MOMENTS: usize = 6;
/// Laws that the stepwise search takes in at most, as many as a model holds.
const MAX_EFFECTS: usize = 8;
/// Folds of the sparse regression's threshold.
const FOLDS: usize = 3;
/// Thresholds tried, in units of the noise.
const THRESHOLDS: [f64; 5] = [0.1, 0.3, 1.0, 3.0, 10.0];
/// Ridge, in shares of a column's own square.
const RIDGE: f64 = 0.05;
/// Rounds of thresholding.
const ROUNDS: usize = 10;

/// What both baselines answered.
#[derive(Serialize, Deserialize)]
pub(super) struct Marks {
    pub(super) stepwise: Mark,
    pub(super) sparse: Mark,
}

/// Runs both baselines and marks them.
pub(super) fn marks(arm: &Arm, class: Class, blind: &Blind) -> Result<Marks> {
    let noise = repeated(arm, blind.measured()).context("no words are repeated")?;
    let dictionary = Dictionary::new(arm, blind, noise).map_err(|no_pose| no_pose.error)?;
    let mark = |solution: &DVector<f64>| dictionary.mark(class, blind, solution);
    Ok(Marks { stepwise: mark(&dictionary.stepwise()), sparse: mark(&dictionary.sparse()) })
}

/// All columns of all laws, scaled.
struct Dictionary {
    effects: Vec<Effect<f64>>,
    /// The effect of each column.
    owner: Vec<usize>,
    /// Rows are components of residuals.
    columns: DMatrix<f64>,
    residuals: DVector<f64>,
    /// The fold of each row.
    folds: Vec<usize>,
    held_out: Observations,
    held_out_columns: DMatrix<f64>,
    held_out_residuals: Vec<f64>,
    noise: PoseRepeatability,
}

/// Squares and products of columns and residuals.
#[derive(Clone)]
struct Sums {
    gram: DMatrix<f64>,
    along: DVector<f64>,
    square: f64,
    n: usize,
}

impl Dictionary {
    fn new(arm: &Arm, blind: &Blind, noise: PoseRepeatability) -> Result<Self, NoPose> {
        let (run, mut scratch) = (blind.measured(), ArmScratch::default());
        let training = Observations::new(arm, run, noise.sigma, |sample| !sample.held_out);
        let held_out = Observations::new(arm, run, noise.sigma, |sample| sample.held_out);
        let seen = Sensitivity::new(&arm.model, &training, &mut scratch)?;
        let unseen = Sensitivity::new(&arm.model, &held_out, &mut scratch)?;
        let end_s = training.times_s().last().unwrap_or(0.0);
        let (effects, mut owner, mut columns, mut others) =
            (candidates(arm, end_s), Vec::new(), Vec::new(), Vec::new());
        for (index, effect) in effects.iter().enumerate() {
            for value in 0..effect.values().len() {
                let Some(column) = seen.column(effect, value) else { continue };
                let scale = 1.0 / root_mean_square(&column);
                let other = unseen.column(effect, value).unwrap_or_else(|| vec![0.0; unseen_len(&held_out)]);
                columns.push(DVector::from_vec(column) * scale);
                others.push(DVector::from_vec(other) * scale);
                owner.push(index);
            }
        }
        let n_axes = training.n_axes();
        let folds = training.groups().iter().flat_map(|group| vec![group % FOLDS; n_axes]).collect();
        Ok(Self {
            effects,
            owner,
            columns: DMatrix::from_columns(&columns),
            residuals: DVector::from_vec(seen.into_residuals()),
            folds,
            held_out_columns: DMatrix::from_columns(&others),
            held_out_residuals: unseen.into_residuals(),
            held_out,
            noise,
        })
    }

    /// The sums over the rows of some folds.
    fn sums(&self, chosen: impl Fn(usize) -> bool) -> Sums {
        let rows: Vec<usize> = (0..self.folds.len()).filter(|&row| chosen(self.folds[row])).collect();
        let (columns, residuals) = (self.columns.select_rows(&rows), self.residuals.select_rows(&rows));
        Sums {
            gram: columns.tr_mul(&columns),
            along: columns.tr_mul(&residuals),
            square: residuals.norm_squared(),
            n: rows.len(),
        }
    }

    /// The columns of an effect.
    fn of(&self, effect: usize) -> impl Iterator<Item = usize> {
        (0..self.owner.len()).filter(move |&column| self.owner[column] == effect)
    }

    fn stepwise(&self) -> DVector<f64> {
        let sums = self.sums(|_| true);
        let (mut active, mut taken): (Vec<usize>, Vec<usize>) = (Vec::new(), Vec::new());
        let mut best_bic = sums.bic(&active);
        while taken.len() < MAX_EFFECTS {
            let open = (0..self.effects.len()).filter(|effect| !taken.contains(effect));
            let tried = open.map(|effect| {
                let more: Vec<usize> = active.iter().copied().chain(self.of(effect)).collect();
                (sums.bic(&more), effect)
            });
            let Some((bic, best)) = tried.min_by(|a, b| a.0.total_cmp(&b.0)) else { break };
            if bic >= best_bic {
                break;
            }
            best_bic = bic;
            taken.push(best);
            active.extend(self.of(best));
        }
        sums.solution(&active, 0.0)
    }

    fn sparse(&self) -> DVector<f64> {
        let all = self.sums(|_| true);
        let folds: Vec<[Sums; 2]> =
            (0..FOLDS).map(|fold| [self.sums(|of| of != fold), self.sums(|of| of == fold)]).collect();
        let starts: Vec<DVector<f64>> = folds.iter().map(|[seen, _]| seen.solution(&seen.every(), RIDGE)).collect();
        let unseen = |threshold: f64| -> f64 {
            let of_fold = |([seen, left_out], start): (&[Sums; 2], &DVector<f64>)| {
                left_out.residual(&seen.thresholded(start, threshold))
            };
            folds.iter().zip(&starts).map(of_fold).sum()
        };
        let best = THRESHOLDS.into_iter().map(|threshold| (unseen(threshold), threshold));
        let threshold = best.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(1.0, |(_, threshold)| threshold);
        all.thresholded(&all.solution(&all.every(), RIDGE), threshold)
    }

    fn mark(&self, class: Class, blind: &Blind, solution: &DVector<f64>) -> Mark {
        let kept = |effect: &usize| self.of(*effect).any(|column| solution[column] != 0.0);
        let mut named: Vec<Named> = (0..self.effects.len())
            .filter(kept)
            .map(|effect| (self.effects[effect].name(), Place::of_arm(&self.effects[effect])))
            .collect();
        named.dedup();
        let parts: Vec<Named> = named.iter().map(|(law, place)| (*law, place.part())).collect();
        let (mut is_named, mut placed) = right(&pairs(blind.unseal()), &parts);
        if class == Class::Outside {
            (is_named, placed) = (named.is_empty(), false);
        }
        Mark { named: is_named, placed, ratio: self.ratio(blind, solution), ..Mark::default() }
    }

    /// Held-out error over the repeatability, without the rows that the generator spoiled.
    fn ratio(&self, blind: &Blind, solution: &DVector<f64>) -> f64 {
        let after = DVector::from_vec(self.held_out_residuals.clone()) + &self.held_out_columns * solution;
        let distances = self.held_out.distances_m(after.as_slice());
        let rows = self.held_out.rows.iter().zip(distances);
        let good = rows.filter(|(row, _)| !blind.spoiled().contains(&row.sample)).map(|(_, distance)| distance);
        root_mean_square(&good.collect::<Vec<_>>()) / self.noise.distance_m
    }
}

fn unseen_len(held_out: &Observations) -> usize {
    held_out.rows.len() * held_out.n_axes()
}

/// All candidates, steps at several moments of a run of this length.
fn candidates(arm: &Arm, end_s: f64) -> Vec<Effect<f64>> {
    let moments = || (1..=MOMENTS).map(|k| end_s * k as f64 / (MOMENTS + 1) as f64);
    let timed = |effect: Effect<f64>| {
        let steps: Vec<_> = moments().filter_map(|since_s| beginning(&effect, since_s)).collect();
        if steps.is_empty() { vec![effect] } else { steps }
    };
    all(&arm.model).into_iter().flat_map(timed).collect()
}

impl Sums {
    fn every(&self) -> Vec<usize> {
        (0..self.along.len()).collect()
    }

    /// The least squares of residual + columns·x over the active columns; zero elsewhere.
    fn solution(&self, active: &[usize], ridge: f64) -> DVector<f64> {
        let mut solution = DVector::zeros(self.along.len());
        if active.is_empty() {
            return solution;
        }
        let mut gram = self.gram.select_rows(active).select_columns(active);
        for k in 0..active.len() {
            gram[(k, k)] *= 1.0 + ridge.max(1e-9);
        }
        let along = self.along.select_rows(active);
        if let Some(cholesky) = gram.cholesky() {
            let x = cholesky.solve(&along);
            active.iter().zip(x.iter()).for_each(|(&column, &x)| solution[column] = -x);
        }
        solution
    }

    /// Sum of squares that a solution leaves.
    fn residual(&self, solution: &DVector<f64>) -> f64 {
        self.square + 2.0 * solution.dot(&self.along) + solution.dot(&(&self.gram * solution))
    }

    fn bic(&self, active: &[usize]) -> f64 {
        let n = self.n as f64;
        let left = self.residual(&self.solution(active, 0.0)).max(f64::MIN_POSITIVE);
        n * (left / n).ln() + active.len() as f64 * n.ln()
    }

    /// Small values are dropped and the others solved again, until none is small; then without the ridge.
    fn thresholded(&self, start: &DVector<f64>, threshold: f64) -> DVector<f64> {
        let large = |x: &DVector<f64>| (0..x.len()).filter(|&k| x[k].abs() >= threshold).collect::<Vec<usize>>();
        let mut active = large(start);
        for _ in 0..ROUNDS {
            let next = large(&self.solution(&active, RIDGE));
            if next.len() == active.len() {
                break;
            }
            active = next;
        }
        self.solution(&active, 0.0)
    }
}
