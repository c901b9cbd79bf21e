//! The arms whose tool poses are measured blind, each with its plans.

use std::sync::OnceLock;

use anyhow::Result;
use darm_arm::arm::Arm;
use darm_diagnose::measurement_plan::{Options, Step, plan};

use xtask::setup;

/// Measurement plans that the seeds of an arm share.
const PLANS: usize = 4;
/// Weights of the spatial arm, whose file has none: its plates and what it carries, kg.
const PLATE_KG: f64 = 1.5;
const TOOL_KG: f64 = 0.5;

/// An arm and what it plays.
pub(crate) struct Subject {
    pub(super) arm: Arm,
    plans: [OnceLock<Vec<Step>>; PLANS],
}

impl Subject {
    /// What the arm plays for a seed.
    pub(super) fn steps(&self, seed: u64) -> &[Step] {
        let seed = seed % PLANS as u64;
        let made = || plan(&self.arm, &Options { seed, ..Options::default() });
        self.plans[seed as usize].get_or_init(made)
    }
}

/// The planar, the spatial and the hybrid arm.
pub(super) fn subjects() -> Result<[Subject; 3]> {
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
