//! Stage 5: what the selected effects leave, what else explains the measurements as well, and what to measure next.

pub(crate) mod constancy;
pub(crate) mod far_rows;
pub mod fitted_terms;
pub(crate) mod gate;
pub(crate) mod held_out;
pub mod intervals;
mod jumps;
pub(crate) mod lack_of_fit;
pub mod next_rows;
pub mod next_words;
mod own_angle;
pub mod pose_dictionary;
pub mod pose_intervals;
pub mod poses;
pub mod regression;
pub mod remaining;
pub mod scatter;
pub mod selected;
pub mod signals;
pub mod structure;

use crate::outcome::{Alternative, Effect, NextMeasurement, Repeatability, Structure, Verdict};

/// What is concluded, whatever was measured.
pub(crate) struct Judgement {
    pub(crate) verdict: Verdict,
    /// The effects that are named.
    pub(crate) effects: Vec<Effect>,
    pub(crate) alternatives: Vec<Alternative>,
    pub(crate) unobservable: Vec<String>,
    /// Effects of the best model that these data do not confirm.
    pub(crate) unconfirmed: Vec<String>,
    pub(crate) repeatability: Option<Repeatability>,
    /// Whether the noise is known well enough to say that nothing else is left.
    pub(crate) is_noise_known: bool,
    /// Whether more than noise is left with the effects selected.
    pub(crate) is_more_left: bool,
    /// What the residual depends on before any effect is added; not looked for in signals.
    pub(crate) structure: Option<Structure>,
    /// What it depends on with the effects selected.
    pub(crate) remaining: Structure,
    pub(crate) next_measurement: Option<NextMeasurement>,
}
