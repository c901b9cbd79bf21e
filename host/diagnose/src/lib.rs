//! Diagnosis: which physical effect is missing in a model, traced from predicted minus measured, and how certain that is.
//!
//! ```text
//! measurement ─► prepare ─► linearise ─► select ─► project ─► judge ─► report
//!  tables, logs   rows,      residuals    effects   bodies     verdict   sentences
//!                 noise,     and their    by cross- that can   and what
//!                 folds      derivatives  validation exist     rests on it
//! ```
//!
//! Start reading at [`diagnosis`], which calls the stages in this order. A kind of measurement (tool pose, joint torque,
//! force, held position, contact wrench, point contact) differs from the others by how it predicts, by its laws and by its
//! noise: see [`linearise`].

pub(crate) mod agreement;
pub mod calibrate;
pub mod correction;
pub mod diagnosis;
pub mod effect;
pub mod error;
pub mod files;
pub mod judge;
pub(crate) mod least_squares;
pub mod linearise;
pub mod measured;
pub mod measurement_plan;
pub mod misreading;
pub mod model_file;
pub(crate) mod number;
pub mod outcome;
pub mod overview;
pub mod prepare;
pub mod progress;
pub mod project;
pub mod rejection;
pub mod report;
pub mod select;

pub mod truth;
