//! What is wired to one board, and the limits that no table can exceed: written only while a person is at the board.
//!
//! A table says which output moves which actuator, and within which limits; it may tighten a profile and never widen it.
//! An output is what feeds one coil: its lines, its limits and, where there is one, the input of its limit switch.
//!
//! A profile travels and is stored as a list of [`ProfileRecord`]s in a fixed order: `Start`, `Board` where it says something
//! of it, `Sync` where a camera gets a pulse, `MinSupply` where the board's supply has a threshold, the outputs by number, the servos in their order along the arm, `End`. A board without a profile has [`BUILT_IN`].
#![cfg_attr(not(test), deny(clippy::indexing_slicing, clippy::arithmetic_side_effects, clippy::unwrap_used))]

mod error;
mod mismatch;
mod pins;

use serde::{Deserialize, Serialize};

use crate::output::{
    Coil, CoilLimit, Drive, InputUse, LineUse, MAX_COILS, MAX_LINES, MAX_SERVOS, ServoWiring, SwitchLimit, Wiring,
    WiringError, check_servos, check_supply, input_bit,
};
use crate::units::Digest;
pub use error::{ProfileError, Shortage};
pub use mismatch::Mismatch;
pub use pins::{B_L475E_IOT01A, PICO, PIN_TABLES, PinTable};

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

/// Lines of a 74HC595.
pub const LINES_PER_CHIP: u8 = 8;
/// Most chips of an output chain.
pub const MAX_CHIPS: u8 = MAX_LINES as u8 / LINES_PER_CHIP;

/// The board and the chain that the wiring is made for; `None` where the profile does not say.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct BoardWiring {
    /// Chips of the output chain.
    pub chips: Option<u8>,
    /// The board with its pins: [`PinTable::layout`].
    pub layout: Option<u32>,
}

impl BoardWiring {
    /// Says nothing.
    pub const ANY: Self = Self { chips: None, layout: None };

    /// Refuses a length that no chain has.
    fn check(&self) -> Result<(), ProfileError> {
        match self.chips {
            Some(chips) if !(1..=MAX_CHIPS).contains(&chips) => Err(ProfileError::ChainLength { chips }),
            Some(_) | None => Ok(()),
        }
    }

    /// Refuses an output beyond the end of the chain.
    fn check_drive(&self, drive: &Drive) -> Result<(), ProfileError> {
        let Some(chips) = self.chips else { return Ok(()) };
        let (first, second) = drive.lines();
        let beyond = [Some(first), second].into_iter().flatten().find(|line| line / LINES_PER_CHIP >= chips);
        beyond.map_or(Ok(()), |line| Err(ProfileError::ChainLine { line, chips }))
    }
}

/// Lowest and highest threshold of a board's supply, mV: from the lowest supply of the STM32L475's converter (DS10969, "Analog-to-digital
/// converter characteristics") to the highest one at VSYS of the Pico (Pico data sheet, 4.4).
pub const MIN_SUPPLY_MV: [u16; 2] = [1_620, 5_500];

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
    /// The board and the chain that this is made for.
    pub board: BoardWiring,
    /// A camera gets a pulse at each row.
    pub sync: bool,
    /// Below this supply of the board the safe state is latched, mV.
    pub min_supply_mv: Option<u16>,
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
        Self::with_outputs(outputs)
    }

    /// Nothing wired, to be filled by a [`ProfileReader`].
    pub const fn empty() -> Self {
        Self::with_outputs([None; MAX_COILS])
    }

    /// One output at a time, and nothing else.
    const fn with_outputs(outputs: [Option<Output>; MAX_COILS]) -> Self {
        let supply = SwitchLimit { new_coils: 1, window_ms: 10 };
        let (board, digest) = (BoardWiring::ANY, Digest([0; 32]));
        Self {
            outputs,
            servos: heapless::Vec::new(),
            supply,
            emergency_stop: None,
            board,
            sync: false,
            min_supply_mv: None,
            digest,
        }
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
        let board = Some(self.board).filter(|board| *board != BoardWiring::ANY).map(ProfileRecord::Board);
        let sync = self.sync.then_some(ProfileRecord::Sync);
        let min_supply = self.min_supply_mv.map(|mv| ProfileRecord::MinSupply { mv });
        let settings = core::iter::once(start).chain(board).chain(sync).chain(min_supply);
        settings.chain(outputs).chain(servos).chain([ProfileRecord::End])
    }

    /// Refuses a profile that the board could not run safely.
    ///
    /// # Errors
    ///
    /// [`ProfileError::Wiring`]: a line or input is missing or used twice, or a limit bounds nothing.
    /// [`ProfileError::ChainLength`], [`ProfileError::ChainLine`]: the chain has no such length, or ends before a line.
    /// [`ProfileError::MinSupply`]: no board measures such a supply.
    pub fn check(&self) -> Result<(), ProfileError> {
        self.board.check()?;
        let [lowest, highest] = MIN_SUPPLY_MV;
        if let Some(mv) = self.min_supply_mv.filter(|mv| !(lowest..=highest).contains(mv)) {
            return Err(ProfileError::MinSupply { mv });
        }
        self.outputs.iter().flatten().try_for_each(|output| self.board.check_drive(&output.drive))?;
        self.check_as_wiring().map_err(ProfileError::Wiring)
    }

    fn check_as_wiring(&self) -> Result<(), WiringError> {
        check_supply(&self.supply)?;
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
    ///
    /// # Errors
    ///
    /// The profile has no such output, the output has another drive, or the coil's limit is wider than the profile's.
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
    ///
    /// # Errors
    ///
    /// The limit of the supply, or the range of a servo, is wider than the profile's; a servo is missing in the
    /// profile; or a limit switch is at another input than that of the actuator's first output.
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
    /// Behind `Start`: the board and the chain. Firmware from before this record refuses it.
    Board(BoardWiring),
    /// Behind `Start` and `Board`: a camera gets a pulse at each row. Firmware from before this record refuses it.
    Sync,
    /// Behind `Start`, `Board` and `Sync`: below this supply of the board the safe state is latched. Firmware from before this record
    /// refuses it.
    MinSupply {
        /// The threshold, mV.
        mv: u16,
    },
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
    ///
    /// # Errors
    ///
    /// [`ProfileError::Order`]: a record of this kind, or an output with this number, may not come here.
    /// [`ProfileError::Wiring`]: there are too many outputs or servos, or the board could not run the profile safely.
    pub fn push(&mut self, record: &ProfileRecord, profile: &mut Profile) -> Result<(), ProfileError> {
        let at = core::mem::take(self);
        *self = match (at, record) {
            (Self::Empty, ProfileRecord::Start { supply, emergency_stop }) => {
                *profile = Profile { supply: *supply, emergency_stop: *emergency_stop, ..Profile::empty() };
                Self::Open { next: Some(0) }
            }
            (Self::Open { next: Some(0) }, ProfileRecord::Board(board))
                if profile.board == BoardWiring::ANY && !profile.sync && profile.min_supply_mv.is_none() =>
            {
                profile.board = *board;
                Self::Open { next: Some(0) }
            }
            (Self::Open { next: Some(0) }, ProfileRecord::Sync) if !profile.sync && profile.min_supply_mv.is_none() => {
                profile.sync = true;
                Self::Open { next: Some(0) }
            }
            (Self::Open { next: Some(0) }, ProfileRecord::MinSupply { mv }) if profile.min_supply_mv.is_none() => {
                profile.min_supply_mv = Some(*mv);
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

#[cfg(test)]
mod tests;
