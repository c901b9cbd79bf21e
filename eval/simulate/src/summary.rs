//! What is kept of each seed, and the figures of many.

use std::collections::BTreeMap;

use anyhow::Result;
use darm_figures::figure::Figure;
use serde::{Deserialize, Serialize};

use crate::run::Outcome;
use crate::script::LOSSES;

/// What is kept of one seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// The seed.
    pub seed: u64,
    /// The first violation of each rule.
    pub violations: Vec<Violated>,
    /// Equal for equal runs.
    pub digest: u64,
    /// Disturbances by kind, pieces that the line struck among them.
    pub injected: BTreeMap<String, u32>,
    /// How long the host needed after each, ms.
    pub recoveries: Vec<(String, u64)>,
    /// Loss of the line, percent.
    pub loss_percent: u32,
    /// How the first upload went.
    pub first_upload: Option<Upload>,
    /// Virtual time, ms.
    pub virtual_ms: u64,
}

/// A broken rule.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Violated {
    /// Which judge: `pins` or `reports`.
    pub judge: String,
    /// Name of the rule.
    pub rule: String,
    /// True time, ms.
    pub at_ms: u64,
    /// What was seen and what is allowed.
    pub sentence: String,
    /// How often.
    pub count: u32,
}

/// How the first upload went.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Upload {
    /// It completed.
    pub completed: bool,
    /// Calls that it took.
    pub calls: u32,
    /// Virtual time, ms.
    pub took_ms: u64,
}

impl From<&Outcome> for Record {
    fn from(outcome: &Outcome) -> Self {
        let violation = |(first, count): &(crate::judge::Violation, u32)| Violated {
            judge: first.judge.to_owned(),
            rule: first.rule.to_owned(),
            at_ms: first.at_ms,
            sentence: first.sentence.clone(),
            count: *count,
        };
        let struck = outcome.struck;
        let line = [
            ("piece lost", struck.dropped),
            ("piece damaged", struck.corrupted),
            ("piece duplicated", struck.duplicated),
            ("piece reordered", struck.reordered),
            ("piece delayed", struck.delayed),
        ];
        let injected = outcome.injected.iter().map(|(kind, count)| (*kind, *count)).chain(line);
        Self {
            seed: outcome.seed,
            violations: outcome.verdict.firsts().iter().map(violation).collect(),
            digest: outcome.digest,
            injected: injected.map(|(kind, count)| (kind.to_owned(), count)).collect(),
            recoveries: outcome.recoveries.iter().map(|(kind, ms)| ((*kind).to_owned(), *ms)).collect(),
            loss_percent: outcome.loss_percent,
            first_upload: outcome.first_upload.map(|first| Upload {
                completed: first.completed,
                calls: first.calls,
                took_ms: first.took_ms,
            }),
            virtual_ms: outcome.virtual_ms,
        }
    }
}

/// The figures of these seeds.
///
/// # Errors
///
/// The goals cannot be read.
pub fn figures(records: &[Record]) -> Result<Vec<Figure>> {
    let virtual_h = records.iter().map(|record| record.virtual_ms as f64).sum::<f64>() / 3.6e6;
    let mut rows = vec![
        Figure::new("simulate: seeds", records.len() as f64, "seeds")?,
        Figure::new("simulate: virtual time", virtual_h, "h")?,
    ];
    rows.extend(violations(records)?);
    rows.extend(disturbances(records)?);
    rows.extend(recoveries(records)?);
    rows.extend(uploads(records)?);
    Ok(rows)
}

/// In how many seeds each rule was broken.
fn violations(records: &[Record]) -> Result<Vec<Figure>> {
    let mut seeds: BTreeMap<(&str, &str), u32> = BTreeMap::new();
    for violation in records.iter().flat_map(|record| &record.violations) {
        *seeds.entry((&violation.judge, &violation.rule)).or_default() += 1;
    }
    let failed = records.iter().filter(|record| !record.violations.is_empty()).count();
    let mut rows = vec![Figure::new("simulate: seeds with a violation", failed as f64, "seeds")?];
    for ((judge, rule), count) in seeds {
        rows.push(Figure::new(&format!("violated, {judge}: {rule}"), count.into(), "seeds")?);
    }
    Ok(rows)
}

fn disturbances(records: &[Record]) -> Result<Vec<Figure>> {
    let mut counts: BTreeMap<&str, u32> = BTreeMap::new();
    for (kind, count) in records.iter().flat_map(|record| &record.injected) {
        *counts.entry(kind).or_default() += count;
    }
    counts.into_iter().map(|(kind, count)| Figure::new(&format!("injected: {kind}"), count.into(), "")).collect()
}

/// Time until the host got through again: count, median, longest.
fn recoveries(records: &[Record]) -> Result<Vec<Figure>> {
    let mut times: BTreeMap<&str, Vec<u64>> = BTreeMap::new();
    for (kind, ms) in records.iter().flat_map(|record| &record.recoveries) {
        times.entry(kind).or_default().push(*ms);
    }
    let mut rows = Vec::new();
    for (kind, mut times) in times {
        times.sort_unstable();
        let median = times[times.len() / 2];
        rows.push(Figure::new(&format!("recovered after {kind}"), times.len() as f64, "")?);
        rows.push(Figure::new(&format!("recovered after {kind}, median"), median as f64, "ms")?);
        rows.push(Figure::new(&format!("recovered after {kind}, longest"), times[times.len() - 1] as f64, "ms")?);
    }
    Ok(rows)
}

/// First uploads that completed, against the loss of the line.
fn uploads(records: &[Record]) -> Result<Vec<Figure>> {
    let mut rows = Vec::new();
    for loss in LOSSES {
        let firsts =
            records.iter().filter(|record| record.loss_percent == loss).filter_map(|record| record.first_upload);
        let count = firsts.clone().count();
        if count == 0 {
            continue;
        }
        let share = |completed: usize| 100.0 * completed as f64 / count as f64;
        let completed = share(firsts.clone().filter(|first| first.completed).count());
        let at_once = share(firsts.clone().filter(|first| first.completed && first.calls == 1).count());
        let mean_s = 1e-3 * firsts.map(|first| first.took_ms as f64).sum::<f64>() / count as f64;
        rows.push(Figure::new(&format!("uploads completed at {loss} % loss"), completed, "%")?);
        rows.push(Figure::new(&format!("uploads completed at {loss} % loss in one call"), at_once, "%")?);
        rows.push(Figure::new(&format!("upload at {loss} % loss, mean"), mean_s, "s")?);
    }
    Ok(rows)
}
