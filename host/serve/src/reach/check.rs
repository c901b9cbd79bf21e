//! What a request about reach may hold, and why it is refused.

use darm_arm::arm::{Arm, frames};
use darm_core::units::Word;

use crate::refusal::{Kind, Refused};

/// Largest coordinate of a target, m: what is further away is a slip of the finger.
pub(super) const MAX_M: f64 = 1e3;

pub(super) fn refused(error: impl std::fmt::Display) -> Refused {
    Refused::new(Kind::Refused, error)
}

pub(super) fn invalid(text: impl std::fmt::Display) -> Refused {
    Refused::new(Kind::Invalid, text)
}

/// Parses a word of this arm.
pub(super) fn word(arm: &Arm, text: &str) -> Result<Word, Refused> {
    let word: Word = text.parse().map_err(|error| invalid(format!("{text}: {error}")))?;
    frames::check_word(&word, arm).map_err(invalid)?;
    Ok(word)
}

/// Checks angles of the servo joints, rad.
pub(super) fn checked_servos(arm: &Arm, servos_rad: &[f64]) -> Result<(), Refused> {
    if servos_rad.len() != arm.n_servos() {
        let expected = arm.n_servos();
        return Err(invalid(format!("{} servo angles, the arm has {expected} servo joints", servos_rad.len())));
    }
    for (index, (angle_rad, servo)) in servos_rad.iter().zip(&arm.servos).enumerate() {
        // A person types degrees, with few digits.
        let is_within = (f64::from(servo.min_rad) - 1e-3..=f64::from(servo.max_rad) + 1e-3).contains(angle_rad);
        if !is_within {
            let [angle, min, max] =
                [*angle_rad, servo.min_rad.into(), servo.max_rad.into()].map(|rad: f64| rad.to_degrees());
            let name = arm.servo_name(index);
            return Err(invalid(format!("servo {index} ({name}): {angle:.1}°, allowed {min:.1}° to {max:.1}°")));
        }
    }
    Ok(())
}
