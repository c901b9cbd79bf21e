//! `cargo xtask`: the set-up, the image and the tests of this workspace; it starts what measures.

mod start;
mod test;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use start::Arguments;
use xtask::{image, package};

/// Set-up, demo, tests and measurements. Each command does the set-up that it needs and says what it does.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Cli {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// The complete loop: synthesis, table, upload, play, measure, diagnose, close; writes a report
    Demo(Arguments),
    /// Measures, and prints a table beside the goals
    Bench(Arguments),
    /// Reproduces a paper, and prints its tables, ours beside theirs
    Papers(Arguments),
    /// Diagnoses arms with hidden effects, seed by seed; prints rates with their intervals beside baselines
    Blind(Arguments),
    /// Calibrates simulated arms look by look; prints false alarms, or visits beside one measurement plan
    Calibrate(Arguments),
    /// Cuts the power at seeded moments, sends damaged frames, stops through a port that is held, kills the live page; prints the counts
    Faults(Arguments),
    /// Runs the complete system in virtual time under two judges; prints what they find
    Simulate(Arguments),
    /// Joins the result files of a run that was spread over processes, and prints its table
    Merge(Arguments),
    /// Compares two folders of figure files; exit code 1 if they differ
    Compare(Arguments),
    /// Writes docs/measured.md from docs/figures and tests/goals.toml
    Measured(Arguments),
    Test(test::Test),
    /// Builds the firmware image and prints its path, or analyses it
    Image(image::Command),
    /// Builds the Debian package of the tool and prints its path, or checks what is published
    Package(package::Command),
}

fn main() -> ExitCode {
    let result = match Cli::parse().task {
        Task::Demo(arguments) => start::demo(&arguments),
        Task::Bench(arguments) => start::measurement("bench", &arguments),
        Task::Papers(arguments) => start::measurement("papers", &arguments),
        Task::Blind(arguments) => start::measurement("blind", &arguments),
        Task::Calibrate(arguments) => start::measurement("calibrate", &arguments),
        Task::Faults(arguments) => start::measurement("faults", &arguments),
        Task::Simulate(arguments) => start::simulation(&arguments),
        Task::Merge(arguments) => start::measurement("merge", &arguments),
        Task::Compare(arguments) => start::measurement("compare", &arguments),
        Task::Measured(arguments) => start::measurement("measured", &arguments),
        Task::Test(test) => test.run().map(|()| ExitCode::SUCCESS),
        Task::Image(image) => image.run().map(|()| ExitCode::SUCCESS),
        Task::Package(package) => package.run().map(|()| ExitCode::SUCCESS),
    };
    result.unwrap_or_else(|error| {
        eprintln!("error: {error:#}");
        ExitCode::FAILURE
    })
}

#[cfg(test)]
mod tests {
    use clap::Parser as _;

    use super::Cli;

    #[test]
    fn every_command_of_a_measured_figure_exists() {
        let path = xtask::setup::root().join("docs/figures/index.toml");
        let index: toml::Table = std::fs::read_to_string(path).unwrap().parse().unwrap();
        let figures = index["figures"].as_array().unwrap();
        assert!(!figures.is_empty());
        for figure in figures {
            let command = figure["command"].as_str().unwrap();
            let arguments = command.strip_prefix("cargo ").unwrap().split_whitespace();
            assert!(Cli::try_parse_from(arguments).is_ok(), "{command}");
        }
    }
}
