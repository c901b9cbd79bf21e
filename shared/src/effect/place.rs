//! Where an effect acts, and the conditions that it acts under.

use super::fitted_term::VariableName;
use crate::actuator::JointKind;
use crate::real::{Real, real};
use crate::units::Word;

/// What a law acts on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Place {
    /// The actuator with this index.
    Actuator(u8),
    /// All actuators of the stage with this index.
    Module(u8),
    /// All actuators of the arm.
    Arm,
    /// The servo joint with this index.
    Servo(u8),
    /// The pose of the arm.
    Base,
    /// What the last stage carries.
    Tool,
    /// What looks at the tool.
    Camera,
}

/// Which number of a place a law changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Detail {
    /// All that the place has.
    All,
    /// The stroke in one state.
    State(u8),
    /// The anchor on one plate.
    Anchor(Plate),
    /// What another actuator, the one with this index, does to it.
    With(u8),
    /// What depends on one variable, or on its square.
    Term {
        /// The variable.
        of: VariableName,
        /// Whether on its square.
        square: bool,
    },
}

/// What one value of a law is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Quantity {
    /// Its name.
    pub name: &'static str,
    /// Its unit; `1` for a plain number.
    pub unit: &'static str,
}

/// What is commanded, and what surrounds the arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Condition<'a, T: Real> {
    /// The digits of all discrete actuators.
    pub word: Word,
    /// The word before it; `None` when the arm has just been switched on.
    pub previous: Option<Word>,
    /// The positions of the servo joints, rad or m.
    pub servos: &'a [T],
    /// The supply, in the unit of the model's nominal one.
    pub supply: T,
    /// The temperature of the arm, K.
    pub temperature_k: T,
    /// Time since the measurement began, s; `None` outside of one.
    pub time_s: Option<T>,
    /// How often each actuator has switched since then; empty outside of one.
    pub switches: &'a [T],
    /// Time since the row that switched each actuator last, s; empty outside of one.
    pub dwell_s: &'a [T],
    /// What the tool carries in addition to the model's payload, at that payload's centre of mass, kg.
    pub load_kg: T,
}

/// What had come to an arm at the end of a measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct End<'a, T: Real> {
    /// Time since the measurement began, s.
    pub time_s: T,
    /// How often each actuator had switched.
    pub switches: &'a [T],
    /// Dwell time of the actuators that did not switch, median over all rows, s.
    pub dwell_s: T,
}

impl<T: Real> Condition<'_, T> {
    /// A word alone, of an arm without servos: no word before, a supply of 1 and 293.15 K as of an ideal arm.
    pub fn of_word(word: Word) -> Self {
        Self {
            word,
            previous: None,
            servos: &[],
            supply: T::one(),
            temperature_k: real(293.15),
            time_s: None,
            switches: &[],
            dwell_s: &[],
            load_kg: T::zero(),
        }
    }
}

/// One actuator and the conditions that it is under.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Site<T: Real> {
    /// Index of the stage.
    pub stage: usize,
    /// Index of the actuator in the arm.
    pub actuator: usize,
    /// Whether the actuator slides, as every leg does, or turns.
    pub kind: JointKind,
    /// Its state.
    pub digit: u8,
    /// Its state in the word before; `None` when that is not known.
    pub previous: Option<u8>,
    /// Its ideal value in this state less that in state 0, m or rad.
    pub stroke: T,
    /// Supply over nominal supply, less one.
    pub supply_deviation: T,
    /// Temperature less reference temperature, K.
    pub temperature_rise_k: T,
    /// Time since the measurement began, s; `None` where it is not known.
    pub time_s: Option<T>,
    /// How often the actuator has switched since then; `None` where it was not counted.
    pub switches: Option<T>,
    /// Time since the row that switched it last, s; `None` where it is not known.
    pub dwell_s: Option<T>,
    /// The digits of all actuators; `None` where they are not known.
    pub word: Option<Word>,
    /// How many others of its stage have another digit than in the word before.
    pub together: u8,
}

impl<T: Real> Default for Site<T> {
    /// Actuator 0 of stage 0, a contracted leg, at nominal conditions, with no word before.
    fn default() -> Self {
        Self {
            stage: 0,
            actuator: 0,
            kind: JointKind::Prismatic,
            digit: 0,
            previous: None,
            stroke: T::zero(),
            supply_deviation: T::zero(),
            temperature_rise_k: T::zero(),
            time_s: None,
            switches: None,
            dwell_s: None,
            word: None,
            together: 0,
        }
    }
}

impl Place {
    /// Whether it is one actuator or several.
    pub fn is_actuators(&self) -> bool {
        matches!(self, Self::Actuator(_) | Self::Module(_) | Self::Arm)
    }

    /// Whether an actuator is one of those meant.
    pub fn holds<T: Real>(&self, site: &Site<T>) -> bool {
        match self {
            Self::Actuator(actuator) => site.actuator == usize::from(*actuator),
            Self::Module(stage) => site.stage == usize::from(*stage),
            Self::Arm => true,
            Self::Servo(_) | Self::Base | Self::Tool | Self::Camera => false,
        }
    }
}

/// A plate of a platform.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Plate {
    /// The plate that the legs stand on.
    Base,
    /// The plate that the legs carry.
    Top,
}

/// A frame at an end of the arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frame {
    /// The pose of the arm in the camera's frame.
    Base,
    /// What the camera follows.
    Tool,
}
