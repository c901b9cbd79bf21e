//! Which column of a recording becomes which of ours, and in which unit its numbers are.
//!
//! An entry is `TARGET=SOURCE`, `TARGET=SOURCE*UNIT` or `TARGET=SOURCE*NUMBER`.
//!
//! | part | meaning |
//! | --- | --- |
//! | TARGET | name of one of our columns, ending in its unit: `q1_rad`, `time_s`, `Fx_n` |
//! | SOURCE | name of a column as `darm import FILE` lists it; the end of the name after `/`, or the name without its unit, where no other has it |
//! | | of a table without names the number of the column, from 1 |
//! | | of an array `name[:,3]` (from 0, as NumPy counts) or `name(:,4)` (from 1, as MATLAB counts): the same column |
//! | `*UNIT` | unit of the numbers in the file, where the file does not name it or names another |
//! | `*NUMBER` | a factor: `tau1_nm=current*-0.093` |
//! | `*` in both | each column that matches; in TARGET it is the matched text, and `#` is its number from 1: `q#_rad=q[:,*]` |

use std::str::FromStr;

use crate::import::recording::{Column, Part, Recording};
use crate::unit::{self, Unit};

/// Names that a message lists at most.
const MAX_NAMES: usize = 12;

/// What becomes of the numbers of a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scale {
    /// They are in the unit that the file names, or in that of the target.
    OfFile,
    /// They are in this unit.
    In(Unit),
    /// They are multiplied by this.
    Times(f64),
}

/// One column of the result.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Its name.
    pub target: String,
    /// The column of the recording.
    pub source: String,
    /// What becomes of its numbers.
    pub scale: Scale,
    /// Where the entry was written: an option, or a place in a file.
    pub origin: String,
}

/// The columns of the result, in order, and units of columns of the recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mapping {
    /// The columns.
    pub entries: Vec<Entry>,
    /// Patterns of names and the unit of the columns that match; the first counts.
    pub units: Vec<(String, Unit)>,
    /// Numbers that mean a missing value, as the file has them.
    pub missing: Vec<f64>,
}

/// A column of the result found in a recording.
pub(crate) struct Found<'a> {
    pub(crate) target: String,
    pub(crate) part: &'a Part,
    pub(crate) column: &'a Column,
    pub(crate) scale: Scale,
    pub(crate) origin: &'a str,
}

impl FromStr for Entry {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let Some((target, source)) = text.split_once('=') else {
            return Err(format!("`{text}`: write TARGET=SOURCE, such as q1_deg=angle"));
        };
        Self::new(target, source, &format!("`{text}`"))
    }
}

impl Entry {
    /// An entry that was written at `origin`; `source` may end in a unit or factor.
    ///
    /// # Errors
    ///
    /// An empty name, or a `*` in the target alone.
    pub fn new(target: &str, source: &str, origin: &str) -> Result<Self, String> {
        let (target, source) = (target.trim(), source.trim());
        let scaled = source.rsplit_once('*').and_then(|(name, end)| Some((name.trim_end(), scale(end)?)));
        let (name, scale) = scaled.filter(|(name, _)| !name.is_empty()).unwrap_or((source, Scale::OfFile));
        if target.is_empty() || name.is_empty() {
            return Err(format!("{origin}: write TARGET=SOURCE, such as q1_deg=angle"));
        }
        if target.contains([',', '"', '\n']) {
            return Err(format!("{origin}: the target `{target}` has a character that no column can have"));
        }
        if target.contains(['*', '#']) && !name.contains('*') {
            return Err(format!("{origin}: `*` and `#` in the target need a `*` in the source, such as q#_rad=q[:,*]"));
        }
        Ok(Self { target: target.into(), source: name.into(), scale, origin: origin.into() })
    }
}

fn scale(text: &str) -> Option<Scale> {
    let text = text.trim();
    let number = text.parse().ok().filter(|number: &f64| number.is_finite()).map(Scale::Times);
    number.or_else(|| Unit::named(text).map(Scale::In))
}

impl Mapping {
    /// The columns of the result in a recording, in order.
    pub(crate) fn resolve<'a>(&'a self, recording: &'a Recording) -> Result<Vec<Found<'a>>, String> {
        let mut all: Vec<Found<'a>> = Vec::new();
        for entry in &self.entries {
            let found = |target, (part, column)| {
                let scale = self.scale(entry, column);
                Found { target, part, column, scale, origin: &entry.origin }
            };
            if entry.source.contains('*') {
                let pattern = canonical(&entry.source);
                let matching = columns(recording)
                    .filter_map(|(part, column)| Some((matched(&pattern, &column.name)?.to_owned(), (part, column))));
                let before = all.len();
                all.extend(matching.enumerate().map(|(k, (text, place))| {
                    found(entry.target.replace('*', &text).replace('#', &(k + 1).to_string()), place)
                }));
                if all.len() == before {
                    return Err(format!("{}: no column matches; {}", entry.origin, listed(recording)));
                }
            } else {
                let place = find(recording, &entry.source).map_err(|text| format!("{}: {text}", entry.origin))?;
                all.push(found(entry.target.clone(), place));
            }
        }
        for (k, one) in all.iter().enumerate() {
            if all[..k].iter().any(|other| other.target == one.target) {
                return Err(format!("{}: the target {} is given twice: use another name", one.origin, one.target));
            }
        }
        Ok(all)
    }

    fn scale(&self, entry: &Entry, column: &Column) -> Scale {
        let given =
            || self.units.iter().find(|(pattern, _)| is_meant(pattern, &column.name)).map(|(_, unit)| Scale::In(*unit));
        match entry.scale {
            Scale::OfFile => given().unwrap_or(Scale::OfFile),
            scale => scale,
        }
    }

    /// The unit that the mapping or the file gives a column.
    pub fn unit_of(&self, column: &Column) -> Option<Unit> {
        let given = self.units.iter().find(|(pattern, _)| is_meant(pattern, &column.name)).map(|(_, unit)| *unit);
        given.or_else(|| Unit::named(column.unit.as_deref()?))
    }
}

fn is_meant(pattern: &str, name: &str) -> bool {
    let tail = name.rsplit_once('/').map_or(name, |(_, tail)| tail);
    [name, tail, unit::split(name).0].iter().any(|name| matched(pattern, name).is_some()) || canonical(pattern) == name
}

/// The text that the `*` of a pattern matches; empty of a pattern without one that is the name.
fn matched<'a>(pattern: &str, name: &'a str) -> Option<&'a str> {
    let Some((start, end)) = pattern.split_once('*') else { return (pattern == name).then_some("") };
    let tail = || name.rsplit_once('/').and_then(|(_, tail)| tail.strip_prefix(start)?.strip_suffix(end));
    let text = name.strip_prefix(start).and_then(|rest| rest.strip_suffix(end)).or_else(tail)?;
    (!text.is_empty()).then_some(text)
}

fn columns(recording: &Recording) -> impl Iterator<Item = (&Part, &Column)> {
    recording.parts.iter().flat_map(|part| part.columns.iter().map(move |column| (part, column)))
}

/// A column by its name, the end of its name, its name without a unit, or its number.
fn find<'a>(recording: &'a Recording, name: &str) -> Result<(&'a Part, &'a Column), String> {
    let canonical = canonical(name);
    let tail = format!("/{}", canonical.trim_start_matches('/'));
    let ways: [&dyn Fn(&Column) -> bool; 3] =
        [&|column| column.name == canonical, &|column| column.name.ends_with(&tail), &|column| {
            unit::split(&column.name).0 == canonical
        }];
    for is_meant in ways {
        let mut found = columns(recording).filter(|(_, column)| is_meant(column));
        match (found.next(), found.next()) {
            (Some(_), Some(_)) => return Err(several(recording, name, is_meant)),
            (Some(one), None) => return Ok(one),
            _ => {}
        }
    }
    let table = recording.parts.first().filter(|part| part.is_text_table() && recording.parts.len() == 1);
    let numbered =
        name.parse::<usize>().ok().and_then(|number| Some((table?, table?.columns.get(number.checked_sub(1)?)?)));
    numbered.ok_or_else(|| format!("no column `{name}`; {}", listed(recording)))
}

/// `name[:,3]` for `name(:,4)`, `name[3,:]` for `name(4,:)`: names of columns count from 0.
fn canonical(name: &str) -> String {
    let indices = name.strip_suffix(')').and_then(|rest| rest.rsplit_once('('));
    let counted = |index: &str| match index.trim() {
        open @ (":" | "*") => Some(open.to_owned()),
        number => Some((number.parse::<usize>().ok()?.checked_sub(1)?).to_string()),
    };
    let found = indices.and_then(|(array, indices)| {
        let (row, column) = indices.split_once(',')?;
        (row.trim() == ":" || column.trim() == ":").then_some(())?;
        Some(format!("{array}[{},{}]", counted(row)?, counted(column)?))
    });
    found.unwrap_or_else(|| name.replace("[: ,", "[:,").replace("[:, ", "[:,"))
}

fn several(recording: &Recording, name: &str, is_meant: &dyn Fn(&Column) -> bool) -> String {
    let all = columns(recording).enumerate().filter(|(_, (_, column))| is_meant(column));
    let (numbers, names): (Vec<String>, Vec<String>) =
        all.map(|(k, (_, column))| ((k + 1).to_string(), column.name.clone())).unzip();
    if names.iter().all(|other| *other == names[0]) {
        return format!(
            "columns {} are all called `{name}`: give the number of the one that is meant",
            numbers.join(", ")
        );
    }
    format!("`{name}` may be {}: give the full name", names.join(" or "))
}

fn listed(recording: &Recording) -> String {
    let names: Vec<&str> = columns(recording).map(|(_, column)| column.name.as_str()).collect();
    let more = if names.len() > MAX_NAMES { format!(" and {} more", names.len() - MAX_NAMES) } else { String::new() };
    format!("the recording has {}{more}", names[..names.len().min(MAX_NAMES)].join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_have_units_and_factors() {
        let entry = |text: &str| text.parse::<Entry>().unwrap();
        let deg = Unit::named("deg").unwrap();
        assert_eq!(
            (entry("q1_rad=Var3*deg").source.as_str(), entry("q1_rad=Var3*deg").scale),
            ("Var3", Scale::In(deg))
        );
        assert_eq!(entry("tau1_nm = current * -0.5").scale, Scale::Times(-0.5));
        assert_eq!(entry("q1_deg=joint_1 position [deg]").source, "joint_1 position [deg]");
        assert_eq!((entry("q#_rad=q[:,*]").source.as_str(), entry("q#_rad=q[:,*]").scale), ("q[:,*]", Scale::OfFile));
        assert_eq!((entry("q#_rad=q_**deg").source.as_str(), entry("q#_rad=q_**deg").scale), ("q_*", Scale::In(deg)));
        for wrong in ["q1", "=a", "a=", "q*=a", "a,b=c"] {
            assert!(wrong.parse::<Entry>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn columns_are_found_by_several_names() {
        let column = |name: &str| Column::of_numbers(name, vec![0.0]);
        let names = ["/a/x", "/b/x", "/b/y", "q[:,0]", "q[:,1]", "Time [s]", "twice", "twice"];
        let part = Part { kind: "table".into(), columns: names.map(column).into(), lines: vec![2], ..Part::default() };
        let recording = Recording { parts: vec![part], ..Recording::default() };
        let name = |text: &str| find(&recording, text).map(|(_, column)| column.name.clone());
        for (text, full) in [
            ("y", "/b/y"),
            ("b/x", "/b/x"),
            ("q(:,2)", "q[:,1]"),
            ("q[:, 0]", "q[:,0]"),
            ("Time", "Time [s]"),
            ("2", "/b/x"),
        ] {
            assert_eq!(name(text).as_deref(), Ok(full), "{text}");
        }
        assert!(name("x").unwrap_err().contains("/a/x or /b/x"));
        assert!(name("twice").unwrap_err().contains("columns 7, 8"));
        assert!(name("z").unwrap_err().contains("the recording has /a/x"));
        let mapping = Mapping { entries: vec!["q#_*=q[:,*]".parse().unwrap()], ..Mapping::default() };
        let found: Vec<String> = mapping.resolve(&recording).unwrap().into_iter().map(|found| found.target).collect();
        assert_eq!(found, ["q1_0", "q2_1"]);
    }
}
