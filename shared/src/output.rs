//! How actuators, limit switches and servos are wired to the board, and the limits that no sender can exceed.
//!
//! An actuator with two states has one coil, one with three or four states has two: coil `b` is on when bit `b`
//! of the actuator's digit is set. Coils are numbered along the actuators, the way the text command `coil N` counts them.
//!
//! | drive       | lines        | while the coil is on                                          |
//! |-------------|--------------|---------------------------------------------------------------|
//! | `Hold`      | one          | the line is high (a valve)                                    |
//! | `PeakHold`  | pull, hold   | both high for `peak_ms`, then only the hold line               |
//! | `Latch`     | set, reset   | a pulse of `pulse_ms` on `set` when it goes on, on `reset` when it goes off, no current between |
#![cfg_attr(not(test), deny(clippy::indexing_slicing, clippy::arithmetic_side_effects, clippy::unwrap_used))]

use core::fmt;

use serde::{Deserialize, Serialize};

use crate::units::{ActuatorId, Micros, Word};

/// Lines of the output chain: eight 74HC595.
pub const MAX_LINES: usize = 64;
/// Coils that one board drives.
pub const MAX_COILS: usize = 48;
/// Discrete actuators of one arm.
pub const MAX_ACTUATORS: usize = 48;
/// Inputs of the board: limit switches and an emergency stop.
pub const MAX_INPUTS: usize = 13;
/// Servo joints on the bus.
pub const MAX_SERVOS: usize = 4;

/// Positions of a servo in one turn (Feetech STS).
pub const SERVO_STEPS_PER_TURN: f32 = 4096.0;

/// How a coil uses its lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Drive {
    /// On or off.
    Hold {
        /// Line of the coil.
        line: u8,
    },
    /// Full current to pull in, less to hold.
    PeakHold {
        /// Line of the full current.
        pull: u8,
        /// Line of the holding current.
        hold: u8,
        /// How long the full current lasts.
        peak_ms: u16,
    },
    /// Keeps its state without current.
    Latch {
        /// Line of the coil that sets.
        set: u8,
        /// Line of the coil that resets.
        reset: u8,
        /// Length of either pulse.
        pulse_ms: u16,
    },
}

impl Drive {
    /// From the beginning of one peak to that of the next it takes at least so many times the length of a peak.
    const PEAK_PERIODS: u32 = 10;

    /// The least time between the beginnings of two peaks of an output, so that the share of full current is at most
    /// 10 %; 0 for a drive without a peak. The duty of a profile is that of the holding current: a coil that is switched
    /// off for a moment and on again, over and over, would keep it and burn. A peak of 0 ms counts as one of 1 ms: full
    /// current flows for a tick.
    pub fn peak_pause(&self) -> Micros {
        match *self {
            Self::PeakHold { peak_ms, .. } => {
                Micros::from_millis(u32::from(peak_ms.max(1)).saturating_mul(Self::PEAK_PERIODS))
            }
            Self::Hold { .. } | Self::Latch { .. } => Micros(0),
        }
    }

    /// The lines that this drive uses.
    pub const fn lines(&self) -> (u8, Option<u8>) {
        match *self {
            Self::Hold { line } => (line, None),
            Self::PeakHold { pull, hold, .. } => (pull, Some(hold)),
            Self::Latch { set, reset, .. } => (set, Some(reset)),
        }
    }

    /// Whether this drive of a profile allows that of a table: the same lines, no longer peak or pulse.
    pub const fn allows(&self, table: &Self) -> bool {
        match (*self, *table) {
            (Self::Hold { line }, Self::Hold { line: wanted }) => line == wanted,
            (Self::PeakHold { pull, hold, peak_ms }, Self::PeakHold { pull: p, hold: h, peak_ms: wanted }) => {
                pull == p && hold == h && wanted <= peak_ms
            }
            (Self::Latch { set, reset, pulse_ms }, Self::Latch { set: s, reset: r, pulse_ms: wanted }) => {
                set == s && reset == r && wanted <= pulse_ms
            }
            _ => false,
        }
    }

    /// The limits of a coil whose owner gave none: safe for small solenoids and for valves.
    pub const fn default_limit(&self) -> CoilLimit {
        match self {
            Self::Hold { .. } => CoilLimit { max_on_ms: 300_000, duty_percent: 80, window_ms: 600_000 },
            Self::PeakHold { .. } => CoilLimit { max_on_ms: 60_000, duty_percent: 60, window_ms: 120_000 },
            Self::Latch { .. } => CoilLimit { max_on_ms: 200, duty_percent: 20, window_ms: 10_000 },
        }
    }
}

impl fmt::Display for Drive {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Hold { line } => write!(f, "line {line}"),
            Self::PeakHold { pull, hold, peak_ms } => write!(f, "pull line {pull} for {peak_ms} ms, hold line {hold}"),
            Self::Latch { set, reset, pulse_ms } => write!(f, "set line {set}, reset line {reset} for {pulse_ms} ms"),
        }
    }
}

/// How long current may flow in a coil.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CoilLimit {
    /// Longest time on without a pause.
    pub max_on_ms: u32,
    /// Largest share of any window that the coil may be on, in percent.
    pub duty_percent: u8,
    /// Length of that window.
    pub window_ms: u32,
}

impl CoilLimit {
    /// Shortest window over which duty is counted. An output is looked at every 8 ms at the latest, which is to be a small
    /// part of it.
    pub const MIN_WINDOW_MS: u32 = 200;
    /// Longest window, and longest time on: their microseconds fit 32 bits.
    pub const MAX_WINDOW_MS: u32 = 3_600_000;
    /// Longest pulse of a latch.
    pub const MAX_PULSE_MS: u16 = 1_000;
    /// Longest peak.
    pub const MAX_PEAK_MS: u16 = 10_000;

    /// Whether these limits bound anything, and let the drive do what it is for.
    pub fn is_sound(&self, drive: &Drive) -> bool {
        let drive_fits = match *drive {
            Drive::Latch { pulse_ms, .. } => {
                (1..=Self::MAX_PULSE_MS).contains(&pulse_ms) && u32::from(pulse_ms) <= self.max_on_ms
            }
            Drive::PeakHold { peak_ms, .. } => peak_ms <= Self::MAX_PEAK_MS,
            Drive::Hold { .. } => true,
        };
        drive_fits
            && (Self::MIN_WINDOW_MS..=Self::MAX_WINDOW_MS).contains(&self.window_ms)
            && (1..=Self::MAX_WINDOW_MS).contains(&self.max_on_ms)
            && (1..=100).contains(&self.duty_percent)
    }

    /// Whether these limits of a profile allow those of a table: no looser, over the same window.
    pub const fn allows(&self, table: &Self) -> bool {
        table.max_on_ms <= self.max_on_ms
            && table.duty_percent <= self.duty_percent
            && table.window_ms == self.window_ms
    }
}

impl fmt::Display for CoilLimit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "on for {} ms, {} % of {} ms", self.max_on_ms, self.duty_percent, self.window_ms)
    }
}

/// One coil: its output, its lines and its limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Coil {
    /// Number of the board's output that feeds it.
    pub output: u8,
    /// How it uses its lines.
    pub drive: Drive,
    /// How long current may flow.
    pub limit: CoilLimit,
}

/// The switch that sees one actuator at its stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LimitSwitch {
    /// Input, the bit of [`crate::sequencer::Seen::switches`].
    pub input: u8,
    /// Digits in which the switch is closed: bit `d` for digit `d`.
    pub closed_in: u8,
}

impl LimitSwitch {
    /// Whether the switch is to be closed when its actuator rests in state `digit`.
    pub const fn closed(&self, digit: u8) -> bool {
        self.closed_in >> digit & 1 == 1
    }
}

/// One discrete actuator as the board sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ActuatorWiring {
    /// Number of states, 2 to 4.
    pub states: u8,
    /// Its limit switch, if it has one.
    pub switch: Option<LimitSwitch>,
    /// Longest time from the coil's change to the stop.
    pub travel_ms: u16,
}

impl ActuatorWiring {
    /// Number of coils: one for two states, two for more.
    pub const fn coils(&self) -> usize {
        if self.states > 2 { 2 } else { 1 }
    }
}

/// One servo joint on the bus, with the limits of its motion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ServoWiring {
    /// Address on the bus.
    pub id: u8,
    /// Smallest joint angle.
    pub min_rad: f32,
    /// Largest joint angle.
    pub max_rad: f32,
    /// Largest speed, also that of the first move after power-on.
    pub max_speed_rad_s: f32,
    /// Largest torque as a share of the servo's own, 0 to 1.
    pub max_torque: f32,
    /// No answer for so long is a fault.
    pub timeout_ms: u16,
}

impl ServoWiring {
    /// Largest angle of a servo's shaft, either way.
    pub const MAX_RAD: f32 = 3.2;
    /// Smallest speed: one step of 1/4096 turn in a second, the smallest that a servo can be given.
    pub const MIN_SPEED_RAD_S: f32 = core::f32::consts::TAU / 4096.0;
    /// Largest speed.
    pub const MAX_SPEED_RAD_S: f32 = 50.0;
    /// Longest time without an answer.
    pub const MAX_TIMEOUT_MS: u16 = 5_000;
    /// Largest address of one servo; 254 speaks to all.
    pub const MAX_ID: u8 = 253;

    /// Whether address, range, speed, torque and time-out make sense.
    pub fn is_sound(&self) -> bool {
        self.id <= Self::MAX_ID
            && self.min_rad < self.max_rad
            && self.min_rad >= -Self::MAX_RAD
            && self.max_rad <= Self::MAX_RAD
            && self.max_speed_rad_s >= Self::MIN_SPEED_RAD_S
            && self.max_speed_rad_s <= Self::MAX_SPEED_RAD_S
            && self.max_torque > 0.0
            && self.max_torque <= 1.0
            && (1..=Self::MAX_TIMEOUT_MS).contains(&self.timeout_ms)
    }

    /// Whether these limits of a profile allow those of a table: the same servo, no faster, stronger or more patient.
    /// Ranges are compared when it moves, since a table's are those of the joint.
    pub fn allows(&self, table: &Self) -> bool {
        table.id == self.id
            && table.max_speed_rad_s <= self.max_speed_rad_s
            && table.max_torque <= self.max_torque
            && table.timeout_ms <= self.timeout_ms
    }
}

/// How many coils may go on within a window: what the supply can feed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SwitchLimit {
    /// Coils that may newly go on within the window, 1 to [`SwitchLimit::MAX_COILS`].
    pub new_coils: u8,
    /// Length of the window.
    pub window_ms: u16,
}

impl SwitchLimit {
    /// Most coils that a limit may allow in its window.
    pub const MAX_COILS: usize = 16;
    /// Longest window.
    pub const MAX_WINDOW_MS: u16 = 10_000;

    /// Refuses a limit that bounds nothing.
    pub fn check(&self) -> Result<(), WiringError> {
        let sound = (1..=Self::MAX_COILS).contains(&usize::from(self.new_coils))
            && (1..=Self::MAX_WINDOW_MS).contains(&self.window_ms);
        if sound { Ok(()) } else { Err(WiringError::SwitchLimit) }
    }

    /// Whether this limit of a profile allows that of a table: no more coils, in no shorter a window.
    pub const fn allows(&self, table: &Self) -> bool {
        table.new_coils <= self.new_coils && table.window_ms >= self.window_ms
    }
}

impl fmt::Display for SwitchLimit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "at most {} outputs on within {} ms", self.new_coils, self.window_ms)
    }
}

impl Default for SwitchLimit {
    fn default() -> Self {
        Self { new_coils: 6, window_ms: 10 }
    }
}

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

/// Why a wiring is refused.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum WiringError {
    /// More coils, actuators or servos than the board drives.
    TooMany,
    /// An actuator has fewer than 2 or more than 4 states.
    States {
        /// Which actuator.
        actuator: ActuatorId,
    },
    /// The coils do not match the actuators that stand before them.
    CoilCount {
        /// Which coil.
        coil: u8,
    },
    /// The line does not exist or another coil uses it.
    Line {
        /// Which line.
        line: u8,
    },
    /// The switch input does not exist or another actuator uses it.
    Input {
        /// Which input.
        input: u8,
    },
    /// A limit of an output is zero, beyond what the board can count, or shorter than its own pulse.
    CoilLimit {
        /// Which output.
        output: u8,
    },
    /// The output does not exist or another coil uses it.
    Output {
        /// Which output.
        output: u8,
    },
    /// The number of coils that may switch at once is 0 or above what the board counts.
    SwitchLimit,
    /// The servo's range, speed, torque or time-out makes no sense.
    Servo {
        /// Index of the servo.
        servo: u8,
    },
}

impl fmt::Display for WiringError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooMany => {
                write!(
                    f,
                    "at most {MAX_ACTUATORS} actuators, {MAX_COILS} coils and {MAX_SERVOS} servos fit on the board"
                )
            }
            Self::States { actuator } => write!(f, "actuator {} has not 2 to 4 states", actuator.0),
            Self::CoilCount { coil } => write!(f, "coil {coil} belongs to no actuator or an actuator lacks a coil"),
            Self::Line { line } => write!(f, "line {line} is used twice or is not one of 0 to {}", MAX_LINES - 1),
            Self::Input { input } => {
                write!(f, "switch input {input} is used twice or does not exist")
            }
            Self::CoilLimit { output } => write!(
                f,
                "output {output}: the window must be {} to {} ms, the on-time at most as long, duty 1 to 100 %, a pulse at \
                 most {} ms and the on-time, a peak at most {} ms",
                CoilLimit::MIN_WINDOW_MS,
                CoilLimit::MAX_WINDOW_MS,
                CoilLimit::MAX_PULSE_MS,
                CoilLimit::MAX_PEAK_MS
            ),
            Self::Output { output } => {
                write!(f, "output {output} is used twice or is not one of 0 to {}", MAX_COILS - 1)
            }
            Self::SwitchLimit => write!(
                f,
                "1 to {} coils may switch within a window of 1 to {} ms",
                SwitchLimit::MAX_COILS,
                SwitchLimit::MAX_WINDOW_MS
            ),
            Self::Servo { servo } => write!(
                f,
                "servo {servo}: address, range, speed, torque or time-out are out of bounds, or its address is used twice"
            ),
        }
    }
}

impl core::error::Error for WiringError {}

impl Wiring {
    /// Index of the first coil of an actuator.
    pub fn first_coil(&self, actuator: usize) -> usize {
        self.actuators.iter().take(actuator).map(ActuatorWiring::coils).sum()
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
    pub fn check(&self) -> Result<(), WiringError> {
        self.check_actuators()?;
        self.check_coils()?;
        check_servos(self.servos.iter())?;
        self.switch_limit.check()
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

/// When coils went on lately, and how many: the memory that the [`SwitchLimit`] needs.
#[derive(Clone, Debug, Default)]
pub struct SwitchClock {
    recent: heapless::Deque<(Micros, u8), { SwitchLimit::MAX_COILS }>,
}

impl SwitchClock {
    /// How many coils may go on at `now`.
    pub fn room(&mut self, now: Micros, limit: &SwitchLimit) -> u8 {
        let window = Micros::from_millis(u32::from(limit.window_ms));
        while self.recent.front().is_some_and(|&(then, _)| now - then >= window) {
            self.recent.pop_front();
        }
        self.recent.iter().fold(limit.new_coils, |room, &(_, coils)| room.saturating_sub(coils))
    }

    /// Notes that so many coils, no more than there was [`room`](Self::room) for, went on at `now`.
    pub fn note(&mut self, now: Micros, coils: u8) {
        if coils > 0 {
            // Each note takes room of at least one, so there are never more notes than a limit allows coils.
            let _ = self.recent.push_back((now, coils));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn so_many_coils_at_once_and_no_more() {
        let limit = SwitchLimit { new_coils: 2, window_ms: 10 };
        let mut clock = SwitchClock::default();
        clock.note(Micros(0), 1);
        assert_eq!(clock.room(Micros(9_999), &limit), 1);
        clock.note(Micros(9_999), 1);
        assert_eq!(clock.room(Micros(9_999), &limit), 0);
        assert_eq!(clock.room(Micros(10_000), &limit), 1);
    }
}
