//! What the camera, the supply sensor and the thermometer measure of the true arm.

use darm_core::chain::ChainError;
use darm_core::real::Vec3;
use darm_core::se::{Pose, Twist};
use darm_core::units::Word;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::measurement_plan::{PlanStep, arrivals};
use crate::truth::CAMERA_M;
use crate::truth::CAMERA_RAD;
use crate::truth::History;
use crate::truth::Observed;
use crate::truth::TrueState;
use crate::truth::Truth;
use darm_arm::arm::ZERO_CELSIUS;
use darm_measure::{Run, Sample};

/// Time that one step takes in a [`Truth::measure`]d measurement plan; a repeat takes a third of it.
const STEP_S: f64 = 0.3;

impl Truth {
    /// What camera, supply sensor and thermometer measure.
    ///
    /// # Errors
    ///
    /// The true arm has no pose in this state.
    pub fn observe(&self, state: &TrueState, rng: &mut impl Rng) -> Result<Observed, ChainError> {
        let pose = self.pose(state)?;
        let (supply, temperature_k) = self.surroundings.sensed(state.time_s, &state.word, rng);
        Ok(Observed { pose: self.seen(&pose, rng), supply, temperature_c: temperature_k - ZERO_CELSIUS })
    }

    /// A pose as the camera sees it.
    fn seen(&self, pose: &Pose<f64>, rng: &mut impl Rng) -> Pose<f64> {
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let mut error = Twist::<f64>::zero();
        error.linear = Vec3::from_fn(|_, _| CAMERA_M * normal());
        error.angular = Vec3::from_fn(|_, _| CAMERA_RAD * normal());
        if self.body.chain.is_planar() {
            error.linear.z = 0.0;
            error.angular.x = 0.0;
            error.angular.y = 0.0;
        }
        *pose * Pose::exp(&error)
    }

    /// The measurement of a measurement plan that begins at `start_s`, with a camera seeded by `seed`.
    ///
    /// # Errors
    ///
    /// The true arm has no pose for a step.
    pub fn measure(&self, steps: &[PlanStep], start_s: f64, seed: u64) -> Result<Run, ChainError> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0xca3e_7a00);
        let mut run = Run::default();
        for (visit, (step, moment)) in steps.iter().zip(self.followed(steps, start_s)).enumerate() {
            let observed = self.observe(&moment.state(step), &mut rng)?;
            run.samples.push(Sample {
                time_s: moment.time_s,
                word: step.word,
                previous: Some(step.previous),
                servos_rad: step.servos_rad.clone(),
                pose: observed.pose,
                supply: Some(observed.supply),
                temperature_c: Some(observed.temperature_c),
                load_kg: step.load_kg,
                strokes_s: Vec::new(),
                run: 0,
                visit: visit as u32,
                held_out: step.held_out,
            });
        }
        Ok(run)
    }

    /// When each step of a measurement plan is made, and what happened before.
    pub(crate) fn followed(&self, steps: &[PlanStep], start_s: f64) -> Vec<Followed> {
        let mut history = History::default();
        let mut time_s = start_s;
        let follow = |(step, previous): (&PlanStep, Word)| {
            time_s += if step.repeat { STEP_S / 3.0 } else { STEP_S };
            let supply = self.surroundings.at(time_s, &step.word).supply_ratio;
            history.follow(step, supply, time_s);
            Followed { time_s, previous, history: history.clone() }
        };
        steps.iter().zip(arrivals(steps)).map(follow).collect()
    }
}

/// One step of a measurement plan in time.
pub(crate) struct Followed {
    pub(crate) time_s: f64,
    /// The word that the arm has come from.
    previous: Word,
    pub(crate) history: History,
}

impl Followed {
    pub(crate) fn state<'a>(&'a self, step: &'a PlanStep) -> TrueState<'a> {
        TrueState {
            word: step.word,
            previous: Some(self.previous),
            servos_rad: &step.servos_rad,
            time_s: self.time_s,
            load_kg: step.load_kg.unwrap_or(0.0),
            history: Some(&self.history),
        }
    }
}

impl History {
    /// Adds a step at this time under this supply, in shares of nominal.
    fn follow(&mut self, step: &PlanStep, supply: f64, time_s: f64) {
        self.blows.resize(step.word.len(), 0.0);
        // Before it has switched an actuator counts from the first row, as in the diagnosis.
        self.switched_s.resize(step.word.len(), time_s);
        for actuator in 0..step.word.len() {
            if step.word.digit(actuator) != step.previous.digit(actuator) {
                self.blows[actuator] += supply;
                self.switched_s[actuator] = time_s;
            }
        }
        if step.word != step.previous {
            self.second_last = self.last.replace(step.previous);
        }
    }
}
