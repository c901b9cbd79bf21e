//! Coils of one board: which carry current, since when, and which lines that makes high.
//!
//! A tick touches what changes: coils that switch, peaks and pulses that end, and [`COILS_A_TICK`] clocks in turn.

use super::{CommandError, FaultKind};
use crate::output::{CoilBreach, CoilClock, Drive, MAX_ACTUATORS, MAX_COILS, SwitchClock, Wiring};
use crate::units::{Micros, Word};

/// So many coils have their limits looked at in one tick: each of the most there can be within 8 ms.
const COILS_A_TICK: usize = 6;

/// State of all coils. Sets of coils are masks: bit `c` is coil `c`.
#[derive(Debug)]
pub(super) struct Coils {
    /// Digits that the coils hold.
    word: Word,
    /// Digits that are asked for.
    wanted: Word,
    /// Coils that are on in the wanted word.
    target: u64,
    /// Coils that are on.
    on: u64,
    /// When each coil changed last.
    changed: [Micros; MAX_COILS],
    /// When a coil that is on by hand goes off.
    off_at: Option<(u8, Micros)>,
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
    clocks: [CoilClock; MAX_COILS],
    /// Until when each clock has counted.
    counted: [Micros; MAX_COILS],
    /// The coil whose clock counts next.
    next: usize,
    switched: SwitchClock,
    /// Coils of bits 0 and 1 of each actuator's digit.
    of_digit: [[u64; 2]; MAX_ACTUATORS],
    /// Lines of each coil.
    wires: [Wires; MAX_COILS],
}

/// Lines of one coil, as masks: a shift of 64 bits by a variable costs the chip ten instructions.
#[derive(Clone, Copy, Debug, Default)]
struct Wires {
    /// High while a coil pulls in; sets a latch.
    first: u64,
    /// High while a coil is on; resets a latch.
    second: u64,
}

impl From<&Drive> for Wires {
    fn from(drive: &Drive) -> Self {
        match *drive {
            Drive::Hold { line } => Self { first: 0, second: 1 << line },
            Drive::PeakHold { pull, hold, .. } => Self { first: 1 << pull, second: 1 << hold },
            Drive::Latch { set, reset, .. } => Self { first: 1 << set, second: 1 << reset },
        }
    }
}

impl Default for Coils {
    fn default() -> Self {
        Self {
            word: Word::default(),
            wanted: Word::default(),
            target: 0,
            on: 0,
            changed: [Micros(0); MAX_COILS],
            off_at: None,
            latches: 0,
            peaks: 0,
            unknown: 0,
            pulsing: 0,
            peaking: 0,
            lines: 0,
            clocks: [CoilClock::default(); MAX_COILS],
            counted: [Micros(0); MAX_COILS],
            next: 0,
            switched: SwitchClock::default(),
            of_digit: [[0; 2]; MAX_ACTUATORS],
            wires: [Wires::default(); MAX_COILS],
        }
    }
}

impl Coils {
    pub(super) fn word(&self) -> Word {
        self.word
    }

    /// Levels of the output lines.
    pub(super) fn lines(&self) -> u64 {
        self.lines
    }

    /// Takes over another wiring, of whose latches nothing is known. No coil carries current.
    pub(super) fn load(&mut self, now: Micros, wiring: &Wiring) {
        self.latches = 0;
        self.peaks = 0;
        for (index, (coil, wires)) in wiring.coils.iter().zip(&mut self.wires).enumerate() {
            *wires = Wires::from(&coil.drive);
            match coil.drive {
                Drive::Hold { .. } => {}
                Drive::PeakHold { .. } => self.peaks |= 1 << index,
                Drive::Latch { .. } => self.latches |= 1 << index,
            }
        }
        let mut first = 0;
        for (actuator, of_digit) in wiring.actuators.iter().zip(&mut self.of_digit) {
            *of_digit = if actuator.coils() > 1 { [1 << first, 2 << first] } else { [1 << first, 0] };
            first += actuator.coils();
        }
        self.next = 0;
        self.on = 0;
        self.word = Word::zeros(wiring.actuators.len() as u8).unwrap_or_default();
        self.rest(now, wiring);
    }

    /// No coil carries current; latches stay as they are. What has flowed so far stays counted.
    pub(super) fn rest(&mut self, now: Micros, wiring: &Wiring) {
        for (index, _) in Bits(self.fed()) {
            // That the coil was on for too long no longer matters: it goes off.
            let _ = self.count(now, index, true, wiring);
        }
        self.word = Word::zeros(self.word.len() as u8).unwrap_or_default();
        self.wanted = self.word;
        self.target = 0;
        self.on &= self.latches;
        self.pulsing = 0;
        self.peaking = 0;
        self.lines = 0;
        self.off_at = None;
    }

    /// Nobody knows any more how the latches stand.
    pub(super) fn forget(&mut self) {
        self.unknown = self.latches;
    }

    /// Sets the latches that nobody knows as a word says, no more at once than the supply can feed. True when they are
    /// set and the supply is ready for as many coils as it can ever feed.
    pub(super) fn set_latches(&mut self, now: Micros, word: Word, wiring: &Wiring) -> Result<bool, FaultKind> {
        self.ask(word);
        self.set_all(now, now, self.unknown, wiring)?;
        let ready = self.switched.room(now, &wiring.switch_limit) == wiring.switch_limit.new_coils;
        Ok(ready && self.unknown | self.pulsing == 0)
    }

    /// Lets time pass: ends peaks and pulses, and finds the coil that carries current for too long.
    pub(super) fn pass(&mut self, now: Micros, wiring: &Wiring) -> Result<(), FaultKind> {
        let fed = self.fed();
        for _ in 0..COILS_A_TICK.min(wiring.coils.len()) {
            self.count(now, self.next, fed >> self.next & 1 == 1, wiring)?;
            self.next = if self.next + 1 < wiring.coils.len() { self.next + 1 } else { 0 };
        }
        for (index, bit) in Bits(self.pulsing | self.peaking) {
            let long_ms = match wiring.coils.get(index).map(|coil| coil.drive) {
                Some(Drive::PeakHold { peak_ms, .. }) => peak_ms,
                Some(Drive::Latch { pulse_ms, .. }) => pulse_ms,
                Some(Drive::Hold { .. }) | None => 0,
            };
            if now - self.changed[index] >= Micros::from_millis(u32::from(long_ms)) {
                self.count(now, index, true, wiring)?;
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

    /// Lets the clock of one coil, which was `fed` or not, count up to now.
    fn count(&mut self, now: Micros, index: usize, fed: bool, wiring: &Wiring) -> Result<(), FaultKind> {
        let Some(coil) = wiring.coils.get(index) else {
            return Ok(());
        };
        let span = now - self.counted[index];
        self.counted[index] = now;
        let passed = self.clocks[index].pass(span, fed, &coil.limit);
        passed.map_err(|breach| match breach {
            CoilBreach::OnTooLong => FaultKind::CoilOnTooLong { coil: index as u8 },
            CoilBreach::Duty => FaultKind::CoilDuty { coil: index as u8 },
        })
    }

    /// Sets all digits at once, as a row says. The feed is counted at the row's own time `due`, which no late tick moves.
    pub(super) fn switch(&mut self, now: Micros, due: Micros, word: Word, wiring: &Wiring) -> Result<(), FaultKind> {
        self.ask(word);
        if !self.set_all(now, due, self.on ^ self.target, wiring)? {
            return Err(FaultKind::TooManyCoils);
        }
        self.word = word;
        Ok(())
    }

    /// Asks for a word by hand; [`Coils::release`] sets it as the supply allows.
    pub(super) fn want(&mut self, word: Word, wiring: &Wiring) -> Result<(), CommandError> {
        let fits = word.len() == wiring.actuators.len()
            && wiring.actuators.iter().zip(word.iter()).all(|(actuator, digit)| digit < actuator.states);
        if !fits {
            return Err(CommandError::NotWired);
        }
        self.ask(word);
        self.off_at = None;
        Ok(())
    }

    /// The wanted word, and the coils that are on in it.
    fn ask(&mut self, word: Word) {
        for (index, _) in Bits(word.differing(&self.wanted)) {
            let ([low, high], digit) = (self.of_digit[index], word.digit(index));
            self.target &= !(low | high);
            self.target |= if digit & 1 != 0 { low } else { 0 } | if digit & 2 != 0 { high } else { 0 };
        }
        self.wanted = word;
    }

    /// Switches one coil by hand: on for `on_ms`, or off.
    pub(super) fn pulse(&mut self, now: Micros, coil: u8, on_ms: u32, wiring: &Wiring) -> Result<(), CommandError> {
        let wired = wiring.coils.get(usize::from(coil)).ok_or(CommandError::NotWired)?;
        if self.latches >> coil & 1 == 0 && on_ms > wired.limit.max_on_ms {
            return Err(CommandError::OnTooLong { max_ms: wired.limit.max_on_ms });
        }
        self.want_coil(coil, on_ms > 0, wiring);
        self.off_at = (on_ms > 0).then_some((coil, now + Micros::from_millis(on_ms)));
        Ok(())
    }

    fn want_coil(&mut self, coil: u8, on: bool, wiring: &Wiring) {
        let mask = 1 << coil;
        for (index, [low, high]) in self.of_digit.into_iter().enumerate().take(wiring.actuators.len()) {
            let bit = u8::from(mask == low) | u8::from(mask == high) << 1;
            if bit == 0 {
                continue;
            }
            let digit = self.wanted.digit(index);
            self.ask(self.wanted.with_digit(index, if on { digit | bit } else { digit & !bit }));
        }
    }

    /// Switches what is asked for by hand, no more coils at once than the supply can feed.
    pub(super) fn release(&mut self, now: Micros, wiring: &Wiring) -> Result<(), FaultKind> {
        if let Some((coil, off_at)) = self.off_at
            && now >= off_at
        {
            self.want_coil(coil, false, wiring);
            self.off_at = None;
        }
        if self.set_all(now, now, self.on ^ self.target, wiring)? {
            self.word = self.wanted;
        }
        Ok(())
    }

    /// Switches coils to what is wanted; false when the supply cannot feed them all now.
    fn set_all(&mut self, now: Micros, due: Micros, coils: u64, wiring: &Wiring) -> Result<bool, FaultKind> {
        if coils == 0 {
            return Ok(true);
        }
        let feeding = coils & (self.target | self.latches);
        let room = self.switched.room(due, &wiring.switch_limit);
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
            self.count(now, index, fed & bit != 0, wiring)?;
            self.changed[index] = now;
            self.show(index, bit);
        }
        Ok(complete)
    }

    /// Makes the lines of one coil what its state says.
    fn show(&mut self, index: usize, bit: u64) {
        let Wires { first, second } = self.wires[index];
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
