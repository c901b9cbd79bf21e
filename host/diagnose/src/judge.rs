//! Stage 5: what the selected effects leave, what else explains the measurements as well, and what to measure next.

pub mod fitted_terms;
pub(crate) mod gate;
pub(crate) mod held_out;
pub mod intervals;
pub mod next_rows;
pub mod next_words;
pub mod pose_dictionary;
pub mod poses;
pub mod regression;
pub mod remaining;
pub mod scatter;
pub mod selected;
pub mod signals;
pub mod structure;
