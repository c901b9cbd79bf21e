//! Several effects, or one that no law knows, in one true arm: for `cargo xtask blind`.

use darm_core::chain::ChainError;
use darm_core::se::Pose;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::measurement_plan::PlanStep;
use crate::truth::Body;
use crate::truth::Kind;
use crate::truth::Occasion;
use crate::truth::Sealed;
use crate::truth::Surroundings;
use crate::truth::Truth;
use crate::truth::TruthError;
use crate::truth::scatter_m;
use darm_arm::arm::Arm;
use darm_measure::Run;

/// Error that each effect makes by itself over the run, in units of the camera's scatter.
const TIMES_SCATTER: std::ops::Range<f64> = 8.0..32.0;
/// Share of the rows that are made outliers.
const OUTLIERS: f64 = 0.02;
/// By how much, in units of the camera's scatter.
const OUTLIER_SCATTERS: std::ops::Range<f64> = 20.0..500.0;
/// Share of the arms with a sag whose tool carries something else from time to time.
const LOADED: f64 = 0.5;
/// What it carries, kg, and for how many steps.
const LOADS_KG: std::ops::Range<f64> = 0.0..2.0;
const LOADED_STEPS: std::ops::Range<usize> = 10..40;
/// Draws before a set of effects is held to be impossible.
const DRAWS: usize = 16;

/// A true arm with several effects, measured in one measurement plan.
#[derive(Clone, Debug)]
pub struct Blind {
    truth: Truth,
    sealed: Vec<Sealed>,
    measured: Run,
    clean: Run,
    spoiled: Vec<usize>,
}

impl Blind {
    /// The kinds that a law is right for.
    pub const INSIDE: [Kind; 18] = [
        Kind::StrokeLoss,
        Kind::AnchorOffset,
        Kind::GravitySag,
        Kind::Play,
        Kind::SupplyStroke,
        Kind::ThermalGrowth,
        Kind::Step,
        Kind::Drift,
        Kind::Wear,
        Kind::Crowding,
        Kind::LengthOffset,
        Kind::Interaction,
        Kind::Creep,
        Kind::BaseStep,
        Kind::BaseOffset,
        Kind::ToolOffset,
        Kind::Scale,
        Kind::JointOffset,
    ];
    /// The kinds that no law is right for.
    pub const OUTSIDE: [Kind; 5] = [Kind::Sway, Kind::Bimetal, Kind::Hose, Kind::Echo, Kind::Cable];

    /// A true arm with effects of these kinds, places and sizes drawn by the seed, in one run of `steps`.
    ///
    /// # Errors
    ///
    /// [`TruthError::NoPose`]: the arm has no pose for a word. [`TruthError::TooWeak`]: the arm can have no such effect, or
    /// no draw gives one that is large enough.
    pub fn draw(arm: &Arm, steps: &[PlanStep], kinds: &[Kind], seed: u64) -> Result<Self, TruthError> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0xb11d_0000);
        let mut last = TruthError::TooWeak { kind: Kind::Nothing };
        for _ in 0..DRAWS {
            match Self::once(arm, steps, kinds, seed, &mut rng) {
                Ok(blind) => return Ok(blind),
                Err(error) => last = error,
            }
        }
        Err(last)
    }

    fn once(
        arm: &Arm,
        steps: &[PlanStep],
        kinds: &[Kind],
        seed: u64,
        rng: &mut ChaCha8Rng,
    ) -> Result<Self, TruthError> {
        let (model, sealed) = (&arm.model, Sealed::nothing(seed));
        let surroundings = Surroundings::draw_wide(rng, model.nominal_supply, model.reference_temperature_k);
        let mut truth = Truth { body: Body::of(arm), surroundings, mechanisms: Vec::new(), sealed };
        let is_loaded = kinds.contains(&Kind::GravitySag) && rng.random_bool(LOADED);
        let steps = &if is_loaded { loaded(steps, rng) } else { steps.to_vec() };
        let followed = truth.followed(steps, 0.0);
        let moment = |state| {
            let crate::truth::TrueState { time_s, word, .. } = state;
            Occasion { state, moment: truth.surroundings.at(time_s, &word) }
        };
        let occasions: Vec<Occasion> =
            followed.iter().zip(steps).map(|(followed, step)| moment(followed.state(step))).collect();
        let mut sealed = Vec::new();
        for &kind in kinds {
            let times = rng.random_range(TIMES_SCATTER);
            sealed.push(truth.add(kind, times * scatter_m(arm), &occasions, seed, rng)?);
        }
        let no_pose = |error: ChainError| TruthError::NoPose { word: steps[0].word, error };
        let mut measured = truth.measure(steps, 0.0, seed).map_err(no_pose)?;
        let mut clean = measured.clone();
        for (sample, occasion) in clean.samples.iter_mut().zip(&occasions) {
            sample.pose = truth.pose(&occasion.state).map_err(no_pose)?;
        }
        let spoiled = spoil(&mut measured, arm, OUTLIERS, rng);
        Ok(Self { truth, sealed, measured, clean, spoiled })
    }

    /// What was measured.
    pub fn measured(&self) -> &Run {
        &self.measured
    }

    /// What was measured, for an evaluation that damages it.
    pub fn measured_mut(&mut self) -> &mut Run {
        &mut self.measured
    }

    /// What the same arm gives from step number `from` on in another measurement plan, with a camera and outliers of this
    /// seed. What comes before does not depend on the steps after it.
    ///
    /// # Errors
    ///
    /// The true arm has no pose for a step.
    pub fn measure(&self, arm: &Arm, steps: &[PlanStep], from: usize, seed: u64) -> Result<Run, ChainError> {
        let mut run = self.truth.measure(steps, 0.0, seed)?;
        run.samples.drain(..from.min(run.samples.len()));
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ from as u64 ^ 0x5a01_0000_0000);
        spoil(&mut run, arm, OUTLIERS, &mut rng);
        Ok(run)
    }

    /// Throws a further share of the poses far off, as those that are off already.
    pub fn spoil(&mut self, arm: &Arm, share: f64, rng: &mut ChaCha8Rng) {
        let more = spoil(&mut self.measured, arm, share, rng);
        self.spoiled.extend(more);
    }

    /// The measurement without noise and outliers. To be read once the verdict is written.
    pub fn clean(&self) -> &Run {
        &self.clean
    }

    /// The samples that were made outliers. To be read once the verdict is written.
    pub fn spoiled(&self) -> &[usize] {
        &self.spoiled
    }

    /// The secrets. To be read once the verdict is written.
    pub fn unseal(&self) -> &[Sealed] {
        &self.sealed
    }

    /// The noise of the camera as a distance d, m.
    pub fn scatter_m(&self) -> f64 {
        crate::truth::scatter_of(self.truth.body.chain.is_planar(), self.truth.body.length_scale_m)
    }
}

/// The steps with something else at the tool every few of them.
fn loaded(steps: &[PlanStep], rng: &mut ChaCha8Rng) -> Vec<PlanStep> {
    let (mut load_kg, mut left) = (0.0, 0);
    let carry = |step: &PlanStep| {
        if left == 0 {
            (load_kg, left) = (rng.random_range(LOADS_KG), rng.random_range(LOADED_STEPS));
        }
        left -= 1;
        PlanStep { load_kg: Some(load_kg), ..step.clone() }
    };
    steps.iter().map(carry).collect()
}

/// Throws a share of the poses far off; which.
fn spoil(run: &mut Run, arm: &Arm, share: f64, rng: &mut ChaCha8Rng) -> Vec<usize> {
    let scatter_m = scatter_m(arm);
    let spoiled: Vec<usize> = (0..run.samples.len()).filter(|_| rng.random_bool(share)).collect();
    for &sample in &spoiled {
        let size_m = scatter_m * rng.random_range(OUTLIER_SCATTERS);
        let aside = crate::truth::displacement::tilt(arm.model.chain.is_planar(), rng) * size_m;
        let pose = &mut run.samples[sample].pose;
        *pose = *pose * Pose::exp(&aside);
    }
    spoiled
}
