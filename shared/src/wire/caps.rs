//! What a board can do: read by a host from the answer to `Hello`, before it makes a profile or a table for the board.

use core::fmt;

use serde::{Deserialize, Serialize};

use crate::output::{MAX_INPUTS, MAX_LINES, MAX_SERVOS};
use crate::profile::{LINES_PER_CHIP, PinTable, Profile, ProfileError, Shortage};

/// Longest name of a board, in bytes.
pub const MAX_NAME: usize = 16;

/// What a board can do.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Caps {
    /// Output lines that it can drive, numbered from 0.
    pub lines: u8,
    /// Inputs of limit switches, numbered from 0.
    pub inputs: u8,
    /// Servos on its bus.
    pub servos: u8,
    /// Bytes of the longest table image that it stores.
    pub slot_bytes: u32,
    /// Name of the board, as in the answer to identify.
    pub board: heapless::String<MAX_NAME>,
    /// Which source the firmware was built from.
    pub build: BuildId,
}

/// First eight bytes of the SHA-256 of the firmware's source.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct BuildId(pub [u8; 8]);

impl fmt::Display for BuildId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl Caps {
    /// A board of this name with as many lines, inputs and servos as the firmware supports.
    pub fn largest(board: &str, slot_bytes: u32, build: BuildId) -> Self {
        let board = heapless::String::try_from(board).unwrap_or_default();
        let [lines, inputs, servos] = [MAX_LINES, MAX_INPUTS, MAX_SERVOS].map(|count| count as u8);
        Self { lines, inputs, servos, slot_bytes, board, build }
    }

    /// Refuses a profile that wires what the board does not have.
    ///
    /// # Errors
    /// With the first line, input or servo beyond the board's; or the profile is made for a chain of another length, or for
    /// other pins. A board that has as many lines as the firmware supports may not have counted them: it accepts less.
    pub fn check(&self, profile: &Profile) -> Result<(), ProfileError> {
        let missing = |shortage| Err(ProfileError::Board(shortage));
        let table = PinTable::of_board(&self.board);
        let own = table.map(PinTable::layout);
        if profile.board.layout.is_some_and(|layout| Some(layout) != own) {
            return missing(Shortage::Pins);
        }
        if profile.sync && table.is_none_or(|table| table.sync.is_empty()) {
            return missing(Shortage::Sync);
        }
        let measured_mv = table.map(|table| table.supply_mv);
        let is_measured = |mv: &u16| measured_mv.is_some_and(|[lowest, highest]| (lowest..=highest).contains(mv));
        if let Some(mv) = profile.min_supply_mv.filter(|mv| !is_measured(mv)) {
            return missing(Shortage::Supply { mv, measured_mv });
        }
        let is_counted = usize::from(self.lines) < MAX_LINES;
        if let Some(chips) =
            profile.board.chips.filter(|chips| is_counted && chips.saturating_mul(LINES_PER_CHIP) != self.lines)
        {
            return missing(Shortage::Chips { chips, lines: self.lines });
        }
        if let Some(stop) = profile.emergency_stop.filter(|stop| stop.input >= self.inputs) {
            return missing(Shortage::Input { input: stop.input, inputs: self.inputs });
        }
        for output in profile.outputs.iter().flatten() {
            let (first, second) = output.drive.lines();
            if let Some(line) = [Some(first), second].into_iter().flatten().find(|line| *line >= self.lines) {
                return missing(Shortage::Line { line, lines: self.lines });
            }
            if let Some(input) = output.input.filter(|input| *input >= self.inputs) {
                return missing(Shortage::Input { input, inputs: self.inputs });
            }
        }
        if profile.servos.len() > usize::from(self.servos) {
            return missing(Shortage::Servos { servos: self.servos });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::{BuildId, Caps};
    use crate::output::Drive;
    use crate::profile::{
        B_L475E_IOT01A, BUILT_IN, BoardWiring, EmergencyStop, Output, PICO, Profile, ProfileError, Shortage,
    };

    fn caps() -> Caps {
        Caps {
            lines: 16,
            inputs: 8,
            servos: 4,
            slot_bytes: 65_536,
            board: "pico".try_into().unwrap(),
            build: BuildId([1, 2, 3, 4, 5, 6, 7, 0xab]),
        }
    }

    #[test]
    fn golden_bytes_both_ways() {
        let mut bytes = [0; 64];
        let encoded = postcard::to_slice(&caps(), &mut bytes).unwrap();
        assert_eq!(encoded, b"\x10\x08\x04\x80\x80\x04\x04pico\x01\x02\x03\x04\x05\x06\x07\xab");
        assert_eq!(postcard::from_bytes::<Caps>(encoded), Ok(caps()));
        let mut text = heapless::String::<16>::new();
        core::fmt::write(&mut text, format_args!("{}", caps().build)).unwrap();
        assert_eq!(text, "01020304050607ab");
    }

    #[test]
    fn a_profile_that_fits_passes_and_one_line_or_input_more_does_not() {
        let mut profile = Profile { outputs: BUILT_IN.outputs, ..Profile::empty() };
        assert_eq!(caps().check(&profile), Ok(()));
        let output = profile.outputs[0].unwrap();
        profile.outputs[0] = Some(Output { drive: Drive::Latch { set: 15, reset: 16, pulse_ms: 5 }, ..output });
        assert_eq!(caps().check(&profile), Err(ProfileError::Board(Shortage::Line { line: 16, lines: 16 })));
        profile.outputs[0] = Some(Output { input: Some(8), ..output });
        assert_eq!(caps().check(&profile), Err(ProfileError::Board(Shortage::Input { input: 8, inputs: 8 })));
        profile.outputs[0] = Some(Output { input: Some(7), ..output });
        profile.emergency_stop = Some(EmergencyStop { input: 9, opens: true });
        assert_eq!(caps().check(&profile), Err(ProfileError::Board(Shortage::Input { input: 9, inputs: 8 })));
    }

    #[test]
    fn a_profile_for_other_pins_or_for_a_chain_of_another_length_is_refused() {
        let with = |chips, layout| Profile { board: BoardWiring { chips, layout }, ..Profile::empty() };
        let pico = Caps { board: "Pico".try_into().unwrap(), ..caps() };
        assert_eq!(pico.check(&with(Some(2), Some(PICO.layout()))), Ok(()));
        for chips in [1, 3] {
            let found = pico.check(&with(Some(chips), None));
            assert_eq!(found, Err(ProfileError::Board(Shortage::Chips { chips, lines: 16 })));
        }
        let with_sync = Profile { sync: true, ..with(None, None) };
        assert_eq!(pico.check(&with_sync), Ok(()));
        assert_eq!(caps().check(&with_sync), Err(ProfileError::Board(Shortage::Sync)));
        let with_threshold = |mv| Profile { min_supply_mv: Some(mv), ..with(None, None) };
        assert_eq!(pico.check(&with_threshold(4_500)), Ok(()));
        let shortage = |mv, measured_mv| Err(ProfileError::Board(Shortage::Supply { mv, measured_mv }));
        assert_eq!(pico.check(&with_threshold(1_799)), shortage(1_799, Some([1_800, 5_500])));
        assert_eq!(caps().check(&with_threshold(4_500)), shortage(4_500, None), "it measures nothing");
        let uncounted = Caps { lines: 64, ..pico.clone() };
        assert_eq!(uncounted.check(&with(Some(3), None)), Ok(()));
        for (caps, layout) in [(&pico, B_L475E_IOT01A.layout()), (&caps(), PICO.layout())] {
            assert_eq!(caps.check(&with(None, Some(layout))), Err(ProfileError::Board(Shortage::Pins)));
        }
    }
}
