//! A log without a model: what is in it, and what can be diagnosed from it by which command.

use std::path::Path;

use darm_diagnose::error::DiagnoseError;
use darm_diagnose::files::FilesError;
use darm_diagnose::overview::{ColumnOverview, Overview, Possible, SamplingOverview};
use darm_measure::ReadError;
use darm_measure::import::read::Dialect;
use serde::Serialize;

use super::options::DiagnoseOptions;
use crate::failure::{Usage, in_table};
use crate::swapped_files::{is_model, options_without, quoted};
use crate::ui::{Answer, Ui, columns, six_digits};

/// Notes that are printed.
const MAX_NOTES: usize = 20;

/// What is printed.
#[derive(Serialize)]
struct Report {
    file: String,
    #[serde(flatten)]
    overview: Overview,
    /// The command line for each kind of measurement that is possible.
    commands: Vec<String>,
}

/// Prints what is in a log.
pub(super) fn print(data: &Path, options: &DiagnoseOptions, ui: Ui) -> anyhow::Result<()> {
    let file = quoted(&data.display().to_string());
    if is_model(data) {
        return Err(
            Usage(format!("{file} is a model; give the measurements after it: darm diagnose {file} DATA")).into()
        );
    }
    let overview = match options.overview(data)? {
        Ok(overview) => overview,
        Err(error) => {
            let converts = is_foreign(&error).then(|| conversion(data, None)).flatten();
            return Err(converts.map_or_else(|| in_table(data, error.line(), error), |line| anyhow::anyhow!("{line}")));
        }
    };
    let options: String = options_without(&[data], &[]).iter().map(|word| format!(" {}", quoted(word))).collect();
    let command = |one: &Possible| format!("darm diagnose {} {file}{options}", one.model_file);
    let commands = overview.possible.iter().map(command).collect();
    ui.print(&Report { file, overview, commands })
}

/// An error of a log, with the line that converts the log where it is one of another program.
pub(super) fn with_conversion(model: &Path, data: &Path, error: anyhow::Error) -> anyhow::Error {
    let is_of_log = match error.downcast_ref::<FilesError>() {
        Some(FilesError::Read(error)) => is_read_by_import(error),
        Some(FilesError::Diagnose { source: DiagnoseError::Read(error), .. }) => is_read_by_import(error),
        _ => false,
    };
    match is_of_log.then(|| conversion(data, Some(model))).flatten() {
        Some(line) => anyhow::anyhow!("{error:#}\n{line}"),
        None => error,
    }
}

/// The line that converts a recording of another program, and what comes after it; `None` of a table as ours, whose names the error
/// is about.
fn conversion(data: &Path, model: Option<&Path>) -> Option<String> {
    let recording = darm_measure::import::read(data, Dialect::default()).ok()?;
    let is_as_ours =
        recording.notes.is_empty() && recording.parts.iter().all(|part| part.kind == "table, separated by commas");
    let shown = |path: &Path| quoted(&path.display().to_string());
    let (file, converted) = (shown(data), shown(&data.with_extension("table.csv")));
    let model = model.map_or_else(String::new, |model| format!("{} ", shown(model)));
    (!is_as_ours).then(|| {
        format!(
            "{file} is a recording that only `darm import` reads; run `darm import {file} -o {converted}`, then `darm diagnose \
             {model}{converted}`"
        )
    })
}

/// Whether a file may be one of another program.
fn is_foreign(error: &DiagnoseError) -> bool {
    matches!(error, DiagnoseError::Read(error) if is_read_by_import(error))
}

fn is_read_by_import(error: &ReadError) -> bool {
    let is_table = matches!(error, ReadError::Io { .. } | ReadError::Csv(_) | ReadError::Log { .. });
    is_table || matches!(error, ReadError::NoQuantity { .. } | ReadError::Foreign { .. })
}

impl Answer for Report {
    fn text(&self) -> String {
        let Overview { rows, columns: all, sampling, repeats, held_out, questions, findings, possible, .. } =
            &self.overview;
        let head = ["  column", "taken for", "unit", "numbers", "empty", "min", "max"].map(str::to_owned).to_vec();
        let table: Vec<Vec<String>> = std::iter::once(head).chain(all.iter().map(column)).collect();
        let mut lines = vec![format!("{}: {rows} rows, {} columns", self.file, all.len()), columns(&table)];
        lines.extend(sampling.as_ref().map(self::sampling));
        lines.push(format!(
            "repeats: {} {} measured several times, {} degrees of freedom",
            repeats.conditions,
            if repeats.of == "words" { "words" } else { "conditions" },
            repeats.dof
        ));
        lines.push(format!(
            "held out: {}{}",
            held_out.how,
            match held_out.rows {
                0 => String::new(),
                n => format!(", {n} rows"),
            }
        ));
        lines.extend(questions.iter().map(|question| format!("question: {question}")));
        lines.extend(findings.iter().take(MAX_NOTES).map(|finding| format!("note: {finding}")));
        if findings.len() > MAX_NOTES {
            lines.push(format!("note: and {} more; --json lists them", findings.len() - MAX_NOTES));
        }
        lines.extend(possible.iter().zip(&self.commands).map(self::possible));
        if possible.is_empty() {
            lines.push(format!(
                "\nno kind of measurement has these columns; name them with --column NAME=COLUMN (docs/formats.md), or convert \
                 the file: darm import {}",
                self.file
            ));
        }
        lines.join("\n")
    }
}

fn column(column: &ColumnOverview) -> Vec<String> {
    let limit = |number: Option<f64>| number.map_or(String::new(), six_digits);
    let range = match (column.is_constant, column.min) {
        (true, _) => ["constant".into(), limit(column.max)],
        (false, None) => [format!("{} different", column.different), String::new()],
        (false, _) => [limit(column.min), limit(column.max)],
    };
    let meaning = if column.meaning.is_empty() { "?".into() } else { column.meaning.clone() };
    let counts = [column.numbers, column.empty].map(|n| n.to_string());
    let first = [format!("  {}", column.name), meaning, column.unit.into()];
    first.into_iter().chain(counts).chain(range).collect()
}

fn sampling(of: &SamplingOverview) -> String {
    let mut parts = vec![format!("{} s", six_digits(of.duration_s))];
    if let Some(rate_hz) = of.rate_hz {
        let jitter = of.jitter_s.map_or(String::new(), |jitter_s| format!(", jitter {:.3} ms rms", 1e3 * jitter_s));
        let clock = if of.is_even { format!("even clock{jitter}") } else { "no even clock".into() };
        parts.push(format!("{} rows a second ({clock})", six_digits(rate_hz)));
    }
    let counts = [
        (of.missing_rows, "rows missing between others"),
        (of.gaps, "gaps"),
        (of.same_time, "rows with the time of the row before"),
        (of.time_runs_back, "times that run back"),
    ];
    parts.extend(counts.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} {what}")));
    format!("sampling: {}", parts.join("; "))
}

fn possible((one, command): (&Possible, &String)) -> String {
    let mut lines = vec![format!("\n{} can be diagnosed with {}:", one.kind, one.model)];
    lines.extend(one.lines.iter().map(|line| format!("    {line}")));
    lines.push(format!("  {command}"));
    lines.extend(one.missing.iter().map(|what| format!("  better with {what}")));
    lines.join("\n")
}
