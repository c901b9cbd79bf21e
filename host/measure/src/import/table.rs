//! The table that a mapping makes of recordings: parts joined, units converted, files appended.

use crate::csv_text::csv_text;
use crate::log::FIRST_ROW;

use crate::import::error::{ImportError, Where};
use crate::import::join;
use crate::import::mapping::{Found, Mapping, Scale};
use crate::import::recording::{Part, Recording};
use crate::unit::Unit;

/// A table of measurements.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// Comment lines before it: keys and values.
    pub about: Vec<(String, String)>,
    /// Names of the columns.
    pub names: Vec<String>,
    /// Cells, row by row; a missing value is empty.
    pub rows: Vec<Vec<String>>,
    /// What its owner should know.
    pub notes: Vec<String>,
}

/// Columns that number and name appended files.
const FILES: [&str; 2] = ["run", "file"];

impl Table {
    /// Makes the table; several recordings follow each other, with their number in the column `run` and their name in `file`.
    ///
    /// # Errors
    ///
    /// A mapping that does not fit a recording, parts that cannot be joined, a text where a number is needed.
    pub fn new(recordings: &[Recording], mapping: &Mapping) -> Result<Self, ImportError> {
        let mut all = Self::default();
        for (run, recording) in recordings.iter().enumerate() {
            let one = Self::of_one(recording, mapping)?;
            let mut names = one.names;
            let extra = if recordings.len() > 1 { &FILES[..] } else { &[] };
            if let Some(name) = names.iter().find(|name| extra.contains(&name.as_str())) {
                let text = format!("the target {name} is the number or the name of the file where several are given");
                return Err(ImportError::new(&recording.path, "", text));
            }
            names.extend(extra.iter().map(|name| (*name).to_owned()));
            if run > 0 && names != all.names {
                let text =
                    format!("its columns are {}, those of the first file {}", names.join(", "), all.names.join(", "));
                return Err(ImportError::new(&recording.path, "", text));
            }
            let file = recording.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let own = [run.to_string(), file];
            all.rows.extend(one.rows.into_iter().map(|mut row| {
                row.extend(own.iter().take(extra.len()).cloned());
                row
            }));
            (all.names, all.about) = (names, if run == 0 { one.about } else { all.about });
            let path = recording.path.display();
            let named = |note: String| if recordings.len() > 1 { format!("{path}: {note}") } else { note };
            all.notes.extend(one.notes.into_iter().map(named));
        }
        Ok(all)
    }

    fn of_one(recording: &Recording, mapping: &Mapping) -> Result<Self, ImportError> {
        let fault = |place: Where, text: String| ImportError::new(&recording.path, place, text);
        let found = mapping.resolve(recording).map_err(|text| fault(Where::File, text))?;
        let is_time = |found: &&Found| Unit::of_target(&found.target).is_some_and(|unit| unit.dimension() == "time");
        let Some(base) = found.iter().find(is_time).or(found.first()).map(|found| found.part) else {
            let unread = recording.parts.iter().filter(|part| part.columns.is_empty()).map(described);
            let text = match unread.collect::<Vec<_>>() {
                unread if unread.is_empty() => "nothing is mapped: give --column TARGET=SOURCE".into(),
                unread => format!("nothing in it is read: {}; record or save it in another form", unread.join(", ")),
            };
            return Err(fault(Where::File, text));
        };
        let n = base.n_rows();
        if n == 0 {
            return Err(fault(base.shown().into(), "no rows".into()));
        }
        let mut notes = recording.notes.clone();
        let mut columns = Vec::with_capacity(found.len());
        for one in &found {
            let cells = converted(one, &mut notes).and_then(|cells| joined(cells, one, base));
            columns.push(cells.map_err(|(place, text)| fault(place, format!("{}: {text}", one.origin)))?);
        }
        notes.extend(missing(&found, base, &columns));
        let row = |row: usize| columns.iter().map(|cells| cells.text(row)).collect();
        let mut about = vec![("source".to_owned(), recording.path.display().to_string())];
        if let Some(stamp) = base.epoch_ns.as_ref().or(base.stamps_ns.first()).filter(|stamp| **stamp > 0) {
            let (seconds, rest) = (stamp / 1_000_000_000, stamp % 1_000_000_000);
            about.push((FIRST_ROW.to_owned(), format!("{seconds}.{rest:09}")));
        }
        let names = found.iter().map(|found| found.target.clone()).collect();
        Ok(Self { about, names, rows: (0..n).map(row).collect(), notes })
    }

    /// The parts of a recording from which a mapping takes nothing, in one sentence.
    pub fn left_out(recording: &Recording, mapping: &Mapping) -> Option<String> {
        let is_taken = |part: &&Part| {
            part.columns.iter().any(|column| mapping.entries.iter().any(|entry| entry.source == column.name))
        };
        let parts: Vec<String> = recording.parts.iter().filter(|part| !is_taken(part)).map(described).collect();
        (!parts.is_empty()).then(|| format!("not in the table: {}", parts.join(", ")))
    }

    /// The table as comma-separated text, after its comment lines.
    pub fn text(&self) -> String {
        let about: String = self.about.iter().map(|(key, value)| format!("# {key} {value}\n")).collect();
        about + &csv_text(std::iter::once(&self.names).chain(&self.rows))
    }
}

/// A part and its kind.
pub(crate) fn described(part: &Part) -> String {
    format!("{} ({})", part.shown(), part.kind)
}

/// Cells of a column: numbers, or the texts that a file has.
enum Cells {
    Numbers(Vec<f64>),
    Texts(Vec<String>),
}

impl Cells {
    fn text(&self, row: usize) -> String {
        match self {
            Self::Numbers(numbers) => number_text(numbers[row]),
            Self::Texts(texts) => texts[row].clone(),
        }
    }

    fn is_missing(&self, row: usize) -> bool {
        match self {
            Self::Numbers(numbers) => numbers[row].is_nan(),
            Self::Texts(texts) => texts[row].is_empty(),
        }
    }
}

/// The shortest text that reads as the same number; empty of NaN.
fn number_text(number: f64) -> String {
    let size = number.abs();
    match number {
        _ if number.is_nan() => String::new(),
        _ if size == 0.0 || (1e-5..1e15).contains(&size) => number.to_string(),
        _ => format!("{number:?}"),
    }
}

/// A place and a fault.
type Wrong = (Where, String);

/// The cells of a column in the unit of its target.
fn converted(found: &Found, notes: &mut Vec<String>) -> Result<Cells, Wrong> {
    let Found { column, scale, .. } = found;
    let target = Unit::of_target(&found.target);
    let of_file = || Unit::named(column.unit.as_deref()?);
    let source = match scale {
        Scale::In(unit) => Some(*unit),
        Scale::OfFile => of_file(),
        Scale::Times(_) => None,
    };
    let (factor, offset) = match (scale, target, source) {
        (Scale::Times(factor), ..) => (*factor, 0.0),
        (Scale::In(unit), None, _) => {
            let text = format!(
                "{} ends in no unit, so {} cannot be converted: name it {}_{}",
                found.target,
                unit.name,
                found.target,
                unit.written().name
            );
            return Err((Where::File, text));
        }
        (_, None, _) if !column.texts.is_empty() => {
            return Ok(Cells::Texts(column.texts.iter().map(|text| trimmed(text)).collect()));
        }
        (_, None, _) => (1.0, 0.0),
        (_, Some(target), Some(source)) => source.conversion(target).ok_or_else(|| {
            let [a, b] = [source, target].map(|unit| format!("{} ({})", unit.name, unit.dimension()));
            let cure = if *scale == Scale::OfFile {
                format!("; if the file is wrong, write {}*UNIT", column.name)
            } else {
                String::new()
            };
            (Where::File, format!("{a} does not convert to {b}{cure}"))
        })?,
        (_, Some(target), None) => {
            if target.dimension() != "count" {
                notes.push(format!(
                    "{}: its unit is not in the file; its numbers are read in the unit of {}",
                    column.name, found.target
                ));
            }
            (1.0, 0.0)
        }
    };
    if let Some((row, text)) = column.first_text() {
        let numbered = || Where::Part(format!("row {}", row + 1));
        let place = found.part.lines.get(row).map_or_else(numbered, |line| Where::Line(*line));
        let stray = column.stray().len();
        if stray == 0 {
            let text = format!(
                "column {} holds `{text}`, expected a number; correct the cell or map another column",
                column.name
            );
            return Err((place, text));
        }
        let n = column.n_values();
        notes.push(format!(
            "{}: {stray} of {n} cells, such as `{text}`, are no numbers, and are left empty",
            column.name
        ));
    }
    if let Some((code, n, [low, high])) = column.code() {
        notes.push(format!(
            "{}: {n} numbers are {code}, far from the others, {low} to {high}; where that means a missing value, `darm import \
             --missing={code}` leaves it out",
            column.name
        ));
    }
    if (factor, offset) == (1.0, 0.0) {
        return Ok(Cells::Numbers(column.numbers.clone()));
    }
    // A division keeps the digits that a factor below one would lose: 1500 ms are 1.5 s.
    let inverse = (1.0 / factor).round();
    let exact = factor < 1.0 && ((1.0 / factor) - inverse).abs() < 1e-9 * inverse;
    let number = |x: &f64| if exact { x / inverse + offset } else { x * factor + offset };
    Ok(Cells::Numbers(column.numbers.iter().map(number).collect()))
}

fn trimmed(text: &str) -> String {
    if crate::import::recording::is_missing(text) { String::new() } else { text.trim().to_owned() }
}

/// Cells on the rows of the base part.
fn joined(cells: Cells, found: &Found, base: &Part) -> Result<Cells, Wrong> {
    let part = found.part;
    if std::ptr::eq(part, base)
        || (part.stamps_ns.is_empty() && base.stamps_ns.is_empty() && part.n_rows() == base.n_rows())
    {
        return Ok(cells);
    }
    let both = format!("{} has {} rows, {} has {}", part.shown(), part.n_rows(), base.shown(), base.n_rows());
    if part.stamps_ns.is_empty() && base.stamps_ns.is_empty() {
        return Err((
            part.shown().into(),
            format!("{both}: arrays are joined row by row, map only those of one length"),
        ));
    }
    if part.stamps_ns.is_empty() || base.stamps_ns.is_empty() {
        return Err((
            part.shown().into(),
            format!("{both}, and one of them has no time stamps by which they could be joined"),
        ));
    }
    Ok(match cells {
        Cells::Numbers(numbers) => Cells::Numbers(join::interpolated(&part.stamps_ns, &numbers, &base.stamps_ns)),
        Cells::Texts(texts) => Cells::Texts(join::latest(&part.stamps_ns, &texts, &base.stamps_ns)),
    })
}

/// How parts were joined, and how many rows miss a value.
fn missing(found: &[Found], base: &Part, columns: &[Cells]) -> Vec<String> {
    let mut notes = Vec::new();
    let mut parts: Vec<&Part> = Vec::new();
    for one in found.iter().filter(|one| !std::ptr::eq(one.part, base) && !base.stamps_ns.is_empty()) {
        if !parts.iter().any(|part| std::ptr::eq(*part, one.part)) {
            parts.push(one.part);
        }
    }
    for part in parts {
        notes.push(format!(
            "{} is joined to the time stamps of {} by linear interpolation",
            part.shown(),
            base.shown()
        ));
    }
    let n_missing = (0..base.n_rows()).filter(|row| columns.iter().any(|cells| cells.is_missing(*row))).count();
    if n_missing > 0 {
        notes.push(format!(
            "{n_missing} of {} rows have an empty cell; commands that need its column leave them out",
            base.n_rows()
        ));
    }
    notes
}
