//! Which words bring the tool nearest to a pose, out of all words of an arm.
//!
//! Every word is looked at: the stages' poses are tabulated once, and the words share the products of the stages that
//! they have in common, so that the last stage costs one product a word. Servo joints are solved continuously for each
//! word. The nearest words of the ideal geometry are then judged again by the model with its effects, under working
//! conditions: what effects move has to be small against the distance of the first and the last of them.
//!
//! Distance: d² = |Δp|² + ℓ²θ² with the arm's length scale ℓ.
//!
//! Arms with more words: [`exact`], with more than can be tabulated [`anytime`], with servo joints [`servo`]; where an
//! arm reaches: [`map`]; from word to word: [`path`]; what a board needs to answer by itself: [`board`].

pub mod anytime;
pub mod better_words;
pub mod board;
pub mod corrected;
mod every_word;
pub mod exact;
mod frames;
mod judge;
pub mod map;
pub mod path;
mod refine;
pub mod servo;
mod steps;
mod tree;

use darm_core::chain::ChainError;
use darm_core::se::Pose;
use darm_core::units::Word;

pub use self::every_word::{MAX_WORDS, best_words};

/// A word, and where it brings the tool.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The word.
    pub word: Word,
    /// Angles of the servo joints, rad.
    pub servos_rad: Vec<f64>,
    /// Where the model predicts the tool in the base.
    pub pose_base_tool: Pose<f64>,
    /// Distance from the wanted pose, m.
    pub distance_m: f64,
    /// Distance of the positions, m.
    pub error_m: f64,
    /// Angle between the orientations, rad.
    pub error_rad: f64,
}

/// Why no words can be named.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ReachError {
    /// The arm has too many words to look at each.
    #[error("words of {digits} digits are too many")]
    TooManyWords {
        /// Digits of a word.
        digits: usize,
    },
    /// No word puts the arm together.
    #[error("no word gives the arm a pose: {0}")]
    NoPose(ChainError),
    /// The cells of a map are too small for its extent.
    #[error("the cells are too small for the arm: take larger ones")]
    TooFine,
    /// The arm has servo joints, and frames are wanted that hold for all of their angles.
    #[error("not supported with servo joints: the frames of the arm depend on their angles")]
    Servos,
    /// Nobody waits for the result any more.
    #[error("the search was given up")]
    GivenUp,
    /// None of the allowed settings puts a stage together.
    #[error("stage {stage} cannot be assembled in any of its allowed states: change its legs or free an actuator")]
    NoSetting {
        /// Index of the stage.
        stage: usize,
    },
}
