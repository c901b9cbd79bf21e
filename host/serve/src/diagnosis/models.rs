//! Models that a page need not send: the arm of the server, and those of its history.

use serde::Serialize;
use serde_json::Value;

use crate::history::{History, Kind as Entry};
use crate::hub::Hub;
use crate::job_queue::Work;
use crate::refusal::{Kind, Refused};
use crate::served_arm::ServedArm;

/// Models of the history that are offered, the newest.
const MAX_MODELS: u32 = 50;

/// A model that the server has.
#[derive(Debug, Serialize)]
pub(super) struct KnownModel {
    digest: String,
    /// Name that a person gave it in the history.
    label: Option<String>,
    /// Name of its file.
    name: String,
    number: Option<u64>,
    /// The diagnosis that it was corrected after.
    origin: Option<OriginView>,
    /// It is the arm that the server was started with.
    is_served: bool,
}

/// The diagnosis that a model was corrected after.
#[derive(Clone, Debug, Serialize)]
pub(super) struct OriginView {
    /// Law and place of its first effect; empty where none is named.
    effect: String,
    /// Name of the file of measurements.
    data: String,
    at_ms: i64,
}

/// A model's file.
pub(super) struct ModelText {
    pub(super) name: String,
    pub(super) text: String,
}

/// The arm of the server first, then the newest of the history.
pub(super) fn list(hub: &Hub, work: &Work) -> Result<Vec<KnownModel>, Refused> {
    work.check()?;
    let served = hub.served().map(KnownModel::served);
    let entries = hub.history().map_or(Ok(Vec::new()), |history| history.entries(Entry::Models, Some(MAX_MODELS)));
    let entries = entries.map_err(|error| Refused::new(Kind::Refused, error))?;
    let is_new = |model: &KnownModel| served.as_ref().is_none_or(|served| served.digest != model.digest);
    let label = served.as_ref().and_then(|served| entries.iter().find(|entry| entry["digest"] == *served.digest));
    let label = label.and_then(|entry| entry["label"].as_str().map(str::to_owned));
    let mut others: Vec<KnownModel> = entries.iter().filter_map(KnownModel::of_entry).filter(is_new).collect();
    for model in &mut others {
        work.check()?;
        model.origin = hub.history().and_then(|history| OriginView::of(history, &model.digest));
    }
    Ok(served.map(|served| KnownModel { label, ..served }).into_iter().chain(others).collect())
}

/// The file of the model with this digest.
pub(super) fn text(hub: &Hub, digest: &str) -> Result<ModelText, Refused> {
    if let Some(served) = hub.served().filter(|served| served.wired.arm.hash().to_string() == digest) {
        return Ok(ModelText { name: as_file_name(served.file_name()), text: served.wired.arm.to_toml() });
    }
    let failed = |error| Refused::new(Kind::Refused, error);
    let (mut name, mut text) = (None, None);
    if let Some(history) = hub.history() {
        (name, text) = (history.model_name(digest).map_err(failed)?, history.model_file(digest).map_err(failed)?);
    }
    let found = name.zip(text).map(|(name, text)| ModelText { name: as_file_name(&name), text });
    found.ok_or_else(|| Refused::new(Kind::Invalid, format!("the server has no model {digest}; choose its file")))
}

impl KnownModel {
    fn served(served: &ServedArm) -> Self {
        let arm = &served.wired.arm;
        let (digest, number) = (arm.hash().to_string(), Some(arm.model.number.into()));
        Self { digest, label: None, name: as_file_name(served.file_name()), number, origin: None, is_served: true }
    }

    /// `None` of an entry without a file.
    fn of_entry(entry: &Value) -> Option<Self> {
        let text = |key: &str| entry[key].as_str().map(str::to_owned);
        let has_file = entry["has_file"].as_i64() == Some(1);
        let (digest, name) = text("digest").zip(text("name")).filter(|_| has_file)?;
        Some(Self {
            digest,
            label: text("label"),
            name: as_file_name(&name),
            number: entry["number"].as_u64(),
            origin: None,
            is_served: false,
        })
    }
}

impl OriginView {
    /// `None` of a model that was corrected after no diagnosis of this history, or where that cannot be read.
    fn of(history: &History, digest: &str) -> Option<Self> {
        let (at_ms, data, report) = history.correction(digest).ok()??;
        let report: Value = serde_json::from_str(&report).ok()?;
        let effect = &report["effects"][0];
        let named = effect["law"].as_str().zip(effect["place_name"].as_str());
        let effect = named.map_or_else(String::new, |(law, place)| format!("{law}, {place}"));
        Some(Self { effect, data, at_ms })
    }
}

/// A name that a file can have: what a page sends is any text.
fn as_file_name(name: &str) -> String {
    let is_file = [".toml", ".urdf", ".xml"].iter().any(|end| name.to_lowercase().ends_with(end));
    let plain: String = name.chars().map(|c| if c.is_control() || "/\\:".contains(c) { '-' } else { c }).collect();
    if is_file { plain } else { format!("{plain}.toml") }
}
