//! The modules of a table and their frames, checked while they arrive.

use super::TableError;
use crate::nearest::Coordinates;
use crate::output::Wiring;

/// Most actuators of a module: two bits each.
const MAX_ACTUATORS: u8 = 8;
/// Largest length scale, m.
const MAX_SCALE_M: f32 = 1e3;

/// The modules so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Modules {
    /// Actuators of the modules before the last.
    first: u8,
    /// Actuators of the last.
    actuators: u8,
    /// Digits of its last frame.
    last: Option<u16>,
}

impl Modules {
    /// The next module; every module before it has to have a frame.
    pub(super) fn next(
        self,
        actuators: u8,
        length_scale_m: f32,
        behind: &Coordinates,
        wiring: &Wiring,
    ) -> Result<Self, TableError> {
        let first = self.first.saturating_add(self.actuators);
        let left = wiring.actuators.len().saturating_sub(first.into());
        let fits = (1..=MAX_ACTUATORS).contains(&actuators) && usize::from(actuators) <= left;
        let sound = behind.is_sound() && (0.0..=MAX_SCALE_M).contains(&length_scale_m);
        if fits && sound && (first == 0 || self.last.is_some()) {
            Ok(Self { first, actuators, last: None })
        } else {
            Err(TableError::Modules)
        }
    }

    /// The next frame of the last module.
    pub(super) fn with_frame(self, digits: u16, pose: &Coordinates, wiring: &Wiring) -> Result<Self, TableError> {
        let digit = |leg: u8| (digits >> leg.wrapping_mul(2) & 3) as u8;
        let actuator = |leg: u8| wiring.actuators.get(usize::from(self.first.saturating_add(leg)));
        let states = |leg: u8| actuator(leg).map_or(0, |actuator| actuator.states);
        let has = (0..self.actuators).all(|leg| digit(leg) < states(leg));
        let only = (self.actuators..MAX_ACTUATORS).all(|leg| digit(leg) == 0);
        if has && only && self.last < Some(digits) && pose.is_sound() {
            Ok(Self { last: Some(digits), ..self })
        } else {
            Err(TableError::Modules)
        }
    }

    /// Refuses modules that leave an actuator or a module without a frame.
    pub(super) fn check(self, wiring: &Wiring) -> Result<(), TableError> {
        let all = usize::from(self.first.saturating_add(self.actuators)) == wiring.actuators.len();
        if all && self.last.is_some() { Ok(()) } else { Err(TableError::Modules) }
    }
}
