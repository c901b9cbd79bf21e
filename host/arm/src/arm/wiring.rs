//! The wiring of an arm: the outputs and servos that its file names, as the profile of the board has them.

use std::fmt;

use darm_core::output::{ActuatorWiring, Coil, LimitSwitch, ServoWiring, Wiring, WiringError};
use darm_core::profile::Profile;

use super::{Arm, Connection, Servo};

/// Why the profile of a board and an arm do not fit together.
#[derive(Clone, Debug, PartialEq)]
pub struct WiringFault {
    /// The part of the arm.
    pub part: Part,
    /// Its name.
    pub name: String,
    /// What is wrong with it.
    pub reason: WiringReason,
}

/// A part of an arm that a board drives; both count from 0 at the base.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// A discrete actuator.
    Actuator(usize),
    /// A servo joint.
    Servo(usize),
    /// The arm as it is.
    Arm,
}

/// What is wrong with a part of an arm under a profile.
#[derive(Clone, Debug, PartialEq)]
pub enum WiringReason {
    /// The arm does not name the outputs of the actuator.
    Unnamed {
        /// How many it needs.
        needed: usize,
    },
    /// The profile does not have the output.
    NoOutput {
        /// Its number.
        output: u8,
    },
    /// The actuator has a limit switch, and its first output has no input in the profile.
    NoInput {
        /// Number of the output.
        output: u8,
    },
    /// The profile does not have the servo.
    NoServo {
        /// Its address.
        id: u8,
    },
    /// The profile has the servo at another place in its order.
    ServoOrder {
        /// Its address.
        id: u8,
        /// Its number along the arm.
        arm: usize,
        /// Its number in the profile.
        profile: usize,
    },
    /// The board could not run it safely.
    Wiring(WiringError),
}

impl fmt::Display for WiringFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = &self.name;
        let cure = "or name the right profile, by `profile` in the arm file or by --profile";
        match &self.reason {
            WiringReason::Unnamed { needed: 1 } => {
                write!(f, "{name} names no output; add `output = N`, the number of the board's output that feeds it")
            }
            WiringReason::Unnamed { .. } => {
                write!(f, "{name} names no outputs; add `outputs = [N, M]`, those of the board that feed it")
            }
            WiringReason::NoOutput { output } => {
                write!(f, "{name}: the board's profile has no output {output}; add it to the profile, {cure}")
            }
            WiringReason::NoInput { output } => write!(
                f,
                "{name}: output {output} has no limit switch in the board's profile; add its `input` to the profile, {cure}"
            ),
            WiringReason::NoServo { id } => {
                write!(f, "{name}: the board's profile has no servo with the id {id}; add it to the profile, {cure}")
            }
            WiringReason::ServoOrder { id, arm, profile } => write!(
                f,
                "{name}: servo {id} is number {arm} along the arm and number {profile} in the board's profile; list the \
                 servos of the profile in the order of the arm"
            ),
            WiringReason::Wiring(error) => write!(f, "{name}: {error}; correct the arm or the board's profile"),
        }
    }
}

impl std::error::Error for WiringFault {}

/// What a table carries of `arm` on a board with this profile: drives and limits are those of the profile.
///
/// # Errors
///
/// The arm names an output, limit switch or servo that the profile does not have, or none; or the board could not run
/// the wiring safely.
pub fn wiring(arm: &Arm, profile: &Profile) -> Result<Wiring, WiringFault> {
    let (wiring, faults) = wiring_and_faults(arm, profile);
    faults.into_iter().next().map_or(Ok(wiring), Err)
}

/// Everything in which an arm and the profile of a board do not fit together, part by part.
pub fn contradictions(arm: &Arm, profile: &Profile) -> Vec<WiringFault> {
    wiring_and_faults(arm, profile).1
}

/// The wiring of the parts that fit the profile, and what is wrong with the others.
fn wiring_and_faults(arm: &Arm, profile: &Profile) -> (Wiring, Vec<WiringFault>) {
    let mut faults = Vec::new();
    let mut wiring = Wiring { switch_limit: profile.supply, ..Wiring::default() };
    for (actuator, connection) in arm.connections.iter().enumerate() {
        let states = arm.model.chain.n_states(actuator) as u8;
        if let Err(reason) = add_actuator(&mut wiring, connection, states, profile) {
            let name = arm.actuator_name(actuator);
            faults.push(WiringFault { part: Part::Actuator(actuator), name, reason });
        }
    }
    for (number, servo) in arm.servos.iter().enumerate() {
        if let Err(reason) = add_servo(&mut wiring, number, servo, profile) {
            faults.push(WiringFault { part: Part::Servo(number), name: arm.servo_name(number), reason });
        }
    }
    // The parts that are left out would make it a wiring with gaps.
    if faults.is_empty()
        && let Err(error) = wiring.check()
    {
        let reason = WiringReason::Wiring(error);
        faults.push(WiringFault { part: Part::Arm, name: arm.name.clone(), reason });
    }
    (wiring, faults)
}

fn add_actuator(
    wiring: &mut Wiring,
    connection: &Connection,
    states: u8,
    profile: &Profile,
) -> Result<(), WiringReason> {
    let too_many = WiringReason::Wiring(WiringError::TooMany);
    let Connection { outputs, closed_in, travel_ms } = connection;
    let switch = match (outputs.first(), *closed_in) {
        (Some(&first), Some(closed_in)) => Some(limit_switch(first, closed_in, profile)?),
        _ => None,
    };
    let actuator = ActuatorWiring { states, switch, travel_ms: *travel_ms };
    if outputs.len() != actuator.coils() {
        return Err(WiringReason::Unnamed { needed: actuator.coils() });
    }
    for &output in outputs {
        let wired = profile.output(output).ok_or(WiringReason::NoOutput { output })?;
        let coil = Coil { output, drive: wired.drive, limit: wired.limit };
        wiring.coils.push(coil).map_err(|_| too_many.clone())?;
    }
    wiring.actuators.push(actuator).map_err(|_| too_many)
}

fn limit_switch(output: u8, closed_in: u8, profile: &Profile) -> Result<LimitSwitch, WiringReason> {
    let wired = profile.output(output).ok_or(WiringReason::NoOutput { output })?;
    let input = wired.input.ok_or(WiringReason::NoInput { output })?;
    Ok(LimitSwitch { input, closed_in })
}

/// A table's range is that of the joint; the board compares the angle of the shaft with the profile when it moves.
fn add_servo(wiring: &mut Wiring, number: usize, servo: &Servo, profile: &Profile) -> Result<(), WiringReason> {
    let Servo { id, min_rad, max_rad } = *servo;
    let found = profile.servos.iter().position(|wired| wired.limit.id == id);
    let found = found.ok_or(WiringReason::NoServo { id })?;
    if found != number {
        return Err(WiringReason::ServoOrder { id, arm: number, profile: found });
    }
    let joint = ServoWiring { min_rad, max_rad, ..profile.servos[found].limit };
    wiring.servos.push(joint).map_err(|_| WiringReason::Wiring(WiringError::TooMany))
}
