//! What is done with the files of measurements: results joined, figures compared, the page of measured figures written.

use std::path::PathBuf;

use anyhow::{Context as _, Result, bail};
use darm_figures::compare::{Comparison, folders};
use darm_figures::figure::goals;
use darm_figures::items::{self, Job};
use darm_figures::measured;
use darm_figures::merge::Merged as Results;
use darm_figures::root;

use crate::{bench, blind, calibrate, faults, papers};

/// Joins the result files of a run that was spread over processes, and prints its table
///
/// The order of files and of lines does not matter. Items that are missing, or that have two different outcomes, are
/// named, and nothing is written.
#[derive(clap::Args)]
pub(crate) struct Merge {
    /// Count the outcomes of several runs of a command together, such as those of other seeds
    #[arg(long)]
    together: bool,
    /// Files that the processes wrote with --results
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Write the figures as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

impl Merge {
    pub(crate) fn run(self) -> Result<()> {
        let runs = if self.together { Results::read_runs(&self.files)? } else { vec![Results::read(&self.files)?] };
        let command = runs.first().context("no files to merge")?.run.command.clone();
        match command.as_str() {
            blind::Job::COMMAND => self.report::<blind::Job>(runs),
            blind::Damages::COMMAND => self.report::<blind::Damages>(runs),
            blind::Layouts::COMMAND => self.report::<blind::Layouts>(runs),
            blind::Mechanisms::COMMAND => self.report::<blind::Mechanisms>(runs),
            blind::Outside::COMMAND => self.report::<blind::Outside>(runs),
            calibrate::Clean::COMMAND => self.report::<calibrate::Clean>(runs),
            calibrate::Effects::COMMAND => self.report::<calibrate::Effects>(runs),
            darm_demo::Sweep::COMMAND => self.report::<darm_demo::Sweep>(runs),
            bench::SynthesisSweep::COMMAND => self.report::<bench::SynthesisSweep>(runs),
            bench::FarFrames::COMMAND => self.report::<bench::FarFrames>(runs),
            bench::Reach::COMMAND => self.report::<bench::Reach>(runs),
            faults::Job::COMMAND => self.report::<faults::Job>(runs),
            papers::Darm::COMMAND => self.report::<papers::Darm>(runs),
            papers::Grasp::COMMAND => self.report::<papers::Grasp>(runs),
            papers::Memr::COMMAND => self.report::<papers::Memr>(runs),
            darm_simulate::seeds::Seeds::COMMAND => self.report::<darm_simulate::seeds::Seeds>(runs),
            darm_simulate::mutants::Mutants::COMMAND => self.report::<darm_simulate::mutants::Mutants>(runs),
            other => bail!("no command {other:?} writes result files"),
        }
    }

    fn report<J: Job>(&self, runs: Vec<Results>) -> Result<()> {
        let (jobs, outcomes): (Vec<J>, Vec<Vec<J::Outcome>>) =
            runs.into_iter().map(Results::outcomes).collect::<Result<Vec<_>>>()?.into_iter().unzip();
        let job = jobs.first().context("no files to merge")?;
        items::report(job, &outcomes.into_iter().flatten().collect::<Vec<_>>(), self.json.as_deref())
    }
}

/// Compares two folders of figure files; exit code 1 if they differ
///
/// Names, units, verdicts and integers are to be identical, instruction counts within 1 %, other numbers within 1e-6
/// relative; times are left out. A missing row is a difference, a new one is not.
#[derive(clap::Args)]
pub(crate) struct Compare {
    /// Folder with the files of --json before a change
    before: PathBuf,
    /// Folder with files of the same names after it
    after: PathBuf,
}

impl Compare {
    pub(crate) fn run(&self) -> Result<()> {
        let comparison = folders(&self.before, &self.after)?;
        comparison.differences.iter().for_each(|difference| println!("{difference}"));
        let Comparison { equal, left_out, new, .. } = &comparison;
        println!("{equal} rows agree, {left_out} are times and left out, {new} are new");
        match comparison.differences.len() {
            0 => Ok(()),
            n => bail!("{n} differences"),
        }
    }
}

/// Writes docs/measured.md from docs/figures and tests/goals.toml
#[derive(clap::Args)]
pub(crate) struct Measured {
    /// Folder with the figures and index.toml, which has the title and the command of each file
    #[arg(value_name = "FOLDER", default_value_os_t = root().join("docs/figures"))]
    folder: PathBuf,
}

impl Measured {
    pub(crate) fn run(&self) -> Result<()> {
        let path = root().join("docs/measured.md");
        std::fs::write(&path, measured::page(&self.folder, goals()?)?)
            .with_context(|| format!("{} cannot be written", path.display()))?;
        println!("{}", path.display());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use serde_json::{Value, json};

    use super::*;

    /// The names of the items of a job with these options, which are to be read back as they are.
    fn items<J: Job>(options: Value) -> Vec<String> {
        let job: J = serde_json::from_value(options.clone()).unwrap();
        assert_eq!(serde_json::to_value(&job).unwrap(), options, "{}", J::COMMAND);
        let items = job.items().unwrap();
        let unique: BTreeSet<&String> = items.iter().collect();
        assert_eq!(unique.len(), items.len(), "{}", J::COMMAND);
        items
    }

    #[test]
    fn every_job_has_its_options_and_items_with_names_of_their_own() {
        let blind = items::<blind::Job>(json!({ "seeds": 3, "first_seed": 5, "arm": "hybrid" }));
        assert_eq!(blind, ["seed 5", "seed 6", "seed 7"]);
        assert_eq!(items::<blind::Mechanisms>(json!({ "first_seed": 1 })).len(), 23);
        assert_eq!(items::<blind::Damages>(json!({ "logs": 2, "first_seed": 1 })).len(), 2 * 81);
        assert_eq!(
            items::<darm_demo::Sweep>(json!({ "seeds": 2, "arm": "planar", "effect": "play" })),
            ["seed 1", "seed 2"]
        );
        assert_eq!(items::<darm_demo::Sweep>(json!({ "seeds": 1, "arm": "hybrid", "effect": null })).len(), 1);
        assert_eq!(items::<calibrate::Effects>(json!({ "seeds": 2, "first_seed": 1 })).len(), 2 * 6);
        assert_eq!(items::<calibrate::Clean>(json!({ "arms": 3, "first_seed": 1 })).len(), 3);
        assert_eq!(items::<bench::SynthesisSweep>(json!({})).len(), 17 * 200 + 100);
        assert_eq!(items::<bench::FarFrames>(json!({})).len(), 1000);
        assert_eq!(items::<bench::Reach>(json!({ "seed": 1 })).len(), 1 + 1000);
        assert_eq!(
            items::<faults::Job>(
                json!({ "kills": 51, "page": null, "attack": null, "frames": null, "stops": 20, "stop_times": null, "pico": null, "serve": null, "store": null })
            )
            .len(),
            3
        );
        let grasp = items::<papers::Grasp>(json!({ "n": 10, "held_out": 250, "lambdas": 2 }));
        let held_out = |hand: &str| [0, 100, 200].map(|first| format!("{hand}, constraints from {first}"));
        let each = ["training with the printed range", "training"].map(|what| format!("{what}, constraints from 0"));
        let each = each.into_iter();
        assert_eq!(grasp, each.chain(held_out("Allegro hand")).chain(held_out("LEAP hand")).collect::<Vec<_>>());
        assert_eq!(items::<papers::Memr>(json!({ "seed": 1 })).len(), 15 + 21 + 3);
    }
}
