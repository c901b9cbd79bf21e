//! A module as a header of C99, whose functions are `static inline` and call nothing but each other.

use std::fmt::Write as _;

use crate::function::{Constant, Function, Module, Width};
use crate::graph::Operand;
use crate::text::{Binding, Body, Language, Step, WORDS, indices, paragraph};

/// Sine and cosine of the core in `double`.
const DOUBLE: &str = include_str!("c/double.h.txt");
/// The same in `float`.
const SINGLE: &str = include_str!("c/single.h.txt");

/// The header.
pub fn file(module: &Module, width: Width) -> String {
    let prefix = identifier(&module.name);
    let guard = format!("{}_H", prefix.to_uppercase());
    let (number, turns) = match width {
        Width::Single => ("float", SINGLE),
        Width::Double => ("double", DOUBLE),
    };
    let mut text = String::from("/*\n");
    text += &module.about.iter().map(|line| paragraph(" * ", line)).collect::<String>();
    text += &paragraph(
        " * ",
        "Arrays are by rows. Names begin with the robot's. With -ffp-contract=off the results are those of the generated Rust, bit \
         by bit.",
    );
    _ = writeln!(
        text,
        " */\n#ifndef {guard}\n#define {guard}\n\n#include <math.h>\n#include <stdint.h>\n#include <string.h>\n"
    );
    text += &turns.replace("PREFIX", &prefix);
    let language = C { width, prefix };
    for constant in &module.constants {
        text += &language.constant(constant, number);
    }
    for function in &module.functions {
        text += &language.function(function, number);
    }
    text + "\n#endif\n"
}

/// A name as C has it: letters, digits and underscores, in lower case.
fn identifier(name: &str) -> String {
    let letter = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' };
    let text: String = name.chars().map(letter).collect();
    if text.starts_with(|c: char| c.is_ascii_alphabetic()) { text } else { format!("robot_{text}") }
}

struct C {
    width: Width,
    prefix: String,
}

impl C {
    fn constant(&self, constant: &Constant, number: &str) -> String {
        let row = |row: &[f64]| row.iter().map(|value| self.number(*value)).collect::<Vec<_>>().join(", ");
        let rows = constant.entries.chunks(constant.columns);
        format!(
            "\n/*\n{} */\nstatic const {number} {}_{}[{}][{}] = {{\n{}}};\n",
            paragraph(" * ", &constant.about),
            self.prefix.to_uppercase(),
            constant.name,
            rows.len(),
            constant.columns,
            rows.map(|numbers| format!("    {{{}}},\n", row(numbers))).collect::<String>()
        )
    }

    fn function(&self, function: &Function, number: &str) -> String {
        let body = Body::new(function);
        let mut text = format!("\n/*\n{} *\n", paragraph(" * ", &function.about));
        if function.digits > 0 {
            text += &paragraph(" * ", &format!("{WORDS}."));
        }
        for input in &function.inputs {
            text += &paragraph(" * ", &format!("{}: {}.", input.name, input.about));
        }
        for output in &function.outputs {
            text += &paragraph(" * ", &format!("writes {}: {}.", output.name, output.about));
        }
        let words = ["word", "previous"]
            .map(|name| (function.digits > 0).then(|| format!("const uint8_t {name}[{}]", function.digits)));
        let inputs = function.inputs.iter().map(|input| format!("const {number} {}[{}]", input.name, input.len));
        let outputs = function.outputs.iter().map(|output| {
            let dimensions: String = output.shape.iter().map(|size| format!("[{size}]")).collect();
            format!("{number} {}{dimensions}", output.name)
        });
        let arguments: Vec<_> = words.into_iter().flatten().chain(inputs).chain(outputs).collect();
        _ = writeln!(text, " */\nstatic inline void {}_{}({}) {{", self.prefix, function.name, arguments.join(", "));
        let head = text.len();
        for step in body.steps() {
            match step {
                Step::Turns(turns) => text += &self.turns(&body, &turns, number),
                Step::Named(node) => {
                    _ = writeln!(text, "    const {number} t{node} = {};", body.expression(node, self).0);
                }
                Step::Store { output, entry } => {
                    let output = &function.outputs[output];
                    let value = body.operand(output.entries[entry], Binding::Sum, self);
                    _ = writeln!(text, "    {}{} = {value};", output.name, indices(&output.shape, entry));
                }
            }
        }
        // A Jacobian may be constant, and a warning of an unused argument is an error in some firmware.
        let unused = function.inputs.iter().filter(|input| !text[head..].contains(&format!("{}[", input.name)));
        let unused: String = unused.map(|input| format!("    (void){};\n", input.name)).collect();
        text.insert_str(head, &unused);
        text + "}\n"
    }

    fn turns(&self, body: &Body<'_>, turns: &[(u32, Operand)], number: &str) -> String {
        let line = |(node, angle): &(u32, Operand)| {
            let angle = body.operand(*angle, Binding::Sum, self);
            format!("    {number} s{node}, c{node};\n    {}_sin_cos({angle}, &s{node}, &c{node});\n", self.prefix)
        };
        turns.iter().map(line).collect()
    }

    /// A function of `math.h` for the width.
    fn call(&self, name: &str, arguments: &str) -> String {
        let end = if self.width == Width::Single { "f" } else { "" };
        format!("{name}{end}({arguments})")
    }
}

impl Language for C {
    fn number(&self, value: f64) -> String {
        match self.width {
            Width::Single => format!("{:?}f", value as f32),
            Width::Double => format!("{value:?}"),
        }
    }

    fn element(&self, name: &str, place: usize) -> String {
        format!("{name}[{place}]")
    }

    fn root(&self, of: &str) -> String {
        self.call("sqrt", of)
    }

    fn absolute(&self, of: &str) -> String {
        self.call("fabs", of)
    }

    fn maximum(&self, a: &str, b: &str) -> String {
        self.call("fmax", &format!("{a}, {b}"))
    }

    fn minimum(&self, a: &str, b: &str) -> String {
        self.call("fmin", &format!("{a}, {b}"))
    }

    fn choice(&self, question: &str, yes: &str, no: &str) -> String {
        format!("({question} ? {yes} : {no})")
    }

    fn truth(&self, question: &str) -> String {
        format!("({question})")
    }
}
