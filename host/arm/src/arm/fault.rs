//! What can be wrong with what an arm file or a frames file says.

use std::fmt;

use darm_core::chain::ChainError;
use darm_core::output::{ServoWiring, WiringError};
use darm_core::units::{Word, WordError};

use super::WiringFault;

/// What is wrong with an arm, and what to do about it.
#[derive(Clone, Debug, PartialEq)]
pub enum ArmFault {
    /// The file has another format than this program reads.
    Format {
        /// The number in the file.
        found: u32,
    },
    /// A number has to be above zero.
    NotPositive {
        /// The key.
        key: &'static str,
        /// The number.
        value: f64,
    },
    /// The arm has no stage, or more than fit.
    StageCount {
        /// How many there are.
        found: usize,
        /// How many fit.
        most: usize,
    },
    /// A key is missing.
    Missing {
        /// The key.
        key: &'static str,
        /// What it is needed for.
        of: &'static str,
    },
    /// A key stands where it means nothing.
    Useless {
        /// The key.
        key: &'static str,
        /// What has no such key.
        of: &'static str,
    },
    /// A platform has the wrong number of legs.
    LegCount {
        /// How many its kind has.
        expected: usize,
        /// How many are given.
        found: usize,
    },
    /// A point or pose has the wrong number of coordinates.
    Coordinates {
        /// How many it has here.
        expected: usize,
        /// How many are given.
        found: usize,
    },
    /// An actuator has fewer than two or more than four states.
    StateCount {
        /// How many are given.
        found: usize,
    },
    /// A state is shorter than the one before it: its stroke is below zero.
    Stroke {
        /// The state.
        state: usize,
        /// Its value, m or rad.
        value: f64,
        /// The value of the state before, m or rad.
        before: f64,
    },
    /// An actuator with so many states needs another number of outputs.
    OutputCount {
        /// How many it needs.
        expected: usize,
        /// How many are given.
        found: usize,
    },
    /// A switch is closed in a state that its actuator does not have.
    SwitchState {
        /// The state.
        state: u8,
    },
    /// The axis of a joint has no direction.
    NoAxis,
    /// There is no law of this name.
    UnknownLaw {
        /// The name in the file.
        found: String,
        /// The names that there are.
        known: Vec<&'static str>,
    },
    /// An effect names an actuator, module or state that the arm does not have.
    NoSuchPlace,
    /// The values of an effect are not those of its law.
    EffectValues {
        /// The keys that it has.
        expected: Vec<String>,
    },
    /// More effects than a model holds.
    TooManyEffects {
        /// How many it holds.
        most: usize,
    },
    /// Two servos answer to one address of the bus.
    SameBusId {
        /// The address.
        id: u8,
        /// The two servo joints, by their names.
        joints: [String; 2],
    },
    /// Address or range of a servo are out of bounds.
    Servo {
        /// The address.
        id: u8,
    },
    /// No board could drive the arm: an output is named twice, or there are too many.
    Wiring(WiringError),
    /// The profile of the board does not fit the arm.
    Profile(WiringFault),
    /// The arm has no pose for a word that it must be able to take.
    NoPose {
        /// The word.
        word: Word,
        /// The module that is at fault, by its name.
        module: String,
        /// Why.
        reason: ChainError,
    },
}

impl fmt::Display for ArmFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Format { found: 1 } => write!(
                f,
                "the file has format 1, in which the arm carried the limits of its board; bring it over by \
                 `darm profile migrate OLD.toml -o NEW.toml --profile PROFILE.toml`"
            ),
            Self::Format { found } => {
                write!(f, "the file has format {found}, this program reads format {}", super::FORMAT)
            }
            Self::NotPositive { key, value } => write!(f, "{key} is {value}; give a number above zero"),
            Self::StageCount { found, most } => write!(f, "the arm has {found} stages; give 1 to {most}"),
            Self::Missing { key, of } => write!(f, "{of} needs the key `{key}`; add it"),
            Self::Useless { key, of } => write!(f, "{of} has no key `{key}`; remove it"),
            Self::LegCount { expected, found } => {
                write!(f, "the platform has {found} legs; give {expected}, each in a [[stage.leg]] of its own")
            }
            Self::Coordinates { expected, found } => {
                write!(f, "{found} coordinates are given; give {expected}, in metres")
            }
            Self::StateCount { found } => write!(f, "the actuator has {found} states; give 2 to 4, digit 0 first"),
            Self::Stroke { state, value, before } => write!(
                f,
                "state {state} at {value} is below state {} at {before}: a stroke below zero; give the states in growing order \
                 (digit 0: all outputs off, 1: the first on, 2: the second on, 3: both on). A spring-centred actuator of two \
                 opposed coils is not supported yet",
                state - 1
            ),
            Self::OutputCount { expected, found } => write!(
                f,
                "the actuator has {found} outputs; give {expected}: `output` for two states, two in `outputs` for three or four"
            ),
            Self::SwitchState { state } => {
                write!(
                    f,
                    "the switch is closed in state {state}, which the actuator does not have; correct `closed_in`"
                )
            }
            Self::NoAxis => write!(f, "the axis has no direction; give a vector that is not zero"),
            Self::UnknownLaw { found, known } => {
                write!(f, "there is no law `{found}`; the laws are {}", known.join(", "))
            }
            Self::NoSuchPlace => {
                write!(
                    f,
                    "the effect acts on an actuator, module or state that is missing or does not exist; both count from 0 at the base"
                )
            }
            Self::EffectValues { expected } => write!(f, "the values of this law are {}", expected.join(", ")),
            Self::TooManyEffects { most } => write!(f, "a model holds at most {most} effects; remove some"),
            Self::SameBusId { id, joints: [first, second] } => {
                write!(f, "{first} and {second} have the bus address {id}; give each servo an `id` of its own")
            }
            Self::Servo { id } => write!(
                f,
                "servo {id}: give an `id` of 0 to {}, and `min_deg` below `max_deg` within {:.0} degrees of 0",
                ServoWiring::MAX_ID,
                ServoWiring::MAX_RAD.to_degrees()
            ),
            Self::Wiring(error) => write!(f, "{error}; correct the wiring"),
            Self::Profile(fault) => write!(f, "{fault}"),
            Self::NoPose { word, module, reason } => {
                let reason = reason_of(reason);
                write!(f, "{module} has no pose for the word {word}: {reason}; change its leg lengths, anchors or home")
            }
        }
    }
}

impl std::error::Error for ArmFault {}

/// What is wrong with desired frames, and what to do about it.
#[derive(Clone, Debug, PartialEq)]
pub enum FrameFault {
    /// The file has another format than this program reads.
    Format {
        /// The number in the file.
        found: u32,
    },
    /// The text of a word is no word.
    Word(WordError),
    /// A frame has no word.
    NoWord,
    /// The word has not one digit for each actuator.
    WordLength {
        /// The word.
        word: Word,
        /// Actuators of the arm.
        actuators: usize,
    },
    /// A digit of the word asks for a state that its actuator does not have.
    Digit {
        /// The word.
        word: Word,
        /// The actuator, by its name.
        actuator: String,
        /// How many states it has.
        states: usize,
    },
    /// The frame's word serves another frame already.
    SameWord {
        /// The word.
        word: Word,
        /// The frame that it serves.
        other: String,
    },
    /// A pose has the wrong number of coordinates.
    Coordinates {
        /// How many it has here.
        expected: usize,
        /// How many are given.
        found: usize,
    },
    /// Not one angle for each servo joint.
    ServoCount {
        /// Servo joints of the arm.
        servos: usize,
        /// Angles given.
        found: usize,
    },
    /// A weight has to be above zero.
    Weight(f64),
    /// A bound names an actuator that the arm does not have.
    NoSuchActuator {
        /// Its number.
        actuator: usize,
        /// Actuators of the arm.
        actuators: usize,
    },
    /// A bound is given in the wrong unit.
    BoundUnit {
        /// The actuator, by its name.
        actuator: String,
        /// Whether it turns.
        turns: bool,
    },
    /// A bound leaves nothing.
    EmptyBound {
        /// The actuator, by its name.
        actuator: String,
    },
    /// There is no frame.
    Empty,
}

impl fmt::Display for FrameFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Format { found } => {
                write!(f, "the file has format {found}, this program reads format {}", super::frames::FORMAT)
            }
            Self::Word(error) => write!(f, "{error}; give one digit for each actuator, base first"),
            Self::NoWord => {
                write!(f, "the frame has no word; give one, or have it chosen by --choose-words of `darm synth`")
            }
            Self::WordLength { word, actuators } => {
                write!(f, "the word {word} has {} digits; give {actuators}, one for each actuator", word.len())
            }
            Self::Digit { word, actuator, states } => write!(
                f,
                "the word {word} asks for a state that {actuator} does not have; its digits are 0 to {}",
                states - 1
            ),
            Self::SameWord { word, other } => {
                write!(f, "the word {word} serves {other} already; one word reaches one frame, give another word")
            }
            Self::Coordinates { expected, found } => {
                write!(f, "the position has {found} coordinates; give {expected}, in metres")
            }
            Self::ServoCount { servos, found } => {
                write!(f, "{found} servo angles are given; give {servos}, one for each servo joint")
            }
            Self::Weight(weight) => {
                write!(f, "the weight is {weight}; give a number above zero, or `orientation = \"free\"`")
            }
            Self::NoSuchActuator { actuator, actuators } => {
                write!(f, "there is no actuator {actuator}; give 0 to {}, counted from the base", actuators - 1)
            }
            Self::BoundUnit { actuator, turns } => {
                let unit = if *turns { "deg" } else { "m" };
                write!(f, "bounds of {actuator} are in {unit}; give keys that end in _{unit}")
            }
            Self::EmptyBound { actuator } => {
                write!(f, "the least bound of {actuator} is above the most; exchange them")
            }
            Self::Empty => write!(f, "there is no frame; add a [[frame]]"),
        }
    }
}

impl std::error::Error for FrameFault {}

/// The reason without the number of the stage, for messages that name the stage.
pub(crate) fn reason_of(error: &ChainError) -> String {
    match error {
        ChainError::Platform { reason, .. } => reason.to_string(),
        error => error.to_string(),
    }
}
