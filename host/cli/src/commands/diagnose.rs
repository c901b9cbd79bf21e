//! `darm diagnose`: which effect is missing in the model, where, how large, and how certain that is.

mod log;
pub(super) mod options;
mod rows;

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use anyhow::Context as _;
use darm_arm::draw::page::SourceFile;
use darm_diagnose::correction::Keep;
use darm_diagnose::outcome::{Diagnosis, Effect, ErrorFigure, Number};
use darm_diagnose::report::numbers::{after, readable, with_interval};
use darm_measure::Finding;
use serde::Serialize;

use crate::output_file::{self, Syntax};
use crate::overwrite::OutputFile;
use crate::pages::diagnosis::diagnosis_page;
use crate::swapped_files;
use crate::ui::{Answer, Ui, columns};
use options::{DiagnoseOptions, NewModel, Task};

const EXAMPLES: &str = "\
Examples:
  darm diagnose run.csv                             # without a model: what a log has
  darm diagnose arm.toml run.csv                    # the verdict and its evidence
  darm diagnose arm.toml run.csv -o arm2.toml       # and the corrected model, for the next table
  darm diagnose planar4.toml planar4-run.csv        # a recording that is shipped
  darm --json diagnose arm.toml run.csv --hold-out-each word
  darm diagnose tx40.toml tx40-motion.csv.gz --hold-out-column heldout -o tx40-2.toml   # torques
  darm diagnose planar4.toml planar4-run.csv --reject 'supply-stroke: new regulator'
  darm diagnose cylinder.toml cylinder-force.csv.gz --where 'seal = O-ring' \\
                --hold-out 'set_bar = 5' -o cylinder2.toml --keep-terms --report page.html

Held-out rows are never used by a fit; the error after the correction is reported on them. By default they are the rows marked \
in the column held_out; without that column every fourth block of rows, or for tool poses each word in turn. --column names \
columns of other names, such as --column x_mm=cam_x. The columns and units of tables are listed in \
docs/formats.md.

--reject LAW, PLACE: REASON excludes an effect that you know is not there, with law and place as the verdict prints them; without a \
place the law is excluded everywhere. The reason is in every output.

A recording of `darm record` names the model of its table. A MODEL that differs from it only in its effects, such as one from \
-o, is accepted with a note; any other is refused, unless --other-model is given.";

/// Findings on rows that are printed.
const MAX_NOTES: usize = 20;
const NOTHING_TO_WRITE: &str = "no effect was identified, so no corrected model is written";

/// Find the missing effect of a model: law, place, size and confidence
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES, allow_missing_positional = true)]
pub(crate) struct Diagnose {
    /// The model to diagnose: an arm file, a URDF, or a TOML file that names its kind; without it the columns of DATA are
    /// listed, and what they can diagnose
    #[arg(value_name = "MODEL")]
    model: Option<PathBuf>,
    /// Measurements: a file from `darm record`, or a CSV file with its columns; can be compressed (.gz)
    #[arg(value_name = "DATA", required = true)]
    data: PathBuf,
    /// Write the model with the effects that were found
    #[arg(short, long, value_name = "NEW.toml", requires = "model")]
    output: Option<OutputFile>,
    /// Add fitted terms to that model for a residual that no law explains
    #[arg(long, requires = "output")]
    keep_terms: bool,
    /// Write a report with tables and plots
    #[arg(long, value_name = "FILE.html", requires = "model")]
    report: Option<OutputFile>,
    #[command(flatten)]
    options: DiagnoseOptions,
}

/// What is printed.
#[derive(Serialize)]
pub(super) struct Report {
    #[serde(flatten)]
    diagnosis: Diagnosis,
    /// The corrected model, where one was written.
    output: Option<PathBuf>,
    /// What was asked about the units before.
    #[serde(skip)]
    asked: Vec<Finding>,
}

impl Diagnose {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        if let Some(fault) = darm_measure::import::read::mat_fault(&self.data) {
            return Err(fault.into());
        }
        let Some(model) = &self.model else { return log::print(&self.data, &self.options, ui) };
        swapped_files::refuse(model, &self.data)?;
        if let Some(path) = &self.output {
            output_file::refuse_other_than_toml(path, &[model])?;
        }
        if let Some(path) = &self.report {
            output_file::refuse_other_than_page(path)?;
        }
        let keep = if self.keep_terms { Keep::EffectsAndTerms } else { Keep::Effects };
        let new_model = self.output.as_deref().map(|path| NewModel { path, keep });
        let asked = self.options.ask(&self.data, ui)?;
        let task = Task { model, data: &self.data, new_model };
        let found = self.options.diagnose(task, ui).map_err(|error| log::with_conversion(model, &self.data, error));
        let (diagnosis, is_written) = found?;
        let output = self.output.as_deref().filter(|_| is_written).map(Path::to_path_buf);
        if self.output.is_some() && !is_written {
            ui.note(NOTHING_TO_WRITE);
        }
        if let Some(path) = &self.report {
            output_file::write_text(path, Syntax::Html, &page(&diagnosis, &diagnosis.next_step(), model, &self.data)?)?;
        }
        ui.print(&Report { diagnosis, output, asked })
    }
}

/// The page of a diagnosis, with what to do next and the digests of its files.
pub(super) fn page(diagnosis: &Diagnosis, next: &str, model: &Path, data: &Path) -> anyhow::Result<String> {
    let read = |kind, path: &Path| {
        SourceFile::read(kind, path).with_context(|| format!("cannot read {} for its digest", path.display()))
    };
    let files = [read("model", model)?, read("measurements", data)?];
    Ok(diagnosis_page(diagnosis, next, &files, SystemTime::now()).into_string())
}

impl Report {
    /// Of a diagnosis that writes no model.
    pub(super) fn new(diagnosis: Diagnosis) -> Self {
        Self { diagnosis, output: None, asked: Vec::new() }
    }
}

impl Answer for Report {
    fn text(&self) -> String {
        let Diagnosis { findings, verdict, plain, effects, repeatability, held_out, .. } = &self.diagnosis;
        let open = findings.iter().filter(|finding| !self.asked.contains(finding));
        let (of_rows, of_file): (Vec<&Finding>, Vec<&Finding>) = open.partition(|f| f.line.is_some());
        let shown = of_file.into_iter().chain(of_rows.iter().copied().take(MAX_NOTES));
        let mut lines: Vec<String> = shown.map(|finding| format!("note: {finding}")).collect();
        if of_rows.len() > MAX_NOTES {
            lines.push(format!("note: and {} more rows; --json lists them", of_rows.len() - MAX_NOTES));
        }
        lines.push(format!("verdict: {verdict}"));
        let (first, others) = plain.split_at(plain.len().min(1));
        lines.extend(first.iter().cloned());
        lines.push(format!("Next: {}", self.diagnosis.next_step()));
        lines.extend(others.iter().cloned());
        lines.extend(effects.iter().map(effect));
        lines.push(String::new());
        lines.push(self.errors());
        let repeats = repeatability.as_ref().map_or("not measured".to_owned(), |r| {
            let (value, unit) = readable(&r.norm);
            format!("{value:.3} {unit}, {} degrees of freedom", r.dof)
        });
        lines.push(format!("{}: {held_out}; repeatability: {repeats}", self.diagnosis.unseen()));
        lines.extend(self.output.as_ref().map(|path| format!("\nwrote the corrected model to {}", path.display())));
        lines.join("\n")
    }
}

/// The values of an effect with their intervals.
pub(super) fn effect(found: &Effect) -> String {
    let values = found.values.iter().map(|value| {
        let unit = after(&value.unit);
        let Some(ci95) = value.ci95 else { return format!("{} {:.3}{unit}", value.name, value.value) };
        let Some(from) = value.nominal else {
            let [size, low, high] = with_interval(value.value, ci95);
            return format!("{} {size}{unit} (95 % CI {low} to {high})", value.name);
        };
        let [size, low, high] = with_interval(from + value.value, ci95.map(|end| from + end));
        let [from, ..] = with_interval(from, ci95);
        format!("{} {from} → {size}{unit} (95 % CI {low} to {high})", value.name)
    });
    format!("  {}, {}: {}", found.law, found.site.name, values.collect::<Vec<_>>().join(", "))
}

impl Report {
    /// Errors before and after, on rows that the fit saw and on those that it did not.
    fn errors(&self) -> String {
        let Diagnosis { rows, error, .. } = &self.diagnosis;
        let unit = |unit: &'static str| readable(&Number { value: 0.0, unit }).1;
        let names = error.before.train.axes.iter().map(|axis| format!("{}, {}", axis.axis, unit(axis.unit)));
        let head: Vec<String> =
            ["error (RMS)", "rows", ""].map(str::to_owned).into_iter().chain(names).chain(["norm".into()]).collect();
        columns(&[
            head,
            cells("fitted", rows.train, Some(&error.before.train), "before"),
            cells("", rows.train, Some(&error.after.train), "after"),
            cells(self.diagnosis.unseen(), rows.held_out, error.before.held_out.as_ref(), "before"),
            cells("", rows.held_out, error.after.held_out.as_ref(), "after"),
        ])
    }
}

/// The cells of errors: of which rows, how many these are, when, and the error of each axis and the norm.
fn cells(name: &str, n: usize, figure: Option<&ErrorFigure>, when: &str) -> Vec<String> {
    let numbers = figure.map_or(Vec::new(), |figure| {
        let axes = figure.axes.iter().map(|axis| Number { value: axis.value, unit: axis.unit });
        let axes = axes.map(|number| format!("{:.3}", readable(&number).0));
        let (norm, unit) = readable(&figure.norm);
        axes.chain([format!("{norm:.3} {unit}")]).collect()
    });
    [vec![name.to_owned(), n.to_string(), when.to_owned()], numbers].concat()
}
