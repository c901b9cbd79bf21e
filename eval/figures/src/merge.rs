//! The outcomes of several result files as those of one run, whatever the order of files and lines.

use std::path::PathBuf;

use anyhow::{Context as _, Result, bail, ensure};

use crate::items::{Job, decode};
use crate::results::{Contents, Outcomes, Run, join};

/// Items that are named in an error at most.
const NAMED: usize = 20;

/// What several files have together.
#[derive(Debug)]
pub struct Merged {
    /// The run that all files belong to.
    pub run: Run,
    outcomes: Outcomes,
}

impl Merged {
    /// Reads the files of one run.
    ///
    /// # Errors
    ///
    /// A file cannot be read or is damaged, files belong to different runs, or an item has two outcomes.
    pub fn read(files: &[PathBuf]) -> Result<Self> {
        let (mut first, mut items): (Option<(String, Run)>, Vec<_>) = (None, Vec::new());
        for file in files {
            let name = file.display().to_string();
            let bytes = std::fs::read(file).with_context(|| format!("{name} cannot be read"))?;
            let contents = Contents::parse(&bytes, &name)?;
            ensure!(!contents.runs.is_empty(), "{name} does not say which run it belongs to");
            for run in contents.runs {
                let (first_name, known) = first.get_or_insert_with(|| (name.clone(), run.clone()));
                let differences = known.differences(&run);
                if !differences.is_empty() {
                    bail!("{first_name} and {name} belong to different runs: {}", differences.join(", "));
                }
            }
            items.extend(contents.items);
        }
        let (_, run) = first.context("no files to merge")?;
        Ok(Self { run, outcomes: join(items)? })
    }

    /// Reads the files of several runs, each run with all of its files.
    ///
    /// # Errors
    ///
    /// As [`Self::read`] of the files of one run.
    pub fn read_runs(files: &[PathBuf]) -> Result<Vec<Self>> {
        let mut runs: Vec<(Run, Vec<PathBuf>)> = Vec::new();
        for file in files {
            let run = Self::read(std::slice::from_ref(file))?.run;
            match runs.iter_mut().find(|(known, _)| known.differences(&run).is_empty()) {
                Some((_, files)) => files.push(file.clone()),
                None => runs.push((run, vec![file.clone()])),
            }
        }
        runs.iter().map(|(_, files)| Self::read(files)).collect()
    }

    /// The job and all its outcomes.
    ///
    /// # Errors
    ///
    /// The run is of another command; items are missing, or do not belong to the job.
    pub fn outcomes<J: Job>(self) -> Result<(J, Vec<J::Outcome>)> {
        ensure!(self.run.command == J::COMMAND, "{} and {} are two commands", J::COMMAND, self.run.command);
        let job: J = serde_json::from_value(self.run.options)
            .with_context(|| format!("the options are not those of {}", J::COMMAND))?;
        let items = job.items()?;
        let missing: Vec<&str> =
            items.iter().filter(|item| !self.outcomes.contains_key(*item)).map(String::as_str).collect();
        ensure!(missing.is_empty(), "{} items are missing: {}", missing.len(), named(&missing));
        let unknown: Vec<&str> =
            self.outcomes.keys().filter(|item| !items.contains(item)).map(String::as_str).collect();
        ensure!(unknown.is_empty(), "items that the run does not have: {}", named(&unknown));
        let outcomes = decode(&items, self.outcomes)?;
        Ok((job, outcomes))
    }
}

fn named(items: &[&str]) -> String {
    let more = if items.len() > NAMED { ", …" } else { "" };
    items[..items.len().min(NAMED)].join(", ") + more
}
