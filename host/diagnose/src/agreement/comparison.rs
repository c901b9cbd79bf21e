//! Readings of signals and their model, held against each other.
//!
//! Models of robots are rough before they are identified: friction is missing and masses are guesses. So readings are compared
//! by the model as it is first, then by what is left with every law at every place, on rows that are left out in turn: the sum
//! over the axes of the logarithm of the error as a share of what was measured, which another unit does not change.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use rayon::prelude::{IntoParallelIterator as _, ParallelIterator as _};

use super::column_readings::{Hypothesis, around};
use super::training::{AGREES, FOLLOWS, OTHER_UNIT, Training, trimmed_of_axis, variation};
use crate::effect::LawName;
use crate::error::MIN_PIECES;
use crate::linearise::experiment::{Experiment, TableColumns};
use crate::linearise::linearise;
use crate::linearise::model::Model;
use crate::misreading::Misreading;
use crate::prepare::column_reading::ColumnReading;
use crate::prepare::groups::Groups;
use crate::prepare::signals::Prepared;
use crate::progress::{Cancelled, Progress};
use crate::select::signals::Signals;
use crate::select::signals::backward::every_law;
use crate::select::significance::{DISCOVERY_LEVEL, chance_of_mean};

/// Rows that readings are compared on.
const ROWS: usize = 600;
/// Factor by which the product of the axes' errors falls under another reading, with every law.
const MUCH_LESS: f64 = 2.0;
/// Share of its error that is left of the model as it is under another reading.
const MUCH_LESS_AS_IT_IS: f64 = 0.25;
/// Hypotheses that are compared with every law, the best ones of the model as it is.
const COMPARED: usize = 12;
/// Times that laws with impossible sizes are taken out of a fit.
const MAX_ROUNDS: usize = 4;
/// A row counts as this multiple of the usual error at most.
const FAR: f64 = 4.0;

/// A table and its model, which may be read in other ways.
pub(super) struct Comparison<'a> {
    pub(super) model: &'a Model,
    pub(super) data: &'a Prepared,
    pub(super) progress: &'a Progress,
}

/// A hypothesis with what it leaves.
pub(super) struct HypothesisTrial {
    pub(super) left: ResidualError,
    pub(super) hypothesis: Hypothesis,
}

/// A hypothesis that explains far more than the table as it is read, both with these laws.
pub(super) struct Improvement {
    pub(super) tried: HypothesisTrial,
    pub(super) laws: Laws,
}

impl Comparison<'_> {
    /// The best of these hypotheses, where it explains far more than the table as it is read and most of what was measured.
    pub(super) fn better(
        &self,
        hypotheses: Vec<Hypothesis>,
        columns: &TableColumns,
    ) -> Result<Option<Improvement>, Cancelled> {
        let n_tried = hypotheses.len() as f64;
        let is_chance = |as_read: &ResidualError, left: &ResidualError| {
            as_read.chance_of_fall_to(left) * n_tried >= DISCOVERY_LEVEL
        };
        let mut tried = self.tried(hypotheses, |_| (Laws::None, f64::INFINITY))?;
        let mut as_read = BaselineCache { comparison: self, left: BTreeMap::new() };
        for best in 0..tried.len() {
            let HypothesisTrial { left, hypothesis } = &tried[best];
            let is_it = as_read.left(hypothesis.columns.rows_later(), Laws::None)?.is_some_and(|as_read| {
                let is_near = left.share < AGREES || left.share < FOLLOWS && OTHER_UNIT * left.norm < as_read.norm;
                is_near && left.norm < MUCH_LESS_AS_IT_IS * as_read.norm && !is_chance(as_read, left)
            });
            if is_it {
                return self.refined(tried.swap_remove(best), columns, Laws::None);
            }
        }
        // Friction that the model does not have hides what a short delay changes.
        let is_compared =
            |(rank, tried): &(usize, HypothesisTrial)| *rank < COMPARED || tried.hypothesis.is_short_delay();
        let compared = tried.into_iter().enumerate().filter(is_compared);
        let hypotheses: Vec<Hypothesis> = compared.map(|(_, tried)| tried.hypothesis).collect();
        // The few rows that a delay takes off either end change this by far less than [`MUCH_LESS`].
        let mut limits: BTreeMap<Laws, f64> = BTreeMap::new();
        for laws in hypotheses.iter().map(|hypothesis| Laws::compared_with(&hypothesis.misreading)) {
            limits.insert(laws, as_read.left(0, laws)?.map_or(f64::INFINITY, |left| left.log));
        }
        let with_laws = |misreading: &Misreading| {
            let laws = Laws::compared_with(misreading);
            (laws, limits[&laws])
        };
        for best in self.tried(hypotheses, with_laws)? {
            let HypothesisTrial { left, hypothesis } = &best;
            let laws = Laws::compared_with(&hypothesis.misreading);
            let is_far_better = left.share < AGREES
                && as_read
                    .left(hypothesis.columns.rows_later(), laws)?
                    .is_some_and(|as_read| left.log < as_read.log - MUCH_LESS.ln() && !is_chance(as_read, left));
            if is_far_better {
                return self.refined(best, columns, laws);
            }
        }
        Ok(None)
    }

    /// A delay with those around it tried too; any other reading as it is.
    fn refined(
        &self,
        best: HypothesisTrial,
        columns: &TableColumns,
        laws: Laws,
    ) -> Result<Option<Improvement>, Cancelled> {
        let tried = match best.hypothesis.misreading {
            Misreading::Delay { delay_s } => {
                let around = around(self.data, &columns.measured.concat(), delay_s);
                self.tried(around, |_| (laws, f64::INFINITY))?.into_iter().next()
            }
            _ => Some(best),
        };
        Ok(tried.map(|tried| Improvement { tried, laws }))
    }

    /// Hypotheses with what they leave, the best one first, each with the laws and the limit of [`Self::left`].
    fn tried(
        &self,
        hypotheses: Vec<Hypothesis>,
        with: impl Fn(&Misreading) -> (Laws, f64) + Sync,
    ) -> Result<Vec<HypothesisTrial>, Cancelled> {
        let tried = hypotheses.into_par_iter().filter_map(|hypothesis| {
            let Hypothesis { misreading, columns, model } = &hypothesis;
            let left = self.left(columns, columns.rows_later(), model.as_ref(), with(misreading)).transpose()?;
            Some(left.map(|left| HypothesisTrial { left, hypothesis }))
        });
        let mut tried = tried.collect::<Result<Vec<HypothesisTrial>, Cancelled>>()?;
        tried.sort_by(|a, b| a.left.log.total_cmp(&b.left.log));
        Ok(tried)
    }

    /// What a reading leaves with these laws, in rows from which the one `rows_later` is in the same stretch; `None` where
    /// it gives no experiment. Where laws of any size leave more than a limit, a sum of logarithms, those of possible ones are
    /// not asked.
    fn left(
        &self,
        reading: &ColumnReading,
        rows_later: isize,
        model: Option<&Model>,
        (laws, limit): (Laws, f64),
    ) -> Result<Option<ResidualError>, Cancelled> {
        self.progress.check()?;
        let data = self.data.read_as(reading.clone(), rows_later, ROWS);
        let Ok(experiment) = linearise(model.unwrap_or(self.model), &data) else { return Ok(None) };
        let Some(training) = Training::of(&experiment) else { return Ok(None) };
        let measured = variation(&experiment, &training.measured);
        let (n_axes, n_norm) = (experiment.axes.len(), experiment.n_norm);
        let groups = Groups::new(&experiment.rows);
        let blocks = groups.blocks.clone();
        if groups.n_blocks < MIN_PIECES {
            return Ok(None);
        }
        let of = |residuals: &[f64]| {
            ResidualError::of(&AxisLeft::of_norm(n_norm, n_axes, residuals, &measured), residuals, n_axes, &blocks)
        };
        let is_lost = |residuals: &[f64]| of(residuals).is_none_or(|left| left.log > limit);
        let residuals = match laws {
            Laws::None => experiment.training_rows(&experiment.residuals),
            Laws::All => self.residuals_in_turn(experiment, groups, None, is_lost)?,
            Laws::AllBut(law) => self.residuals_in_turn(experiment, groups, Some(law), is_lost)?,
        };
        Ok(of(&residuals))
    }

    /// Residuals of the training rows, each of a fit with every law at every place that has not seen it; a law that fits best
    /// with an impossible size, a friction below zero, is left out, unless the reading is lost with it.
    fn residuals_in_turn(
        &self,
        experiment: Experiment,
        groups: Groups,
        without: Option<LawName>,
        is_lost: impl Fn(&[f64]) -> bool,
    ) -> Result<Vec<f64>, Cancelled> {
        let problem = Signals::new(experiment, groups).with_progress(self.progress.clone());
        let candidates = &problem.experiment.candidates;
        let mut laws = every_law(&problem, &[]);
        laws.retain(|&k| Some(candidates[k].law) != without);
        let mut best = problem.fitted(laws)?;
        for _ in 0..MAX_ROUNDS {
            let can_be = |k: &usize| {
                let values = problem.indices(&[*k]).into_iter().zip(&candidates[*k].values);
                values.into_iter().all(|(index, value)| best.fit.values[index] >= value.min)
            };
            let possible: Vec<usize> = best.fit.active.iter().copied().filter(can_be).collect();
            if possible.len() == best.fit.active.len() || is_lost(&best.unseen_residuals) {
                break;
            }
            best = problem.fitted(possible)?;
        }
        Ok(best.unseen_residuals)
    }
}

/// What a table leaves as it is read: many hypotheses are judged by the same rows and laws.
struct BaselineCache<'a> {
    comparison: &'a Comparison<'a>,
    left: BTreeMap<(isize, Laws), Option<ResidualError>>,
}

impl BaselineCache<'_> {
    /// In rows from which the one `rows_later` is in the same stretch.
    fn left(&mut self, rows_later: isize, laws: Laws) -> Result<Option<&ResidualError>, Cancelled> {
        let compute = || self.comparison.left(&ColumnReading::default(), rows_later, None, (laws, f64::INFINITY));
        Ok(match self.left.entry((rows_later, laws)) {
            Entry::Occupied(known) => known.into_mut().as_ref(),
            Entry::Vacant(place) => place.insert(compute()?).as_ref(),
        })
    }
}

/// The errors of one axis.
pub(super) struct AxisLeft {
    axis: usize,
    left: f64,
    measured: f64,
}

impl AxisLeft {
    /// Those of the axes of the norm, the first `n_norm` of `n_axes`, on which something was measured: of residuals and of what
    /// was measured less its mean, rows × axes both.
    pub(super) fn of_norm(n_norm: usize, n_axes: usize, residuals: &[f64], measured: &[f64]) -> Vec<Self> {
        let of = |axis: usize| {
            let [left, measured] = [residuals, measured].map(|rows| trimmed_of_axis(rows, axis, n_axes));
            Self { axis, left, measured }
        };
        (0..n_norm).map(of).filter(|axis| axis.measured > 0.0).collect()
    }

    /// The logarithm of the error as a share of what was measured.
    pub(super) fn log(&self) -> f64 {
        (self.left / self.measured).max(f64::MIN_POSITIVE).ln()
    }
}

/// Laws that a model is fitted with, each at all its places.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Laws {
    None,
    All,
    AllBut(LawName),
}

impl Laws {
    /// All but the law that would do the same as a reading.
    fn compared_with(misreading: &Misreading) -> Self {
        match misreading {
            Misreading::Delay { .. } => Self::AllBut(LawName::Delay),
            Misreading::InvertedColumns { .. } => Self::AllBut(LawName::Gain),
            _ => Self::All,
        }
    }
}

/// What is left by a reading.
pub(super) struct ResidualError {
    /// Sum over the axes of the norm of the logarithm of the error as a share of what was measured.
    pub(super) log: f64,
    /// Root mean square of these axes together.
    pub(super) norm: f64,
    /// That root mean square as a share of what was measured.
    share: f64,
    /// Sum over the axes of the logarithm of the error in each piece of rows, rows that are far off drawn near.
    pieces: Vec<f64>,
}

impl ResidualError {
    /// By the errors of the axes; `None` where nothing was measured.
    fn of(axes: &[AxisLeft], residuals: &[f64], n_axes: usize, blocks: &[usize]) -> Option<Self> {
        let log: f64 = axes.iter().map(AxisLeft::log).sum();
        let rows: Vec<(&[f64], usize)> = residuals.chunks(n_axes).zip(blocks.iter().copied()).collect();
        let of_piece = |piece: &[(&[f64], usize)]| {
            let square = |axis: &AxisLeft| {
                let near = piece.iter().map(|(row, _)| row[axis.axis].abs().min(FAR * axis.left).powi(2));
                near.sum::<f64>() / piece.len() as f64
            };
            axes.iter().map(|axis| 0.5 * square(axis).max(f64::MIN_POSITIVE).ln()).sum()
        };
        let norm = |of: fn(&AxisLeft) -> f64| axes.iter().map(|axis| of(axis).powi(2)).sum::<f64>().sqrt();
        (!axes.is_empty() && log.is_finite()).then_some(Self {
            log,
            norm: norm(|axis| axis.left),
            share: norm(|axis| axis.left) / norm(|axis| axis.measured),
            pieces: rows.chunk_by(|a, b| a.1 == b.1).map(of_piece).collect(),
        })
    }

    /// The chance of as large a fall to what another reading of the same rows leaves.
    fn chance_of_fall_to(&self, other: &Self) -> f64 {
        let falls: Vec<f64> = self.pieces.iter().zip(&other.pieces).map(|(own, other)| own - other).collect();
        chance_of_mean(&falls)
    }
}
