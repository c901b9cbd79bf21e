//! Files that a page sends together: a line of JSON with their names and lengths, then their bytes one after the other.
//!
//! ```text
//! {"model":{"name":"arm.toml","bytes":1834},"data":{"name":"run.csv","bytes":20671},"more":[]}⏎
//! bytes of the model, of the data, of each further file
//! ```
//!
//! In place of `model` it may name one that the server has, by its digest: `"known":"8e415f3039ec8956"`. `columns` says how the
//! columns of the data are read, where their names do not say it.

use darm_robot::files::{Files, Limits};
use serde::{Deserialize, Serialize};

use crate::refusal::{Kind, Refused};

/// Largest upload of files, bytes.
pub const MAX_FILES: usize = 64 << 20;
/// Most bytes of all uploads that the server has at once.
pub(crate) const MAX_UPLOADS: usize = 2 * MAX_FILES;
/// Longest name of a file, bytes.
const MAX_SENT_NAME: usize = 100;

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
pub(crate) struct ReadAs {
    /// Name of the column in the file.
    pub column: String,
    /// What it holds; empty of a column that is not read.
    pub quantity: String,
    /// The unit of its numbers; empty where it has none.
    pub unit: String,
}

/// The model of an upload.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Model {
    /// A file that was sent, by its name.
    Sent(String),
    /// One that the server has, by its digest.
    Known(String),
    /// None: the data are only looked at.
    Missing,
}

/// A model, measurements, and the files that the model names.
#[derive(Debug)]
pub(crate) struct Upload<'a> {
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
    pub(crate) fn parse(body: &'a [u8]) -> Result<Self, Refused> {
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
            rest = others;
            files.push((name, own));
        }
        Ok(Self { model, columns: head.columns, data, accepts_other_model: head.other_model, files })
    }

    /// The bytes of a file that was sent; empty for another name.
    pub(crate) fn bytes(&self, name: &str) -> &[u8] {
        self.files.iter().find(|(own, _)| own == name).map_or(&[], |(_, bytes)| bytes)
    }

    /// The files as all that is read: whatever a model names, and however it writes it, there are no others.
    pub(crate) fn handed(&self) -> Files {
        Files::handed(self.files.iter().map(|(name, bytes)| (name.clone(), bytes.to_vec())), Limits::SERVER)
    }
}

/// Whether a name is that of a file in one folder, on every system.
fn is_plain(name: &str) -> bool {
    let is_odd = |c: char| c.is_control() || matches!(c, '/' | '\\' | ':');
    !name.is_empty() && name.len() <= MAX_SENT_NAME && !name.starts_with('.') && !name.contains(is_odd)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use darm_diagnose::files::Subject;

    use super::{Model, Upload};

    #[test]
    fn files_are_parted_by_their_lengths() {
        let body = b"{\"model\":{\"name\":\"a.toml\",\"bytes\":2},\"data\":{\"name\":\"b.csv\",\"bytes\":3}}\nAB1\n2";
        let upload = Upload::parse(body).unwrap();
        let read = |name: &str| upload.handed().read(Path::new(name)).unwrap();
        assert_eq!((read("a.toml"), read("b.csv")), (b"AB".to_vec(), b"1\n2".to_vec()));
        assert_eq!(upload.model, Model::Sent("a.toml".into()));
        let known = Upload::parse(b"{\"known\":\"8e\",\"data\":{\"name\":\"b.csv\",\"bytes\":0}}\n").unwrap();
        assert_eq!(known.model, Model::Known("8e".into()));
    }

    /// `<include>` reads any file as XML, whatever its name ends with, and a path may begin with a space.
    #[test]
    fn a_file_that_is_included_may_not_name_files_elsewhere_either() {
        let folder = tempfile::tempdir().unwrap();
        let secret = folder.path().join("secret.xml");
        std::fs::write(&secret, "<mujoco model=\"the secret\"/>").unwrap();
        let elsewhere = format!("<mujoco><include file=\"{}\"/></mujoco>", secret.display());
        let own = "<mujoco><worldbody/></mujoco>".to_owned();
        for (included, is_read) in [(elsewhere, false), (own, true)] {
            let model = "<mujoco><include file=\"b.dat\"/></mujoco>";
            let head = format!(
                "{{\"model\":{{\"name\":\"a.xml\",\"bytes\":{}}},\"data\":{{\"name\":\"d.csv\",\"bytes\":0}},\"more\":[{{\"name\":\"b.dat\",\"bytes\":{}}}]}}",
                model.len(),
                included.len()
            );
            let body = format!("{head}\n{model}{included}");
            let files = Upload::parse(body.as_bytes()).unwrap().handed();
            let read = Subject::read(files.file(Path::new("a.xml")));
            let text = read.err().map_or_else(String::new, |error| error.to_string());
            assert_eq!(!text.contains("was not sent"), is_read, "{text}");
            assert!(!text.contains("the secret"), "{text}");
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
