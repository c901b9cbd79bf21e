//! Starts a program that measures. It is built first; its options, its help and its exit code are its own.

use std::process::{Command, ExitCode};

use anyhow::{Context as _, Result};
use xtask::setup;

/// What is handed on.
#[derive(clap::Args)]
#[command(disable_help_flag = true)]
pub(crate) struct Arguments {
    /// Options of the measurement: see its --help
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    all: Vec<String>,
}

/// A measurement of `eval/`.
pub(crate) fn measurement(name: &str, arguments: &Arguments) -> Result<ExitCode> {
    run(&["--package", "darm-eval", "--", name], arguments)
}

/// The simulation of the complete system: a separate package, because the mutants build it again and again.
pub(crate) fn simulation(arguments: &Arguments) -> Result<ExitCode> {
    run(&["--package", "darm-simulate", "--"], arguments)
}

fn run(what: &[&str], arguments: &Arguments) -> Result<ExitCode> {
    let mut command = Command::new("cargo");
    // Not quiet: a first build takes minutes.
    command.args(["run", "--manifest-path"]).arg(setup::root().join("Cargo.toml"));
    let status = command.args(what).args(&arguments.all).status();
    let code = status.context("cargo did not start")?.code().unwrap_or(1);
    Ok(ExitCode::from(u8::try_from(code).unwrap_or(1)))
}
