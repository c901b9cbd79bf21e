//! What can be wrong with what an arm file or a frames file says.

use darm_core::chain::ChainError;
use darm_core::output::{ServoWiring, WiringError};
use darm_core::units::{Word, WordError};

use super::WiringFault;

/// What is wrong with an arm, and what to do about it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ArmFault {
    /// The file has another format than this program reads.
    #[error("{}", unknown_format(*found))]
    Format {
        /// The number in the file.
        found: u32,
    },
    /// The file is none of an arm.
    #[error("the file holds {holds}, and no arm; give the arm file: where a command takes both, it comes first")]
    OtherKind {
        /// What it holds.
        holds: &'static str,
    },
    /// A number has to be above zero, and of a size that can be computed with.
    #[error("{key} is {value}; give a number above zero, at most 1e9")]
    NotPositive {
        /// The key.
        key: &'static str,
        /// The number.
        value: f64,
    },
    /// The arm has no stage, or more than fit.
    #[error("the arm has {found} stages; give 1 to {max}")]
    StageCount {
        /// How many there are.
        found: usize,
        /// How many fit.
        max: usize,
    },
    /// A key is missing.
    #[error("{of} needs the key `{key}`; add it")]
    Missing {
        /// The key.
        key: &'static str,
        /// What it is needed for.
        of: &'static str,
    },
    /// A key is in a place where it has no meaning.
    #[error("{of} has no key `{key}`; remove it")]
    Useless {
        /// The key.
        key: &'static str,
        /// What has no such key.
        of: &'static str,
    },
    /// A platform has the wrong number of legs.
    #[error("the platform has {found} legs; give {expected}, each in a separate [[stage.leg]]")]
    LegCount {
        /// How many its kind has.
        expected: usize,
        /// How many are given.
        found: usize,
    },
    /// A point or pose has the wrong number of coordinates.
    #[error("{found} coordinates are given; give {expected}, in metres")]
    Coordinates {
        /// How many it has here.
        expected: usize,
        /// How many are given.
        found: usize,
    },
    /// An actuator has fewer than two or more than four states.
    #[error("the actuator has {found} states; give 2 to 4, digit 0 first")]
    StateCount {
        /// How many are given.
        found: usize,
    },
    /// A state is shorter than the one before it: its stroke is below zero.
    #[error(
        "state {state} at {value} is below state {} at {before}: a stroke below zero; give the states in growing order \
         (digit 0: all outputs off, 1: the first on, 2: the second on, 3: both on). A spring-centred actuator of two \
         opposed coils is not supported yet",
        .state - 1
    )]
    Stroke {
        /// The state.
        state: usize,
        /// Its value, m or rad.
        value: f64,
        /// The value of the state before, m or rad.
        before: f64,
    },
    /// An actuator with this many states needs another number of outputs.
    #[error(
        "the actuator has {found} outputs; give {expected}: `output` for two states, two in `outputs` for three or four"
    )]
    OutputCount {
        /// How many it needs.
        expected: usize,
        /// How many are given.
        found: usize,
    },
    /// A switch is closed in a state that its actuator does not have.
    #[error("the switch is closed in state {state}, which the actuator does not have; correct `closed_in`")]
    SwitchState {
        /// The state.
        state: u8,
    },
    /// Two keys say what one actuator gives.
    #[error("`{first}` and `{second}` both say what the actuator gives; remove one")]
    TwoStrengths {
        /// One key.
        first: &'static str,
        /// The other.
        second: &'static str,
    },
    /// The rod of a cylinder does not fit its bore.
    #[error("`rod_m` is {rod_m}; give at least 0, and less than `bore_m` = {bore_m}")]
    Rod {
        /// Diameter of the rod, m.
        rod_m: f64,
        /// Diameter of the piston, m.
        bore_m: f64,
    },
    /// The axis of a joint has no direction.
    #[error("the axis has no direction; give a vector that is not zero")]
    NoAxis,
    /// There is no law of this name.
    #[error("there is no law `{found}`; the laws are {}", .known.join(", "))]
    UnknownLaw {
        /// The name in the file.
        found: String,
        /// The names that there are.
        known: Vec<&'static str>,
    },
    /// An effect names an actuator, module, servo or state that the arm does not have.
    #[error(
        "{law}: there is no {what} {number}{}; {}",
        .of.map_or(String::new(), |actuator| format!(" of actuator {actuator}")),
        numbers(*.count, what, *.of)
    )]
    NoSuchPlace {
        /// The law.
        law: &'static str,
        /// `actuator`, `module`, `servo` or `state`.
        what: &'static str,
        /// Its number in the file.
        number: u8,
        /// The actuator of a state.
        of: Option<u8>,
        /// How many there are.
        count: usize,
    },
    /// An effect is to be that of an actuator on itself.
    #[error("interaction: `other` is actuator {actuator} itself; name another actuator")]
    WithItself {
        /// The actuator.
        actuator: u8,
    },
    /// The values of an effect are not those of its law.
    #[error("the values of this law are {}", .expected.join(", "))]
    EffectValues {
        /// The keys that it has.
        expected: Vec<String>,
    },
    /// More effects than a model holds.
    #[error("a model holds at most {max} effects; remove some")]
    TooManyEffects {
        /// How many it holds.
        max: usize,
    },
    /// Two servos answer to one address of the bus.
    #[error("{} and {} have the bus address {id}; give each servo a separate `id`", .joints[0], .joints[1])]
    SameBusId {
        /// The address.
        id: u8,
        /// The two servo joints, by their names.
        joints: [String; 2],
    },
    /// Address or range of a servo are out of bounds.
    #[error(
        "servo {id}: give an `id` of 0 to {}, and `min_deg` below `max_deg` within {:.0} degrees of 0",
        ServoWiring::MAX_ID,
        ServoWiring::MAX_RAD.to_degrees()
    )]
    Servo {
        /// The address.
        id: u8,
    },
    /// Two actuators name one output, or one actuator names it twice.
    #[error("output {output} feeds both {first} and {second}; give each an output that nothing else uses")]
    OutputTwice {
        /// The output.
        output: u8,
        /// One actuator, by its number and name.
        first: String,
        /// The other.
        second: String,
    },
    /// No board could drive the arm: an output does not exist, or there are too many.
    #[error("{0}; correct the wiring")]
    Wiring(WiringError),
    /// The profile of the board does not fit the arm.
    #[error("{0}")]
    Profile(WiringFault),
    /// The arm has no pose for a word that it must be able to take.
    #[error(
        "{module} has no pose for the word {word}: {}; change its leg lengths, anchors or home",
        reason_of(.reason)
    )]
    NoPose {
        /// The word.
        word: Word,
        /// The module that is at fault, by its name.
        module: String,
        /// Why.
        reason: ChainError,
    },
}

/// What is wrong with desired frames, and what to do about it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FrameFault {
    /// The file has another format than this program reads.
    #[error("the file has format {found}, this program reads format {}", super::frames::FORMAT)]
    Format {
        /// The number in the file.
        found: u32,
    },
    /// The text of a word is no word.
    #[error("{0}; give one digit for each actuator, base first")]
    Word(WordError),
    /// A frame has no word.
    #[error("the frame has no word; give one, or have it chosen by --choose-words of `darm synth`")]
    NoWord,
    /// The word has not one digit for each actuator.
    #[error("the word {word} has {} digits; give {actuators}, one for each actuator", .word.len())]
    WordLength {
        /// The word.
        word: Word,
        /// Actuators of the arm.
        actuators: usize,
    },
    /// A digit of the word asks for a state that its actuator does not have.
    #[error("the word {word} asks for a state that {actuator} does not have; its digits are 0 to {}", .states - 1)]
    Digit {
        /// The word.
        word: Word,
        /// The actuator, by its name.
        actuator: String,
        /// How many states it has.
        states: usize,
    },
    /// The frame's word serves another frame already.
    #[error("the word {word} serves {other} already; one word reaches one frame, give another word")]
    SameWord {
        /// The word.
        word: Word,
        /// The frame that it serves.
        other: String,
    },
    /// A pose has the wrong number of coordinates.
    #[error("the position has {found} coordinates; give {expected}, in metres")]
    Coordinates {
        /// How many it has here.
        expected: usize,
        /// How many are given.
        found: usize,
    },
    /// Not one angle for each servo joint.
    #[error("{found} servo angles are given; give {servos}, one for each servo joint")]
    ServoCount {
        /// Servo joints of the arm.
        servos: usize,
        /// Angles given.
        found: usize,
    },
    /// A weight has to be above zero.
    #[error("the weight is {0}; give a number above zero, or `orientation = \"free\"`")]
    Weight(f64),
    /// A bound names an actuator that the arm does not have.
    #[error("there is no actuator {actuator}; give 0 to {}, counted from the base", .actuators - 1)]
    NoSuchActuator {
        /// Its number.
        actuator: usize,
        /// Actuators of the arm.
        actuators: usize,
    },
    /// A bound names a state that the actuator does not have.
    #[error("{actuator} has no state {state}; give 0 to {}", states.saturating_sub(1))]
    NoSuchState {
        /// The actuator, by its name.
        actuator: String,
        /// The state.
        state: u8,
        /// States of the actuator.
        states: usize,
    },
    /// A bound is given in the wrong unit.
    #[error("bounds of {actuator} are in {}; give keys that end in _{}", unit(*turns), unit(*turns))]
    BoundUnit {
        /// The actuator, by its name.
        actuator: String,
        /// Whether it turns.
        turns: bool,
    },
    /// A bound leaves nothing.
    #[error("the least bound of {actuator} is above the most; exchange them")]
    EmptyBound {
        /// The actuator, by its name.
        actuator: String,
    },
    /// There is no frame.
    #[error("there is no frame; add a [[frame]]")]
    Empty,
}

fn unknown_format(found: u32) -> String {
    format!("the file has format {found}, this program reads format {}", super::FORMAT)
}

/// Which numbers there are of something: of an arm, or of one of its actuators.
fn numbers(count: usize, what: &str, of: Option<u8>) -> String {
    match count {
        0 => format!("the arm has no {what}"),
        count if of.is_some() => format!("give 0 to {}", count - 1),
        count => format!("give 0 to {}, counted from the base", count - 1),
    }
}

fn unit(turns: bool) -> &'static str {
    if turns { "deg" } else { "m" }
}

/// The reason without the number of the stage, for messages that name the stage.
pub(crate) fn reason_of(error: &ChainError) -> String {
    match error {
        ChainError::Platform { reason, .. } => reason.to_string(),
        error => error.to_string(),
    }
}
