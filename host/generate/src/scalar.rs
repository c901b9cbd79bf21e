//! The scalar that records: the core's generic code runs with it once, and leaves the graph of what it computes.
//!
//! A [`Recorded`] is a constant or a value of the graph of this thread, which [`record`] opens and takes back. Straight-line
//! code has no branches, so a comparison is answered where constants, or the sign of squares and roots, decide it. Another one
//! makes the recording fail, or is answered as it is for a sample of the arguments.

use std::cell::RefCell;
use std::cmp::Ordering;
use std::fmt;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Rem, RemAssign, Sub, SubAssign};

use approx::{AbsDiffEq, RelativeEq, UlpsEq};
use nalgebra::{ComplexField, Field, RealField, SimdValue};
use num_traits::{FromPrimitive, Num, One, Signed, Zero};
use simba::scalar::SubsetOf;

use crate::graph::{Arguments, Graph, Operand, Operation, Question, value_of};

/// A number that is a constant or a value of the graph of this thread.
#[derive(Clone, Copy, Debug)]
pub struct Recorded(Operand);

/// Why code cannot be recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RecordError {
    /// Two values are compared that differ from call to call.
    #[error("it branches on a value that is not constant")]
    Branch,
    /// A function that no generated file has.
    #[error("it calls {0} of a value that is not constant")]
    Function(&'static str),
}

#[derive(Default)]
struct Recording {
    graph: Graph,
    inputs: u32,
    error: Option<RecordError>,
    sample: Option<Sample>,
}

/// Arguments for which comparisons are answered, and the values of the nodes for them.
struct Sample {
    numbers: Vec<f64>,
    word: Vec<u8>,
    previous: Vec<u8>,
    values: Vec<f64>,
}

impl Recording {
    /// How two operands compare for the sample.
    fn sampled(&mut self, a: Operand, b: Operand) -> Option<Ordering> {
        let Sample { numbers, word, previous, values } = self.sample.as_mut()?;
        self.graph.evaluate(&Arguments { numbers, word, previous }, values);
        value_of(a, values).partial_cmp(&value_of(b, values))
    }
}

thread_local! {
    static RECORDING: RefCell<Recording> = RefCell::default();
}

/// Runs `code` on a new graph; its result and the graph. Comparisons of values are answered as they are for `sample`: what is
/// recorded is right where all are answered so.
///
/// # Errors
///
/// `code` branches on a value without a sample, or calls a function that is not recorded.
pub fn record<R>(sample: Option<&Arguments<'_>>, code: impl FnOnce() -> R) -> Result<(R, Graph), RecordError> {
    let sample = sample.map(|arguments| Sample {
        numbers: arguments.numbers.to_vec(),
        word: arguments.word.to_vec(),
        previous: arguments.previous.to_vec(),
        values: Vec::new(),
    });
    RECORDING.replace(Recording { sample, ..Recording::default() });
    let result = code();
    let Recording { graph, error, .. } = RECORDING.take();
    error.map_or(Ok((result, graph)), Err)
}

/// `a` where the answer is yes, else `b`.
pub fn choice(question: Question, a: Recorded, b: Recorded) -> Recorded {
    graph(|graph| graph.choice(question, a.0, b.0))
}

/// The next `n` inputs of the function that is recorded.
pub fn inputs(n: usize) -> Vec<Recorded> {
    let next = |_| {
        with(|recording| {
            recording.inputs += 1;
            Recorded(recording.graph.node(Operation::Input(recording.inputs - 1)))
        })
    };
    (0..n).map(next).collect()
}

fn with<R>(act: impl FnOnce(&mut Recording) -> R) -> R {
    RECORDING.with_borrow_mut(act)
}

fn graph(act: impl FnOnce(&mut Graph) -> Operand) -> Recorded {
    Recorded(with(|recording| act(&mut recording.graph)))
}

fn fail<R>(error: RecordError, instead: R) -> R {
    with(|recording| {
        recording.error.get_or_insert(error);
    });
    instead
}

impl Recorded {
    /// A constant.
    pub fn constant(value: f64) -> Self {
        Self(Operand::constant(value))
    }

    /// What the graph calls it.
    pub fn operand(self) -> Operand {
        self.0
    }

    /// Of a constant, `function`; another value has no such function.
    fn of_constant(self, name: &'static str, function: impl FnOnce(f64) -> f64) -> Self {
        match self.0.as_constant() {
            Some(value) => Self::constant(function(value)),
            None => fail(RecordError::Function(name), self),
        }
    }
}

impl Default for Recorded {
    fn default() -> Self {
        Self(Operand::ZERO)
    }
}

impl fmt::Display for Recorded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Operand::Constant(bits) => write!(f, "{}", f64::from_bits(bits)),
            Operand::Value { node, is_negative } => write!(f, "{}v{node}", if is_negative { "-" } else { "" }),
        }
    }
}

impl PartialEq for Recorded {
    fn eq(&self, other: &Self) -> bool {
        self.partial_cmp(other) == Some(Ordering::Equal)
    }
}

impl PartialOrd for Recorded {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        let (a, b) = (self.0, other.0);
        if let (Some(a), Some(b)) = (a.as_constant(), b.as_constant()) {
            return a.partial_cmp(&b);
        }
        if a == b {
            return Some(Ordering::Equal);
        }
        // At zero the root of a sum of squares is that of zero on either branch.
        let is_never_negative = |x: Operand| with(|recording| recording.graph.is_never_negative(x));
        if b.as_constant().is_some_and(|b| b <= 0.0) && is_never_negative(a) {
            return Some(Ordering::Greater);
        }
        if a.as_constant().is_some_and(|a| a <= 0.0) && is_never_negative(b) {
            return Some(Ordering::Less);
        }
        match with(|recording| recording.sample.is_some().then(|| recording.sampled(a, b))) {
            Some(sampled) => sampled,
            None => fail(RecordError::Branch, None),
        }
    }
}

/// Binary operators, and those that assign.
macro_rules! operator {
    ($($trait:ident, $name:ident, $assign:ident, $name_assign:ident, |$graph:ident, $a:ident, $b:ident| $value:expr;)*) => {$(
        impl $trait for Recorded {
            type Output = Self;
            fn $name(self, other: Self) -> Self {
                let ($a, $b) = (self.0, other.0);
                graph(|$graph| $value)
            }
        }

        impl $assign for Recorded {
            fn $name_assign(&mut self, other: Self) {
                *self = $trait::$name(*self, other);
            }
        }
    )*};
}

operator! {
    Add, add, AddAssign, add_assign, |graph, a, b| graph.sum(a, b);
    Sub, sub, SubAssign, sub_assign, |graph, a, b| graph.sum(a, b.negated());
    Mul, mul, MulAssign, mul_assign, |graph, a, b| graph.product(a, b);
    Div, div, DivAssign, div_assign, |graph, a, b| graph.quotient(a, b);
}

impl Rem for Recorded {
    type Output = Self;
    fn rem(self, other: Self) -> Self {
        match other.0.as_constant() {
            Some(other) => self.of_constant("the remainder", |x| x % other),
            None => fail(RecordError::Function("the remainder"), self),
        }
    }
}

impl RemAssign for Recorded {
    fn rem_assign(&mut self, other: Self) {
        *self = *self % other;
    }
}

impl Neg for Recorded {
    type Output = Self;
    fn neg(self) -> Self {
        Self(self.0.negated())
    }
}

impl Zero for Recorded {
    fn zero() -> Self {
        Self::constant(0.0)
    }

    fn is_zero(&self) -> bool {
        self.0.as_constant() == Some(0.0)
    }
}

impl One for Recorded {
    fn one() -> Self {
        Self::constant(1.0)
    }
}

impl Num for Recorded {
    type FromStrRadixErr = <f64 as Num>::FromStrRadixErr;

    fn from_str_radix(text: &str, radix: u32) -> Result<Self, Self::FromStrRadixErr> {
        f64::from_str_radix(text, radix).map(Self::constant)
    }
}

impl FromPrimitive for Recorded {
    fn from_i64(value: i64) -> Option<Self> {
        f64::from_i64(value).map(Self::constant)
    }

    fn from_u64(value: u64) -> Option<Self> {
        f64::from_u64(value).map(Self::constant)
    }

    fn from_f64(value: f64) -> Option<Self> {
        Some(Self::constant(value))
    }
}

impl Signed for Recorded {
    fn abs(&self) -> Self {
        graph(|graph| graph.absolute(self.0))
    }

    fn abs_sub(&self, other: &Self) -> Self {
        let difference = *self - *other;
        graph(|graph| graph.maximum(difference.0, Operand::ZERO))
    }

    fn signum(&self) -> Self {
        self.of_constant("the sign", f64::signum)
    }

    fn is_positive(&self) -> bool {
        *self > Self::zero()
    }

    fn is_negative(&self) -> bool {
        *self < Self::zero()
    }
}

impl SimdValue for Recorded {
    const LANES: usize = 1;
    type Element = Self;
    type SimdBool = bool;

    fn splat(value: Self) -> Self {
        value
    }

    fn extract(&self, _: usize) -> Self {
        *self
    }

    unsafe fn extract_unchecked(&self, _: usize) -> Self {
        *self
    }

    fn replace(&mut self, _: usize, value: Self) {
        *self = value;
    }

    unsafe fn replace_unchecked(&mut self, _: usize, value: Self) {
        *self = value;
    }

    fn select(self, condition: bool, other: Self) -> Self {
        if condition { self } else { other }
    }
}

impl Field for Recorded {}

impl SubsetOf<Self> for Recorded {
    fn to_superset(&self) -> Self {
        *self
    }

    fn from_superset_unchecked(element: &Self) -> Self {
        *element
    }

    fn is_in_subset(_: &Self) -> bool {
        true
    }
}

/// A type of machine numbers within the recorded ones.
macro_rules! machine_number {
    ($($number:ty),*) => {$(
        impl SubsetOf<Recorded> for $number {
            fn to_superset(&self) -> Recorded {
                Recorded::constant((*self).into())
            }

            fn from_superset_unchecked(element: &Recorded) -> Self {
                // Only messages of errors show it.
                element.0.as_constant().unwrap_or(f64::NAN) as $number
            }

            fn is_in_subset(element: &Recorded) -> bool {
                element.0.as_constant().is_some()
            }
        }
    )*};
}

machine_number!(f32, f64);

impl AbsDiffEq for Recorded {
    type Epsilon = Self;

    fn default_epsilon() -> Self {
        Self::constant(f64::EPSILON)
    }

    fn abs_diff_eq(&self, other: &Self, epsilon: Self) -> bool {
        Signed::abs(&(*self - *other)) <= epsilon
    }
}

impl RelativeEq for Recorded {
    fn default_max_relative() -> Self {
        Self::default_epsilon()
    }

    fn relative_eq(&self, other: &Self, epsilon: Self, _: Self) -> bool {
        self.abs_diff_eq(other, epsilon)
    }
}

impl UlpsEq for Recorded {
    fn default_max_ulps() -> u32 {
        4
    }

    fn ulps_eq(&self, other: &Self, epsilon: Self, _: u32) -> bool {
        self.abs_diff_eq(other, epsilon)
    }
}

/// Functions that only constants have.
macro_rules! of_constants {
    ($($name:ident)*) => {$(
        fn $name(self) -> Self {
            self.of_constant(stringify!($name), f64::$name)
        }
    )*};
}

impl ComplexField for Recorded {
    type RealField = Self;

    of_constants! { floor ceil round trunc fract tan asin acos atan sinh cosh tanh asinh acosh atanh }
    of_constants! { log2 log10 ln ln_1p exp exp2 exp_m1 cbrt }

    fn from_real(re: Self) -> Self {
        re
    }

    fn real(self) -> Self {
        self
    }

    fn imaginary(self) -> Self {
        Self::zero()
    }

    fn modulus(self) -> Self {
        Signed::abs(&self)
    }

    fn modulus_squared(self) -> Self {
        self * self
    }

    fn argument(self) -> Self {
        if self >= Self::zero() { Self::zero() } else { Self::pi() }
    }

    fn norm1(self) -> Self {
        Signed::abs(&self)
    }

    fn scale(self, factor: Self) -> Self {
        self * factor
    }

    fn unscale(self, factor: Self) -> Self {
        self / factor
    }

    fn mul_add(self, a: Self, b: Self) -> Self {
        self * a + b
    }

    fn abs(self) -> Self {
        Signed::abs(&self)
    }

    fn hypot(self, other: Self) -> Self {
        (self * self + other * other).sqrt()
    }

    fn recip(self) -> Self {
        Self::one() / self
    }

    fn conjugate(self) -> Self {
        self
    }

    fn sin(self) -> Self {
        self.sin_cos().0
    }

    fn cos(self) -> Self {
        self.sin_cos().1
    }

    fn sin_cos(self) -> (Self, Self) {
        let (sine, cosine) = with(|recording| recording.graph.sin_cos(self.0));
        (Self(sine), Self(cosine))
    }

    fn log(self, base: Self) -> Self {
        match base.0.as_constant() {
            Some(base) => self.of_constant("log", |x| x.log(base)),
            None => fail(RecordError::Function("log"), self),
        }
    }

    fn sqrt(self) -> Self {
        graph(|graph| graph.root(self.0))
    }

    fn powi(self, n: i32) -> Self {
        let power = (0..n.unsigned_abs()).fold(Self::one(), |power, _| power * self);
        if n < 0 { power.recip() } else { power }
    }

    fn powf(self, n: Self) -> Self {
        match n.0.as_constant() {
            Some(n) => self.of_constant("powf", |x| x.powf(n)),
            None => fail(RecordError::Function("powf"), self),
        }
    }

    fn powc(self, n: Self) -> Self {
        self.powf(n)
    }

    fn is_finite(&self) -> bool {
        self.0.as_constant().is_none_or(f64::is_finite)
    }

    fn try_sqrt(self) -> Option<Self> {
        (self >= Self::zero()).then(|| self.sqrt())
    }
}

/// Constants of mathematics.
macro_rules! constants {
    ($($name:ident = $value:expr;)*) => {$(
        fn $name() -> Self {
            Self::constant($value)
        }
    )*};
}

impl RealField for Recorded {
    constants! {
        pi = std::f64::consts::PI;
        two_pi = std::f64::consts::TAU;
        frac_pi_2 = std::f64::consts::FRAC_PI_2;
        frac_pi_3 = std::f64::consts::FRAC_PI_3;
        frac_pi_4 = std::f64::consts::FRAC_PI_4;
        frac_pi_6 = std::f64::consts::FRAC_PI_6;
        frac_pi_8 = std::f64::consts::FRAC_PI_8;
        frac_1_pi = std::f64::consts::FRAC_1_PI;
        frac_2_pi = std::f64::consts::FRAC_2_PI;
        frac_2_sqrt_pi = std::f64::consts::FRAC_2_SQRT_PI;
        e = std::f64::consts::E;
        log2_e = std::f64::consts::LOG2_E;
        log10_e = std::f64::consts::LOG10_E;
        ln_2 = std::f64::consts::LN_2;
        ln_10 = std::f64::consts::LN_10;
    }

    fn is_sign_positive(&self) -> bool {
        *self >= Self::zero()
    }

    fn is_sign_negative(&self) -> bool {
        *self < Self::zero()
    }

    fn copysign(self, sign: Self) -> Self {
        let size = Signed::abs(&self);
        if sign >= Self::zero() { size } else { -size }
    }

    fn max(self, other: Self) -> Self {
        graph(|graph| graph.maximum(self.0, other.0))
    }

    fn min(self, other: Self) -> Self {
        graph(|graph| graph.minimum(self.0, other.0))
    }

    fn clamp(self, min: Self, max: Self) -> Self {
        RealField::min(RealField::max(self, min), max)
    }

    fn atan2(self, other: Self) -> Self {
        match other.0.as_constant() {
            Some(other) => self.of_constant("atan2", |y| y.atan2(other)),
            None => fail(RecordError::Function("atan2"), self),
        }
    }

    fn min_value() -> Option<Self> {
        Some(Self::constant(f64::MIN))
    }

    fn max_value() -> Option<Self> {
        Some(Self::constant(f64::MAX))
    }
}
