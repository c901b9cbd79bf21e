//! Table files: a program for the board, as `darm table` writes it.
//!
//! | bytes       | holds                                                                        |
//! |-------------|------------------------------------------------------------------------------|
//! | 13          | `darm table 2`, line feed                                                    |
//! | 32          | SHA-256 of the image: what the board reports of the table that it holds      |
//! | the rest    | the image: the records, one after the other, as they travel and are stored   |
//! | 4, LE       | CRC-32 (ISO HDLC) of all bytes before it                                     |

mod error;

use std::path::{Path, PathBuf};

use darm_core::profile::Profile;
use darm_core::table::{Board, Checker, Record, wiring};
use darm_core::units::{DeviceId, Digest, Micros, ModelHash};
use darm_core::wire::frame::CRC;

use crate::image::UploadImage;
pub use error::TableFileError;

/// First bytes of a file of this version.
const HEAD: &[u8] = b"darm table 2\n";
/// First bytes of a file of any version.
pub const KIND: &[u8] = b"darm table ";
const DIGEST: usize = 32;
const CHECK: usize = 4;

/// The visit file of a table file: `a.darm` has `a.visits.csv`.
pub fn visits_file(table: &Path) -> PathBuf {
    table.with_extension("visits.csv")
}

/// Parses a digest in hexadecimal digits.
pub fn digest(text: &str) -> Option<Digest> {
    let figures: Vec<u32> = text.chars().map(|figure| figure.to_digit(16)).collect::<Option<_>>()?;
    let bytes: Vec<u8> =
        figures.chunks(2).map(|pair| pair.iter().fold(0, |byte, figure| byte << 4 | *figure as u8)).collect();
    let is_digest = figures.len() == 2 * DIGEST;
    is_digest.then(|| bytes.try_into().ok().map(Digest)).flatten()
}

/// The bytes of a table's file.
pub fn bytes(image: &UploadImage) -> Vec<u8> {
    let mut bytes = [HEAD, &image.image().digest.0, image.bytes()].concat();
    bytes.extend(CRC.checksum(&bytes).to_le_bytes());
    bytes
}

/// A table read from a file and checked against its own limits.
pub struct TableFile {
    path: PathBuf,
    /// The board that it is bound to.
    pub device: Option<DeviceId>,
    /// The board profile that it was made for.
    pub profile: Digest,
    /// All records, in order.
    pub records: Vec<Record>,
    /// Image to upload.
    pub image: UploadImage,
}

impl TableFile {
    /// Reads a table and checks it against the limits in it.
    ///
    /// # Errors
    ///
    /// The file cannot be read; or as [`parse`](Self::parse).
    pub fn read(path: &Path) -> Result<Self, TableFileError> {
        let bytes = std::fs::read(path).map_err(|source| TableFileError::Read { path: path.into(), source })?;
        Self::parse(path, &bytes)
    }

    /// The table in the bytes of a file, checked against the limits in it; `path` only serves messages.
    ///
    /// # Errors
    ///
    /// The bytes are not a complete table of this version, its checksum or digest differs, or a record breaks a limit.
    #[expect(clippy::missing_panics_doc, reason = "the checker refuses a table without a start")]
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self, TableFileError> {
        let (named, _) = unpack(bytes, path)?;
        let records = check(path, unchecked_records(path, bytes)?)?;
        let Start { model, device, profile } = start(&records).expect("the checker refuses a table without a start");
        let image = UploadImage::table(&records, model);
        let found = image.image().digest;
        if found != named {
            let (found, expected) = (found.short(), named.short());
            return Err(TableFileError::OtherRecords { path: path.into(), found, expected });
        }
        Ok(Self { path: path.into(), device, profile, records, image })
    }

    /// Digest, as the board reports it.
    pub fn digest(&self) -> Digest {
        self.image.image().digest
    }

    /// Rejects a board with another table or none.
    ///
    /// # Errors
    ///
    /// The board has no table, or one with another digest.
    pub fn check_loaded(&self, board: Option<Digest>) -> Result<(), TableFileError> {
        let path = self.path.clone();
        match board {
            None => Err(TableFileError::NotLoaded { path }),
            Some(board) if board != self.digest() => {
                Err(TableFileError::OtherTable { path, table: self.digest().short(), board: board.short() })
            }
            Some(_) => Ok(()),
        }
    }

    /// Rejects the visits of another table.
    ///
    /// # Errors
    ///
    /// The visits name another digest.
    pub fn check_visits(&self, visits: Digest) -> Result<(), TableFileError> {
        if visits == self.digest() {
            return Ok(());
        }
        let (path, table) = (self.path.clone(), self.digest().short());
        Err(TableFileError::OtherVisits { path, table, visits: visits.short() })
    }

    /// Rejects a board with another profile than the one that the table was made for.
    ///
    /// # Errors
    ///
    /// The profile of the board has another digest.
    pub fn check_profile(&self, board: Digest) -> Result<(), TableFileError> {
        if self.profile == board {
            return Ok(());
        }
        let (path, profile) = (self.path.clone(), self.profile.short());
        Err(TableFileError::OtherProfile { path, profile, board: board.short() })
    }

    /// Rejects a board that the table is not bound to.
    ///
    /// # Errors
    ///
    /// The table is bound to another device.
    pub fn check_device(&self, board: DeviceId) -> Result<(), TableFileError> {
        match self.device {
            Some(device) if device != board => {
                Err(TableFileError::OtherDevice { path: self.path.clone(), device, board })
            }
            _ => Ok(()),
        }
    }

    /// Duration of the program.
    #[expect(clippy::missing_panics_doc, reason = "the checker refuses a table without an end")]
    pub fn end(&self) -> Micros {
        let end = |record: &Record| if let Record::End { at } = record { Some(*at) } else { None };
        self.records.iter().find_map(end).expect("the checker refuses a table without an end")
    }
}

/// The records of a file whose checksum matches, not checked against any limit: to show what a refused table holds.
///
/// # Errors
///
/// The bytes are not a table of this version, the checksum differs, or bytes are no record.
pub fn unchecked_records(path: &Path, bytes: &[u8]) -> Result<Vec<Record>, TableFileError> {
    let (_, image) = unpack(bytes, path)?;
    let offset = |offset| TableFileError::Bytes { path: path.into(), offset: HEAD.len() + DIGEST + offset };
    records(image).map_err(offset)
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

/// The digest and the image in a file's bytes, if the checksum matches.
fn unpack<'b>(bytes: &'b [u8], path: &Path) -> Result<(Digest, &'b [u8]), TableFileError> {
    let no_table = || TableFileError::NoTable { path: path.into() };
    let (content, check) = bytes.split_last_chunk::<CHECK>().ok_or_else(no_table)?;
    let (digest, image) = content.strip_prefix(HEAD).and_then(<[u8]>::split_first_chunk).ok_or_else(no_table)?;
    let (found, expected) = (CRC.checksum(content), u32::from_le_bytes(*check));
    if found == expected {
        return Ok((Digest(*digest), image));
    }
    // A file that is cut off has records as far as it goes, the last one in pieces, and no checksum.
    match rows_until_cut(bytes.get(HEAD.len() + DIGEST..).unwrap_or_default()) {
        Some(rows) => Err(TableFileError::Truncated { path: path.into(), bytes: bytes.len(), rows }),
        None => Err(TableFileError::Damaged { path: path.into(), found, expected }),
    }
}

/// The rows of records of which the last ones are missing; `None` where an end record or bytes that are no record stand among
/// them.
fn rows_until_cut(bytes: &[u8]) -> Option<usize> {
    let (mut rows, mut rest) = (0, bytes);
    while !rest.is_empty() {
        match postcard::take_from_bytes(rest) {
            Ok((Record::End { .. }, _)) => return None,
            Ok((record, after)) => {
                rows += usize::from(matches!(record, Record::Row(_)));
                rest = after;
            }
            Err(postcard::Error::DeserializeUnexpectedEnd) => return Some(rows),
            Err(_) => return None,
        }
    }
    Some(rows)
}

fn check(path: &Path, records: Vec<Record>) -> Result<Vec<Record>, TableFileError> {
    let refused = |source| TableFileError::Refused { path: path.into(), source };
    let wiring = wiring(&records).map_err(refused)?;
    let digest = start(&records).map(|start| start.profile).unwrap_or_default();
    let profile = Profile { digest, ..Profile::of(&wiring) };
    let board = Board { device: None, profile: &profile };
    let mut checker = Checker::default();
    records.iter().try_for_each(|record| checker.admit(record, &board)).map_err(refused)?;
    match checker.is_complete() {
        true => Ok(records),
        false => Err(TableFileError::CutOff { path: path.into(), rows: rows(&records) }),
    }
}

fn rows(records: &[Record]) -> usize {
    records.iter().filter(|record| matches!(record, Record::Row(_))).count()
}

/// Contents of the first record.
struct Start {
    model: ModelHash,
    device: Option<DeviceId>,
    profile: Digest,
}

fn start(records: &[Record]) -> Option<Start> {
    let start = |record: &Record| match record {
        Record::Start { model, device, profile, .. } => {
            Some(Start { model: *model, device: *device, profile: *profile })
        }
        _ => None,
    };
    records.iter().find_map(start)
}

#[cfg(test)]
mod tests;
