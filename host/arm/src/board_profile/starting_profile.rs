//! A first, cautious profile for the board of an arm, to be edited by a person.

use darm_core::output::{CoilLimit, Drive, MAX_INPUTS, ServoWiring};
use darm_core::profile::{BUILT_IN, Fallback, Output, Profile, Servo};

use super::BoardProfile;
use crate::arm::{Arm, Connection};

/// Slow and weak: what a servo may do until a person has looked.
const SPEED_DEG_S: f64 = 20.0;
const TORQUE: f32 = 0.2;
const TIMEOUT_MS: u16 = 100;
/// Longest time over which an output's duty counts. After power-up every output counts as used to its limit: with the ten minutes of a
/// valve's default a first program of 3 s waits for 190 s, with one minute for 17 s.
const WINDOW_MS: u32 = 60_000;

/// What a person has to look up before the profile is written to a board.
const ADVICE: &str = "\
# A first profile: every value below is cautious or a guess. Before it is written to a board, correct it:
#
# drive         how the coil is fed: \"hold\" (one line), \"peak-hold\" (a pull and a hold line, peak_ms), or \"latch\"
#               (a set and a reset line, pulse_ms). Data sheet: holding current, latching.
# peak_ms       how long the full current lasts, at most 10000. Data sheet: pull-in time. The next peak begins no sooner
#               than ten times as long after this one: full current flows for at most 10 % of the time.
# line          the line of the output chain that the coil is soldered to; here it is the number of the output.
# max_on_ms     longest time on without a pause. Data sheet: maximum on-time (\"max. ON\").
# duty_percent  share of window_ms that it may be on. Data sheet: duty cycle (\"ED\", S1 is 100 %) and cycle time, at the
#               hottest surroundings (ambient_c, derate_percent_per_k).
# input         input of the limit switch of the actuator; here they count along the arm.
# board         name of the board, so that no other one takes this profile: \"Pico\" or \"B-L475E-IOT01A\".
# [chain]       chips = N, the 74HC595 in the output chain: no line beyond them can be wired. A B-L475E-IOT01A then demands
#               that the far end of the chain is wired back.
# [supply]      coils that may be switched on within window_ms: current of the supply over the pull-in current of one coil.
# [[servo]]     range of the shaft (here that of the joint), speed, share of the servo's own torque, time-out.

";

impl BoardProfile {
    /// A cautious profile for the outputs and servos that `arm` names: every output holds the line with the same
    /// number, within the limits that are built into a board; servos are slow and weak; limit switches are at inputs
    /// that count along the arm.
    pub fn first(arm: &Arm) -> Self {
        let mut profile = Profile { supply: BUILT_IN.supply, ..Profile::empty() };
        let mut inputs = 0..MAX_INPUTS as u8;
        for connection in &arm.connections {
            let input = connection.closed_in.and_then(|_| inputs.next());
            add_outputs(&mut profile, connection, input);
        }
        profile.servos = arm.servos.iter().map(|servo| first_servo(servo.id, servo.min_rad, servo.max_rad)).collect();
        Self::new(&arm.name, profile)
    }

    /// The text of its file, with what is to be looked up on the data sheets.
    pub fn to_toml_with_advice(&self) -> String {
        format!("{ADVICE}{}", self.to_toml())
    }
}

/// The same duty, in a window that is not too long for a first program: a limit that allows nothing more.
pub(crate) fn first_limit(limit: CoilLimit) -> CoilLimit {
    let CoilLimit { max_on_ms, duty_percent, window_ms } = limit;
    let window_ms = window_ms.min(WINDOW_MS);
    CoilLimit { max_on_ms: max_on_ms.min(window_ms / 100 * u32::from(duty_percent)), duty_percent, window_ms }
}

/// The input is that of the first output.
fn add_outputs(profile: &mut Profile, connection: &Connection, input: Option<u8>) {
    let Some(built_in) = BUILT_IN.output(0) else { return };
    let limit = first_limit(built_in.limit);
    for (index, &number) in connection.outputs.iter().enumerate() {
        let input = input.filter(|_| index == 0);
        let output = Output { drive: Drive::Hold { line: number }, limit, input };
        if let Some(place) = profile.outputs.get_mut(usize::from(number)) {
            *place = Some(output);
        }
    }
}

fn first_servo(id: u8, min_rad: f32, max_rad: f32) -> Servo {
    let max_speed_rad_s = SPEED_DEG_S.to_radians() as f32;
    let limit = ServoWiring { id, min_rad, max_rad, max_speed_rad_s, max_torque: TORQUE, timeout_ms: TIMEOUT_MS };
    Servo { limit, fallback: Fallback::Hold }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::arm::wiring;

    #[test]
    fn a_first_profile_drives_the_arm_and_allows_no_more_than_a_board_without_one() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/planar4-hybrid.toml");
        let arm = Arm::read(&path).unwrap();
        let first = BoardProfile::first(&arm);
        let read = BoardProfile::parse(Path::new("first.toml"), &first.to_toml_with_advice()).unwrap();
        assert_eq!(read, first);
        let wiring = wiring(&arm, &first.profile).unwrap();
        assert_eq!((wiring.coils.len(), wiring.servos.len()), (12, 1));
        let built_in = BUILT_IN.output(0).unwrap().limit;
        for coil in &wiring.coils {
            assert_eq!(coil.drive, Drive::Hold { line: coil.output });
            assert_eq!(coil.limit, first_limit(built_in));
        }
        assert_eq!(wiring.switch_limit, BUILT_IN.supply);
        assert!(wiring.actuators.iter().enumerate().all(|(k, actuator)| actuator.switch.unwrap().input == k as u8));
        for limit in [built_in, Drive::Hold { line: 0 }.default_limit()] {
            let first = first_limit(limit);
            // The same share of a shorter window is never more of a longer one.
            assert!(first.max_on_ms <= limit.max_on_ms && first.window_ms <= limit.window_ms.min(WINDOW_MS));
            assert_eq!(first.duty_percent, limit.duty_percent);
        }
        assert!(wiring.servos[0].max_torque < 0.3 && wiring.servos[0].max_speed_rad_s < 0.5);
    }
}
