//! Recordings of other programs as tables of measurements: what a file holds, which of it is meant, and in which unit.
//!
//! ```text
//! file ─► read ─► Recording ─► proposal ─► Mapping ─► table ─► CSV or MCAP
//!                 parts of columns          target = source * unit
//! ```
//!
//! [`read()`] gives a [`Recording`]: a part for each table, array or topic. [`proposal`] guesses what its columns mean,
//! [`mapping`] says it, [`table`] joins the parts row by row or by time and converts units. Nothing else of the workspace
//! knows these formats: every command that takes measurements reads what comes out.

mod array;
mod clock;
mod delimited;
mod error;
pub(crate) mod header;
pub mod join;
pub mod map_file;
pub mod mapping;
pub mod proposal;
pub mod read;
pub mod recording;
mod ros;
pub mod summary;
pub mod table;
pub mod time_stamp;

pub use error::ImportError;
pub use read::read;
pub use recording::{Column, Part, Recording};
