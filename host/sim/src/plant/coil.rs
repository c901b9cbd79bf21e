//! One coil with its armature: which lines make it pull, hold and let go.
//!
//! | drive      | pulls                                | lets go                       |
//! |------------|--------------------------------------|-------------------------------|
//! | hold       | while its line is high               | when the line is low          |
//! | peak, hold | when the pull line goes high         | when both lines are low: the holding current keeps a pulled armature but pulls none |
//! | latch      | after half a pulse on the set line   | after half a pulse on the reset line |

use darm_core::output::Drive;

/// State of one coil.
#[derive(Clone, Debug)]
pub(super) struct Coil {
    drive: Drive,
    pulled: bool,
    /// A latch under current: the state that it takes, and when.
    flips: Option<(bool, f64)>,
}

impl Coil {
    pub(super) fn new(drive: Drive) -> Self {
        Self { drive, pulled: false, flips: None }
    }

    /// Whether the armature is pulled in.
    pub(super) fn pulled(&self) -> bool {
        self.pulled
    }

    /// Lets the lines act from `now_s` on.
    pub(super) fn set_lines(&mut self, now_s: f64, lines: u64) {
        let high = |line: u8| lines >> line & 1 == 1;
        match self.drive {
            Drive::Hold { line } => self.pulled = high(line),
            Drive::PeakHold { pull, hold, .. } => self.pulled = high(pull) || self.pulled && high(hold),
            Drive::Latch { set, reset, pulse_ms } => {
                let side = match (high(set), high(reset)) {
                    (true, false) => Some(true),
                    (false, true) => Some(false),
                    _ => None,
                };
                if side != self.flips.map(|(side, _)| side) {
                    let half_pulse_s = 0.5e-3 * f64::from(pulse_ms);
                    self.flips = side.map(|side| (side, now_s + half_pulse_s));
                }
            }
        }
    }

    /// Lets time pass.
    pub(super) fn advance(&mut self, now_s: f64) {
        if let Some((side, at_s)) = self.flips
            && at_s <= now_s
        {
            self.pulled = side;
        }
    }

    /// When the armature moves next if the lines stay as they are.
    pub(super) fn next_event_s(&self) -> Option<f64> {
        self.flips.filter(|(side, _)| *side != self.pulled).map(|(_, at_s)| at_s)
    }
}

#[cfg(test)]
mod tests {
    use darm_core::output::Drive;

    use super::Coil;

    #[test]
    fn the_holding_current_pulls_nothing_in() {
        let mut coil = Coil::new(Drive::PeakHold { pull: 0, hold: 1, peak_ms: 50 });
        for (lines, pulled) in [(0b10, false), (0b11, true), (0b10, true), (0b00, false), (0b10, false)] {
            coil.set_lines(0.0, lines);
            assert_eq!(coil.pulled(), pulled, "{lines:02b}");
        }
    }

    #[test]
    fn a_latch_wants_half_a_pulse_and_keeps_its_state() {
        let mut coil = Coil::new(Drive::Latch { set: 0, reset: 1, pulse_ms: 20 });
        let mut at = |now_s: f64, lines| {
            coil.advance(now_s);
            coil.set_lines(now_s, lines);
            coil.pulled()
        };
        assert!(!at(0.0, 0b01) && !at(0.009, 0b00), "too short a pulse");
        assert!(!at(0.1, 0b01) && at(0.12, 0b00) && at(9.0, 0b00));
        assert!(at(9.0, 0b10) && !at(9.02, 0b00));
    }
}
