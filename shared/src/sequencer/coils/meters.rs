//! The meters of the coils, which count in turn.
//!
//! When a coil switched is only noted: its meter counts in its turn what flowed before and after, so that no row makes a tick
//! long. Two times are noted; where current begins or ends a third time before the meter's turn, the meter counts at once. No
//! program does that in time: each actuator [rests for a turn](crate::duty::turn_ticks), and the first row waits until all is counted.

use super::{Coils, bit_of};
use crate::duty::{Breach, SPANS, SPANS_A_TICK};
use crate::sequencer::FaultKind;
use crate::sequencer::bits::Bits;
use crate::units::Micros;

/// Meters that count in turn in one tick.
pub(super) const METERS_A_TICK: usize = 6;
impl Coils<'_> {
    /// Lets the next meters count.
    #[inline(always)]
    pub(super) fn count_in_turn(&mut self, now: Micros) -> Result<(), FaultKind> {
        let (fed, mut spans) = (self.fed(), SPANS_A_TICK);
        for _ in 0..METERS_A_TICK.min(self.n_outputs) {
            let bit = bit_of(self.next as u8);
            let own = match (self.uncounted & bit, self.uncounted_twice & bit) {
                (0, _) => 1,
                (_, 0) => 2,
                _ => SPANS,
            };
            let Some(left) = spans.checked_sub(own) else { break };
            spans = left;
            self.count(now, self.next, fed & bit != 0)?;
            let next = self.next.wrapping_add(1);
            self.next = if next < self.n_outputs { next } else { 0 };
        }
        Ok(())
    }

    /// Whether every meter has counted all that has flowed, as is so a few ticks after coils have switched.
    pub(in crate::sequencer) fn is_counted(&self) -> bool {
        self.uncounted | self.ending == 0
    }

    /// Current begins or ends now in these coils, all of which were `fed` before, or none.
    pub(super) fn note_switched(&mut self, now: Micros, coils: u64, fed: bool) -> Result<(), FaultKind> {
        for (index, bit) in Bits::of(coils) {
            if self.uncounted_twice & bit != 0 {
                self.count(now, index, fed)?;
            }
            let Some((output, between_us)) = self.outputs.get_mut(index).zip(self.between_us.get_mut(index)) else {
                continue;
            };
            if self.uncounted & bit == 0 {
                output.switched = now;
                self.uncounted |= bit;
            } else {
                // Its meter has its turn long before.
                *between_us = u16::try_from((now - output.switched).0).unwrap_or(u16::MAX);
                self.uncounted_twice |= bit;
            }
        }
        Ok(())
    }

    /// Lets the meter of one output, which is `fed` or not, count up to now.
    // One copy, with the meter's code in it: 3 % less in the longest tick of 12 coils.
    #[inline(never)]
    pub(super) fn count(&mut self, now: Micros, index: usize, fed: bool) -> Result<(), FaultKind> {
        let Some((output, meter)) = self.outputs.get_mut(index).zip(self.used.meters.get_mut(index)) else {
            return Ok(());
        };
        let (bit, mut before) = (bit_of(index as u8), Ok(()));
        if self.uncounted_twice & bit != 0 {
            let Some(&between_us) = self.between_us.get(index) else { return Ok(()) };
            self.uncounted_twice &= !bit;
            before = meter.pass(output.switched - output.counted, fed, &output.limit);
            output.counted = output.switched;
            output.switched = output.switched + Micros(between_us.into());
        }
        if self.uncounted & bit != 0 {
            self.uncounted &= !bit;
            before = before.and(meter.pass(output.switched - output.counted, !fed, &output.limit));
            output.counted = output.switched;
        }
        let span = now - output.counted;
        output.counted = now;
        before.and(meter.pass(span, fed, &output.limit)).map_err(|breach| match breach {
            Breach::OnTooLong => FaultKind::OnTooLong { output: index as u8 },
            Breach::Duty => FaultKind::Duty { output: index as u8 },
        })
    }
}
