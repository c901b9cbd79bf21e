//! The entry of a diagnosis in the history.

use darm_diagnose::files::FileDiagnosis;
use serde_json::Value;
use sha2::{Digest as _, Sha256};

use super::Diagnoses;
use super::sources::Sources;
use super::view::ResultView;
use crate::history::{DiagnosisEntry, ModelEntry};
use crate::unix_time;

impl Diagnoses {
    /// Keeps a diagnosis with what pages show of it, its model and the corrected one in the history, where the server has one. Where
    /// that fails the diagnosis has not failed.
    pub(super) fn keep(
        &self,
        sources: &Sources<'_>,
        found: &FileDiagnosis,
        result: &ResultView,
        corrected_digest: Option<String>,
    ) {
        let Some(history) = self.hub.history() else { return };
        let diagnosis = &found.diagnosis;
        let (upload, model_bytes) = (sources.upload, sources.model_bytes());
        let digest = found.arm().map_or_else(|| sha256(model_bytes), |arm| arm.hash().to_string());
        let file = String::from_utf8_lossy(model_bytes);
        let number = diagnosis.model;
        let model = ModelEntry { digest: &digest, name: &sources.model, number, parent: None, file: &file };
        let corrected = result
            .corrected
            .as_ref()
            .map(|next| (next, corrected_digest.unwrap_or_else(|| sha256(next.text.as_bytes()))));
        let next = corrected.as_ref().map(|(next, own)| ModelEntry {
            digest: own,
            name: &next.name,
            number: u32::try_from(next.number).ok(),
            parent: Some(&digest),
            file: &next.text,
        });
        let (data_digest, report) = (sha256(upload.bytes(&upload.data)), numbers(found));
        let shown = serde_json::to_string(result).ok();
        let verdict = diagnosis.verdict.to_string();
        let entry = DiagnosisEntry {
            model,
            corrected: next,
            data_name: &upload.data,
            data_digest: &data_digest,
            verdict: &verdict,
            summary: diagnosis.plain.first().map_or("", String::as_str),
            report: &report,
            result: shown.as_deref(),
        };
        if let Err(error) = history.add_diagnosis(&entry, unix_time::now_ms()) {
            eprintln!("darm serve: the history does not keep the diagnosis: {error}");
        }
    }
}

/// The numbers of a diagnosis as JSON, without the points of its plots.
fn numbers(found: &FileDiagnosis) -> String {
    let mut value = serde_json::to_value(&found.diagnosis).unwrap_or(Value::Null);
    value.as_object_mut().map(|fields| fields.remove("points"));
    value.to_string()
}

fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}
