//! Table files: the records of a table image, one after the other, as they travel and are stored.

use std::path::{Path, PathBuf};

use darm::client::TableImage;
use darm_core::table::{Checker, Record, TableError};
use darm_core::units::{DeviceId, Micros, ModelHash};

/// A table read from a file and checked against its own limits.
pub(crate) struct TableFile {
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
    /// Reads and checks; `device` is the board it is meant for, where that is known.
    pub(crate) fn read(path: &Path, device: Option<DeviceId>) -> Result<Self, TableFileError> {
        let bytes = std::fs::read(path).map_err(|source| TableFileError::Read { path: path.into(), source })?;
        let records = records(&bytes)
            .map_err(|offset| TableFileError::Bytes { path: path.into(), offset })
            .and_then(|records| check(path, records, device))?;
        let model = model(&records);
        let image = TableImage::new(&records, model)
            .map_err(|source| TableFileError::Refused { path: path.into(), source })?;
        Ok(Self { records, image })
    }

    /// Number of rows.
    pub(crate) fn rows(&self) -> usize {
        rows(&self.records)
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

fn check(path: &Path, records: Vec<Record>, device: Option<DeviceId>) -> Result<Vec<Record>, TableFileError> {
    let mut checker = Checker::default();
    for record in &records {
        checker
            .admit(record, device)
            .map_err(|source| TableFileError::Refused { path: path.into(), source })?;
    }
    match checker.is_complete() {
        true => Ok(records),
        false => Err(TableFileError::CutOff { path: path.into(), rows: rows(&records) }),
    }
}

fn rows(records: &[Record]) -> usize {
    records.iter().filter(|record| matches!(record, Record::Row(_))).count()
}

fn model(records: &[Record]) -> ModelHash {
    let model = |record: &Record| if let Record::Start { model, .. } = record { Some(*model) } else { None };
    records.iter().find_map(model).unwrap_or_default()
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
