//! What the writers of both languages share: the order of the statements, and which values have a name.

use std::collections::HashMap;
use std::fmt::Write as _;

use crate::function::Function;
use crate::graph::{Operand, Operation, Question};
use crate::optimize::uses;

/// What the two words are that a function of an arm reads.
pub(crate) const WORDS: &str = "`word` and `previous`: the digit of each actuator now, and in the word before; one that is no state counts as the last";

/// How a language writes operations.
pub(crate) trait Language {
    /// A constant.
    fn number(&self, value: f64) -> String;
    /// Element `place` of the input `name`.
    fn element(&self, name: &str, place: usize) -> String;
    /// The root of an expression.
    fn root(&self, of: &str) -> String;
    /// The absolute value of an expression.
    fn absolute(&self, of: &str) -> String;
    /// The larger of two expressions.
    fn maximum(&self, a: &str, b: &str) -> String;
    /// The smaller of two expressions.
    fn minimum(&self, a: &str, b: &str) -> String;
    /// One of two expressions.
    fn choice(&self, question: &str, yes: &str, no: &str) -> String;
    /// The answer of a question as a number, 1 or 0.
    fn truth(&self, question: &str) -> String;
}

/// A step of a function's body.
pub(crate) enum Step {
    /// Sines and cosines of these angles, each under the number of its node.
    Turns(Vec<(u32, Operand)>),
    /// A value that is read more than once, under the number of its node.
    Named(u32),
    /// An entry of an output is known.
    Store {
        /// Number of the output.
        output: usize,
        /// Number of the entry.
        entry: usize,
    },
}

/// How tightly an expression holds together.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
pub(crate) enum Binding {
    /// A sum.
    Sum,
    /// A product or a quotient.
    Product,
    /// A negated atom.
    Sign,
    /// A name, a number, a call.
    Atom,
}

/// A function on its way to a text.
pub(crate) struct Body<'a> {
    pub(crate) function: &'a Function,
    uses: Vec<u32>,
    /// Node of the sine of each angle: sine and cosine of one angle are computed together.
    turn: HashMap<Operand, u32>,
}

impl<'a> Body<'a> {
    pub(crate) fn new(function: &'a Function) -> Self {
        let uses = uses(function);
        let mut turn = HashMap::new();
        for (node, operation) in function.graph.operations().iter().enumerate() {
            if let (Operation::Sine(a) | Operation::Cosine(a), true) = (operation, uses[node] > 0) {
                turn.entry(*a).or_insert(node as u32);
            }
        }
        Self { function, uses, turn }
    }

    /// Whether the value gets a name: what is read once is written where it is read.
    fn is_named(&self, node: u32) -> bool {
        match self.function.graph.operation(node) {
            Operation::Input(_) | Operation::Sine(_) | Operation::Cosine(_) => false,
            _ => self.uses[node as usize] > 1,
        }
    }

    /// The steps: every value right before what first needs it, the outputs in their order.
    pub(crate) fn steps(&self) -> Vec<Step> {
        let graph = &self.function.graph;
        let mut steps = Vec::new();
        let mut done = vec![false; graph.operations().len()];
        // Angles that depend on the inputs alone are turned into sines and cosines side by side.
        let mut depends = vec![false; done.len()];
        let mut first = Vec::new();
        for (node, operation) in graph.operations().iter().enumerate() {
            let on_turn = operation.operands().filter_map(Operand::node).any(|node| depends[node as usize]);
            let is_turn = matches!(operation, Operation::Sine(_) | Operation::Cosine(_));
            depends[node] = on_turn || is_turn;
            if let Operation::Sine(a) | Operation::Cosine(a) = operation
                && !on_turn
                && self.turn.get(a) == Some(&(node as u32))
            {
                first.push((node as u32, *a));
            }
        }
        for (_, angle) in &first {
            self.need(*angle, &mut done, &mut steps);
        }
        if !first.is_empty() {
            first.iter().for_each(|(node, _)| done[*node as usize] = true);
            steps.push(Step::Turns(first));
        }
        for (output, written) in self.function.outputs.iter().enumerate() {
            for (entry, value) in written.entries.iter().enumerate() {
                self.need(*value, &mut done, &mut steps);
                steps.push(Step::Store { output, entry });
            }
        }
        steps
    }

    /// Adds what `operand` needs and is not there yet.
    fn need(&self, operand: Operand, done: &mut [bool], steps: &mut Vec<Step>) {
        let Some(node) = operand.node() else { return };
        if done[node as usize] {
            return;
        }
        let operation = self.function.graph.operation(node);
        if let Operation::Sine(a) | Operation::Cosine(a) = operation {
            let turn = self.turn[&a];
            if !done[turn as usize] {
                self.need(a, done, steps);
                steps.push(Step::Turns(vec![(turn, a)]));
                done[turn as usize] = true;
            }
            done[node as usize] = true;
            return;
        }
        operation.operands().for_each(|operand| self.need(operand, done, steps));
        done[node as usize] = true;
        if self.is_named(node) {
            steps.push(Step::Named(node));
        }
    }

    /// An operand as an expression that holds together as `needed`.
    pub(crate) fn operand(&self, operand: Operand, needed: Binding, language: &impl Language) -> String {
        let (text, binding) = match operand {
            Operand::Constant(bits) => {
                let value = f64::from_bits(bits);
                (language.number(value), if value < 0.0 { Binding::Sign } else { Binding::Atom })
            }
            Operand::Value { node, is_negative: false } => self.value(node, language),
            Operand::Value { node, is_negative: true } => self.negated(node, language),
        };
        if binding >= needed { text } else { format!("({text})") }
    }

    /// A value by its name, or the expression that it is.
    fn value(&self, node: u32, language: &impl Language) -> (String, Binding) {
        if self.is_named(node) { (format!("t{node}"), Binding::Atom) } else { self.expression(node, language) }
    }

    /// A value with the other sign: of a difference, the difference the other way round.
    fn negated(&self, node: u32, language: &impl Language) -> (String, Binding) {
        if let (false, Operation::Sum(a, b)) = (self.is_named(node), self.function.graph.operation(node))
            && let (b, true) = b.split()
        {
            let [b, a] = [self.operand(b, Binding::Sum, language), self.operand(a, Binding::Product, language)];
            return (format!("{b} - {a}"), Binding::Sum);
        }
        match self.value(node, language) {
            (text, Binding::Atom) => (format!("-{text}"), Binding::Sign),
            (text, _) => (format!("-({text})"), Binding::Sign),
        }
    }

    /// The operation of a node as an expression.
    pub(crate) fn expression(&self, node: u32, language: &impl Language) -> (String, Binding) {
        let any = |a| self.operand(a, Binding::Sum, language);
        let atom = Binding::Atom;
        match self.function.graph.operation(node) {
            Operation::Input(index) => {
                let (input, place) = self.function.input(index);
                (language.element(input.name, place), atom)
            }
            Operation::Sum(a, b) => {
                let (b, is_negative) = b.split();
                let sign = if is_negative { '-' } else { '+' };
                (format!("{} {sign} {}", any(a), self.operand(b, Binding::Product, language)), Binding::Sum)
            }
            Operation::Product(a, b) => (
                format!(
                    "{} * {}",
                    self.operand(a, Binding::Product, language),
                    self.operand(b, Binding::Sign, language)
                ),
                Binding::Product,
            ),
            Operation::Quotient(a, b) => (
                format!(
                    "{} / {}",
                    self.operand(a, Binding::Product, language),
                    self.operand(b, Binding::Sign, language)
                ),
                Binding::Product,
            ),
            Operation::Sine(a) => (format!("s{}", self.turn[&a]), atom),
            Operation::Cosine(a) => (format!("c{}", self.turn[&a]), atom),
            Operation::Root(a) => (language.root(&any(a)), atom),
            Operation::Absolute(a) => (language.absolute(&any(a)), atom),
            Operation::Maximum(a, b) => (language.maximum(&any(a), &any(b)), atom),
            Operation::Minimum(a, b) => (language.minimum(&any(a), &any(b)), atom),
            Operation::Choice(asked, a, b) => (language.choice(&question(asked, language), &any(a), &any(b)), atom),
        }
    }
}

/// A question in what both languages share.
fn question(asked: Question, language: &impl Language) -> String {
    match asked {
        Question::Digit { actuator, state } => format!("word[{actuator}] == {state}"),
        Question::Previous { actuator, state } => format!("previous[{actuator}] == {state}"),
        Question::Together { actuator, first, end, count } => {
            let others = (first..end).filter(|other| *other != actuator);
            let switched = others.map(|other| language.truth(&format!("word[{other}] != previous[{other}]")));
            format!("{} == {count}", switched.collect::<Vec<_>>().join(" + "))
        }
    }
}

/// The indices of entry `entry` of an array of this shape, each in brackets.
pub(crate) fn indices(shape: &[usize], entry: usize) -> String {
    let mut rest = entry;
    let mut text: Vec<String> = shape
        .iter()
        .rev()
        .map(|size| {
            let index = rest % size;
            rest /= size;
            format!("[{index}]")
        })
        .collect();
    text.reverse();
    text.concat()
}

/// A paragraph in lines of at most 120 characters that begin with `start`. A name of a file ends neither a line nor a comment of C.
pub(crate) fn paragraph(start: &str, text: &str) -> String {
    let mut lines = String::new();
    let mut line = String::new();
    for word in text.replace("*/", "* /").split_whitespace() {
        if !line.is_empty() && start.len() + line.chars().count() + 1 + word.chars().count() > 120 {
            _ = writeln!(lines, "{start}{line}");
            line.clear();
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line += word;
    }
    _ = writeln!(lines, "{start}{line}");
    lines
}
