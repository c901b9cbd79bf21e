//! Files that a page sends together: a line of JSON with their names and lengths, then their bytes one after the other.
//!
//! ```text
//! {"model":{"name":"arm.toml","bytes":1834},"data":{"name":"run.csv","bytes":20671},"more":[]}⏎
//! bytes of the model, of the data, of each further file
//! ```
//!
//! In place of `model` it may name one that the server has, by its digest: `"known":"8e415f3039ec8956"`. `columns` says how the
//! columns of the data are read, where their names do not say it.

use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::refusal::{Kind, Refused};

const QUOTES: [char; 2] = ['"', '\''];
/// Largest upload of files, bytes.
pub const MAX_FILES: usize = 64 << 20;
/// Most bytes of all uploads that the server has at once.
pub const MAX_UPLOADS: usize = 2 * MAX_FILES;
/// Longest name of a file, bytes.
const MAX_NAME: usize = 100;

/// The first line of an upload.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    model: Option<Named>,
    known: Option<String>,
    data: Named,
    #[serde(default)]
    columns: Vec<ReadAs>,
    #[serde(default)]
    more: Vec<Named>,
    #[serde(default)]
    other_model: bool,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Named {
    name: String,
    bytes: usize,
}

/// How the numbers of a column are read.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ReadAs {
    /// Name of the column in the file.
    pub column: String,
    /// What it holds; empty of a column that is not read.
    pub quantity: String,
    /// The unit of its numbers; empty where it has none.
    pub unit: String,
}

/// The model of an upload.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Model {
    /// A file that was sent, by its name.
    Sent(String),
    /// One that the server has, by its digest.
    Known(String),
    /// None: the data are only looked at.
    Missing,
}

/// A model, measurements, and the files that the model names.
#[derive(Debug)]
pub struct Upload<'a> {
    /// The model.
    pub model: Model,
    /// How columns of the measurements are read; those that are not named are read by their names.
    pub columns: Vec<ReadAs>,
    /// Name of the file of measurements.
    pub data: String,
    /// Whether a recording of the table of another arm is accepted.
    pub accepts_other_model: bool,
    files: Vec<(String, &'a [u8])>,
}

impl<'a> Upload<'a> {
    /// Parts the body of a request.
    ///
    /// # Errors
    ///
    /// The body is no upload, a name is none of a file, or two files have one name.
    pub fn parse(body: &'a [u8]) -> Result<Self, Refused> {
        let invalid = |text: String| Refused::new(Kind::Invalid, text);
        let end = body.iter().position(|byte| *byte == b'\n').unwrap_or(body.len());
        let head: Head = serde_json::from_slice(&body[..end])
            .map_err(|error| invalid(format!("the first line does not list the files: {error}")))?;
        let model = match (&head.model, head.known) {
            (Some(model), _) => Model::Sent(model.name.clone()),
            (None, Some(digest)) => Model::Known(digest),
            (None, None) => Model::Missing,
        };
        let data = head.data.name.clone();
        let mut rest = body.get(end + 1..).unwrap_or_default();
        let mut files: Vec<(String, &[u8])> = Vec::new();
        for Named { name, bytes } in head.model.into_iter().chain([head.data]).chain(head.more) {
            if !is_plain(&name) {
                return Err(invalid(format!("{name:?} is not the name of a file; rename it")));
            }
            if files.iter().any(|(other, _)| *other == name) {
                return Err(invalid(format!("two files have the name {name}; rename one of them")));
            }
            let (own, others) = rest
                .split_at_checked(bytes)
                .ok_or_else(|| invalid(format!("{name} arrived incomplete; choose the files again")))?;
            if let Some(path) = path_elsewhere(&name, own) {
                return Err(invalid(format!(
                    "{name} names {path:?}, and only files that are sent with it are read; name it without a folder"
                )));
            }
            rest = others;
            files.push((name, own));
        }
        Ok(Self { model, columns: head.columns, data, accepts_other_model: head.other_model, files })
    }

    /// The bytes of a file that was sent; empty for another name.
    pub fn bytes(&self, name: &str) -> &[u8] {
        self.files.iter().find(|(own, _)| own == name).map_or(&[], |(_, bytes)| bytes)
    }

    /// Writes the files into a folder; the path of the measurements.
    ///
    /// # Errors
    ///
    /// A file cannot be written.
    pub fn write(&self, folder: &Path) -> io::Result<PathBuf> {
        for (name, bytes) in &self.files {
            std::fs::write(folder.join(name), bytes)?;
        }
        Ok(folder.join(&self.data))
    }
}

/// A path in the file of a model that may lead out of its folder: what a page sends makes the server read no other file.
fn path_elsewhere<'t>(name: &str, bytes: &'t [u8]) -> Option<&'t str> {
    let is_model = [".toml", ".urdf", ".xml"].iter().any(|end| name.to_ascii_lowercase().ends_with(end));
    let text = std::str::from_utf8(bytes).ok().filter(|_| is_model)?;
    // Which pieces are within quotes is not asked, and what could write a path in other characters is refused too.
    let leads_out = |piece: &&str| {
        let is_absolute = piece.starts_with(['/', '~']) && !piece.starts_with("/>") || piece.starts_with("file:");
        is_absolute || ["..", "&#", "\\"].iter().any(|odd| piece.contains(odd))
    };
    let is_xml = !name.to_ascii_lowercase().ends_with(".toml");
    // A string of several lines begins with a line break.
    let pieces = |part: &'t str| part.lines().flat_map(|line| line.split(QUOTES)).find(leads_out);
    if is_xml { outside_comments(text).find_map(pieces) } else { pieces(text) }
}

/// The parts of an XML text outside of comments. A comment with quotes counts as text: it may be within a value, and hide the
/// end of one.
fn outside_comments(text: &str) -> impl Iterator<Item = &str> {
    let (first, others) = text.split_once("<!--").unwrap_or((text, ""));
    let after = |part: &str| -> usize {
        let comment = part.split_once("-->").map(|(comment, _)| comment).filter(|comment| !comment.contains(QUOTES));
        comment.map_or(0, |comment| comment.len() + "-->".len())
    };
    std::iter::once(first).chain(others.split("<!--").map(move |part| &part[after(part)..]))
}

/// Whether a name is that of a file in one folder, on every system.
fn is_plain(name: &str) -> bool {
    let is_odd = |c: char| c.is_control() || matches!(c, '/' | '\\' | ':');
    !name.is_empty() && name.len() <= MAX_NAME && !name.starts_with('.') && !name.contains(is_odd)
}

#[cfg(test)]
mod tests {
    use super::{Model, Upload};

    #[test]
    fn files_are_parted_by_their_lengths() {
        let body = b"{\"model\":{\"name\":\"a.toml\",\"bytes\":2},\"data\":{\"name\":\"b.csv\",\"bytes\":3}}\nAB1\n2";
        let upload = Upload::parse(body).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let data = upload.write(folder.path()).unwrap();
        let model = folder.path().join("a.toml");
        assert_eq!((std::fs::read(model).unwrap(), std::fs::read(data).unwrap()), (b"AB".to_vec(), b"1\n2".to_vec()));
        assert_eq!(upload.model, Model::Sent("a.toml".into()));
        let known = Upload::parse(b"{\"known\":\"8e\",\"data\":{\"name\":\"b.csv\",\"bytes\":0}}\n").unwrap();
        assert_eq!(known.model, Model::Known("8e".into()));
    }

    #[test]
    fn a_model_that_names_files_elsewhere_is_refused() {
        let upload = |name: &str, text: &str| {
            let head = format!(
                "{{\"model\":{{\"name\":{name:?},\"bytes\":{}}},\"data\":{{\"name\":\"b\",\"bytes\":0}}}}",
                text.len()
            );
            Upload::parse(format!("{head}\n{text}").as_bytes()).map(|_| ()).map_err(|refused| refused.text)
        };
        assert_eq!(upload("a.toml", "urdf = \"tx40.urdf\""), Ok(()));
        assert_eq!(upload("a.urdf", "<mesh filename=\"package://tx40/link.stl\"/>"), Ok(()));
        let comment = "<robot><!-- made from ../../arm.xacro --><link name=\"a\"/><!-- and of ../b --></robot>";
        assert_eq!(upload("a.urdf", comment), Ok(()));
        let hidden = "<mesh a=\"<!--\" filename=\"../../secret\" b=\"-->\"/>";
        assert!(upload("a.urdf", hidden).unwrap_err().contains("secret"));
        let lines = "urdf = \"\"\"\n/etc/passwd\"\"\"";
        assert!(upload("a.toml", lines).unwrap_err().contains("/etc/passwd"));
        for path in ["/etc/passwd", "../other.urdf", "file:///etc/passwd", "&#47;etc", "\\u002fetc"] {
            assert!(upload("a.toml", &format!("urdf = \"{path}\"")).unwrap_err().contains(&format!("{path:?}")));
            assert!(upload("a.xml", &format!("<include file='{path}'/>")).unwrap_err().contains(&format!("{path:?}")));
        }
    }

    #[test]
    fn names_that_leave_the_folder_and_files_that_are_cut_are_refused() {
        let body = |name: &str, bytes: usize| {
            let head = format!(
                "{{\"model\":{{\"name\":{name:?},\"bytes\":{bytes}}},\"data\":{{\"name\":\"b\",\"bytes\":0}}}}"
            );
            format!("{head}\nAB").into_bytes()
        };
        assert!(Upload::parse(&body("a.toml", 2)).is_ok());
        for name in ["../a.toml", "/etc/a", "a\\b", "", ".hidden", "c:a", "a\u{7}"] {
            assert!(Upload::parse(&body(name, 2)).is_err(), "{name:?}");
        }
        assert!(Upload::parse(&body("b", 2)).unwrap_err().text.contains("two files"));
        assert!(Upload::parse(&body("a.toml", 3)).unwrap_err().text.contains("incomplete"));
        assert!(Upload::parse(b"").is_err() && Upload::parse(b"{}\n").is_err());
    }
}
