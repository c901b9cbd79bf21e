//! A module as a file of Rust: `no_std`, without dependencies.

use std::fmt::Write as _;

use crate::function::{Constant, Function, Module, Width};
use crate::graph::Operand;
use crate::text::{Binding, Body, Language, Step, WORDS, indices, paragraph};

/// Sine and cosine of the core in `f64`.
const DOUBLE: &str = include_str!("rust/double.rs.txt");
/// The same in `f32`.
const SINGLE: &str = include_str!("rust/single.rs.txt");

/// The root in `f64`, which a crate without `std` does not have.
const DOUBLE_ROOT: &str = include_str!("rust/double_root.rs.txt");
/// The root of the core in `f32`.
const SINGLE_ROOT: &str = include_str!("rust/single_root.rs.txt");

/// The file.
pub fn file(module: &Module, width: Width) -> String {
    let number = match width {
        Width::Single => "f32",
        Width::Double => "f64",
    };
    let mut text: String = module.about.iter().map(|line| paragraph("//! ", line)).collect();
    text += "#![allow(dead_code, unreachable_pub, unused_parens, unused_variables, clippy::all)]\n\n";
    for constant in &module.constants {
        text += &paragraph("/// ", &constant.about);
        let kind = array(number, &[constant.entries.len() / constant.columns, constant.columns]);
        _ = writeln!(text, "pub const {}: {kind} = [\n{}];\n", constant.name, rows(constant, width));
    }
    for function in &module.functions {
        text += &self::function(function, width, number);
        text += "\n";
    }
    let [turns, root] = match width {
        Width::Single => [SINGLE, SINGLE_ROOT],
        Width::Double => [DOUBLE, DOUBLE_ROOT],
    };
    let called = [("sin_cos(", turns), ("square_root(", root)].into_iter().filter(|(call, _)| text.contains(call));
    let parts: Vec<_> = called.map(|(_, part)| part).collect();
    text + &parts.join("\n")
}

fn function(function: &Function, width: Width, number: &str) -> String {
    let language = Rust { width };
    let body = Body::new(function);
    let mut text = paragraph("/// ", &function.about);
    text += "///\n";
    if function.digits > 0 {
        text += &paragraph("/// ", &format!("- {WORDS}."));
    }
    for input in &function.inputs {
        text += &paragraph("/// ", &format!("- `{}`: {}.", input.name, input.about));
    }
    for output in &function.outputs {
        text += &paragraph("/// ", &format!("- writes `{}`: {}.", output.name, output.about));
    }
    let words =
        ["word", "previous"].map(|name| (function.digits > 0).then(|| format!("{name}: &[u8; {}]", function.digits)));
    let inputs = function.inputs.iter().map(|input| format!("{}: &[{number}; {}]", input.name, input.len));
    let outputs =
        function.outputs.iter().map(|output| format!("{}: &mut {}", output.name, array(number, &output.shape)));
    let arguments: Vec<_> = words.into_iter().flatten().chain(inputs).chain(outputs).collect();
    _ = writeln!(text, "pub fn {}({}) {{", function.name, arguments.join(", "));
    for step in body.steps() {
        match step {
            Step::Turns(turns) => text += &language.turns(&body, &turns),
            Step::Named(node) => {
                _ = writeln!(text, "    let t{node} = {};", body.expression(node, &language).0);
            }
            Step::Store { output, entry } => {
                let output = &function.outputs[output];
                let value = body.operand(output.entries[entry], Binding::Sum, &language);
                _ = writeln!(text, "    {}{} = {value};", output.name, indices(&output.shape, entry));
            }
        }
    }
    text + "}\n"
}

/// An array of arrays as a type.
fn array(number: &str, shape: &[usize]) -> String {
    shape.iter().rev().fold(number.to_owned(), |inner, size| format!("[{inner}; {size}]"))
}

/// The rows of a constant, one a line.
fn rows(constant: &Constant, width: Width) -> String {
    let row = |row: &[f64]| row.iter().map(|value| literal(*value, width)).collect::<Vec<_>>().join(", ");
    constant.entries.chunks(constant.columns).map(|numbers| format!("    [{}],\n", row(numbers))).collect()
}

/// The shortest digits that give the number.
fn literal(value: f64, width: Width) -> String {
    match width {
        Width::Single => format!("{:?}", value as f32),
        Width::Double => format!("{value:?}"),
    }
}

struct Rust {
    width: Width,
}

impl Rust {
    fn turns(&self, body: &Body<'_>, turns: &[(u32, Operand)]) -> String {
        let names: Vec<_> = turns.iter().map(|(node, _)| format!("(s{node}, c{node})")).collect();
        let angles: Vec<_> = turns.iter().map(|(_, angle)| body.operand(*angle, Binding::Sum, self)).collect();
        format!("    let [{}] = sin_cos([{}]);\n", names.join(", "), angles.join(", "))
    }
}

impl Language for Rust {
    fn number(&self, value: f64) -> String {
        literal(value, self.width)
    }

    fn element(&self, name: &str, place: usize) -> String {
        format!("{name}[{place}]")
    }

    fn root(&self, of: &str) -> String {
        format!("square_root({of})")
    }

    fn absolute(&self, of: &str) -> String {
        format!("({of}).abs()")
    }

    fn maximum(&self, a: &str, b: &str) -> String {
        format!("({a}).max({b})")
    }

    fn minimum(&self, a: &str, b: &str) -> String {
        format!("({a}).min({b})")
    }

    fn choice(&self, question: &str, yes: &str, no: &str) -> String {
        format!("(if {question} {{ {yes} }} else {{ {no} }})")
    }

    fn truth(&self, question: &str) -> String {
        format!("u8::from({question})")
    }
}
