//! `darm diagnose`: which effect is missing in the model, where, how large, and how certain that is.

use std::path::PathBuf;

use darm::report::diagnosis_page;
use darm_arm::arm::Arm;
use darm_diagnose::correction::Keep;
use darm_diagnose::diagnosis::SignalOptions;
use darm_diagnose::files::{FileOptions, Files, Subject};
use darm_diagnose::measurement::hold_out::HoldOut;
use darm_diagnose::measurement::select::Selection;
use darm_diagnose::measurement::{self, Finding};
use darm_diagnose::outcome::{Diagnosis, Effect, ErrorFigure, Number};
use darm_diagnose::prepare::signals::Preparation;
use darm_diagnose::report::numbers::with_interval;
use darm_diagnose::report::sentences::readable;
use serde::Serialize;

use super::subject::Locked;
use crate::exchanged;
use crate::failure::Usage;
use crate::output_file::{self, Syntax};
use crate::ui::{Answer, Ui, columns};

const EXAMPLES: &str = "\
Examples:
  darm diagnose arm.toml run.csv                    # the verdict and its evidence
  darm diagnose arm.toml run.csv -o arm2.toml       # and the corrected model, for the next table
  darm diagnose planar4.toml planar4-run.csv        # a recording that is shipped
  darm --json diagnose arm.toml run.csv --hold-out-each word
  darm diagnose tx40.toml tx40-motion.csv.gz --hold-out-column heldout -o tx40-2.toml   # torques
  darm diagnose cylinder.toml cylinder-force.csv.gz --where 'seal = O-ring' \\
                --hold-out 'set_bar = 5' -o cylinder2.toml --keep-terms --report page.html

Held-out rows are never used by a fit; the error after the correction is reported on them. By default they are the rows marked \
in the column held_out; without that column every fourth block of rows, or for tool poses each word in turn. --column names \
columns of other names, such as --column x_mm=cam_x. The columns and units of tables are listed in \
docs/formats.md.

A recording of `darm record` names the model of its table. A MODEL that differs from it only in its effects, such as one from \
-o, is accepted with a note; any other is refused, unless --other-model is given.";

/// Findings on rows that are printed.
const MAX_NOTES: usize = 20;
const NOTHING_TO_WRITE: &str = "no effect was identified, so no corrected model is written";

/// Find the missing effect of a model: law, place, size and confidence
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Diagnose {
    /// The model to diagnose: an arm file, a URDF, or a TOML file that names its kind
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// Measurements: a file from `darm record`, or a CSV file with its columns; can be compressed (.gz)
    #[arg(value_name = "DATA")]
    data: PathBuf,
    /// Write the model with the effects that were found
    #[arg(short, long, alias = "write-model", value_name = "NEW.toml")]
    output: Option<PathBuf>,
    /// Accept a recording of the table of another arm file
    #[arg(long)]
    other_model: bool,
    /// Add fitted terms to that model for a residual that no law explains
    #[arg(long, requires = "output")]
    keep_terms: bool,
    /// Seed of the cross-validation
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Write a report with tables and plots
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Fix a joint of the robot that the data do not have at a position, in deg or mm
    #[arg(long = "lock", value_name = "JOINT=Q", allow_hyphen_values = true)]
    locks: Vec<String>,
    #[command(flatten)]
    rows: RowOptions,
}

/// Which rows of a table count, and how.
#[derive(clap::Args, Debug)]
struct RowOptions {
    /// Use only the rows where this holds, such as `seal = NAPN and (t >= 4.5 or run = 2)`; a comma is `and`
    #[arg(long = "where", value_name = "EXPR")]
    keep: Option<Selection>,
    /// Hold out the rows where this holds
    #[arg(long, value_name = "EXPR", group = "held_out_rows")]
    hold_out: Option<Selection>,
    /// Hold out this share of the rows, at the end
    #[arg(long, value_name = "FRACTION", group = "held_out_rows")]
    hold_out_last: Option<f64>,
    /// Hold out each value of a column in turn
    #[arg(long, value_name = "COLUMN", group = "held_out_rows")]
    hold_out_each: Option<String>,
    /// Hold out the rows where a column is not 0
    #[arg(long, alias = "split", value_name = "COLUMN", group = "held_out_rows")]
    hold_out_column: Option<String>,
    /// Columns whose values separate the rows into segments
    #[arg(long, value_name = "COLUMN,…", value_delimiter = ',', alias = "within")]
    segment_by: Vec<String>,
    /// Sampling rate, where the table has no time
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// Decimate to about this rate
    #[arg(long, value_name = "HZ")]
    thin: Option<f64>,
    /// Cut-off frequency of a low-pass without delay on all signals
    #[arg(long, value_name = "HZ")]
    lowpass: Option<f64>,
    /// Interpolate the posture between the rows where this column is not 0
    #[arg(long, value_name = "COLUMN")]
    interpolate: Option<String>,
    /// Skip rows within this time after a change of target
    #[arg(long, alias = "settled", value_name = "S")]
    skip_after_change: Option<f64>,
    /// Laws to include from the start
    #[arg(long, value_name = "LAW,…", value_delimiter = ',')]
    always: Vec<String>,
    /// Meaning of columns with other names, such as `load=duty,position_count=pos`
    #[arg(long = "column", alias = "map", value_name = "NAME=COLUMN,…", value_delimiter = ',')]
    columns: Vec<String>,
}

/// What is printed.
#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    diagnosis: Diagnosis,
    /// The corrected model, where one was written.
    output: Option<PathBuf>,
}

impl Diagnose {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        exchanged::refuse(&self.model, &self.data)?;
        if let Some(path) = &self.output {
            output_file::refuse_other_than_toml(path, &[&self.model])?;
        }
        if let Some(path) = &self.report {
            output_file::refuse_other_than_page(path)?;
        }
        let subject = match Locked(&self.locks).read_model(&self.model)? {
            Some((model, locked)) => Subject::Signals(Box::new(model), locked),
            None if !self.locks.is_empty() => return Err(Usage("--lock needs a robot, not an arm file".into()).into()),
            None => {
                self.rows.refuse_those_of_signals()?;
                Subject::Arm(Box::new(Arm::read(&self.model)?))
            }
        };
        let report = self.diagnose(subject, ui)?;
        if let (Some(_), None) = (&self.output, &report.output) {
            ui.note(NOTHING_TO_WRITE);
        }
        if let Some(path) = &self.report {
            let page = diagnosis_page(&report.diagnosis).into_string();
            output_file::write_text(path, Syntax::Html, &page)?;
        }
        ui.print(&report)
    }

    fn diagnose(&self, subject: Subject, ui: Ui) -> anyhow::Result<Report> {
        let how = FileOptions {
            names: self.rows.names()?,
            rows: self.rows.options(self.seed)?,
            accepts_other_model: self.other_model,
        };
        let spinner = ui.spinner("diagnosing");
        let found = Files { model: &self.model, data: &self.data }.diagnose(subject, &how);
        spinner.finish_and_clear();
        let found = found?;
        let output = match &self.output {
            Some(path) => found.write_corrected(path, self.keep())?.map(|_| path.clone()),
            None => None,
        };
        Ok(Report { diagnosis: found.diagnosis, output })
    }

    fn keep(&self) -> Keep {
        if self.keep_terms { Keep::EffectsAndTerms } else { Keep::Effects }
    }
}

impl RowOptions {
    fn names(&self) -> anyhow::Result<measurement::table::Names> {
        let pair = |text: &String| {
            let parts = text.split_once('=').map(|(name, column)| (name.trim().to_string(), column.trim().to_string()));
            parts.ok_or_else(|| Usage(format!("--column {text}: give NAME=COLUMN")).into())
        };
        self.columns.iter().map(pair).collect()
    }

    fn held_out(&self) -> anyhow::Result<HoldOut> {
        Ok(match (&self.hold_out, self.hold_out_last, &self.hold_out_each, &self.hold_out_column) {
            (Some(selection), ..) => HoldOut::Where(selection.clone()),
            (_, Some(share), ..) if !(share > 0.0 && share < 1.0) => {
                return Err(Usage(format!("--hold-out-last {share}: give a share between 0 and 1")).into());
            }
            (_, Some(share), ..) => HoldOut::Last(share),
            (.., Some(column), _) => HoldOut::Each(column.clone()),
            (.., Some(column)) => HoldOut::Column(column.clone()),
            _ => HoldOut::Own,
        })
    }

    /// Poses are visits, not a signal: filters and decimation mean nothing there, and laws are in the arm file.
    fn refuse_those_of_signals(&self) -> anyhow::Result<()> {
        let given = [
            (
                "--segment-by",
                !self.segment_by.is_empty(),
                "visits are separated by their column `run`: use --column run=COLUMN",
            ),
            ("--rate", self.rate.is_some(), "poses need a column of time"),
            ("--thin", self.thin.is_some(), "each row is a separate visit: choose rows with --where"),
            ("--lowpass", self.lowpass.is_some(), "each row is a separate visit, there is no signal to filter"),
            ("--interpolate", self.interpolate.is_some(), "each row is a separate visit"),
            (
                "--skip-after-change",
                self.skip_after_change.is_some(),
                "each row is a separate visit: choose rows with --where",
            ),
            ("--always", !self.always.is_empty(), "add the effect to the arm file, its values are fitted again"),
        ];
        match given.into_iter().find(|(_, given, _)| *given) {
            Some((option, _, what)) => {
                Err(Usage(format!("{option} is for signals, not for an arm file: {what}")).into())
            }
            None => Ok(()),
        }
    }

    fn options(&self, seed: u64) -> anyhow::Result<SignalOptions> {
        let preparation = Preparation {
            keep: self.keep.clone(),
            hold_out: self.held_out()?,
            segment_by: self.segment_by.clone(),
            rate_hz: positive("--rate", self.rate)?,
            thin_hz: positive("--thin", self.thin)?,
            lowpass_hz: positive("--lowpass", self.lowpass)?,
            interpolate: self.interpolate.clone(),
            skip_after_change_s: self.skip_after_change,
        };
        Ok(SignalOptions { preparation, always: self.always.clone(), seed, ..SignalOptions::default() })
    }
}

fn positive(option: &str, number: Option<f64>) -> anyhow::Result<Option<f64>> {
    match number {
        Some(number) if !(number > 0.0 && number.is_finite()) => {
            Err(Usage(format!("{option} {number}: give a number above 0")).into())
        }
        number => Ok(number),
    }
}

impl Answer for Report {
    fn text(&self) -> String {
        let Diagnosis { findings, verdict, plain, effects, repeatability, held_out, .. } = &self.diagnosis;
        let (of_rows, of_file): (Vec<&Finding>, Vec<&Finding>) = findings.iter().partition(|f| f.line.is_some());
        let shown = of_file.into_iter().chain(of_rows.iter().copied().take(MAX_NOTES));
        let mut lines: Vec<String> = shown.map(|finding| format!("note: {finding}")).collect();
        if of_rows.len() > MAX_NOTES {
            lines.push(format!("note: and {} more rows; --json lists them", of_rows.len() - MAX_NOTES));
        }
        lines.push(format!("verdict: {verdict}"));
        lines.extend(plain.clone());
        lines.extend(effects.iter().map(effect));
        lines.push(String::new());
        lines.push(self.errors());
        let repeats = repeatability.as_ref().map_or("not measured".to_owned(), |r| {
            let (value, unit) = readable(&r.norm);
            format!("{value:.3} {unit}, {} degrees of freedom", r.dof)
        });
        lines.push(format!("held out: {held_out}; repeatability: {repeats}"));
        lines.extend(self.output.as_ref().map(|path| format!("\nwrote the corrected model to {}", path.display())));
        lines.join("\n")
    }
}

/// The values of an effect with their intervals.
fn effect(found: &Effect) -> String {
    let values = found.values.iter().map(|value| {
        let unit = if value.unit == "1" { String::new() } else { format!(" {}", value.unit) };
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
            cells("held out", rows.held_out, error.before.held_out.as_ref(), "before"),
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
