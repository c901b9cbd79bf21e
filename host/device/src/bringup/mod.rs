//! Bring-up of a new arm: each output is switched on and off by itself, the inputs are read back, and what they show is compared
//! with what the arm file and the board profile say.
//!
//! ```text
//!  run ──strokes──► judge ──findings──► correct ──► board profile
//!   │                 ▲                    travel ──► travel times of the arm file
//!   └─► Operator ─────┘ what a person saw
//! ```
//!
//! [`run`] moves the arm, one output at a time, and asks an [`Operator`]. The others are functions from values to values:
//! [`judge`] gives the findings of a list of [`Stroke`]s, [`correct`] the profile that follows from findings, [`travels`] the
//! times.
//!
//! The board drives only what its profile has, within its limits. The table that is loaded meanwhile has no limit switches, so
//! that a wrong wire does not latch the safe state before it is found.
//!
//! # What switches alone cannot show
//!
//! The inputs show only which output closes which switch. Two outputs that are exchanged look like two switches that are
//! exchanged, and where both are, all looks right. Which actuator moved is seen by a person; without one, a finding names
//! all causes that the inputs allow.

mod correct;
mod finding;
mod judge;
mod kind;
mod operator;
mod pairs;
mod response;
mod run;
mod stroke;
mod subject;
mod travel;
mod wording;

pub use correct::{Correction, correct};
pub use finding::Finding;
pub use judge::judge;
pub use kind::Kind;
pub use operator::{Consent, Look, Operator, Step};
pub use run::{BringupError, Outcome, run};
pub use stroke::{Edge, Sample, Sight, Span, Stroke};
pub use subject::Subject;
pub use travel::{Travel, travel_ms, travels};
