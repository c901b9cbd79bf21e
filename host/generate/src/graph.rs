//! The graph that a recording makes: each node is one operation, and equal operations are one node.
//!
//! A value is a node with a sign, so that a negation costs nothing and a·(−b), (−a)·b and −(a·b) are one node. Constants are
//! no nodes: they are folded while the graph is built. What is simplified at once: sums with 0, products with 0 and ±1, x − x,
//! k₁·x + k₂·x, products of constants, sin²x + cos²x, and angles shifted by quarter turns.

use std::collections::HashMap;
use std::f64::consts::FRAC_PI_2;

/// A constant, or a node with its sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Operand {
    /// The bits of a constant.
    Constant(u64),
    /// A node's value, or less that.
    Value {
        /// Number of the node.
        node: u32,
        /// Whether the value is negated.
        is_negative: bool,
    },
}

/// A question about the word, on which one of two values is chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Question {
    /// Whether an actuator is in a state.
    Digit {
        /// The actuator.
        actuator: u8,
        /// The state.
        state: u8,
    },
    /// The same of the word before.
    Previous {
        /// The actuator.
        actuator: u8,
        /// The state.
        state: u8,
    },
    /// Whether as many others of the actuators from `first` to `end` have another digit than before.
    Together {
        /// The actuator that does not count.
        actuator: u8,
        /// The first one that does.
        first: u8,
        /// The one after the last.
        end: u8,
        /// How many.
        count: u8,
    },
}

/// What a recorded function is called with.
#[derive(Clone, Copy, Debug, Default)]
pub struct Arguments<'a> {
    /// The elements of all inputs.
    pub numbers: &'a [f64],
    /// The digits of the word.
    pub word: &'a [u8],
    /// Those of the word before.
    pub previous: &'a [u8],
}

/// What a node computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Operation {
    /// Element of the inputs, in the order in which they were declared.
    Input(u32),
    /// a + b, the first not negated.
    Sum(Operand, Operand),
    /// a · b, neither negated.
    Product(Operand, Operand),
    /// a / b, neither negated.
    Quotient(Operand, Operand),
    /// sin a, a not negated.
    Sine(Operand),
    /// cos a, a not negated.
    Cosine(Operand),
    /// √a.
    Root(Operand),
    /// |a|, a not negated.
    Absolute(Operand),
    /// The larger of two.
    Maximum(Operand, Operand),
    /// The smaller of two.
    Minimum(Operand, Operand),
    /// The first of two where the answer is yes, else the second.
    Choice(Question, Operand, Operand),
}

/// Operations and the constants between them, operands before what uses them.
#[derive(Clone, Debug, Default)]
pub struct Graph {
    nodes: Vec<Operation>,
    known: HashMap<Operation, u32>,
}

impl Operand {
    /// Zero.
    pub const ZERO: Self = Self::Constant(0);

    /// A constant; both zeros are one.
    pub fn constant(value: f64) -> Self {
        Self::Constant((value + 0.0).to_bits())
    }

    /// A node's value.
    pub fn value(node: u32) -> Self {
        Self::Value { node, is_negative: false }
    }

    /// Its number, where it is a constant.
    pub fn as_constant(self) -> Option<f64> {
        match self {
            Self::Constant(bits) => Some(f64::from_bits(bits)),
            Self::Value { .. } => None,
        }
    }

    /// Its node, where it has one.
    pub fn node(self) -> Option<u32> {
        match self {
            Self::Constant(_) => None,
            Self::Value { node, .. } => Some(node),
        }
    }

    /// −a.
    pub fn negated(self) -> Self {
        match self {
            Self::Constant(bits) => Self::constant(-f64::from_bits(bits)),
            Self::Value { node, is_negative } => Self::Value { node, is_negative: !is_negative },
        }
    }

    /// −a where `is_negative` holds, else a.
    pub fn signed(self, is_negative: bool) -> Self {
        if is_negative { self.negated() } else { self }
    }

    /// |a| and whether a was negated, by its sign alone: of a node, its value.
    pub fn split(self) -> (Self, bool) {
        match self {
            Self::Constant(bits) => {
                let value = f64::from_bits(bits);
                (Self::constant(value.abs()), value < 0.0)
            }
            Self::Value { node, is_negative } => (Self::value(node), is_negative),
        }
    }
}

impl Operation {
    /// What it reads.
    pub fn operands(self) -> impl DoubleEndedIterator<Item = Operand> {
        let pair = match self {
            Self::Input(_) => [None, None],
            Self::Sine(a) | Self::Cosine(a) | Self::Root(a) | Self::Absolute(a) => [Some(a), None],
            Self::Sum(a, b)
            | Self::Product(a, b)
            | Self::Quotient(a, b)
            | Self::Maximum(a, b)
            | Self::Minimum(a, b)
            | Self::Choice(_, a, b) => [Some(a), Some(b)],
        };
        pair.into_iter().flatten()
    }
}

impl Question {
    /// The answer for these words.
    pub fn answer(self, word: &[u8], previous: &[u8]) -> bool {
        match self {
            Self::Digit { actuator, state } => word[usize::from(actuator)] == state,
            Self::Previous { actuator, state } => previous[usize::from(actuator)] == state,
            Self::Together { actuator, first, end, count } => {
                let others = (usize::from(first)..usize::from(end)).filter(|other| *other != usize::from(actuator));
                others.filter(|other| word[*other] != previous[*other]).count() == usize::from(count)
            }
        }
    }
}

impl Graph {
    /// The operation of a node.
    pub fn operation(&self, node: u32) -> Operation {
        self.nodes[node as usize]
    }

    /// The operations, operands before what uses them.
    pub fn operations(&self) -> &[Operation] {
        &self.nodes
    }

    /// The node of an operation, as it is.
    pub fn node(&mut self, operation: Operation) -> Operand {
        let nodes = &mut self.nodes;
        let node = *self.known.entry(operation).or_insert_with(|| {
            nodes.push(operation);
            nodes.len() as u32 - 1
        });
        Operand::value(node)
    }

    /// a + b.
    pub fn sum(&mut self, a: Operand, b: Operand) -> Operand {
        match (a.as_constant(), b.as_constant()) {
            (Some(a), Some(b)) => return Operand::constant(a + b),
            (Some(0.0), None) => return b,
            (None, Some(0.0)) => return a,
            _ => {}
        }
        if a == b.negated() {
            return Operand::ZERO;
        }
        for (constant, chosen) in [(a, b), (b, a)] {
            if constant.as_constant().is_some()
                && let Some((question, yes, no)) = self.constant_choice(chosen)
            {
                let (yes, no) = (self.sum(constant, yes), self.sum(constant, no));
                return self.choice(question, yes, no);
            }
        }
        let (ka, ca) = self.scaled(a);
        let (kb, cb) = self.scaled(b);
        if ca == cb {
            return self.product(Operand::constant(ka + kb), ca);
        }
        if let Some(sum) = self.sum_with_constant(a, b).or_else(|| self.sum_with_constant(b, a)) {
            return sum;
        }
        if let Some(one) = self.unit_circle(a, b) {
            return one;
        }
        let (a, b) = if a.split() <= b.split() { (a, b) } else { (b, a) };
        let is_negative = a.split().1;
        self.node(Operation::Sum(a.signed(is_negative), b.signed(is_negative))).signed(is_negative)
    }

    /// c + (d + x) = (c + d) + x.
    fn sum_with_constant(&mut self, constant: Operand, sum: Operand) -> Option<Operand> {
        let (value, Operand::Value { node, is_negative }) = (constant.as_constant()?, sum) else { return None };
        let Operation::Sum(first, rest) = self.operation(node) else { return None };
        let first = first.as_constant()?;
        let first = if is_negative { -first } else { first };
        Some(self.sum(Operand::constant(value + first), rest.signed(is_negative)))
    }

    /// 1 where the two are sin²x and cos²x.
    fn unit_circle(&self, a: Operand, b: Operand) -> Option<Operand> {
        let square = |x: Operand| match (x, self.operation(x.node()?)) {
            (Operand::Value { is_negative, .. }, Operation::Product(p, q)) if p == q => {
                Some((is_negative, self.operation(p.node()?)))
            }
            _ => None,
        };
        let ((sa, a), (sb, b)) = (square(a)?, square(b)?);
        match (a, b) {
            (Operation::Sine(x), Operation::Cosine(y)) | (Operation::Cosine(x), Operation::Sine(y))
                if x == y && sa == sb =>
            {
                Some(Operand::constant(if sa { -1.0 } else { 1.0 }))
            }
            _ => None,
        }
    }

    /// k and x of a = k·x.
    fn scaled(&self, a: Operand) -> (f64, Operand) {
        let (core, is_negative) = a.split();
        let sign = if is_negative { -1.0 } else { 1.0 };
        match core.node().map(|node| self.operation(node)) {
            Some(Operation::Product(factor, rest)) if factor.as_constant().is_some() => {
                (sign * factor.as_constant().unwrap_or(1.0), rest)
            }
            _ => (sign, core),
        }
    }

    /// a · b.
    pub fn product(&mut self, a: Operand, b: Operand) -> Operand {
        match (a.as_constant(), b.as_constant()) {
            (Some(a), Some(b)) => return Operand::constant(a * b),
            (Some(factor), None) => return self.multiple(factor, b),
            (None, Some(factor)) => return self.multiple(factor, a),
            (None, None) => {}
        }
        let ((a, sa), (b, sb)) = (a.split(), b.split());
        let (a, b) = if a <= b { (a, b) } else { (b, a) };
        self.node(Operation::Product(a, b)).signed(sa != sb)
    }

    fn multiple(&mut self, factor: f64, a: Operand) -> Operand {
        if let Some(a) = a.as_constant() {
            return Operand::constant(factor * a);
        }
        if factor == 0.0 {
            return Operand::ZERO;
        }
        if let Some((question, yes, no)) = self.constant_choice(a) {
            let (yes, no) = (self.multiple(factor, yes), self.multiple(factor, no));
            return self.choice(question, yes, no);
        }
        let (k, core) = self.scaled(a);
        let factor = factor * k;
        if factor.abs() == 1.0 {
            return core.signed(factor < 0.0);
        }
        self.node(Operation::Product(Operand::constant(factor.abs()), core)).signed(factor < 0.0)
    }

    /// a / b; by a constant as the product with its reciprocal.
    pub fn quotient(&mut self, a: Operand, b: Operand) -> Operand {
        if let Some(divisor) = b.as_constant() {
            return match a.as_constant() {
                Some(a) => Operand::constant(a / divisor),
                None => self.multiple(1.0 / divisor, a),
            };
        }
        if a == Operand::ZERO {
            return a;
        }
        let ((a, sa), (b, sb)) = (a.split(), b.split());
        if a == b {
            return Operand::constant(1.0).signed(sa != sb);
        }
        self.node(Operation::Quotient(a, b)).signed(sa != sb)
    }

    /// (sin a, cos a).
    pub fn sin_cos(&mut self, a: Operand) -> (Operand, Operand) {
        if let Some(angle) = a.as_constant() {
            let (sine, cosine) = angle.sin_cos();
            return (Operand::constant(sine), Operand::constant(cosine));
        }
        if let Some((question, yes, no)) = self.constant_choice(a) {
            let [yes, no] = [yes, no].map(|angle| self.sin_cos(angle));
            return (self.choice(question, yes.0, no.0), self.choice(question, yes.1, no.1));
        }
        let (angle, is_negative) = a.split();
        if let Some((quarters, rest)) = self.quarter_turns(angle) {
            let (sine, cosine) = self.sin_cos(rest);
            let (sine, cosine) = match quarters.rem_euclid(4) {
                0 => (sine, cosine),
                1 => (cosine, sine.negated()),
                2 => (sine.negated(), cosine.negated()),
                _ => (cosine.negated(), sine),
            };
            return (sine.signed(is_negative), cosine);
        }
        (self.node(Operation::Sine(angle)).signed(is_negative), self.node(Operation::Cosine(angle)))
    }

    /// k and x of a = k·π/2 + x.
    fn quarter_turns(&self, angle: Operand) -> Option<(i64, Operand)> {
        let Operation::Sum(constant, rest) = self.operation(angle.node()?) else { return None };
        let offset = constant.as_constant()?;
        let quarters = (offset / FRAC_PI_2).round();
        let is_exact = quarters != 0.0 && (offset - quarters * FRAC_PI_2).abs() <= 8.0 * f64::EPSILON;
        is_exact.then_some((quarters as i64, rest))
    }

    /// √a.
    pub fn root(&mut self, a: Operand) -> Operand {
        match a.as_constant() {
            Some(a) => Operand::constant(a.sqrt()),
            None => self.node(Operation::Root(a)),
        }
    }

    /// |a|.
    pub fn absolute(&mut self, a: Operand) -> Operand {
        match a.split().0 {
            constant @ Operand::Constant(_) => constant,
            value => self.node(Operation::Absolute(value)),
        }
    }

    /// The larger of a and b.
    pub fn maximum(&mut self, a: Operand, b: Operand) -> Operand {
        match (a.as_constant(), b.as_constant()) {
            (Some(a), Some(b)) => Operand::constant(a.max(b)),
            _ if a == b => a,
            _ => self.node(Operation::Maximum(a.min(b), a.max(b))),
        }
    }

    /// The smaller of a and b.
    pub fn minimum(&mut self, a: Operand, b: Operand) -> Operand {
        match (a.as_constant(), b.as_constant()) {
            (Some(a), Some(b)) => Operand::constant(a.min(b)),
            _ if a == b => a,
            _ => self.node(Operation::Minimum(a.min(b), a.max(b))),
        }
    }

    /// Whether a cannot be below zero: a square, a root, an absolute value, or a sum of such.
    pub fn is_never_negative(&self, a: Operand) -> bool {
        let Operand::Value { node, is_negative } = a else { return a.as_constant() >= Some(0.0) };
        !is_negative
            && match self.operation(node) {
                Operation::Product(a, b) => a == b || (self.is_never_negative(a) && self.is_never_negative(b)),
                Operation::Sum(a, b) => self.is_never_negative(a) && self.is_never_negative(b),
                Operation::Root(_) | Operation::Absolute(_) => true,
                _ => false,
            }
    }

    /// a where the answer is yes, else b.
    pub fn choice(&mut self, question: Question, a: Operand, b: Operand) -> Operand {
        if a == b { a } else { self.node(Operation::Choice(question, a, b)) }
    }

    /// The question of a choice between constants and such choices, and what is chosen from.
    fn constant_choice(&self, a: Operand) -> Option<(Question, Operand, Operand)> {
        let Operand::Value { node, is_negative } = a else { return None };
        let Operation::Choice(question, yes, no) = self.operation(node) else { return None };
        let is_constant = |x: Operand| x.as_constant().is_some() || self.constant_choice(x).is_some();
        let [yes, no] = [yes, no].map(|x| x.signed(is_negative));
        (is_constant(yes) && is_constant(no)).then_some((question, yes, no))
    }

    /// The value of every node for these arguments, in the order of the nodes, after those that `values` has.
    pub fn evaluate(&self, arguments: &Arguments<'_>, values: &mut Vec<f64>) {
        for operation in self.nodes.get(values.len()..).unwrap_or_default() {
            let at = |operand: Operand| value_of(operand, values);
            let value = match *operation {
                Operation::Input(index) => arguments.numbers[index as usize],
                Operation::Sum(a, b) => at(a) + at(b),
                Operation::Product(a, b) => at(a) * at(b),
                Operation::Quotient(a, b) => at(a) / at(b),
                Operation::Sine(a) => at(a).sin(),
                Operation::Cosine(a) => at(a).cos(),
                Operation::Root(a) => at(a).sqrt(),
                Operation::Absolute(a) => at(a).abs(),
                Operation::Maximum(a, b) => at(a).max(at(b)),
                Operation::Minimum(a, b) => at(a).min(at(b)),
                Operation::Choice(question, yes, no) => {
                    at(if question.answer(arguments.word, arguments.previous) { yes } else { no })
                }
            };
            values.push(value);
        }
    }
}

/// The number of an operand among the values of the nodes.
pub fn value_of(operand: Operand, values: &[f64]) -> f64 {
    match operand {
        Operand::Constant(bits) => f64::from_bits(bits),
        Operand::Value { node, is_negative } => {
            let value = values[node as usize];
            if is_negative { -value } else { value }
        }
    }
}
