//! What is done to a graph once it is complete.

use crate::function::Function;
use crate::graph::{Graph, Operand, Operation};

/// The function with a graph of those operations alone that its outputs need.
pub fn optimized(function: Function) -> Function {
    rebuilt(function)
}

/// The graph again from what the outputs need, in the order in which it was made.
fn rebuilt(mut function: Function) -> Function {
    let uses = uses(&function);
    let mut graph = Graph::default();
    let mut moved = vec![Operand::ZERO; uses.len()];
    for (node, operation) in function.graph.operations().iter().enumerate() {
        if uses[node] > 0 {
            let at = |operand: Operand| renamed(operand, &moved);
            moved[node] = again(&mut graph, *operation, at);
        }
    }
    for output in &mut function.outputs {
        output.entries.iter_mut().for_each(|entry| *entry = renamed(*entry, &moved));
    }
    Function { graph, ..function }
}

fn renamed(operand: Operand, moved: &[Operand]) -> Operand {
    match operand {
        Operand::Constant(_) => operand,
        Operand::Value { node, is_negative } => moved[node as usize].signed(is_negative),
    }
}

/// An operation on other operands.
fn again(graph: &mut Graph, operation: Operation, at: impl Fn(Operand) -> Operand) -> Operand {
    match operation {
        Operation::Input(_) => graph.node(operation),
        Operation::Sum(a, b) => graph.sum(at(a), at(b)),
        Operation::Product(a, b) => graph.product(at(a), at(b)),
        Operation::Quotient(a, b) => graph.quotient(at(a), at(b)),
        Operation::Sine(a) => graph.sin_cos(at(a)).0,
        Operation::Cosine(a) => graph.sin_cos(at(a)).1,
        Operation::Root(a) => graph.root(at(a)),
        Operation::Absolute(a) => graph.absolute(at(a)),
        Operation::Maximum(a, b) => graph.maximum(at(a), at(b)),
        Operation::Minimum(a, b) => graph.minimum(at(a), at(b)),
        Operation::Choice(question, a, b) => graph.choice(question, at(a), at(b)),
    }
}

/// How often each node is read, by nodes that the outputs need and by the outputs.
pub fn uses(function: &Function) -> Vec<u32> {
    let operations = function.graph.operations();
    let mut uses = vec![0; operations.len()];
    let mut count = |operand: Operand| {
        if let Some(node) = operand.node() {
            uses[node as usize] += 1;
        }
    };
    function.results().for_each(&mut count);
    for (node, operation) in operations.iter().enumerate().rev() {
        if uses[node] > 0 {
            for operand in operation.operands() {
                if let Some(node) = operand.node() {
                    uses[node as usize] += 1;
                }
            }
        }
    }
    uses
}
