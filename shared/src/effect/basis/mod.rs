//! Laws along one coordinate: what a joint's torque, an actuator's force or a held position has beyond its ideal.
//!
//! ```text
//! measured = ideal + Σ coefficient · basis(sample, memory)
//! ```
//!
//! One file a law. A law is a basis function, with at most one parameter of its shape that no linear fit finds, and a
//! coefficient that a fit determines; a [`Term`] is both. What a law remembers of earlier samples is in a [`Memory`] that the caller owns, so
//! the same source runs row by row over a measurement and tick by tick on the chip.
//!
//! A new law is one file and its line in the list below.

pub mod backlash;
pub mod backlash_by_load;
pub mod compliance;
pub mod coulomb_friction;
pub mod delay;
pub mod friction_wear;
pub mod gain;
pub mod hysteresis;
pub mod load_dependent_friction;
pub mod load_dependent_presliding;
pub mod load_dependent_viscosity;
pub mod offset;
pub mod offset_drift;
pub mod periodic_cosine;
pub mod periodic_sine;
pub mod position_dependent_friction;
pub mod presliding_friction;
pub mod rotor_inertia;
pub mod speed_dependent_offset;
pub mod spring;
pub mod step_in_time;
pub mod stribeck_friction;
pub mod thermal_drift;
pub mod thermal_viscosity;
pub mod viscous_friction;

use super::law_name::LawName;
use crate::real::{Real, exp, real};

/// A law along one coordinate.
pub trait BasisLaw<T: Real> {
    /// The law's name.
    fn name(&self) -> LawName;

    /// What the coefficient is called.
    fn coefficient(&self) -> &'static str;

    /// The coefficient's unit: that of the force (or of the position, where it is held), divided by these.
    fn per(&self) -> &'static [Per];

    /// The parameter of its shape that a linear fit does not find.
    fn shape_parameter(&self) -> Option<ShapeParameter<T>> {
        None
    }

    /// Whether a drive that moves the coordinate never needs less force because of the law: its coefficient is then never negative.
    fn takes_power(&self) -> bool {
        false
    }

    /// What a coefficient of one adds at this sample; `memory` is this law's own, and zero where a motion begins.
    fn basis(&self, now: &CoordinateSample<T>, memory: &mut Memory<T>) -> T;
}

/// What a coefficient is divided by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Per {
    /// Nothing.
    One,
    /// m or rad.
    Length,
    /// m/s or rad/s.
    Speed,
    /// m/s² or rad/s².
    Acceleration,
    /// s.
    Time,
    /// The unit of the load.
    Load,
    /// The unit of the load, each second.
    LoadRate,
    /// K.
    Kelvin,
}

/// A parameter of the shape of a law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeParameter<T> {
    /// Its name.
    pub name: &'static str,
    /// The number.
    pub value: T,
    /// Its unit.
    pub per: Per,
}

/// A coordinate at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoordinateSample<T: Real> {
    /// Position, m or rad.
    pub position: T,
    /// Velocity, m/s or rad/s.
    pub velocity: T,
    /// Acceleration, m/s² or rad/s².
    pub acceleration: T,
    /// Time since the measurement began, s.
    pub time_s: T,
    /// What the coordinate bears: a torque, a pressure, a current, in the caller's unit.
    pub load: T,
    /// Its rate, in that unit per s.
    pub load_rate: T,
    /// Temperature less that of reference, K.
    pub temperature_rise_k: T,
}

impl<T: Real> Default for CoordinateSample<T> {
    /// At rest at zero, unloaded.
    fn default() -> Self {
        let zero = T::zero();
        Self {
            position: zero,
            velocity: zero,
            acceleration: zero,
            time_s: zero,
            load: zero,
            load_rate: zero,
            temperature_rise_k: zero,
        }
    }
}

/// What a law remembers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Memory<T: Real> {
    /// What it followed one sample ago; `None` at the start.
    pub before: Option<T>,
    /// What came of it.
    pub state: T,
}

impl<T: Real> Default for Memory<T> {
    fn default() -> Self {
        Self { before: None, state: T::zero() }
    }
}

impl<T: Real> Memory<T> {
    /// z with dz = (sign(dx) − z)·|dx|/d: the way that the last few `distance` went.
    pub fn presliding_state(&mut self, position: T, distance: T) -> T {
        let step = self.before.map_or(T::zero(), |before| position - before);
        if step != T::zero() {
            let way = step.signum();
            self.state = way + (self.state - way) * exp(-step.abs() / distance);
        }
        self.before = Some(position);
        self.state
    }

    /// The play operator: what follows `input` with a slack of this half width.
    pub fn play(&mut self, input: T, half_width: T) -> T {
        let last = if self.before.is_some() { self.state } else { input };
        self.before = Some(input);
        self.state = last.max(input - half_width).min(input + half_width);
        self.state
    }

    /// The length of the path so far.
    pub fn path_length(&mut self, position: T) -> T {
        self.state += self.before.map_or(T::zero(), |before| (position - before).abs());
        self.before = Some(position);
        self.state
    }
}

macro_rules! laws {
    ($($law:ident $(<$t:ident> { $constant:ident })? in $file:ident,)+) => {
        /// Any of the laws.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum Law<T: Real> {
            $(#[doc = concat!("See [`", stringify!($file), "`].")] $law($file::$law $(<$t>)?),)+
        }

        impl<T: Real> Law<T> {
            /// The law.
            pub fn basis_law(&self) -> &dyn BasisLaw<T> {
                match self {
                    $(Self::$law(law) => law,)+
                }
            }
        }

        impl Law<f64> {
            /// The law with this name, and with this constant where it has one; `None` where there is none such.
            pub fn named(name: LawName, constant: Option<f64>) -> Option<Self> {
                let all = [$(laws!(@new constant $file $law $($constant)?)),+];
                all.into_iter().flatten().find(|law| law.basis_law().name() == name)
            }

            /// The same law in numbers of type `U`.
            pub fn cast<U: Real>(&self) -> Law<U> {
                match self {
                    $(Self::$law(law) => laws!(@cast law $file $law $($constant)?),)+
                }
            }
        }
    };
    (@cast $own:ident $file:ident $law:ident) => { Law::$law(*$own) };
    (@cast $own:ident $file:ident $law:ident $constant:ident) => {
        Law::$law($file::$law { $constant: real($own.$constant) })
    };
    (@new $value:ident $file:ident $law:ident) => {
        match $value { None => Some(Law::$law($file::$law)), Some(_) => None }
    };
    (@new $value:ident $file:ident $law:ident $constant:ident) => {
        $value.map(|$constant| Law::$law($file::$law { $constant }))
    };
}

laws! {
    Offset in offset,
    Spring in spring,
    OffsetDrift in offset_drift,
    StepInTime<T> { at_s } in step_in_time,
    ViscousFriction in viscous_friction,
    CoulombFriction<T> { creep_speed } in coulomb_friction,
    StribeckFriction<T> { fall_speed } in stribeck_friction,
    PreslidingFriction<T> { distance } in presliding_friction,
    PositionDependentFriction<T> { distance } in position_dependent_friction,
    LoadDependentFriction<T> { creep_speed } in load_dependent_friction,
    LoadDependentPresliding<T> { distance } in load_dependent_presliding,
    LoadDependentViscosity in load_dependent_viscosity,
    SpeedDependentOffset in speed_dependent_offset,
    RotorInertia in rotor_inertia,
    Gain in gain,
    Delay in delay,
    ThermalDrift in thermal_drift,
    ThermalViscosity in thermal_viscosity,
    FrictionWear<T> { creep_speed } in friction_wear,
    PeriodicSine<T> { per_turn } in periodic_sine,
    PeriodicCosine<T> { per_turn } in periodic_cosine,
    Backlash<T> { distance } in backlash,
    BacklashByLoad<T> { seating } in backlash_by_load,
    Compliance in compliance,
    Hysteresis<T> { half_width } in hysteresis,
}

/// A law with its coefficient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Term<T: Real> {
    /// The law.
    pub law: Law<T>,
    /// Its coefficient, in the unit that [`BasisLaw::per`] gives.
    pub coefficient: T,
}

impl<T: Real> Term<T> {
    /// What the law adds at this sample.
    pub fn at(&self, now: &CoordinateSample<T>, memory: &mut Memory<T>) -> T {
        self.coefficient * self.law.basis_law().basis(now, memory)
    }
}

impl Term<f64> {
    /// The same term in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> Term<U> {
        Term { law: self.law.cast(), coefficient: real(self.coefficient) }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec::Vec;

    use proptest::prelude::*;

    use super::*;
    use crate::arms::seeded;

    fn laws() -> Vec<Law<f64>> {
        let law = |name: &LawName| Law::named(*name, None).or(Law::named(*name, Some(0.3)));
        LawName::ALL.iter().filter_map(law).collect()
    }

    #[test]
    fn laws_are_found_by_their_names_and_only_by_them() {
        assert_eq!(laws().len(), 25);
        for law in laws() {
            let (name, constant) = (law.basis_law().name(), law.basis_law().shape_parameter().map(|_| 0.3));
            assert_eq!(Law::named(name, constant), Some(law));
            assert_eq!(Law::named(name, if constant.is_some() { None } else { Some(0.3) }), None);
        }
    }

    proptest! {
        #![proptest_config(seeded(64))]

        /// Shapes of single precision lie within what the roundings of a few operations on numbers up to 9 leave:
        /// 32 ε relative to the largest product, and the memories forget what was rounded before.
        #[test]
        fn single_precision_tells_the_same(rows in prop::collection::vec(prop::array::uniform7(-3.0f64..3.0), 1..30)) {
            for law in laws() {
                let (mut fine, mut coarse) = (Memory::default(), Memory::default());
                for row in &rows {
                    let row = row.map(|number| f64::from(number as f32));
                    let [position, velocity, acceleration, time_s, load, load_rate, temperature_rise_k] = row;
                    let now =
                        CoordinateSample { position, velocity, acceleration, time_s, load, load_rate, temperature_rise_k };
                    let [position, velocity, acceleration, time_s, load, load_rate, temperature_rise_k] =
                        row.map(|number| number as f32);
                    let on_chip =
                        CoordinateSample { position, velocity, acceleration, time_s, load, load_rate, temperature_rise_k };
                    let exact = Term { law, coefficient: 2.0 }.at(&now, &mut fine);
                    let rounded = Term { law, coefficient: 2.0 }.cast::<f32>().at(&on_chip, &mut coarse);
                    let bound = 32.0 * f64::from(f32::EPSILON) * (20.0 + exact.abs());
                    prop_assert!((exact - f64::from(rounded)).abs() <= bound, "{law:?} {exact} {rounded}");
                }
            }
        }

        #[test]
        fn friction_takes_power_and_never_gives_any(v in -5.0f64..5.0, load in -5.0f64..5.0) {
            let now = CoordinateSample { velocity: v, load, ..CoordinateSample::default() };
            for name in [
                LawName::ViscousFriction,
                LawName::CoulombFriction,
                LawName::StribeckFriction,
                LawName::LoadDependentFriction,
            ] {
                let law = Law::named(name, None).or(Law::named(name, Some(0.1))).unwrap();
                prop_assert!(law.basis_law().basis(&now, &mut Memory::default()) * v >= 0.0, "{name}");
            }
        }
    }
}
