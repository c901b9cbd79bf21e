//! A program for the board: what is wired, and the timed rows to run. Valid by construction.
//!
//! A table travels and is stored as a list of [`Record`]s, so that the board checks it while it arrives and never needs
//! room for two. The order is fixed: one `Start`, the coils, actuators and servos, where the board is to answer which
//! word is nearest to a pose the modules with their frames, the rows in order of time, one `End`.
#![cfg_attr(not(test), deny(clippy::indexing_slicing, clippy::arithmetic_side_effects, clippy::unwrap_used))]

mod checker;
mod error;
mod modules;
pub mod nearest_search;

use serde::{Deserialize, Serialize};

use crate::duty::DutyMeters;
use crate::nearest::Coordinates;
use crate::output::{ActuatorWiring, Coil, MAX_SERVOS, ServoWiring, SwitchLimit, Wiring};
use crate::profile::Profile;
use crate::units::{DeviceId, Digest, Micros, ModelHash, Word};
pub use checker::Checker;
use checker::{Stage, push};
pub use error::{RowError, TableError};

/// Rows that fit the board's memory.
pub const MAX_ROWS: usize = 1024;

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
        /// The profile of the board that they were computed for.
        profile: Digest,
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
        /// Pose of the module's top in its base; the mount is in the first module, the tool in the last.
        pose: Coordinates,
    },
}

impl Record {
    /// No record is longer than this in bytes.
    pub const MAX_BYTES: usize = 64;
}

/// What a table is checked against.
#[derive(Clone, Copy, Debug)]
pub struct Board<'p> {
    /// The device; a host that checks before it knows the device gives `None`.
    pub device: Option<DeviceId>,
    /// What is wired to it.
    pub profile: &'p Profile,
}

/// The wiring that records describe, not yet checked.
///
/// # Errors
///
/// [`TableError::Wiring`]: there are more coils, actuators or servos than the board drives.
pub fn wiring<'r>(records: impl IntoIterator<Item = &'r Record>) -> Result<Wiring, TableError> {
    let mut wiring = Wiring::default();
    for record in records {
        match record {
            Record::Start { switch_limit, .. } => wiring.switch_limit = *switch_limit,
            Record::Coil(coil) => push(&mut wiring.coils, *coil)?,
            Record::Actuator(actuator) => push(&mut wiring.actuators, *actuator)?,
            Record::Servo(servo) => push(&mut wiring.servos, *servo)?,
            Record::Row(_) | Record::End { .. } | Record::Module { .. } | Record::Frame { .. } => {}
        }
    }
    Ok(wiring)
}

/// The records of a table before those of its modules and rows, for a board that is wired so: the inverse of [`wiring`].
pub fn head(
    wiring: &Wiring,
    model: ModelHash,
    device: Option<DeviceId>,
    profile: Digest,
) -> impl Iterator<Item = Record> {
    core::iter::once(Record::Start { model, device, profile, switch_limit: wiring.switch_limit })
        .chain(wiring.coils.iter().copied().map(Record::Coil))
        .chain(wiring.actuators.iter().copied().map(Record::Actuator))
        .chain(wiring.servos.iter().copied().map(Record::Servo))
}

/// A complete table in memory.
#[derive(Clone, Debug, Default)]
pub struct Table {
    checker: Checker,
    rows: heapless::Vec<Row, MAX_ROWS>,
}

impl Table {
    /// Appends a record or says why not. A `Start` record empties the table first, so one place in memory serves all tables.
    ///
    /// After an error the table is empty.
    ///
    /// # Errors
    ///
    /// As [`Checker::admit`]; or [`TableError::TooManyRows`].
    pub fn push(&mut self, record: &Record, board: &Board<'_>) -> Result<(), TableError> {
        if matches!(record, Record::Start { .. }) {
            self.rows.clear();
        }
        let mut result = self.checker.admit(record, board);
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

    /// When the program ends; `None` while the table is not complete.
    pub fn end(&self) -> Option<Micros> {
        match self.checker.stage {
            Stage::Ended { at } => Some(at),
            Stage::Empty | Stage::Wiring | Stage::Modules(_) | Stage::Rows => None,
        }
    }

    /// Takes over what the outputs have already been on, for a [rehearsal](Self::rehearse). No more than a copy: the
    /// control tick does it.
    pub fn recall(&mut self, used: &DutyMeters) {
        self.checker.meters = used.meters;
    }

    /// Lets the limits of all outputs judge these rows, after what was [recalled](Self::recall), and the end where `rows`
    /// reaches it. The first rows come first. Nothing is driven.
    ///
    /// # Errors
    ///
    /// [`TableError::Row`]: a row, or the end, would break a limit of an output.
    pub fn rehearse(&mut self, rows: core::ops::Range<usize>) -> Result<(), TableError> {
        if rows.start == 0 {
            self.checker.rewind();
            let numbered = (0u32..).zip(&self.checker.meters);
            self.checker.used = numbered.fold(0, |used, (output, meter)| used | u64::from(!meter.is_empty()) << output);
        }
        let last = rows.end;
        for number in rows {
            let Some(row) = self.rows.get(number) else { break };
            self.checker.pass_row(row).map_err(|error| TableError::Row { row: number as u16, error })?;
        }
        match self.end() {
            Some(end) if last >= self.rows.len() => {
                let row = self.rows.len() as u16;
                self.checker.pass_until(end).map_err(|error| TableError::Row { row, error })
            }
            _ => Ok(()),
        }
    }

    /// Smallest and largest angle of a servo joint in all rows; nothing without rows.
    pub fn servo_span_rad(&self, servo: usize) -> Option<(f32, f32)> {
        self.checker.servo_span_rad.get(servo).copied().filter(|(low, high)| low <= high)
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
