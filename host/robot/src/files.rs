//! Where files are read from: a disk, or a set of files that somebody handed over. The one place of this program that opens
//! models, the files that these name, and recordings.
//!
//! A [`Source`](crate::source::Source) keeps the [`Files`] that it was opened in, and opens what it names there too: an include,
//! a mesh, a robot, a package. A set that was handed over has no way to a disk, whatever a path says and whatever a file is
//! called, so a server that is handed files reads these and nothing else.
//!
//! Both have [`Limits`], as memory has: a file of 60 kB can expand to a thousand times its size, and a table in memory takes many
//! times its text.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read as _};
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

/// How much of a file is read into memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of a file, and of what a compressed one expands to.
    pub bytes: u64,
    /// Bytes of the text of a model, with all that it includes: an element or a key takes up to 50 times its text.
    pub model_bytes: u64,
    /// Cells of a table: each takes up to 150 bytes besides its text, until its columns are numbers.
    pub cells: usize,
    /// Columns of a table, or arrays of a file.
    pub columns: usize,
}

/// Files that can be read by their paths.
#[derive(Clone, Debug, PartialEq)]
pub struct Files {
    place: Place,
    limits: Limits,
}

#[derive(Clone, Debug, PartialEq)]
enum Place {
    Disk,
    Handed(Arc<BTreeMap<PathBuf, Arc<[u8]>>>),
}

/// A file and where it is read from. A path alone is one on the disk.
#[derive(Clone, Debug, PartialEq)]
pub struct FileRef<'a> {
    /// Its path.
    pub path: &'a Path,
    /// Where it is read from.
    pub files: Files,
}

impl Limits {
    /// For somebody who gives the command himself: what a computer has.
    pub const COMMAND: Self = Self { bytes: 1 << 30, model_bytes: 1 << 26, cells: 100_000_000, columns: 1 << 16 };
    /// For a server, which works on two recordings at once at most and stays below 1 GiB with both.
    pub const SERVER: Self = Self { bytes: 1 << 26, model_bytes: 1 << 22, cells: 2_000_000, columns: 1 << 12 };

    /// The sentence that a table has more cells, or columns, than are read.
    pub fn too_many_cells(&self) -> String {
        let Self { cells, columns, .. } = self;
        format!(
            "the table has more than {cells} cells or {columns} columns, which are not read into memory; record less at once, \
             or keep every tenth row"
        )
    }

    /// The sentence that a file is or expands to more than is read.
    pub fn too_large(&self) -> String {
        format!("it is or expands to more than {} MiB; record less at once, or keep every tenth row", self.bytes >> 20)
    }

    /// Whether a table of these rows and columns fits.
    pub fn has_room_for(&self, rows: usize, columns: usize) -> bool {
        columns <= self.columns && rows.saturating_mul(columns.max(1)) <= self.cells
    }

    /// Whether each line of a text may be taken apart into cells: a line of 40 MB would take 25 times as much. Separators in quotes count
    /// too, so that there are some to spare.
    pub fn has_room_for_lines(&self, text: &[u8], separator: u8) -> bool {
        let count = |line: &[u8]| line.iter().filter(|byte| **byte == separator).count();
        text.split(|byte| matches!(byte, b'\n' | b'\r')).all(|line| count(line) <= 4 * self.columns)
    }
}

impl Files {
    /// The files of the disk, for somebody who gives a command: regular files, none of a device or pipe.
    pub fn on_disk() -> Self {
        Self { place: Place::Disk, limits: Limits::COMMAND }
    }

    /// These files and no others, by their names.
    pub fn handed(files: impl IntoIterator<Item = (String, Vec<u8>)>, limits: Limits) -> Self {
        let files = files.into_iter().map(|(name, bytes)| (plain(Path::new(&name)), bytes.into()));
        Self { place: Place::Handed(Arc::new(files.collect())), limits }
    }

    /// No file at all.
    pub fn none() -> Self {
        Self::handed([], Limits::COMMAND)
    }

    /// The same with another file, in place of one of the same name; on a disk nothing changes.
    #[must_use]
    pub fn with(mut self, name: &Path, bytes: Vec<u8>) -> Self {
        if let Place::Handed(files) = &mut self.place {
            Arc::make_mut(files).insert(plain(name), bytes.into());
        }
        self
    }

    /// How much of a file is read.
    pub fn limits(&self) -> Limits {
        self.limits
    }

    /// A file of these.
    pub fn file<'a>(&self, path: &'a Path) -> FileRef<'a> {
        FileRef { path, files: self.clone() }
    }

    /// Whether there is such a file.
    pub fn has(&self, path: &Path) -> bool {
        match &self.place {
            Place::Disk => path.is_file(),
            Place::Handed(files) => files.contains_key(&plain(path)),
        }
    }

    /// Whether the files are those of the disk.
    pub fn is_disk(&self) -> bool {
        self.place == Place::Disk
    }

    /// The bytes of a file.
    ///
    /// # Errors
    ///
    /// There is no such file, it is none (a folder, a device, a pipe), or it is larger than the limit.
    pub fn read(&self, path: &Path) -> io::Result<Vec<u8>> {
        match &self.place {
            Place::Disk => from_disk(path, &self.limits),
            Place::Handed(files) => match files.get(&plain(path)) {
                Some(bytes) if bytes.len() as u64 <= self.limits.bytes => Ok(bytes.to_vec()),
                Some(_) => Err(io::Error::other(self.limits.too_large())),
                None => Err(io::Error::new(
                    io::ErrorKind::NotFound,
                    "it was not sent, and only files that are sent are read",
                )),
            },
        }
    }
}

/// A regular file, and not more of it than the limit: what grows while it is read, or has no length, ends there.
fn from_disk(path: &Path, limits: &Limits) -> io::Result<Vec<u8>> {
    // Asked before the file is opened: a pipe without a writer would not open.
    if !path.metadata()?.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "it is no regular file"));
    }
    let mut bytes = Vec::new();
    File::open(path)?.take(limits.bytes + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limits.bytes { Err(io::Error::other(limits.too_large())) } else { Ok(bytes) }
}

/// A path without the parts that lead nowhere.
fn plain(path: &Path) -> PathBuf {
    path.components().filter(|component| !matches!(component, Component::CurDir)).collect()
}

impl FileRef<'_> {
    /// Its bytes.
    ///
    /// # Errors
    ///
    /// As [`Files::read`].
    pub fn bytes(&self) -> io::Result<Vec<u8>> {
        self.files.read(self.path)
    }
}

impl<'a> From<&'a Path> for FileRef<'a> {
    fn from(path: &'a Path) -> Self {
        Self { path, files: Files::on_disk() }
    }
}

impl<'a> From<&'a PathBuf> for FileRef<'a> {
    fn from(path: &'a PathBuf) -> Self {
        path.as_path().into()
    }
}

impl<'a> From<&FileRef<'a>> for FileRef<'a> {
    fn from(file: &FileRef<'a>) -> Self {
        file.clone()
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::{Files, Limits};

    #[test]
    fn files_that_were_handed_over_are_all_that_is_read() {
        let files = Files::handed([("a.xml".into(), b"<a/>".to_vec())], Limits::SERVER);
        assert_eq!(files.read(Path::new("./a.xml")).unwrap(), b"<a/>");
        for path in ["/etc/passwd", "../a.xml", "b.xml", "/proc/self/environ", "", "a.xml/../a.xml", "A.xml", " a.xml"]
        {
            assert!(!files.has(Path::new(path)) && files.read(Path::new(path)).is_err(), "{path}");
        }
    }

    #[test]
    fn a_line_of_very_many_cells_is_not_taken_apart() {
        let limits = Limits { columns: 3, ..Limits::SERVER };
        assert!(limits.has_room_for_lines(b"1,2,3\n\"a,b,c\",2,3\n", b','));
        assert!(limits.has_room_for_lines(&b"1,2,3\r".repeat(100), b','));
        assert!(!limits.has_room_for_lines(b"1\n1,2,3,4,5,6,7,8,9,10,11,12,13,14\n", b','));
    }

    #[cfg(unix)]
    #[test]
    fn devices_and_folders_are_not_read_from_a_disk() {
        for path in ["/dev/zero", "/dev/null", "/"] {
            let error = Files::on_disk().read(Path::new(path)).unwrap_err();
            assert!(error.to_string().contains("no regular file"), "{path}: {error}");
        }
    }

    #[test]
    fn a_file_that_is_larger_than_the_limit_is_not_read() {
        let limits = Limits { bytes: 3, ..Limits::COMMAND };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, b"1234").unwrap();
        assert!(super::from_disk(&path, &limits).is_err());
        std::fs::write(&path, b"123").unwrap();
        assert_eq!(super::from_disk(&path, &limits).unwrap(), b"123");
        assert!(Files::handed([("a".into(), b"1234".to_vec())], limits).read(Path::new("a")).is_err());
    }
}
