//! Stage 6: the outcome as plain data, and in sentences.

pub mod poses;
pub mod sentences;
pub mod signals;
