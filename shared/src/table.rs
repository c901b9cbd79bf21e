//! A program for the board: what is wired, and the timed rows to run. Valid by construction.
//!
//! A table travels and is stored as a list of [`Record`]s, so that the board checks it while it arrives and never needs
//! room for two. The order is fixed: one `Start`, the coils, actuators and servos, where the board is to answer which
//! word is nearest to a pose the modules with their frames, the rows in order of time, one `End`.

mod modules;

use core::fmt;

use serde::{Deserialize, Serialize};

use crate::nearest::Coordinates;
use crate::output::{
    ActuatorWiring, Coil, CoilBreach, CoilClock, CoilLimit, Drive, MAX_ACTUATORS, MAX_COILS, MAX_SERVOS, ServoWiring,
    SwitchClock, SwitchLimit, Wiring, WiringError,
};
use crate::units::{ActuatorId, DeviceId, Micros, ModelHash, Word};
use modules::Modules;

/// Rows that fit the board's memory.
pub const MAX_ROWS: usize = 1024;

/// The board may switch a coil off so much later than its row says; longest on-times are checked with that in mind.
const LATENESS_MS: u32 = 2;

/// Joint angles of the servos along the chain, in radians.
pub type ServoAngles = heapless::Vec<f32, MAX_SERVOS>;

/// One row: at this time after the start the actuators take this word and the servos go to these angles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Time after the start of the program.
    pub at: Micros,
    /// Digits of all discrete actuators.
    pub word: Word,
    /// Angles of all servo joints.
    pub servos: ServoAngles,
}

/// One piece of a table as it travels and is stored.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Record {
    /// First record.
    Start {
        /// The model that the rows were computed with.
        model: ModelHash,
        /// The device that they were computed for; any device where `None`.
        device: Option<DeviceId>,
        /// What the supply can feed.
        switch_limit: SwitchLimit,
    },
    /// The next coil.
    Coil(Coil),
    /// The next actuator.
    Actuator(ActuatorWiring),
    /// The next servo joint.
    Servo(ServoWiring),
    /// The next row.
    Row(Row),
    /// Last record: the time at which the program ends and every coil goes off.
    End {
        /// Time after the start of the program.
        at: Micros,
    },
    /// The next module from the base on, for the search of [`crate::nearest`]; its frames follow.
    Module {
        /// How many actuators it has, 1 to 8.
        actuators: u8,
        /// One radian of orientation is held equal to so much, m.
        length_scale_m: f32,
        /// What the modules after it typically do.
        behind: Coordinates,
    },
    /// The next frame of the module, in the order of its digits.
    Frame {
        /// Two bits for each actuator of the module, the first in the lowest.
        digits: u16,
        /// Pose of the module's top in its base; the mount stands in the first module, the tool in the last.
        pose: Coordinates,
    },
}

impl Record {
    /// No record is longer than this in bytes.
    pub const MAX_BYTES: usize = 64;
}

/// Why a record is refused.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum TableError {
    /// The record stands where it cannot stand.
    Order,
    /// The bytes are no record.
    Malformed,
    /// The wiring cannot be run safely.
    Wiring(WiringError),
    /// The table was made for another device.
    OtherDevice,
    /// More rows than [`MAX_ROWS`].
    TooManyRows,
    /// Something is wrong with a row.
    Row {
        /// Index of the row; the number of rows for the end of the program.
        row: u16,
        /// What is wrong.
        error: RowError,
    },
    /// The modules do not have each actuator once, or a frame has digits that its module does not have, is out of
    /// order, or is no pose.
    Modules,
}

/// Why a row is refused.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum RowError {
    /// It is not later than the row before.
    Time,
    /// Its word has not one digit for each actuator, or a digit that the actuator does not have.
    Word,
    /// Not one angle for each servo joint, or an angle out of the joint's range.
    Servo {
        /// Index of the servo.
        servo: u8,
    },
    /// The servo would have to turn faster than it may.
    ServoSpeed {
        /// Index of the servo.
        servo: u8,
    },
    /// The coil would be on for longer than it may.
    CoilOnTooLong {
        /// Index of the coil.
        coil: u8,
    },
    /// The coil would be on for more than its share of the window.
    CoilDuty {
        /// Index of the coil.
        coil: u8,
    },
    /// The actuator would switch again before it can have reached its stop.
    Travel {
        /// Which actuator.
        actuator: ActuatorId,
    },
    /// More coils would go on at once than the supply can feed.
    TooManyCoils,
}

impl fmt::Display for TableError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Order => f.write_str("a record of the table stands where it cannot stand"),
            Self::Malformed => f.write_str("the bytes of the table are no record"),
            Self::Wiring(error) => error.fmt(f),
            Self::OtherDevice => f.write_str("the table was made for another device"),
            Self::TooManyRows => write!(f, "a table has at most {MAX_ROWS} rows"),
            Self::Row { row, error } => write!(f, "row {row}: {error}"),
            Self::Modules => f.write_str("the frames of the modules do not fit the actuators"),
        }
    }
}

impl fmt::Display for RowError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Time => f.write_str("it is not later than the row before"),
            Self::Word => f.write_str("the word does not fit the actuators"),
            Self::Servo { servo } => write!(f, "the angle of servo {servo} is missing or out of its range"),
            Self::ServoSpeed { servo } => {
                write!(f, "servo {servo} would have to turn faster than it may")
            }
            Self::CoilOnTooLong { coil } => {
                write!(f, "coil {coil} would be on for longer than it may")
            }
            Self::CoilDuty { coil } => write!(f, "coil {coil} would be on for more than its share of the window"),
            Self::Travel { actuator } => {
                write!(f, "actuator {} would switch again before it can have reached its stop", actuator.0)
            }
            Self::TooManyCoils => f.write_str("more coils would go on at once than the supply can feed"),
        }
    }
}

impl core::error::Error for TableError {}
impl core::error::Error for RowError {}

/// Checks records in their order: what [`Table::push`] does without keeping the rows.
///
/// The board streams a table from flash through it before the table is committed.
#[derive(Clone, Debug)]
pub struct Checker {
    stage: Stage,
    wiring: Wiring,
    model: ModelHash,
    clocks: [CoilClock; MAX_COILS],
    switched: SwitchClock,
    rows: u16,
    last: Option<Row>,
    /// When each actuator switched last, in microseconds after the start.
    moved_us: [u64; MAX_ACTUATORS],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Empty,
    Wiring,
    Modules(Modules),
    Rows,
    Ended { at: Micros },
}

impl Default for Checker {
    fn default() -> Self {
        Self {
            stage: Stage::Empty,
            wiring: Wiring::default(),
            model: ModelHash::default(),
            clocks: [CoilClock::default(); MAX_COILS],
            switched: SwitchClock::default(),
            rows: 0,
            last: None,
            moved_us: [0; MAX_ACTUATORS],
        }
    }
}

impl Checker {
    /// Accepts the next record or says why not; after an error nothing more is accepted than a new `Start`.
    ///
    /// `device` is the device that checks; a host that checks before it knows the device gives `None`.
    pub fn admit(&mut self, record: &Record, device: Option<DeviceId>) -> Result<(), TableError> {
        let result = self.admit_in_order(record, device);
        if result.is_err() {
            self.stage = Stage::Empty;
        }
        result
    }

    fn admit_in_order(&mut self, record: &Record, here: Option<DeviceId>) -> Result<(), TableError> {
        match (self.stage, record) {
            (_, Record::Start { model, device, switch_limit }) => {
                if device.is_some() && here.is_some() && *device != here {
                    return Err(TableError::OtherDevice);
                }
                self.begin(*model, *switch_limit);
                Ok(())
            }
            (Stage::Wiring, Record::Coil(coil)) => push(&mut self.wiring.coils, *coil),
            (Stage::Wiring, Record::Actuator(actuator)) => push(&mut self.wiring.actuators, *actuator),
            (Stage::Wiring, Record::Servo(servo)) => push(&mut self.wiring.servos, *servo),
            (Stage::Wiring, Record::Row(_) | Record::End { .. } | Record::Module { .. }) => {
                self.wiring.check().map_err(TableError::Wiring)?;
                let modules = matches!(record, Record::Module { .. });
                self.stage = if modules { Stage::Modules(Modules::default()) } else { Stage::Rows };
                self.admit_in_order(record, here)
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
                self.admit_in_order(record, here)
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

    /// Starts anew in place: a fresh checker would need room on the stack of the board.
    fn begin(&mut self, model: ModelHash, switch_limit: SwitchLimit) {
        self.stage = Stage::Wiring;
        self.wiring.coils.clear();
        self.wiring.actuators.clear();
        self.wiring.servos.clear();
        self.wiring.switch_limit = switch_limit;
        self.model = model;
        self.clocks.fill(CoilClock::default());
        self.switched = SwitchClock::default();
        self.rows = 0;
        self.last = None;
        self.moved_us.fill(0);
    }

    fn admit_row(&mut self, row: &Row) -> Result<(), RowError> {
        if self.last.as_ref().is_some_and(|last| row.at <= last.at) {
            return Err(RowError::Time);
        }
        check_word(&row.word, &self.wiring)?;
        self.check_servos(row)?;
        self.pass_until(row.at)?;
        self.switch_coils(row)?;
        self.last = Some(row.clone());
        self.rows += 1;
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

    fn check_servos(&self, row: &Row) -> Result<(), RowError> {
        for (index, wiring) in self.wiring.servos.iter().enumerate() {
            let servo = index as u8;
            let angle = *row.servos.get(index).ok_or(RowError::Servo { servo })?;
            if !(wiring.min_rad..=wiring.max_rad).contains(&angle) {
                return Err(RowError::Servo { servo });
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
    fn pass_until(&mut self, at: Micros) -> Result<(), RowError> {
        let Some(last) = &self.last else {
            return Ok(());
        };
        let span = at - last.at;
        let fed = self.wiring.coils_on(&last.word);
        for (index, coil) in self.wiring.coils.iter().enumerate() {
            let on = match coil.drive {
                Drive::Latch { .. } => false,
                Drive::Hold { .. } | Drive::PeakHold { .. } => fed >> index & 1 == 1,
            };
            let limit = CoilLimit { max_on_ms: coil.limit.max_on_ms.saturating_sub(LATENESS_MS), ..coil.limit };
            let passed = self.clocks[index].pass(span, on, &limit);
            passed.map_err(|breach| match breach {
                CoilBreach::OnTooLong => RowError::CoilOnTooLong { coil: index as u8 },
                CoilBreach::Duty => RowError::CoilDuty { coil: index as u8 },
            })?;
        }
        Ok(())
    }

    /// Counts the coils that this row newly feeds, and the pulses of latches. Before the first row the board sets each
    /// latch, in its own time.
    fn switch_coils(&mut self, row: &Row) -> Result<(), RowError> {
        let rest = Word::zeros(self.wiring.actuators.len() as u8).unwrap_or_default();
        let is_first = self.last.is_none();
        let before = self.last.as_ref().map_or(rest, |last| last.word);
        self.check_travel(row, &before)?;
        let (fed, feeding) = (self.wiring.coils_on(&before), self.wiring.coils_on(&row.word));
        let room = self.switched.room(row.at, &self.wiring.switch_limit);
        let mut newly_fed = 0;
        for (index, coil) in self.wiring.coils.iter().enumerate() {
            let (was, is) = (fed >> index & 1 == 1, feeding >> index & 1 == 1);
            match coil.drive {
                Drive::Hold { .. } | Drive::PeakHold { .. } => newly_fed += u8::from(is && !was),
                Drive::Latch { .. } if is == was && !is_first => {}
                Drive::Latch { pulse_ms, .. } => {
                    newly_fed += u8::from(!is_first);
                    let pulse = Micros::from_millis(u32::from(pulse_ms));
                    let passed = self.clocks[index].pass(pulse, true, &coil.limit);
                    passed.map_err(|_| RowError::CoilDuty { coil: index as u8 })?;
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
            let travel = Micros::from_millis(u32::from(actuator.travel_ms));
            let moved = self.moved_us[index];
            if moved > 0 && row.at < Micros(moved) + travel {
                return Err(RowError::Travel { actuator: ActuatorId(index as u8) });
            }
            self.moved_us[index] = row.at.0.max(1);
        }
        Ok(())
    }

    /// True when the last record was an admitted `End`.
    pub fn is_complete(&self) -> bool {
        matches!(self.stage, Stage::Ended { .. })
    }
}

fn push<T, const N: usize>(list: &mut heapless::Vec<T, N>, item: T) -> Result<(), TableError> {
    list.push(item).map_err(|_| TableError::Wiring(WiringError::TooMany))
}

fn check_word(word: &Word, wiring: &Wiring) -> Result<(), RowError> {
    let fits = word.len() == wiring.actuators.len()
        && word.is_canonical()
        && wiring.actuators.iter().zip(word.iter()).all(|(actuator, digit)| digit < actuator.states);
    if fits { Ok(()) } else { Err(RowError::Word) }
}

/// A whole table in memory.
#[derive(Clone, Debug, Default)]
pub struct Table {
    checker: Checker,
    rows: heapless::Vec<Row, MAX_ROWS>,
}

impl Table {
    /// Appends a record or says why not. A `Start` record empties the table first, so one place in memory serves all tables.
    ///
    /// After an error the table is empty.
    pub fn push(&mut self, record: &Record, device: Option<DeviceId>) -> Result<(), TableError> {
        if matches!(record, Record::Start { .. }) {
            self.rows.clear();
        }
        let mut result = self.checker.admit(record, device);
        if let (Ok(()), Record::Row(row)) = (&result, record) {
            result = self.rows.push(row.clone()).map_err(|_| TableError::TooManyRows);
        }
        if result.is_err() {
            self.clear();
        }
        result
    }

    /// Empties the table.
    pub fn clear(&mut self) {
        self.rows.clear();
        self.checker.stage = Stage::Empty;
    }

    /// When the program ends; `None` while the table is not whole.
    pub fn end(&self) -> Option<Micros> {
        match self.checker.stage {
            Stage::Ended { at } => Some(at),
            Stage::Empty | Stage::Wiring | Stage::Modules(_) | Stage::Rows => None,
        }
    }

    /// The rows in order of time.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// What is wired.
    pub fn wiring(&self) -> &Wiring {
        &self.checker.wiring
    }

    /// The model that the rows were computed with.
    pub fn model(&self) -> ModelHash {
        self.checker.model
    }
}

#[cfg(test)]
mod tests;
