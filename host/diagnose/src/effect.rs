//! What a diagnosis names: a law at a place, with its values.

use std::fmt;

use darm_core::effect;
pub use darm_core::effect::Detail;
pub use darm_core::effect::law_name::LawName;
use serde::{Serialize, Serializer};

use crate::number::Number;

/// Where an effect acts. Two effects are at the same place when these are equal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Place {
    /// A part of an arm of discrete actuators, and which number of it.
    Arm(effect::Place, Detail),
    /// The only actuator of a force measurement.
    Actuator,
    /// The only joint of a position measurement.
    SingleJoint,
    /// A joint of a robot, counted from 0.
    Joint(usize),
    /// A motor that drives several joints, counted from 0.
    Motor(usize),
    /// The sum of the motions of a joint and of the one before it.
    JointWithLast(usize),
    /// The difference of the motions of a joint and of the one before it.
    JointAgainstLast(usize),
    /// All joints at once.
    AllJoints,
    /// The link behind a joint, counted from 0.
    Link(usize),
    /// What the tool carries, by the number that the log has for it.
    Payload(u32),
    /// The floating base.
    Base,
    /// The frame that touches.
    Tool,
    /// The force plate.
    ForcePlate,
    /// What measures a tool from outside.
    Instrument,
}

impl Place {
    /// Where an effect of an arm acts.
    pub fn of_arm(effect: &effect::Effect<f64>) -> Self {
        Self::Arm(effect.place(), effect.detail())
    }

    /// The part that it is at, whatever number of it is meant.
    #[must_use]
    pub fn part(&self) -> Self {
        match *self {
            Self::Arm(part, Detail::State(_) | Detail::Anchor(_)) => Self::Arm(part, Detail::All),
            other => other,
        }
    }
}

/// A place with its names.
#[derive(Clone, Debug, Serialize)]
pub struct Site {
    /// The place.
    #[serde(skip)]
    pub place: Place,
    /// The place in files and reports, unambiguous: `actuator 4, state 1`, `joint 3 (elbow)`.
    #[serde(rename = "where")]
    pub code: String,
    /// The place in a sentence.
    #[serde(rename = "place_name")]
    pub name: String,
}

impl Site {
    /// A place whose code serves in sentences as well.
    pub fn new(place: Place, code: impl Into<String>) -> Self {
        let code = code.into();
        Self { place, name: code.clone(), code }
    }
}

impl PartialEq for Site {
    fn eq(&self, other: &Self) -> bool {
        self.place == other.place
    }
}

impl fmt::Display for Site {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.code)
    }
}

/// A law at a place, with its values.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Effect {
    /// The law.
    #[serde(serialize_with = "as_str")]
    pub law: LawName,
    /// Where it acts.
    #[serde(flatten)]
    pub site: Site,
    /// Its values.
    #[serde(rename = "parameters")]
    pub values: Vec<EffectValue>,
    /// By how much the norm of the held-out error is larger without it; `None` where no rows are held out.
    pub held_out_gain: Option<Number>,
}

/// One value of an effect.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EffectValue {
    /// Its name.
    pub name: String,
    /// The value.
    pub value: f64,
    /// Its unit.
    pub unit: String,
    /// Its 95 % confidence interval; `None` of a number that was chosen and not fitted, and of a value that is not the same all the time.
    pub ci95: Option<[f64; 2]>,
    /// Of a quantity that the model has, such as a mass: its value there. The value and its interval are the change from it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nominal: Option<f64>,
}

pub(crate) fn as_str<S: Serializer>(law: &LawName, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(law.as_str())
}
