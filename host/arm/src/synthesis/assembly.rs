//! Stops that no frame uses, set so that every module can be assembled in every setting of its actuators.
//!
//! The frames say nothing of these stops. Where the others have moved far they may leave a module without a pose at rest, which is no
//! arm, or in other words, which no table could then use.

use darm_core::actuator::Stage;
use darm_core::chain::Parameter;
use nalgebra::DVector;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::problem::Problem;
use crate::arm::Arm;
use crate::stage_settings::{pose, settings};

/// Sizes of alterations that are tried, from small to large, and draws of each.
const SIZES: u32 = 64;
const DRAWS: u32 = 64;
/// The largest standard deviation, as a share of a stop: the default bounds are a half and twice the length.
const LARGEST: f64 = 0.3;

/// The settings of one module in which it cannot be assembled: a digit for each of its actuators.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WithoutPose {
    /// Number of the stage.
    pub stage: usize,
    /// The settings.
    pub settings: Vec<Vec<u8>>,
}

/// The modules of an arm with settings in which they cannot be assembled: no table can use words that contain them.
pub fn without_pose(arm: &Arm) -> Vec<WithoutPose> {
    let stages = arm.model.chain.stages.iter().enumerate();
    let modules = stages.map(|(stage, module)| WithoutPose { stage, settings: without_pose_of(module) });
    modules.filter(|module| !module.settings.is_empty()).collect()
}

fn without_pose_of(stage: &Stage<f64>) -> Vec<Vec<u8>> {
    match stage {
        Stage::Planar(_) | Stage::Spatial(_) => {
            settings(stage).filter(|digits| pose(stage, digits).is_none()).collect()
        }
        _ => Vec::new(),
    }
}

/// What a module has to do in any case: an arm without a pose at rest or fully extended cannot be read from its file.
fn has_needed_poses(stage: &Stage<f64>) -> bool {
    let extended: Vec<u8> = (0..stage.n_actuators()).map(|leg| stage.n_states(leg) as u8 - 1).collect();
    pose(stage, &vec![0; extended.len()]).is_some() && pose(stage, &extended).is_some()
}

impl Problem<'_> {
    /// The unknowns with stops that no frame uses altered, as little as a few draws find, so that every module is assembled in
    /// every setting; where none of them is, at rest and fully extended. `None` where even that cannot be.
    pub(super) fn assembled(&mut self, mut unknowns: DVector<f64>) -> Option<DVector<f64>> {
        for stage in 0..self.base_line().model.chain.stages.len() {
            let is_complete = |stage: &Stage<f64>| without_pose_of(stage).is_empty();
            if self.holds(&unknowns, stage, is_complete) {
                continue;
            }
            let repaired = self.with_free_stops(&unknowns, stage, is_complete);
            unknowns = match repaired {
                Some(repaired) => repaired,
                None if self.holds(&unknowns, stage, has_needed_poses) => unknowns,
                None => self.with_free_stops(&unknowns, stage, has_needed_poses)?,
            };
        }
        Some(unknowns)
    }

    fn holds(&mut self, unknowns: &DVector<f64>, stage: usize, is_enough: impl Fn(&Stage<f64>) -> bool) -> bool {
        is_enough(self.stage(unknowns, stage))
    }

    fn with_free_stops(
        &mut self,
        unknowns: &DVector<f64>,
        stage: usize,
        is_enough: impl Fn(&Stage<f64>) -> bool,
    ) -> Option<DVector<f64>> {
        let free = self.free_stops(stage);
        // The draws are the same each time: an answer can be repeated.
        let mut rng = ChaCha8Rng::seed_from_u64(stage as u64);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        for size in 1..=SIZES {
            let deviation = LARGEST * f64::from(size) / f64::from(SIZES);
            let mut best: Option<(f64, DVector<f64>)> = None;
            for _ in 0..DRAWS {
                let mut drawn = unknowns.clone();
                free.iter().for_each(|&stop| drawn[stop] *= 1.0 + deviation * normal());
                let altered = self.alteration(&drawn);
                let is_smaller = best.as_ref().is_none_or(|(smallest, _)| altered < *smallest);
                if is_smaller && self.keeps_bounds(&drawn) && self.holds(&drawn, stage, &is_enough) {
                    best = Some((altered, drawn));
                }
            }
            if let Some((_, drawn)) = best {
                return Some(drawn);
            }
        }
        None
    }

    /// The unknowns that are stops of a module and that no frame uses.
    fn free_stops(&self, stage: usize) -> Vec<usize> {
        let chain = &self.base_line().model.chain;
        let is_own = |stop: &Parameter| match *stop {
            Parameter::Stop { actuator, .. } => chain.actuator(actuator.into()).is_some_and(|(own, _)| own == stage),
            _ => false,
        };
        let is_used =
            |unknown: usize| self.targets.iter().any(|target| target.used.iter().any(|(used, _)| *used == unknown));
        (0..self.n_stops()).filter(|&unknown| is_own(&self.stops[unknown]) && !is_used(unknown)).collect()
    }

    fn keeps_bounds(&self, unknowns: &DVector<f64>) -> bool {
        self.bounds.iter().all(|bound| bound.slack(unknowns) > -1e-12)
    }
}
