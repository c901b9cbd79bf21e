//! The arms that are measured blind, each with its programmes.

use anyhow::Result;
use darm::arm::Arm;
use darm::programme::{Options, Step, programme};

use crate::setup;

/// Programmes that the seeds of an arm share.
const PROGRAMMES: u64 = 4;
/// Weights of the spatial arm, whose file has none: its plates and what it carries, kg.
const PLATE_KG: f64 = 1.5;
const TOOL_KG: f64 = 0.5;

/// An arm and what it plays.
pub(super) struct Subject {
    pub(super) name: &'static str,
    pub(super) arm: Arm,
    programmes: Vec<Vec<Step>>,
}

impl Subject {
    /// What the arm plays for a seed.
    pub(super) fn steps(&self, seed: u64) -> &[Step] {
        &self.programmes[(seed % PROGRAMMES) as usize]
    }
}

/// All arms.
pub(super) fn subjects() -> Result<Vec<Subject>> {
    ["planar4", "spatial3", "planar4-hybrid"].into_iter().map(subject).collect()
}

fn subject(name: &'static str) -> Result<Subject> {
    let mut arm = Arm::read(&setup::root().join("examples").join(format!("{name}.toml")))?;
    if arm.model.payload.mass_kg == 0.0 {
        let n = arm.model.chain.stages.len();
        arm.model.masses.iter_mut().take(n).for_each(|mass| mass.mass_kg = PLATE_KG);
        arm.model.payload.mass_kg = TOOL_KG;
    }
    let of_seed = |seed| programme(&arm, &Options { seed, ..Options::default() });
    let programmes = (0..PROGRAMMES).map(of_seed).collect();
    Ok(Subject { name, arm, programmes })
}
