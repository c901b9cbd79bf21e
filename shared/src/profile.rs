//! What is wired to one board, and the limits that no table can exceed: written only while a person is at the board.
//!
//! A table says which output moves which actuator, and within which limits; it may tighten a profile and never widen it.
//! An output is what feeds one coil: its lines, its limits and, where there is one, the input of its limit switch.
//!
//! A profile travels and is stored as a list of [`ProfileRecord`]s in a fixed order: `Start`, the outputs by number, the
//! servos in their order along the arm, `End`. A board without a profile has [`BUILT_IN`].
#![cfg_attr(not(test), deny(clippy::indexing_slicing, clippy::arithmetic_side_effects, clippy::unwrap_used))]

use core::fmt;

use serde::{Deserialize, Serialize};

use crate::output::{
    Coil, CoilLimit, Drive, InputUse, LineUse, MAX_COILS, MAX_SERVOS, ServoWiring, SwitchLimit, Wiring, WiringError,
    check_servos, input_bit,
};
use crate::units::{Digest, ShortDigest};

/// One output of the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Output {
    /// Its lines, and the longest pulse or peak.
    pub drive: Drive,
    /// The most that a table may allow.
    pub limit: CoilLimit,
    /// Input of the limit switch of the actuator that it feeds.
    pub input: Option<u8>,
}

/// What a servo does in the safe state and after a reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Fallback {
    /// Holds the angle that it has.
    Hold,
    /// Has no torque.
    Release,
}

/// One servo on the bus. Angles are those of its shaft: a calibration does not move them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Servo {
    /// Address, and the limits that a table may tighten.
    pub limit: ServoWiring,
    /// What it does in the safe state and after a reset.
    pub fallback: Fallback,
}

/// An input that latches the safe state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct EmergencyStop {
    /// Number of the input.
    pub input: u8,
    /// True for a contact that opens when the button is pressed, so that a broken wire stops the arm too.
    pub opens: bool,
}

impl EmergencyStop {
    /// Whether it is pressed. `inputs`: bit `i` is input `i`, high when closed.
    pub const fn is_pressed(&self, inputs: u32) -> bool {
        let closed = inputs & input_bit(self.input) != 0;
        closed != self.opens
    }
}

/// Everything that is wired to one board.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// Output `o` at index `o`; `None` where nothing is wired.
    pub outputs: [Option<Output>; MAX_COILS],
    /// Servos in their order along the arm.
    pub servos: heapless::Vec<Servo, MAX_SERVOS>,
    /// What the supply can feed.
    pub supply: SwitchLimit,
    /// The input that latches the safe state.
    pub emergency_stop: Option<EmergencyStop>,
    /// SHA-256 of its records as they are stored; zeros for [`BUILT_IN`].
    pub digest: Digest,
}

/// What a board without a profile allows: a valve at each of the first sixteen lines, for a second in ten, one at a
/// time, no servos, no inputs.
pub static BUILT_IN: Profile = Profile::built_in();

/// Outputs of [`BUILT_IN`]: those of two chips.
const BUILT_IN_OUTPUTS: usize = 16;

impl Profile {
    #[expect(clippy::indexing_slicing, clippy::arithmetic_side_effects, reason = "evaluated by the compiler")]
    const fn built_in() -> Self {
        let limit = CoilLimit { max_on_ms: 1_000, duty_percent: 10, window_ms: 10_000 };
        let mut outputs = [None; MAX_COILS];
        let mut number = 0;
        while number < BUILT_IN_OUTPUTS {
            outputs[number] = Some(Output { drive: Drive::Hold { line: number as u8 }, limit, input: None });
            number += 1;
        }
        let supply = SwitchLimit { new_coils: 1, window_ms: 10 };
        Self { outputs, servos: heapless::Vec::new(), supply, emergency_stop: None, digest: Digest([0; 32]) }
    }

    /// Nothing wired, to be filled by a [`ProfileReader`].
    pub const fn empty() -> Self {
        let supply = SwitchLimit { new_coils: 1, window_ms: 10 };
        let outputs = [None; MAX_COILS];
        Self { outputs, servos: heapless::Vec::new(), supply, emergency_stop: None, digest: Digest([0; 32]) }
    }

    /// The profile that allows just this wiring.
    pub fn of(wiring: &Wiring) -> Self {
        let mut profile = Self { supply: wiring.switch_limit, ..Self::empty() };
        for coil in &wiring.coils {
            if let Some(output) = profile.outputs.get_mut(usize::from(coil.output)) {
                *output = Some(Output { drive: coil.drive, limit: coil.limit, input: None });
            }
        }
        for (actuator, coils) in wiring.actuators_with_coils() {
            let number = coils.first().map_or(MAX_COILS, |coil| usize::from(coil.output));
            if let Some(Some(output)) = profile.outputs.get_mut(number) {
                output.input = actuator.switch.map(|switch| switch.input);
            }
        }
        let servos = wiring.servos.iter().map(|servo| Servo { limit: *servo, fallback: Fallback::Hold });
        profile.servos = servos.collect();
        profile
    }

    /// The output of this number.
    pub fn output(&self, number: u8) -> Option<&Output> {
        self.outputs.get(usize::from(number)).and_then(Option::as_ref)
    }

    /// Its records, in order.
    pub fn records(&self) -> impl Iterator<Item = ProfileRecord> {
        let start = ProfileRecord::Start { supply: self.supply, emergency_stop: self.emergency_stop };
        let outputs = (0u8..)
            .zip(&self.outputs)
            .filter_map(|(number, output)| output.map(|output| ProfileRecord::Output { number, output }));
        let servos = self.servos.iter().map(|servo| ProfileRecord::Servo(*servo));
        core::iter::once(start).chain(outputs).chain(servos).chain([ProfileRecord::End])
    }

    /// Refuses a profile that the board could not run safely.
    pub fn check(&self) -> Result<(), ProfileError> {
        self.check_as_wiring().map_err(ProfileError::Wiring)
    }

    fn check_as_wiring(&self) -> Result<(), WiringError> {
        self.supply.check()?;
        let (mut lines, mut inputs) = (LineUse::default(), InputUse::default());
        if let Some(stop) = self.emergency_stop {
            inputs.take(stop.input)?;
        }
        for (number, output) in (0u8..).zip(&self.outputs) {
            let Some(output) = output else { continue };
            lines.take(&output.drive)?;
            if !output.limit.is_sound(&output.drive) {
                return Err(WiringError::CoilLimit { output: number });
            }
            if let Some(input) = output.input {
                inputs.take(input)?;
            }
        }
        check_servos(self.servos.iter().map(|servo| &servo.limit))
    }

    /// Refuses a coil of a table that this profile does not allow.
    pub fn check_coil(&self, coil: &Coil) -> Result<(), Mismatch> {
        let number = coil.output;
        let output = self.output(number).ok_or(Mismatch::NoOutput { output: number })?;
        if !output.drive.allows(&coil.drive) {
            return Err(Mismatch::Drive { output: number, profile: output.drive, table: coil.drive });
        }
        if !output.limit.allows(&coil.limit) {
            return Err(Mismatch::Limit { output: number, profile: output.limit, table: coil.limit });
        }
        Ok(())
    }

    /// Refuses a wiring of a table that this profile does not allow. Its coils were [checked](Self::check_coil).
    pub fn check_wiring(&self, wiring: &Wiring) -> Result<(), Mismatch> {
        if !self.supply.allows(&wiring.switch_limit) {
            return Err(Mismatch::Supply { profile: self.supply, table: wiring.switch_limit });
        }
        for (actuator, coils) in wiring.actuators_with_coils() {
            let number = coils.first().map_or(u8::MAX, |coil| coil.output);
            let input = self.output(number).and_then(|output| output.input);
            match actuator.switch {
                Some(switch) if Some(switch.input) != input => {
                    return Err(Mismatch::Input { output: number, profile: input, table: switch.input });
                }
                Some(_) | None => {}
            }
        }
        for (index, servo) in (0u8..).zip(&wiring.servos) {
            let fits = self.servos.get(usize::from(index)).is_some_and(|own| own.limit.allows(servo));
            if !fits {
                return Err(Mismatch::Servo { servo: index });
            }
        }
        Ok(())
    }
}

/// One piece of a profile as it travels and is stored.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum ProfileRecord {
    /// First record.
    Start {
        /// What the supply can feed.
        supply: SwitchLimit,
        /// The input that latches the safe state.
        emergency_stop: Option<EmergencyStop>,
    },
    /// An output; their numbers rise.
    Output {
        /// Its number.
        number: u8,
        /// What it is.
        output: Output,
    },
    /// The next servo.
    Servo(Servo),
    /// Last record.
    End,
}

/// Fills a [`Profile`] from its records. Nothing of an incomplete profile can be taken.
#[derive(Clone, Debug, Default)]
pub enum ProfileReader {
    /// Nothing has come.
    #[default]
    Empty,
    /// More is to come; the number that the next output may have at least.
    Open {
        /// Smallest number of the next output; `None` after the first servo.
        next: Option<u8>,
    },
    /// All has come and was checked.
    Complete,
}

impl ProfileReader {
    /// Takes the next record into `profile`.
    pub fn push(&mut self, record: &ProfileRecord, profile: &mut Profile) -> Result<(), ProfileError> {
        let at = core::mem::take(self);
        *self = match (at, record) {
            (Self::Empty, ProfileRecord::Start { supply, emergency_stop }) => {
                *profile = Profile { supply: *supply, emergency_stop: *emergency_stop, ..Profile::empty() };
                Self::Open { next: Some(0) }
            }
            (Self::Open { next: Some(next) }, ProfileRecord::Output { number, output }) if *number >= next => {
                let too_many = ProfileError::Wiring(WiringError::TooMany);
                *profile.outputs.get_mut(usize::from(*number)).ok_or(too_many)? = Some(*output);
                Self::Open { next: number.checked_add(1) }
            }
            (Self::Open { .. }, ProfileRecord::Servo(servo)) => {
                profile.servos.push(*servo).map_err(|_| ProfileError::Wiring(WiringError::TooMany))?;
                Self::Open { next: None }
            }
            (Self::Open { .. }, ProfileRecord::End) => {
                profile.check()?;
                Self::Complete
            }
            _ => return Err(ProfileError::Order),
        };
        Ok(())
    }

    /// Whether the profile is complete and sound.
    pub const fn is_complete(&self) -> bool {
        matches!(self, Self::Complete)
    }
}

/// Why a profile is refused.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum ProfileError {
    /// A record is out of order, or the last one is missing.
    Order,
    /// The bytes are not a record.
    Malformed,
    /// The board cannot run it safely.
    Wiring(WiringError),
}

impl fmt::Display for ProfileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Order => f.write_str("a record of the profile is out of order or missing"),
            Self::Malformed => f.write_str("the bytes are not a profile"),
            Self::Wiring(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for ProfileError {}

/// Where a table asks for more than the board's profile allows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Mismatch {
    /// The profile has no such output.
    NoOutput {
        /// Its number.
        output: u8,
    },
    /// The output has other lines, or the table wants a longer pulse or peak.
    Drive {
        /// Its number.
        output: u8,
        /// What the profile says.
        profile: Drive,
        /// What the table says.
        table: Drive,
    },
    /// The table wants the output on for longer, or counts over another window.
    Limit {
        /// Its number.
        output: u8,
        /// What the profile allows.
        profile: CoilLimit,
        /// What the table says.
        table: CoilLimit,
    },
    /// The limit switch of the output's actuator is at another input.
    Input {
        /// Number of the output.
        output: u8,
        /// Its input by the profile.
        profile: Option<u8>,
        /// Its input by the table.
        table: u8,
    },
    /// The table wants to switch more outputs at once.
    Supply {
        /// What the profile allows.
        profile: SwitchLimit,
        /// What the table says.
        table: SwitchLimit,
    },
    /// The servo is missing, has another address or narrower limits.
    Servo {
        /// Its index along the arm.
        servo: u8,
    },
    /// Everything that the table needs is allowed, but it was made for another profile.
    Digest {
        /// The profile that the table was made for.
        table: ShortDigest,
        /// The profile that the board has.
        profile: ShortDigest,
    },
}

impl fmt::Display for Mismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoOutput { output } => write!(f, "output {output}: the board's profile does not have it"),
            Self::Drive { output, profile, table } => {
                write!(f, "output {output}: the table drives it by {table}, the board's profile by {profile}")
            }
            Self::Limit { output, profile, table } => {
                write!(f, "output {output}: the table allows {table}, the board's profile {profile}")
            }
            Self::Input { output, profile: Some(profile), table } => {
                write!(
                    f,
                    "output {output}: the table has its switch at input {table}, the board's profile at {profile}"
                )
            }
            Self::Input { output, profile: None, table } => {
                write!(f, "output {output}: the table has its switch at input {table}, the board's profile has none")
            }
            Self::Supply { profile, table } => {
                write!(f, "the table switches {table}, the board's profile allows {profile}")
            }
            Self::Servo { servo } => {
                write!(f, "servo {servo}: the board's profile does not have it, or has narrower limits")
            }
            Self::Digest { table, profile } => {
                write!(f, "the table was made for profile {table}, the board has {profile}")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    extern crate std;
    use std::vec::Vec;

    /// Two valves, one with a switch, and a servo.
    fn profile() -> Profile {
        let mut profile = Profile::empty();
        let limit = CoilLimit { max_on_ms: 100, duty_percent: 50, window_ms: 1600 };
        profile.outputs[0] = Some(Output { drive: Drive::Hold { line: 0 }, limit, input: Some(3) });
        profile.outputs[7] = Some(Output { drive: Drive::Hold { line: 9 }, limit, input: None });
        let limit =
            ServoWiring { id: 1, min_rad: -1.0, max_rad: 1.0, max_speed_rad_s: 1.0, max_torque: 0.5, timeout_ms: 100 };
        profile.servos.push(Servo { limit, fallback: Fallback::Release }).expect("one fits");
        profile.emergency_stop = Some(EmergencyStop { input: 12, opens: true });
        profile
    }

    fn read(records: &[ProfileRecord]) -> Result<Profile, ProfileError> {
        let (mut reader, mut profile) = (ProfileReader::default(), Profile::empty());
        records.iter().try_for_each(|record| reader.push(record, &mut profile))?;
        if reader.is_complete() { Ok(profile) } else { Err(ProfileError::Order) }
    }

    #[test]
    fn a_profile_and_its_records_are_inverse() {
        let records: Vec<_> = profile().records().collect();
        assert_eq!(read(&records), Ok(profile()));
        assert_eq!(records.len(), 5);
        let mut bytes = [0; 64];
        assert!(records.iter().all(|record| postcard::to_slice(record, &mut bytes).is_ok()));
    }

    #[test]
    fn records_out_of_order_and_incomplete_profiles_are_refused() {
        let records: Vec<_> = profile().records().collect();
        for missing in 0..records.len() {
            let mut some = records.clone();
            some.remove(missing);
            let dropped = matches!(records[missing], ProfileRecord::Output { .. } | ProfileRecord::Servo(_));
            assert_eq!(read(&some).is_ok(), dropped, "without record {missing}");
        }
        let mut swapped = records.clone();
        swapped.swap(1, 2);
        assert_eq!(read(&swapped), Err(ProfileError::Order));
    }

    #[test]
    fn the_profile_that_is_built_in_is_sound_and_cautious() {
        assert_eq!(BUILT_IN.check(), Ok(()));
        let most = BUILT_IN.outputs.iter().flatten().map(|output| output.limit.max_on_ms).max();
        assert_eq!((most, BUILT_IN.servos.len()), (Some(1_000), 0));
    }

    #[test]
    fn what_the_board_cannot_run_safely_is_refused() {
        let broken = |change: fn(&mut Profile)| {
            let mut profile = profile();
            change(&mut profile);
            profile.check().is_err()
        };
        assert!(!broken(|_| {}));
        assert!(broken(|profile| profile.outputs[8] = profile.outputs[7]), "a line is used twice");
        assert!(broken(|profile| profile.emergency_stop = Some(EmergencyStop { input: 3, opens: true })));
        assert!(broken(|profile| profile.supply.new_coils = 0));
        assert!(broken(|profile| profile.servos[0].limit.id = 254));
        assert!(broken(|profile| profile.servos[0].limit.max_speed_rad_s = f32::NAN));
        assert!(broken(|profile| {
            let servo = profile.servos[0];
            let _ = profile.servos.push(servo);
        }));
        assert!(broken(|profile| {
            if let Some(output) = &mut profile.outputs[0] {
                output.limit.window_ms = u32::MAX;
            }
        }));
    }

    #[test]
    fn a_broken_wire_to_the_emergency_stop_stops_too() {
        let stop = EmergencyStop { input: 12, opens: true };
        assert!(stop.is_pressed(0) && !stop.is_pressed(1 << 12));
    }
}
