//! What a log has before it is diagnosed, how its columns are read, and how they can be read otherwise.
//!
//! A log with names as `darm record` writes them is diagnosed as it is, with other names for some of its columns. A recording of
//! another program is converted first, as `darm import` does.

use std::path::{Path, PathBuf};

use darm_diagnose::error::DiagnoseError;
use darm_diagnose::overview::{self, Overview, Possible};
use darm_diagnose::prepare::signals::Preparation;
use darm_measure::import::mapping::{Entry, Mapping, Scale};
use darm_measure::import::read::Dialect;
use darm_measure::import::{ImportError, Recording, proposal, table};
use darm_measure::origin::Origin;
use darm_measure::poses::{self, Which};
use darm_measure::table::{Names, Table};
use darm_measure::unit::{self, Unit};
use darm_measure::{Finding, FindingKind, ReadError, about};
use darm_robot::files::{FileRef, Files};
use serde::Serialize;

use crate::job_queue::Unwanted;
use crate::upload::ReadAs;

/// Quantities that a diagnosis of an arm needs.
const NEEDED: [&str; 4] = ["time", "word", "x", "y"];
/// The orientation of a tool in the plane, and in space.
const ORIENTATION: [&[&str]; 2] = [&["angle"], &["z", "rx", "ry", "rz"]];
/// Notes that are shown.
const MAX_NOTES: usize = 8;

/// What a page shows of a log.
#[derive(Debug, Serialize)]
pub(super) struct LogView {
    n_rows: usize,
    /// Whether it is a recording of another program, which is converted.
    is_converted: bool,
    /// Digest of the model whose table was played, where the file says it.
    model: Option<String>,
    columns: Vec<ColumnView>,
    /// Units that look wrong.
    doubts: Vec<DoubtView>,
    possible: Vec<Possible>,
    /// Quantities that are missing for the diagnosis of an arm.
    missing: Vec<&'static str>,
    notes: Vec<String>,
    /// Why it cannot be diagnosed as it is read.
    problem: Option<String>,
    /// What a column can hold, and in which units.
    quantities: Vec<(String, String)>,
    units: Vec<&'static str>,
}

/// A column of the file.
#[derive(Debug, Serialize)]
struct ColumnView {
    /// As it is read.
    #[serde(flatten)]
    read_as: ReadAs,
    /// What it is taken for; empty where that is unknown.
    meaning: String,
    /// Number of cells with a number.
    numbers: usize,
    /// Number of cells without one.
    others: usize,
    /// The smallest and largest number of the file.
    range: Option<[f64; 2]>,
    /// The first cell.
    example: String,
}

/// A unit that looks wrong.
#[derive(Debug, Serialize)]
struct DoubtView {
    /// Name of the column in the file.
    column: String,
    question: String,
    /// The units that it may be in.
    units: Vec<&'static str>,
}

/// Who reads a file.
enum Reader {
    Own(Box<Table>),
    Import(Box<Recording>),
}

/// A file as it is diagnosed.
pub(super) struct Readable {
    pub(super) files: Files,
    pub(super) data: PathBuf,
    pub(super) names: Names,
    notes: Vec<String>,
}

impl Readable {
    /// A file as it was sent.
    fn own(file: &FileRef<'_>, names: Names) -> Self {
        Self { files: file.files.clone(), data: file.path.into(), names, notes: Vec::new() }
    }
}

/// A log as its columns are read.
struct Read {
    overview: Option<Overview>,
    notes: Vec<String>,
    /// Why it cannot be diagnosed.
    problem: Option<String>,
}

/// Why a log cannot be read.
#[derive(Debug, thiserror::Error)]
pub(super) enum LogFault {
    #[error(transparent)]
    Import(#[from] ImportError),
    #[error("{0}: no unit; choose one of the list")]
    Unit(String),
    #[error("two columns are read as {0}; choose what one of them is not to be")]
    Twice(String),
    #[error(transparent)]
    Unwanted(#[from] Unwanted),
}

/// Whether somebody still waits for what a log has: asked before each step that may take a second, which the limits of a
/// recording bound.
pub(super) type Check<'a> = &'a dyn Fn() -> Result<(), Unwanted>;

/// What is in a log, with its columns read as `given`, or as their names say where nothing is given.
pub(super) fn view(data: &FileRef<'_>, given: &[ReadAs], check: Check<'_>) -> Result<LogView, LogFault> {
    let reader = Reader::of(data, check)?;
    let columns = if given.is_empty() { reader.proposed() } else { reader.completed(given) };
    let Read { overview, mut notes, problem } = reader.overview(data, &columns, check)?;
    notes.extend(
        overview.iter().flat_map(|overview| overview.findings.iter().filter(is_of_rows).map(ToString::to_string)),
    );
    notes.truncate(MAX_NOTES);
    let possible = overview.as_ref().map_or_else(Vec::new, |overview| overview.possible.clone());
    let units = reader.units();
    let column = |read_as| {
        check()?;
        Ok(reader.column(read_as, overview.as_ref()))
    };
    Ok(LogView {
        n_rows: reader.n_rows(),
        is_converted: matches!(reader, Reader::Import(_)),
        model: about(data).ok().and_then(|about| Origin::find(&about)).map(|origin| origin.model.to_string()),
        doubts: overview.as_ref().map_or_else(Vec::new, |overview| doubts(overview, &columns, &units)),
        missing: if possible.is_empty() { missing(&columns) } else { Vec::new() },
        columns: columns.iter().map(column).collect::<Result<_, Unwanted>>()?,
        problem: problem.filter(|_| !possible.is_empty() || overview.is_none()),
        possible,
        notes,
        quantities: overview::quantities().collect(),
        units,
    })
}

/// Whether a finding is no error of the columns, which is the problem of the log.
fn is_of_rows(finding: &&Finding) -> bool {
    finding.kind != FindingKind::RowDoesNotFitArm || finding.line.is_some()
}

/// The file that is diagnosed, with its columns read as `given`.
pub(super) fn readable(data: &FileRef<'_>, given: &[ReadAs], check: Check<'_>) -> Result<Readable, LogFault> {
    if let Some(fault) = darm_measure::import::read::mat_fault(data) {
        return Err(fault.into());
    }
    if given.is_empty() {
        return Ok(Readable::own(data, Names::new()));
    }
    let reader = Reader::of(data, check)?;
    check()?;
    reader.readable(data, &reader.completed(given))
}

/// What is wrong with a log, without the options of the command line.
pub(super) fn without_option(error: &DiagnoseError) -> String {
    match error {
        DiagnoseError::Read(ReadError::NoQuantity { path, column, .. }) => no_quantity(path, column),
        error => darm_diagnose::error::sentence(error),
    }
}

/// The sentence that a quantity is missing, for a page.
pub(super) fn no_quantity(path: &Path, column: &str) -> String {
    format!(
        "{}: no column is read as {}; choose what a column holds, and its unit, under `Columns of the measurements`",
        path.display(),
        unit::split(column).0
    )
}

impl Reader {
    fn of(data: &FileRef<'_>, check: Check<'_>) -> Result<Self, LogFault> {
        check()?;
        let own = Table::read(data, &Names::new()).map(|(table, _)| table);
        check()?;
        let own = match own {
            Ok(table) if is_own(data) => return Ok(Self::Own(Box::new(table))),
            own => own,
        };
        check()?;
        match (darm_measure::import::read(data, Dialect::default()), own) {
            (Ok(recording), _) => Ok(Self::Import(Box::new(recording))),
            (Err(_), Ok(table)) => Ok(Self::Own(Box::new(table))),
            (Err(error), Err(_)) => Err(error.into()),
        }
    }

    fn n_rows(&self) -> usize {
        match self {
            Self::Own(table) => table.lines.len(),
            Self::Import(recording) => recording.parts.iter().map(|part| part.n_rows()).max().unwrap_or(0),
        }
    }

    fn units(&self) -> Vec<&'static str> {
        match self {
            Self::Own(_) => Unit::ends().collect(),
            Self::Import(_) => Unit::names().collect(),
        }
    }

    /// What the names of the columns say.
    fn proposed(&self) -> Vec<ReadAs> {
        match self {
            Self::Own(table) => {
                let read_as = |column: &darm_measure::Column| {
                    let (quantity, unit) = (column.quantity.clone(), column.file_unit().to_lowercase());
                    ReadAs { column: column.name.clone(), quantity, unit }
                };
                table.columns.iter().map(read_as).collect()
            }
            Self::Import(recording) => {
                let mapping = proposal::propose(recording, &[]);
                mapping.entries.iter().map(|entry| proposed_by(entry, &mapping, recording)).collect()
            }
        }
    }

    /// `given`, and what is proposed for the columns that it leaves out.
    fn completed(&self, given: &[ReadAs]) -> Vec<ReadAs> {
        let by_name = |own: ReadAs| given.iter().find(|given| given.column == own.column).cloned().unwrap_or(own);
        self.proposed().into_iter().map(by_name).collect()
    }

    fn readable(&self, data: &FileRef<'_>, columns: &[ReadAs]) -> Result<Readable, LogFault> {
        let recording = match self {
            Self::Own(table) => {
                let changed = || columns.iter().zip(&table.columns).filter(|(read_as, own)| !is_own_name(read_as, own));
                if let Some((twice, _)) = changed().find(|(read_as, _)| is_twice(read_as, columns)) {
                    return Err(LogFault::Twice(twice.quantity.clone()));
                }
                let names = changed().map(|(read_as, own)| (name(read_as), own.name.clone())).collect();
                return Ok(Readable::own(data, names));
            }
            Self::Import(recording) => recording,
        };
        let entries = columns.iter().filter(|column| !column.quantity.is_empty()).map(entry);
        let mapping = Mapping { entries: entries.collect::<Result<_, _>>()?, ..Mapping::default() };
        let converted = table::Table::new(std::slice::from_ref(&**recording), &mapping)?;
        // Errors name the file that the person has sent.
        let name = data.path.file_name().expect("a sent file has a name");
        let path = Path::new("converted").join(name).with_extension("csv");
        let files = data.files.clone().with(&path, converted.text().into_bytes());
        Ok(Readable { files, data: path, names: Names::new(), notes: converted.notes })
    }

    fn overview(&self, data: &FileRef<'_>, columns: &[ReadAs], check: Check<'_>) -> Result<Read, Unwanted> {
        let nothing = |notes, problem| Ok(Read { overview: None, notes, problem: Some(problem) });
        check()?;
        let Readable { files, data, names, notes } = match self.readable(data, columns) {
            Ok(readable) => readable,
            Err(fault) => return nothing(Vec::new(), fault.to_string()),
        };
        let data = files.file(&data);
        check()?;
        let overview = match overview::overview(&data, &names, &Preparation::default()) {
            Ok(overview) => overview,
            Err(error) => return nothing(notes, without_option(&error)),
        };
        check()?;
        let is_of_words = columns.iter().any(|column| column.quantity == "word");
        let visits = is_of_words.then(|| poses::read(&data, &names, &Which::default()));
        let problem = visits.and_then(Result::err).map(|error| without_option(&error.into()));
        Ok(Read { overview: Some(overview), notes, problem })
    }

    fn column(&self, read_as: &ReadAs, overview: Option<&Overview>) -> ColumnView {
        let named = |name: &str| overview?.columns.iter().find(|column| column.name == name).map(|c| c.meaning.clone());
        let (numbers, example, name): (Vec<f64>, String, String) = match self {
            Self::Own(table) => {
                let column = table.column(&read_as.column);
                let words = column.map_or(&[][..], |column| &column.words);
                let numbers = words.iter().map(|word| word.parse().unwrap_or(f64::NAN)).collect();
                (numbers, words.first().cloned().unwrap_or_default(), read_as.column.clone())
            }
            Self::Import(recording) => {
                let mut all = recording.parts.iter().flat_map(|part| &part.columns);
                let column = all.find(|column| column.name == read_as.column);
                let first = column.and_then(|column| column.texts.first().cloned());
                (
                    column.map_or_else(Vec::new, |column| column.numbers.clone()),
                    first.unwrap_or_default(),
                    target(read_as),
                )
            }
        };
        let finite = || numbers.iter().copied().filter(|number| number.is_finite());
        let is_word = ["word", "previous"].contains(&read_as.quantity.as_str());
        let range = finite().reduce(f64::min).zip(finite().reduce(f64::max)).filter(|_| !is_word);
        ColumnView {
            read_as: read_as.clone(),
            meaning: named(&name).unwrap_or_default(),
            numbers: finite().count(),
            others: numbers.len() - finite().count(),
            range: range.map(|(low, high)| [low, high]),
            example,
        }
    }
}

/// Whether a file is one of `darm record`, or has all columns for a diagnosis under their own names.
fn is_own(data: &FileRef<'_>) -> bool {
    let origin = about(data).is_ok_and(|about| Origin::find(&about).is_some());
    let has_all =
        || overview::overview(data, &Names::new(), &Preparation::default()).is_ok_and(|o| !o.possible.is_empty());
    origin || has_all()
}

/// How a mapping reads a column.
fn proposed_by(entry: &Entry, mapping: &Mapping, recording: &Recording) -> ReadAs {
    let column = recording.parts.iter().flat_map(|part| &part.columns).find(|column| column.name == entry.source);
    let of_file = || column.and_then(|column| mapping.unit_of(column));
    let target = Unit::of_target(&entry.target);
    let unit = match entry.scale {
        Scale::In(unit) => Some(unit),
        _ => of_file().or(target),
    };
    let quantity = target.map_or(entry.target.as_str(), |_| unit::split(&entry.target).0);
    // A text keeps its name.
    let unit = unit.filter(|_| column.is_some_and(darm_measure::import::Column::is_numeric) && target.is_some());
    ReadAs {
        column: entry.source.clone(),
        quantity: quantity.to_lowercase(),
        unit: unit.map_or_else(String::new, |u| u.name.into()),
    }
}

/// The name of the column that a column is converted to.
fn target(read_as: &ReadAs) -> String {
    match Unit::named(&read_as.unit) {
        Some(unit) => format!("{}_{}", read_as.quantity, unit.written().name),
        None => read_as.quantity.clone(),
    }
}

fn entry(read_as: &ReadAs) -> Result<Entry, LogFault> {
    let unit = Some(&read_as.unit).filter(|unit| !unit.is_empty());
    let unit = unit.map(|name| Unit::named(name).ok_or_else(|| LogFault::Unit(name.clone()))).transpose()?;
    let (source, origin) = (read_as.column.clone(), format!("column {}", read_as.column));
    Ok(Entry { target: target(read_as), source, scale: unit.map_or(Scale::OfFile, Scale::In), origin })
}

/// Whether a column of ours is read as its name says.
fn is_own_name(read_as: &ReadAs, own: &darm_measure::Column) -> bool {
    read_as.quantity == own.quantity && read_as.unit == own.file_unit().to_lowercase()
}

/// Whether another column is read as the same quantity.
fn is_twice(read_as: &ReadAs, columns: &[ReadAs]) -> bool {
    let alike = columns.iter().filter(|column| column.quantity == read_as.quantity).count();
    !read_as.quantity.is_empty() && alike > 1
}

/// The name that a column of ours is given: one of no quantity where it is not read.
fn name(read_as: &ReadAs) -> String {
    let ReadAs { column, quantity, unit } = read_as;
    match (quantity.is_empty(), unit.is_empty()) {
        (true, _) => format!("{column}, not read"),
        (false, true) => quantity.clone(),
        (false, false) => format!("{quantity}_{unit}"),
    }
}

/// Units that look wrong and units that are missing, by the names of the columns in the file.
fn doubts(overview: &Overview, columns: &[ReadAs], known: &[&str]) -> Vec<DoubtView> {
    let source = |name: &str| columns.iter().find(|column| column.column == name || target(column) == name);
    let view = |name: &str, text: &dyn Fn(&str) -> String, units: &[&'static str]| {
        let column = source(name)?.column.clone();
        let units = units.iter().copied().filter(|unit| known.contains(unit)).collect();
        Some(DoubtView { question: text(&column), column, units })
    };
    let doubts = overview.doubts.iter().filter(|doubt| overview.unread.iter().all(|one| one.column != doubt.column));
    let doubts = doubts.filter_map(|doubt| view(&doubt.column, &|_| format!("{}?", doubt.question), &[doubt.unit]));
    let unread = overview.unread.iter().filter_map(|one| {
        view(&one.column, &|column| format!("{column}: {}, {}: not read.", one.quantity, one.fault), one.units)
    });
    unread.chain(doubts).collect()
}

/// Quantities that no column is read as, of those that the diagnosis of an arm needs.
fn missing(columns: &[ReadAs]) -> Vec<&'static str> {
    let is_read = |quantity: &&str| {
        let is_it =
            |own: &str| own.eq_ignore_ascii_case(quantity) || *quantity == "time" && own.eq_ignore_ascii_case("t");
        columns.iter().any(|column| is_it(&column.quantity))
    };
    let [planar, spatial] = ORIENTATION;
    let orientation = if spatial.iter().any(is_read) { spatial } else { planar };
    NEEDED.iter().chain(orientation).filter(|quantity| !is_read(quantity)).copied().collect()
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::path::Path;

    use darm_robot::files::{Files, Limits};

    use super::{LogFault, Unwanted, readable, view};

    const OWN: &[u8] = include_bytes!("../../../../examples/planar4-run.csv");
    /// Of another program: it is converted.
    const FOREIGN: &[u8] = b"Zeit [ms];Stellung;X [mm];Y [mm];Richtung [deg]\n0;0;1,5;2;3\n10;1;1,25;2;3\n";

    /// In how many steps work is done, each of which begins only where somebody still waits for it.
    #[track_caller]
    fn n_steps<T>(work: impl Fn(super::Check<'_>) -> Result<T, LogFault>) -> usize {
        for last in 0.. {
            let asked = Cell::new(0);
            let check = || {
                asked.set(asked.get() + 1);
                if asked.get() > last { Err(Unwanted) } else { Ok(()) }
            };
            match work(&check) {
                Ok(_) => return last,
                Err(LogFault::Unwanted(Unwanted)) => assert_eq!(asked.get(), last + 1, "it asks no more"),
                Err(fault) => panic!("step {last}: {fault}"),
            }
        }
        unreachable!("an endless loop")
    }

    #[test]
    fn what_is_read_of_a_log_ends_at_the_step_at_which_its_page_leaves() {
        for (text, least) in [(OWN, 12), (FOREIGN, 11)] {
            let files = Files::handed([("log.csv".into(), text.to_vec())], Limits::SERVER);
            let data = files.file(Path::new("log.csv"));
            let steps = n_steps(|check| view(&data, &[], check));
            assert!(steps >= least, "{steps} steps: reading, an overview, and each column");
            let given = [super::ReadAs { column: "X [mm]".into(), quantity: "x".into(), unit: "mm".into() }];
            let steps = n_steps(|check| readable(&data, &given, check));
            assert!(steps >= 3, "{steps} steps");
        }
    }
}
