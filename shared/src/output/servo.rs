//! One servo joint on the bus, and the limits of its motion.

use serde::{Deserialize, Serialize};

/// One servo joint on the bus, with the limits of its motion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ServoWiring {
    /// Address on the bus.
    pub id: u8,
    /// Smallest joint angle.
    pub min_rad: f32,
    /// Largest joint angle.
    pub max_rad: f32,
    /// Largest speed, also that of the first move after power-on.
    pub max_speed_rad_s: f32,
    /// Largest torque as a share of the servo's own, 0 to 1.
    pub max_torque: f32,
    /// No answer for this time is a fault.
    pub timeout_ms: u16,
}

impl ServoWiring {
    /// Largest angle of a servo's shaft, either way.
    pub const MAX_RAD: f32 = 3.2;
    /// Smallest speed: one step of 1/4096 turn in a second, the smallest that a servo can be given.
    pub const MIN_SPEED_RAD_S: f32 = core::f32::consts::TAU / 4096.0;
    /// Largest speed.
    pub const MAX_SPEED_RAD_S: f32 = 50.0;
    /// Longest time without an answer.
    pub const MAX_TIMEOUT_MS: u16 = 5_000;
    /// Largest address of one servo; 254 speaks to all.
    pub const MAX_ID: u8 = 253;
    /// A servo may be seen this far out of its range before that is a fault: overshoot and resolution.
    pub const RANGE_MARGIN_RAD: f32 = 0.02;

    /// Whether address, range, speed, torque and time-out make sense.
    pub fn is_sound(&self) -> bool {
        self.id <= Self::MAX_ID
            && self.min_rad < self.max_rad
            && self.min_rad >= -Self::MAX_RAD
            && self.max_rad <= Self::MAX_RAD
            && self.max_speed_rad_s >= Self::MIN_SPEED_RAD_S
            && self.max_speed_rad_s <= Self::MAX_SPEED_RAD_S
            && self.max_torque > 0.0
            && self.max_torque <= 1.0
            && (1..=Self::MAX_TIMEOUT_MS).contains(&self.timeout_ms)
    }

    /// Whether a servo that is seen there keeps its range, up to [`RANGE_MARGIN_RAD`](Self::RANGE_MARGIN_RAD).
    pub fn keeps_range(&self, angle_rad: f32) -> bool {
        (self.min_rad - Self::RANGE_MARGIN_RAD..=self.max_rad + Self::RANGE_MARGIN_RAD).contains(&angle_rad)
    }

    /// Whether these limits of a profile allow those of a table: the same servo, no faster, stronger or more patient.
    /// Ranges are compared when it moves, since a table's are those of the joint.
    pub fn allows(&self, table: &Self) -> bool {
        table.id == self.id
            && table.max_speed_rad_s <= self.max_speed_rad_s
            && table.max_torque <= self.max_torque
            && table.timeout_ms <= self.timeout_ms
    }
}
