//! What measures: the demo, the benchmarks, the blind suite, the papers and the faults; what is done with the figures.
//! `cargo xtask` starts it.

mod bench;
mod blind;
mod demo;
mod faults;
mod join;
mod papers;
mod python;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Measurements of this workspace, each with its goals
///
/// A command with the options --shard and --results is a list of independent seeded items. Several processes share them:
/// each runs its part (--shard I/N, or the rank of mpirun or of a Slurm array) and appends outcomes to a separate file
/// (--results 'NAME.{shard}.results'); a process that was killed is started again with the same command. `merge` joins the
/// files and prints the table of one process. docs/evaluation.md describes the files.
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
    Merge(join::Merge),
    Compare(join::Compare),
    Measured(join::Measured),
}

fn main() -> ExitCode {
    let result = match Arguments::parse().task {
        Task::Demo(demo) => demo.run(),
        Task::Bench(bench) => bench.run(),
        Task::Papers(papers) => papers.run(),
        Task::Blind(blind) => blind.run(),
        Task::Faults(faults) => faults.run(),
        Task::Merge(merge) => merge.run(),
        Task::Compare(compare) => compare.run(),
        Task::Measured(measured) => measured.run(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}
