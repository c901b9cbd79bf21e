//! The results of many runs: a table for people and the same numbers as JSON, beside the goals of `tests/goals.toml`.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context as _, Result};
use serde::{Deserialize, Serialize};

use crate::goals::Goals;
use crate::run::Outcome;
use crate::script::LOSSES;

/// One measured number.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// What it is.
    pub name: String,
    /// The number.
    pub value: f64,
    /// Its unit.
    pub unit: &'static str,
    /// The bound that it is to keep, as in the file of goals.
    pub goal: Option<String>,
    /// Whether it does.
    pub met: Option<bool>,
}

#[derive(Serialize)]
struct Rows<'r> {
    rows: &'r [Row],
    seed: u64,
    versions: BTreeMap<&'static str, &'static str>,
    broken: Vec<Broken>,
}

/// A rule that was broken in a seed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Broken {
    /// The seed.
    pub seed: u64,
    /// The rule.
    pub rule: String,
}

/// What is read back of the figures of another run.
#[derive(Clone, Debug, Deserialize)]
pub struct Figures {
    rows: Vec<Figure>,
    /// Rules that were broken, by seed.
    pub broken: Vec<Broken>,
}

#[derive(Clone, Debug, Deserialize)]
struct Figure {
    name: String,
    value: f64,
}

impl Figures {
    /// Seeds that ran.
    pub fn ran(&self) -> Result<u64> {
        let row = self.rows.iter().find(|row| row.name == SEEDS);
        Ok(row.context("the figures do not say how many seeds ran")?.value as u64)
    }
}

/// Name of the row with the number of seeds.
const SEEDS: &str = "simulate: seeds";

/// The rules that were broken, by seed.
pub fn broken(outcomes: &[Outcome]) -> Vec<Broken> {
    let of = |outcome: &Outcome| {
        let seed = outcome.seed;
        let firsts = outcome.verdict.firsts().iter();
        firsts.map(|(violation, _)| Broken { seed, rule: violation.rule.to_owned() }).collect::<Vec<_>>()
    };
    outcomes.iter().flat_map(of).collect()
}

/// The numbers of these runs.
pub fn rows(outcomes: &[Outcome]) -> Vec<Row> {
    let mut rows = vec![
        row(SEEDS, outcomes.len() as f64, "seeds"),
        row("simulate: virtual time", outcomes.iter().map(|o| o.virtual_ms as f64).sum::<f64>() / 3.6e6, "h"),
    ];
    rows.extend(violations(outcomes));
    rows.extend(disturbances(outcomes));
    rows.extend(recoveries(outcomes));
    rows.extend(uploads(outcomes));
    rows
}

/// In how many seeds each rule was broken.
fn violations(outcomes: &[Outcome]) -> Vec<Row> {
    let mut seeds: BTreeMap<(&str, &str), u32> = BTreeMap::new();
    for (violation, _) in outcomes.iter().flat_map(|outcome| outcome.verdict.firsts()) {
        *seeds.entry((violation.judge, violation.rule)).or_default() += 1;
    }
    let failed = outcomes.iter().filter(|outcome| !outcome.verdict.firsts().is_empty()).count();
    let mut rows = vec![row("simulate: seeds with a violation", failed as f64, "seeds")];
    let named = |((judge, rule), count): (_, u32)| row(&format!("violated, {judge}: {rule}"), count.into(), "seeds");
    rows.extend(seeds.into_iter().map(named));
    rows
}

fn disturbances(outcomes: &[Outcome]) -> Vec<Row> {
    let mut counts: BTreeMap<&str, u32> = BTreeMap::new();
    for outcome in outcomes {
        outcome.injected.iter().for_each(|(kind, count)| *counts.entry(kind).or_default() += count);
        let struck = outcome.struck;
        let line = [
            ("piece lost", struck.dropped),
            ("piece damaged", struck.corrupted),
            ("piece duplicated", struck.duplicated),
            ("piece reordered", struck.reordered),
            ("piece delayed", struck.delayed),
        ];
        line.into_iter().for_each(|(kind, count)| *counts.entry(kind).or_default() += count);
    }
    counts.into_iter().map(|(kind, count)| row(&format!("injected: {kind}"), count.into(), "")).collect()
}

/// Time until the host got through again: count, median, longest.
fn recoveries(outcomes: &[Outcome]) -> Vec<Row> {
    let mut times: BTreeMap<&str, Vec<u64>> = BTreeMap::new();
    for (kind, ms) in outcomes.iter().flat_map(|outcome| &outcome.recoveries) {
        times.entry(kind).or_default().push(*ms);
    }
    let mut rows = Vec::new();
    for (kind, mut times) in times {
        times.sort_unstable();
        let median = times[times.len() / 2];
        rows.push(row(&format!("recovered after {kind}"), times.len() as f64, ""));
        rows.push(row(&format!("recovered after {kind}, median"), median as f64, "ms"));
        rows.push(row(&format!("recovered after {kind}, longest"), times[times.len() - 1] as f64, "ms"));
    }
    rows
}

/// First uploads that completed, against the loss of the line.
fn uploads(outcomes: &[Outcome]) -> Vec<Row> {
    let mut rows = Vec::new();
    for loss in LOSSES {
        let firsts = outcomes.iter().filter(|o| o.loss_percent == loss).filter_map(|o| o.first_upload);
        let count = firsts.clone().count();
        if count == 0 {
            continue;
        }
        let share = |completed: usize| 100.0 * completed as f64 / count as f64;
        let completed = share(firsts.clone().filter(|first| first.completed).count());
        let at_once = share(firsts.clone().filter(|first| first.completed && first.calls == 1).count());
        let mean_s = 1e-3 * firsts.map(|first| first.took_ms as f64).sum::<f64>() / count as f64;
        rows.push(row(&format!("uploads completed at {loss} % loss"), completed, "%"));
        rows.push(row(&format!("uploads completed at {loss} % loss in one call"), at_once, "%"));
        rows.push(row(&format!("upload at {loss} % loss, mean"), mean_s, "s"));
    }
    rows
}

fn row(name: &str, value: f64, unit: &'static str) -> Row {
    Row { name: name.to_owned(), value, unit, goal: None, met: None }
}

/// Puts the goals of a file beside the numbers.
pub fn with_goals(mut rows: Vec<Row>, goals: &Path) -> Result<Vec<Row>> {
    let goals = Goals::read(goals)?;
    for row in &mut rows {
        (row.goal, row.met) = goals.judge(&row.name, row.value)?.unzip();
    }
    Ok(rows)
}

/// The table for people.
pub fn text(rows: &[Row]) -> String {
    let mut text = String::new();
    for Row { name, value, unit, goal, met } in rows {
        let value = if value.fract() == 0.0 { format!("{value}") } else { format!("{value:.2}") };
        let verdict = match met {
            Some(true) => "met",
            Some(false) => "MISSED",
            None => "",
        };
        let goal = goal.as_deref().unwrap_or_default();
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{name:60} {value:>10} {unit:6} {goal:10} {verdict}");
    }
    text
}

/// How many mutants there were, and how many no rule caught.
pub fn mutant_rows(mutants: usize, missed: usize) -> Vec<Row> {
    vec![row("mutants", mutants as f64, ""), row("mutants: not caught", missed as f64, "")]
}

/// The same numbers for programs, with the rules that were broken in each seed.
pub fn write_json(rows: &[Row], broken: Vec<Broken>, first_seed: u64, path: &Path) -> Result<()> {
    let versions = BTreeMap::from([("darm", env!("CARGO_PKG_VERSION"))]);
    let text = serde_json::to_string_pretty(&Rows { rows, seed: first_seed, versions, broken })?;
    std::fs::write(path, text).with_context(|| format!("{} cannot be written", path.display()))
}
