//! Measured figures: one table for people, the same as JSON for programs, beside the goals of `tests/goals.toml`.

use std::path::Path;

use anyhow::{Context, Result};
use darm_simulate::goals::Goals;
use serde::Serialize;

use xtask::setup;

/// One measured number.
#[derive(Debug, Serialize)]
pub(crate) struct Figure {
    pub(crate) name: String,
    pub(crate) value: f64,
    pub(crate) unit: String,
    goal: Option<String>,
    met: Option<bool>,
}

#[derive(Serialize)]
struct Rows<'a> {
    rows: &'a [Figure],
    seed: u64,
    versions: Versions,
}

#[derive(Serialize)]
struct Versions {
    darm: &'static str,
}

impl Figure {
    /// The number beside its goal: a bound such as `<= 8000`.
    pub(crate) fn new(name: &str, value: f64, unit: &str) -> Result<Self> {
        let (goal, met) = Goals::read(&setup::root().join("tests/goals.toml"))?.judge(name, value)?.unzip();
        Ok(Self { name: name.to_owned(), value, unit: unit.to_owned(), goal, met })
    }
}

/// Prints the figures, and writes them as JSON where a file is named.
pub(crate) fn tell(figures: &[Figure], seed: u64, json: Option<&Path>) -> Result<()> {
    for Figure { name, value, unit, goal, met } in figures {
        let verdict = match met {
            Some(true) => "met",
            Some(false) => "MISSED",
            None => "",
        };
        println!("{name:55} {:>12} {unit:13} {:10} {verdict}", short(*value), goal.as_deref().unwrap_or_default());
    }
    if let Some(path) = json {
        let rows = Rows { rows: figures, seed, versions: Versions { darm: env!("CARGO_PKG_VERSION") } };
        let text = serde_json::to_string_pretty(&rows)?;
        std::fs::write(path, text).with_context(|| format!("{} cannot be written", path.display()))?;
    }
    Ok(())
}

/// Counts as they are, small numbers with two digits, others with four.
fn short(value: f64) -> String {
    if value.fract() == 0.0 {
        format!("{value}")
    } else if value.abs() < 1e-2 {
        format!("{value:.1e}")
    } else {
        format!("{value:.3}")
    }
}
