//! What the board sees in one tick, and what it drives until the next.

use serde::{Deserialize, Serialize};

use crate::output::MAX_SERVOS;
use crate::units::Micros;

/// What the board sees in one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seen {
    /// Limit switches: bit `i` is input `i`, high when closed.
    pub switches: u32,
    /// What each servo answered last.
    pub servos: [ServoSeen; MAX_SERVOS],
    /// What each servo does that its profile does not allow, whatever it is to do.
    pub servo_breaches: [Option<ServoBreach>; MAX_SERVOS],
    /// The output chain does not return what was shifted into it, or does not bring it to the latch.
    pub chain_broken: bool,
    /// The level at which output enable stays although the board drives the other one.
    pub enable_stuck: Option<EnableLevel>,
    /// What the far end of the chain shows.
    pub far_end: FarEnd,
    /// Supply of the board where it was measured since the tick before, mV; 0 where a measurement gave nothing.
    pub supply_mv: Option<u16>,
}

/// A level of output enable, which is active low.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EnableLevel {
    /// Outputs are enabled.
    Low,
    /// Outputs are disabled.
    High,
}

/// What the far end of the output chain shows, the serial output of its last chip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FarEnd {
    /// The board has no input for it.
    #[default]
    Absent,
    /// It has not answered, and is asked again.
    Trying,
    /// It has not answered, as often as it was asked.
    Silent,
    /// The chain has this many chips.
    Chips(u8),
}

/// The last answer of one servo.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ServoSeen {
    /// Angle of its shaft; the joint's is this less the calibrated offset.
    pub angle_rad: f32,
    /// Load as a share of the servo's own torque, 0 to 1.
    pub load: f32,
    /// Error bits of its status byte, 0 when it is well.
    pub error: u8,
    /// When this answer was requested; `None` before the first one.
    pub answered: Option<Micros>,
}

/// What a servo does that its profile does not allow, as several of its answers say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ServoBreach {
    /// Its shaft is out of the range.
    Range,
    /// It turns faster than it may.
    Speed,
    /// It has torque and leaves the angle that it is to hold, or its target.
    Moved,
}

/// What the board drives until the next tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outputs {
    /// Lines of the output chain: bit `i` is line `i`.
    pub lines: u64,
    /// Output enable of the chain; without it no line carries current. Only while a line is high.
    pub enabled: bool,
    /// A row begins in this tick, and the profile has a pulse to a camera.
    pub sync: bool,
    /// What each servo of the profile does.
    pub servos: [ServoAction; MAX_SERVOS],
}

/// What one servo does.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum ServoAction {
    /// Holds the angle that it has if it has torque, and stays without torque if it has none.
    #[default]
    Hold,
    /// Has no torque.
    Release,
    /// Goes to a target.
    Go(ServoTarget),
}

/// Where one servo is to go, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServoTarget {
    /// Angle of its shaft.
    pub angle_rad: f32,
    /// Speed on the way.
    pub speed_rad_s: f32,
    /// Largest torque as a share of the servo's own, 0 to 1.
    pub torque: f32,
}
