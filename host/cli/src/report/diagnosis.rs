//! The page of a diagnosis: verdict and next action first, then what shows it, then the files.

use std::io;
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use darm_diagnose::outcome::Diagnosis;
use darm_diagnose::report::tables::tables_and_plots;
use maud::{Markup, html};
use sha2::{Digest as _, Sha256};

use super::skeleton::skeleton;

/// A file that a diagnosis has read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceFile {
    /// What it is: `model`, `measurements`.
    pub kind: &'static str,
    /// Its name, without its folder.
    pub name: String,
    /// SHA-256 of its bytes, in hexadecimal digits.
    pub digest: String,
}

impl SourceFile {
    /// Reads a file for its digest.
    ///
    /// # Errors
    ///
    /// The file cannot be read.
    pub fn read(kind: &'static str, path: &Path) -> io::Result<Self> {
        let digest = Sha256::digest(std::fs::read(path)?).iter().map(|byte| format!("{byte:02x}")).collect();
        Ok(Self { kind, name: path.file_name().unwrap_or_default().to_string_lossy().into_owned(), digest })
    }
}

/// The page of a diagnosis of these files, the model first, made at this time; `next` is what a person does next.
pub fn diagnosis_page(diagnosis: &Diagnosis, next: &str, files: &[SourceFile], at: SystemTime) -> Markup {
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
                (rows.train) " rows fitted, " (rows.held_out) " held out: " (diagnosis.held_out) "; cross-validated over "
                (diagnosis.left_out) "."
            }
        }
    }
}

/// Files with their digests.
pub(super) fn file_table(files: &[SourceFile]) -> Markup {
    html! {
        table.files {
            thead { tr { th { "file" } th { "name" } th { "SHA-256" } } }
            tbody { @for file in files { tr { td { (file.kind) } td { (file.name) } td { code { (file.digest) } } } } }
        }
    }
}

/// The day and minute in UTC, ISO 8601. Source of the calendar: H. Hinnant, chrono-Compatible Low-Level Date Algorithms,
/// `civil_from_days`.
pub(super) fn date(at: SystemTime) -> String {
    let seconds = at.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    let (days, minutes) = (seconds / 86_400 + 719_468, seconds % 86_400 / 60);
    let (era, of_era) = (days / 146_097, days % 146_097);
    let year_of_era = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let from_march = (5 * of_year + 2) / 153;
    let (day, month) =
        (of_year - (153 * from_march + 2) / 5 + 1, if from_march < 10 { from_march + 3 } else { from_march - 9 });
    let year = year_of_era + 400 * era + u64::from(month <= 2);
    format!("{year}-{month:02}-{day:02} {:02}:{:02} UTC", minutes / 60, minutes % 60)
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, UNIX_EPOCH};

    use super::date;

    /// `date -u -d @SECONDS` of GNU coreutils.
    #[test]
    fn dates_are_those_of_the_calendar() {
        let at = |seconds| date(UNIX_EPOCH + Duration::from_secs(seconds));
        assert_eq!(at(0), "1970-01-01 00:00 UTC");
        assert_eq!(at(951_827_696), "2000-02-29 12:34 UTC");
        assert_eq!(at(1_767_225_599), "2025-12-31 23:59 UTC");
        assert_eq!(at(4_107_542_400), "2100-03-01 00:00 UTC");
    }
}
