//! Recorded functions with the shapes and units of what they read and write, and the module that they make up.

use crate::graph::{Arguments, Graph, Operand, value_of};

/// Type of the numbers of a generated file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Width {
    /// `f32`, C's `float`: 24 bits.
    Single,
    /// `f64`, C's `double`: 53 bits.
    Double,
}

/// A list of numbers that a function reads.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// Its name.
    pub name: &'static str,
    /// How many numbers.
    pub len: usize,
    /// What it is, with its unit.
    pub about: String,
}

/// An array that a function writes.
#[derive(Clone, Debug, PartialEq)]
pub struct Output {
    /// Its name.
    pub name: &'static str,
    /// Its dimensions, the outermost first.
    pub shape: Vec<usize>,
    /// What it is, with its unit.
    pub about: String,
    /// Its entries, those of the last dimension next to each other.
    pub entries: Vec<Operand>,
}

/// A recorded function.
#[derive(Clone, Debug)]
pub struct Function {
    /// Its name.
    pub name: &'static str,
    /// What it computes.
    pub about: String,
    /// How many digits the word and the word before have, which it reads first; 0: it reads none.
    pub digits: usize,
    /// What it reads, in the order of its arguments.
    pub inputs: Vec<Input>,
    /// What it writes.
    pub outputs: Vec<Output>,
    /// What it computes between them.
    pub graph: Graph,
}

/// A matrix of constants.
#[derive(Clone, Debug, PartialEq)]
pub struct Constant {
    /// Its name.
    pub name: &'static str,
    /// What it is, with its unit.
    pub about: String,
    /// How many columns it has.
    pub columns: usize,
    /// Its entries, by rows.
    pub entries: Vec<f64>,
}

/// The functions of one robot or arm.
#[derive(Clone, Debug)]
pub struct Module {
    /// Name of the robot, for names in C.
    pub name: String,
    /// What the file's head says: one paragraph a line.
    pub about: Vec<String>,
    /// Constants.
    pub constants: Vec<Constant>,
    /// Functions.
    pub functions: Vec<Function>,
}

impl Function {
    /// The entries of all outputs.
    pub fn results(&self) -> impl Iterator<Item = Operand> {
        self.outputs.iter().flat_map(|output| output.entries.iter().copied())
    }

    /// What it writes for these arguments, output by output.
    pub fn evaluate(&self, arguments: &Arguments<'_>) -> Vec<Vec<f64>> {
        let mut values = Vec::new();
        self.graph.evaluate(arguments, &mut values);
        let entries = |output: &Output| output.entries.iter().map(|entry| value_of(*entry, &values)).collect();
        self.outputs.iter().map(entries).collect()
    }

    /// The input that element `index` of all inputs belongs to, and its place there.
    #[expect(clippy::missing_panics_doc, reason = "a recording counts its inputs as it declares them")]
    pub fn input(&self, index: u32) -> (&Input, usize) {
        let mut place = index as usize;
        let mut inputs = self.inputs.iter();
        loop {
            let input = inputs.next().expect("a recording counts its inputs as it declares them");
            if place < input.len {
                return (input, place);
            }
            place -= input.len;
        }
    }
}
