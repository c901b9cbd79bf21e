//! The true arm: the nominal geometry with one effect in it that no model declares.
//!
//! A seed draws the effect, its place and its size; nobody who diagnoses the arm can see them before [`Truth::unseal`].
//! Its size is such that the tool misses the desired frames by 10 to 40 times what the camera scatters. The equations
//! are its own (see `mechanism`), not those of the laws that a diagnosis tries.

mod mechanism;
mod surroundings;

use darm_core::chain::{Chain, ChainError};
use darm_core::model::Mass;
use darm_core::real::Vec3;
use darm_core::se::{Pose, Twist};
use darm_core::units::Word;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::arm::frames::DesiredFrame;
use crate::arm::{Arm, ArmScratch, MAX_STAGES};
use crate::measurement::{Run, Sample};
use crate::programme::Step;
pub use mechanism::Kind;
use mechanism::Mechanism;
pub use surroundings::Surroundings;

/// Standard deviation of a coordinate that the camera tells.
pub const CAMERA_M: f64 = 0.2e-3;
/// Standard deviation of an angle that the camera tells: 0.02°.
pub const CAMERA_RAD: f64 = 0.02 * std::f64::consts::PI / 180.0;
/// The error at the desired frames is drawn from this range, in units of the camera's scatter, for settled
/// surroundings; while they settle it is up to a quarter more or less.
const TIMES_SCATTER: std::ops::Range<f64> = 13.0..32.0;
/// Places drawn before a kind of effect is held to be impossible in an arm.
const DRAWS: usize = 64;
/// Random words that an arm has to stand in with its effect.
const STANDS_IN: usize = 256;
/// Time that one step takes in a [`Truth::measure`]d programme; a repeat takes a third of it.
const STEP_S: f64 = 0.3;

/// What the arm is told and when.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueState<'a> {
    /// The stops where the actuators rest.
    pub word: Word,
    /// Those before; `None` since power-on.
    pub previous: Option<Word>,
    /// Positions of the servo joints.
    pub servos_rad: &'a [f64],
    /// Time since the arm was switched on.
    pub time_s: f64,
}

/// What the instruments tell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observed {
    /// Pose of the tool in the base, by the camera.
    pub pose: Pose<f64>,
    /// Supply, in the unit of the model.
    pub supply: f64,
    /// Temperature of the arm.
    pub temperature_c: f64,
}

/// The true arm.
#[derive(Clone, Debug)]
pub struct Truth {
    body: Body,
    surroundings: Surroundings,
    mechanism: Mechanism,
    sealed: Sealed,
}

/// The nominal arm, as far as physics goes.
#[derive(Clone, Debug)]
struct Body {
    chain: Chain<f64, MAX_STAGES>,
    masses: [Mass<f64>; MAX_STAGES],
    payload: Mass<f64>,
    gravity: Vec3<f64>,
    length_scale_m: f64,
}

/// The secret, for the report that is written after the verdict.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Sealed {
    /// Name of the law that is right for it; `none`.
    pub effect: &'static str,
    /// Where: `actuator 4, state 1`, `module 1`, `arm`; empty where there is none.
    pub place: String,
    /// Its size.
    pub size: f64,
    /// Unit of the size.
    pub unit: &'static str,
    /// Error at the desired frames that it was sized for, as a distance d, root mean square, m.
    pub desired_error_m: f64,
    /// The same in units of the camera's scatter.
    pub times_scatter: f64,
    /// The seed.
    pub seed: u64,
}

/// Why no true arm could be drawn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TruthError {
    /// The arm has no pose for a desired word.
    #[error("word {word} of a desired frame: {error}")]
    NoPose {
        /// The word.
        word: Word,
        /// Why.
        error: ChainError,
    },
    /// No place and size give an effect that is large enough at the desired frames.
    #[error("{kind} cannot move the tool far enough at the desired frames of this arm: draw another effect")]
    TooWeak {
        /// The kind of effect.
        kind: Kind,
    },
}

impl Truth {
    /// A true arm of `arm`'s geometry with an effect drawn by `seed`: of this `kind`, or of any.
    pub fn draw(arm: &Arm, desired: &[DesiredFrame], seed: u64, kind: Option<Kind>) -> Result<Self, TruthError> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x7a11_ed00);
        let kind = kind.unwrap_or_else(|| Kind::EFFECTS[rng.random_range(0..Kind::EFFECTS.len())]);
        let surroundings = Surroundings::draw(&mut rng, arm.model.nominal_supply, arm.model.reference_temperature_k);
        let sealed = Sealed {
            effect: kind.law(),
            place: String::new(),
            size: 0.0,
            unit: "",
            desired_error_m: 0.0,
            times_scatter: 0.0,
            seed,
        };
        let mut truth = Self { body: Body::of(arm), surroundings, mechanism: Mechanism::Nothing, sealed };
        if kind == Kind::Nothing {
            return Ok(truth);
        }
        let scatter_m = scatter_m(arm);
        let times = rng.random_range(TIMES_SCATTER);
        for _ in 0..DRAWS {
            let unit = Mechanism::draw(kind, &arm.model.chain, &mut rng);
            let Some(unit) = unit else { break };
            if let Some(size) = truth.size_for(&unit, desired, times * scatter_m)? {
                truth.mechanism = unit.scaled(size);
                if !truth.stands(&mut rng) {
                    truth.mechanism = Mechanism::Nothing;
                    continue;
                }
                truth.sealed.size = size;
                truth.sealed.unit = kind.unit();
                truth.sealed.place = unit.place();
                truth.sealed.desired_error_m = truth.desired_error_m(desired)?;
                truth.sealed.times_scatter = truth.sealed.desired_error_m / scatter_m;
                return Ok(truth);
            }
        }
        Err(TruthError::TooWeak { kind })
    }

    /// The same true arm after a person has set its stops and anchors to those of `arm`: the effect stays.
    #[must_use]
    pub fn with_geometry(&self, arm: &Arm) -> Self {
        Self { body: Body { chain: arm.model.chain.clone(), ..self.body.clone() }, ..self.clone() }
    }

    /// Pose of the tool in the base.
    pub fn pose(&self, state: &TrueState) -> Result<Pose<f64>, ChainError> {
        let surroundings = self.surroundings.at(state.time_s, &state.word);
        self.mechanism.pose(&self.body, state, surroundings, &mut ArmScratch::default())
    }

    /// What camera, supply sensor and thermometer tell.
    pub fn observe(&self, state: &TrueState, rng: &mut impl Rng) -> Result<Observed, ChainError> {
        let pose = self.pose(state)?;
        let (supply, temperature_k) = self.surroundings.told(state.time_s, &state.word, rng);
        Ok(Observed { pose: self.seen(&pose, rng), supply, temperature_c: temperature_k - 273.15 })
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

    /// The measurement of a whole programme that begins at `start_s`, with a camera seeded by `seed`.
    pub fn measure(&self, steps: &[Step], start_s: f64, seed: u64) -> Result<Run, ChainError> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0xca3e_7a00);
        let mut time_s = start_s;
        let mut run = Run::default();
        for (visit, step) in steps.iter().enumerate() {
            time_s += if step.repeat { STEP_S / 3.0 } else { STEP_S };
            let previous = Some(step.previous);
            let state = TrueState { word: step.word, previous, servos_rad: &step.servos_rad, time_s };
            let observed = self.observe(&state, &mut rng)?;
            run.samples.push(Sample {
                time_s,
                word: step.word,
                previous,
                servos_rad: step.servos_rad.clone(),
                pose: observed.pose,
                supply: Some(observed.supply),
                temperature_c: Some(observed.temperature_c),
                run: 0,
                visit: visit as u32,
                held_out: step.held_out,
            });
        }
        Ok(run)
    }

    /// The secret. To be asked for once the verdict is written.
    pub fn unseal(&self) -> &Sealed {
        &self.sealed
    }

    /// The size of an effect of size one that gives this error at the desired frames, by bisection; `None` where no
    /// sensible size does.
    fn size_for(&self, unit: &Mechanism, desired: &[DesiredFrame], error_m: f64) -> Result<Option<f64>, TruthError> {
        let error_of = |size: f64| {
            let truth = Self { mechanism: unit.scaled(size), ..self.clone() };
            truth.desired_error_m(desired).unwrap_or(f64::INFINITY)
        };
        self.desired_error_m(desired)?;
        let (mut low, mut high) = (0.0, unit.largest());
        if error_of(high) < error_m {
            return Ok(None);
        }
        while high - low > 1e-6 * high {
            let middle = 0.5 * (low + high);
            if error_of(middle) < error_m { low = middle } else { high = middle }
        }
        Ok(Some(high))
    }

    /// Whether the arm has a pose in random words wherever its drawing has one: no effect is to break it.
    fn stands(&self, rng: &mut impl Rng) -> bool {
        let mut scratch = ArmScratch::default();
        let chain = &self.body.chain;
        let servos_rad = vec![0.0; chain.n_servos()];
        (0..STANDS_IN).all(|_| {
            let mut digit = |k| rng.random_range(0..chain.n_states(k).max(1) as u8);
            let digits: Vec<u8> = (0..chain.n_actuators()).map(&mut digit).collect();
            let word = Word::new(&digits).unwrap_or_default();
            let state = TrueState { word, previous: None, servos_rad: &servos_rad, time_s: 0.0 };
            chain.pose_base_tool(&word, &servos_rad, &mut scratch).is_err()
                || self.mechanism.pose(&self.body, &state, self.surroundings.settled(&word), &mut scratch).is_ok()
        })
    }

    /// The distance d from the nominal arm at the desired frames in settled surroundings, root mean square, m.
    fn desired_error_m(&self, desired: &[DesiredFrame]) -> Result<f64, TruthError> {
        let mut scratch = ArmScratch::default();
        let mut squares = 0.0;
        for frame in desired {
            let (word, servos_rad) = (frame.word, &frame.servos_rad[..]);
            let no_pose = |error| TruthError::NoPose { word, error };
            let state = TrueState { word, previous: Some(frame.previous), servos_rad, time_s: f64::INFINITY };
            let surroundings = self.surroundings.settled(&word);
            let nominal = self.body.chain.pose_base_tool(&word, servos_rad, &mut scratch).map_err(no_pose)?;
            let own = self.mechanism.pose(&self.body, &state, surroundings, &mut scratch).map_err(no_pose)?;
            squares += nominal.distance(&own, self.body.length_scale_m).powi(2);
        }
        Ok((squares / desired.len().max(1) as f64).sqrt())
    }
}

impl Body {
    fn of(arm: &Arm) -> Self {
        let model = &arm.model;
        Self {
            chain: model.chain.clone(),
            masses: model.masses,
            payload: model.payload,
            gravity: model.gravity,
            length_scale_m: arm.length_scale_m,
        }
    }

    /// The potential energy of all weights in the posture of `scratch`, J.
    fn potential_j(&self, scratch: &ArmScratch) -> f64 {
        let height = |mass: &Mass<f64>, frame: &Pose<f64>| -mass.mass_kg * self.gravity.dot(&(*frame * mass.center));
        let plates = self.chain.stages.iter().zip(&self.masses).zip(&scratch.tops);
        plates.map(|((_, mass), top)| height(mass, top)).sum::<f64>() + height(&self.payload, &scratch.pose_base_tool)
    }
}

/// The camera's scatter as a distance d, m.
pub fn scatter_m(arm: &Arm) -> f64 {
    let (linear, angular) = if arm.model.chain.is_planar() { (2.0, 1.0) } else { (3.0, 3.0) };
    (linear * CAMERA_M.powi(2) + angular * (CAMERA_RAD * arm.length_scale_m).powi(2)).sqrt()
}

#[cfg(test)]
mod tests;
