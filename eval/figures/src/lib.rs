//! Measured figures and their goals; runs of many independent seeded items, spread over processes and machines.
//!
//! - [`figure`]: one row, and the JSON file that every measuring command writes.
//! - [`items`]: what a statistical command is made of, and how it runs.
//! - [`shard`]: which of the items a process runs.
//! - [`results`], [`merge`]: the files in which the outcomes are kept, and how several are joined.
//! - [`compare`], [`measured`]: two folders of figures compared; the table of `docs/measured.md`.
//!
//! `docs/evaluation.md` describes the same for users.

pub mod compare;
pub mod figure;
pub mod goals;
pub mod items;
pub mod measured;
pub mod merge;
pub mod number;
pub mod progress;
pub mod results;
pub mod shard;

use std::path::Path;

/// The root of the workspace.
#[expect(clippy::missing_panics_doc, reason = "the folder of this crate has two parents")]
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).expect("eval/figures is in the workspace")
}
