//! What a servo that is seen must be like.

use super::{FaultKind, ServoSeen};
use crate::output::ServoWiring;
use crate::units::Micros;

/// A servo may be seen this far out of its range before that is a fault: overshoot and resolution.
const RANGE_MARGIN_RAD: f32 = 0.02;

/// Whether a servo has answered before and does not any more.
pub(super) fn is_silent(now: Micros, joint: &ServoWiring, answered: Option<Micros>) -> bool {
    answered.is_some_and(|answered| now - answered > Micros::from_millis(u32::from(joint.timeout_ms)))
}

pub(super) fn check_servo(now: Micros, servo: u8, joint: &ServoWiring, seen: &ServoSeen) -> Result<(), FaultKind> {
    if seen.answered.is_none() {
        return Ok(());
    }
    let range = joint.min_rad - RANGE_MARGIN_RAD..=joint.max_rad + RANGE_MARGIN_RAD;
    if is_silent(now, joint, seen.answered) {
        Err(FaultKind::ServoSilent { servo })
    } else if seen.error != 0 {
        Err(FaultKind::ServoError { servo, bits: seen.error })
    } else if seen.load > joint.max_torque {
        Err(FaultKind::ServoTorque { servo, load: seen.load })
    } else if !range.contains(&seen.angle_rad) {
        Err(FaultKind::ServoRange { servo, angle_rad: seen.angle_rad })
    } else {
        Ok(())
    }
}
