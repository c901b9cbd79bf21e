//! The page of a diagnosis: verdict and next action first, then what shows it, then the files.

use std::time::SystemTime;

use darm_arm::draw::page::{SourceFile, date, file_table, skeleton};
use darm_diagnose::outcome::Diagnosis;
use darm_diagnose::report::tables::tables_and_plots;
use maud::{Markup, html};

/// The page of a diagnosis of these files, the model first, made at this time; `next` is what a person does next.
pub(crate) fn diagnosis_page(diagnosis: &Diagnosis, next: &str, files: &[SourceFile], at: SystemTime) -> Markup {
    let name = files.first().map_or(diagnosis.kind.as_str(), |file| file.name.as_str());
    let body = html! {
        header {
            h1 { "Diagnosis of " (name) }
            p.sub { (diagnosis.kind) @if let Some(model) = diagnosis.model { " · model " (model) } " · " (date(at)) }
        }
        (verdict(diagnosis, next))
        section { h2 { "Evidence" } (tables_and_plots(diagnosis)) }
        @if !diagnosis.findings.is_empty() {
            section { h2 { "Notes on the data" } @for finding in &diagnosis.findings { p { (finding) } } }
        }
        (sources(diagnosis, files))
        footer { "darm " (diagnosis.version) " · seed " (diagnosis.seed) }
    };
    skeleton(name, &body)
}

fn verdict(diagnosis: &Diagnosis, next: &str) -> Markup {
    let (verdict, others) = match &diagnosis.plain[..] {
        [verdict, others @ ..] => (verdict.as_str(), others),
        [] => ("", &[][..]),
    };
    html! {
        section {
            h2 { (verdict) }
            p.next { b { "Next: " } (next) }
            @for sentence in others { p { (sentence) } }
        }
    }
}

/// What was read, and how its rows were used.
fn sources(diagnosis: &Diagnosis, files: &[SourceFile]) -> Markup {
    let rows = &diagnosis.rows;
    html! {
        section {
            h2 { "Files" }
            (file_table(files))
            p {
                (rows.train) " rows fitted, " (rows.held_out) " " (diagnosis.unseen()) ": " (diagnosis.held_out) "; cross-validated over "
                (diagnosis.left_out) "."
            }
        }
    }
}
