//! The text of a file that describes an arm or robot, and errors that name its file, line and column.

use std::fmt;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::files::{FileRef, Files};

/// A file in memory, and the files that it can name.
#[derive(Clone)]
pub struct Source {
    files: Files,
    path: PathBuf,
    text: String,
}

/// What a file of a model describes: by what it says, whatever its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModelKind {
    /// A robot alone: URDF, MJCF, or a Denavit–Hartenberg table.
    Robot,
    /// A model of an experiment: TOML with a text under `kind`.
    Experiment,
    /// An arm of words: any other TOML.
    Arm,
}

/// A place in a file; both count from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// The line.
    pub line: usize,
    /// The column, in characters.
    pub column: usize,
}

/// What is wrong with a file, and where: `FILE:LINE:COLUMN: what is wrong`.
#[derive(Debug)]
pub struct FileError<F> {
    /// The file.
    pub path: PathBuf,
    /// Where in it; `None` of the complete file.
    pub place: Option<Place>,
    /// What is wrong.
    pub fault: Fault<F>,
}

/// What is wrong with a file.
#[derive(Debug)]
pub enum Fault<F> {
    /// It cannot be read.
    Read(io::Error),
    /// It cannot be written.
    Write(io::Error),
    /// It is no TOML or XML, or a key is missing, unknown or of the wrong type.
    Syntax(String),
    /// It says what cannot be.
    Content(Box<F>),
}

impl Source {
    /// Reads the file. Bytes that are not UTF-8 become replacement characters in XML, where they stand in names and comments of other
    /// programs; in TOML, which is UTF-8 by its standard, they are an error.
    ///
    /// # Errors
    ///
    /// [`Fault::Read`]: the file cannot be read, is larger than the text of a model may be, or is TOML and not UTF-8.
    pub fn read<'a, F>(file: impl Into<FileRef<'a>>) -> Result<Self, FileError<F>> {
        let file = file.into();
        let text = model_bytes(&file).and_then(|bytes| match String::from_utf8(bytes) {
            Ok(text) => Ok(text),
            Err(error) => {
                let text = String::from_utf8_lossy(error.as_bytes()).into_owned();
                let not_utf8 = || io::Error::new(io::ErrorKind::InvalidData, "stream did not contain valid UTF-8");
                if is_xml(&text) { Ok(text) } else { Err(not_utf8()) }
            }
        });
        match text {
            Ok(text) => Ok(Self { path: file.path.into(), text, files: file.files }),
            Err(error) => Err(FileError::unreadable(file.path, error)),
        }
    }

    /// A text, under the path that errors shall name. The files that it names are those of the disk.
    pub fn of_text(path: &Path, text: &str) -> Self {
        Self { path: path.into(), text: text.into(), files: Files::on_disk() }
    }

    /// The file as a value of TOML.
    ///
    /// # Errors
    ///
    /// [`Fault::Syntax`]: the file is not TOML, or not of the keys and types of `T`.
    pub fn parse<T: DeserializeOwned, F>(&self) -> Result<T, FileError<F>> {
        toml::from_str(&self.text).map_err(|error| {
            let message = error.message().trim_end().replace('\n', ", ");
            self.error(error.span(), Fault::Syntax(format!("{message}; correct the TOML")))
        })
    }

    /// A path that the file names: relative to the folder of the file.
    pub fn companion(&self, named: &str) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(named)
    }

    /// The files that it can name.
    pub fn files(&self) -> &Files {
        &self.files
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What it describes.
    pub fn kind(&self) -> ModelKind {
        if !self.is_toml() {
            return ModelKind::Robot;
        }
        match self.text.parse::<toml::Table>() {
            Ok(keys) if keys.contains_key("notation") => ModelKind::Robot,
            Ok(keys) if keys.get("kind").is_some_and(toml::Value::is_str) => ModelKind::Experiment,
            // Broken TOML too: whoever reads the arm says where.
            Ok(_) | Err(_) => ModelKind::Arm,
        }
    }

    /// Whether it is TOML, and no XML. What is neither, or empty, is what its name says, so that the error is of that.
    pub(crate) fn is_toml(&self) -> bool {
        let has_keys = || self.text.parse::<toml::Table>().is_ok_and(|keys| !keys.is_empty());
        !is_xml(&self.text) && (self.path.extension().is_some_and(|end| end == "toml") || has_keys())
    }

    /// The complete text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The error that `content` is wrong at `span`.
    pub fn wrong<F>(&self, span: Range<usize>, content: F) -> FileError<F> {
        self.error(Some(span), Fault::Content(Box::new(content)))
    }

    /// The error of `fault` at `span`, or in the complete file.
    pub fn error<F>(&self, span: Option<Range<usize>>, fault: Fault<F>) -> FileError<F> {
        FileError { path: self.path.clone(), place: span.map(|span| self.place(span.start)), fault }
    }

    /// `FILE:LINE:COLUMN` of a span.
    pub fn location(&self, span: Range<usize>) -> String {
        let Place { line, column } = self.place(span.start);
        format!("{}:{line}:{column}", self.path.display())
    }

    fn place(&self, offset: usize) -> Place {
        let before = self.text.get(..offset).unwrap_or(&self.text);
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        Place { line: before.matches('\n').count() + 1, column: before[line_start..].chars().count() + 1 }
    }
}

/// Whether a text is XML, and no TOML: by its first character.
fn is_xml(text: &str) -> bool {
    text.trim_start_matches('\u{feff}').trim_start().starts_with('<')
}

/// The bytes of the text of a model.
fn model_bytes(file: &FileRef<'_>) -> io::Result<Vec<u8>> {
    let (bytes, max) = (file.bytes()?, file.files.limits().model_bytes);
    let text = || format!("the text of a model has at most {} MiB", max >> 20);
    if bytes.len() as u64 > max { Err(io::Error::other(text())) } else { Ok(bytes) }
}

/// A number that is neither infinite nor NaN, both of which TOML can write.
#[derive(Clone, Copy, Deserialize)]
#[serde(try_from = "f64")]
pub struct Number(pub f64);

impl TryFrom<f64> for Number {
    type Error = &'static str;
    fn try_from(value: f64) -> Result<Self, Self::Error> {
        if value.is_finite() { Ok(Self(value)) } else { Err("the number has to be finite") }
    }
}

/// The path by which the file at `from` names the file at `to`: the inverse of [`Source::companion`].
pub fn path_between(from: &Path, to: &Path) -> PathBuf {
    let real = |path: &Path| path.canonicalize().or_else(|_| std::path::absolute(path)).unwrap_or(path.into());
    let folder = from.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let (folder, to) = (real(folder), real(to));
    let common = folder.components().zip(to.components()).take_while(|(one, other)| one == other).count();
    let up = std::iter::repeat_n(Path::new(".."), folder.components().count() - common);
    up.chain(to.components().skip(common).map(|component| Path::new(component.as_os_str()))).collect()
}

/// What an error says of a file that cannot be read.
pub fn unreadable(error: &io::Error) -> String {
    format!("cannot be read: {error}; check the path")
}

impl<F> FileError<F> {
    /// The error that the file cannot be read.
    pub fn unreadable(path: &Path, error: io::Error) -> Self {
        Self { path: path.into(), place: None, fault: Fault::Read(error) }
    }

    /// The error that the file cannot be written.
    pub fn unwritable(path: &Path, error: io::Error) -> Self {
        Self { path: path.into(), place: None, fault: Fault::Write(error) }
    }

    /// The same error with another kind of content.
    pub fn map<G>(self, content: impl FnOnce(F) -> G) -> FileError<G> {
        let fault = match self.fault {
            Fault::Read(error) => Fault::Read(error),
            Fault::Write(error) => Fault::Write(error),
            Fault::Syntax(message) => Fault::Syntax(message),
            Fault::Content(fault) => Fault::Content(Box::new(content(*fault))),
        };
        FileError { path: self.path, place: self.place, fault }
    }
}

impl<F: fmt::Display> fmt::Display for FileError<F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:", self.path.display())?;
        if let Some(Place { line, column }) = self.place {
            write!(f, "{line}:{column}:")?;
        }
        write!(f, " {}", self.fault)
    }
}

impl<F: fmt::Display> fmt::Display for Fault<F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Read(error) => f.write_str(&unreadable(error)),
            Self::Write(error) => write!(f, "cannot be written: {error}; check the path"),
            Self::Syntax(message) => write!(f, "{message}"),
            Self::Content(content) => write!(f, "{content}"),
        }
    }
}

impl<F: fmt::Debug + fmt::Display> std::error::Error for FileError<F> {}
