//! Straight-line code for one robot or arm, in Rust or C, from one pass over the core's own generic functions.
//!
//! [`scalar::Recorded`] runs through the core in place of a number and leaves a [`graph::Graph`] of operations, with the
//! constants of the robot folded. [`optimize`] removes what is not used and shares what is computed twice, and the writers
//! in [`rust`] and [`c`] print it as functions without a loop, a branch, an allocation or a dependency. There is no second set
//! of formulas.

pub mod arm;
pub mod c;
pub mod function;
pub mod graph;
pub mod optimize;
mod recording;
pub mod robot;
pub mod rust;
pub mod scalar;
mod text;

pub use function::{Function, Input, Module, Output, Width};
