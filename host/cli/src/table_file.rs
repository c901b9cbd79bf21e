//! Table files.
//!
//! | bytes       | holds                                                                        |
//! |-------------|------------------------------------------------------------------------------|
//! | 13          | `darm table 2`, line feed                                                    |
//! | 32          | SHA-256 of the image: what the board reports of the table that it holds      |
//! | the rest    | the image: the records, one after the other, as they travel and are stored   |
//! | 4, LE       | CRC-32 (ISO HDLC) of all bytes before it                                     |

use std::path::{Path, PathBuf};

use darm_arm::image::UploadImage;
use darm_core::profile::Profile;
use darm_core::table::{Board, Checker, Record, TableError, wiring};
use darm_core::units::{DeviceId, Digest, Micros, ModelHash, ShortDigest};
use darm_core::wire::frame::CRC;

/// First bytes of a file of this version.
const HEAD: &[u8] = b"darm table 2\n";
/// First bytes of a file of any version.
pub(crate) const KIND: &[u8] = b"darm table ";
const DIGEST: usize = 32;
const CHECK: usize = 4;

/// The visit file of a table file: `a.darm` has `a.visits.csv`.
pub(crate) fn visits_file(table: &Path) -> PathBuf {
    table.with_extension("visits.csv")
}

/// Parses a digest in hexadecimal digits.
pub(crate) fn digest(text: &str) -> Option<Digest> {
    let figures: Vec<u32> = text.chars().map(|figure| figure.to_digit(16)).collect::<Option<_>>()?;
    let bytes: Vec<u8> =
        figures.chunks(2).map(|pair| pair.iter().fold(0, |byte, figure| byte << 4 | *figure as u8)).collect();
    let is_digest = figures.len() == 2 * DIGEST;
    is_digest.then(|| bytes.try_into().ok().map(Digest)).flatten()
}

/// The bytes of a table's file.
pub(crate) fn bytes(image: &UploadImage) -> Vec<u8> {
    let mut bytes = [HEAD, &image.image().digest.0, image.bytes()].concat();
    bytes.extend(CRC.checksum(&bytes).to_le_bytes());
    bytes
}

/// A table read from a file and checked against its own limits.
pub(crate) struct TableFile {
    path: PathBuf,
    /// The board that it is bound to.
    pub(crate) device: Option<DeviceId>,
    /// The board profile that it was made for.
    pub(crate) profile: Digest,
    /// All records, in order.
    pub(crate) records: Vec<Record>,
    /// Image to upload.
    pub(crate) image: UploadImage,
}

/// Why a file is not a usable table.
#[derive(Debug, thiserror::Error)]
pub(crate) enum TableFileError {
    /// The file cannot be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// Another kind of file, or a table of an earlier version.
    #[error("{path} is not a table of this version; remake it with `darm table`")]
    NoTable {
        /// The file.
        path: PathBuf,
    },
    /// The checksum differs.
    #[error(
        "{path} is damaged: checksum {found:08x}, expected {expected:08x}; copy it again, or remake it with `darm table`"
    )]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The checksum of its bytes.
        found: u32,
        /// The checksum at its end.
        expected: u32,
    },
    /// The end of the file is missing.
    #[error(
        "{path} is truncated: its {bytes} bytes end after {rows} rows, before the end of the table; copy it again, or make it \
         again with `darm table`"
    )]
    Truncated {
        /// The file.
        path: PathBuf,
        /// Bytes that it has.
        bytes: usize,
        /// Complete rows among them.
        rows: usize,
    },
    /// Bytes that are not a record.
    #[error("{path}: the bytes from offset {offset} are not a record; remake the table with `darm table`")]
    Bytes {
        /// The file.
        path: PathBuf,
        /// Where the first bad record starts.
        offset: usize,
    },
    /// A record that exceeds a limit.
    #[error("{path}: {source}; remake the table with `darm table`")]
    Refused {
        /// The file.
        path: PathBuf,
        /// Which limit.
        source: TableError,
    },
    /// The digest at the beginning belongs to other records.
    #[error(
        "{path} is damaged: its records have digest {found}, its header says {expected}; remake it with `darm table`"
    )]
    OtherRecords {
        /// The file.
        path: PathBuf,
        /// The digest of its records.
        found: ShortDigest,
        /// The digest that it names.
        expected: ShortDigest,
    },
    /// The board has no table.
    #[error("the board has no table; run `darm upload {}`", .path.display())]
    NotLoaded {
        /// The file.
        path: PathBuf,
    },
    /// The board has another table.
    #[error("the board has table {board}, {} is {table}; run `darm upload {}`", .path.display(), .path.display())]
    OtherTable {
        /// The file.
        path: PathBuf,
        /// Its digest.
        table: ShortDigest,
        /// The digest of the board's table.
        board: ShortDigest,
    },
    /// The visit file was made with another table.
    #[error(
        "{} belongs to table {visits}, {} is {table}; remake both with `darm table`",
        visits_file(.path).display(),
        .path.display()
    )]
    OtherVisits {
        /// The table's file.
        path: PathBuf,
        /// The table's digest.
        table: ShortDigest,
        /// The digest in the visit file.
        visits: ShortDigest,
    },
    /// The table binds to another board.
    #[error("{path} is bound to board {device}, this is board {board}; remake it with `darm table --bind`")]
    OtherDevice {
        /// The file.
        path: PathBuf,
        /// The board it is bound to.
        device: DeviceId,
        /// The connected board.
        board: DeviceId,
    },
    /// The table was made for another profile of the board.
    #[error(
        "{path} was made for {}, this board has {}; write that profile with `darm profile write`, or remake the table with \
         `darm table --profile`",
        profile_name(.profile),
        profile_name(.board)
    )]
    OtherProfile {
        /// The file.
        path: PathBuf,
        /// The profile it was made for.
        profile: ShortDigest,
        /// The profile of the board.
        board: ShortDigest,
    },
    /// The last record is missing.
    #[error("{path}: the table ends after {rows} rows without an end record; remake it with `darm table`")]
    CutOff {
        /// The file.
        path: PathBuf,
        /// Rows before the end.
        rows: usize,
    },
}

/// The digest of a profile; that of a board without one is zero.
fn profile_name(profile: &ShortDigest) -> String {
    match *profile == Digest::default().short() {
        true => "no profile (built-in limits)".to_owned(),
        false => format!("board profile {profile}"),
    }
}

impl TableFile {
    /// Reads a table and checks it against the limits in it.
    pub(crate) fn read(path: &Path) -> Result<Self, TableFileError> {
        let bytes = std::fs::read(path).map_err(|source| TableFileError::Read { path: path.into(), source })?;
        Self::parse(path, &bytes)
    }

    fn parse(path: &Path, bytes: &[u8]) -> Result<Self, TableFileError> {
        let (named, image) = unpack(bytes, path)?;
        let records = records(image)
            .map_err(|offset| TableFileError::Bytes { path: path.into(), offset: HEAD.len() + DIGEST + offset })
            .and_then(|records| check(path, records))?;
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
    pub(crate) fn digest(&self) -> Digest {
        self.image.image().digest
    }

    /// Rejects a board with another table or none.
    pub(crate) fn check_loaded(&self, board: Option<Digest>) -> Result<(), TableFileError> {
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
    pub(crate) fn check_visits(&self, visits: Digest) -> Result<(), TableFileError> {
        if visits == self.digest() {
            return Ok(());
        }
        let (path, table) = (self.path.clone(), self.digest().short());
        Err(TableFileError::OtherVisits { path, table, visits: visits.short() })
    }

    /// Rejects a board with another profile than the one that the table was made for.
    pub(crate) fn check_profile(&self, board: Digest) -> Result<(), TableFileError> {
        if self.profile == board {
            return Ok(());
        }
        let (path, profile) = (self.path.clone(), self.profile.short());
        Err(TableFileError::OtherProfile { path, profile, board: board.short() })
    }

    /// Rejects a board that the table is not bound to.
    pub(crate) fn check_device(&self, board: DeviceId) -> Result<(), TableFileError> {
        match self.device {
            Some(device) if device != board => {
                Err(TableFileError::OtherDevice { path: self.path.clone(), device, board })
            }
            _ => Ok(()),
        }
    }

    /// Duration of the program.
    pub(crate) fn end(&self) -> Micros {
        let end = |record: &Record| if let Record::End { at } = record { Some(*at) } else { None };
        self.records.iter().find_map(end).expect("the checker refuses a table without an end")
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
