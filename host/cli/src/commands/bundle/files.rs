//! The files of a model: its own, and those that it names, by names under which they find each other in another folder.

use std::path::{Component, Path, PathBuf};

use anyhow::Context as _;

/// Keys of a TOML file that name another file.
const KEYS: [&str; 2] = ["urdf", "profile"];
/// Attributes of an MJCF that name a folder of files.
const FOLDERS: [&str; 2] = ["meshdir", "assetdir"];

/// A model with all that it names.
pub(super) struct Files {
    /// The name of the model among them.
    pub(super) model: String,
    /// Names and contents.
    pub(super) all: Vec<(String, Vec<u8>)>,
}

/// A file: its path from the folder of the model, and its content.
struct Stored {
    path: PathBuf,
    bytes: Vec<u8>,
}

/// The files of a model.
pub(super) fn of(model: &Path) -> anyhow::Result<Files> {
    let bytes = std::fs::read(model).with_context(|| format!("cannot read {}", model.display()))?;
    let folder = model.parent().unwrap_or(Path::new(""));
    let mut stored = vec![Stored { path: model.file_name().unwrap_or_default().into(), bytes }];
    let mut next = 0;
    while next < stored.len() {
        let is_toml = stored[next].path.extension().is_some_and(|end| end == "toml");
        if is_toml {
            let bytes = std::mem::take(&mut stored[next].bytes);
            stored[next].bytes = with_near_files(bytes, &mut stored, folder);
        }
        for path in named(&stored[next]) {
            let is_known = stored.iter().any(|known| known.path == path);
            if let Some(bytes) = std::fs::read(folder.join(&path)).ok().filter(|_| !is_known) {
                stored.push(Stored { path, bytes });
            }
        }
        next += 1;
    }
    // Files above the folder of the model have a place where the model is as many folders deep.
    let above = |path: &Path| path.components().take_while(|part| *part == Component::ParentDir).count();
    let depth = stored.iter().map(|file| above(&file.path)).max().unwrap_or_default();
    let deep: PathBuf = std::iter::once("model").chain(std::iter::repeat_n("of", depth)).collect();
    let name = |path: &Path| {
        let parts = normal(&deep.join(path));
        parts.iter().map(|part| part.to_string_lossy()).collect::<Vec<_>>().join("/")
    };
    let model = name(&stored[0].path);
    Ok(Files { model, all: stored.into_iter().map(|file| (name(&file.path), file.bytes)).collect() })
}

/// The text of a TOML file in which files that are named by absolute paths are named by their own names; these files are
/// added.
fn with_near_files(bytes: Vec<u8>, stored: &mut Vec<Stored>, folder: &Path) -> Vec<u8> {
    let text = String::from_utf8_lossy(&bytes);
    let Ok(mut document) = text.parse::<toml_edit::DocumentMut>() else { return bytes };
    for key in KEYS {
        let Some(path) = document.get(key).and_then(|value| value.as_str()).map(PathBuf::from) else { continue };
        let Some(name) = path.file_name().filter(|_| path.is_absolute()) else { continue };
        if let Ok(bytes) = std::fs::read(folder.join(&path)) {
            stored.push(Stored { path: name.into(), bytes });
            document[key] = toml_edit::value(name.to_string_lossy().into_owned());
        }
    }
    document.to_string().into_bytes()
}

/// The paths that a file names, from the folder of the model; some of them may not exist.
fn named(file: &Stored) -> Vec<PathBuf> {
    let text = String::from_utf8_lossy(&file.bytes);
    let folder = file.path.parent().unwrap_or(Path::new(""));
    let end = file.path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    let names: Vec<PathBuf> = match &end[..] {
        "toml" => {
            let document = text.parse::<toml_edit::DocumentMut>().unwrap_or_default();
            KEYS.iter().filter_map(|key| Some(document.get(key)?.as_str()?.into())).collect()
        }
        "xml" | "urdf" => {
            let folders: Vec<&str> = FOLDERS.iter().flat_map(|name| attributes(&text, name)).chain([""]).collect();
            let files = attributes(&text, "file");
            files.into_iter().flat_map(|file| folders.iter().map(move |folder| Path::new(folder).join(file))).collect()
        }
        _ => Vec::new(),
    };
    names.iter().filter(|name| name.is_relative()).map(|name| normal(&folder.join(name))).collect()
}

/// The values of an attribute in a text of XML.
fn attributes<'t>(text: &'t str, name: &str) -> Vec<&'t str> {
    let equals = format!("{name}=");
    let places = text.match_indices(&equals).filter(|(at, _)| text[..*at].ends_with(char::is_whitespace));
    let value = |(at, _): (usize, &str)| {
        let value = &text[at + equals.len()..];
        let quote = value.chars().next().filter(|quote| ['"', '\''].contains(quote))?;
        value[1..].split(quote).next()
    };
    places.filter_map(value).collect()
}

/// A path without `.`, and without `..` after a folder.
fn normal(path: &Path) -> PathBuf {
    let mut parts: Vec<Component> = Vec::new();
    for part in path.components() {
        match (part, parts.last()) {
            (Component::CurDir, _) => {}
            (Component::ParentDir, Some(Component::Normal(_))) => drop(parts.pop()),
            _ => parts.push(part),
        }
    }
    parts.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The names of a model's files.
    fn names(files: &[(&str, &str)], model: &str) -> Vec<String> {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        of(&folder.path().join(model)).unwrap().all.into_iter().map(|(name, _)| name).collect()
    }

    #[test]
    fn files_that_are_named_keep_their_places() {
        let toml = ("a/model.toml", "kind = 'robot'\nurdf = '../b/./robot.xml'\n");
        let robot = (
            "b/robot.xml",
            "<mujoco><compiler meshdir='m'/><include file=\"part.xml\"/><mesh\nfile='c.stl'/></mujoco>",
        );
        let rest = [("b/part.xml", "<mujoco/>"), ("b/m/c.stl", "solid"), ("b/other.xml", "")];
        let all = names(&[&[toml, robot][..], &rest].concat(), "a/model.toml");
        assert_eq!(all, ["model/of/model.toml", "model/b/robot.xml", "model/b/part.xml", "model/b/m/c.stl"]);
        assert_eq!(names(&[("arm.toml", "profile = 'gone.toml'")], "arm.toml"), ["model/arm.toml"]);
        assert_eq!(names(&[("arm.toml", "no toml = =")], "arm.toml"), ["model/arm.toml"]);
    }

    #[test]
    fn a_file_at_an_absolute_path_becomes_a_neighbour() {
        let folder = tempfile::tempdir().unwrap();
        let robot = folder.path().join("far.urdf");
        std::fs::write(&robot, "<robot/>").unwrap();
        let model = folder.path().join("model.toml");
        std::fs::write(&model, format!("# kept\nurdf = {:?}\n", robot.display().to_string())).unwrap();
        let Files { model, all } = of(&model).unwrap();
        assert_eq!((&model[..], &all[1].0[..]), ("model/model.toml", "model/far.urdf"));
        assert_eq!(String::from_utf8_lossy(&all[0].1), "# kept\nurdf = \"far.urdf\"\n");
    }
}
