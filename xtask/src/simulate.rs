//! Starts the simulation of the whole system; its options and its exit code are its own.

use std::process::Command;

use anyhow::{Context as _, Result, bail};

use crate::setup;

/// Runs the whole system in virtual time under two judges: `cargo xtask simulate -- --help`
#[derive(clap::Args)]
pub(crate) struct Simulate {
    /// Options of the simulation, such as --seeds 0..1000, --replay 7, --json FILE, --mutants
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<String>,
}

impl Simulate {
    pub(crate) fn run(&self) -> Result<()> {
        let mut simulate = Command::new("cargo");
        simulate.args(["run", "--quiet", "--package", "darm-eval", "--bin", "simulate", "--"]);
        simulate.current_dir(setup::root()).args(&self.arguments);
        match simulate.status().context("cargo did not start")?.code() {
            Some(0) => Ok(()),
            Some(1) => bail!("the judges found violations, see above"),
            _ => bail!("the simulation did not run"),
        }
    }
}
