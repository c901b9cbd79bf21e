//! A function from one run of generic code on recorded numbers.

use crate::function::{Function, Input, Output};
use crate::optimize::optimized;
use crate::scalar::{RecordError, Recorded, inputs, record};

/// An array of recorded numbers on its way to an [`Output`].
pub(crate) struct Written {
    pub(crate) name: &'static str,
    pub(crate) shape: Vec<usize>,
    pub(crate) about: String,
    pub(crate) entries: Vec<Recorded>,
}

/// Records `code`, which gets the numbers of each input and gives the outputs.
pub(crate) fn recorded_function(
    name: &'static str,
    about: String,
    reads: Vec<Input>,
    code: impl FnOnce(&[Vec<Recorded>]) -> Vec<Written>,
) -> Result<Function, RecordError> {
    let (written, graph) = record(|| {
        let read: Vec<_> = reads.iter().map(|input| inputs(input.len)).collect();
        code(&read)
    })?;
    let output = |written: Written| Output {
        name: written.name,
        shape: written.shape,
        about: written.about,
        entries: written.entries.into_iter().map(Recorded::operand).collect(),
    };
    let function = Function { name, about, inputs: reads, outputs: written.into_iter().map(output).collect(), graph };
    Ok(optimized(function))
}
