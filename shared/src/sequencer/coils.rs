//! Coils of one board: which carry current, since when, and which lines that makes high.
//!
//! Coils are numbered by the output that feeds them. A tick touches what changes: coils that switch, peaks and pulses
//! that end, and [`METERS_A_TICK`] meters in turn, also those of outputs that no table uses.

use super::{CommandError, FaultKind};
use crate::duty::{Breach, DutyMeters};
use crate::output::{CoilLimit, Drive, MAX_ACTUATORS, MAX_COILS, SwitchClock, SwitchLimit, Wiring};
use crate::profile::Profile;
use crate::units::{Micros, Word};

/// So many meters count in one tick: each of the most there can be within 8 ms.
const METERS_A_TICK: usize = 6;

/// State of all coils. Sets of coils are masks: bit `o` is the coil of output `o`.
#[derive(Debug)]
pub(super) struct Coils<'t> {
    /// Digits that the coils hold.
    word: Word,
    /// Digits that are asked for.
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
    /// Latches whose state nobody knows: they are set before the first row, whatever they were.
    unknown: u64,
    /// Latches whose pulse runs.
    pulsing: u64,
    /// Coils with full current, to pull in.
    peaking: u64,
    /// Levels of the output lines.
    lines: u64,
    outputs: [Output; MAX_COILS],
    /// Outputs of the profile, up to the last.
    n_outputs: usize,
    /// The output whose meter counts next.
    next: usize,
    /// The meter of each output, which outlives table, stop and reset.
    used: &'t mut DutyMeters,
    supply: SwitchLimit,
    switched: SwitchClock,
    /// Coils of bits 0 and 1 of each actuator's digit.
    of_digit: [[u64; 2]; MAX_ACTUATORS],
}

/// One output: its lines, its limits and its times.
#[derive(Clone, Copy, Debug)]
struct Output {
    wires: Wires,
    limit: CoilLimit,
    /// Length of its peak or pulse.
    burst: Micros,
    /// When it switched last.
    changed: Micros,
    /// How long it is on by hand, and when it goes off: counted from when the supply has let it go on.
    on_for: Micros,
    off_at: Micros,
    /// Until when its meter has counted.
    counted: Micros,
}

/// Lines of one coil, as masks: a shift of 64 bits by a variable costs the chip ten instructions.
#[derive(Clone, Copy, Debug, Default)]
struct Wires {
    /// High while a coil pulls in; sets a latch.
    first: u64,
    /// High while a coil is on; resets a latch.
    second: u64,
}

/// A limit that allows nothing and counts nothing: that of an output that the profile does not have.
const NO_LIMIT: CoilLimit = CoilLimit { max_on_ms: 0, duty_percent: 0, window_ms: 0 };

const NO_OUTPUT: Output = Output {
    wires: Wires { first: 0, second: 0 },
    limit: NO_LIMIT,
    burst: Micros(0),
    changed: Micros(0),
    on_for: Micros(0),
    off_at: Micros(0),
    counted: Micros(0),
};

impl Output {
    fn wire(&mut self, drive: &Drive) {
        let bit = |line: u8| 1u64.checked_shl(line.into()).unwrap_or(0);
        let (first, second, burst_ms) = match *drive {
            Drive::Hold { line } => (0, bit(line), 0),
            Drive::PeakHold { pull, hold, peak_ms } => (bit(pull), bit(hold), peak_ms),
            Drive::Latch { set, reset, pulse_ms } => (bit(set), bit(reset), pulse_ms),
        };
        self.wires = Wires { first, second };
        self.burst = Micros::from_millis(burst_ms.into());
    }
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
            lines: 0,
            outputs: [NO_OUTPUT; MAX_COILS],
            n_outputs: 0,
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

    /// Takes over the outputs of a profile after a start. A meter that is not valid, or was another profile's, counts as
    /// exhausted, and so does the supply: nobody knows what flowed just before.
    pub(super) fn configure(&mut self, now: Micros, profile: &Profile) {
        let same = self.used.profile == profile.digest.short().0;
        self.used.profile = profile.digest.short().0;
        self.n_outputs = 0;
        let numbered = profile.outputs.iter().enumerate();
        for ((number, wired), (output, meter)) in numbered.zip(self.outputs.iter_mut().zip(&mut self.used.meters)) {
            *output = Output { limit: wired.map_or(NO_LIMIT, |wired| wired.limit), counted: now, ..NO_OUTPUT };
            if wired.is_some() {
                self.n_outputs = number.saturating_add(1);
            }
            if !(same && meter.is_valid()) {
                meter.exhaust(&output.limit);
            }
        }
        self.supply = profile.supply;
        let room = self.switched.room(now, &self.supply);
        self.switched.note(now, room);
    }

    /// Takes over another wiring, of whose latches nothing is known. No coil carries current.
    pub(super) fn load(&mut self, now: Micros, wiring: &Wiring, profile: &Profile) {
        self.rest(now);
        (self.wired, self.latches, self.peaks, self.on) = (0, 0, 0, 0);
        for (output, wired) in self.outputs.iter_mut().zip(&profile.outputs) {
            output.wires = Wires::default();
            output.limit = wired.map_or(NO_LIMIT, |wired| wired.limit);
        }
        for coil in &wiring.coils {
            let Some(output) = self.outputs.get_mut(usize::from(coil.output)) else { continue };
            output.wire(&coil.drive);
            output.limit = coil.limit;
            let bit = bit_of(coil.output);
            self.wired |= bit;
            match coil.drive {
                Drive::Hold { .. } => {}
                Drive::PeakHold { .. } => self.peaks |= bit,
                Drive::Latch { .. } => self.latches |= bit,
            }
        }
        for ((_, coils), of_digit) in wiring.actuators_with_coils().zip(&mut self.of_digit) {
            let mask = |digit_bit: usize| coils.get(digit_bit).map_or(0, |coil| bit_of(coil.output));
            *of_digit = [mask(0), mask(1)];
        }
        self.supply = wiring.switch_limit;
        self.unknown = self.latches;
        self.word = Word::zeros(wiring.actuators.len() as u8).unwrap_or_default();
        self.wanted = self.word;
    }

    /// No coil carries current; latches stay as they are, and a latch whose pulse is cut is unknown. What has flowed so
    /// far stays counted.
    pub(super) fn rest(&mut self, now: Micros) {
        for (index, _) in Bits(self.fed()) {
            // That the coil was on for too long no longer matters: it goes off.
            let _ = self.count(now, index, true);
        }
        self.word = Word::zeros(self.word.len() as u8).unwrap_or_default();
        self.wanted = self.word;
        self.target = 0;
        self.on &= self.latches;
        self.unknown |= self.pulsing;
        (self.pulsing, self.peaking, self.lines, self.timed, self.asked) = (0, 0, 0, 0, 0);
    }

    /// Nobody knows any more how the latches stand.
    pub(super) fn forget(&mut self) {
        self.unknown = self.latches;
    }

    /// Sets the latches that nobody knows as a word says, no more at once than the supply can feed. True when they are
    /// set and the supply is ready for as many coils as it can ever feed.
    pub(super) fn set_latches(&mut self, now: Micros, word: Word) -> Result<bool, FaultKind> {
        self.ask(word);
        self.set_all(now, now, self.unknown)?;
        let ready = self.switched.room(now, &self.supply) == self.supply.new_coils;
        Ok(ready && self.unknown | self.pulsing == 0)
    }

    /// Lets time pass: ends peaks and pulses, and finds the coil that carries current for too long.
    pub(super) fn pass(&mut self, now: Micros) -> Result<(), FaultKind> {
        let fed = self.fed();
        for _ in 0..METERS_A_TICK.min(self.n_outputs) {
            self.count(now, self.next, fed >> self.next & 1 == 1)?;
            let next = self.next.wrapping_add(1);
            self.next = if next < self.n_outputs { next } else { 0 };
        }
        for (index, bit) in Bits(self.pulsing | self.peaking) {
            let Some(output) = self.outputs.get(index) else { continue };
            if now - output.changed >= output.burst {
                self.count(now, index, true)?;
                self.pulsing &= !bit;
                self.peaking &= !bit;
                self.show(index, bit);
            }
        }
        Ok(())
    }

    /// Coils that carry current.
    fn fed(&self) -> u64 {
        self.on & !self.latches | self.pulsing
    }

    /// Lets the meter of one output, which was `fed` or not, count up to now.
    fn count(&mut self, now: Micros, index: usize, fed: bool) -> Result<(), FaultKind> {
        let Some((output, meter)) = self.outputs.get_mut(index).zip(self.used.meters.get_mut(index)) else {
            return Ok(());
        };
        if output.limit.window_ms == 0 {
            return Ok(());
        }
        let span = now - output.counted;
        output.counted = now;
        meter.pass(span, fed, &output.limit).map_err(|breach| match breach {
            Breach::OnTooLong => FaultKind::OnTooLong { output: index as u8 },
            Breach::Duty => FaultKind::Duty { output: index as u8 },
        })
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

    /// Asks for a word by hand; [`Coils::release`] sets it as the supply allows.
    pub(super) fn want(&mut self, now: Micros, word: Word, wiring: &Wiring) -> Result<(), CommandError> {
        if !wiring.has_word(&word) {
            return Err(CommandError::NotWired);
        }
        let target = self.target_of(&word);
        let switching = target ^ self.on | self.unknown;
        for (index, bit) in Bits(switching & (target | self.latches)) {
            let least = if self.latches & bit == 0 { Micros(1) } else { self.burst(index) };
            self.require(now, index, least)?;
        }
        self.ask(word);
        self.timed = 0;
        self.asked = self.wired;
        Ok(())
    }

    /// The wanted word, and the coils that are on in it.
    fn ask(&mut self, word: Word) {
        self.target = self.target_of(&word);
        self.wanted = word;
    }

    fn target_of(&self, word: &Word) -> u64 {
        let mut target = self.target;
        for (index, _) in Bits(word.differing(&self.wanted)) {
            let Some([low, high]) = self.of_digit.get(index) else { continue };
            let digit = word.digit(index);
            target &= !(low | high);
            target |= if digit & 1 != 0 { *low } else { 0 } | if digit & 2 != 0 { *high } else { 0 };
        }
        target
    }

    /// Switches one coil by hand: on for `on_ms`, or off. A latch is set for so long, then reset.
    pub(super) fn pulse(&mut self, now: Micros, number: u8, on_ms: u32) -> Result<(), CommandError> {
        let (index, bit) = (usize::from(number), bit_of(number));
        if self.wired & bit == 0 {
            return Err(CommandError::NotWired);
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
        self.want_coil(bit, on_ms > 0);
        Ok(())
    }

    fn burst(&self, index: usize) -> Micros {
        self.outputs.get(index).map_or(Micros(0), |output| output.burst)
    }

    /// Refuses to let current flow for so long from now on where the output's limits do not allow it.
    fn require(&mut self, now: Micros, index: usize, flows: Micros) -> Result<(), CommandError> {
        let fed = self.fed() >> index & 1 == 1;
        // A breach is found again by the next tick, which latches it.
        let _ = self.count(now, index, fed);
        let Some((output, meter)) = self.outputs.get(index).zip(self.used.meters.get(index)) else {
            return Err(CommandError::NotWired);
        };
        let limit = &output.limit;
        if flows > Micros::from_millis(limit.max_on_ms) {
            return Err(CommandError::OnTooLong { max_ms: limit.max_on_ms });
        }
        let left_us = meter.left_us(limit);
        if flows <= Micros(left_us.into()) {
            return Ok(());
        }
        let [left_ms, wait_ms] = [left_us, meter.recovery_us(limit)].map(|us| us / 1000);
        Err(CommandError::Recovering { output: index as u8, left_ms, wait_ms })
    }

    fn want_coil(&mut self, bit: u64, on: bool) {
        let of = |[low, high]: &[u64; 2]| u8::from(bit == *low) | u8::from(bit == *high) << 1;
        let own = self.of_digit.iter().take(self.wanted.len()).position(|masks| of(masks) != 0);
        let Some((index, mask)) = own.and_then(|index| Some((index, of(self.of_digit.get(index)?)))) else { return };
        let digit = self.wanted.digit(index);
        self.ask(self.wanted.with_digit(index, if on { digit | mask } else { digit & !mask }));
    }

    /// Switches what is asked for by hand, no more coils at once than the supply can feed.
    pub(super) fn release(&mut self, now: Micros) -> Result<(), FaultKind> {
        for (index, bit) in Bits(self.timed) {
            if self.outputs.get(index).is_some_and(|output| now >= output.off_at) {
                self.timed &= !bit;
                self.want_coil(bit, false);
            }
        }
        if self.set_all(now, now, self.on ^ self.target | self.unknown & self.asked)? {
            self.word = self.wanted;
        }
        Ok(())
    }

    /// Switches coils to what is wanted; false when the supply cannot feed them all now.
    fn set_all(&mut self, now: Micros, due: Micros, coils: u64) -> Result<bool, FaultKind> {
        if coils == 0 {
            return Ok(true);
        }
        let feeding = coils & (self.target | self.latches);
        let room = self.switched.room(due, &self.supply);
        let fed_now = first_of(feeding, room);
        self.switched.note(due, fed_now.count_ones() as u8);
        let complete = fed_now == feeding;
        let coils = coils & !feeding | fed_now;
        let (fed, on) = (self.fed(), self.target & coils);
        self.on = self.on & !coils | on;
        self.unknown &= !coils;
        self.pulsing |= self.latches & coils;
        self.peaking = self.peaking & !coils | self.peaks & on;
        for (index, bit) in Bits(coils) {
            self.count(now, index, fed & bit != 0)?;
            if let Some(output) = self.outputs.get_mut(index) {
                output.changed = now;
                if self.timed & on & bit != 0 {
                    output.off_at = now + output.on_for;
                }
            }
            self.show(index, bit);
        }
        Ok(complete)
    }

    /// Makes the lines of one coil what its state says.
    fn show(&mut self, index: usize, bit: u64) {
        let Some(Output { wires: Wires { first, second }, .. }) = self.outputs.get(index).copied() else { return };
        let (on, pulsing) = (self.on & bit != 0, self.pulsing & bit != 0);
        let levels = match (self.latches & bit != 0, on) {
            (true, _) if !pulsing => 0,
            (true, true) => first,
            (true, false) => second,
            (false, true) if self.peaking & bit != 0 => first | second,
            (false, true) => second,
            (false, false) => 0,
        };
        self.lines = self.lines & !(first | second) | levels;
    }
}

/// The mask of one output; none where there is no such output.
fn bit_of(number: u8) -> u64 {
    if usize::from(number) < MAX_COILS { 1 << number } else { 0 }
}

/// So many of the bits that are set, lowest first.
fn first_of(mask: u64, most: u8) -> u64 {
    if mask.count_ones() <= u32::from(most) {
        return mask;
    }
    Bits(mask).take(usize::from(most)).fold(0, |first, (_, bit)| first | bit)
}

/// The bits of a mask that are set, lowest first: index and mask of each.
pub(super) struct Bits(pub(super) u64);

impl Iterator for Bits {
    type Item = (usize, u64);

    fn next(&mut self) -> Option<Self::Item> {
        let bit = self.0 & self.0.wrapping_neg();
        self.0 ^= bit;
        (bit != 0).then(|| (bit.trailing_zeros() as usize, bit))
    }
}
