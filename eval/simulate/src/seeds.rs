//! The seeds of a simulation as independent items.

use std::ops::Range;

use anyhow::Result;
use darm_figures::figure::Figure;
use darm_figures::items::Job;
use darm_figures::shard::Shard;
use darm_sim::in_process::Chip;
use serde::{Deserialize, Serialize};

use crate::run::run;
use crate::script::Script;
use crate::summary::{self, Record};

/// Seeds that run before it is looked whether a rule is broken.
const BATCH: usize = 20;

/// Seeds from one to another, the second not included.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Seeds {
    from: u64,
    to: u64,
    chip: Chip,
    /// Stop soon after the first seed in which a rule is broken.
    #[serde(skip)]
    until_broken: bool,
}

impl Seeds {
    /// The seeds of a range, on a board with this chip.
    pub fn new(seeds: Range<u64>, chip: Chip, until_broken: bool) -> Self {
        Self { from: seeds.start, to: seeds.end, chip, until_broken }
    }
}

impl Job for Seeds {
    const COMMAND: &'static str = "simulate";
    type Bench = ();
    type Outcome = Record;

    fn items(&self) -> Result<Vec<String>> {
        Ok((self.from..self.to).map(|seed| format!("seed {seed}")).collect())
    }

    fn bench(&self, _: Shard) -> Result<()> {
        Ok(())
    }

    fn run(&self, (): &(), item: usize) -> Result<Record> {
        Ok(Record::from(&run(&Script::on(self.chip, self.from + item as u64), false)))
    }

    fn batch(&self) -> usize {
        if self.until_broken { BATCH } else { usize::MAX }
    }

    fn is_enough(&self, record: &Record) -> bool {
        !record.violations.is_empty()
    }

    fn figures(&self, records: &[Record]) -> Result<Vec<Figure>> {
        for record in records {
            for violation in &record.violations {
                let summary::Violated { rule, at_ms, sentence, count, .. } = violation;
                println!("seed {}, {rule} at {at_ms} ms: {sentence} ({count} times)", record.seed);
            }
        }
        summary::figures(records)
    }

    fn seed(&self) -> u64 {
        self.from
    }
}
