//! Which rows of a log a diagnosis uses, and how: options that other commands share.

use darm_diagnose::diagnosis::SignalOptions;
use darm_diagnose::prepare::signals::Preparation;
use darm_diagnose::rejection::Rejection;
use darm_measure::hold_out::HoldOut;
use darm_measure::select::Selection;
use darm_measure::table::Names;

use crate::failure::Usage;

/// Which rows of a table count, and how.
#[derive(clap::Args, Debug)]
pub(super) struct RowOptions {
    /// Use only the rows where this holds, such as `seal = NAPN and (t >= 4.5 or run = 2)`; a comma is `and`
    #[arg(long = "where", value_name = "EXPR")]
    pub(super) keep: Option<Selection>,
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
    #[arg(long, value_name = "COLUMN", group = "held_out_rows")]
    hold_out_column: Option<String>,
    /// Columns whose values separate the rows into segments
    #[arg(long, value_name = "COLUMN,…", value_delimiter = ',')]
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
    #[arg(long, value_name = "S")]
    skip_after_change: Option<f64>,
    /// Laws to include from the start
    #[arg(long, requires = "model", value_name = "LAW,…", value_delimiter = ',')]
    pub(super) always: Vec<String>,
    /// Meaning of columns with other names, such as `load=duty,position_count=pos`
    #[arg(long = "column", value_name = "NAME=COLUMN,…", value_delimiter = ',')]
    columns: Vec<String>,
}

impl RowOptions {
    pub(super) fn names(&self) -> anyhow::Result<Names> {
        let pair = |text: &String| {
            let parts = text.split_once('=').map(|(name, column)| (name.trim().to_string(), column.trim().to_string()));
            parts.ok_or_else(|| Usage(format!("--column {text}: give NAME=COLUMN")).into())
        };
        self.columns.iter().map(pair).collect()
    }

    pub(super) fn held_out(&self) -> anyhow::Result<HoldOut> {
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
    pub(super) fn refuse_those_of_signals(&self) -> anyhow::Result<()> {
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

    pub(super) fn options(&self, seed: u64, rejected: &[Rejection]) -> anyhow::Result<SignalOptions> {
        let is_contrary = |one: &&Rejection| one.place.is_none() && self.always.contains(&one.law);
        if let Some(Rejection { law, .. }) = rejected.iter().find(is_contrary) {
            return Err(Usage(format!("--always {law} and --reject {law} exclude each other; give one of them")).into());
        }
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
        let (always, rejected) = (self.always.clone(), rejected.to_vec());
        Ok(SignalOptions { preparation, always, rejected, seed, ..SignalOptions::default() })
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
