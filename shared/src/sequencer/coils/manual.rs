//! Coils that are switched by hand: what a person asks for, within the limits.

use super::output::bit_of;
use super::{Coils, FaultKind};
use crate::output::Wiring;
use crate::sequencer::CommandError;
use crate::sequencer::bits::Bits;
use crate::units::{Micros, Word};

impl Coils<'_> {
    /// Asks for a word by hand; [`Coils::release`] sets it as the supply allows.
    pub(in crate::sequencer) fn want(&mut self, now: Micros, word: Word, wiring: &Wiring) -> Result<(), CommandError> {
        if !wiring.has_word(&word) {
            return Err(CommandError::NotWired);
        }
        let target = self.target_of(&word);
        let switching = target ^ self.on | self.unknown;
        for (index, bit) in Bits::of(switching & (target | self.latches)) {
            let min_flow = if self.latches & bit == 0 { Micros(1) } else { self.burst(index) };
            self.require(now, index, min_flow)?;
        }
        self.ask(word);
        self.timed = 0;
        self.asked = self.wired;
        Ok(())
    }

    /// Switches one coil by hand: on for `on_ms`, or off. A latch is set for this time, then reset.
    pub(in crate::sequencer) fn pulse(
        &mut self,
        now: Micros,
        number: u8,
        on_ms: u32,
        wiring: &Wiring,
    ) -> Result<(), CommandError> {
        let (index, bit) = (usize::from(number), bit_of(number));
        if self.wired & bit == 0 {
            return Err(CommandError::NotWired);
        }
        let word = self.with_coil(bit, on_ms > 0);
        if !wiring.has_word(&word) {
            return Err(CommandError::NoSuchState);
        }
        if on_ms > 0 {
            let on = Micros::from_millis(on_ms);
            let flows = if self.latches & bit == 0 { on } else { self.burst(index) };
            self.require(now, index, flows)?;
            let is_on = self.on & bit != 0;
            if let Some(output) = self.outputs.get_mut(index) {
                output.on_for = on;
                output.off_at = if is_on { now + on } else { Micros(u64::MAX) };
            }
            self.timed |= bit;
        } else {
            self.timed &= !bit;
        }
        self.asked |= bit;
        self.ask(word);
        Ok(())
    }

    fn burst(&self, index: usize) -> Micros {
        self.outputs.get(index).map_or(Micros(0), |output| output.burst)
    }

    /// Refuses to let current flow for this time from now on where the output's limits do not allow it.
    fn require(&mut self, now: Micros, index: usize, flows: Micros) -> Result<(), CommandError> {
        let fed = (self.fed() | self.ending) >> index & 1 == 1;
        // A breach is found again by the next tick, which latches it.
        let _ = self.count(now, index, fed);
        let Some((output, meter)) = self.outputs.get(index).zip(self.used.meters.get(index)) else {
            return Err(CommandError::NotWired);
        };
        let limit = &output.limit;
        if flows > limit.max_on() {
            return Err(CommandError::OnTooLong { max_ms: (limit.max_on().0 / 1000) as u32 });
        }
        let left_us = meter.left_us(limit);
        if flows <= Micros(left_us.into()) {
            let wait = if self.on >> index & 1 == 1 { Micros(0) } else { output.peak_from - now };
            let wait_ms = wait.0.div_ceil(1000) as u32;
            let recovering = CommandError::Recovering { output: index as u8, left_ms: 0, wait_ms };
            return if wait_ms == 0 { Ok(()) } else { Err(recovering) };
        }
        let [left_ms, wait_ms] = [left_us, meter.recovery_us(limit)].map(|us| us / 1000);
        Err(CommandError::Recovering { output: index as u8, left_ms, wait_ms })
    }

    /// The wanted word, but for one coil. A latch that a stop left set, and that was not requested since, counts in its actuator's state: a
    /// state that the actuator does not have would be made of both.
    fn with_coil(&self, bit: u64, on: bool) -> Word {
        let of = |[low, high]: &[u64; 2]| u8::from(bit == *low) | u8::from(bit == *high) << 1;
        let mut masks = self.of_digit.iter().take(self.wanted.len()).map(of).enumerate();
        let Some((index, mask)) = masks.find(|(_, mask)| *mask != 0) else { return self.wanted };
        let coils = self.target & self.asked | self.on & !self.asked;
        let [low, high] = self.of_digit.get(index).map_or([false; 2], |of| of.map(|coil| coils & coil != 0));
        let digit = u8::from(low) | u8::from(high) << 1;
        self.wanted.with_digit(index, if on { digit | mask } else { digit & !mask })
    }

    /// Switches what is requested by hand, no more coils at once than the supply can feed. The actuators that may travel from now on, bit
    /// `a` for actuator `a`: those whose digit changes, and those whose latch gets a pulse, as after a stop, which makes every digit 0.
    pub(in crate::sequencer) fn release(&mut self, now: Micros) -> Result<u64, FaultKind> {
        let (before, pulsing) = (self.word, self.pulsing);
        for (index, bit) in Bits::of(self.timed) {
            if self.outputs.get(index).is_some_and(|output| now >= output.off_at) {
                self.timed &= !bit;
                self.ask(self.with_coil(bit, false));
            }
        }
        // A stop leaves latches as they are: no command for another coil resets them.
        self.set_all(now, now, (self.on ^ self.target | self.unknown) & self.asked)?;
        // Each actuator is as its coils are: the supply may not have fed all of the word, and a latch that a stop left set, and
        // that was not requested since, is still set.
        let pulsed = self.actuators_of(self.pulsing & !pulsing);
        for (index, _) in Bits::of(self.wanted.differing(&self.word) | pulsed) {
            let Some([low, high]) = self.of_digit.get(index) else { continue };
            let digit = u8::from(self.on & low != 0) | u8::from(self.on & high != 0) << 1;
            self.word = self.word.with_digit(index, digit);
        }
        Ok(self.word.differing(&before) | pulsed)
    }

    /// The actuators of coils.
    fn actuators_of(&self, coils: u64) -> u64 {
        if coils == 0 {
            return 0;
        }
        let own = self.of_digit.iter().enumerate().filter(|(_, [low, high])| (low | high) & coils != 0);
        own.fold(0, |actuators, (index, _)| actuators | 1 << index)
    }

    /// Whether a coil sets and resets a latch.
    pub(in crate::sequencer) fn is_latch(&self, number: u8) -> bool {
        self.latches & bit_of(number) != 0
    }
}
