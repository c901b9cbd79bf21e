//! Coils of one board: which carry current, since when, and what their switches must show.

use super::{CommandError, FaultKind};
use crate::output::{CoilBreach, CoilClock, Drive, MAX_ACTUATORS, MAX_COILS, SwitchClock, Wiring};
use crate::units::{ActuatorId, Micros, Word};

/// A switch must contradict in so many ticks in a row before that is a fault: contacts bounce.
const BOUNCE_TICKS: u8 = 3;

/// State of all coils.
#[derive(Debug)]
pub(super) struct Coils {
    /// Digits that the coils hold.
    word: Word,
    /// Digits that are asked for by hand.
    wanted: Word,
    /// Coils that are on, bit `c` for coil `c`.
    on: u64,
    /// When each coil changed last.
    changed: [Micros; MAX_COILS],
    /// When a coil that is on by hand goes off.
    off_at: Option<(u8, Micros)>,
    /// Coils that are latches.
    latches: u64,
    /// Latches whose state nobody knows: the next word sets them whatever it was.
    unknown: u64,
    /// Latches whose pulse runs.
    pulsing: u64,
    clocks: [CoilClock; MAX_COILS],
    switched: SwitchClock,
    switches: [Expected; MAX_ACTUATORS],
}

/// What the switch of one actuator must show, and since when.
#[derive(Clone, Copy, Debug, Default)]
struct Expected {
    since: Option<Micros>,
    contradictions: u8,
}

impl Default for Coils {
    fn default() -> Self {
        Self {
            word: Word::default(),
            wanted: Word::default(),
            on: 0,
            changed: [Micros(0); MAX_COILS],
            off_at: None,
            latches: 0,
            unknown: 0,
            pulsing: 0,
            clocks: [CoilClock::default(); MAX_COILS],
            switched: SwitchClock::default(),
            switches: [Expected::default(); MAX_ACTUATORS],
        }
    }
}

impl Coils {
    pub(super) fn word(&self) -> Word {
        self.word
    }

    /// Takes over another wiring, of whose latches nothing is known.
    pub(super) fn load(&mut self, wiring: &Wiring) {
        self.latches = wiring.coils.iter().enumerate().fold(0, |mask, (index, coil)| match coil.drive {
            Drive::Latch { .. } => mask | 1 << index,
            Drive::Hold { .. } | Drive::PeakHold { .. } => mask,
        });
        self.word = Word::zeros(wiring.actuators.len() as u8).unwrap_or_default();
        self.on = 0;
        self.rest();
    }

    /// No coil carries current; latches stay as they are. What has flowed so far stays counted.
    pub(super) fn rest(&mut self) {
        self.word = Word::zeros(self.word.len() as u8).unwrap_or_default();
        self.wanted = self.word;
        self.on &= self.latches;
        self.pulsing = 0;
        self.off_at = None;
        self.expect_from(None);
    }

    /// A program starts: its first word sets every latch, and every switch must show its digit after the travel.
    pub(super) fn begin(&mut self, now: Micros) {
        self.unknown = self.latches;
        self.expect_from(Some(now));
    }

    /// What the switches must show counts from `since` on.
    fn expect_from(&mut self, since: Option<Micros>) {
        let wired = self.word.len();
        self.switches.iter_mut().take(wired).for_each(|switch| *switch = Expected { since, contradictions: 0 });
    }

    /// Lets time pass and finds the coil that carries current for too long.
    pub(super) fn pass(&mut self, now: Micros, span: Micros, wiring: &Wiring) -> Result<(), FaultKind> {
        let mut fed = self.on & !self.latches | self.pulsing;
        for (index, coil) in wiring.coils.iter().enumerate() {
            let passed = self.clocks[index].pass(span, fed & 1 == 1, &coil.limit);
            fed >>= 1;
            passed.map_err(|breach| match breach {
                CoilBreach::OnTooLong => FaultKind::CoilOnTooLong { coil: index as u8 },
                CoilBreach::Duty => FaultKind::CoilDuty { coil: index as u8 },
            })?;
            if let Drive::Latch { pulse_ms, .. } = coil.drive
                && now - self.changed[index] >= Micros::from_millis(u32::from(pulse_ms))
            {
                self.pulsing &= !(1 << index);
            }
        }
        Ok(())
    }

    /// Sets all digits at once, as a row says. The feed is counted at the row's own time `due`, which no late tick moves.
    pub(super) fn switch(&mut self, now: Micros, due: Micros, word: Word, wiring: &Wiring) -> Result<(), FaultKind> {
        let target = wiring.coils_on(&word);
        for index in 0..wiring.coils.len() {
            let changes = ((self.on ^ target) | self.unknown) >> index & 1 == 1;
            if changes && !self.set(now, due, index, target >> index & 1 == 1, wiring) {
                return Err(FaultKind::TooManyCoils);
            }
        }
        self.hold(now, word);
        Ok(())
    }

    /// Asks for a word by hand; [`Coils::release`] sets it as the supply allows.
    pub(super) fn want(&mut self, word: Word, wiring: &Wiring) -> Result<(), CommandError> {
        let fits = word.len() == wiring.actuators.len()
            && wiring.actuators.iter().zip(word.iter()).all(|(actuator, digit)| digit < actuator.states);
        if !fits {
            return Err(CommandError::NotWired);
        }
        self.wanted = word;
        self.off_at = None;
        Ok(())
    }

    /// Switches one coil by hand: on for `on_ms`, or off.
    pub(super) fn pulse(&mut self, now: Micros, coil: u8, on_ms: u32, wiring: &Wiring) -> Result<(), CommandError> {
        let wired = wiring.coils.get(usize::from(coil)).ok_or(CommandError::NotWired)?;
        if self.latches >> coil & 1 == 0 && on_ms > wired.limit.max_on_ms {
            return Err(CommandError::OnTooLong { max_ms: wired.limit.max_on_ms });
        }
        if self.wanted.len() != wiring.actuators.len() {
            self.wanted = Word::zeros(wiring.actuators.len() as u8).unwrap_or_default();
        }
        self.want_coil(usize::from(coil), on_ms > 0, wiring);
        self.off_at = (on_ms > 0).then_some((coil, now + Micros::from_millis(on_ms)));
        Ok(())
    }

    fn want_coil(&mut self, coil: usize, on: bool, wiring: &Wiring) {
        let mut first = 0;
        for (index, actuator) in wiring.actuators.iter().enumerate() {
            if (first..first + actuator.coils()).contains(&coil) {
                let bit = 1 << (coil - first);
                let digit = self.wanted.digit(index);
                self.wanted = self.wanted.with_digit(index, if on { digit | bit } else { digit & !bit });
            }
            first += actuator.coils();
        }
    }

    /// Switches what is asked for by hand, no more coils at once than the supply can feed.
    pub(super) fn release(&mut self, now: Micros, wiring: &Wiring) {
        if let Some((coil, off_at)) = self.off_at
            && now >= off_at
        {
            self.want_coil(usize::from(coil), false, wiring);
            self.off_at = None;
        }
        let target = wiring.coils_on(&self.wanted);
        let complete = (0..wiring.coils.len()).all(|index| {
            let changes = (self.on ^ target) >> index & 1 == 1;
            !changes || self.set(now, now, index, target >> index & 1 == 1, wiring)
        });
        if complete && self.word != self.wanted {
            self.hold(now, self.wanted);
        }
    }

    /// Switches one coil; false when the supply cannot feed it now.
    fn set(&mut self, now: Micros, due: Micros, index: usize, on: bool, wiring: &Wiring) -> bool {
        let bit = 1 << index;
        let feeds = on || self.latches & bit != 0;
        if feeds && !self.switched.admit(due, &wiring.switch_limit) {
            return false;
        }
        self.on = if on { self.on | bit } else { self.on & !bit };
        self.unknown &= !bit;
        self.pulsing |= self.latches & bit;
        self.changed[index] = now;
        true
    }

    /// Notes which actuators move, so that their switches are looked at after the travel.
    fn hold(&mut self, now: Micros, word: Word) {
        for (index, expected) in self.switches.iter_mut().enumerate().take(word.len()) {
            if word.len() != self.word.len() || word.digit(index) != self.word.digit(index) {
                *expected = Expected { since: Some(now), contradictions: 0 };
            }
        }
        self.word = word;
    }

    /// Finds the switch that contradicts its actuator's digit after the time of travel.
    pub(super) fn check_switches(&mut self, now: Micros, seen: u32, wiring: &Wiring) -> Result<(), FaultKind> {
        for (index, (actuator, expected)) in wiring.actuators.iter().zip(&mut self.switches).enumerate() {
            let (Some(switch), Some(since)) = (actuator.switch, expected.since) else {
                continue;
            };
            if now - since < Micros::from_millis(u32::from(actuator.travel_ms)) {
                continue;
            }
            let expected_closed = switch.closed(self.word.digit(index));
            let seen_closed = seen >> switch.input & 1 == 1;
            expected.contradictions = if seen_closed == expected_closed { 0 } else { expected.contradictions + 1 };
            if expected.contradictions >= BOUNCE_TICKS {
                return Err(FaultKind::Switch { actuator: ActuatorId(index as u8), expected_closed, seen_closed });
            }
        }
        Ok(())
    }

    /// Levels of the output lines.
    ///
    /// Bits are shifted along one by one: a shift of 64 bits by a variable costs the chip ten times as much.
    pub(super) fn lines(&self, now: Micros, wiring: &Wiring) -> u64 {
        let (mut on_bits, mut pulsing_bits) = (self.on, self.pulsing);
        let mut lines = 0;
        for (coil, &changed) in wiring.coils.iter().zip(&self.changed) {
            let (on, pulsing) = (on_bits & 1 == 1, pulsing_bits & 1 == 1);
            (on_bits, pulsing_bits) = (on_bits >> 1, pulsing_bits >> 1);
            if !on && !pulsing {
                continue;
            }
            lines |= match coil.drive {
                Drive::Hold { line } => u64::from(on) << line,
                Drive::PeakHold { pull, hold, peak_ms } => {
                    let peak = on && now - changed < Micros::from_millis(u32::from(peak_ms));
                    u64::from(peak) << pull | u64::from(on) << hold
                }
                Drive::Latch { set, reset, .. } => u64::from(pulsing && on) << set | u64::from(pulsing && !on) << reset,
            };
        }
        lines
    }
}
