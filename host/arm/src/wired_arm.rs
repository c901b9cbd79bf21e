//! An arm, the profile of the board that drives it, and the wiring that follows from the two.

use std::path::Path;

use darm_core::output::Wiring;

use crate::arm::{Arm, ArmError, ArmFile, WiringFault, wiring};
use crate::board_profile::{BoardProfile, ProfileFault};
use darm_robot::source::FileError;

/// An arm on its board.
#[derive(Clone, Debug, PartialEq)]
pub struct WiredArm {
    /// The arm.
    pub arm: Arm,
    /// The profile of its board.
    pub profile: BoardProfile,
    /// What a table carries of both.
    pub wiring: Wiring,
}

/// Why an arm has no wiring.
#[derive(Debug, thiserror::Error)]
pub enum WiredArmError {
    /// The arm file is refused, or does not fit the profile.
    #[error(transparent)]
    Arm(#[from] ArmError),
    /// The profile is refused.
    #[error(transparent)]
    Profile(#[from] FileError<ProfileFault>),
    /// The arm does not fit the profile.
    #[error(transparent)]
    Wiring(#[from] WiringFault),
}

impl WiredArm {
    /// Reads an arm and its [profile](profile_of()). Where they do not fit, the error names line and column of the arm file.
    ///
    /// # Errors
    ///
    /// The arm file or the profile cannot be read or is refused, or the arm does not fit the profile.
    pub fn read(path: &Path, profile: Option<&Path>) -> Result<Self, WiredArmError> {
        let file = ArmFile::read(path)?;
        let profile = profile_of(&file.arm, profile)?;
        let wiring = file.wiring(&profile.profile)?;
        Ok(Self { arm: file.arm, profile, wiring })
    }

    /// The same of an arm that was read or made before, under the profile that it names.
    ///
    /// # Errors
    ///
    /// The profile cannot be read or is refused, or the arm does not fit it.
    pub fn new(arm: Arm) -> Result<Self, WiredArmError> {
        let profile = profile_of(&arm, None)?;
        let wiring = wiring(&arm, &profile.profile)?;
        Ok(Self { arm, profile, wiring })
    }
}

/// The profile in the file that is `given`; else the one that the arm names; else the one that is built into boards.
///
/// # Errors
///
/// The file cannot be read, or is not a profile that the board could run safely. The built-in profile does not fail.
pub fn profile_of(arm: &Arm, given: Option<&Path>) -> Result<BoardProfile, FileError<ProfileFault>> {
    match given.or(arm.profile.as_deref()) {
        Some(path) => BoardProfile::read(path),
        None => Ok(BoardProfile::built_in()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ARM: &str = "format = 2
name = \"three\"
profile = \"board.toml\"
[[stage]]
kind = \"discrete-joint\"
name = \"base\"
value_deg = [0.0, 10.0, 20.0]
outputs = [5, 3]
switch = { closed_in = [0] }
[[stage]]
kind = \"servo\"
name = \"elbow\"
servo = { id = 2, min_deg = -30.0, max_deg = 40.0 }
";

    const PROFILE: &str = "format = 1
name = \"board\"
supply = { new_outputs = 2, window_ms = 20 }
[[output]]
number = 3
drive = \"latch\"
set = 8
reset = 9
pulse_ms = 20
max_on_ms = 100
duty_percent = 20
window_ms = 5000
[[output]]
number = 5
drive = \"hold\"
line = 1
max_on_ms = 4000
duty_percent = 35
window_ms = 9000
input = 7
[[servo]]
id = 2
min_deg = -90.0
max_deg = 90.0
max_speed_deg_s = 30.0
max_torque = 0.4
timeout_ms = 80
fallback = \"hold\"
";

    fn read(arm: &str, profile: &str) -> Result<WiredArm, String> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("arm.toml"), arm).unwrap();
        std::fs::write(folder.path().join("board.toml"), profile).unwrap();
        let read = WiredArm::read(&folder.path().join("arm.toml"), None);
        read.map_err(|error| error.to_string().replace(&format!("{}/", folder.path().display()), ""))
    }

    #[test]
    fn drives_limits_and_inputs_are_those_of_the_profile_and_ranges_those_of_the_arm() {
        let WiredArm { wiring, profile, .. } = read(ARM, PROFILE).unwrap();
        let coils: Vec<_> = wiring.coils.iter().map(|coil| (coil.output, coil.drive, coil.limit)).collect();
        let of = |number| profile.profile.output(number).map(|output| (number, output.drive, output.limit)).unwrap();
        assert_eq!(coils, [of(5), of(3)]);
        let actuator = wiring.actuators[0];
        assert_eq!((actuator.states, actuator.travel_ms), (3, 100));
        assert_eq!(actuator.switch.map(|switch| (switch.input, switch.closed_in)), Some((7, 0b001)));
        let (servo, limit) = (wiring.servos[0], profile.profile.servos[0].limit);
        assert_eq!((servo.max_speed_rad_s, servo.max_torque, servo.timeout_ms), (limit.max_speed_rad_s, 0.4, 80));
        assert_eq!((servo.min_rad, servo.max_rad), ((-30f64).to_radians() as f32, 40f64.to_radians() as f32));
        assert_eq!(wiring.switch_limit, profile.profile.supply);
    }

    #[test]
    fn what_the_profile_does_not_have_is_an_error_at_its_place_in_the_arm_file() {
        let cure = "add it to the profile, or name the right profile, by `profile` in the arm file or by --profile";
        let cases = [
            (ARM.replace("[5, 3]", "[5, 4]"), format!("8:11: base: the board's profile has no output 4; {cure}")),
            (
                ARM.replace("[5, 3]", "[3, 5]"),
                format!(
                    "9:10: base: output 3 has no limit switch in the board's profile; {}",
                    cure.replacen("it", "its `input`", 1)
                ),
            ),
            (
                ARM.replace("outputs = [5, 3]\n", ""),
                "5:8: base names no outputs; add `outputs = [N, M]`, those of the board that feed it".to_owned(),
            ),
            (
                ARM.replace("id = 2", "id = 9"),
                format!("13:9: elbow: the board's profile has no servo with the id 9; {cure}"),
            ),
        ];
        for (arm, expected) in cases {
            assert_eq!(read(&arm, PROFILE).unwrap_err(), format!("arm.toml:{expected}"));
        }
        let servo = PROFILE.split_once("[[servo]]").unwrap().1;
        let two = PROFILE.replace("[[servo]]", &format!("[[servo]]{}\n[[servo]]", servo.replace("id = 2", "id = 1")));
        assert_eq!(
            read(ARM, &two).unwrap_err(),
            "arm.toml:13:9: elbow: servo 2 is number 0 along the arm and number 1 in the board's profile; list the servos \
             of the profile in the order of the arm"
        );
    }

    #[test]
    fn an_arm_without_a_profile_is_on_a_board_with_the_one_built_in() {
        let alone = ARM.replace("profile = \"board.toml\"\n", "").replace("switch = { closed_in = [0] }\n", "");
        let (two, _) = alone.rsplit_once("[[stage]]").unwrap();
        let wired = read(two, "").unwrap();
        assert_eq!(wired.profile, BoardProfile::built_in());
        assert_eq!(wired.wiring.switch_limit.new_coils, 1);
        let servo = read(&alone, "").unwrap_err();
        assert!(servo.contains("has no servo with the id 2"), "{servo}");
    }
}
