//! The file of a model of signals: what a correction is written to.

use std::path::{Path, PathBuf};

use crate::linearise::model::ModelError;
use crate::linearise::model_effects::ModelEffect;
use crate::measured::Measured;
use darm_robot::files::FileRef;
use darm_robot::source::{ModelKind, Source};

/// A joint of a model that does not move: its name, and its position in deg or mm.
#[derive(Clone, Debug, PartialEq)]
pub struct LockedJoint {
    /// Its name.
    pub name: String,
    /// Whether it turns: the position is in deg, else in mm.
    pub is_revolute: bool,
    /// Its position, deg or mm.
    pub position: f64,
}

/// What was chosen of a model's robot besides what its file says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chosen {
    /// Joints that do not move.
    pub locked: Vec<LockedJoint>,
    /// The body or link with which its tree begins.
    pub root: Option<String>,
}

/// The keys of a model's file, and where it lies.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelFile {
    path: PathBuf,
    keys: toml::Table,
}

impl ModelFile {
    /// Reads the file of a model; of a robot's file the keys are those of a model of `kind` that names it.
    ///
    /// # Errors
    ///
    /// A file that cannot be read, or that is not TOML.
    pub fn read<'a>(file: impl Into<FileRef<'a>>, kind: Measured) -> Result<Self, ModelError> {
        let source = Source::read(file)?;
        let path = source.path();
        let keys = if source.kind() == ModelKind::Robot {
            let observed = if kind == Measured::ContactWrench { "wrench" } else { "torque" };
            let own = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let keys = [("kind", "robot".to_string()), ("urdf", own), ("observed", observed.into())];
            keys.map(|(key, value)| (key.to_string(), toml::Value::String(value))).into_iter().collect()
        } else {
            source.parse()?
        };
        Ok(Self { path: path.into(), keys })
    }

    /// The model with what was chosen besides what its file says.
    #[must_use]
    pub fn with(mut self, chosen: &Chosen) -> Self {
        if let Some(root) = &chosen.root {
            self.keys.insert("root".into(), toml::Value::String(root.clone()));
        }
        for joint in &chosen.locked {
            let key = if joint.is_revolute { "lock_deg" } else { "lock_mm" };
            let locks = self.keys.entry(key).or_insert_with(|| toml::Value::Table(toml::Table::new()));
            if let Some(locks) = locks.as_table_mut() {
                locks.insert(joint.name.clone(), toml::Value::Float(joint.position));
            }
        }
        self
    }

    /// Its number; 0 where it has none.
    pub fn number(&self) -> u64 {
        let number = self.keys.get("number").and_then(toml::Value::as_integer);
        number.and_then(|number| u64::try_from(number).ok()).unwrap_or(0)
    }

    /// The next model: with these effects in place of those that it has.
    #[must_use]
    pub(crate) fn with_effects<'a>(&self, effects: impl Iterator<Item = &'a ModelEffect>) -> Self {
        let mut next = self.clone();
        let number = toml::Value::try_from(self.number() + 1).expect("a number of a model is small");
        next.keys.insert("number".into(), number);
        let tables = effects.map(|effect| toml::Value::try_from(effect).expect("an effect is names and numbers"));
        next.keys.insert("effect".into(), toml::Value::Array(tables.collect()));
        next
    }

    /// The text of the file of the model, where it lies beside the one that was read.
    pub fn text(&self) -> String {
        text_of(&self.keys)
    }

    /// Writes the file of the model; the robot's file that it names stays where it is.
    ///
    /// # Errors
    ///
    /// The robot's file is not there, or the output cannot be written.
    pub fn write(&self, output: &Path) -> Result<(), ModelError> {
        let mut keys = self.keys.clone();
        if let Some(toml::Value::String(urdf)) = keys.get_mut("urdf")
            && folder(&self.path) != folder(output)
        {
            let path = self.path.parent().unwrap_or(Path::new("")).join(&*urdf);
            let absolute = path.canonicalize().map_err(|error| ModelError::unreadable(&path, error))?;
            *urdf = absolute.display().to_string();
        }
        std::fs::write(output, text_of(&keys)).map_err(|error| ModelError::unwritable(output, error))
    }
}

fn text_of(keys: &toml::Table) -> String {
    toml::to_string(keys).expect("keys that were read can be written")
}

/// The folder of a file; none of one that is not there.
fn folder(path: &Path) -> Option<PathBuf> {
    let parent = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    parent.unwrap_or(Path::new(".")).canonicalize().ok()
}
