//! Table files: the records of a table image, one after the other, as they travel and are stored.

use std::path::{Path, PathBuf};

use darm::client::TableImage;
use darm_core::table::{Checker, Record, TableError};
use darm_core::units::{DeviceId, Micros, ModelHash};

/// A table read from a file and checked against its own limits.
pub(crate) struct TableFile {
    path: PathBuf,
    /// The board that it was made for, if for one.
    device: Option<DeviceId>,
    /// All records, in order.
    pub(crate) records: Vec<Record>,
    /// What travels.
    pub(crate) image: TableImage,
}

/// Why a file is no table.
#[derive(Debug, thiserror::Error)]
pub(crate) enum TableFileError {
    /// The file cannot be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// Bytes that are no record.
    #[error("{path}: the bytes from {offset} on are no table; tables are made by `darm table`")]
    Bytes {
        /// The file.
        path: PathBuf,
        /// Where the first bad record starts.
        offset: usize,
    },
    /// A record that breaks a limit.
    #[error("{path}: {source}; make the table again with `darm table`")]
    Refused {
        /// The file.
        path: PathBuf,
        /// Which limit.
        source: TableError,
    },
    /// The table binds to another board.
    #[error("{path} was made for the board {device}, this is {board}; make it again with `darm table --bind`")]
    OtherDevice {
        /// The file.
        path: PathBuf,
        /// The board it was made for.
        device: DeviceId,
        /// The board that is there.
        board: DeviceId,
    },
    /// The last record is missing.
    #[error("{path}: the table is cut off after {rows} rows; make it again with `darm table`")]
    CutOff {
        /// The file.
        path: PathBuf,
        /// Rows that are there.
        rows: usize,
    },
}

impl TableFile {
    /// Reads and checks against the limits that it carries.
    pub(crate) fn read(path: &Path) -> Result<Self, TableFileError> {
        let bytes = std::fs::read(path).map_err(|source| TableFileError::Read { path: path.into(), source })?;
        let records = records(&bytes)
            .map_err(|offset| TableFileError::Bytes { path: path.into(), offset })
            .and_then(|records| check(path, records))?;
        let (model, device) = start(&records);
        let image =
            TableImage::new(&records, model).map_err(|source| TableFileError::Refused { path: path.into(), source })?;
        Ok(Self { path: path.into(), device, records, image })
    }

    /// Refuses a board that the table was not made for.
    pub(crate) fn check_device(&self, board: DeviceId) -> Result<(), TableFileError> {
        match self.device {
            Some(device) if device != board => {
                Err(TableFileError::OtherDevice { path: self.path.clone(), device, board })
            }
            _ => Ok(()),
        }
    }

    /// How long the program lasts.
    pub(crate) fn end(&self) -> Micros {
        let end = |record: &Record| if let Record::End { at } = record { Some(*at) } else { None };
        self.records.iter().find_map(end).unwrap_or_default()
    }
}

fn records(bytes: &[u8]) -> Result<Vec<Record>, usize> {
    let (mut records, mut rest) = (Vec::new(), bytes);
    while !rest.is_empty() {
        let offset = bytes.len() - rest.len();
        let (record, after) = postcard::take_from_bytes(rest).map_err(|_| offset)?;
        records.push(record);
        rest = after;
    }
    Ok(records)
}

fn check(path: &Path, records: Vec<Record>) -> Result<Vec<Record>, TableFileError> {
    let mut checker = Checker::default();
    for record in &records {
        checker.admit(record, None).map_err(|source| TableFileError::Refused { path: path.into(), source })?;
    }
    match checker.is_complete() {
        true => Ok(records),
        false => Err(TableFileError::CutOff { path: path.into(), rows: rows(&records) }),
    }
}

fn rows(records: &[Record]) -> usize {
    records.iter().filter(|record| matches!(record, Record::Row(_))).count()
}

fn start(records: &[Record]) -> (ModelHash, Option<DeviceId>) {
    let start = |record: &Record| match record {
        Record::Start { model, device, .. } => Some((*model, *device)),
        _ => None,
    };
    records.iter().find_map(start).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::records;

    #[test]
    fn the_place_of_bad_bytes_is_told() {
        assert_eq!(records(&[]), Ok(vec![]));
        assert_eq!(records(&[0xff, 1]), Err(0));
    }
}
