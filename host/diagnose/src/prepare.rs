//! Stage 1: rows that count, rows that no fit may see, which rows are left out together, and the noise.

pub mod groups;
pub mod observations;
pub mod repeatability;
pub mod sampling;
pub mod signals;
