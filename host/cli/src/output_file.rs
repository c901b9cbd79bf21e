//! Output files: a command replaces only files of the kind that it writes, and replaces none before all are complete
//! under temporary names.

use std::ffi::OsString;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use darm_arm::table_file;

use darm_measure::visits;

/// Number of bytes that decide the kind of a file.
const HEAD_BYTES: u64 = 512;

/// Why a file is not written.
#[derive(Debug, thiserror::Error)]
pub(crate) enum OutputError {
    /// The name belongs to a file of another kind.
    #[error("{path} exists and is not {kind}; choose another name, or remove it first")]
    OtherKind {
        /// The file.
        path: PathBuf,
        /// The required kind.
        kind: &'static str,
    },
    /// The name belongs to a file that the command reads.
    #[error("{path} is a file that is read; choose another name")]
    Input {
        /// The file.
        path: PathBuf,
    },
    /// Two options name one file.
    #[error("{first} and {second} are the same file; choose two different names")]
    Same {
        /// One name.
        first: PathBuf,
        /// The other.
        second: PathBuf,
    },
}

/// Refuses to replace anything but a table, an empty file or a device.
pub(crate) fn refuse_other_than_table(path: &Path) -> Result<(), OutputError> {
    refuse_unless(path, "a table of `darm table`", |bytes| bytes.starts_with(table_file::KIND))
}

/// Refuses to replace anything but a visit file.
pub(crate) fn refuse_other_than_visits(path: &Path) -> Result<(), OutputError> {
    let is_header = |line: &[u8]| line.starts_with(visits::HEADER.as_bytes());
    refuse_unless(path, "a visit file of `darm table`", |bytes| bytes.split(|&byte| byte == b'\n').any(is_header))
}

/// Refuses to replace anything but a measurement.
pub(crate) fn refuse_other_than_measurement(path: &Path) -> Result<(), OutputError> {
    refuse_unless(path, "a recording of `darm record`", |_| is_recording(path))
}

/// What a file of text is written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Syntax {
    Html,
    Svg,
    Json,
    Toml,
    /// With the columns of the text that is written.
    Csv,
}

impl Syntax {
    fn name(self) -> &'static str {
        match self {
            Self::Html => "an HTML page",
            Self::Svg => "an SVG picture",
            Self::Json => "a JSON file",
            Self::Toml => "a TOML file",
            Self::Csv => "a CSV file with the same columns",
        }
    }

    fn is_that_of(self, old: &str, new: &str) -> bool {
        let columns = |text: &str| text.lines().next().map(str::to_owned);
        match self {
            Self::Html => old.starts_with("<!DOCTYPE html"),
            Self::Svg => old.starts_with("<svg"),
            Self::Json => serde_json::from_str::<serde_json::Value>(old).is_ok(),
            Self::Toml => old.parse::<toml_edit::DocumentMut>().is_ok(),
            Self::Csv => columns(old) == columns(new),
        }
    }
}

/// Writes a text; replaces only a file in the same syntax.
pub(crate) fn write_text(path: &Path, syntax: Syntax, text: &str) -> anyhow::Result<()> {
    refuse_other_syntax(path, syntax, text)?;
    write_all(&[(path, text.as_bytes())])
}

/// Refuses to replace anything but a TOML file, and a file that is read.
pub(crate) fn refuse_other_than_toml(path: &Path, inputs: &[&Path]) -> Result<(), OutputError> {
    refuse_other_syntax(path, Syntax::Toml, "")?;
    match inputs.iter().find(|input| real(input) == real(path)) {
        Some(_) => Err(OutputError::Input { path: path.into() }),
        None => Ok(()),
    }
}

/// Refuses to replace anything but an HTML page.
pub(crate) fn refuse_other_than_page(path: &Path) -> Result<(), OutputError> {
    refuse_other_syntax(path, Syntax::Html, "")
}

fn refuse_other_syntax(path: &Path, syntax: Syntax, text: &str) -> Result<(), OutputError> {
    // Some of them are known by all of the text alone.
    let is_that = |old: &[u8]| std::str::from_utf8(old).is_ok_and(|old| syntax.is_that_of(old, text));
    refuse_unless_in(path, syntax.name(), u64::MAX, is_that)
}

/// Refuses two names of one file.
pub(crate) fn refuse_same(first: &Path, second: &Path) -> Result<(), OutputError> {
    match real(first) == real(second) {
        true => Err(OutputError::Same { first: first.into(), second: second.into() }),
        false => Ok(()),
    }
}

/// Writes all files under temporary names, then renames them; where one cannot be written, all keep what they were.
pub(crate) fn write_all(files: &[(&Path, &[u8])]) -> anyhow::Result<()> {
    let mut written = Vec::new();
    let result = files.iter().try_for_each(|&(path, bytes)| {
        let target = real(path);
        // A device or pipe is written directly, a file by a temporary file that replaces it.
        let is_file = target.metadata().map_or(true, |metadata| metadata.is_file());
        let name = if is_file { temporary(&target) } else { target.clone() };
        if is_file {
            written.push((name.clone(), target));
        }
        std::fs::write(&name, bytes).with_context(|| format!("cannot write {}", path.display()))
    });
    let result = result.and_then(|()| {
        written.iter().try_for_each(|(name, target)| {
            std::fs::rename(name, target).with_context(|| format!("cannot write {}", target.display()))
        })
    });
    if result.is_err() {
        // Files that were not written do not exist.
        written.iter().for_each(|(name, _)| drop(std::fs::remove_file(name)));
    }
    result
}

fn refuse_unless(path: &Path, kind: &'static str, is_kind: impl Fn(&[u8]) -> bool) -> Result<(), OutputError> {
    refuse_unless_in(path, kind, HEAD_BYTES, is_kind)
}

/// The same by the first `n_bytes` of the file.
fn refuse_unless_in(
    path: &Path,
    kind: &'static str,
    n_bytes: u64,
    is_kind: impl Fn(&[u8]) -> bool,
) -> Result<(), OutputError> {
    let other = || OutputError::OtherKind { path: path.into(), kind };
    if path.is_dir() {
        return Err(other());
    }
    match holds_bytes(path) {
        true => first_bytes(path, n_bytes).filter(|bytes| is_kind(bytes)).map(drop).ok_or_else(other),
        false => Ok(()),
    }
}

/// Whether there is a file that is not empty.
pub(crate) fn holds_bytes(path: &Path) -> bool {
    path.metadata().is_ok_and(|metadata| metadata.is_file() && metadata.len() > 0)
}

fn first_bytes(path: &Path, n_bytes: u64) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    std::fs::File::open(path).ok()?.take(n_bytes).read_to_end(&mut bytes).ok()?;
    Some(bytes)
}

fn is_recording(path: &Path) -> bool {
    darm_measure::about(path).is_ok_and(|about| about.contains_key("program_start_s"))
}

/// The file that a name refers to, even if it does not exist yet.
fn real(path: &Path) -> PathBuf {
    if let Ok(real) = path.canonicalize() {
        return real;
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match (folder.canonicalize(), path.file_name()) {
        (Ok(folder), Some(name)) => folder.join(name),
        _ => path.to_owned(),
    }
}

/// A temporary name in the same folder.
fn temporary(path: &Path) -> PathBuf {
    let mut name = OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(format!(".{}", std::process::id()));
    path.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::{Syntax, write_all, write_text};

    #[test]
    fn a_text_replaces_only_a_file_in_its_syntax() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let texts = [
            (Syntax::Html, "<!DOCTYPE html><p>1"),
            (Syntax::Svg, "<svg/>"),
            (Syntax::Json, "{\"a\": 1}"),
            (Syntax::Toml, "a = 1"),
            (Syntax::Csv, "x_m,y_m\n1,2\n"),
        ];
        for (old, content) in texts {
            for (new, text) in texts {
                std::fs::write(&path, content).unwrap();
                assert_eq!(write_text(&path, new, text).is_ok(), old == new, "{new:?} over {old:?}");
                assert_eq!(std::fs::read_to_string(&path).unwrap(), content);
            }
        }
        for other in [&b"notes"[..], b"x_m,z_m\n1,2\n", b"\xff\xfe"] {
            std::fs::write(&path, other).unwrap();
            assert!(texts.iter().all(|(syntax, text)| write_text(&path, *syntax, text).is_err()), "{other:?}");
        }
        std::fs::write(&path, "").unwrap();
        write_text(&path, Syntax::Svg, "<svg/>").unwrap();
    }

    #[test]
    fn all_files_are_written_or_none() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("a"), "old").unwrap();
        let (a, missing) = (path("a"), path("missing/b"));
        assert!(write_all(&[(&a, b"new"), (&missing, b"new")]).is_err());
        assert_eq!(std::fs::read(&a).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing else is left");
        write_all(&[(&a, b"new"), (&path("b"), b"new")]).unwrap();
        assert_eq!(std::fs::read(&a).unwrap(), b"new");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }
}
