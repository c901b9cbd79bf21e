//! A function from one run of generic code on recorded numbers.

use crate::function::{Function, Input, Output};
use crate::graph::Arguments;
use crate::optimize::optimized;
use crate::scalar::{RecordError, Recorded, inputs, record};

/// An array of recorded numbers on its way to an [`Output`].
pub(crate) struct Written {
    pub(crate) name: &'static str,
    pub(crate) shape: Vec<usize>,
    pub(crate) about: String,
    pub(crate) entries: Vec<Recorded>,
}

/// What a function is and reads.
pub(crate) struct Signature {
    pub(crate) name: &'static str,
    pub(crate) about: String,
    pub(crate) digits: usize,
    pub(crate) inputs: Vec<Input>,
}

/// Records `code`, which gets the numbers of each input and gives the outputs. Comparisons of values are answered as they are
/// for the arguments of `sample`; without it they fail.
pub(crate) fn recorded_function(
    signature: Signature,
    sample: Option<&Arguments<'_>>,
    code: impl FnOnce(&[Vec<Recorded>]) -> Vec<Written>,
) -> Result<Function, RecordError> {
    let Signature { name, about, digits, inputs: reads } = signature;
    let (written, graph) = record(sample, || {
        let read: Vec<_> = reads.iter().map(|input| inputs(input.len)).collect();
        code(&read)
    })?;
    let output = |written: Written| Output {
        name: written.name,
        shape: written.shape,
        about: written.about,
        entries: written.entries.into_iter().map(Recorded::operand).collect(),
    };
    let outputs = written.into_iter().map(output).collect();
    Ok(optimized(Function { name, about, digits, inputs: reads, outputs, graph }))
}
