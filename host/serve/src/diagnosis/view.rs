//! A finished diagnosis as pages show it.

use darm_diagnose::files::FileDiagnosis;
use darm_diagnose::outcome::{Diagnosis, Verdict};
use darm_diagnose::report::tables::{sampling_table, tables_and_plots};
use darm_measure::Finding;
use maud::{Markup, html};
use serde::Serialize;

use super::sources::Sources;

/// Notes on rows that are listed.
const MAX_NOTES: usize = 20;

/// A result.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct ResultView {
    /// Name of the model's file.
    model: String,
    /// Name of the file of measurements.
    data: String,
    verdict: Verdict,
    /// The report, as a part of a page.
    html: String,
    /// The corrected model; `None` where there is nothing to correct.
    pub(super) corrected: Option<Corrected>,
    /// Number of the result on this server.
    number: u64,
    /// Words that distinguish the candidates, of an arm without servos.
    n_words: usize,
    /// Whether a measurement plan can be made: the model is an arm of words.
    has_plan: bool,
}

/// The file of a corrected model.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Corrected {
    /// Number of the model.
    pub(super) number: u64,
    /// Name of the file.
    pub(super) name: String,
    /// Its text.
    pub(super) text: String,
}

impl Corrected {
    /// `arm.toml` and `arm-3.toml` are followed by `arm-4.toml` where the new model has the number 4.
    pub(crate) fn new(model: &str, number: u64, text: String) -> Self {
        let stem = model.rsplit_once('.').map_or(model, |(stem, _)| stem);
        let is_number = |end: &str| !end.is_empty() && end.bytes().all(|byte| byte.is_ascii_digit());
        let stem = stem.rsplit_once('-').filter(|(_, end)| is_number(end)).map_or(stem, |(stem, _)| stem);
        Self { number, name: format!("{stem}-{number}.toml"), text }
    }
}

impl ResultView {
    pub(super) fn new(sources: &Sources<'_>, found: &FileDiagnosis, corrected: Option<Corrected>, number: u64) -> Self {
        let (diagnosis, arm) = (&found.diagnosis, found.arm());
        let n_words = diagnosis.next_measurement.as_ref().map_or(0, |next| next.words.len());
        Self {
            model: sources.model.clone(),
            data: sources.upload.data.clone(),
            verdict: diagnosis.verdict,
            html: report(diagnosis).into_string(),
            number,
            n_words: arm.filter(|arm| arm.n_servos() == 0).map_or(0, |_| n_words),
            has_plan: arm.is_some(),
            corrected,
        }
    }
}

fn report(diagnosis: &Diagnosis) -> Markup {
    let (verdict, others) = match &diagnosis.plain[..] {
        [verdict, others @ ..] => (verdict.as_str(), others),
        [] => ("", &[][..]),
    };
    html! {
        section #verdict-section tabindex="-1" aria-labelledby="verdict-title" data-verdict=(diagnosis.verdict) {
            h2 #verdict-title { "Verdict" }
            p.verdict { (verdict) }
            p.next { b { "Next: " } (diagnosis.next_step()) }
            @for sentence in others { p { (sentence) } }
        }
        section aria-labelledby="sampling-title" {
            h2 #sampling-title { "Measurements" }
            (sampling_table(diagnosis))
            (notes(&diagnosis.findings))
        }
        section.report aria-labelledby="evidence-title" {
            h2 #evidence-title { "Evidence" }
            (tables_and_plots(diagnosis))
            p.note { "darm " (diagnosis.version) ", seed " (diagnosis.seed) "; `darm diagnose` has more options for rows and columns." }
        }
    }
}

fn notes(findings: &[Finding]) -> Markup {
    html! {
        @if !findings.is_empty() {
            h3 { "Notes" }
            ul.notes { @for finding in findings.iter().take(MAX_NOTES) { li { (finding) } } }
            @if findings.len() > MAX_NOTES { p { "and " (findings.len() - MAX_NOTES) " more" } }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Corrected;

    #[test]
    fn a_corrected_model_is_named_by_its_number() {
        let name = |model: &str| Corrected::new(model, 4, String::new()).name;
        assert_eq!(
            ["arm.toml", "arm-3.toml", "my-arm.toml", "robot.urdf", "arm"].map(name),
            ["arm-4.toml", "arm-4.toml", "my-arm-4.toml", "robot-4.toml", "arm-4.toml"]
        );
    }
}
