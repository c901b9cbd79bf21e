//! `cargo xtask`: the set-up, the demo, the tests and the measurements of this workspace.

mod bench;
mod blind;
mod demo;
mod faults;
mod figures;
mod image;
mod papers;
mod progress;
mod setup;
mod simulate;
mod step;
mod test;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Set-up, demo, tests and measurements. Each command does the set-up that it needs and says what it does.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    Demo(demo::Demo),
    Bench(bench::Bench),
    Papers(papers::Papers),
    Blind(blind::Blind),
    Faults(faults::Faults),
    Simulate(simulate::Simulate),
    /// All tests: format, lints, documentation, unit and system tests, the image in the emulator
    Test,
    Image(image::Command),
}

fn main() -> ExitCode {
    let result = match Arguments::parse().task {
        Task::Demo(demo) => demo.run(),
        Task::Bench(bench) => bench.run(),
        Task::Papers(papers) => papers.run(),
        Task::Blind(blind) => blind.run(),
        Task::Faults(faults) => faults.run(),
        Task::Simulate(simulate) => simulate.run(),
        Task::Test => test::run(),
        Task::Image(image) => image.run(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}
