//! The frame of all self-contained HTML pages, and the parts that they share: files with their digests, dates.

use std::io;
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use maud::{DOCTYPE, Markup, PreEscaped, html};
use sha2::{Digest as _, Sha256};

use super::palette::{BLUE, GREEN, GRID, GROUND, INK, MUTED, ORANGE, PALE, PAPER, RED};

/// The palette as variables of the style sheet.
fn colors() -> String {
    format!(
        ":root {{ --ink: {INK}; --muted: {MUTED}; --pale: {PALE}; --line: {GRID}; --ground: {GROUND}; --paper: {PAPER}; \
         --before: {ORANGE}; --after: {BLUE}; --good: {GREEN}; --bad: {RED}; }}\n"
    )
}

/// A self-contained page: `title` is that of the window, `body` its content.
pub fn skeleton(title: &str, body: &Markup) -> Markup {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { "darm: " (title) }
                style { (PreEscaped(colors())) (PreEscaped(include_str!("page/style.css"))) }
            }
            body { main { (body) } script { (PreEscaped(include_str!("page/page.js"))) } }
        }
    }
}

/// A page with these sections.
pub fn page(title: &str, body: &Markup) -> String {
    let body = html! { header { h1 { (title) } } (body) footer { "darm " (env!("CARGO_PKG_VERSION")) } };
    skeleton(title, &body).into_string()
}

/// A page of preformatted text.
pub fn plain_page(title: &str, text: &str) -> String {
    page(title, &html! { section { pre { (text) } } })
}

/// A file that a page is made from.
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

/// Files with their digests.
pub fn file_table(files: &[SourceFile]) -> Markup {
    html! {
        table.files {
            thead { tr { th { "file" } th { "name" } th { "SHA-256" } } }
            tbody { @for file in files { tr { td { (file.kind) } td { (file.name) } td { code { (file.digest) } } } } }
        }
    }
}

/// The day and minute in UTC, ISO 8601. Source of the calendar: H. Hinnant, chrono-Compatible Low-Level Date Algorithms,
/// `civil_from_days`.
pub fn date(at: SystemTime) -> String {
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
