//! What is brought up: the arm's wiring as its files say.

use darm_arm::wired_arm::WiredArm;
use darm_core::output::{Coil, LimitSwitch, Wiring};
use darm_core::profile::EmergencyStop;

/// An arm as its file and the board's profile say.
#[derive(Clone, Debug, PartialEq)]
pub struct Subject {
    /// Outputs, lines, inputs.
    pub wiring: Wiring,
    /// What a person calls each actuator.
    pub names: Vec<String>,
    /// The emergency stop of the profile.
    pub emergency_stop: Option<EmergencyStop>,
}

/// One coil of an arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    /// Its actuator.
    pub(super) actuator: usize,
    /// Its bit in the actuator's digit.
    pub(super) bit: usize,
    /// Output and drive.
    pub(super) coil: Coil,
    /// The actuator's switch.
    pub(super) switch: Option<LimitSwitch>,
}

impl Place {
    /// The actuator's digit while this coil alone is on.
    pub(super) fn digit(&self) -> u8 {
        1 << self.bit
    }

    /// Whether the switch is closed at rest, and while the coil is on; `None` where that is the same, or without a switch.
    pub(super) fn expected(&self) -> Option<(LimitSwitch, [bool; 2])> {
        let switch = self.switch?;
        let closed = [switch.closed(0), switch.closed(self.digit())];
        (closed[0] != closed[1]).then_some((switch, closed))
    }
}

impl Subject {
    /// The arm of a file.
    pub fn of(wired: &WiredArm) -> Self {
        let names = (0..wired.wiring.actuators.len()).map(|actuator| wired.arm.actuator_name(actuator));
        let emergency_stop = wired.profile.profile.emergency_stop;
        Self { wiring: wired.wiring.clone(), names: names.collect(), emergency_stop }
    }

    /// All coils along the arm.
    pub(super) fn places(&self) -> impl Iterator<Item = Place> {
        self.wiring.actuators_with_coils().enumerate().flat_map(|(actuator, (wiring, coils))| {
            let switch = wiring.switch;
            coils.iter().enumerate().map(move |(bit, &coil)| Place { actuator, bit, coil, switch })
        })
    }

    /// The coil of an output.
    pub(super) fn place(&self, output: u8) -> Option<Place> {
        self.places().find(|place| place.coil.output == output)
    }

    /// The first output of an actuator.
    pub(super) fn first_output(&self, actuator: usize) -> Option<u8> {
        self.places().find(|place| place.actuator == actuator).map(|place| place.coil.output)
    }

    /// The only output of an actuator; `None` where it has two.
    pub(super) fn only_output(&self, actuator: usize) -> Option<u8> {
        let mut own = self.places().filter(|place| place.actuator == actuator);
        let output = own.next()?.coil.output;
        own.next().is_none().then_some(output)
    }

    /// The actuator whose switch is at an input.
    pub(super) fn actuator_at(&self, input: u8) -> Option<usize> {
        self.wiring.actuators.iter().position(|wiring| wiring.switch.is_some_and(|switch| switch.input == input))
    }

    /// Inputs that switches can be at: all but that of the emergency stop.
    pub(super) fn switch_inputs(&self) -> u32 {
        !self.emergency_stop.map_or(0, |stop| darm_core::output::input_bit(stop.input))
    }

    /// An actuator with its name.
    pub fn name(&self, actuator: usize) -> String {
        let name = self.names.get(actuator).map(String::as_str).unwrap_or_default();
        format!("actuator {actuator} ({name})")
    }
}
