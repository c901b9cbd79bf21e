//! Which model a recording was made with, and whether an arm file may be compared with it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use darm_core::units::ModelHash;

use super::{Finding, FindingKind};
use darm_arm::arm::Arm;

/// The model whose table was played while these measurements were taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Origin {
    /// Hash of the arm file.
    pub model: ModelHash,
    /// Hash of the arm without its effects; `None` in recordings of earlier versions.
    pub geometry: Option<ModelHash>,
}

/// The measurements were taken with a table of another arm.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{} was recorded with a table of model {recorded}, {} is model {given} and differs in more than its effects; {}, or add \
     --other-model to compare it with this one",
    data.display(),
    arm.display(),
    match wanted {
        Some(path) => format!("give {}, which is that model", path.display()),
        None => "give the arm file that the table was made from".into(),
    }
)]
pub struct OtherModel {
    /// The measurements.
    pub data: PathBuf,
    /// The arm file.
    pub arm: PathBuf,
    /// The model of the measurements.
    pub recorded: ModelHash,
    /// That of the arm file.
    pub given: ModelHash,
    /// An arm file beside `arm` that is the model of the measurements.
    pub wanted: Option<PathBuf>,
}

impl Origin {
    /// What the comment lines or the metadata of a file say; `None` where they name no model.
    pub fn find(about: &BTreeMap<String, String>) -> Option<Self> {
        let hash = |key: &str| about.get(key).and_then(|text| hash(text));
        Some(Self { model: hash("model")?, geometry: hash("geometry") })
    }

    /// Whether the arm is the recorded model or one that differs in its effects only.
    pub fn fits(&self, arm: &Arm) -> bool {
        self.model == arm.hash() || self.geometry == Some(arm.geometry_hash())
    }

    /// The finding that the arm is another model than the recorded one; `None` of the same.
    pub fn finding(&self, arm: &Arm) -> Option<Finding> {
        let (recorded, given) = (self.model, arm.hash());
        let how = if self.fits(arm) { "the same arm with other effects" } else { "another arm" };
        let text = format!("recorded with a table of model {recorded}; the arm file is model {given}, {how}");
        (recorded != given).then(|| Finding::note(FindingKind::OtherModel, text))
    }

    /// The error that names the arm file to give.
    pub fn refusal(&self, data: &Path, path: &Path, arm: &Arm) -> OtherModel {
        let wanted = companion(path).find(|other| Arm::read(other).is_ok_and(|other| other.hash() == self.model));
        OtherModel { data: data.into(), arm: path.into(), recorded: self.model, given: arm.hash(), wanted }
    }
}

fn hash(text: &str) -> Option<ModelHash> {
    let is_hash = text.len() == 16 && text.bytes().all(|byte| byte.is_ascii_hexdigit());
    is_hash.then(|| u64::from_str_radix(text, 16).ok().map(ModelHash)).flatten()
}

/// The arm files that may be in the folder of `path`.
fn companion(path: &Path) -> impl Iterator<Item = PathBuf> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let entries = std::fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok);
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    files.retain(|file| file.extension().is_some_and(|end| end == "toml"));
    files.sort();
    files.into_iter()
}

#[cfg(test)]
mod tests {

    use darm_core::effect::Effect;

    use super::*;

    fn about(pairs: &[(&str, &str)]) -> BTreeMap<String, String> {
        pairs.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect()
    }

    fn arm() -> Arm {
        Arm::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/planar4.toml")).unwrap()
    }

    #[test]
    fn only_hashes_name_a_model() {
        assert_eq!(Origin::find(&about(&[("model", "UR10")])), None);
        assert_eq!(Origin::find(&about(&[("model", "+123456789abcdef")])), None);
        let found = Origin::find(&about(&[("model", "00000000000000ff")]));
        assert_eq!(found, Some(Origin { model: ModelHash(255), geometry: None }));
    }

    #[test]
    fn a_model_with_other_effects_fits_and_one_with_another_stop_does_not() {
        let recorded = arm();
        let origin = Origin { model: recorded.hash(), geometry: Some(recorded.geometry_hash()) };
        assert_eq!((origin.fits(&recorded), origin.finding(&recorded)), (true, None));
        let mut next = recorded.clone();
        next.model.number += 1;
        next.model.working_supply *= 0.9;
        next.model.effects.push(Effect::StrokeLoss { actuator: 4, state: 1, loss_m: 1e-3 }).unwrap();
        assert!(origin.fits(&next) && origin.finding(&next).is_some());
        let mut moved = recorded;
        moved.model.chain.tool.position.x += 1e-6;
        assert!(!origin.fits(&moved));
        assert!(!Origin { geometry: None, ..origin }.fits(&next));
    }
}
