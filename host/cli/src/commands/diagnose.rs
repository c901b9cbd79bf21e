//! `darm diagnose`: which effect is missing in the model, where, how large, and how certain that is.

use std::path::PathBuf;

use anyhow::Context as _;
use darm::report::diagnosis_page;
use darm_arm::arm::Arm;
use darm_diagnose::correction::Keep;
use darm_diagnose::diagnosis::{Options, SignalOptions, diagnose, diagnose_file};
use darm_diagnose::linearise::model::Model;
use darm_diagnose::measurement::hold_out::HoldOut;
use darm_diagnose::measurement::origin::Origin;
use darm_diagnose::measurement::poses::{self, Which};
use darm_diagnose::measurement::select::Selection;
use darm_diagnose::measurement::{self, Finding, about, check};
use darm_diagnose::outcome::{Diagnosis, Effect, ErrorFigure, Number};
use darm_diagnose::prepare::signals::Preparation;
use darm_diagnose::report::sentences::readable;
use serde::Serialize;

use crate::failure::Usage;
use crate::ui::{Answer, Ui, columns};

const EXAMPLES: &str = "\
Examples:
  darm diagnose arm.toml run.csv                 the verdict, and what it rests on
  darm diagnose arm.toml run.csv -o arm2.toml    and the model with the effect in it, for the next table
  darm diagnose arm.toml run.mcap                the same of a log in MCAP with messages of JSON
  darm --json diagnose arm.toml run.csv.gz       everything that was tried
  darm diagnose cylinder.toml force.csv --hold-out \"set_bar = 5\"
                                                 friction of a cylinder, judged at a pressure that no fit has seen
  darm diagnose cylinder.toml force.csv -o new.toml --keep-terms
                                                 the same, with what no law explains as a fitted curve
  darm diagnose arm.toml run.csv --where \"run != 3\" --hold-out-each word --map x_mm=cam_x --report page.html
                                                 poses in columns of other names, without one run, as a page
  darm diagnose arm.urdf motion.csv --lowpass 20 --thin 40
                                                 missing effects in the torques of a serial arm

Rows that are held out are never fitted: the held-out error is computed on them. By default they are those of the column \
held_out; without it every fourth block of rows, or of tool poses each word in turn. docs/formats.md lists the columns that \
tables may have, and their units.

A recording of `darm record` names the model of its table. A MODEL that differs from it in its effects only, as \
the one that -o writes, is accepted with a note; any other is refused, unless --other-model is given.";

/// Findings on rows that are printed.
const MAX_NOTES: usize = 20;
const NOTHING_TO_WRITE: &str = "no effect is identified, so there is no corrected model to write";

/// Find which effect is missing in the model, where, how large, and how certain that is
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Diagnose {
    /// The model that predicted: an arm file, a URDF, or a small TOML that names its kind
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// Measurements: what `darm record` writes, or any CSV with its columns; may end in .gz
    #[arg(value_name = "DATA")]
    data: PathBuf,
    /// The model with the effects that were found
    #[arg(short, long = "write-model", visible_alias = "output", value_name = "NEW.toml")]
    output: Option<PathBuf>,
    /// Accept a recording that was made with the table of another arm file
    #[arg(long)]
    other_model: bool,
    /// Keep what no law explains in that model, as fitted terms of what it depends on
    #[arg(long, requires = "output")]
    keep_terms: bool,
    /// Seed of the cross-validation
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// A page with tables and plots
    #[arg(long, value_name = "OUT.html")]
    report: Option<PathBuf>,
    #[command(flatten)]
    rows: RowOptions,
}

/// Which rows of a table count, and how.
#[derive(clap::Args, Debug)]
struct RowOptions {
    /// Only rows where this holds, as `seal = NAPN, t >= 4.5`
    #[arg(long = "where", value_name = "EXPR")]
    keep: Option<Selection>,
    /// Hold out the rows where this holds
    #[arg(long, value_name = "EXPR", group = "held")]
    hold_out: Option<Selection>,
    /// Hold out this share of the rows, from the end
    #[arg(long, value_name = "FRACTION", group = "held")]
    hold_out_last: Option<f64>,
    /// Hold out each value of a column in turn
    #[arg(long, value_name = "COLUMN", group = "held")]
    hold_out_each: Option<String>,
    /// Hold out the rows where a column is not 0
    #[arg(long, value_name = "COLUMN", group = "held")]
    split: Option<String>,
    /// Columns whose values part the rows into stretches
    #[arg(long, value_name = "COLUMN,…", value_delimiter = ',')]
    within: Vec<String>,
    /// Rows a second, where the table has no time
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// Keep about this many rows a second
    #[arg(long, value_name = "HZ")]
    thin: Option<f64>,
    /// Low-pass without delay on all channels
    #[arg(long, value_name = "HZ")]
    lowpass: Option<f64>,
    /// Interpolate the posture between the rows where this column is not 0
    #[arg(long, value_name = "FLAG")]
    interpolate: Option<String>,
    /// Leave out rows sooner than this after a change of target
    #[arg(long, value_name = "SECONDS")]
    settled: Option<f64>,
    /// Laws that are in the model from the start
    #[arg(long, value_name = "LAW,…", value_delimiter = ',')]
    always: Vec<String>,
    /// What columns hold whose own names do not say it, as `load=duty,position_count=pos`
    #[arg(long, value_name = "NAME=COLUMN,…", value_delimiter = ',')]
    map: Vec<String>,
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
        let report = match Model::read(&self.model)? {
            Some(model) => self.signals(&model, ui)?,
            None => self.poses(ui)?,
        };
        if let (Some(_), None) = (&self.output, &report.output) {
            ui.note(NOTHING_TO_WRITE);
        }
        if let Some(path) = &self.report {
            let page = diagnosis_page(&report.diagnosis).into_string();
            std::fs::write(path, page).with_context(|| format!("{} cannot be written", path.display()))?;
        }
        ui.print(&report)
    }

    fn signals(&self, model: &Model, ui: Ui) -> anyhow::Result<Report> {
        let (names, options) = (self.rows.names()?, self.rows.options(self.seed)?);
        let spinner = ui.spinner("diagnosing");
        let outcome = diagnose_file(model, &self.data, &names, &options);
        spinner.finish_and_clear();
        let outcome = outcome.with_context(|| self.data.display().to_string())?;
        let mut output = None;
        if let Some(path) = &self.output
            && outcome.correction.write(&self.model, path, &outcome.diagnosis, self.keep())?
        {
            output = Some(path.clone());
        }
        Ok(Report { diagnosis: outcome.diagnosis, output })
    }

    fn poses(&self, ui: Ui) -> anyhow::Result<Report> {
        self.rows.refuse_those_of_signals()?;
        let arm = Arm::read(&self.model)?;
        let which = Which { keep: self.rows.keep.clone(), hold_out: self.rows.held_out()? };
        let (run, mut findings) = poses::read(&self.data, &self.rows.names()?, &which)?;
        findings.extend(self.origin(&arm)?);
        findings.extend(check(&arm, &run));
        let spinner = ui.spinner("diagnosing");
        let outcome = diagnose(&arm, &run, &Options { seed: self.seed, ..Options::default() });
        spinner.finish_and_clear();
        let outcome = outcome.with_context(|| self.data.display().to_string())?;
        let mut output = None;
        if let Some(path) = &self.output
            && let Some(corrected) = outcome.correction.corrected(&arm, &run, self.keep())
        {
            corrected.write(path)?;
            output = Some(path.clone());
        }
        Ok(Report { diagnosis: Diagnosis { findings, ..outcome.diagnosis }, output })
    }

    fn keep(&self) -> Keep {
        if self.keep_terms { Keep::EffectsAndTerms } else { Keep::Effects }
    }

    /// Compares the model of a recording with the arm.
    fn origin(&self, arm: &Arm) -> anyhow::Result<Option<Finding>> {
        let Some(origin) = Origin::find(&about(&self.data)?) else { return Ok(None) };
        if self.other_model || origin.fits(arm) {
            return Ok(origin.finding(arm));
        }
        Err(origin.refusal(&self.data, &self.model, arm).into())
    }
}

impl RowOptions {
    fn names(&self) -> anyhow::Result<measurement::table::Names> {
        let pair = |text: &String| {
            let parts = text.split_once('=').map(|(name, column)| (name.trim().to_string(), column.trim().to_string()));
            parts.ok_or_else(|| Usage(format!("--map {text}: write NAME=COLUMN")).into())
        };
        self.map.iter().map(pair).collect()
    }

    fn held_out(&self) -> anyhow::Result<HoldOut> {
        Ok(match (&self.hold_out, self.hold_out_last, &self.hold_out_each, &self.split) {
            (Some(selection), ..) => HoldOut::Where(selection.clone()),
            (_, Some(share), ..) if !(share > 0.0 && share < 1.0) => {
                return Err(Usage(format!("--hold-out-last {share}: a share lies between 0 and 1")).into());
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
            ("--within", !self.within.is_empty(), "visits are parted by their column `run`: --map run=COLUMN"),
            ("--rate", self.rate.is_some(), "poses need a column of time"),
            ("--thin", self.thin.is_some(), "each row is a separate visit: --where chooses rows"),
            ("--lowpass", self.lowpass.is_some(), "each row is a separate visit, there is no signal to filter"),
            ("--interpolate", self.interpolate.is_some(), "each row is a separate visit"),
            ("--settled", self.settled.is_some(), "each row is a separate visit: --where chooses rows"),
            ("--always", !self.always.is_empty(), "write the effect into the arm file, its values are fitted again"),
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
            within: self.within.clone(),
            rate_hz: positive("--rate", self.rate)?,
            thin_hz: positive("--thin", self.thin)?,
            lowpass_hz: positive("--lowpass", self.lowpass)?,
            interpolate: self.interpolate.clone(),
            settled_s: self.settled,
        };
        Ok(SignalOptions { preparation, always: self.always.clone(), seed })
    }
}

fn positive(option: &str, number: Option<f64>) -> anyhow::Result<Option<f64>> {
    match number {
        Some(number) if !(number > 0.0 && number.is_finite()) => {
            Err(Usage(format!("{option} {number}: must be more than 0")).into())
        }
        number => Ok(number),
    }
}

impl Answer for Report {
    fn text(&self) -> String {
        let Diagnosis { findings, plain, effects, repeatability, held_out, .. } = &self.diagnosis;
        let (of_rows, of_file): (Vec<&Finding>, Vec<&Finding>) = findings.iter().partition(|f| f.line.is_some());
        let shown = of_file.into_iter().chain(of_rows.iter().copied().take(MAX_NOTES));
        let mut lines: Vec<String> = shown.map(|finding| format!("note: {finding}")).collect();
        if of_rows.len() > MAX_NOTES {
            lines.push(format!("note: and {} more rows; --json lists them", of_rows.len() - MAX_NOTES));
        }
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
        let interval = value.ci95.map_or(String::new(), |[low, high]| format!(" (95 % CI {low:.6} to {high:.6})"));
        format!("{} {:.6}{unit}{interval}", value.name, value.value)
    });
    format!("  {}, {}: {}", found.law, found.site.name, values.collect::<Vec<_>>().join(", "))
}

impl Report {
    /// Errors before and after, on rows that the fit saw and on those that it did not.
    fn errors(&self) -> String {
        let Diagnosis { rows, error, .. } = &self.diagnosis;
        let cells = |name: &str, n: usize, figure: Option<&ErrorFigure>, when: &str| {
            let numbers = figure.map_or(Vec::new(), |figure| {
                let axes = figure.axes.iter().map(|axis| Number { value: axis.value, unit: axis.unit });
                let axes = axes.map(|number| format!("{:.3}", readable(&number).0));
                let (norm, unit) = readable(&figure.norm);
                axes.chain([format!("{norm:.3} {unit}")]).collect()
            });
            [vec![name.to_owned(), n.to_string(), when.to_owned()], numbers].concat()
        };
        let unit = |unit: &'static str| readable(&Number { value: 0.0, unit }).1;
        let names = error.before.train.axes.iter().map(|axis| format!("{}, {}", axis.axis, unit(axis.unit)));
        let head: Vec<String> =
            ["error (RMS)", "rows", ""].map(str::to_owned).into_iter().chain(names).chain(["norm".into()]).collect();
        columns(&[
            head,
            cells("fitted", rows.train, Some(&error.before.train), "before"),
            cells("", rows.train, Some(&error.after.train), "after"),
            cells("held out", rows.heldout, error.before.heldout.as_ref(), "before"),
            cells("", rows.heldout, error.after.heldout.as_ref(), "after"),
        ])
    }
}
