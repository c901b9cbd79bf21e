//! The judges. They share no code with what they judge: plain integers, their own decoders.
//!
//! | judge | sees | module |
//! |-------|------|--------|
//! | pins | edges of the four chain pins, power | [`pins`] |
//! | pins | shafts, goals and torque of the servos, whatever the bus carries | [`servos`] |
//! | pins | valves by their lines, limit switches as the arm has them | [`switches`] |
//! | pins | the state of each actuator by its lines | [`valves`] |
//! | pins | the supply of the board, with lines and shafts | [`board_supply`] |
//! | pins | erasures and writes of the flash | [`wear`] |
//! | reports | what the host client reports, what flash holds, which lines pulsed | [`reports`] |
//! | reports | the button, and which profile the board says is in force | [`person`] |

pub mod board_supply;
pub mod chain;
pub mod person;
pub mod pins;
pub mod reports;
pub mod servos;
pub mod switches;
pub mod valves;
pub mod wear;

/// Limits of one output line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineCeiling {
    /// Longest time on without a pause, ms.
    pub max_on_ms: u32,
    /// Largest share of any window that the line may be on, percent.
    pub duty_percent: u8,
    /// Length of that window, ms.
    pub window_ms: u32,
    /// Lines of one load have the same number: the supply feeds them as one.
    pub load: u8,
    /// Length of the peak of full current that the line carries, ms; 0 where it carries none.
    pub peak_ms: u32,
}

/// Limits of one servo, in its own steps of 4096 a turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ServoCeiling {
    /// Address on the bus.
    pub id: u8,
    /// Smallest goal position.
    pub min_step: i16,
    /// Largest goal position.
    pub max_step: i16,
    /// Largest speed, steps/s.
    pub max_steps_s: u16,
    /// Largest torque, thousandths of what it has.
    pub max_torque: u16,
    /// A driven servo that has not answered for this time is a fault, ms.
    pub timeout_ms: u32,
    /// It has no torque in the safe state and after a start.
    pub is_released: bool,
}

impl ServoCeiling {
    /// How far a place is out of the range, steps; negative within it.
    fn beyond(&self, step: f32) -> f32 {
        (f32::from(self.min_step) - step).max(step - f32::from(self.max_step))
    }
}

/// The two lines of a latch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LatchCeiling {
    /// Line that sets it.
    pub set: u8,
    /// Line that resets it.
    pub reset: u8,
    /// Longest pulse of either, ms.
    pub pulse_ms: u32,
}

/// One actuator, with or without a limit switch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ValveCeiling {
    /// Its coils, as those of a [`SwitchCeiling`].
    pub coils: Vec<(u8, Option<u8>)>,
    /// Its digits, from 0.
    pub states: u8,
}

/// One actuator with a limit switch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SwitchCeiling {
    /// Its coils: the line that holds the coil, or sets the latch; the line that resets it, where it is a latch.
    pub coils: Vec<(u8, Option<u8>)>,
    /// Its digits, from 0.
    pub states: u8,
    /// Input of the switch.
    pub input: u8,
    /// Digits in which the switch is closed: bit `d` for digit `d`.
    pub closed_in: u8,
    /// The actuator arrives within this time, ms.
    pub travel_ms: u32,
}

/// What must never be exceeded, whatever anybody sends: the complete interface between the board's profile and the judges.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ceilings {
    /// Limits of each line; `None` where nothing is wired.
    pub lines: [Option<LineCeiling>; 64],
    /// Latches.
    pub latches: Vec<LatchCeiling>,
    /// Limits of the servos.
    pub servos: Vec<ServoCeiling>,
    /// Loads that may be newly switched on within the budget's window.
    pub new_loads: u8,
    /// The budget's window, ms.
    pub budget_ms: u32,
    /// While lines are driven the chain is latched at least so often, ms: a disturbed register does not stay wrong.
    pub refresh_ms: u32,
    /// Error of the board's clock: limits are kept on that clock. Parts per million, positive when fast.
    pub clock_ppm: i32,
}

impl Ceilings {
    /// True time that this number of microseconds of the board's clock lasts, ns.
    pub fn true_us_ns(&self, board_us: u64) -> u64 {
        let ns = u128::from(board_us) * 1_000 * 1_000_000 / (1_000_000 + i64::from(self.clock_ppm)) as u128;
        u64::try_from(ns).unwrap_or(u64::MAX)
    }

    /// True time that a span of the board's clock lasts, ns.
    pub fn true_ns(&self, board_ms: u64) -> u64 {
        self.true_us_ns(1_000 * board_ms)
    }
}

/// A broken rule.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation {
    /// Which judge: `pins` or `reports`.
    pub judge: &'static str,
    /// Name of the rule.
    pub rule: &'static str,
    /// True time, ms.
    pub at_ms: u64,
    /// What was seen and what is allowed.
    pub sentence: String,
}

/// The violations of one run: the first of each rule, and how many there were.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Verdict(Vec<(Violation, u32)>);

impl Verdict {
    /// Notes a violation.
    pub fn note(&mut self, judge: &'static str, rule: &'static str, at_ns: u64, sentence: impl FnOnce() -> String) {
        match self.0.iter_mut().find(|(first, _)| first.judge == judge && first.rule == rule) {
            Some((_, count)) => *count += 1,
            None => self.0.push((Violation { judge, rule, at_ms: at_ns / 1_000_000, sentence: sentence() }, 1)),
        }
    }

    /// The first violation of each rule with the number of all.
    pub fn firsts(&self) -> &[(Violation, u32)] {
        &self.0
    }

    /// Whether this rule was broken.
    pub fn has(&self, rule: &str) -> bool {
        self.0.iter().any(|(first, _)| first.rule == rule)
    }

    /// Adds those of another judge.
    pub fn extend(&mut self, other: Verdict) {
        self.0.extend(other.0);
    }
}
