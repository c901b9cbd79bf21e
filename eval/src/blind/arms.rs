//! The arms whose tool poses are measured blind, each with its plans.

use std::sync::OnceLock;

use anyhow::Result;
use darm_arm::arm::Arm;
use darm_arm::arm::frames::{DesiredFrame, Weights};
use darm_diagnose::measurement_plan::{PlanOptions, PlanStep, as_run, candidates, plan};
use darm_measure::Sample;

use xtask::setup;

/// Measurement plans that the seeds of an arm share.
const PLANS: usize = 4;
/// Frames that an arm without a task is to reach.
const FRAMES: usize = 6;
/// Weights of the spatial arm, whose file has none: its plates and what it carries, kg.
const PLATE_KG: f64 = 1.5;
const TOOL_KG: f64 = 0.5;

/// An arm and what it plays.
pub(crate) struct Subject {
    pub(crate) arm: Arm,
    plans: [OnceLock<Vec<PlanStep>>; PLANS],
}

impl Subject {
    /// Some words as frames that the arm is to reach, where its model has them.
    pub(crate) fn frames(&self, seed: u64) -> Vec<DesiredFrame> {
        let steps: Vec<PlanStep> = candidates(&self.arm, seed).into_iter().take(FRAMES).collect();
        let run = as_run(&self.arm, &steps, self.arm.model.nominal_supply, self.arm.model.reference_temperature_k);
        run.samples.into_iter().map(|sample| frame(&self.arm, sample)).collect()
    }

    /// What the arm plays for a seed.
    pub(crate) fn steps(&self, seed: u64) -> &[PlanStep] {
        let seed = seed % PLANS as u64;
        let made = || plan(&self.arm, &PlanOptions { seed, ..PlanOptions::default() });
        self.plans[seed as usize].get_or_init(made)
    }
}

/// The planar, the spatial and the hybrid arm.
pub(crate) fn subjects() -> Result<[Subject; 3]> {
    Ok([subject("planar4")?, subject("spatial3")?, subject("planar4-hybrid")?])
}

fn subject(name: &str) -> Result<Subject> {
    let mut arm = Arm::read(&setup::root().join("examples").join(format!("{name}.toml")))?;
    if arm.model.payload.mass_kg == 0.0 {
        let n = arm.model.chain.stages.len();
        arm.model.masses.iter_mut().take(n).for_each(|mass| mass.mass_kg = PLATE_KG);
        arm.model.payload.mass_kg = TOOL_KG;
    }
    Ok(Subject { arm, plans: Default::default() })
}

/// Where the tool is in a sample, as a frame.
fn frame(arm: &Arm, sample: Sample) -> DesiredFrame {
    DesiredFrame {
        name: sample.word.to_string(),
        word: sample.word,
        previous: sample.previous.unwrap_or(arm.rest()),
        servos_rad: sample.servos_rad,
        pose_base_tool: sample.pose,
        weights: Weights::default(),
    }
}
