//! `darm import`: recordings of other programs as tables of measurements.

mod listing;

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use darm_measure::import::join::side_by_side;
use darm_measure::import::mapping::{Entry, Mapping};
use darm_measure::import::read::Dialect;
use darm_measure::import::summary::{Summary, summary};
use darm_measure::import::table::Table;
use darm_measure::import::time_stamp::Dates;
use darm_measure::import::{Recording, map_file, proposal};
use darm_measure::unit::Unit;
use darm_measure::write_table;
use serde::Serialize;

use crate::failure::Usage;
use crate::output_file::refuse_same;
use crate::overwrite::OutputFile;
use crate::ui::{Answer, Ui};

const EXAMPLES: &str = "\
Examples:
  darm import foreign-robot.csv                        # what is in it, and a proposed mapping
  darm import foreign-robot.csv -o robot.csv           # convert it by that mapping
  darm import foreign-robot.csv -o robot.mcap --column time_s=Zeit --column q1_deg='Achse 1 [deg]'
  darm import foreign-robot.csv --write-map map.toml   # the mapping as a file, to edit
  darm import foreign-robot.csv --map map.toml -o mapped.csv
  darm import foreign-arrays.npz -o arrays.csv --column 'time_s=t*ms' --column 'q#_rad=q[:,*]*deg'
  darm import foreign-matlab.mat -o matlab.csv --column 'q#_rad=log.q(:,*)' --column time_s=log.t
  darm import foreign-ros2.mcap -o ros2.csv

Reads CSV of any dialect, .npy, .npz, .mat (level 5), MCAP with messages of ROS (JointState, PoseStamped, WrenchStamped, \
TwistStamped) or JSON, and folders of ROS 2 bags in MCAP. Without --column and --map all columns are converted as proposed.

TARGET is one of the columns of docs/formats.md and ends in its unit; SOURCE is a column as listed, and may end in *UNIT (the unit \
of its numbers) or *NUMBER (a factor). A * in both takes every column that matches; # counts them from 1.

Several topics are joined to the time stamps of the one that time comes from, by linear interpolation, never across gaps. Several \
files follow each other, with their number in the column run; --join puts them next to each other by time.";

/// Convert a recording of another program into measurements
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Import {
    /// Recordings: CSV, .npy, .npz, .mat, .mcap, or the folder of a ROS 2 bag
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    /// Write the measurements: CSV, compressed (.csv.gz) or MCAP (.mcap)
    #[arg(short, long, value_name = "FILE.csv")]
    output: Option<OutputFile>,
    /// A column of the result, such as q1_rad=Var3*deg
    #[arg(long = "column", value_name = "TARGET=SOURCE", allow_hyphen_values = true)]
    columns: Vec<String>,
    /// File with the columns and units
    #[arg(long, value_name = "MAP.toml", conflicts_with = "columns")]
    map: Option<PathBuf>,
    /// Unit of columns of the recording, such as 'Var*=deg'
    #[arg(long = "unit", value_name = "SOURCE=UNIT")]
    units: Vec<String>,
    /// A number that means a missing value, such as --missing=-9999
    #[arg(long, value_name = "NUMBER", allow_hyphen_values = true)]
    missing: Vec<f64>,
    /// Write the mapping as a file for --map
    #[arg(long, value_name = "MAP.toml")]
    write_map: Option<OutputFile>,
    /// Join files by their time stamps, or arrays (.npy) row by row; default: one file after the other
    #[arg(long)]
    join: bool,
    /// Separator of a text file: a character, tab or space; default: found
    #[arg(long, value_name = "CHAR", value_parser = delimiter)]
    delimiter: Option<char>,
    /// The first row of a text file has no names
    #[arg(long)]
    no_header: bool,
    /// Lines before the table of a text file; default: those that have not as many cells as most
    #[arg(long, value_name = "N")]
    skip_lines: Option<usize>,
    /// What dates such as 1/5/2024 begin with; default: found where a number is above 12
    #[arg(long, value_name = "ORDER")]
    dates: Option<DateOrder>,
}

/// What dates begin with.
#[derive(clap::ValueEnum, Clone, Copy, Debug)]
enum DateOrder {
    DayFirst,
    MonthFirst,
}

impl From<DateOrder> for Dates {
    fn from(order: DateOrder) -> Self {
        match order {
            DateOrder::DayFirst => Self::DayFirst,
            DateOrder::MonthFirst => Self::MonthFirst,
        }
    }
}

fn delimiter(text: &str) -> Result<char, String> {
    match text {
        "tab" | "\\t" => Ok('\t'),
        "space" => Ok(' '),
        _ => text.parse().ok().filter(char::is_ascii).ok_or_else(|| "give one character, tab or space".into()),
    }
}

/// What is printed.
#[derive(Serialize)]
struct Report {
    files: Vec<Summary>,
    /// The mapping: columns of the result by those of the recording.
    mapping: Vec<String>,
    is_proposed: bool,
    /// Rows of the result, where one was written.
    rows: Option<usize>,
    output: Option<PathBuf>,
    /// What its owner should know.
    notes: Vec<String>,
}

impl Import {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let dialect = Dialect {
            delimiter: self.delimiter,
            has_header: self.no_header.then_some(false),
            skip_lines: self.skip_lines,
            dates: self.dates.map(Dates::from),
        };
        let mut recordings = Vec::new();
        for file in &self.files {
            recordings.push(darm_measure::import::read(file, dialect)?);
        }
        let given = self.given()?;
        recordings.iter_mut().for_each(|recording| recording.leave_out(&given.missing));
        let files = recordings.iter().map(summary).collect();
        let is_single_array = |file: &PathBuf| file.extension().is_some_and(|end| end == "npy");
        if recordings.len() > 1 && (self.join || self.files.iter().all(is_single_array)) {
            recordings = vec![side_by_side(recordings)?];
        }
        let is_proposed = given.entries.is_empty();
        let mapping = if is_proposed {
            Mapping { missing: given.missing, ..proposal::propose(&recordings[0], &given.units) }
        } else {
            given
        };
        let (mut rows, mut notes) = (None, Vec::new());
        if let Some(output) = &self.output {
            let table = self.table(&recordings, &mapping, output)?;
            (rows, notes) = (Some(table.rows.len()), table.notes);
            notes.extend(Table::left_out(&recordings[0], &mapping).filter(|_| is_proposed));
        } else if !is_proposed {
            notes = Table::new(&recordings, &mapping)?.notes;
        }
        if let Some(path) = &self.write_map {
            std::fs::write(path, map_file::text(&mapping))
                .with_context(|| format!("cannot write {}", path.display()))?;
        }
        let line = |entry: &Entry| format!("{}={}", entry.target, entry.expression());
        let mapping = mapping.entries.iter().map(line).collect();
        ui.print(&Report {
            files,
            mapping,
            is_proposed,
            rows,
            output: self.output.as_deref().map(Path::to_path_buf),
            notes,
        })
    }

    /// The mapping of the command line or of its file.
    fn given(&self) -> anyhow::Result<Mapping> {
        let mut mapping = self.map.as_deref().map(map_file::read).transpose()?.unwrap_or_default();
        for text in &self.columns {
            let entry: Entry = text.parse().map_err(|error| Usage(format!("--column {error}")))?;
            mapping.entries.push(Entry { origin: format!("--column {}", entry.origin), ..entry });
        }
        // Options come before the file, whose first match counts.
        let mut units = Vec::new();
        for text in &self.units {
            let parsed =
                text.rsplit_once('=').and_then(|(name, unit)| Some((name.trim().to_owned(), Unit::named(unit)?)));
            let wrong =
                || Usage(format!("--unit {text}: give SOURCE=UNIT with a unit such as deg, rad, mm, N, bar or ms"));
            units.push(parsed.ok_or_else(wrong)?);
        }
        mapping.units.splice(0..0, units);
        mapping.missing.extend(&self.missing);
        Ok(mapping)
    }

    fn table(&self, recordings: &[Recording], mapping: &Mapping, output: &Path) -> anyhow::Result<Table> {
        for file in &self.files {
            refuse_same(file, output)?;
        }
        let table = Table::new(recordings, mapping)?;
        write_table(output, &table.text()).with_context(|| format!("cannot write {}", output.display()))?;
        Ok(table)
    }
}

impl Answer for Report {
    fn text(&self) -> String {
        let mut lines = Vec::new();
        if self.output.is_none() {
            lines.extend(self.files.iter().map(listing::text));
            let how = if self.is_proposed { "proposed mapping (TARGET=SOURCE):" } else { "mapping (TARGET=SOURCE):" };
            lines.push(how.into());
            lines.extend(self.mapping.iter().map(|entry| format!("  {entry}")));
        }
        lines.extend(self.notes.iter().map(|note| format!("note: {note}")));
        match (&self.output, self.rows) {
            (Some(path), Some(rows)) => {
                let targets: Vec<&str> = self.mapping.iter().filter_map(|entry| entry.split('=').next()).collect();
                let how = if self.is_proposed { " (proposed mapping)" } else { "" };
                lines.push(format!("wrote {rows} rows to {}: {}{how}", path.display(), targets.join(", ")));
            }
            _ => lines.push(
                "\nconvert with -o OUT.csv; change it with --column TARGET=SOURCE or --write-map MAP.toml".into(),
            ),
        }
        lines.join("\n")
    }
}
