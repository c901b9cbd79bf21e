//! Two folders of figure files, before and after a change that is not to change them.
//!
//! Rows are matched by file and name. Names, units, verdicts and integers are to be identical, instruction counts within
//! 1 %, other numbers within 1e-6 relative. Times, and what a search reaches in a given time, are left out. A row that is
//! missing after the change is a difference, a new one is not.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Context as _, Result, bail};

use crate::figure::{Figure, Figures};

/// Units of times, and of what depends on the machine.
const TIMES: [&str; 11] =
    ["ns", "us", "µs", "ms", "s", "min", "h", "of the time", "instructions/s", "MB of memory", "GiB of memory"];
/// Parts of names of rows that depend on how fast the machine is, whatever their unit.
const TIMED: [&str; 2] = [", the same time:", " over Pinocchio's"];
const INSTRUCTIONS: &str = "instructions";
const INSTRUCTIONS_REL: f64 = 1e-2;
const NUMBER_REL: f64 = 1e-6;

/// What was compared.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Comparison {
    /// Rows that agree.
    pub equal: usize,
    /// Rows that depend on time.
    pub left_out: usize,
    /// Rows and files that were not there before.
    pub new: usize,
    /// One line for each difference.
    pub differences: Vec<String>,
}

/// Compares the `*.json` files of two folders.
///
/// # Errors
///
/// A folder has no figures, or a file is not one of figures.
pub fn folders(before: &Path, after: &Path) -> Result<Comparison> {
    let (before, after) = (read(before)?, read(after)?);
    let mut comparison = Comparison::default();
    let names: BTreeSet<&String> = before.keys().chain(after.keys()).collect();
    for name in names {
        match (before.get(name), after.get(name)) {
            (Some(before), Some(after)) => comparison.file(name, before, after),
            (Some(_), None) => comparison.differences.push(format!("{name}: missing after")),
            (None, _) => comparison.new += 1,
        }
    }
    Ok(comparison)
}

fn read(folder: &Path) -> Result<BTreeMap<String, Figures>> {
    let mut files = BTreeMap::new();
    for entry in std::fs::read_dir(folder).with_context(|| format!("{} cannot be read", folder.display()))? {
        let path = entry?.path();
        if path.extension().is_some_and(|extension| extension == "json") {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            files.insert(name, Figures::read(&path)?);
        }
    }
    if files.is_empty() {
        bail!("{} has no *.json", folder.display());
    }
    Ok(files)
}

impl Comparison {
    fn file(&mut self, file: &str, before: &Figures, after: &Figures) {
        let old = self.by_name(file, "before", before);
        let new = self.by_name(file, "after", after);
        for name in old.keys().chain(new.keys()).collect::<BTreeSet<_>>() {
            match (old.get(name), new.get(name)) {
                (Some(old), Some(new)) => self.row(&format!("{file}: {name}"), old, new),
                (Some(old), None) => self.differences.push(format!("{file}: {:?} is missing after", old.name)),
                (None, _) => self.new += 1,
            }
        }
    }

    fn by_name<'f>(&mut self, file: &str, when: &str, figures: &'f Figures) -> BTreeMap<&'f str, &'f Figure> {
        let mut rows = BTreeMap::new();
        for row in &figures.rows {
            if rows.insert(row.name.as_str(), row).is_some() {
                self.differences.push(format!("{file}: two rows have the name {:?} {when}", row.name));
            }
        }
        rows
    }

    fn row(&mut self, name: &str, old: &Figure, new: &Figure) {
        if old.unit != new.unit {
            self.differences.push(format!("{name}: unit {:?} -> {:?}", old.unit, new.unit));
        } else if TIMES.contains(&old.unit.as_str()) || TIMED.iter().any(|part| name.contains(part)) {
            self.left_out += 1;
        } else if !agree(old.value, new.value, &old.unit) {
            self.differences.push(format!("{name}: {} -> {} {}", old.value, new.value, old.unit));
        } else if old.met != new.met {
            self.differences.push(format!("{name}: goal {} -> {}", verdict(old), verdict(new)));
        } else {
            self.equal += 1;
        }
    }
}

fn verdict(figure: &Figure) -> &'static str {
    match figure.met {
        Some(true) => "met",
        Some(false) => "missed",
        None => "not set",
    }
}

/// NaN agrees with nothing: it is a measurement that failed.
fn agree(old: f64, new: f64, unit: &str) -> bool {
    let within = |share: f64| (old - new).abs() <= share * old.abs().max(new.abs());
    if !old.is_finite() || !new.is_finite() {
        return false;
    }
    if unit == INSTRUCTIONS {
        within(INSTRUCTIONS_REL)
    } else if old.fract() == 0.0 && new.fract() == 0.0 {
        old == new
    } else {
        within(NUMBER_REL)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figure(name: &str, value: f64, unit: &str) -> Figure {
        Figure { name: name.into(), value, unit: unit.into(), goal: None, met: None }
    }

    fn rows(rows: &[(&str, f64, &str)]) -> Figures {
        Figures::new(rows.iter().map(|(name, value, unit)| figure(name, *value, unit)).collect(), 1)
    }

    fn compared(before: &[(&str, f64, &str)], after: &[(&str, f64, &str)]) -> Comparison {
        let mut comparison = Comparison::default();
        comparison.file("a.json", &rows(before), &rows(after));
        comparison
    }

    #[track_caller]
    fn differs(before: (&str, f64, &str), after: (&str, f64, &str), part: &str) {
        let found = compared(&[before], &[after]).differences;
        assert!(found.len() == 1 && found[0].contains(part), "{found:?}");
    }

    #[test]
    fn equal_rows_agree_whatever_their_order() {
        let found = compared(&[("a", 1.0, ""), ("b", 0.25, "mm")], &[("b", 0.25 + 1e-8, "mm"), ("a", 1.0, "")]);
        assert_eq!(found, Comparison { equal: 2, ..Comparison::default() });
    }

    #[test]
    fn numbers_counts_and_instructions_have_their_own_bounds() {
        differs(("a", 0.25, "mm"), ("a", 0.25 + 1e-6, "mm"), "0.25");
        differs(("a", 1e7, "words"), ("a", 1e7 + 1.0, "words"), "words");
        differs(("a", 6751.0, "instructions"), ("a", 6851.0, "instructions"), "6851");
        assert_eq!(compared(&[("a", 6751.0, "instructions")], &[("a", 6800.0, "instructions")]).equal, 1);
    }

    #[test]
    fn times_are_left_out_and_nothing_else_is() {
        let found = compared(
            &[("a", 1.0, "s"), ("b, the same time: error", 2.0, "cm")],
            &[("a", 9.0, "s"), ("b, the same time: error", 3.0, "cm")],
        );
        assert_eq!(found, Comparison { left_out: 2, ..Comparison::default() });
        differs(("a", 1.0, "m"), ("a", 2.0, "m"), "1 -> 2 m");
    }

    #[test]
    fn a_time_that_becomes_another_unit_is_a_difference() {
        differs(("a", 1.0, "s"), ("a", 1.0, "ms"), "unit \"s\" -> \"ms\"");
        differs(("a", 1.0, "s"), ("a", 1.0, ""), "unit");
    }

    #[test]
    fn what_is_not_a_number_agrees_with_nothing() {
        for value in [f64::NAN, f64::INFINITY] {
            differs(("a", value, ""), ("a", value, ""), "a.json: a");
            differs(("a", 1.0, ""), ("a", value, ""), "a.json: a");
        }
    }

    #[test]
    fn missing_and_doubled_rows_are_named() {
        let found = compared(&[("a", 1.0, ""), ("b", 1.0, "")], &[("a", 1.0, ""), ("a", 1.0, ""), ("c", 1.0, "")]);
        let expected = ["a.json: two rows have the name \"a\" after", "a.json: \"b\" is missing after"];
        assert_eq!(found.differences, expected);
        assert_eq!(found.new, 1);
    }

    #[test]
    fn another_verdict_is_a_difference() {
        let (mut old, mut new) = (rows(&[("a", 1.0, "")]), rows(&[("a", 1.0, "")]));
        (old.rows[0].met, new.rows[0].met) = (Some(true), Some(false));
        let mut comparison = Comparison::default();
        comparison.file("a.json", &old, &new);
        assert_eq!(comparison.differences, ["a.json: a: goal met -> missed"]);
    }

    #[test]
    fn missing_files_are_named_and_empty_folders_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let [before, after] = ["before", "after"].map(|name| folder.path().join(name));
        std::fs::create_dir(&before).unwrap();
        std::fs::create_dir(&after).unwrap();
        rows(&[("a", 1.0, "")]).write(&before.join("a.json")).unwrap();
        rows(&[("a", 1.0, "")]).write(&before.join("b.json")).unwrap();
        assert!(folders(&before, &after).is_err());
        rows(&[("a", 1.0, "")]).write(&after.join("a.json")).unwrap();
        let found = folders(&before, &after).unwrap();
        assert_eq!(found.differences, ["b.json: missing after"]);
        std::fs::write(after.join("b.json"), "{\"rows\": [{\"name\": \"a\"}]}").unwrap();
        assert!(folders(&before, &after).is_err());
    }
}
