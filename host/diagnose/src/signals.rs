//! Diagnosis of channels: force, position, torque, wrench or closure, row by row, against a model that predicts them.
//!
//! ```text
//! table ─► prepared rows ─► experiment: residuals, and a column for each value of each law that may be missing
//!                                │
//!                                ▼
//!       search (the same as for tool poses) ─► values, intervals, what is not told ─► what remains
//! ```
//!
//! No law is tied to a set of data: a kind of experiment lists the laws that can act on what it observes. Rows that are
//! held out are seen by nothing before the errors are told.

use std::path::Path;

use crate::linearise::experiment::Experiment;
use crate::linearise::model::{Model, What};
use crate::linearise::{force, model_effects as known, point_contact as closure, position, torque, wrench};
use crate::measurement::hold_out::HoldOut;
use crate::measurement::table::{Names, Table};
use crate::measurement::{Finding, ReadError};
use crate::outcome_signals::Diagnosis;
use crate::prepare::groups::Groups;
use crate::prepare::signals::{Preparation, PrepareError, Prepared};
use crate::project as physical;
use crate::report::signals as summary;
use crate::select::forward::Search;
use crate::select::problem::{Kind as _, Trial};
use crate::select::signals::Channels;
use crate::select::significance::RIVAL_LEVEL;
use crate::select::{backward as thinned, simplify as simplified};

/// Pieces of rows without which nothing can be said.
const FEWEST_PIECES: usize = 8;

/// Slopes and residuals from here on are no measurement.
const LARGEST: f64 = 1e100;

/// How a diagnosis of channels is made.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// How the table is made ready.
    pub preparation: Preparation,
    /// Laws that are in the model from the start, each at all its places.
    pub always: Vec<String>,
    /// Told in the report.
    pub seed: u64,
}

/// Why there is no diagnosis.
#[derive(Debug, thiserror::Error)]
pub enum ChannelError {
    /// The table is not fit.
    #[error(transparent)]
    Prepare(#[from] PrepareError),
    /// A column is missing.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// Too few rows.
    #[error(
        "{rows} rows in {pieces} pieces are not enough to tell an effect from chance: measure at least {FEWEST_PIECES} pieces that are not held out"
    )]
    TooFew {
        /// Rows that a fit may see.
        rows: usize,
        /// Pieces that they make.
        pieces: usize,
    },
    /// A law that is not among those of this kind.
    #[error("no law {law} here; there are {known}")]
    NoLaw {
        /// The law.
        law: String,
        /// Those that there are.
        known: String,
    },
    /// An effect of the model that these rows have no place for.
    #[error("the model has {law} at {place}, and this measurement has no such place: is this the right model?")]
    NotHere {
        /// The law.
        law: String,
        /// The place.
        place: String,
    },
    /// A number came out that is none.
    #[error("the model predicts no number in line {line}: is this the right model, are these its units?")]
    NoNumber {
        /// Line of the file.
        line: usize,
    },
}

/// Reads a table and tells what `model` lacks.
pub fn diagnose(model: &Model, data: &Path, names: &Names, options: &Options) -> Result<Diagnosis, ChannelError> {
    let (table, findings) = Table::read(data, names)?;
    let mut diagnosis = diagnose_table(model, &table, options)?;
    diagnosis.findings.splice(0..0, findings.iter().map(Finding::to_string));
    Ok(diagnosis)
}

/// What a table tells about what `model` lacks.
pub fn diagnose_table(model: &Model, table: &Table, options: &Options) -> Result<Diagnosis, ChannelError> {
    let HoldOut::Each(column) = &options.preparation.hold_out else {
        let found = found(model, table, options, None)?;
        return Ok(summary::diagnosis(found, None, &model.effects, options));
    };
    let mut kept = table.clone();
    if let Some(keep) = &options.preparation.keep {
        kept.retain(&keep.rows(table).map_err(PrepareError::from)?);
    }
    let mut pooled = summary::HeldOut::default();
    for value in kept.values_of(column).map_err(PrepareError::from)? {
        pooled.add(&found(model, table, options, Some(&value))?);
    }
    Ok(summary::diagnosis(found(model, table, options, None)?, Some(pooled), &model.effects, options))
}

/// A search that has ended.
pub(crate) struct Ended {
    pub(crate) search: Search<Channels>,
    pub(crate) best: Trial<Channels>,
    pub(crate) n_known: usize,
    pub(crate) held_out: String,
    pub(crate) findings: Vec<Finding>,
}

fn found(model: &Model, table: &Table, options: &Options, each: Option<&str>) -> Result<Ended, ChannelError> {
    let mut data = Prepared::new(table.clone(), &options.preparation, each)?;
    let mut experiment = experiment(model, &mut data)?;
    check(&experiment)?;
    // A column that overflows tells nothing.
    let values = experiment.candidates.iter_mut().flat_map(|candidate| &mut candidate.values);
    for value in values.filter(|value| !value.column.iter().all(|slope| slope.abs() < LARGEST)) {
        value.column.fill(0.0);
    }
    let groups = Groups::new(&experiment.rows);
    if groups.n_blocks < FEWEST_PIECES {
        return Err(ChannelError::TooFew { rows: groups.training.len(), pieces: groups.n_blocks });
    }
    let always = always(&experiment, &options.always)?;
    let n_known = always.len();
    let mut search = Search::new(Channels::new(experiment, groups));
    let start = search.kind.start(always);
    let best = if search.kind.experiment.is_held_by_priors() {
        few_or_whole(&mut search, &start)
    } else {
        chosen(&mut search, &start)
    };
    let Ok(best) = search.kind.settled(best);
    let Ok(settled) = search.kind.settled(simplified::simplified(&search.kind, best, n_known));
    let best = physical::physical(&search.kind, settled);
    Ok(Ended { search, best, n_known, held_out: data.held_out, findings: data.findings })
}

/// Where all values have priors: every law at every place, unless a few effects predict unseen rows as well.
fn few_or_whole(search: &mut Search<Channels>, start: &Trial<Channels>) -> Trial<Channels> {
    let Ok((few, _)) = search.run(start.clone());
    let (whole, ladder) = thinned::whole(&mut search.kind, start);
    // In the same units of noise.
    let few = search.kind.judged(few.fit.active, None);
    if search.kind.fall(&few, &whole).p > RIVAL_LEVEL {
        return few;
    }
    search.ladder = ladder;
    whole
}

/// The better one of two models: that to which effects were added, and that from which they were taken away.
fn chosen(search: &mut Search<Channels>, start: &Trial<Channels>) -> Trial<Channels> {
    let Ok((grown, _)) = search.run(start.clone());
    let (left, ladder) = thinned::thinned(&mut search.kind, start);
    let grown = search.kind.judged(grown.fit.active, None);
    if simplified::better(&search.kind, grown.clone(), left.clone()).fit.active != left.fit.active {
        return grown;
    }
    search.ladder = ladder;
    let Ok((grown, _)) = search.run(left);
    grown
}

fn experiment(model: &Model, data: &mut Prepared) -> Result<Experiment, ChannelError> {
    let known = &model.effects;
    let mut experiment = match &model.what {
        What::Cylinder { bore_m } => force::experiment(data, *bore_m, known)?,
        What::Servo => position::experiment(data, known)?,
        What::Torque(robot, transmission) => torque::experiment(data, robot, transmission.as_ref(), known)?,
        What::Wrench(robot) => wrench::experiment(data, robot)?,
        What::Closure(robot, points) => closure::experiment(data, robot, points)?,
        What::Any(robot) if data.raw("fz").is_some() => wrench::experiment(data, robot)?,
        What::Any(robot) => torque::experiment(data, robot, None, known)?,
    };
    known::apply(&mut experiment, known)?;
    Ok(experiment)
}

/// The candidates of the laws that are always in the model.
fn always(experiment: &Experiment, laws: &[String]) -> Result<Vec<usize>, ChannelError> {
    let mut active = Vec::new();
    for law in laws {
        let of_law = |k: &usize| experiment.candidates[*k].law == law;
        let all: Vec<usize> = (0..experiment.candidates.len()).filter(of_law).collect();
        if all.is_empty() {
            let mut known: Vec<&str> = experiment.candidates.iter().map(|candidate| candidate.law).collect();
            known.sort_unstable();
            known.dedup();
            return Err(ChannelError::NoLaw { law: law.clone(), known: known.join(", ") });
        }
        // Of a law with several shapes the first is taken.
        let other_shape = |k: &usize, of: &[usize]| {
            let place = |k: usize| &experiment.candidates[k].place;
            of.iter().any(|other| experiment.candidates[*other].law == law && place(*other) == place(*k))
        };
        for k in all {
            if !other_shape(&k, &active) {
                active.push(k);
            }
        }
    }
    Ok(active)
}

fn check(experiment: &Experiment) -> Result<(), ChannelError> {
    let n_axes = experiment.axes.len();
    match experiment.residuals.iter().position(|residual| residual.is_nan() || residual.abs() >= LARGEST) {
        Some(at) => Err(ChannelError::NoNumber { line: experiment.rows[at / n_axes].line }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod cases;
#[cfg(test)]
mod tests;
