//! Laws along one coordinate: what a joint's torque, an actuator's force or a held position has beyond its ideal.
//!
//! ```text
//! measured = ideal + Σ coefficient · basis(sample, memory)
//! ```
//!
//! A law is a basis function, with at most one parameter of its shape that no linear fit finds, and a coefficient that a fit
//! determines; a [`Term`] is both. What a law remembers of earlier samples is in a [`Memory`] that the caller owns, so that the
//! same source runs row by row over a measurement and tick by tick on the chip.
//!
//! A new law is a row of the table [`Law`], its equation in [`Law::basis`], and its name in [`LawName`].
//!
//! Symbols: x, v, a position (m or rad), velocity and acceleration of the coordinate; t time since the measurement began, s; L
//! what the coordinate bears, in the caller's unit; Δϑ temperature less that of reference, K.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::basis::{CoordinateSample, Law, Memory};
//! let law = Law::CoulombFriction(0.01);
//! let now = CoordinateSample { velocity: -1.0, ..CoordinateSample::default() };
//! assert!((law.basis(&now, &mut Memory::default()) - (-1.0f64)).abs() < 1e-12);
//! ```

use super::law_name::LawName;
use crate::real::{Real, cos, exp, real, sin, tanh};

/// What a coefficient, or the parameter of a shape, is measured in: a coefficient in the unit of the force (or of the position,
/// where it is held) divided by these.
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

/// The parameter of the shape of a law.
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
    /// z with dz = (sign(dx) − z)·|dx|/d, the way that the last few `distance` went: −1 after going down by several d, +1 after
    /// going up, 0 at the start. Solved exactly for a motion that keeps its way between two samples.
    pub fn presliding_state(&mut self, position: T, distance: T) -> T {
        let step = self.before.map_or(T::zero(), |before| position - before);
        if step != T::zero() {
            let way = step.signum();
            self.state = way + (self.state - way) * exp(-step.abs() / distance);
        }
        self.before = Some(position);
        self.state
    }

    /// The play operator p = min(max(p, L − w), L + w): what follows `input` with a slack of this half width, from the input
    /// itself on.
    pub fn play(&mut self, input: T, half_width: T) -> T {
        let last = if self.before.is_some() { self.state } else { input };
        self.before = Some(input);
        self.state = last.max(input - half_width).min(input + half_width);
        self.state
    }

    /// The length of the path so far, ∫|dx|.
    pub fn path_length(&mut self, position: T) -> T {
        self.state += self.before.map_or(T::zero(), |before| (position - before).abs());
        self.before = Some(position);
        self.state
    }
}

/// A row: documentation, name (name and unit of the shape's parameter), what the coefficient is called, what it is divided by.
macro_rules! laws {
    ($($(#[$doc:meta])* $law:ident $(($type:ident: $shape:literal, $unit:ident))? : $coefficient:literal / [$($per:ident),*];)+) => {
        /// A law, with the parameter of its shape where it has one.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum Law<T: Real> {
            $($(#[$doc])* $law $(($type))?,)+
        }

        impl<T: Real> Law<T> {
            /// The law's name.
            pub fn name(&self) -> LawName {
                match self {
                    $(Self::$law { .. } => LawName::$law,)+
                }
            }

            /// What the coefficient is called.
            pub fn coefficient(&self) -> &'static str {
                match self {
                    $(Self::$law { .. } => $coefficient,)+
                }
            }

            /// The coefficient's unit: that of the force (or of the position, where it is held), divided by these.
            pub fn per(&self) -> &'static [Per] {
                match self {
                    $(Self::$law { .. } => &[$(Per::$per),*],)+
                }
            }

            /// The parameter of its shape that a linear fit does not find.
            pub fn shape_parameter(&self) -> Option<ShapeParameter<T>> {
                match *self {
                    $($(Self::$law(value) => Some(ShapeParameter { name: $shape, value, per: Per::$unit }),)?)+
                    _ => None,
                }
            }
        }

        impl Law<f64> {
            /// The law with this name, and with this constant where it has one; `None` where there is none such.
            pub fn named(name: LawName, constant: Option<f64>) -> Option<Self> {
                match (name, constant) {
                    $(laws!(@pattern $($shape)? $law constant) => Some(laws!(@value $($shape)? $law constant)),)+
                    _ => None,
                }
            }

            /// The same law in numbers of type `U`.
            pub fn cast<U: Real>(&self) -> Law<U> {
                match *self {
                    $(laws!(@own $($shape)? $law constant) => laws!(@cast $($shape)? $law constant),)+
                }
            }
        }
    };
    (@pattern $law:ident $constant:ident) => { (LawName::$law, None) };
    (@pattern $shape:literal $law:ident $constant:ident) => { (LawName::$law, Some($constant)) };
    (@value $law:ident $constant:ident) => { Law::$law };
    (@value $shape:literal $law:ident $constant:ident) => { Law::$law($constant) };
    (@own $law:ident $constant:ident) => { Law::$law };
    (@own $shape:literal $law:ident $constant:ident) => { Law::$law($constant) };
    (@cast $law:ident $constant:ident) => { Law::$law };
    (@cast $shape:literal $law:ident $constant:ident) => { Law::$law(real($constant)) };
}

laws! {
    /// A force or torque that is always there, as that of a load cell or a current sensor that is not zero at rest: f = f₀. Valid
    /// where it moves neither with time nor with temperature.
    Offset: "offset" / [];
    /// A force that grows with position, as that of a hose, a cable or a return spring: f = k·x. Valid within its linear range;
    /// one that is slack elsewhere than at zero has an offset next to it. Hooke's law.
    Spring: "stiffness" / [Length];
    /// Something that grows evenly with time: f = r·t. Valid over one measurement; it does not say what drifts.
    OffsetDrift: "rate" / [Time];
    /// From t₀ on something is off, as after a bump or a slipped belt: f = s·(t < t₀ ? 0 : 1). Valid for one step; before it the
    /// ideal holds.
    StepInTime(T: "time of the step", Time): "step" / [];
    /// A force against motion that grows with speed: f = b·v. Valid for lubricated contacts at one temperature; a real bearing's
    /// rises less than in proportion at high speed. O. Reynolds, Phil. Trans. R. Soc. 177 (1886) 157, of a lubricant film.
    ViscousFriction: "coefficient" / [Speed];
    /// A force of one size against motion, which has turned round to 76 % at the creep speed v₀ > 0: f = f_c·tanh(v/v₀). Valid in
    /// motion; at rest it gives no holding force. C. A. Coulomb, Théorie des machines simples, 1785; smoothed as B.
    /// Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit, Automatica 30 (1994) 1083.
    CoulombFriction(T: "creep speed", Speed): "level" / [];
    /// What friction has more at creep than at speed, of which 37 % is left at v_s > 0: f = f_s·tanh(v/v₀)·exp(−|v|/v_s), v₀ =
    /// v_s/10. Valid beside Coulomb friction, whose level is what is left at speed. R. Stribeck, Z. VDI 46 (1902) 1341; form of
    /// L. C. Bo, D. Pavelescu, Wear 82 (1982) 277 with the exponent 1.
    StribeckFriction(T: "speed of fall", Speed): "level" / [];
    /// Friction that turns round over a distance d > 0, as bristles bend before they slide: f = f_c·z, z of
    /// [`Memory::presliding_state`]. Valid from rest to slow motion. P. R. Dahl, A Solid Friction Model, Aerospace Corporation,
    /// 1968, with the exponent 1.
    PreslidingFriction(T: "presliding distance", Length): "level" / [];
    /// Friction that changes along the stroke, as in a bore that is not even: f = c·x·z, z as in presliding. Valid for a change
    /// in proportion to position, beside presliding.
    PositionDependentFriction(T: "presliding distance", Length): "slope" / [Length];
    /// Friction that grows with what presses on the contact, a pressure on a seal or the torque that a gear passes on: f =
    /// µ·|L|·tanh(v/v₀). Valid in motion. G. Amontons, Mém. Acad. R. Sci. 1699, 206.
    LoadDependentFriction(T: "creep speed", Speed): "per load" / [Load];
    /// Presliding whose level grows with what presses on the contact: f = µ·|L|·z, z as in presliding. Valid for seals that
    /// pressure presses on their bore.
    LoadDependentPresliding(T: "presliding distance", Length): "per load" / [Load];
    /// Viscous friction that grows with load, as that of a seal under pressure: f = b·L·v. Valid beside viscous friction.
    LoadDependentViscosity: "coefficient" / [Speed, Load];
    /// An offset that grows with speed whichever way the motion goes, as the lag of a valve: f = c·|v|. Valid where flow or
    /// switching, not friction, costs force.
    SpeedDependentOffset: "coefficient" / [Speed];
    /// What the motor's own rotor and gear take when they speed up: τ = I_m·a, I_m the inertia of the rotor times the square of
    /// its gear ratio. Valid for gears so steep that the rotor's gyroscopic moments do not count. R. Featherstone, Rigid Body
    /// Dynamics Algorithms, 2008, 9.6.
    RotorInertia: "inertia" / [Acceleration];
    /// A current-to-torque constant or a sensor's scale that is off: f = g·L, g the share by which the true one is larger. Valid
    /// where current and torque are in proportion; a motor near saturation is not.
    Gain: "gain" / [Load];
    /// The measured channel comes late by δ: f = −δ·dL/dt, the first order of L(t − δ) − L(t). Valid where δ times the highest
    /// frequency of the channel is well below 1. Taylor's theorem.
    Delay: "delay" / [LoadRate];
    /// An offset that moves with temperature: f = c·Δϑ. Valid near the temperature of reference.
    ThermalDrift: "slope" / [Kelvin];
    /// Viscous friction that changes with temperature, as that of grease, whose c is negative: f = c·v·Δϑ. Valid beside viscous
    /// friction, near the temperature of reference. First order of the Andrade–Reynolds law of viscosity.
    ThermalViscosity: "slope" / [Speed, Kelvin];
    /// Friction that changes with the way that was gone since the measurement began: f = w·s·tanh(v/v₀), s = ∫|dx|. Valid beside
    /// Coulomb friction, whose level is that of the start. J. F. Archard, J. Appl. Phys. 24 (1953) 981: worn volume in proportion
    /// to the way.
    FrictionWear(T: "creep speed", Speed): "slope" / [Length];
    /// Periodic error of a gear or an encoder, the part that is zero at position zero: f = s·sin(n·x), n periods a turn. Valid
    /// for one harmonic; with the cosine for any phase.
    GearPeriodicSine(T: "periods a turn", One): "sine" / [];
    /// The part that is largest at position zero: f = c·cos(n·x).
    GearPeriodicCosine(T: "periods a turn", One): "cosine" / [];
    /// A position that lags behind its target by half a gap, whichever way it was reached: e = h·z, z as in presliding, of the
    /// target, over the distance in which it crosses the gap. Valid where friction holds the joint at the side that it came from.
    Backlash(T: "memory of direction", Length): "half width" / [];
    /// The joint lies at the side of its gap that the load presses it to, by 76 % at L₀ > 0: e = h·tanh(L/L₀). Valid where the
    /// load, not friction, moves the joint within its gap.
    BacklashByLoad(T: "load that seats", Load): "half width" / [];
    /// A joint that gives way to its load at once: e = c·L. Valid within the linear range of gear and bearing. Hooke's law.
    JointCompliance: "compliance" / [Load];
    /// A joint that follows its load with slack: e = c·p, p of [`Memory::play`]. Valid where slack and stiffness lie in series.
    /// M. A. Krasnosel'skii, A. V. Pokrovskii, Systems with Hysteresis, 1989.
    Hysteresis(T: "half width", Load): "compliance" / [Load];
}

impl<T: Real> Law<T> {
    /// What a coefficient of one adds at this sample; `memory` is this law's own, and zero where a motion begins.
    pub fn basis(&self, now: &CoordinateSample<T>, memory: &mut Memory<T>) -> T {
        let CoordinateSample { position: x, velocity: v, load, .. } = *now;
        match *self {
            Self::Offset => T::one(),
            Self::Spring => x,
            Self::OffsetDrift => now.time_s,
            Self::StepInTime(at_s) if now.time_s < at_s => T::zero(),
            Self::StepInTime(_) => T::one(),
            Self::ViscousFriction => v,
            Self::CoulombFriction(creep) => tanh(v / creep),
            Self::StribeckFriction(fall) => tanh(v * real(10.0) / fall) * exp(-v.abs() / fall),
            Self::PreslidingFriction(distance) | Self::Backlash(distance) => memory.presliding_state(x, distance),
            Self::PositionDependentFriction(distance) => x * memory.presliding_state(x, distance),
            Self::LoadDependentFriction(creep) => load.abs() * tanh(v / creep),
            Self::LoadDependentPresliding(distance) => load.abs() * memory.presliding_state(x, distance),
            Self::LoadDependentViscosity => load * v,
            Self::SpeedDependentOffset => v.abs(),
            Self::RotorInertia => now.acceleration,
            Self::Gain | Self::JointCompliance => load,
            Self::Delay => -now.load_rate,
            Self::ThermalDrift => now.temperature_rise_k,
            Self::ThermalViscosity => v * now.temperature_rise_k,
            Self::FrictionWear(creep) => memory.path_length(x) * tanh(v / creep),
            Self::GearPeriodicSine(per_turn) => sin(x * per_turn),
            Self::GearPeriodicCosine(per_turn) => cos(x * per_turn),
            Self::BacklashByLoad(seating) => tanh(load / seating),
            Self::Hysteresis(half_width) => memory.play(load, half_width),
        }
    }

    /// Whether a drive that moves the coordinate never needs less force because of the law: its coefficient is then never
    /// negative.
    pub fn takes_power(&self) -> bool {
        matches!(
            self,
            Self::ViscousFriction
                | Self::CoulombFriction(_)
                | Self::StribeckFriction(_)
                | Self::PreslidingFriction(_)
                | Self::LoadDependentFriction(_)
                | Self::RotorInertia
        )
    }
}

/// A law with its coefficient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Term<T: Real> {
    /// The law.
    pub law: Law<T>,
    /// Its coefficient, in the unit that [`Law::per`] gives.
    pub coefficient: T,
}

impl<T: Real> Term<T> {
    /// What the law adds at this sample.
    pub fn at(&self, now: &CoordinateSample<T>, memory: &mut Memory<T>) -> T {
        self.coefficient * self.law.basis(now, memory)
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
            let (name, constant) = (law.name(), law.shape_parameter().map(|_| 0.3));
            assert_eq!(Law::named(name, constant), Some(law));
            assert_eq!(Law::named(name, if constant.is_some() { None } else { Some(0.3) }), None);
        }
    }

    /// What a coefficient of one adds at the last of these samples.
    fn last(law: Law<f64>, samples: &[CoordinateSample<f64>]) -> f64 {
        let mut memory = Memory::default();
        samples.iter().fold(0.0, |_, now| law.basis(now, &mut memory))
    }

    #[test]
    fn each_law_has_the_value_of_its_equation() {
        let zero = CoordinateSample::default();
        let along = |positions: [f64; 3]| {
            positions.map(|position| CoordinateSample { position, velocity: 1.0, load: 2.0, ..zero })
        };
        let fast = CoordinateSample { velocity: -2.0, ..zero };
        let loaded = CoordinateSample { velocity: 1.0, load: -4.0, load_rate: 3.0, ..zero };
        let cases = [
            (Law::Offset, fast, 1.0),
            (Law::Spring, CoordinateSample { position: 0.02, ..zero }, 0.02),
            (Law::OffsetDrift, CoordinateSample { time_s: 60.0, ..zero }, 60.0),
            (Law::StepInTime(10.0), CoordinateSample { time_s: 9.0, ..zero }, 0.0),
            (Law::StepInTime(10.0), CoordinateSample { time_s: 12.0, ..zero }, 1.0),
            (Law::ViscousFriction, fast, -2.0),
            (Law::CoulombFriction(0.01), fast, -1.0),
            (Law::StribeckFriction(0.1), CoordinateSample { velocity: 5.0, ..zero }, 0.0),
            // tanh(10)/e
            (Law::StribeckFriction(2.0), fast, -0.367_879_439),
            (Law::LoadDependentFriction(0.01), loaded, 4.0),
            (Law::LoadDependentViscosity, CoordinateSample { velocity: 2.0, load: 3.0, ..zero }, 6.0),
            (Law::SpeedDependentOffset, fast, 2.0),
            (Law::RotorInertia, CoordinateSample { acceleration: 5.0, ..zero }, 5.0),
            (Law::Gain, loaded, -4.0),
            (Law::Delay, loaded, -3.0),
            (Law::ThermalDrift, CoordinateSample { temperature_rise_k: 10.0, ..zero }, 10.0),
            (Law::ThermalViscosity, CoordinateSample { temperature_rise_k: 10.0, ..fast }, -20.0),
            (Law::GearPeriodicSine(1.0), CoordinateSample { position: core::f64::consts::FRAC_PI_2, ..zero }, 1.0),
            (Law::GearPeriodicCosine(2.0), zero, 1.0),
            (Law::BacklashByLoad(0.1), loaded, -1.0),
            (Law::JointCompliance, loaded, -4.0),
        ];
        for (law, now, expected) in cases {
            assert!((last(law, &[now]) - expected).abs() < 1e-8, "{law:?}");
        }
        let with_memory = [
            (Law::PreslidingFriction(1.0), along([0.0, 90.0, 3.0]), -1.0),
            (Law::PositionDependentFriction(1.0), along([0.0, 90.0, 3.0]), -3.0),
            (Law::LoadDependentPresliding(1.0), along([0.0, 90.0, 3.0]), -2.0),
            (Law::Backlash(1.0), along([0.0, 90.0, 3.0]), -1.0),
            (Law::FrictionWear(0.01), along([0.0, 2.0, -1.0]), 5.0),
            (Law::Hysteresis(1.0), [0.0, 3.0, 2.0].map(|load| CoordinateSample { load, ..zero }), 2.0),
        ];
        for (law, samples, expected) in with_memory {
            assert!((last(law, &samples) - expected).abs() < 1e-12, "{law:?}");
        }
        let named: Vec<LawName> =
            cases.iter().map(|case| case.0.name()).chain(with_memory.map(|case| case.0.name())).collect();
        assert!(laws().iter().all(|law| named.contains(&law.name())));
    }

    proptest! {
        #![proptest_config(seeded(64))]

        /// Shapes of single precision lie within what the roundings of a few operations on numbers up to 9 leave: 32 ε relative
        /// to the largest product, and the memories forget what was rounded before.
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
                prop_assert!(law.basis(&now, &mut Memory::default()) * v >= 0.0, "{name}");
            }
        }
    }
}
