//! Why a table file is refused.

use std::path::PathBuf;

use darm_core::table::TableError;
use darm_core::units::{DeviceId, Digest, ShortDigest};

use super::visits_file;

/// Why a file is not a usable table.
#[derive(Debug, thiserror::Error)]
pub enum TableFileError {
    /// The file cannot be read.
    #[error("{path}: {}", darm_robot::source::unreadable(source))]
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
        profile_name(.profile, "no profile (built-in limits)"),
        profile_name(.board, "no profile (built-in limits, or nothing is driven: `darm status` says which)")
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
fn profile_name(profile: &ShortDigest, none: &str) -> String {
    match *profile == Digest::default().short() {
        true => none.to_owned(),
        false => format!("board profile {profile}"),
    }
}
