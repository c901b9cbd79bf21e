//! The person at the arm, as the bring-up asks.

use super::subject::Subject;

/// What comes next.
#[derive(Clone, Copy, Debug)]
pub struct Step<'a> {
    /// The arm.
    pub subject: &'a Subject,
    /// Number of the output that is switched.
    pub output: u8,
    /// The actuator that it is to move.
    pub actuator: usize,
    /// The state that the actuator is to take.
    pub state: u8,
    /// How long the output is on, ms.
    pub on_ms: u32,
}

/// Whether an output may be switched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Consent {
    /// Yes.
    Go,
    /// Not this one.
    Skip,
    /// No more.
    Quit,
}

/// What a person saw of a stroke.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Look {
    /// Nobody looked.
    Nobody,
    /// It has to be repeated to be seen.
    Again,
    /// These actuators moved.
    Moved(Vec<usize>),
}

/// A person at the arm, or whoever answers for one.
pub trait Operator {
    /// May this output be switched on now?
    fn consent(&mut self, step: &Step<'_>) -> Consent;
    /// Which actuators moved just now?
    fn moved(&mut self, step: &Step<'_>) -> Look;
    /// Was the actuator in the state of the step while the output was on? `None` where it is unknown.
    fn in_state(&mut self, step: &Step<'_>) -> Option<bool>;
    /// Presses the emergency stop, or releases it; false where nobody is there to do it.
    fn emergency_stop(&mut self, pressed: bool) -> bool;
    /// The board lets an output recover, for at most this time in ms.
    fn waiting(&mut self, output: u8, wait_ms: u32);
    /// Whether the bring-up is to end at once.
    fn is_interrupted(&mut self) -> bool;
}
