//! Two processes with the ranks of a launcher, one of them killed and started again, give the bytes of one process.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use darm_figures::items;
use darm_figures::merge::Merged;
use darm_simulate::seeds::Seeds;

/// None of these breaks a rule, which would be another exit code; seed 1 does.
const SEEDS: &str = "2..18";
/// Longest wait for the first item: a loaded machine is slow.
const LIMIT: Duration = Duration::from_secs(120);

fn simulate(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_simulate"));
    command.current_dir(folder).args(["--seeds", SEEDS]).args(arguments);
    command.stdout(Stdio::null()).stderr(Stdio::null());
    command
}

/// One of two processes that mpirun would start.
fn rank(folder: &Path, rank: &str) -> Command {
    let mut command = simulate(folder, &["--results", "part.{shard}.results"]);
    command.env("OMPI_COMM_WORLD_RANK", rank).env("OMPI_COMM_WORLD_SIZE", "2");
    command
}

fn lines(file: &Path) -> usize {
    std::fs::read_to_string(file).unwrap_or_default().lines().count()
}

#[test]
fn two_ranks_one_killed_and_resumed_give_the_figures_of_one_process() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = [1, 2].map(|shard| folder.path().join(format!("part.{shard}.results")));
    let mut killed = rank(folder.path(), "0").spawn().unwrap();
    let start = Instant::now();
    // The line of the run and one item.
    while lines(&first) < 2 {
        assert!(start.elapsed() < LIMIT, "no item is finished");
        std::thread::sleep(Duration::from_millis(2));
    }
    killed.kill().unwrap();
    killed.wait().unwrap();
    assert!(lines(&first) < 1 + 8, "it was killed too late");
    for number in ["0", "1"] {
        assert!(rank(folder.path(), number).status().unwrap().success());
    }
    assert_eq!([lines(&first), lines(&second)], [1 + 8; 2]);
    let merged = merged(&[second, first], &folder.path().join("merged.json"));
    assert!(simulate(folder.path(), &["--shard", "1/1", "--json", "one.json"]).status().unwrap().success());
    assert_eq!(merged, std::fs::read(folder.path().join("one.json")).unwrap());
}

/// The file of figures of all outcomes.
fn merged(files: &[PathBuf], json: &Path) -> Vec<u8> {
    let (job, outcomes) = Merged::read(files).unwrap().outcomes::<Seeds>().unwrap();
    items::report(&job, &outcomes, Some(json)).unwrap();
    std::fs::read(json).unwrap()
}
