//! Stage 3: which effects predict rows that no fit has seen better than the model without them.

pub mod forward;
pub mod poses;
pub mod problem;
pub mod signals;
pub mod significance;
