//! A mapping as a file.
//!
//! ```toml
//! missing = [-9999]              # numbers that mean a missing value
//!
//! [columns]                      # TARGET = "SOURCE", as on the command line
//! time_s = "Time (ms)"
//! "q#_rad" = "q[:,*]*deg"
//!
//! [units]                        # of columns of the recording that the file does not name or names wrongly
//! "position.slider" = "m"
//! ```

use std::collections::BTreeMap;
use std::path::Path;

use darm_robot::source::{FileError, Place, Source};
use serde::Deserialize;
use toml::Spanned;

use crate::import::mapping::{Entry, Mapping, Scale};
use crate::unit::Unit;

/// Why a file gives no mapping: with file, line and column.
pub type MapFileError = FileError<String>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    #[serde(default)]
    missing: Vec<f64>,
    #[serde(default)]
    columns: BTreeMap<Spanned<String>, Spanned<String>>,
    #[serde(default)]
    units: BTreeMap<Spanned<String>, Spanned<String>>,
}

/// Reads a mapping; its columns are in the order of the file.
///
/// # Errors
///
/// A file that cannot be read, an unknown key or unit, or an entry that makes no sense.
pub fn read(path: &Path) -> Result<Mapping, MapFileError> {
    parse(&Source::read(path)?, path)
}

/// The mapping of a text; `path` only serves messages.
///
/// # Errors
///
/// The text is not TOML of this form, or a quantity, column or unit in it is unknown. The error names line and column.
pub fn parse(source: &Source, path: &Path) -> Result<Mapping, MapFileError> {
    let raw: Raw = source.parse()?;
    let mut columns: Vec<_> = raw.columns.into_iter().collect();
    columns.sort_by_key(|(target, _)| target.span().start);
    let mut mapping = Mapping { missing: raw.missing, ..Mapping::default() };
    for (target, value) in &columns {
        let wrong = |text: String| source.wrong(value.span(), text);
        let place = wrong(String::new()).place.unwrap_or(Place { line: 1, column: 1 });
        let origin = format!("{}:{}:{}: {}", path.display(), place.line, place.column, target.get_ref());
        let entry = Entry::new(target.get_ref(), value.get_ref(), target.get_ref()).map_err(wrong)?;
        mapping.entries.push(Entry { origin, ..entry });
    }
    for (pattern, unit) in raw.units {
        let known = Unit::named(unit.get_ref()).ok_or_else(|| {
            source.wrong(
                unit.span(),
                format!("the unit `{}` is unknown: use one such as deg, rad, mm, N, N·m, bar, ms", unit.get_ref()),
            )
        })?;
        mapping.units.push((pattern.into_inner(), known));
    }
    Ok(mapping)
}

/// The text of a mapping that [`parse`] reads.
pub fn text(mapping: &Mapping) -> String {
    let quoted = |text: &str| toml::Value::String(text.to_owned()).to_string();
    let entry = |entry: &Entry| format!("{} = {}\n", quoted(&entry.target), quoted(&entry.expression()));
    let columns: String = mapping.entries.iter().map(entry).collect();
    let units: String =
        mapping.units.iter().map(|(name, unit)| format!("{} = {}\n", quoted(name), quoted(unit.name))).collect();
    let units = if units.is_empty() { units } else { format!("\n[units]\n{units}") };
    let missing =
        if mapping.missing.is_empty() { String::new() } else { format!("missing = {:?}\n\n", mapping.missing) };
    format!("{missing}[columns]\n{columns}{units}")
}

impl Entry {
    /// The source with its unit or factor, as it is written.
    pub fn expression(&self) -> String {
        match self.scale {
            Scale::OfFile => self.source.clone(),
            Scale::In(unit) => format!("{}*{}", self.source, unit.name),
            Scale::Times(factor) => format!("{}*{factor}", self.source),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Result<Mapping, String> {
        let path = Path::new("map.toml");
        parse(&Source::of_text(path, text), path).map_err(|error| error.to_string())
    }

    #[test]
    fn a_mapping_comes_back_in_its_order() {
        let text = "missing = [-9999.0, 1e30]\n\n[columns]\n\"time_s\" = \"t\"\n\"q#_rad\" = \"q[:,*]*deg\"\n\"a\" = \"b\"\n\n[units]\n\"x\" = \"mm\"\n";
        let mapping = parsed(text).unwrap();
        assert_eq!(
            mapping.entries.iter().map(|entry| entry.target.as_str()).collect::<Vec<_>>(),
            ["time_s", "q#_rad", "a"]
        );
        assert_eq!(super::text(&mapping), text);
    }

    #[test]
    fn faults_have_line_and_column() {
        for (text, expected) in [
            ("[columns]\nq1 = 5\n", "map.toml:2:6: "),
            ("[columns]\n'q*' = 'a'\n", "map.toml:2:8: q*: `*` and `#`"),
            ("[units]\na = 'parsec'\n", "map.toml:2:5: the unit `parsec` is unknown"),
            ("[column]\n", "map.toml:1:2: unknown field"),
        ] {
            let error = parsed(text).unwrap_err();
            assert!(error.starts_with(expected), "{error}");
        }
    }
}
