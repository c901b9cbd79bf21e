//! Everything that is wired to the board, checked before anything is driven.

use super::{
    ActuatorWiring, Coil, Drive, MAX_ACTUATORS, MAX_COILS, MAX_INPUTS, MAX_SERVOS, ServoWiring, SwitchLimit,
    WiringError,
};
use crate::units::{ActuatorId, Word};

/// Everything that is wired to the board.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Wiring {
    /// Coils, numbered along the actuators.
    pub coils: heapless::Vec<Coil, MAX_COILS>,
    /// Discrete actuators along the chain.
    pub actuators: heapless::Vec<ActuatorWiring, MAX_ACTUATORS>,
    /// Servo joints along the chain.
    pub servos: heapless::Vec<ServoWiring, MAX_SERVOS>,
    /// What the supply can feed.
    pub switch_limit: SwitchLimit,
}

impl Wiring {
    /// Index of the first coil of an actuator.
    pub fn first_coil(&self, actuator: usize) -> usize {
        self.actuators.iter().take(actuator).map(ActuatorWiring::coils).sum()
    }

    /// The coil of an output.
    pub fn coil(&self, output: u8) -> Option<&Coil> {
        self.coils.iter().find(|coil| coil.output == output)
    }

    /// The coils that a word feeds: bit `c` for coil `c`.
    pub fn coils_on(&self, word: &Word) -> u64 {
        let mut fed = 0;
        let mut first = 0usize;
        for (index, actuator) in self.actuators.iter().enumerate() {
            fed |= u64::from(word.digit(index)) << first;
            first = first.saturating_add(actuator.coils());
        }
        fed
    }

    /// Whether a word has one digit for each actuator, and only digits that they have.
    pub fn has_word(&self, word: &Word) -> bool {
        word.len() == self.actuators.len()
            && self.actuators.iter().zip(word.iter()).all(|(actuator, digit)| digit < actuator.states)
    }

    /// Refuses a wiring that the board could not run safely.
    ///
    /// # Errors
    ///
    /// An actuator has fewer than 2 or more than 4 states, or not the coils that its states need; an output, line or
    /// input is missing or used twice; or a limit of a coil, of a servo or of the supply bounds nothing.
    pub fn check(&self) -> Result<(), WiringError> {
        self.check_actuators()?;
        self.check_coils()?;
        check_servos(self.servos.iter())?;
        check_supply(&self.switch_limit)
    }

    /// The actuators along the chain, each with its coils; none where the coils do not suffice.
    pub fn actuators_with_coils(&self) -> impl Iterator<Item = (&ActuatorWiring, &[Coil])> {
        let mut rest = self.coils.as_slice();
        self.actuators.iter().map(move |actuator| {
            let (own, others) = rest.split_at_checked(actuator.coils()).unwrap_or_default();
            rest = others;
            (actuator, own)
        })
    }

    fn check_actuators(&self) -> Result<(), WiringError> {
        let mut inputs = InputUse::default();
        for (index, wiring) in (0u8..).zip(&self.actuators) {
            if !(2..=4).contains(&wiring.states) {
                return Err(WiringError::States { actuator: ActuatorId(index) });
            }
            if let Some(switch) = wiring.switch {
                inputs.take(switch.input)?;
            }
        }
        let coils = self.first_coil(self.actuators.len());
        if coils == self.coils.len() {
            Ok(())
        } else {
            Err(WiringError::CoilCount { coil: coils.min(self.coils.len()) as u8 })
        }
    }

    fn check_coils(&self) -> Result<(), WiringError> {
        let (mut lines, mut outputs) = (LineUse::default(), 0u64);
        for coil in &self.coils {
            let output = coil.output;
            let bit = if usize::from(output) < MAX_COILS { 1 << output } else { 0 };
            if bit == 0 || outputs & bit != 0 {
                return Err(WiringError::Output { output });
            }
            outputs |= bit;
            lines.take(&coil.drive)?;
            if !coil.limit.is_sound(&coil.drive) {
                return Err(WiringError::CoilLimit { output });
            }
        }
        Ok(())
    }
}

/// Refuses servos that make no sense, and two with one address.
///
/// # Errors
///
/// [`WiringError::Servo`]: the range, speed, torque or time-out of a servo makes no sense, or an earlier one has its
/// address.
pub fn check_servos<'s>(servos: impl Iterator<Item = &'s ServoWiring> + Clone) -> Result<(), WiringError> {
    for (index, servo) in servos.clone().enumerate() {
        let is_new = servos.clone().take(index).all(|earlier| earlier.id != servo.id);
        if !(servo.is_sound() && is_new) {
            return Err(WiringError::Servo { servo: index as u8 });
        }
    }
    Ok(())
}

/// The bit of an input, among those that the board sees; none where there is no such input.
pub const fn input_bit(input: u8) -> u32 {
    if (input as usize) < MAX_INPUTS { 1 << input } else { 0 }
}

/// Inputs that are in use, bit `i` for input `i`.
#[derive(Clone, Copy, Debug, Default)]
pub struct InputUse(u32);

impl InputUse {
    /// Takes an input, or says that it does not exist or is in use.
    ///
    /// # Errors
    ///
    /// [`WiringError::Input`]: the input does not exist or was taken before.
    pub fn take(&mut self, input: u8) -> Result<(), WiringError> {
        let bit = input_bit(input);
        if bit == 0 || self.0 & bit != 0 {
            return Err(WiringError::Input { input });
        }
        self.0 |= bit;
        Ok(())
    }
}

/// Lines that are in use, bit `i` for line `i`.
#[derive(Clone, Copy, Debug, Default)]
pub struct LineUse(u64);

impl LineUse {
    /// Takes the lines of a drive, or says which does not exist or is in use.
    ///
    /// # Errors
    ///
    /// [`WiringError::Line`]: the line does not exist or was taken before. Lines of the drive before it stay taken.
    pub fn take(&mut self, drive: &Drive) -> Result<(), WiringError> {
        let (first, second) = drive.lines();
        for line in core::iter::once(first).chain(second) {
            let bit = 1u64.checked_shl(u32::from(line)).unwrap_or(0);
            if bit == 0 || self.0 & bit != 0 {
                return Err(WiringError::Line { line });
            }
            self.0 |= bit;
        }
        Ok(())
    }
}

/// Refuses a limit of the supply that bounds nothing.
///
/// # Errors
///
/// [`WiringError::SwitchLimit`]: the limit is 0 or above what the board counts.
pub fn check_supply(limit: &SwitchLimit) -> Result<(), WiringError> {
    if limit.is_sound() { Ok(()) } else { Err(WiringError::SwitchLimit) }
}
