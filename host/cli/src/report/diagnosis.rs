//! The page of a diagnosis.

use darm_diagnose::outcome::Diagnosis;
use darm_diagnose::report::tables::tables_and_plots;
use maud::{Markup, html};

use super::skeleton::skeleton;

/// The page of a diagnosis.
pub fn diagnosis_page(diagnosis: &Diagnosis) -> Markup {
    let body = html! {
        header {
            h1 { "Missing effects" }
            p.sub { (diagnosis.kind) " · " (diagnosis.verdict) " · held out: " (diagnosis.held_out) " · cross-validated over " (diagnosis.left_out) }
        }
        section {
            @for sentence in &diagnosis.plain { p { (sentence) } }
            (tables_and_plots(diagnosis))
        }
        @if !diagnosis.findings.is_empty() {
            section { h2 { "Notes on the data" } @for finding in &diagnosis.findings { p { (finding) } } }
        }
        footer {
            "darm " (diagnosis.version)
            @if let Some(model) = diagnosis.model { " · model " (model) }
            " · seed " (diagnosis.seed)
        }
    };
    skeleton(diagnosis.kind.as_str(), &body)
}
