//! Judge 1, the valves: which state each actuator has by its lines, and whether it is one that it has. A coil is on while its line is
//! high, a latch is set by the last of its lines that went high, also over starts.

use super::ValveCeiling;
use super::switches::digit;

/// The judge's memory.
pub struct Valves {
    actuators: Vec<ValveCeiling>,
    digits: Vec<u8>,
    /// How often each was brought to a state that it does not have.
    entries: Vec<u32>,
    lines: u64,
}

impl Valves {
    /// Actuators at rest.
    pub fn new(actuators: Vec<ValveCeiling>) -> Self {
        let (digits, entries) = (vec![0; actuators.len()], vec![0; actuators.len()]);
        Self { actuators, digits, entries, lines: 0 }
    }

    /// The end of a tick: these lines are high.
    pub fn look(&mut self, lines: u64) {
        let rising = lines & !self.lines;
        self.lines = lines;
        for ((actuator, before), entries) in self.actuators.iter().zip(&mut self.digits).zip(&mut self.entries) {
            let digit = digit(&actuator.coils, *before, lines, rising);
            *entries += u32::from(digit >= actuator.states && *before < actuator.states);
            *before = digit;
        }
    }

    /// The state of an actuator.
    pub fn digit(&self, actuator: usize) -> Option<u8> {
        self.digits.get(actuator).copied()
    }

    /// How often an actuator was brought to a state that it does not have.
    pub fn entries(&self, actuator: usize) -> u32 {
        self.entries.get(actuator).copied().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::{ValveCeiling, Valves};

    #[test]
    fn a_state_that_an_actuator_does_not_have_is_counted_once() {
        for (coils, spans, entries) in [
            ([(0, None), (1, None)], &[0b01, 0, 0b10][..], 0),
            ([(0, None), (1, None)], &[0b01, 0b11, 0b11, 0b10], 1),
            ([(0, Some(2)), (1, Some(3))], &[0b0001, 0, 0b0100, 0, 0b0010], 0),
            ([(0, Some(2)), (1, Some(3))], &[0b0001, 0, 0b0010, 0, 0], 1),
        ] {
            let mut judge = Valves::new(vec![ValveCeiling { coils: coils.to_vec(), states: 3 }]);
            spans.iter().for_each(|lines| judge.look(*lines));
            assert_eq!(judge.entries(0), entries, "{coils:?} {spans:?}");
        }
    }
}
