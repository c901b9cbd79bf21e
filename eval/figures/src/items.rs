//! A command as a list of independent seeded items: run in one process or in several, kept, resumed, reported.

use std::path::{Path, PathBuf};
use std::sync::Mutex;

use anyhow::{Context as _, Result, bail, ensure};
use rayon::prelude::{IntoParallelRefIterator as _, ParallelIterator as _};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::figure::{Figure, Figures};
use crate::progress::Meter;
use crate::results::{Outcomes, ResultFile, Run};
use crate::shard::Shard;

/// Failed items that an error names at most.
const SHOWN: usize = 20;

/// A command whose items need nothing of each other. Its serialised fields are the options on which outcomes depend.
pub trait Job: Serialize + DeserializeOwned + Sync {
    /// Name of the command.
    const COMMAND: &'static str;
    /// What all items share, such as arms that are read once.
    type Bench: Sync;
    /// What an item gives.
    type Outcome: Serialize + DeserializeOwned + Send;

    /// Names of all items, in the order of the report. Each name occurs once.
    ///
    /// # Errors
    ///
    /// A file that the list is made from cannot be read.
    fn items(&self) -> Result<Vec<String>>;

    /// Prepares what all items share; `shard` keeps processes on one machine apart.
    ///
    /// # Errors
    ///
    /// A file cannot be read, or a program is missing.
    fn bench(&self, shard: Shard) -> Result<Self::Bench>;

    /// Runs one item. Its outcome depends on the options and on the item alone.
    ///
    /// # Errors
    ///
    /// The item could not be run: the run fails at its end, and what other items gave is kept.
    fn run(&self, bench: &Self::Bench, item: usize) -> Result<Self::Outcome>;

    /// Whether the item needs the machine for itself, because it measures times or has all cores.
    fn runs_alone(&self, _item: usize) -> bool {
        false
    }

    /// Items after which it is looked whether an outcome was enough.
    fn batch(&self) -> usize {
        usize::MAX
    }

    /// Whether no further items are needed after this outcome.
    fn is_enough(&self, _outcome: &Self::Outcome) -> bool {
        false
    }

    /// The figures of all outcomes, in the order of the items; tables that are no figures are printed.
    ///
    /// # Errors
    ///
    /// The goals cannot be read.
    fn figures(&self, outcomes: &[Self::Outcome]) -> Result<Vec<Figure>>;

    /// The seed that the file of figures names.
    fn seed(&self) -> u64;
}

/// Options of every command that is a list of items.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct Spread {
    /// Run part I of N of the items; without it, the part of the process that mpirun or a Slurm array has started
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// Append each outcome to FILE, and skip those that FILE has; {shard} in the name becomes I
    #[arg(long, value_name = "FILE")]
    results: Option<PathBuf>,
    /// Write the figures as JSON
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

impl Spread {
    /// All items in this process, their outcomes kept in a file.
    pub fn kept_in(results: &Path) -> Self {
        Self { shard: Some(Shard::ALL), results: Some(results.to_owned()), json: None }
    }

    /// Whether the options are those of a list of items; other measurements refuse them.
    pub fn is_used(&self) -> bool {
        self.shard.is_some() || self.results.is_some()
    }

    fn shard(&self) -> Result<Shard> {
        let shard = match self.shard {
            Some(shard) => shard,
            None => Shard::from_launcher(|name| std::env::var(name).ok())?,
        };
        if shard.is_part() {
            ensure!(self.results.is_some(), "part {shard} of the items needs --results FILE, for `merge`");
            ensure!(self.json.is_none(), "part {shard} of the items has no figures; give --json to `merge`");
        }
        Ok(shard)
    }
}

/// Runs the items of this process and reports the figures; a part of the items is only kept, for `merge`.
///
/// # Errors
///
/// An item fails, or a file cannot be written.
pub fn run<J: Job>(job: &J, spread: &Spread) -> Result<()> {
    match outcomes(job, spread)? {
        Some(outcomes) => report(job, &outcomes, spread.json.as_deref()),
        None => Ok(()),
    }
}

/// Prints the figures of all outcomes, and writes them where a file is named.
///
/// # Errors
///
/// The goals cannot be read, or the file cannot be written.
pub fn report<J: Job>(job: &J, outcomes: &[J::Outcome], json: Option<&Path>) -> Result<()> {
    Figures::new(job.figures(outcomes)?, job.seed()).report(json)
}

/// Runs the items of this process: all outcomes in order, or `None` for a part of the items.
///
/// # Errors
///
/// An item fails, or the result file cannot be used.
pub fn outcomes<J: Job>(job: &J, spread: &Spread) -> Result<Option<Vec<J::Outcome>>> {
    let shard = spread.shard()?;
    let items = job.items()?;
    let (file, known) = match &spread.results {
        None => (None, Outcomes::new()),
        Some(path) => {
            let path = path.to_string_lossy().replace("{shard}", &shard.number().to_string());
            let run = Run::new(J::COMMAND, serde_json::to_value(job)?)?;
            let (file, known) = ResultFile::open(Path::new(&path), &run)?;
            (Some(file), known)
        }
    };
    if !known.is_empty() {
        eprintln!("{}: {} items are in the result file", J::COMMAND, known.len());
    }
    let outcomes = Runner { job, shard, items: &items, file, outcomes: Mutex::new(known) }.run()?;
    if shard.is_part() {
        eprintln!("{}: part {shard} is complete; join the files with `cargo xtask merge FILES`", J::COMMAND);
        return Ok(None);
    }
    decode(&items, outcomes).map(Some)
}

/// The outcomes in the order of the items.
///
/// # Errors
///
/// An outcome has another shape.
pub fn decode<T: DeserializeOwned>(items: &[String], mut outcomes: Outcomes) -> Result<Vec<T>> {
    let known = items.iter().filter_map(|item| Some((item, outcomes.remove(item)?)));
    known.map(|(item, outcome)| serde_json::from_value(outcome).with_context(|| item.clone())).collect()
}

struct Runner<'a, J> {
    job: &'a J,
    shard: Shard,
    items: &'a [String],
    file: Option<ResultFile>,
    outcomes: Mutex<Outcomes>,
}

impl<J: Job> Runner<'_, J> {
    fn run(self) -> Result<Outcomes> {
        let missing = |item: &usize| self.shard.has(*item) && !self.lock().contains_key(&self.items[*item]);
        let pending: Vec<usize> = (0..self.items.len()).filter(missing).collect();
        if !pending.is_empty() && !self.has_enough()? {
            let bench = self.job.bench(self.shard)?;
            let meter = Meter::new(J::COMMAND, pending.len());
            for batch in pending.chunks(self.job.batch()) {
                self.run_batch(&bench, batch, &meter)?;
                if self.has_enough()? {
                    break;
                }
            }
            meter.finish();
        }
        Ok(self.outcomes.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner))
    }

    /// Runs all items of a batch, also after one has failed: what the others give is kept.
    fn run_batch(&self, bench: &J::Bench, batch: &[usize], meter: &Meter) -> Result<()> {
        let (alone, others): (Vec<usize>, Vec<usize>) = batch.iter().partition(|item| self.job.runs_alone(**item));
        let run = |item: &usize| self.run_item(bench, *item, meter).err();
        let mut failed: Vec<anyhow::Error> = alone.iter().filter_map(run).collect();
        failed.extend(others.par_iter().filter_map(run).collect::<Vec<_>>());
        let texts: Vec<String> = failed.iter().take(SHOWN).map(|error| format!("{error:#}")).collect();
        ensure!(failed.is_empty(), "{} items failed:\n{}", failed.len(), texts.join("\n"));
        Ok(())
    }

    fn run_item(&self, bench: &J::Bench, item: usize, meter: &Meter) -> Result<()> {
        let name = &self.items[item];
        let outcome = self.job.run(bench, item).with_context(|| name.clone())?;
        let outcome: Value = serde_json::to_value(outcome).with_context(|| name.clone())?;
        if let Some(file) = &self.file {
            file.append(name, &outcome)?;
        }
        if self.lock().insert(name.clone(), outcome).is_some() {
            bail!("{}: two items have the name {name:?}", J::COMMAND);
        }
        meter.step();
        Ok(())
    }

    fn has_enough(&self) -> Result<bool> {
        if self.job.batch() == usize::MAX {
            return Ok(false);
        }
        let outcomes: Vec<J::Outcome> = decode(self.items, self.lock().clone())?;
        Ok(outcomes.iter().any(|outcome| self.job.is_enough(outcome)))
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Outcomes> {
        self.outcomes.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}
