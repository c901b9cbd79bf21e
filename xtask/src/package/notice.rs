//! The notice of what others wrote: every package in the tool and its images, with its licence and its licence texts.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail};

use crate::shipped::{self, Package};

/// Name of the file.
const FILE: &str = "THIRD-PARTY.md";
/// Name of the notice of the standard library.
const LIBRARY: &str = "rust-std.COPYRIGHT.html";
/// How the names of files with licence texts begin, in lower case.
const BEGINNINGS: [&str; 6] = ["licen", "copying", "copyright", "notice", "unlicense", "authors"];
/// Longer files are no text that a person is to read.
const LONGEST: u64 = 1 << 20;

const INTRODUCTION: &str = "# Third-party notice\n\n\
    `darm` and the firmware images in it contain the packages below; crates that generate code (macros) are listed too.\n\
    The numbers are those of the licence texts that follow. Where a package has no text in its source, it is that of SPDX for\n\
    its licence, which has no line of copyright: the authors are named in the package's source.\n\n\
    What the standard library of Rust (`std`) contains is listed in `rust-std.COPYRIGHT.html`.\n\n\
    SQLite, which `libsqlite3-sys` contains, is in the public domain: <https://www.sqlite.org/copyright.html>.\n\n";

/// Writes the notice, and that of the standard library, to a folder.
///
/// # Errors
///
/// As [`text`], the toolchain has no notice of its library, or a file cannot be written.
pub(super) fn write(folder: &Path) -> Result<()> {
    let file = folder.join(FILE);
    fs::write(&file, text(&shipped::packages()?)?).with_context(|| format!("{} cannot be written", file.display()))?;
    let library = shipped::standard_library_notice()?;
    fs::copy(&library, folder.join(LIBRARY)).with_context(|| format!("{} cannot be copied", library.display()))?;
    Ok(())
}

/// The notice of some packages.
///
/// # Errors
///
/// A package has neither a licence text nor a licence that SPDX has the text of, or a text cannot be read.
pub fn text(packages: &BTreeSet<Package>) -> Result<String> {
    let mut texts = Texts::default();
    let mut notice = INTRODUCTION.to_owned();
    notice.push_str("| package | version | licence | source | texts |\n| --- | --- | --- | --- | --- |\n");
    for package in packages {
        let Package { name, version, licence, source, .. } = package;
        let numbers = texts.of(package)?;
        let source = package.repository.as_ref().unwrap_or(source);
        let _ = writeln!(notice, "| {name} | {version} | {licence} | <{source}> | {} |", listed(&numbers));
    }
    notice.push_str("\n## Source under the Mozilla Public License 2.0\n\n");
    for Package { name, version, source, .. } in packages.iter().filter(|it| needs_mpl(it)) {
        let _ = writeln!(
            notice,
            "- {name} {version} is used unchanged. Its source is at <{source}>, under the terms of the Mozilla Public License 2.0."
        );
    }
    notice.push_str("\n## Licence texts\n");
    for (number, text) in texts.ordered.iter().enumerate() {
        let _ = write!(notice, "\n### Text {}\n\n```text\n{text}\n```\n", number + 1);
    }
    Ok(notice)
}

fn listed(numbers: &BTreeSet<usize>) -> String {
    numbers.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")
}

/// Whether the MPL is the only licence, or one of those that are all required.
fn needs_mpl(package: &Package) -> bool {
    let is_other = |required: &spdx::LicenseReq| required.license.id().is_none_or(|id| id.name != "MPL-2.0");
    package.expression().is_ok_and(|expression| !expression.evaluate(is_other))
}

/// The licence texts, each once.
#[derive(Default)]
struct Texts {
    ordered: Vec<String>,
    numbers: BTreeMap<String, usize>,
}

impl Texts {
    /// The numbers of a package's texts, from 1: those in its source, else those that SPDX has of its licences. What a source has
    /// of the MPL may be the reference to its text alone.
    fn of(&mut self, package: &Package) -> Result<BTreeSet<usize>> {
        let mut texts = in_source(package)?;
        if texts.is_empty() || needs_mpl(package) {
            texts.extend(standard(package)?);
        }
        Ok(texts.into_iter().map(|text| self.number(text)).collect())
    }

    fn number(&mut self, text: String) -> usize {
        // The same text with other ends of lines and other empty lines around it is one text. A fence of the text itself would end
        // that of the notice.
        let lines: Vec<&str> = text.lines().map(str::trim_end).collect();
        let text = lines.join("\n").trim_matches('\n').replace("```", "'''");
        let next = self.ordered.len() + 1;
        let number = *self.numbers.entry(text.clone()).or_insert(next);
        if number == next {
            self.ordered.push(text);
        }
        number
    }
}

fn in_source(package: &Package) -> Result<Vec<String>> {
    let Some(folder) = &package.folder else { return Ok(Vec::new()) };
    let entries =
        fs::read_dir(folder).with_context(|| format!("{} of {} cannot be read", folder.display(), package.name))?;
    let mut files = BTreeSet::new();
    for entry in entries {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().to_lowercase();
        let is_named = BEGINNINGS.iter().any(|beginning| name.starts_with(beginning));
        // A page is for a browser; programs that look after licences begin with these words too.
        let is_text = !name.ends_with(".html") && !name.ends_with(".rs") && !name.ends_with(".toml");
        if is_named && is_text && entry.path().is_dir() {
            files.extend(fs::read_dir(entry.path())?.flatten().map(|it| it.path()));
        } else if is_named && is_text {
            files.insert(entry.path());
        }
    }
    files.extend(package.licence_file.iter().map(|file| folder.join(file)));
    let is_short = |file: &&Path| file.metadata().is_ok_and(|it| it.is_file() && it.len() <= LONGEST);
    let files = files.iter().map(|file| file.as_path()).filter(is_short);
    files
        .map(|file| {
            let bytes = fs::read(file).with_context(|| format!("{} cannot be read", file.display()))?;
            Ok(String::from_utf8_lossy(&bytes).into_owned())
        })
        .collect()
}

/// SPDX's texts of the licences of a package.
fn standard(package: &Package) -> Result<Vec<String>> {
    let expression = package.expression()?;
    let ids = expression.requirements().filter_map(|it| it.req.license.id());
    let texts: Vec<String> = ids.map(|id| id.text().to_owned()).collect();
    if texts.is_empty() {
        bail!("{} has no licence text in its source, and SPDX has none of {}", package.name, package.licence);
    }
    Ok(texts)
}
