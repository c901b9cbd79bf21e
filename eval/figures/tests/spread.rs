//! A run that is spread over processes, killed and resumed gives the same figures, byte for byte, as one process.

use std::path::{Path, PathBuf};

use anyhow::{Result, ensure};
use clap::Parser as _;
use darm_figures::figure::{Figure, Figures};
use darm_figures::items::{self, Job, Spread};
use darm_figures::merge::Merged;
use darm_figures::shard::Shard;
use serde::{Deserialize, Serialize};

/// Mean and largest of numbers that are drawn.
#[derive(Serialize, Deserialize)]
struct Draws {
    seeds: u64,
    /// The item that fails, as if the process were killed there.
    #[serde(skip)]
    fails_at: Option<usize>,
}

#[derive(Serialize, Deserialize)]
struct Drawn {
    value: f64,
    label: String,
}

impl Job for Draws {
    const COMMAND: &'static str = "draws";
    type Bench = ();
    type Outcome = Drawn;

    fn items(&self) -> Result<Vec<String>> {
        Ok((0..self.seeds).map(|seed| format!("seed {seed}")).collect())
    }

    fn bench(&self, _: Shard) -> Result<()> {
        Ok(())
    }

    fn run(&self, (): &(), item: usize) -> Result<Drawn> {
        ensure!(self.fails_at != Some(item), "killed");
        // Sums of such numbers depend on their order in the last digit.
        let value = (item as f64 * 0.7).sin() / 3.0;
        Ok(Drawn { value, label: "μ \"quoted\"\n".into() })
    }

    fn runs_alone(&self, item: usize) -> bool {
        item == 2
    }

    fn figures(&self, outcomes: &[Drawn]) -> Result<Vec<Figure>> {
        assert!(outcomes.iter().all(|drawn| drawn.label == "μ \"quoted\"\n"));
        let sum: f64 = outcomes.iter().map(|drawn| drawn.value).sum();
        Ok(vec![
            Figure::new("mean", sum / outcomes.len() as f64, "")?,
            Figure::new("items", outcomes.len() as f64, "")?,
        ])
    }

    fn seed(&self) -> u64 {
        0
    }
}

const JOB: Draws = Draws { seeds: 23, fails_at: None };

#[derive(clap::Parser)]
struct Arguments {
    #[command(flatten)]
    spread: Spread,
}

fn spread(arguments: &str, folder: &Path) -> Spread {
    let arguments = arguments.replace("FOLDER", &folder.display().to_string());
    Arguments::parse_from(["draws"].into_iter().chain(arguments.split_whitespace())).spread
}

/// The bytes of the figures of one process.
fn one_process(folder: &Path) -> Vec<u8> {
    items::run(&JOB, &spread("--shard 1/1 --json FOLDER/one.json", folder)).unwrap();
    std::fs::read(folder.join("one.json")).unwrap()
}

fn merged(files: &[PathBuf], folder: &Path) -> Result<Vec<u8>> {
    let (job, outcomes) = Merged::read(files)?.outcomes::<Draws>()?;
    let json = folder.join("merged.json");
    items::report(&job, &outcomes, Some(&json))?;
    Ok(std::fs::read(json)?)
}

/// Two processes, one of which was killed and resumed.
fn two_processes(folder: &Path) -> [PathBuf; 2] {
    let killed = Draws { fails_at: Some(12), ..JOB };
    let error = items::run(&killed, &spread("--shard 1/2 --results FOLDER/{shard}.results", folder)).unwrap_err();
    assert_eq!(format!("{error:#}"), "1 items failed:\nseed 12: killed");
    let files = [folder.join("1.results"), folder.join("2.results")];
    // Killed while it wrote a line.
    let mut bytes = std::fs::read(&files[0]).unwrap();
    bytes.truncate(bytes.len() - 5);
    std::fs::write(&files[0], bytes).unwrap();
    for shard in ["1/2", "2/2"] {
        items::run(&JOB, &spread(&format!("--shard {shard} --results FOLDER/{{shard}}.results"), folder)).unwrap();
    }
    files
}

#[test]
fn two_processes_one_killed_and_resumed_give_the_bytes_of_one() {
    let folder = tempfile::tempdir().unwrap();
    let files = two_processes(folder.path());
    assert_eq!(merged(&files, folder.path()).unwrap(), one_process(folder.path()));
}

#[test]
fn the_order_of_files_and_lines_does_not_matter() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = two_processes(folder.path());
    let expected = merged(&[first.clone(), second.clone()], folder.path()).unwrap();
    assert_eq!(merged(&[second.clone(), first.clone()], folder.path()).unwrap(), expected);
    let text = std::fs::read_to_string(&first).unwrap() + &std::fs::read_to_string(&second).unwrap();
    let mut lines: Vec<&str> = text.lines().rev().collect();
    lines.rotate_left(7);
    let joined = folder.path().join("joined.results");
    std::fs::write(&joined, lines.join("\n") + "\n").unwrap();
    assert_eq!(merged(&[joined], folder.path()).unwrap(), expected);
}

#[test]
fn finished_items_do_not_run_again() {
    let folder = tempfile::tempdir().unwrap();
    items::run(&JOB, &spread("--shard 1/1 --results FOLDER/all.results", folder.path())).unwrap();
    let before = std::fs::read(folder.path().join("all.results")).unwrap();
    // Would fail if the item ran.
    let fails = Draws { fails_at: Some(12), ..JOB };
    items::run(&fails, &spread("--shard 1/1 --results FOLDER/all.results", folder.path())).unwrap();
    assert_eq!(std::fs::read(folder.path().join("all.results")).unwrap(), before);
}

#[test]
fn missing_and_foreign_items_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = two_processes(folder.path());
    let error = format!("{:#}", merged(std::slice::from_ref(&second), folder.path()).unwrap_err());
    assert!(error.starts_with("12 items are missing: seed 0, seed 2,"), "{error}");
    let few = Draws { seeds: 5, ..JOB };
    items::run(&few, &spread("--shard 2/2 --results FOLDER/few.results", folder.path())).unwrap();
    let error = format!("{:#}", merged(&[first, folder.path().join("few.results")], folder.path()).unwrap_err());
    assert!(error.contains("option seeds is 23 here and 5 there"), "{error}");
}

#[test]
fn a_contradicting_item_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = two_processes(folder.path());
    let other = folder.path().join("other.results");
    // The same run, with another outcome: a process whose numbers are not reproducible.
    let run = darm_figures::results::Run::new("draws", serde_json::to_value(JOB).unwrap()).unwrap();
    let (file, _) = darm_figures::results::ResultFile::open(&other, &run).unwrap();
    file.append("seed 3", &serde_json::json!({ "value": 1.0, "label": "" })).unwrap();
    let error = format!("{:#}", merged(&[first, second, other], folder.path()).unwrap_err());
    assert_eq!(error, "two different outcomes of: seed 3");
}

#[test]
fn a_part_needs_a_file_and_has_no_figures() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |arguments: &str| items::run(&JOB, &spread(arguments, folder.path())).unwrap_err().to_string();
    assert!(refused("--shard 1/2").contains("--results"));
    assert!(refused("--shard 1/2 --results FOLDER/a --json FOLDER/b").contains("merge"));
}

#[test]
fn the_figures_have_the_shape_of_all_commands() {
    let folder = tempfile::tempdir().unwrap();
    one_process(folder.path());
    let figures = Figures::read(&folder.path().join("one.json")).unwrap();
    assert_eq!((figures.rows.len(), figures.rows[1].value), (2, 23.0));
}

#[test]
fn runs_of_other_seeds_count_together_on_demand() {
    let folder = tempfile::tempdir().unwrap();
    let files = two_processes(folder.path());
    let other = folder.path().join("other.results");
    let fewer = Draws { seeds: 5, ..JOB };
    items::run(&fewer, &spread("--results FOLDER/other.results", folder.path())).unwrap();
    let all = [files[0].clone(), other, files[1].clone()];
    let error = Merged::read(&all).unwrap_err().to_string();
    assert!(error.contains("belong to different runs"), "{error}");
    let runs = Merged::read_runs(&all).unwrap();
    let counts: Vec<usize> = runs.into_iter().map(|run| run.outcomes::<Draws>().unwrap().1.len()).collect();
    assert_eq!(counts, [23, 5]);
}
