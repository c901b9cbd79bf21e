//! A chain of stages from the base of an arm to its tool: the pose of the tool for a word and servo positions.
//!
//! # Model
//!
//! `T_base_tool = mount · T_0 · T_1 ⋯ T_(n−1) · tool`, with T_i the pose of the top of stage i in its base.
//!
//! Actuator k of a word is the k-th discrete actuator counted along the chain; a parallel platform counts its legs in
//! their order. Servo k is the k-th servo joint counted along the chain.
//!
//! A [`Chain`] is constant; what a computation needs besides lives in a [`Scratch`] that the caller owns:
//! [`Chain::configure`] writes what every actuator is set to, [`Chain::assemble`] solves the stages,
//! [`Chain::derivative`] says how the tool moves with any one number of the geometry.
#![allow(non_snake_case)]

mod parameter;

use core::fmt;

use heapless::Vec;

use crate::actuator::{MAX_LEGS, PlatformError, Setting, Settings, Stage};
use crate::real::Real;
use crate::se::Pose;
use crate::units::Word;
pub use parameter::{NoSuchParameter, Parameter};

/// An arm of at most `N` stages.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain<T: Real, const N: usize> {
    /// Pose of the first stage's base in the base of the arm.
    pub mount: Pose<T>,
    /// The stages from the base on; each is on the top of the one before.
    pub stages: Vec<Stage<T>, N>,
    /// Pose of the tool in the top of the last stage.
    pub tool: Pose<T>,
}

/// One posture of a chain, and the room to compute it in.
#[derive(Clone, Debug)]
pub struct Scratch<T: Real, const N: usize> {
    /// What the actuators of each stage are set to.
    pub settings: [Settings<T>; N],
    /// Pose of each stage's top in its own base.
    pub stages: [Pose<T>; N],
    /// Pose of each stage's top in the base of the arm.
    pub tops: [Pose<T>; N],
    /// Pose of the tool in the base of the arm.
    pub pose_base_tool: Pose<T>,
    word: Word,
}

/// Why a chain has no pose for a word.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ChainError {
    /// The word has not one digit for each actuator.
    WordLength {
        /// Actuators of the chain.
        actuators: usize,
        /// Digits of the word.
        digits: usize,
    },
    /// There is not one position for each servo joint.
    ServoCount {
        /// Servo joints of the chain.
        servos: usize,
        /// Positions given.
        positions: usize,
    },
    /// A digit asks for a state that its actuator does not have.
    NoSuchState {
        /// Index of the actuator.
        actuator: usize,
        /// The digit.
        digit: u8,
        /// How many states the actuator has.
        states: usize,
    },
    /// A parallel platform has no pose.
    Platform {
        /// Index of the stage.
        stage: usize,
        /// What is wrong with it.
        reason: PlatformError,
    },
}

impl<T: Real, const N: usize> Default for Scratch<T, N> {
    fn default() -> Self {
        Self {
            settings: [[Setting::of_joint(T::zero()); MAX_LEGS]; N],
            stages: [Pose::identity(); N],
            tops: [Pose::identity(); N],
            pose_base_tool: Pose::identity(),
            word: Word::default(),
        }
    }
}

impl<T: Real, const N: usize> Chain<T, N> {
    /// How many discrete actuators the chain has, and so digits of a word.
    pub fn n_actuators(&self) -> usize {
        self.stages.iter().map(Stage::n_actuators).sum()
    }

    /// How many servo joints the chain has.
    pub fn n_servos(&self) -> usize {
        self.servo_stages().count()
    }

    /// Whether the tool only ever moves in the xy-plane of the base.
    pub fn is_planar(&self) -> bool {
        self.mount.is_planar() && self.stages.iter().all(Stage::is_planar) && self.tool.is_planar()
    }

    /// The stage of an actuator and its number within that stage; `None` past the last.
    pub fn actuator(&self, index: usize) -> Option<(usize, usize)> {
        self.actuators().nth(index)
    }

    /// The stage of each actuator and its number within that stage, in the order of the digits.
    pub fn actuators(&self) -> impl Iterator<Item = (usize, usize)> {
        self.stages.iter().enumerate().flat_map(|(stage, kind)| (0..kind.n_actuators()).map(move |leg| (stage, leg)))
    }

    /// How many states an actuator has; 0 past the last.
    pub fn n_states(&self, actuator: usize) -> usize {
        self.actuator(actuator).map_or(0, |(stage, leg)| self.stages[stage].n_states(leg))
    }

    /// Pose of the tool in the base for `word` and the positions of the `servos`, rad or m.
    ///
    /// # Errors
    ///
    /// As [`configure`](Self::configure) and [`assemble`](Self::assemble).
    pub fn pose_base_tool(
        &self,
        word: &Word,
        servos: &[T],
        scratch: &mut Scratch<T, N>,
    ) -> Result<Pose<T>, ChainError> {
        self.configure(word, servos, scratch)?;
        self.assemble(scratch)
    }

    /// Writes what each actuator is set to, and leaves the poses of `scratch` as they were.
    ///
    /// # Errors
    ///
    /// [`ChainError::WordLength`]: the word has not one digit for each actuator. [`ChainError::ServoCount`]: there is
    /// not one position for each servo joint. [`ChainError::NoSuchState`]: a digit asks for a state that its actuator
    /// does not have.
    pub fn configure(&self, word: &Word, servos: &[T], scratch: &mut Scratch<T, N>) -> Result<(), ChainError> {
        let (actuators, digits) = (self.n_actuators(), word.len());
        if actuators != digits {
            return Err(ChainError::WordLength { actuators, digits });
        }
        let (servo_joints, positions) = (self.n_servos(), servos.len());
        if servo_joints != positions {
            return Err(ChainError::ServoCount { servos: servo_joints, positions });
        }
        let (mut actuator, mut servos) = (0, servos.iter());
        for (stage, settings) in self.stages.iter().zip(&mut scratch.settings) {
            if let Stage::Servo(joint) = stage {
                settings[0].value = joint.offset + servos.next().copied().unwrap_or(T::zero());
            }
            for (leg, setting) in settings.iter_mut().enumerate().take(stage.n_actuators()) {
                let digit = word.digit(actuator);
                *setting = stage.setting(leg, digit).ok_or(ChainError::NoSuchState {
                    actuator,
                    digit,
                    states: stage.n_states(leg),
                })?;
                actuator += 1;
            }
        }
        scratch.word = *word;
        Ok(())
    }

    /// Pose of the tool in the base for the settings in `scratch`; the poses of all stages are left there.
    ///
    /// # Errors
    ///
    /// [`ChainError::Platform`]: a parallel platform has no pose for its settings.
    pub fn assemble(&self, scratch: &mut Scratch<T, N>) -> Result<Pose<T>, ChainError> {
        self.assemble_with(scratch, |_, stage, settings| stage.pose(settings))
    }

    /// As [`assemble`](Self::assemble), with the pose of each stage, whose number and settings are given, from `pose_of`.
    ///
    /// # Errors
    ///
    /// [`ChainError::Platform`]: an error of `pose_of`.
    pub fn assemble_with(
        &self,
        scratch: &mut Scratch<T, N>,
        mut pose_of: impl FnMut(usize, &Stage<T>, &Settings<T>) -> Result<Pose<T>, PlatformError>,
    ) -> Result<Pose<T>, ChainError> {
        let mut T_base_top = self.mount;
        for (index, stage) in self.stages.iter().enumerate() {
            let pose = pose_of(index, stage, &scratch.settings[index])
                .map_err(|reason| ChainError::Platform { stage: index, reason })?;
            T_base_top = T_base_top * pose;
            scratch.stages[index] = pose;
            scratch.tops[index] = T_base_top;
        }
        scratch.pose_base_tool = T_base_top * self.tool;
        Ok(scratch.pose_base_tool)
    }

    pub(crate) fn servo_stages(&self) -> impl Iterator<Item = usize> {
        self.stages.iter().enumerate().filter(|(_, stage)| matches!(stage, Stage::Servo(_))).map(|(index, _)| index)
    }
}

impl<const N: usize> Chain<f64, N> {
    /// The same chain in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> Chain<U, N> {
        Chain {
            mount: self.mount.cast(),
            stages: self.stages.iter().map(Stage::cast).collect(),
            tool: self.tool.cast(),
        }
    }
}

impl fmt::Display for ChainError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::WordLength { actuators, digits } => {
                write!(f, "the word has {digits} digits, the arm has {actuators} actuators")
            }
            Self::ServoCount { servos, positions } => {
                write!(f, "{positions} servo positions are given, the arm has {servos} servo joints")
            }
            Self::NoSuchState { actuator, digit, states } => {
                write!(f, "digit {digit} is no state of actuator {actuator}, which has {states}")
            }
            Self::Platform { stage, reason } => write!(f, "stage {stage}: {reason}"),
        }
    }
}

impl core::error::Error for ChainError {}

#[cfg(test)]
mod tests;
