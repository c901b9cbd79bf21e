//! Coils of one board: which carry current, since when, and which lines that makes high.
//!
//! Coils are numbered by the output that feeds them. A tick touches what changes: coils that switch, peaks and pulses
//! that end, and some [meters](meters) in turn, also those of outputs that no table uses.

mod manual;
pub(crate) mod meters;
mod output;

use super::FaultKind;
use super::bits::{Bits, first_of};
use crate::duty::{DutyMeters, MeterLimit};
use crate::output::{Coil, Drive, MAX_ACTUATORS, MAX_COILS, SwitchClock, SwitchLimit, Wiring};
use crate::profile::Profile;
use crate::units::{Micros, Word};
use output::{NO_OUTPUT, Output, Wires, bit_of, limit_of};

/// State of all coils. Sets of coils are masks: bit `o` is the coil of output `o`.
#[derive(Debug)]
pub(super) struct Coils<'t> {
    /// Digits that the coils hold.
    word: Word,
    /// Requested digits.
    wanted: Word,
    /// Coils that are on in the wanted word.
    target: u64,
    /// Coils that are on.
    on: u64,
    /// Coils that a command by hand has switched on for a time.
    timed: u64,
    /// Coils that a command by hand concerns.
    asked: u64,
    /// Coils of the loaded table.
    wired: u64,
    /// Coils that are latches.
    latches: u64,
    /// Coils that pull in with full current.
    peaks: u64,
    /// Latches whose state is unknown: they are set before the first row, whatever they were.
    unknown: u64,
    /// Latches whose pulse runs.
    pulsing: u64,
    /// Coils with full current, to pull in.
    peaking: u64,
    /// When every coil may have a peak again: computed when a program is requested, which has no peak before its
    /// first row.
    peaks_from: Micros,
    /// Coils whose current ends with the outputs of the next tick: until then it is counted.
    ending: u64,
    /// Coils whose current has begun or ended since their meter counted: once, or twice.
    uncounted: u64,
    uncounted_twice: u64,
    /// From the first to the second time, µs.
    between_us: [u16; MAX_COILS],
    /// Levels of the output lines.
    lines: u64,
    outputs: [Output; MAX_COILS],
    /// Outputs of the profile, up to the last.
    n_outputs: usize,
    /// Outputs of the profile, from the first, that are taken over.
    n_taken: usize,
    /// The output whose meter counts next.
    next: usize,
    /// The meter of each output, which outlives table, stop and reset.
    used: &'t mut DutyMeters,
    supply: SwitchLimit,
    switched: SwitchClock,
    /// Coils of bits 0 and 1 of each actuator's digit.
    of_digit: [[u64; 2]; MAX_ACTUATORS],
}

impl<'t> Coils<'t> {
    /// No coil carries current, nothing is wired.
    pub(super) fn new(used: &'t mut DutyMeters) -> Self {
        Self {
            word: Word::default(),
            wanted: Word::default(),
            target: 0,
            on: 0,
            timed: 0,
            asked: 0,
            wired: 0,
            latches: 0,
            peaks: 0,
            unknown: 0,
            pulsing: 0,
            peaking: 0,
            peaks_from: Micros(0),
            ending: 0,
            uncounted: 0,
            uncounted_twice: 0,
            between_us: [0; MAX_COILS],
            lines: 0,
            outputs: [NO_OUTPUT; MAX_COILS],
            n_outputs: 0,
            n_taken: MAX_COILS,
            next: 0,
            used,
            supply: SwitchLimit::default(),
            switched: SwitchClock::default(),
            of_digit: [[0; 2]; MAX_ACTUATORS],
        }
    }

    pub(super) fn word(&self) -> Word {
        self.word
    }

    /// Levels of the output lines.
    pub(super) fn lines(&self) -> u64 {
        self.lines
    }

    /// How long each output has been on.
    pub(super) fn used(&self) -> &DutyMeters {
        self.used
    }

    /// Makes ready for the outputs of a profile after a start. The supply counts as exhausted: it is unknown what
    /// flowed just before.
    pub(super) fn configure(&mut self, now: Micros, profile: &Profile) {
        (self.n_taken, self.n_outputs, self.uncounted, self.uncounted_twice) = (0, 0, 0, 0);
        self.supply = profile.supply;
        let room = self.switched.room(now, &self.supply);
        self.switched.note(now, room);
    }

    /// Takes over some more outputs of the profile. A meter that is not valid, or was another profile's, counts as
    /// exhausted; the longest peak of the profile may have begun just now. All are this profile's when the last one is taken over,
    /// and not before: a reset may come in between.
    pub(super) fn take_outputs(&mut self, now: Micros, profile: &Profile, max: usize) {
        let own = profile.digest.short().0;
        let same = self.used.profile == own;
        let wired = profile.outputs.iter().zip(self.outputs.iter_mut().zip(&mut self.used.meters)).enumerate();
        for (number, (wired, (output, meter))) in wired.skip(self.n_taken).take(max) {
            let peak_from = now + wired.as_ref().map_or(Micros(0), |wired| wired.drive.peak_pause());
            let limit = limit_of(wired.as_ref());
            *output = Output { limit, peak_from, changed: now, counted: now, ..NO_OUTPUT };
            if !(same && meter.is_valid()) {
                meter.exhaust(&output.limit);
            }
            self.n_taken = number.saturating_add(1);
            if wired.is_some() {
                self.n_outputs = self.n_taken;
            }
        }
        if self.has_outputs() {
            self.used.profile = own;
        }
    }

    /// Whether all outputs of the profile are taken over.
    pub(super) fn has_outputs(&self) -> bool {
        self.n_taken >= MAX_COILS
    }

    /// Makes ready for the coils of another table. No coil carries current.
    pub(super) fn load(&mut self, wiring: &Wiring) {
        self.all_off();
        (self.wired, self.latches, self.unknown, self.peaks, self.on) = (0, 0, 0, 0, 0);
        self.supply = wiring.switch_limit;
        self.word = Word::zeros(wiring.actuators.len() as u8).unwrap_or_default();
        self.wanted = self.word;
    }

    /// Takes over the coils of one actuator. The state of a latch is not known.
    pub(super) fn wire(&mut self, actuator: usize, coils: &[Coil]) {
        let masks = [0, 1].map(|digit_bit| coils.get(digit_bit).map_or(0, |coil| self.wire_coil(coil)));
        if let Some(of_digit) = self.of_digit.get_mut(actuator) {
            *of_digit = masks;
        }
    }

    /// The coil's mask.
    fn wire_coil(&mut self, coil: &Coil) -> u64 {
        let Some(output) = self.outputs.get_mut(usize::from(coil.output)) else { return 0 };
        output.wire(&coil.drive);
        output.limit = MeterLimit::of(&coil.limit);
        let bit = bit_of(coil.output);
        self.wired |= bit;
        match coil.drive {
            Drive::Hold { .. } => {}
            Drive::PeakHold { .. } => self.peaks |= bit,
            Drive::Latch { .. } => {
                self.latches |= bit;
                self.unknown |= bit;
            }
        }
        bit
    }

    /// No coil carries current; latches stay as they are, and a latch whose pulse is cut is unknown. What has flowed so
    /// far stays counted.
    pub(super) fn all_off(&mut self) {
        self.ending |= self.fed();
        self.word = Word::zeros(self.word.len() as u8).unwrap_or_default();
        self.wanted = self.word;
        self.target = 0;
        self.on &= self.latches;
        self.unknown |= self.pulsing;
        (self.pulsing, self.peaking, self.lines, self.timed, self.asked) = (0, 0, 0, 0, 0);
    }

    /// Makes ready for the first row. The states of the latches are unknown from now on.
    pub(super) fn prepare(&mut self) {
        self.unknown = self.latches;
        let peaks = Bits::of(self.peaks).filter_map(|(index, _)| self.outputs.get(index));
        self.peaks_from = peaks.map(|output| output.peak_from).max().unwrap_or_default();
    }

    /// Sets the latches of unknown state as a word says, no more at once than the supply can feed. True when they are
    /// set, the supply is ready for as many coils as it can ever feed, every coil may have a peak again, and all that has flowed
    /// is counted, as it is before each pulse too.
    pub(super) fn set_latches(&mut self, now: Micros, word: Word) -> Result<bool, FaultKind> {
        self.ask(word);
        self.set_all(now, now, self.unknown & !(self.uncounted | self.ending))?;
        let ready = self.switched.room(now, &self.supply) == self.supply.new_coils;
        Ok(ready && now >= self.peaks_from && self.unknown | self.pulsing == 0 && self.is_counted())
    }

    /// Lets time pass: ends peaks and pulses, and finds the coil that carries current for too long.
    pub(super) fn pass(&mut self, now: Micros) -> Result<(), FaultKind> {
        let ending = core::mem::take(&mut self.ending);
        self.note_switched(now, ending, true)?;
        self.count_in_turn(now)?;
        let mut ended = 0;
        for (index, bit) in Bits::of(self.pulsing | self.peaking) {
            let Some(output) = self.outputs.get(index) else { continue };
            if now - output.changed >= output.burst {
                ended |= bit;
            }
        }
        // After its peak a coil holds: current flows on. That of a latch ends.
        self.note_switched(now, ended & self.pulsing, true)?;
        self.pulsing &= !ended;
        self.peaking &= !ended;
        self.show(ended);
        Ok(())
    }

    /// Coils that carry current.
    fn fed(&self) -> u64 {
        self.on & !self.latches | self.pulsing
    }

    /// Sets all digits at once, as a row says. The feed is counted at the row's own time `due`, which no late tick moves.
    pub(super) fn switch(&mut self, now: Micros, due: Micros, word: Word) -> Result<(), FaultKind> {
        self.ask(word);
        if !self.set_all(now, due, self.on ^ self.target)? {
            return Err(FaultKind::TooManyCoils);
        }
        self.word = word;
        Ok(())
    }

    /// The wanted word, and the coils that are on in it.
    fn ask(&mut self, word: Word) {
        self.target = self.target_of(&word);
        self.wanted = word;
    }

    fn target_of(&self, word: &Word) -> u64 {
        let mut target = self.target;
        let [lows, highs] = word.flips(&self.wanted).bits_of_digits();
        for (index, _) in Bits::of(lows) {
            target ^= self.of_digit.get(index).map_or(0, |[low, _]| *low);
        }
        for (index, _) in Bits::of(highs) {
            target ^= self.of_digit.get(index).map_or(0, |[_, high]| *high);
        }
        target
    }

    /// Switches coils to what is wanted; false when the supply cannot feed them all now. A coil whose peak comes before
    /// its pause is over breaks its limit.
    fn set_all(&mut self, now: Micros, due: Micros, coils: u64) -> Result<bool, FaultKind> {
        if coils == 0 {
            return Ok(true);
        }
        let feeding = coils & (self.target | self.latches);
        let room = self.switched.room(due, &self.supply);
        let new = first_of(feeding, room);
        self.switched.note(due, new.count_ones() as u8);
        let complete = new == feeding;
        let coils = coils & !feeding | new;
        let (fed, on) = (self.fed(), self.target & coils);
        self.on = self.on & !coils | on;
        self.unknown &= !coils;
        self.pulsing |= self.latches & coils;
        self.peaking = self.peaking & !coils | self.peaks & on;
        let fed_now = self.fed();
        self.note_switched(now, fed & !fed_now, true)?;
        self.note_switched(now, fed_now & !fed, false)?;
        for (index, _) in Bits::of(coils & (self.pulsing | self.peaking)) {
            if let Some(output) = self.outputs.get_mut(index) {
                if now < output.peak_from {
                    return Err(FaultKind::Duty { output: index as u8 });
                }
                (output.changed, output.peak_from) = (now, now + output.pause);
            }
        }
        for (index, _) in Bits::of(self.timed & on) {
            if let Some(output) = self.outputs.get_mut(index) {
                output.off_at = now + output.on_for;
            }
        }
        self.show(coils);
        Ok(complete)
    }

    /// Makes the lines of these coils what their state says.
    fn show(&mut self, coils: u64) {
        if coils == 0 {
            return;
        }
        let holding = coils & self.on & !self.latches;
        let pulsing = coils & self.pulsing;
        let (off, hold) = (self.wires(coils & !holding), self.wires(holding));
        let low = self.lines & !(off.first | off.second | hold.first);
        let second = hold.second | self.wires(pulsing & !self.on).second;
        let full = holding & self.peaking | pulsing & self.on;
        // As a rule all that are switched on have a peak, or none.
        let first = if full == holding { hold.first } else { self.wires(full).first };
        self.lines = low | second | first;
    }

    /// The lines of all of these coils.
    fn wires(&self, coils: u64) -> Wires {
        let outputs = Bits::of(coils).filter_map(|(index, _)| self.outputs.get(index));
        outputs.fold(Wires::default(), |all, Output { wires, .. }| Wires {
            first: all.first | wires.first,
            second: all.second | wires.second,
        })
    }
}

#[cfg(test)]
mod tests;
