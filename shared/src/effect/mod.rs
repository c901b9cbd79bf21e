//! Physical effects that move an arm off its ideal geometry: one law per file, all behind one interface.
//!
//! A law acts through one of four hooks. Before the arm is assembled, [`Law::disturb`] changes what an actuator is set to
//! (its anchors and its length) under the conditions at its [`Site`], and [`Law::turn`] a servo joint. When the arm
//! is assembled, [`Law::deflection`] gives by how much a loaded actuator gives way; then the arm is assembled again.
//! [`Law::displace`] moves the tool rigidly, as the camera sees it under a condition. Effects add up in the order of
//! their list.
//!
//! Arm files, the diagnosis and its reports treat all laws alike: by name, place, constant, and values with names and
//! units.
//!
//! A new law is one file, its line in the list of [`Effect`] and its name in [`law_name`]. Laws of a joint's torque, an
//! actuator's force or a held position are in [`basis`].

pub mod anchor_offset;
pub mod base_drift;
pub mod base_step;
pub mod basis;
pub mod creep;
pub mod crowding;
pub mod drift;
pub mod fitted_term;
pub mod frame_offset;
pub mod gravity_sag;
pub mod interaction;
pub mod joint_offset;
pub mod law_name;
pub mod length_offset;
pub mod play;
pub mod scale;
pub mod step;
pub mod stroke_loss;
pub mod supply_stroke;
pub mod thermal_growth;
pub mod wear;

use crate::actuator::{JointKind, Setting};
use crate::real::{Real, real};
use crate::se::Pose;
use crate::units::Word;
use anchor_offset::Plate;
use fitted_term::VariableName;
use law_name::LawName;

/// A law of how an actuator departs from what it is set to.
pub trait Law<T: Real> {
    /// The law at a place, its values and its constant at zero; `None` where it does not act.
    fn at(place: Place, detail: Detail) -> Option<Self>
    where
        Self: Sized;

    /// The law's name.
    fn name(&self) -> LawName;

    /// Which actuators it acts on.
    fn place(&self) -> Place;

    /// Which number of the place it changes.
    fn detail(&self) -> Detail {
        Detail::All
    }

    /// What each of the values is.
    fn quantities(&self) -> &'static [Quantity];

    /// The numbers that a fit determines; all zero, the law does nothing.
    fn values(&self) -> &[T];

    /// The same, to change them.
    fn values_mut(&mut self) -> &mut [T];

    /// The number in the law that is given and not fitted, as the moment of a step is.
    fn constant(&self) -> Option<(Quantity, T)> {
        None
    }

    /// The same, to change it.
    fn constant_mut(&mut self) -> Option<&mut T> {
        None
    }

    /// Keeps what the law had come to where the measurement that it was fitted to ended.
    fn settle(&mut self, _end: &End<T>) {}

    /// Changes what the actuator at `site` is set to. Only called within [`place`](Self::place).
    fn disturb(&self, _site: &Site<T>, _setting: &mut Setting<T>) {}

    /// By how much the value of the actuator at `site` grows when it pushes with `force`, N, in compression. Only
    /// called within [`place`](Self::place), and where [`bears_load`](Self::bears_load).
    fn deflection(&self, _site: &Site<T>, _force: T) -> T {
        T::zero()
    }

    /// Changes the position of the servo joint at [`place`](Self::place).
    fn turn(&self, _setting: &mut Setting<T>) {}

    /// The pose of the tool in the base as it is seen, where the arm alone would have it `predicted`.
    fn displace(&self, predicted: Pose<T>, _condition: &Condition<T>) -> Pose<T> {
        predicted
    }

    /// Whether the law has a [`deflection`](Self::deflection), so that the forces are worth computing.
    fn bears_load(&self) -> bool {
        false
    }
}

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

macro_rules! effects {
    ($($law:ident in $file:ident,)+) => {
        /// One effect in an arm: any of the laws, with its place and values.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum Effect<T: Real> {
            $(#[doc = concat!("See [`", stringify!($file), "`].")] $law($file::$law<T>),)+
        }

        impl<T: Real> Effect<T> {
            /// Each law at a place, its values and its constant at zero; `None` where it does not act.
            pub const EACH_AT: &[fn(Place, Detail) -> Option<Self>] =
                &[$(|place, detail| $file::$law::at(place, detail).map(Self::$law)),+];

            /// The law.
            pub fn law(&self) -> &dyn Law<T> {
                match self {
                    $(Self::$law(law) => law,)+
                }
            }

            /// The law, to change its values.
            pub fn law_mut(&mut self) -> &mut dyn Law<T> {
                match self {
                    $(Self::$law(law) => law,)+
                }
            }
        }

        impl Effect<f64> {
            /// The same effect in numbers of type `U`.
            pub fn cast<U: Real>(&self) -> Effect<U> {
                match self {
                    $(Self::$law(law) => Effect::$law(law.cast()),)+
                }
            }
        }

        $(impl<T: Real> From<$file::$law<T>> for Effect<T> {
            fn from(law: $file::$law<T>) -> Self {
                Self::$law(law)
            }
        })+
    };
}

effects! {
    GravitySag in gravity_sag,
    Play in play,
    SupplyStroke in supply_stroke,
    ThermalGrowth in thermal_growth,
    Drift in drift,
    Crowding in crowding,
    FrameOffset in frame_offset,
    BaseDrift in base_drift,
    Scale in scale,
    JointOffset in joint_offset,
    StrokeLoss in stroke_loss,
    Wear in wear,
    Step in step,
    LengthOffset in length_offset,
    Interaction in interaction,
    Creep in creep,
    BaseStep in base_step,
    AnchorOffset in anchor_offset,
    FittedTerm in fitted_term,
}

impl<T: Real> Effect<T> {
    /// The law of this name at a place, its values and its constant at zero; `None` where it does not act.
    pub fn at(name: LawName, place: Place, detail: Detail) -> Option<Self> {
        Self::EACH_AT.iter().filter_map(|at| at(place, detail)).find(|effect| effect.law().name() == name)
    }
}

#[cfg(test)]
mod tests;
