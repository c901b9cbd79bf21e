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

use core::fmt;

use serde::{Deserialize, Serialize};

use crate::units::{ActuatorId, Micros, Word};

/// Lines of the output chain: eight 74HC595.
pub const MAX_LINES: usize = 64;
/// Coils that one board drives.
pub const MAX_COILS: usize = 48;
/// Discrete actuators of one arm.
pub const MAX_ACTUATORS: usize = 48;
/// Limit-switch inputs of the board.
pub const MAX_SWITCHES: usize = 32;
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
    /// The lines that this drive uses.
    pub const fn lines(&self) -> (u8, Option<u8>) {
        match *self {
            Self::Hold { line } => (line, None),
            Self::PeakHold { pull, hold, .. } => (pull, Some(hold)),
            Self::Latch { set, reset, .. } => (set, Some(reset)),
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

/// One coil: its lines and its limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Coil {
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
    /// A limit of a coil is zero, above 100 % or shorter than its own pulse.
    CoilLimit {
        /// Which coil.
        coil: u8,
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
            Self::CoilLimit { coil } => {
                write!(f, "the limits of coil {coil} are zero, above 100 % or shorter than its pulse")
            }
            Self::SwitchLimit => {
                write!(f, "the coils that may switch at once must be 1 to {}", SwitchLimit::MAX_COILS)
            }
            Self::Servo { servo } => write!(f, "range, speed, torque or time-out of servo {servo} make no sense"),
        }
    }
}

impl core::error::Error for WiringError {}

impl Wiring {
    /// Number of 74HC595 needed for the highest line in use, at least one.
    pub fn chips(&self) -> usize {
        let highest = self.coils.iter().map(|coil| {
            let (first, second) = coil.drive.lines();
            first.max(second.unwrap_or(0))
        });
        usize::from(highest.max().unwrap_or(0)) / 8 + 1
    }

    /// Index of the first coil of an actuator.
    pub fn first_coil(&self, actuator: usize) -> usize {
        self.actuators.iter().take(actuator).map(ActuatorWiring::coils).sum()
    }

    /// The coils that a word feeds: bit `c` for coil `c`.
    pub fn coils_on(&self, word: &Word) -> u64 {
        let mut fed = 0;
        let mut first = 0;
        for (index, actuator) in self.actuators.iter().enumerate() {
            fed |= u64::from(word.digit(index)) << first;
            first += actuator.coils();
        }
        fed
    }

    /// Refuses a wiring that the board could not run safely.
    pub fn check(&self) -> Result<(), WiringError> {
        self.check_actuators()?;
        self.check_coils()?;
        for (servo, wiring) in (0u8..).zip(&self.servos) {
            let range = wiring.min_rad < wiring.max_rad && wiring.min_rad >= -3.2 && wiring.max_rad <= 3.2;
            let motion = wiring.max_speed_rad_s > 0.0 && wiring.max_torque > 0.0 && wiring.max_torque <= 1.0;
            if !(range && motion && wiring.timeout_ms > 0) {
                return Err(WiringError::Servo { servo });
            }
        }
        let allowed = 1..=SwitchLimit::MAX_COILS;
        if allowed.contains(&usize::from(self.switch_limit.new_coils)) { Ok(()) } else { Err(WiringError::SwitchLimit) }
    }

    fn check_actuators(&self) -> Result<(), WiringError> {
        let mut inputs = 0u32;
        for (index, wiring) in (0u8..).zip(&self.actuators) {
            if !(2..=4).contains(&wiring.states) {
                return Err(WiringError::States { actuator: ActuatorId(index) });
            }
            if let Some(switch) = wiring.switch {
                let bit = 1u32.checked_shl(u32::from(switch.input)).unwrap_or(0);
                if bit == 0 || inputs & bit != 0 {
                    return Err(WiringError::Input { input: switch.input });
                }
                inputs |= bit;
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
        let mut lines = 0u64;
        for (index, coil) in (0u8..).zip(&self.coils) {
            let (first, second) = coil.drive.lines();
            for line in core::iter::once(first).chain(second) {
                let bit = 1u64.checked_shl(u32::from(line)).unwrap_or(0);
                if bit == 0 || lines & bit != 0 {
                    return Err(WiringError::Line { line });
                }
                lines |= bit;
            }
            let limit = coil.limit;
            let pulse_fits = match coil.drive {
                Drive::Latch { pulse_ms, .. } => pulse_ms > 0 && u32::from(pulse_ms) <= limit.max_on_ms,
                Drive::Hold { .. } | Drive::PeakHold { .. } => true,
            };
            let windows = DutyWindow::BUCKETS as u32..=DutyWindow::MAX_WINDOW_MS;
            let window = windows.contains(&limit.window_ms) && limit.max_on_ms > 0;
            if !(pulse_fits && window && (1..=100).contains(&limit.duty_percent)) {
                return Err(WiringError::CoilLimit { coil: index });
            }
        }
        Ok(())
    }
}

/// Which limit a coil would break.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum CoilBreach {
    /// On for longer than `max_on_ms` without a pause.
    OnTooLong,
    /// On for more than its share of the window.
    Duty,
}

/// How long current has flowed in one coil: the memory that its limits need.
///
/// The same arithmetic checks a table when it is loaded and the coil when it runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CoilClock {
    on_us: u64,
    duty: DutyWindow,
}

impl CoilClock {
    /// Lets `span` pass with the coil carrying current or not, and reports the first limit that it broke.
    pub fn pass(&mut self, span: Micros, on: bool, limit: &CoilLimit) -> Result<(), CoilBreach> {
        self.duty.pass(span, on, limit);
        if !on {
            self.on_us = 0;
            return Ok(());
        }
        self.on_us = self.on_us.saturating_add(span.0);
        if self.on_us > u64::from(limit.max_on_ms) * 1000 {
            return Err(CoilBreach::OnTooLong);
        }
        let allowed_us = u64::from(limit.window_ms) * 10 * u64::from(limit.duty_percent);
        if limit.duty_percent < 100 && u64::from(self.duty.on_us) > allowed_us { Err(CoilBreach::Duty) } else { Ok(()) }
    }
}

/// On-time over a sliding window, in equal buckets and the one that is being filled: it never counts too little, and
/// at most one bucket too much.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct DutyWindow {
    buckets_us: [u32; Self::BUCKETS + 1],
    current: u8,
    filled_us: u32,
    /// Sum of the buckets.
    on_us: u32,
}

impl DutyWindow {
    const BUCKETS: usize = 16;
    /// Longest window whose microseconds fit the counters.
    const MAX_WINDOW_MS: u32 = 3_600_000;

    fn pass(&mut self, span: Micros, on: bool, limit: &CoilLimit) {
        let bucket_us = (u64::from(limit.window_ms) * 125 / 2) as u32;
        if span.0 < u64::from(bucket_us.saturating_sub(self.filled_us)) {
            self.fill(span.0 as u32, on);
            return;
        }
        // Nothing older than one window and a bucket can matter.
        let mut left_us = span.0.min(u64::from(bucket_us) * (Self::BUCKETS as u64 + 2));
        while left_us > 0 {
            let step = left_us.min(u64::from(bucket_us.saturating_sub(self.filled_us))) as u32;
            self.fill(step, on);
            left_us -= u64::from(step);
            // A new table may have brought a shorter window than the bucket was begun for.
            if self.filled_us >= bucket_us {
                self.begin_bucket();
            }
        }
    }

    /// A span that ends in the current bucket.
    fn fill(&mut self, span_us: u32, on: bool) {
        if on {
            self.buckets_us[usize::from(self.current)] += span_us;
            self.on_us += span_us;
        }
        self.filled_us += span_us;
    }

    fn begin_bucket(&mut self) {
        self.current = (self.current + 1) % (Self::BUCKETS as u8 + 1);
        let oldest = &mut self.buckets_us[usize::from(self.current)];
        self.on_us -= *oldest;
        *oldest = 0;
        self.filled_us = 0;
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

    const LIMIT: CoilLimit = CoilLimit { max_on_ms: 100, duty_percent: 50, window_ms: 1600 };

    #[test]
    fn a_coil_may_be_on_for_its_longest_time_and_no_longer() {
        let mut clock = CoilClock::default();
        assert_eq!(clock.pass(Micros::from_millis(100), true, &LIMIT), Ok(()));
        assert_eq!(clock.pass(Micros(1), true, &LIMIT), Err(CoilBreach::OnTooLong));
        assert_eq!(clock.pass(Micros(1), false, &LIMIT), Ok(()));
        assert_eq!(clock.pass(Micros::from_millis(100), true, &LIMIT), Ok(()));
    }

    #[test]
    fn duty_counts_over_a_sliding_window() {
        let mut clock = CoilClock::default();
        // 60 ms on, 40 ms off is 60 % of the window: refused when the window is half full of current.
        let broke = (0..32).find(|_| {
            let on = clock.pass(Micros::from_millis(60), true, &LIMIT);
            clock.pass(Micros::from_millis(40), false, &LIMIT).unwrap();
            on == Err(CoilBreach::Duty)
        });
        assert_eq!(broke, Some(13), "13 × 60 ms fill half of 1.6 s");
        assert_eq!(clock.pass(Micros::from_millis(4000), false, &LIMIT), Ok(()));
        assert_eq!(clock.pass(Micros::from_millis(60), true, &LIMIT), Ok(()), "the window forgets");
    }

    #[test]
    fn one_long_span_equals_many_short_ones() {
        let (mut long, mut short) = (CoilClock::default(), CoilClock::default());
        for (millis, on) in [(37, true), (411, false), (90, true), (13, false), (5000, false), (77, true)] {
            let _ = long.pass(Micros::from_millis(millis), on, &LIMIT);
            (0..millis).for_each(|_| {
                let _ = short.pass(Micros::from_millis(1), on, &LIMIT);
            });
        }
        assert_eq!(long.duty.on_us, short.duty.on_us);
        assert_eq!(long.on_us, short.on_us);
    }

    #[test]
    fn a_shorter_window_forgets_what_the_longer_counted() {
        let mut clock = CoilClock::default();
        assert_eq!(clock.pass(Micros::from_millis(90), true, &LIMIT), Ok(()));
        let shorter = CoilLimit { window_ms: 160, ..LIMIT };
        assert_eq!(clock.pass(Micros::from_millis(1), true, &shorter), Err(CoilBreach::Duty));
        assert_eq!(clock.pass(Micros::from_millis(200), false, &shorter), Ok(()));
        assert_eq!(clock.pass(Micros::from_millis(50), true, &shorter), Ok(()));
    }

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
