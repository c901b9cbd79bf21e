//! Reading of a file or folder, by what its bytes begin with.

use std::path::Path;

use crate::csv::expanded;
use crate::foreign;
use darm_robot::files::{FileRef, Limits};

pub use crate::import::delimited::Dialect;

use crate::import::array::{self, mat, npy};
use crate::import::delimited;
use crate::import::error::{Fault, ImportError};
use crate::import::recording::{Part, Recording};
use crate::import::ros;

/// Reads a recording; `dialect` is about text files alone.
///
/// # Errors
///
/// A file that cannot be read, is damaged or is of a format that is not known, with what to do about it.
pub fn read<'a>(file: impl Into<FileRef<'a>>, dialect: Dialect) -> Result<Recording, ImportError> {
    let FileRef { path, files } = file.into();
    let limits = files.limits();
    let load = |path: &Path| files.read(path).map_err(|error| ImportError::io(path, &error));
    let recording = |(parts, notes)| Recording { path: path.into(), parts, notes };
    if files.is_disk() && path.is_dir() {
        let logs: Vec<Vec<u8>> = ros::bag::files(path)?.iter().map(|file| load(file)).collect::<Result<_, _>>()?;
        return ros::log::read(&logs, &limits).map(recording).map_err(|fault| fault.in_file(path));
    }
    let mut bytes = load(path)?;
    let mut is_cut = false;
    if bytes.starts_with(&[0x1f, 0x8b]) {
        let damaged = |error| ImportError::new(path, "", format!("cannot be expanded ({error}): the file is damaged"));
        (bytes, is_cut) = expanded(&bytes, &limits).map_err(damaged)?;
        if is_cut {
            let end = bytes.iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
            bytes.truncate(end);
        }
    }
    if let Some(fault) = foreign::unread(path, &bytes) {
        return Err(ImportError::new(path, "", fault));
    }
    let (parts, mut notes) = parts(path, bytes, dialect, &limits).map_err(|fault| fault.in_file(path))?;
    notes.extend(is_cut.then(|| "the file ends early; its complete rows are read".to_owned()));
    Ok(recording((parts, notes)))
}

/// Why a MAT-file cannot be read; `None` of one that can be, and of any other file.
pub fn mat_fault<'a>(file: impl Into<FileRef<'a>>) -> Option<ImportError> {
    let file = file.into();
    let bytes = file.bytes().ok()?;
    let is_mat = bytes.starts_with(b"MATLAB") || bytes.starts_with(b"\x89HDF");
    drop(bytes);
    is_mat.then(|| read(&file, Dialect::default()).err()).flatten()
}

fn parts(path: &Path, bytes: Vec<u8>, dialect: Dialect, limits: &Limits) -> Result<(Vec<Part>, Vec<String>), Fault> {
    let end = path.extension().and_then(|end| end.to_str()).unwrap_or_default().to_lowercase();
    if bytes.is_empty() {
        return Err(Fault::of_file("the file is empty"));
    }
    if bytes.starts_with(npy::MAGIC) || end == "npy" {
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        return Ok((array::parts(npy::read(&name, &bytes, limits)?), Vec::new()));
    }
    if bytes.starts_with(b"PK") || end == "npz" {
        return Ok((array::parts(npy::read_archive(&bytes, limits)?), Vec::new()));
    }
    if bytes.starts_with(b"MATLAB") || bytes.starts_with(b"\x89HDF") || end == "mat" {
        return Ok((array::parts(mat::read(&bytes, limits)?), Vec::new()));
    }
    if bytes.starts_with(b"\x89MCAP") || end == "mcap" {
        return ros::log::read(&[bytes], limits);
    }
    let (part, notes) = delimited::read(&bytes, dialect, limits)?;
    Ok((vec![part], notes))
}
