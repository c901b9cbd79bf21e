//! Physical effects that move an arm off its ideal geometry: one law per file, all behind one interface.
//!
//! A law acts through two hooks. Before the arm is assembled, [`Law::disturb`] changes what an actuator is set to (its
//! anchors and its length) under the conditions at its [`Site`]. When the arm stands, [`Law::deflection`] tells by how
//! much a loaded actuator gives way; then the arm is assembled anew. Effects add up in the order of their list.
//!
//! A fitter treats all laws alike: by name, place, and values with names and units.
//!
//! A new law is one file and its line in the list below.

pub mod along;
pub mod anchor_offset;
pub mod gravity_sag;
pub mod play;
pub mod stroke_loss;
pub mod supply_stroke;
pub mod thermal_growth;

use crate::actuator::{JointKind, Setting};
use crate::real::Real;

/// A law of how an actuator departs from what it is set to.
pub trait Law<T: Real> {
    /// The law's name, in kebab-case.
    fn name(&self) -> &'static str;

    /// Which actuators it acts on.
    fn place(&self) -> Place;

    /// What each of the values is.
    fn quantities(&self) -> &'static [Quantity];

    /// The numbers that a fit determines; all zero, the law does nothing.
    fn values(&self) -> &[T];

    /// The same, to change them.
    fn values_mut(&mut self) -> &mut [T];

    /// Changes what the actuator at `site` is set to. Only called within [`place`](Self::place).
    fn disturb(&self, _site: &Site<T>, _setting: &mut Setting<T>) {}

    /// By how much the value of the actuator at `site` grows when it pushes with `force`, N, in compression. Only
    /// called within [`place`](Self::place), and where [`bears_load`](Self::bears_load).
    fn deflection(&self, _site: &Site<T>, _force: T) -> T {
        T::zero()
    }

    /// Whether the law has a [`deflection`](Self::deflection), so that the forces are worth computing.
    fn bears_load(&self) -> bool {
        false
    }
}

/// Which actuators a law acts on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Place {
    /// The one with this index.
    Actuator(u8),
    /// All of the stage with this index.
    Module(u8),
    /// All of the arm.
    Arm,
}

/// What one value of a law is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Quantity {
    /// Its name.
    pub name: &'static str,
    /// Its unit; `1` for a plain number.
    pub unit: &'static str,
}

/// One actuator and the conditions that it stands under.
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
        }
    }
}

impl Place {
    /// Whether an actuator is one of those meant.
    pub fn holds<T: Real>(&self, site: &Site<T>) -> bool {
        match self {
            Self::Actuator(actuator) => site.actuator == usize::from(*actuator),
            Self::Module(stage) => site.stage == usize::from(*stage),
            Self::Arm => true,
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
    StrokeLoss in stroke_loss,
    AnchorOffset in anchor_offset,
    GravitySag in gravity_sag,
    Play in play,
    SupplyStroke in supply_stroke,
    ThermalGrowth in thermal_growth,
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::actuator::Setting;
    use crate::real::Vec3;

    fn one_of_each() -> [Effect<f64>; 6] {
        let at = Place::Module(1);
        [
            stroke_loss::StrokeLoss { actuator: 4, state: 1, loss_m: 1e-3 }.into(),
            anchor_offset::AnchorOffset {
                actuator: 4,
                plate: anchor_offset::Plate::Top,
                offset: Vec3::new(1e-3, 2e-3, 3e-3),
            }
            .into(),
            gravity_sag::GravitySag { at, compliance_m_per_n: 1e-5 }.into(),
            play::Play { at, width_m: 1e-3 }.into(),
            supply_stroke::SupplyStroke { at, gain: 0.1 }.into(),
            thermal_growth::ThermalGrowth { at, expansion_per_k: 1e-5 }.into(),
        ]
    }

    fn site() -> Site<f64> {
        Site {
            stage: 1,
            actuator: 4,
            digit: 1,
            previous: Some(1),
            stroke: 0.25,
            supply_deviation: -0.1,
            temperature_rise_k: 10.0,
            ..Site::default()
        }
    }

    #[test]
    fn values_of_zero_do_nothing() {
        for mut effect in one_of_each() {
            effect.law_mut().values_mut().fill(0.0);
            let (before, mut after) = (Setting::of_joint(1.25), Setting::of_joint(1.25));
            effect.law().disturb(&site(), &mut after);
            assert_eq!(after, before, "{}", effect.law().name());
            assert_eq!(effect.law().deflection(&site(), 100.0), 0.0);
        }
    }

    #[test]
    fn every_law_does_something_by_one_of_its_hooks() {
        for effect in one_of_each() {
            let (before, mut after) = (Setting::of_joint(1.25), Setting::of_joint(1.25));
            let law = effect.law();
            law.disturb(&site(), &mut after);
            assert!((after != before) ^ (law.deflection(&site(), 100.0) != 0.0), "{}", law.name());
            assert_eq!(law.bears_load(), after == before);
        }
    }

    #[test]
    fn every_value_has_a_name_and_a_unit() {
        for effect in one_of_each() {
            let law = effect.law();
            assert_eq!(law.values().len(), law.quantities().len());
            assert!(law.name().chars().all(|c| c.is_ascii_lowercase() || c == '-'));
            assert!(law.place().holds(&site()) && !law.place().holds(&Site::<f64>::default()));
        }
    }
}
