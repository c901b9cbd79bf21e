//! Stage 1: rows that count, rows that no fit may see, which rows are left out together, and the noise.

pub(crate) mod column_reading;
mod damaged_cells;
mod error;
pub mod groups;
pub mod observations;
pub mod repeatability;
pub(crate) mod resolution;
pub(crate) mod run_findings;
pub mod sampling;
pub mod signals;
pub(crate) mod table_findings;
pub(crate) mod thinning;
mod turns;
