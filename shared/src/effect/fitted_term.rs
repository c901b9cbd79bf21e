//! Fitted term: no law, but what a measurement showed to remain along one variable, kept as such.
//!
//! # Model
//!
//! T = T₀·exp(v·uᵖ), the parts of v in the directions of the tool or of the base
//!
//! | symbol | field       | unit   | meaning                                                             |
//! |--------|-------------|--------|---------------------------------------------------------------------|
//! | T₀     | `predicted` | m, rad | pose of the tool in the base without the term                       |
//! | u      | `of`        | 1      | the variable, moved and scaled to ±1 over the measurement, or a flag |
//! | p      | `square`    | 1      | 1, or 2 where the term goes with the square                         |
//! | v      | `values`    | rad, m | turn and shift of the tool at u = 1                                 |
//!
//! Frame: at the tool; the directions are those of `frame`.
//! Valid inside the range of u that was measured: no law says what it does outside.
//! Source: regression on what no law explained; see `darm diagnose --keep-terms`.
//!
//! # Example
//!
//! ```
//! use darm_core::effect::{Condition, Frame, fitted_term::{FittedTerm, Variable}};
//! use darm_core::se::Pose;
//! let warmth = Variable::Temperature { center: 298.15, span: 5.0 };
//! let law = FittedTerm { of: warmth, square: true, frame: Frame::Base, values: [0.0, 0.0, 0.0, 0.0, 0.002, 0.0] };
//! let condition = Condition { temperature_k: 308.15, ..Condition::of_word("01".parse().unwrap()) };
//! // Two spans too warm: 2² · 2 mm along the base's y.
//! let seen = law.displace(Pose::identity(), &condition).position;
//! assert!((seen.y - 0.008f64).abs() < 1e-15);
//! ```

use super::{Condition, Frame};
use crate::real::{Real, Vec3, real};
use crate::se::{Pose, Twist};

/// What remains along one variable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedTerm<T: Real> {
    /// The variable.
    pub of: Variable<T>,
    /// Whether it goes with the square.
    pub square: bool,
    /// Whose directions `values` are given in.
    pub frame: Frame,
    /// Rotation vector, rad, and translation, m, at u = 1.
    pub values: [T; 6],
}

/// What a term may depend on. A measured one is u = (value − center)/span.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Variable<T: Real> {
    /// The supply, in the unit of the model's.
    Supply {
        /// u = 0.
        center: T,
        /// From u = 0 to u = 1.
        span: T,
    },
    /// The temperature, K.
    Temperature {
        /// u = 0.
        center: T,
        /// From u = 0 to u = 1.
        span: T,
    },
    /// The position of a servo joint, rad or m.
    Servo {
        /// Its index.
        servo: u8,
        /// u = 0.
        center: T,
        /// From u = 0 to u = 1.
        span: T,
    },
    /// 1 where one actuator, or each of two, is in a state; 0 elsewhere.
    Digits {
        /// Actuator and state.
        first: (u8, u8),
        /// The same of another.
        second: Option<(u8, u8)>,
    },
    /// Whether an actuator was in this state before as well (1) or not (0), less how often that is so; of the other sign
    /// where its digit is not 0, since actuators come off their two stops in opposite directions.
    Stayed {
        /// The actuator.
        actuator: u8,
        /// How often.
        share: T,
    },
}

/// A [`Variable`] without its numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum VariableName {
    /// Supply.
    Supply,
    /// Temperature.
    Temperature,
    /// Position of a servo joint.
    Servo(u8),
    /// States of one or of two actuators.
    Digits((u8, u8), Option<(u8, u8)>),
    /// Whether an actuator kept its state.
    Stayed(u8),
}

impl<T: Real> Variable<T> {
    /// Which variable it is.
    pub fn name(&self) -> VariableName {
        match *self {
            Self::Supply { .. } => VariableName::Supply,
            Self::Temperature { .. } => VariableName::Temperature,
            Self::Servo { servo, .. } => VariableName::Servo(servo),
            Self::Digits { first, second } => VariableName::Digits(first, second),
            Self::Stayed { actuator, .. } => VariableName::Stayed(actuator),
        }
    }

    /// u under a condition; 0 where it has no such part.
    pub fn of(&self, condition: &Condition<T>) -> T {
        let scaled = |value: T, center: T, span: T| (value - center) / span;
        match *self {
            Self::Supply { center, span } => scaled(condition.supply, center, span),
            Self::Temperature { center, span } => scaled(condition.temperature_k, center, span),
            Self::Servo { servo, center, span } => {
                condition.servos.get(usize::from(servo)).map_or(T::zero(), |at| scaled(*at, center, span))
            }
            Self::Digits { first, second } => {
                let is = |(actuator, state)| condition.word.digit(usize::from(actuator)) == state;
                if is(first) && second.is_none_or(is) { T::one() } else { T::zero() }
            }
            Self::Stayed { actuator, share } => {
                let now = condition.word.digit(actuator.into());
                let before = condition.previous.map(|word| word.digit(actuator.into()));
                let stayed = if before == Some(now) { T::one() - share } else { -share };
                if now == 0 { stayed } else { -stayed }
            }
        }
    }
}

impl Variable<f64> {
    /// The same variable in numbers of type `U`.
    fn cast<U: Real>(&self) -> Variable<U> {
        let number = real::<U>;
        match *self {
            Self::Supply { center, span } => Variable::Supply { center: number(center), span: number(span) },
            Self::Temperature { center, span } => Variable::Temperature { center: number(center), span: number(span) },
            Self::Servo { servo, center, span } => {
                Variable::Servo { servo, center: number(center), span: number(span) }
            }
            Self::Digits { first, second } => Variable::Digits { first, second },
            Self::Stayed { actuator, share } => Variable::Stayed { actuator, share: number(share) },
        }
    }
}

impl<T: Real> FittedTerm<T> {
    /// The pose of the tool in the base as it is seen, where the arm alone would have it `predicted`.
    pub fn displace(&self, predicted: Pose<T>, condition: &Condition<T>) -> Pose<T> {
        let u = self.of.of(condition);
        let size = if self.square { u * u } else { u };
        let [rx, ry, rz, x, y, z] = self.values;
        let [turn, shift] = [Vec3::new(rx, ry, rz), Vec3::new(x, y, z)].map(|part| match self.frame {
            Frame::Base => predicted.rotation.transpose() * part,
            Frame::Tool => part,
        });
        predicted * Pose::exp(&(Twist { angular: turn, linear: shift } * size))
    }
}

impl FittedTerm<f64> {
    /// The same law in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> FittedTerm<U> {
        FittedTerm { of: self.of.cast(), square: self.square, frame: self.frame, values: self.values.map(real) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_variable_is_what_it_says() {
        let (previous, plain) = ("110".parse().ok(), Condition::of_word("012".parse().unwrap()));
        let condition = Condition { previous, servos: &[0.5], supply: 5.5e5, temperature_k: 300.0, ..plain };
        let of = |variable: Variable<f64>| variable.of(&condition);
        assert_eq!(of(Variable::Supply { center: 5e5, span: 1e5 }), 0.5);
        assert_eq!(of(Variable::Temperature { center: 310.0, span: 5.0 }), -2.0);
        assert_eq!(of(Variable::Servo { servo: 0, center: 0.25, span: 0.5 }), 0.5);
        assert_eq!(of(Variable::Servo { servo: 1, center: 0.25, span: 0.5 }), 0.0);
        let digits = |second| of(Variable::Digits { first: (2, 2), second });
        assert_eq!((digits(None), digits(Some((1, 1))), digits(Some((1, 0)))), (1.0, 1.0, 0.0));
        let stayed = |actuator| of(Variable::Stayed { actuator, share: 0.25 });
        assert_eq!((stayed(0), stayed(1), stayed(2)), (-0.25, -0.75, 0.25));
    }

    #[test]
    fn directions_are_those_of_the_frame() {
        let turned = Pose::new(&Vec3::new(0.0, 0.0, core::f64::consts::FRAC_PI_2), Vec3::new(1.0, 2.0, 0.0));
        let condition = Condition::of_word("1".parse().unwrap());
        let of = Variable::Digits { first: (0, 1), second: None };
        let values = [0.0, 0.0, 0.0, 0.002, 0.0, 0.0];
        let seen = |frame| FittedTerm { of, square: false, frame, values }.displace(turned, &condition).position;
        assert!((seen(Frame::Tool) - Vec3::new(1.0, 2.002, 0.0)).norm() < 1e-15);
        assert!((seen(Frame::Base) - Vec3::new(1.002, 2.0, 0.0)).norm() < 1e-15);
    }
}
