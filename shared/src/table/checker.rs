//! Checks the records of a table in their order, and lets the limits of all outputs judge its rows.

use super::error::{RowError, TableError};
use super::modules::Modules;
use super::{Board, Record, Row};
use crate::duty::{Breach, DutyMeter, LATENESS, MeterLimit, TICK, turn_ticks};
use crate::output::{Drive, MAX_ACTUATORS, MAX_COILS, MAX_SERVOS, SwitchClock, SwitchLimit, Wiring, WiringError};
use crate::profile::{Mismatch, Profile};
use crate::units::{ActuatorId, Digest, Micros, ModelHash, Word};

/// Checks records in their order: what [`Table::push`](super::Table::push) does without keeping the rows.
///
/// The board streams a table from flash through it before the table is committed.
#[derive(Clone, Debug)]
pub struct Checker {
    pub(super) stage: Stage,
    pub(super) wiring: Wiring,
    pub(super) model: ModelHash,
    profile: Digest,
    /// On-times of the outputs.
    pub(super) meters: [DutyMeter; MAX_COILS],
    /// Outputs that have been on before the first row: bit `o` for output `o`.
    pub(super) used: u64,
    /// Time until the pulse of a latch ends, or until a coil may have another peak, by index of the coil.
    time_left: [Micros; MAX_COILS],
    switched: SwitchClock,
    rows: u16,
    last: Option<Row>,
    /// Smallest and largest angle of each servo joint in the rows.
    pub(super) servo_span_rad: [(f32, f32); MAX_SERVOS],
    /// When each actuator switched last, in microseconds after the start.
    moved_us: [u64; MAX_ACTUATORS],
    /// An actuator rests at least this time, ms, whatever its time of travel: the meters of all outputs have their turn, and a row
    /// goes out behind a late one.
    rest_ms: u8,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    Empty,
    Wiring,
    Modules(Modules),
    Rows,
    Ended { at: Micros },
}

/// The span of no angle.
const NO_SPAN: (f32, f32) = (f32::INFINITY, f32::NEG_INFINITY);

impl Default for Checker {
    fn default() -> Self {
        Self {
            stage: Stage::Empty,
            wiring: Wiring::default(),
            model: ModelHash::default(),
            profile: Digest::default(),
            meters: [DutyMeter::default(); MAX_COILS],
            used: 0,
            time_left: [Micros(0); MAX_COILS],
            switched: SwitchClock::default(),
            rows: 0,
            last: None,
            servo_span_rad: [NO_SPAN; MAX_SERVOS],
            moved_us: [0; MAX_ACTUATORS],
            rest_ms: 0,
        }
    }
}

impl Checker {
    /// Accepts the next record or says why not; after an error nothing more is accepted than a new `Start`.
    ///
    /// # Errors
    ///
    /// The record may not come in this place, the board could not run the wiring safely, the table is of another device
    /// or asks for more than the profile of the board allows, the modules do not fit the actuators, or a row breaks a
    /// limit.
    pub fn admit(&mut self, record: &Record, board: &Board<'_>) -> Result<(), TableError> {
        let result = self.admit_in_order(record, board);
        if result.is_err() {
            self.stage = Stage::Empty;
        }
        result
    }

    fn admit_in_order(&mut self, record: &Record, board: &Board<'_>) -> Result<(), TableError> {
        match (self.stage, record) {
            (_, Record::Start { model, device, profile, switch_limit }) => {
                if device.is_some() && board.device.is_some() && *device != board.device {
                    return Err(TableError::OtherDevice);
                }
                self.begin(*model, *profile, *switch_limit);
                Ok(())
            }
            (Stage::Wiring, Record::Coil(coil)) => {
                board.profile.check_coil(coil).map_err(TableError::Profile)?;
                push(&mut self.wiring.coils, *coil)
            }
            (Stage::Wiring, Record::Actuator(actuator)) => push(&mut self.wiring.actuators, *actuator),
            (Stage::Wiring, Record::Servo(servo)) => push(&mut self.wiring.servos, *servo),
            (Stage::Wiring, Record::Row(_) | Record::End { .. } | Record::Module { .. }) => {
                self.check_wiring(board.profile)?;
                let modules = matches!(record, Record::Module { .. });
                self.stage = if modules { Stage::Modules(Modules::default()) } else { Stage::Rows };
                self.admit_in_order(record, board)
            }
            (Stage::Modules(modules), Record::Module { actuators, length_scale_m, behind }) => {
                self.stage = Stage::Modules(modules.next(*actuators, *length_scale_m, behind, &self.wiring)?);
                Ok(())
            }
            (Stage::Modules(modules), Record::Frame { digits, pose }) => {
                self.stage = Stage::Modules(modules.with_frame(*digits, pose, &self.wiring)?);
                Ok(())
            }
            (Stage::Modules(modules), Record::Row(_) | Record::End { .. }) => {
                modules.check(&self.wiring)?;
                self.stage = Stage::Rows;
                self.admit_in_order(record, board)
            }
            (Stage::Rows, Record::Row(row)) => {
                let number = self.rows;
                self.admit_row(row).map_err(|error| TableError::Row { row: number, error })
            }
            (Stage::Rows, Record::End { at }) => {
                let number = self.rows;
                self.admit_end(*at).map_err(|error| TableError::Row { row: number, error })
            }
            _ => Err(TableError::Order),
        }
    }

    /// What differs is named before digests are compared.
    fn check_wiring(&mut self, board: &Profile) -> Result<(), TableError> {
        let n_outputs = board.outputs.iter().rposition(Option::is_some).map_or(0, |last| last.saturating_add(1));
        self.rest_ms = turn_ticks(n_outputs).saturating_add((LATENESS.0 / TICK.0) as u32) as u8;
        self.wiring.check().map_err(TableError::Wiring)?;
        board.check_wiring(&self.wiring).map_err(TableError::Profile)?;
        if self.profile == board.digest {
            return Ok(());
        }
        let (table, profile) = (self.profile.short(), board.digest.short());
        Err(TableError::Profile(Mismatch::Digest { table, profile }))
    }

    /// Starts again in place: a fresh checker would need room on the stack of the board.
    fn begin(&mut self, model: ModelHash, profile: Digest, switch_limit: SwitchLimit) {
        self.stage = Stage::Wiring;
        self.wiring.coils.clear();
        self.wiring.actuators.clear();
        self.wiring.servos.clear();
        self.wiring.switch_limit = switch_limit;
        self.model = model;
        self.profile = profile;
        self.meters.fill(DutyMeter::default());
        self.used = 0;
        self.servo_span_rad = [NO_SPAN; MAX_SERVOS];
        self.rows = 0;
        self.rewind();
    }

    /// Back to the time before the first row.
    pub(super) fn rewind(&mut self) {
        self.switched = SwitchClock::default();
        self.last = None;
        self.time_left.fill(Micros(0));
        self.moved_us.fill(0);
    }

    fn admit_row(&mut self, row: &Row) -> Result<(), RowError> {
        // One row goes out in a tick.
        if self.last.as_ref().is_some_and(|last| row.at < last.at + TICK) {
            return Err(RowError::Time);
        }
        if !self.wiring.has_word(&row.word) {
            return Err(RowError::Word);
        }
        self.check_servos(row)?;
        self.pass_row(row)?;
        self.rows = self.rows.saturating_add(1);
        Ok(())
    }

    /// Lets time pass up to this row and switches as it says.
    pub(super) fn pass_row(&mut self, row: &Row) -> Result<(), RowError> {
        self.pass_until(row.at)?;
        self.switch_coils(row)?;
        self.last = Some(row.clone());
        Ok(())
    }

    fn admit_end(&mut self, at: Micros) -> Result<(), RowError> {
        if self.last.as_ref().is_some_and(|last| at <= last.at) {
            return Err(RowError::Time);
        }
        self.pass_until(at)?;
        self.stage = Stage::Ended { at };
        Ok(())
    }

    fn check_servos(&mut self, row: &Row) -> Result<(), RowError> {
        for (index, wiring) in self.wiring.servos.iter().enumerate() {
            let servo = index as u8;
            let angle = *row.servos.get(index).ok_or(RowError::Servo { servo })?;
            if !(wiring.min_rad..=wiring.max_rad).contains(&angle) {
                return Err(RowError::Servo { servo });
            }
            if let Some((min_rad, max_rad)) = self.servo_span_rad.get_mut(index) {
                *min_rad = min_rad.min(angle);
                *max_rad = max_rad.max(angle);
            }
            if let Some(last) = &self.last {
                let span_s = (row.at - last.at).0 as f32 * 1e-6;
                let turned_rad = (angle - last.servos.get(index).copied().unwrap_or(angle)).abs();
                if turned_rad > wiring.max_speed_rad_s * span_s {
                    return Err(RowError::ServoSpeed { servo });
                }
            }
        }
        if row.servos.len() > self.wiring.servos.len() {
            return Err(RowError::Servo { servo: self.wiring.servos.len() as u8 });
        }
        Ok(())
    }

    /// Lets the coils of the row before carry current until `at`.
    pub(super) fn pass_until(&mut self, at: Micros) -> Result<(), RowError> {
        let Some(last) = &self.last else {
            return Ok(());
        };
        let span = tick_of(at) - tick_of(last.at);
        let fed = self.wiring.coils_on(&last.word);
        for (index, (coil, time_left)) in self.wiring.coils.iter().zip(&mut self.time_left).enumerate() {
            let output = coil.output;
            let Some(meter) = self.meters.get_mut(usize::from(output)) else { continue };
            let (on, lateness) = match coil.drive {
                Drive::Latch { .. } => (span.min(*time_left), Micros(0)),
                Drive::Hold { .. } | Drive::PeakHold { .. } if fed >> index & 1 == 1 => (span, LATENESS),
                Drive::Hold { .. } | Drive::PeakHold { .. } => (Micros(0), LATENESS),
            };
            *time_left = *time_left - span;
            let limit = MeterLimit::of(&coil.limit).rehearsed(lateness, self.used >> output & 1 == 1);
            let off = span - on;
            let switched_on = if on > Micros(0) { meter.pass_on(on, &limit) } else { Ok(()) };
            let passed = if off > Micros(0) { switched_on.and(meter.pass(off, false, &limit)) } else { switched_on };
            passed.map_err(|breach| match breach {
                Breach::OnTooLong => RowError::OnTooLong { output },
                Breach::Duty => RowError::Duty { output },
            })?;
        }
        Ok(())
    }

    /// Counts the coils that this row newly feeds, the pulses of latches and the pauses between peaks, with room for a row
    /// that is late before one that is not. Before the first row the board sets each latch, in its own time.
    fn switch_coils(&mut self, row: &Row) -> Result<(), RowError> {
        let rest = Word::zeros(self.wiring.actuators.len() as u8).unwrap_or_default();
        let is_first = self.last.is_none();
        let before = self.last.as_ref().map_or(rest, |last| last.word);
        self.check_travel(row, &before)?;
        let (fed, feeding) = (self.wiring.coils_on(&before), self.wiring.coils_on(&row.word));
        let room = self.switched.room(row.at, &self.wiring.switch_limit);
        let mut newly_fed = 0u8;
        for (index, (coil, time_left)) in self.wiring.coils.iter().zip(&mut self.time_left).enumerate() {
            let (was, is) = (fed >> index & 1 == 1, feeding >> index & 1 == 1);
            match coil.drive {
                Drive::PeakHold { .. } if is && !was && *time_left > Micros(0) => {
                    return Err(RowError::Duty { output: coil.output });
                }
                Drive::Hold { .. } | Drive::PeakHold { .. } if is && !was => {
                    newly_fed = newly_fed.saturating_add(1);
                    *time_left = coil.drive.peak_pause() + LATENESS;
                    // A row goes out with the first tick that is not before it: the coil may be on for one more.
                    if let Some(meter) = self.meters.get_mut(usize::from(coil.output)) {
                        meter.charge(TICK);
                    }
                }
                Drive::Hold { .. } | Drive::PeakHold { .. } => {}
                Drive::Latch { .. } if is == was && !is_first => {}
                Drive::Latch { pulse_ms, .. } => {
                    newly_fed = newly_fed.saturating_add(u8::from(!is_first));
                    *time_left = Micros::from_millis(u32::from(pulse_ms)) + TICK;
                }
            }
        }
        if newly_fed > room {
            return Err(RowError::TooManyCoils);
        }
        self.switched.note(row.at, newly_fed);
        Ok(())
    }

    fn check_travel(&mut self, row: &Row, before: &Word) -> Result<(), RowError> {
        for (index, actuator) in self.wiring.actuators.iter().enumerate() {
            if row.word.digit(index) == before.digit(index) {
                continue;
            }
            let travel = Micros::from_millis(u32::from(actuator.travel_ms.max(self.rest_ms.into())));
            let Some(moved_us) = self.moved_us.get_mut(index) else { continue };
            if *moved_us > 0 && row.at < Micros(*moved_us) + travel {
                return Err(RowError::Travel { actuator: ActuatorId(index as u8) });
            }
            *moved_us = row.at.0.max(1);
        }
        Ok(())
    }

    /// True when the last record was an admitted `End`.
    pub fn is_complete(&self) -> bool {
        matches!(self.stage, Stage::Ended { .. })
    }
}

/// When something goes out that is due then.
fn tick_of(due: Micros) -> Micros {
    Micros(due.0.div_ceil(TICK.0).saturating_mul(TICK.0))
}

pub(super) fn push<T, const N: usize>(list: &mut heapless::Vec<T, N>, item: T) -> Result<(), TableError> {
    list.push(item).map_err(|_| TableError::Wiring(WiringError::TooMany))
}
