//! The true arm: the nominal geometry with effects in it that no model declares.
//!
//! A seed draws the effect, its place and its size; nobody who diagnoses the arm can see them before [`Truth::unseal`].
//! Its size is such that the tool misses the desired frames by 10 to 40 times what the camera scatters. The equations
//! are its own (see `mechanism`), not those of the laws that a diagnosis tries.

mod blind;
mod camera;
mod displacement;
mod kind;
mod mechanism;
mod surroundings;
mod true_pose;

use darm_core::chain::{Chain, ChainError};
use darm_core::model::Mass;
use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_core::units::Word;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::effect::{LawName, Place};
use crate::outcome::Regressor;
pub use blind::Blind;
use darm_arm::arm::frames::DesiredFrame;
use darm_arm::arm::{Arm, ArmScratch, MAX_STAGES};
pub use kind::Kind;
use mechanism::Mechanism;
use surroundings::Conditions;
pub use surroundings::Surroundings;

/// Standard deviation of a coordinate that the camera reports.
pub const CAMERA_M: f64 = 0.2e-3;
/// Standard deviation of an angle that the camera reports: 0.02°.
pub const CAMERA_RAD: f64 = 0.02 * std::f64::consts::PI / 180.0;
/// The error at the desired frames is drawn from this range, in units of the camera's scatter, for settled
/// surroundings; while they settle it is up to a quarter more or less.
const TIMES_SCATTER: std::ops::Range<f64> = 13.0..32.0;
/// Places drawn before a kind of effect is held to be impossible in an arm.
const DRAWS: usize = 64;
/// Random words in which an arm must have a pose with its effect.
const POSE_TRIALS: usize = 256;

/// What the arm is commanded, and when.
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
    /// What the tool carries in addition to its payload.
    pub load_kg: f64,
    /// What happened to the arm before; nothing where it is not followed.
    pub history: Option<&'a History>,
}

/// What happened to an arm before the word that it is in.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct History {
    /// Blows of each actuator on its stops, each in shares of one at nominal supply.
    blows: Vec<f64>,
    /// When each actuator had switched last.
    switched_s: Vec<f64>,
    /// The word before the word before.
    second_last: Option<Word>,
    /// The word before.
    last: Option<Word>,
}

/// What the instruments measure.
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
    mechanisms: Vec<Mechanism>,
    sealed: Sealed,
}

/// A state under its surroundings.
#[derive(Clone, Copy, Debug)]
struct Occasion<'a> {
    state: TrueState<'a>,
    moment: Conditions,
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
    /// The law and the place that a diagnosis is to name; `None` where none is right.
    #[serde(skip)]
    pub cause: Option<(LawName, Place)>,
    /// Where no law is right: what it depends on.
    #[serde(skip)]
    pub regressor: Option<Regressor>,
    /// Its size.
    pub size: f64,
    /// Unit of the size.
    pub unit: &'static str,
    /// Error that it was sized for, at the desired frames or over a run, as a distance d, root mean square, m.
    pub desired_error_m: f64,
    /// That error in units of the camera's scatter.
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

impl<'a> TrueState<'a> {
    /// A word alone: no word before, nothing carried, no history.
    pub fn of_word(word: Word, servos_rad: &'a [f64], time_s: f64) -> Self {
        Self { word, previous: None, servos_rad, time_s, load_kg: 0.0, history: None }
    }
}

impl Truth {
    /// A true arm of `arm`'s geometry with an effect drawn by `seed`: of this `kind`, or of any that is large enough.
    ///
    /// # Errors
    ///
    /// [`TruthError::NoPose`]: the arm has no pose for a desired word. [`TruthError::TooWeak`]: no place and size of
    /// this kind give an effect that is large enough at the desired frames.
    pub fn draw(arm: &Arm, desired: &[DesiredFrame], seed: u64, kind: Option<Kind>) -> Result<Self, TruthError> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x7a11_ed00);
        if let Some(kind) = kind {
            return Self::of_kind(arm, desired, seed, kind, rng);
        }
        let kinds = Kind::EFFECTS;
        let first = rng.random_range(0..kinds.len());
        let others = (1..kinds.len()).map(|next| kinds[(first + next) % kinds.len()]);
        let mut drawn = Self::of_kind(arm, desired, seed, kinds[first], rng.clone());
        for kind in others {
            if !matches!(drawn, Err(TruthError::TooWeak { .. })) {
                break;
            }
            drawn = Self::of_kind(arm, desired, seed, kind, rng.clone());
        }
        drawn
    }

    fn of_kind(
        arm: &Arm,
        desired: &[DesiredFrame],
        seed: u64,
        kind: Kind,
        mut rng: ChaCha8Rng,
    ) -> Result<Self, TruthError> {
        let surroundings = Surroundings::draw(&mut rng, arm.model.nominal_supply, arm.model.reference_temperature_k);
        let sealed = Sealed::nothing(seed);
        let mut truth = Self { body: Body::of(arm), surroundings, mechanisms: Vec::new(), sealed };
        if kind == Kind::Nothing {
            return Ok(truth);
        }
        let times = rng.random_range(TIMES_SCATTER);
        let occasions: Vec<Occasion> = desired.iter().map(|frame| truth.settled(frame)).collect();
        truth.sealed = truth.add(kind, times * scatter_m(arm), &occasions, seed, &mut rng)?;
        Ok(truth)
    }

    /// Gives the arm one more effect, of a size that makes this error on these occasions by itself; what it is.
    fn add(
        &mut self,
        kind: Kind,
        error_m: f64,
        occasions: &[Occasion],
        seed: u64,
        rng: &mut ChaCha8Rng,
    ) -> Result<Sealed, TruthError> {
        for _ in 0..DRAWS {
            let unit = Mechanism::draw(kind, &self.body.chain, rng);
            let Some(unit) = unit else { break };
            if let Some(size) = self.size_for(&unit, occasions, error_m)? {
                self.mechanisms.push(unit.scaled(size));
                if !self.has_poses(rng) {
                    self.mechanisms.pop();
                    continue;
                }
                let desired_error_m = self.error_m(&[unit.scaled(size)], occasions)?;
                let times_scatter = desired_error_m / scatter_of(self.body.chain.is_planar(), self.body.length_scale_m);
                let (cause, regressor) = (kind.law().zip(unit.place()), unit.regressor());
                let (effect, place, unit) = (kind.name(), unit.place_in_words(), kind.unit());
                return Ok(Sealed {
                    effect,
                    place,
                    cause,
                    regressor,
                    size,
                    unit,
                    desired_error_m,
                    times_scatter,
                    seed,
                });
            }
        }
        Err(TruthError::TooWeak { kind })
    }

    /// A desired frame in settled surroundings.
    fn settled<'a>(&self, frame: &'a DesiredFrame) -> Occasion<'a> {
        let (word, servos_rad) = (frame.word, &frame.servos_rad[..]);
        let state = TrueState { previous: Some(frame.previous), ..TrueState::of_word(word, servos_rad, f64::INFINITY) };
        Occasion { state, moment: self.surroundings.settled(&word) }
    }

    /// The same true arm after a person has set its stops and anchors to those of `arm`: the effect stays.
    #[must_use]
    pub fn with_geometry(&self, arm: &Arm) -> Self {
        Self { body: Body { chain: arm.model.chain.clone(), ..self.body.clone() }, ..self.clone() }
    }

    /// Pose of the tool in the base.
    ///
    /// # Errors
    ///
    /// The word or the servo positions do not fit the arm, or a platform cannot be assembled with such legs.
    pub fn pose(&self, state: &TrueState) -> Result<Pose<f64>, ChainError> {
        let surroundings = self.surroundings.at(state.time_s, &state.word);
        true_pose::pose(&self.mechanisms, &self.body, state, surroundings, &mut ArmScratch::default())
    }

    /// The secret. To be read once the verdict is written.
    pub fn unseal(&self) -> &Sealed {
        &self.sealed
    }

    /// The size of an effect of size one that gives this error on these occasions, by bisection; `None` where no sensible
    /// size does.
    fn size_for(&self, unit: &Mechanism, occasions: &[Occasion], error_m: f64) -> Result<Option<f64>, TruthError> {
        let error_of = |size: f64| self.error_m(&[unit.scaled(size)], occasions).unwrap_or(f64::INFINITY);
        self.error_m(&[], occasions)?;
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
    fn has_poses(&self, rng: &mut impl Rng) -> bool {
        let mut scratch = ArmScratch::default();
        let chain = &self.body.chain;
        let servos_rad = vec![0.0; chain.n_servos()];
        (0..POSE_TRIALS).all(|_| {
            let mut digit = |k| rng.random_range(0..chain.n_states(k).max(1) as u8);
            let digits: Vec<u8> = (0..chain.n_actuators()).map(&mut digit).collect();
            let word = Word::new(&digits).expect("one digit for each actuator of a chain");
            let state = TrueState::of_word(word, &servos_rad, 0.0);
            let moment = self.surroundings.settled(&word);
            chain.pose_base_tool(&word, &servos_rad, &mut scratch).is_err()
                || true_pose::pose(&self.mechanisms, &self.body, &state, moment, &mut scratch).is_ok()
        })
    }

    /// The distance d from the nominal arm that these effects make on these occasions, root mean square, m.
    fn error_m(&self, mechanisms: &[Mechanism], occasions: &[Occasion]) -> Result<f64, TruthError> {
        let mut scratch = ArmScratch::default();
        let mut squares = 0.0;
        for Occasion { state, moment } in occasions {
            let no_pose = |error| TruthError::NoPose { word: state.word, error };
            let nominal =
                self.body.chain.pose_base_tool(&state.word, state.servos_rad, &mut scratch).map_err(no_pose)?;
            let own = true_pose::pose(mechanisms, &self.body, state, *moment, &mut scratch).map_err(no_pose)?;
            squares += nominal.distance(&own, self.body.length_scale_m).powi(2);
        }
        Ok((squares / occasions.len().max(1) as f64).sqrt())
    }
}

impl Sealed {
    /// Whether there is no effect.
    pub fn is_nothing(&self) -> bool {
        self.effect == Kind::Nothing.name()
    }

    /// Whether this law at this part of the arm is right.
    pub fn is_at_part(&self, law: LawName, place: &Place) -> bool {
        self.cause.is_some_and(|(own, at)| own == law && at.part() == place.part())
    }

    /// No effect at all.
    fn nothing(seed: u64) -> Self {
        let (effect, place) = (Kind::Nothing.name(), String::new());
        Self {
            effect,
            place,
            cause: None,
            regressor: None,
            size: 0.0,
            unit: "",
            desired_error_m: 0.0,
            times_scatter: 0.0,
            seed,
        }
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

    /// The potential energy of all weights in the posture of `scratch`, with what the tool carries in addition, J.
    fn potential_j(&self, load_kg: f64, scratch: &ArmScratch) -> f64 {
        let height = |mass: &Mass<f64>, frame: &Pose<f64>| -mass.mass_kg * self.gravity.dot(&(*frame * mass.center));
        let plates = self.chain.stages.iter().zip(&self.masses).zip(&scratch.tops);
        let carried = Mass { mass_kg: self.payload.mass_kg + load_kg, ..self.payload };
        plates.map(|((_, mass), top)| height(mass, top)).sum::<f64>() + height(&carried, &scratch.pose_base_tool)
    }
}

/// The camera's scatter as a distance d, m.
pub fn scatter_m(arm: &Arm) -> f64 {
    scatter_of(arm.model.chain.is_planar(), arm.length_scale_m)
}

fn scatter_of(planar: bool, length_scale_m: f64) -> f64 {
    let (linear, angular) = if planar { (2.0, 1.0) } else { (3.0, 3.0) };
    (linear * CAMERA_M.powi(2) + angular * (CAMERA_RAD * length_scale_m).powi(2)).sqrt()
}

#[cfg(test)]
mod tests;
