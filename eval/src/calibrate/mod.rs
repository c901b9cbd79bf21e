//! The closed loop of `darm calibrate` on simulated arms: how often it is wrong, and how many visits it needs.

mod clean;
mod demo;

use anyhow::Result;
use darm_arm::arm::Arm;
use darm_diagnose::calibrate::{Look, Next, State, Station, Task, look};
use darm_diagnose::measurement_plan::PlanStep;
use darm_diagnose::progress::Progress;
use darm_diagnose::truth::Blind;
use darm_figures::items::{self, Spread};
use darm_measure::Sample;

pub(crate) use clean::Clean;
pub(crate) use demo::Effects;

/// Calibrates simulated arms look by look; prints false alarms, or visits beside one measurement plan
#[derive(clap::Args)]
pub(crate) struct Calibrate {
    /// Calibrate this many arms without an effect: false alarms of the complete loop
    #[arg(long, value_name = "ARMS", conflicts_with = "seeds")]
    clean: Option<u64>,
    /// Calibrate the arm of the demo with this many seeds of each of its effects: visits to the verdict
    #[arg(long, value_name = "SEEDS", default_value_t = 20)]
    seeds: u64,
    /// The first seed
    #[arg(long, default_value_t = 1)]
    first_seed: u64,
    #[command(flatten)]
    spread: Spread,
}

impl Calibrate {
    pub(crate) fn run(&self) -> Result<()> {
        let Self { seeds, first_seed, .. } = *self;
        match self.clean {
            Some(arms) => items::run(&Clean { arms, first_seed }, &self.spread),
            None => items::run(&Effects { seeds, first_seed }, &self.spread),
        }
    }
}

/// A simulated arm that visits words, one look after the other.
pub(crate) struct Simulated<'a> {
    arm: &'a Arm,
    truth: &'a Blind,
    seed: u64,
    visited: Vec<PlanStep>,
}

impl<'a> Simulated<'a> {
    pub(crate) fn new(arm: &'a Arm, truth: &'a Blind, seed: u64) -> Self {
        Self { arm, truth, seed, visited: Vec::new() }
    }
}

impl Station for Simulated<'_> {
    type Error = anyhow::Error;

    fn measure(&mut self, visits: &[PlanStep]) -> Result<Vec<Sample>> {
        let from = self.visited.len();
        self.visited.extend_from_slice(visits);
        Ok(self.truth.measure(self.arm, &self.visited, from, self.seed)?.samples)
    }
}

/// Calibrates to the end; `each` sees every look with the number of visits so far, and says whether to continue.
pub(crate) fn calibrate(
    task: &Task,
    station: &mut impl Station<Error = anyhow::Error>,
    mut each: impl FnMut(&Look, usize) -> bool,
) -> Result<()> {
    let (mut state, mut visits) = (State::default(), task.first()?);
    loop {
        state = state.with(station.measure(&visits)?);
        let look = look(task, &state, &Progress::default())?;
        let goes_on = each(&look, state.run.samples.len());
        match look.next {
            Next::Measure(next) if goes_on => visits = next,
            Next::Measure(_) | Next::Stop(_) => return Ok(()),
        }
    }
}
