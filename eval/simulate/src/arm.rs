//! An arm for one seed as plain numbers, and what is made of it: the judge's ceilings, the board's records, tables.

use std::ops::Range;

use darm_arm::board_profile::BoardProfile;
use darm_arm::image::UploadImage;
use darm_core::output::{
    ActuatorWiring, Coil, CoilLimit, Drive, LimitSwitch, MAX_COILS, ServoWiring, SwitchLimit, Wiring,
};
use darm_core::profile::{EmergencyStop, Fallback, MAX_CHIPS, Profile};
use darm_core::table::{Board, Checker, Record, Row, head};
use darm_core::units::{DeviceId, Digest, Micros, ModelHash, Word};
use rand::RngExt as _;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;

use crate::judge::reports::KnownTable;
use crate::judge::servos::MAX_BEND_STEPS;
use crate::judge::{Ceilings, LatchCeiling, LineCeiling, ServoCeiling, SwitchCeiling, ValveCeiling};

/// Input of the emergency stop; no actuator's switch is there.
pub const EMERGENCY_STOP: u8 = 12;
/// All inputs at which an actuator's switch may be.
pub const ALL_SWITCHES: u32 = (1 << EMERGENCY_STOP) - 1;
/// The last row of a table that ends while its servos are on their way comes this time after the one before, ms, and sends
/// them as far as this share of their speed reaches. The end comes right behind it.
const LAST_MS: u32 = 350;
const LAST_SHARE: f32 = 0.9;
const LAST_END_MS: u32 = 2;
/// The board promises to shift unchanged lines again so often, ms.
const REFRESH_MS: u32 = 100;
/// From one pulse that a stop ends to the next, ms.
const MIN_PERIOD_MS: u32 = 5;
const MAX_PERIOD_MS: u32 = 12;
/// Where the window of the supply is longer, a coil may not switch each 40 ms, ms.
const MAX_TOGGLED_MS: u16 = 40;
/// The longest time of a coil in a script, ns.
const LONGEST_ON_NS: u64 = 3_000_000_000;

/// How a coil uses its lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DrivePlan {
    /// One line, high while the coil is on.
    Hold(u8),
    /// Pull and hold line, and the time of the full current, ms.
    PeakHold(u8, u8, u16),
    /// Set and reset line, and the pulse, ms.
    Latch(u8, u8, u16),
}

/// One coil with the limits that must hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CoilPlan {
    /// Its lines.
    pub drive: DrivePlan,
    /// Longest time on, ms.
    pub max_on_ms: u32,
    /// Largest share of the window, percent.
    pub duty_percent: u8,
    /// The window, ms.
    pub window_ms: u32,
}

/// One discrete actuator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ActuatorPlan {
    /// Number of states, 2 to 4.
    pub states: u8,
    /// Input of its switch and the digits in which it is closed.
    pub switch: Option<(u8, u8)>,
    /// Longest time to the stop, ms.
    pub travel_ms: u16,
}

impl ActuatorPlan {
    /// How many coils drive it.
    fn n_coils(&self) -> usize {
        if self.states > 2 { 2 } else { 1 }
    }
}

/// One servo joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServoPlan {
    /// Address.
    pub id: u8,
    /// Range on both sides of the middle, rad.
    pub range_rad: f32,
    /// Largest speed, rad/s.
    pub max_speed_rad_s: f32,
    /// Largest torque, share of what it has.
    pub max_torque: f32,
    /// Time-out, ms.
    pub timeout_ms: u16,
    /// It has no torque in the safe state and after a start.
    pub is_released: bool,
    /// Where it rests beside its goal, steps.
    pub bend_steps: f32,
}

/// An arm.
#[derive(Clone, Debug, PartialEq)]
pub struct ArmPlan {
    /// Coils along the actuators.
    pub coils: Vec<CoilPlan>,
    /// Actuators along the chain.
    pub actuators: Vec<ActuatorPlan>,
    /// Servo joints.
    pub servos: Vec<ServoPlan>,
    /// Loads that may be newly switched on within the window.
    pub new_loads: u8,
    /// The window, ms.
    pub budget_ms: u16,
    /// The contact of the emergency stop opens when it is pressed.
    pub stop_opens: bool,
    /// Below this supply of the board the safe state is latched, mV.
    pub min_supply_mv: Option<u16>,
    /// Share of the longest time to the stop that the actuators need.
    pub travel_share: f64,
}

impl ArmPlan {
    /// Draws an arm: one to eight actuators on lines anywhere in the chain, up to two servos.
    pub fn draw(rng: &mut ChaCha8Rng) -> Self {
        // Half of the arms need only the first chips.
        let top: u8 = if rng.random_bool(0.5) { 24 } else { 64 };
        let mut lines: Vec<u8> = (0..top).collect();
        lines.shuffle(rng);
        let (coils, actuators, servos) = (Vec::new(), Vec::new(), Vec::new());
        let mut arm = Self {
            coils,
            actuators,
            servos,
            new_loads: 0,
            budget_ms: 0,
            stop_opens: false,
            min_supply_mv: None,
            travel_share: 0.0,
        };
        let mut inputs: Vec<u8> = (0..EMERGENCY_STOP).collect();
        inputs.shuffle(rng);
        for &input in inputs.iter().take(rng.random_range(1..=8)) {
            let states = *[2, 2, 2, 3, 4].get(rng.random_range(0..5usize)).unwrap_or(&2);
            let kind = rng.random_range(0..4u8);
            for _ in 0..if states > 2 { 2 } else { 1 } {
                arm.coils.extend(draw_coil(rng, kind, &mut lines));
            }
            let switch = rng.random_bool(0.6).then(|| (input, rng.random_range(1..(1 << states) - 1)));
            arm.actuators.push(ActuatorPlan { states, switch, travel_ms: rng.random_range(40..120) });
        }
        for index in 0..rng.random_range(0..=2u8) {
            let (range_rad, max_speed_rad_s) = (rng.random_range(0.5..1.5), rng.random_range(1.0..3.0));
            arm.servos.push(ServoPlan {
                id: 1 + 3 * index,
                range_rad,
                max_speed_rad_s,
                max_torque: 0.01 * f32::from(rng.random_range(20..=95u8)),
                timeout_ms: rng.random_range(100..300),
                is_released: rng.random_ratio(1, 3),
                bend_steps: rng.random_range(-MAX_BEND_STEPS..=MAX_BEND_STEPS),
            });
        }
        arm.travel_share = rng.random_range(0.2..0.9);
        arm.new_loads = rng.random_range(2..=6);
        // A board keeps its supply over resets; only a window that is longer than a start shows that.
        arm.budget_ms = match rng.random_range(0..8u8) {
            0 => rng.random_range(1_000..=10_000),
            1 => rng.random_range(40..1_000),
            _ => rng.random_range(10..40),
        };
        arm
    }

    /// What the judge holds the board to.
    pub fn ceilings(&self, clock_ppm: i32) -> Ceilings {
        let mut lines = [None; 64];
        for (load, coil) in (0..).zip(&self.coils) {
            let CoilPlan { max_on_ms, duty_percent, window_ms, .. } = *coil;
            let (first, second, peak_ms) = match coil.drive {
                DrivePlan::Hold(line) => (line, line, 0),
                DrivePlan::PeakHold(pull, hold, peak_ms) => (pull, hold, peak_ms),
                DrivePlan::Latch(set, reset, _) => (set, reset, 0),
            };
            for (line, peak_ms) in [(second, 0), (first, u32::from(peak_ms))] {
                lines[usize::from(line)] = Some(LineCeiling { max_on_ms, duty_percent, window_ms, load, peak_ms });
            }
        }
        let servos = self.servos.iter().map(servo_ceiling).collect();
        let latches = self.coils.iter().filter_map(|coil| match coil.drive {
            DrivePlan::Latch(set, reset, pulse_ms) => Some(LatchCeiling { set, reset, pulse_ms: pulse_ms.into() }),
            DrivePlan::Hold(_) | DrivePlan::PeakHold(..) => None,
        });
        let (latches, new_loads, budget_ms) = (latches.collect(), self.new_loads, self.budget_ms.into());
        Ceilings { lines, latches, servos, new_loads, budget_ms, refresh_ms: REFRESH_MS, clock_ppm }
    }

    /// For this time after a command its loads may still take the supply, ns: those of a word wait for each other, and a latch is reset at
    /// the end of its time.
    pub fn supplied_ns(&self) -> u64 {
        LONGEST_ON_NS + u64::from(self.budget_ms) * self.coils.len() as u64 * 1_000_000
    }

    /// The limit switches, for the judge.
    pub fn switches(&self) -> Vec<SwitchCeiling> {
        let own = |(actuator, ValveCeiling { coils, states }): (&ActuatorPlan, ValveCeiling)| {
            let (input, closed_in) = actuator.switch?;
            Some(SwitchCeiling { coils, states, input, closed_in, travel_ms: actuator.travel_ms.into() })
        };
        self.actuators.iter().zip(self.valves()).filter_map(own).collect()
    }

    /// The actuators by their lines, for the judge.
    pub fn valves(&self) -> Vec<ValveCeiling> {
        let line = |coil: &CoilPlan| match coil.drive {
            DrivePlan::Hold(line) | DrivePlan::PeakHold(_, line, _) => (line, None),
            DrivePlan::Latch(set, reset, _) => (set, Some(reset)),
        };
        let own = |(actuator, own): (&ActuatorPlan, Range<usize>)| ValveCeiling {
            coils: self.coils.iter().skip(own.start).take(own.len()).map(line).collect(),
            states: actuator.states,
        };
        self.actuators.iter().zip(self.coil_ranges()).map(own).collect()
    }

    /// The coils of each actuator.
    fn coil_ranges(&self) -> impl Iterator<Item = Range<usize>> {
        self.actuators.iter().scan(0, |next, actuator| {
            let own = *next..*next + actuator.n_coils();
            *next = own.end;
            Some(own)
        })
    }

    /// A coil that stays on while it is commanded, and one of another actuator that may switch often meanwhile.
    pub fn steady_and_toggled(&self) -> Option<(u8, u8)> {
        let steady = self.steady_coil()?;
        let is_own = |coils: &Range<usize>| coils.contains(&usize::from(steady));
        let own = self.coil_ranges().find(is_own)?;
        let holds = |coil: usize| self.coils.get(coil).is_some_and(|coil| matches!(coil.drive, DrivePlan::Hold(_)));
        let toggled = (0..self.coils.len()).find(|coil| !own.contains(coil) && holds(*coil))?;
        (self.budget_ms <= MAX_TOGGLED_MS).then_some((steady, toggled as u8))
    }

    /// A coil that the supply feeds often enough to use it up by pulses that a stop ends: the one with the smallest share of its window, and
    /// the time from one pulse to the next, ms.
    pub fn often(&self) -> Option<(u8, u32)> {
        let period_ms = (u32::from(self.budget_ms) + 2).div_ceil(u32::from(self.new_loads).max(1)).max(MIN_PERIOD_MS);
        let has_no_peak = |(_, coil): &(u8, &CoilPlan)| !matches!(coil.drive, DrivePlan::PeakHold(..));
        let coils = (0u8..).zip(&self.coils).filter(has_no_peak);
        let (coil, plan) = coils.min_by_key(|(_, coil)| coil.duty_percent)?;
        // Off for two ticks in each.
        let is_enough = 100 * (period_ms - 2) > u32::from(plan.duty_percent) * period_ms;
        (is_enough && period_ms <= MAX_PERIOD_MS).then_some((coil, period_ms))
    }

    /// One of the actuators whose coils may not be on together: its index, its first coil, and whether that is a latch.
    pub fn three_states(&self, seed: u64) -> Option<(usize, u8, bool)> {
        let own = self.actuators.iter().zip(self.coil_ranges()).enumerate().filter(|(_, (own, _))| own.states == 3);
        let own: Vec<_> = own.map(|(index, (_, coils))| (index, coils.start)).collect();
        let (index, first) = own.get(seed as usize % own.len().max(1)).copied()?;
        let is_latch = self.coils.get(first).is_some_and(|coil| matches!(coil.drive, DrivePlan::Latch(..)));
        Some((index, first as u8, is_latch))
    }

    /// The same arm as the board's own wiring.
    pub fn wiring(&self) -> Wiring {
        let switch_limit = SwitchLimit { new_coils: self.new_loads, window_ms: self.budget_ms };
        Wiring {
            coils: (0..).zip(&self.coils).map(|(output, coil)| wired_coil(output, coil)).collect(),
            actuators: self.actuators.iter().map(wired_actuator).collect(),
            servos: self.servos.iter().map(wired_servo).collect(),
            switch_limit,
        }
    }

    /// The profile that a person has written to the board: it allows just this arm.
    pub fn profile(&self) -> BoardProfile {
        let emergency_stop = Some(EmergencyStop { input: EMERGENCY_STOP, opens: self.stop_opens });
        let mut profile = Profile { emergency_stop, min_supply_mv: self.min_supply_mv, ..Profile::of(&self.wiring()) };
        for (servo, plan) in profile.servos.iter_mut().zip(&self.servos) {
            servo.fallback = if plan.is_released { Fallback::Release } else { Fallback::Hold };
        }
        BoardProfile::new("drawn", profile)
    }

    /// The same arm with its actuators in the opposite order: no output of the profile has the number that it had.
    pub fn reversed(&self) -> Self {
        let mut coils = self.coils.iter();
        let of_actuator = |actuator: &ActuatorPlan| coils.by_ref().take(actuator.n_coils()).copied().collect();
        let groups: Vec<Vec<CoilPlan>> = self.actuators.iter().map(of_actuator).collect();
        let actuators = self.actuators.iter().rev().copied().collect();
        Self { actuators, coils: groups.into_iter().rev().flatten().collect(), ..self.clone() }
    }

    /// A profile that feeds one load at once and allows half of the range of each servo: no table of the arm is for it. The limits of the
    /// outputs are the same, for the board takes one whose limits have changed for exhausted.
    pub fn tighter_profile(&self) -> BoardProfile {
        let mut tighter = Self { new_loads: 1, ..self.clone() };
        tighter.servos.iter_mut().for_each(|servo| servo.range_rad /= 2.0);
        tighter.profile()
    }

    /// The profile of the same arm that names the length of its chain.
    pub fn counted_profile(&self) -> BoardProfile {
        let mut profile = self.profile().profile;
        profile.board.chips = Some(MAX_CHIPS);
        BoardProfile::new("counted", profile)
    }

    /// A coil that stays on while it is commanded, where there is one.
    pub fn steady_coil(&self) -> Option<u8> {
        (0u8..).zip(&self.coils).find(|(_, coil)| !matches!(coil.drive, DrivePlan::Latch(..))).map(|(coil, _)| coil)
    }

    /// The same wiring with the actuators in the opposite order: a coil's index is not its output's number.
    pub fn reversed_wiring(&self) -> Wiring {
        let wiring = self.wiring();
        let coils_of = |actuator: usize| {
            let first = wiring.first_coil(actuator);
            wiring.coils.iter().skip(first).take(wiring.actuators[actuator].coils()).copied()
        };
        let coils = (0..wiring.actuators.len()).rev().flat_map(coils_of).collect();
        let actuators = wiring.actuators.iter().rev().copied().collect();
        Wiring { coils, actuators, ..wiring.clone() }
    }

    /// The same wiring with peaks half as long: the board's pauses between peaks must not depend on the table.
    pub fn hasty_wiring(&self) -> Wiring {
        let mut wiring = self.wiring();
        for coil in &mut wiring.coils {
            if let Drive::PeakHold { peak_ms, .. } = &mut coil.drive {
                *peak_ms /= 2;
            }
        }
        wiring
    }

    /// One of the latches, if there are any: its coil, and its pulse in ms.
    pub fn latch(&self, seed: u64) -> Option<(u8, u16)> {
        let latches: Vec<(u8, u16)> = (0u8..)
            .zip(&self.coils)
            .filter_map(|(coil, plan)| if let DrivePlan::Latch(.., ms) = plan.drive { Some((coil, ms)) } else { None })
            .collect();
        latches.get(seed as usize % latches.len().max(1)).copied()
    }

    /// An actuator with a limit switch and a latch, one of two coils where there is one: the input of its switch, and its coils.
    pub fn watched_latch(&self, seed: u64) -> Option<(u8, Range<u8>)> {
        let mut next = 0;
        let own = self.actuators.iter().filter_map(|actuator| {
            let coils = next..next + actuator.n_coils();
            next = coils.end;
            let (input, _) = actuator.switch?;
            let is_latch = |coil: &CoilPlan| matches!(coil.drive, DrivePlan::Latch(..));
            let has_latch = self.coils.get(coils.clone())?.iter().any(is_latch);
            has_latch.then_some((input, coils.start as u8..coils.end as u8))
        });
        let own: Vec<_> = own.collect();
        let of_two: Vec<_> = own.iter().filter(|(_, coils)| coils.len() == 2).cloned().collect();
        let drawn = if of_two.is_empty() { own } else { of_two };
        drawn.get(seed as usize % drawn.len().max(1)).cloned()
    }

    /// Whether a coil begins with full current.
    pub fn has_peak(&self, coil: u8) -> bool {
        self.coils.get(usize::from(coil)).is_some_and(|coil| matches!(coil.drive, DrivePlan::PeakHold(..)))
    }

    /// One of the coils with a peak where there are any, else one of all.
    pub fn peaking(&self, seed: u64) -> u8 {
        let count = self.coils.len() as u8;
        let peaking: Vec<u8> = (0..count).filter(|&coil| self.has_peak(coil)).collect();
        let picked = peaking.get(seed as usize % peaking.len().max(1)).copied();
        picked.unwrap_or((seed as usize % usize::from(count).max(1)) as u8)
    }

    /// The lines of a coil.
    pub fn coil_lines(&self, coil: u8) -> impl Iterator<Item = u8> + use<> {
        let drive = self.coils.get(usize::from(coil)).map(|coil| coil.drive);
        let lines = drive.map(|drive| match drive {
            DrivePlan::Hold(line) => [Some(line), None],
            DrivePlan::PeakHold(first, second, _) | DrivePlan::Latch(first, second, _) => [Some(first), Some(second)],
        });
        lines.into_iter().flatten().flatten()
    }

    /// The line that a short command of a coil switches on exactly once; `None` for a latch, which may be set already.
    pub fn pulsed_line(&self, coil: u8) -> Option<u8> {
        match self.coils.get(usize::from(coil))?.drive {
            DrivePlan::Hold(line) | DrivePlan::PeakHold(line, ..) => Some(line),
            DrivePlan::Latch(..) => None,
        }
    }
}

fn draw_coil(rng: &mut ChaCha8Rng, kind: u8, lines: &mut Vec<u8>) -> Option<CoilPlan> {
    let window_ms = rng.random_range(2_000..12_000);
    let (first, second) = (lines.pop()?, lines.pop()?);
    Some(match kind {
        0 | 1 => {
            let (max_on_ms, duty_percent) = (rng.random_range(800..3_000), rng.random_range(50..95));
            CoilPlan { drive: DrivePlan::Hold(first), max_on_ms, duty_percent, window_ms }
        }
        2 => {
            let drive = DrivePlan::PeakHold(first, second, rng.random_range(10..60));
            CoilPlan {
                drive,
                max_on_ms: rng.random_range(800..3_000),
                duty_percent: rng.random_range(50..95),
                window_ms,
            }
        }
        _ => {
            let drive = DrivePlan::Latch(first, second, rng.random_range(10..40));
            CoilPlan { drive, max_on_ms: rng.random_range(60..200), duty_percent: rng.random_range(20..50), window_ms }
        }
    })
}

fn servo_ceiling(servo: &ServoPlan) -> ServoCeiling {
    let per_rad = 4096.0 / std::f32::consts::TAU;
    let range = (servo.range_rad * per_rad) as i16 + 1;
    ServoCeiling {
        id: servo.id,
        min_step: 2048 - range,
        max_step: 2048 + range,
        max_steps_s: (servo.max_speed_rad_s * per_rad) as u16 + 1,
        max_torque: (servo.max_torque * 1000.0) as u16 + 1,
        timeout_ms: servo.timeout_ms.into(),
        is_released: servo.is_released,
    }
}

fn wired_coil(output: u8, coil: &CoilPlan) -> Coil {
    let drive = match coil.drive {
        DrivePlan::Hold(line) => Drive::Hold { line },
        DrivePlan::PeakHold(pull, hold, peak_ms) => Drive::PeakHold { pull, hold, peak_ms },
        DrivePlan::Latch(set, reset, pulse_ms) => Drive::Latch { set, reset, pulse_ms },
    };
    let CoilPlan { max_on_ms, duty_percent, window_ms, .. } = *coil;
    Coil { output, drive, limit: CoilLimit { max_on_ms, duty_percent, window_ms } }
}

fn wired_actuator(actuator: &ActuatorPlan) -> ActuatorWiring {
    let switch = actuator.switch.map(|(input, closed_in)| LimitSwitch { input, closed_in });
    ActuatorWiring { states: actuator.states, switch, travel_ms: actuator.travel_ms }
}

fn wired_servo(servo: &ServoPlan) -> ServoWiring {
    let ServoPlan { id, range_rad, max_speed_rad_s, max_torque, timeout_ms, .. } = *servo;
    ServoWiring { id, min_rad: -range_rad, max_rad: range_rad, max_speed_rad_s, max_torque, timeout_ms }
}

/// What a table that is drawn is for.
#[derive(Clone, Copy, Debug)]
pub struct TablePlan<'w> {
    /// The wiring that it names.
    pub wiring: &'w Wiring,
    /// Digest of the profile that it names.
    pub profile: Digest,
    /// Number that names it.
    pub model: u64,
    /// Its rows.
    pub rows: usize,
    /// It ends while its servos are on their way to one more row.
    pub ends_under_way: bool,
    /// The board that it is for; any where `None`.
    pub device: Option<DeviceId>,
}

/// A table with what the judges need to know of it.
#[derive(Clone, Debug)]
pub struct Table {
    /// As the host uploads it.
    pub image: UploadImage,
    /// Number that names it.
    pub model: u64,
    /// Words of the rows.
    pub words: Vec<String>,
    /// Servo angles that it asks for, with the index of the servo, rad.
    pub angles_rad: Vec<(u8, f32)>,
}

impl Table {
    /// A table that the board's own check accepts under a profile that allows the wiring; `None` when none
    /// was found.
    pub fn draw(rng: &mut ChaCha8Rng, plan: &TablePlan<'_>) -> Option<Self> {
        let TablePlan { wiring, profile, model, device, .. } = *plan;
        (0..24).find_map(|attempt| {
            let changes = 0.4 * 0.8f64.powi(attempt);
            let mut records = draw_records(rng, plan, changes);
            keep_pauses(wiring, &mut records);
            let mut checker = Checker::default();
            let allowing = Profile { digest: profile, ..Profile::of(wiring) };
            let board = Board { device, profile: &allowing };
            records.iter().try_for_each(|record| checker.admit(record, &board)).ok()?;
            Some(Self::of(&records, model))
        })
    }

    /// A table of these records, checked or not.
    pub fn of(records: &[Record], model: u64) -> Self {
        let rows = records.iter().filter_map(|record| if let Record::Row(row) = record { Some(row) } else { None });
        Self {
            image: UploadImage::table(records, ModelHash(model)),
            model,
            words: rows.clone().map(|row| row.word.to_string()).collect(),
            angles_rad: rows.flat_map(|row| (0..).zip(row.servos.iter().copied())).collect(),
        }
    }

    /// What the judge knows of it.
    pub fn known(&self) -> KnownTable {
        KnownTable { model: self.model, image: self.image.bytes().to_vec(), words: self.words.clone() }
    }
}

/// Records of the wiring and of rows in which each digit changes with probability `changes`.
///
/// # Panics
///
/// `changes` is not a probability from 0 to 1, or the range of a servo is empty.
pub fn draw_records(rng: &mut ChaCha8Rng, plan: &TablePlan<'_>, changes: f64) -> Vec<Record> {
    let TablePlan { wiring, profile, model, rows, ends_under_way, device } = *plan;
    let mut records: Vec<Record> = head(wiring, ModelHash(model), device, profile).collect();
    let longest_ms = wiring.actuators.iter().map(|actuator| actuator.travel_ms).max().unwrap_or(50);
    let mut digits: Vec<u8> = vec![0; wiring.actuators.len()];
    let mut angles: Vec<f32> = vec![0.0; wiring.servos.len()];
    let mut at_ms = 0;
    for _ in 0..rows {
        let span_ms = u32::from(longest_ms) + rng.random_range(20..200);
        for (digit, actuator) in digits.iter_mut().zip(&wiring.actuators) {
            if rng.random_bool(changes) {
                *digit = rng.random_range(0..actuator.states.clamp(1, 4));
            }
        }
        for (angle, servo) in angles.iter_mut().zip(&wiring.servos) {
            let step_rad = 0.4e-3 * servo.max_speed_rad_s * span_ms as f32;
            *angle = (*angle + rng.random_range(-1.0..1.0) * step_rad).clamp(servo.min_rad, servo.max_rad);
        }
        let word = Word::new(&digits).expect("at most four states of 48 actuators");
        let servos = angles.iter().copied().collect();
        records.push(Record::Row(Row { at: Micros::from_millis(at_ms), word, servos }));
        at_ms += span_ms;
    }
    if ends_under_way && !wiring.servos.is_empty() {
        for (angle, servo) in angles.iter_mut().zip(&wiring.servos) {
            let away_rad = LAST_SHARE * 1e-3 * servo.max_speed_rad_s * LAST_MS as f32;
            *angle = (*angle - away_rad.copysign(*angle)).clamp(servo.min_rad, servo.max_rad);
        }
        let word = Word::new(&digits).expect("at most four states of 48 actuators");
        at_ms += LAST_MS;
        records.push(Record::Row(Row { at: Micros::from_millis(at_ms), word, servos: angles.into_iter().collect() }));
        at_ms += LAST_END_MS;
    }
    records.push(Record::End { at: Micros::from_millis(at_ms) });
    records
}

/// Leaves an actuator as it is in a row that would begin a peak before the pause after the last one is over.
fn keep_pauses(wiring: &Wiring, records: &mut [Record]) {
    /// The first row may be late by so much.
    const LATE: Micros = Micros::from_millis(2);
    let mut last_peaks = [None::<Micros>; MAX_COILS];
    let mut before = Word::zeros(wiring.actuators.len() as u8).unwrap_or_default();
    for record in records {
        let Record::Row(row) = record else { continue };
        for (actuator, (_, coils)) in wiring.actuators_with_coils().enumerate() {
            let rising = row.word.digit(actuator) & !before.digit(actuator);
            let rising = coils.iter().enumerate().filter(|(bit, _)| rising >> bit & 1 == 1).map(|(_, coil)| coil);
            let is_too_soon = rising.clone().any(|coil| {
                let last = last_peaks[usize::from(coil.output)];
                last.is_some_and(|last| row.at < last + coil.drive.peak_pause() + LATE)
            });
            if is_too_soon {
                row.word = row.word.with_digit(actuator, before.digit(actuator));
            } else {
                rising.for_each(|coil| last_peaks[usize::from(coil.output)] = Some(row.at));
            }
        }
        before = row.word;
    }
}
