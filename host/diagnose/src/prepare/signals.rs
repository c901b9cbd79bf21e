//! A table prepared: rows chosen, segments found, rows held out, signals filtered and decimated, with findings.

use crate::measurement::hold_out::{HeldOut, HoldOut};
use crate::measurement::select::Selection;
use crate::measurement::signal::{LowPass, interpolated, rate, rate_hz, stretches, unwrapped};
use crate::measurement::table::Table;
use crate::measurement::{Finding, FindingKind, ReadError, SelectError};
use crate::prepare::groups::Row;

/// Rows up to which all are looked at where nothing is said.
const MOST_ROWS: usize = 10_000;
/// A joint that turns farther, rad, is taken for one in degrees; a position, m, for one in millimetres; a pressure that
/// stays below, Pa, for one in bar.
const LARGEST_ANGLE: f64 = 4.0 * std::f64::consts::PI;
const LARGEST_LENGTH: f64 = 10.0;
const LEAST_PRESSURE: f64 = 1e3;

/// How a table is made ready.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Preparation {
    /// Rows that count; `None`: all.
    pub keep: Option<Selection>,
    /// Rows that no fit may see.
    pub hold_out: HoldOut,
    /// Columns whose values part the rows into stretches.
    pub within: Vec<String>,
    /// Rows a second, where the table has no time.
    pub rate_hz: Option<f64>,
    /// Rows a second that are kept, as near as whole steps come; `None`: all of them up to 10 000, and of more about as
    /// many.
    pub thin_hz: Option<f64>,
    /// Corner of the low-pass on all channels.
    pub lowpass_hz: Option<f64>,
    /// A column that is 0 where a row only repeats the one before.
    pub interpolate: Option<String>,
    /// Rows sooner than this after a change of target do not count, s.
    pub settled_s: Option<f64>,
}

/// Why a table gives no experiment.
#[derive(Debug, thiserror::Error)]
pub enum PrepareError {
    /// A column is missing.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A selection makes no sense.
    #[error(transparent)]
    Select(#[from] SelectError),
    /// Nothing is left.
    #[error("{0}")]
    Nothing(String),
}

/// A table made ready. Channels have one number a row that is kept.
pub struct Prepared {
    /// The rows that are kept.
    pub rows: Vec<Row>,
    /// When, s.
    pub time_s: Vec<f64>,
    /// The stretch of each row.
    pub series: Vec<usize>,
    /// The motion of each row: what a joint remembers of its way does not end where rows are held out.
    pub motions: Vec<usize>,
    /// How the held-out rows were chosen, in words.
    pub held_out: String,
    /// What the owner of the data should know.
    pub findings: Vec<Finding>,
    table: Table,
    all_time_s: Vec<f64>,
    all_series: Vec<usize>,
    fresh: Option<Vec<bool>>,
    filter: Option<(LowPass, usize)>,
    kept: Vec<usize>,
}

impl Prepared {
    /// Makes a table ready; with `each` the rows of that value of the column are held out.
    pub fn new(mut table: Table, how: &Preparation, each: Option<&str>) -> Result<Self, PrepareError> {
        let mut findings = Vec::new();
        if let Some(keep) = &how.keep {
            let keep = keep.rows(&table)?;
            table.retain(&keep);
        }
        leave_out_gaps(&mut table, &mut findings);
        if table.lines.is_empty() {
            return Err(PrepareError::Nothing("no row is left, there is nothing to diagnose".into()));
        }
        constant(&table, &mut findings);
        units(&table, &mut findings);
        let time_s = times_s(&table, how.rate_hz);
        let chosen = how.hold_out.rows(&table, each)?;
        findings.extend(chosen.nothing(&how.hold_out));
        let HeldOut { rows: held, description: held_out, keys } = chosen;
        let (series, motions) = series(&table, &how.within, &time_s, &held, &mut findings)?;
        let steps = |hz: f64| (rate_hz(&time_s, &series) / hz).round().max(1.0) as usize;
        let every = how.thin_hz.map_or(table.lines.len().div_ceil(MOST_ROWS), steps);
        if how.thin_hz.is_none() && every > 1 {
            let text = format!("decimated by {every}, of {} rows; override with --thin", table.lines.len());
            findings.push(Finding::note(FindingKind::Decimated, text));
        }
        let thinned = |stretch: std::ops::Range<usize>| stretch.step_by(every);
        let mut kept: Vec<usize> = stretches(&series).into_iter().flat_map(thinned).collect();
        if let Some(settled_s) = how.settled_s {
            let since = since_change(&table.required("target")?.numbers, &time_s);
            kept.retain(|&row| since[row] >= settled_s);
        }
        let row = |&row: &usize| Row {
            line: table.lines[row],
            time_s: time_s[row],
            series: series[row],
            motion: motions[row],
            key: keys.as_ref().map(|keys| keys[row]),
            held_out: held[row],
        };
        let rows: Vec<Row> = kept.iter().map(row).collect();
        let filter = how.lowpass_hz.map(|corner| low_pass(corner, rate_hz(&time_s, &series))).transpose()?;
        let fresh = how.interpolate.as_deref().map(|name| table.flags(name)).transpose()?;
        let pick = |values: &[f64]| kept.iter().map(|&row| values[row]).collect();
        let [kept_series, kept_motions] =
            [&series, &motions].map(|stretches| kept.iter().map(|&row| stretches[row]).collect());
        Ok(Self {
            rows,
            time_s: pick(&time_s),
            series: kept_series,
            motions: kept_motions,
            held_out,
            findings,
            table,
            all_time_s: time_s,
            all_series: series,
            fresh,
            filter,
            kept,
        })
    }

    /// The channel of a quantity.
    pub fn channel(&self, quantity: &str) -> Result<Vec<f64>, ReadError> {
        Ok(self.thin(&self.full(&self.table.required(quantity)?.numbers, false)))
    }

    /// The same where there is one.
    pub fn optional(&self, quantity: &str) -> Option<Vec<f64>> {
        self.table.quantity(quantity).map(|column| self.thin(&self.full(&column.numbers, false)))
    }

    /// Position, velocity and acceleration from one channel; `posture`: it is interpolated between fresh rows, and an angle.
    pub fn motion(&self, quantity: &str, posture: bool) -> Result<[Vec<f64>; 3], ReadError> {
        let position = self.full(&self.table.required(quantity)?.numbers, posture);
        Ok(self.rates(position))
    }

    /// A channel of every row with its rates, thinned.
    pub fn rates(&self, position: Vec<f64>) -> [Vec<f64>; 3] {
        let velocity = rate(&position, &self.all_time_s, &self.all_series);
        let acceleration = rate(&velocity, &self.all_time_s, &self.all_series);
        [position, velocity, acceleration].map(|channel| self.thin(&channel))
    }

    /// A channel of every row as the table has it; `None` without that quantity.
    pub fn raw(&self, quantity: &str) -> Option<&[f64]> {
        self.table.quantity(quantity).map(|column| &column.numbers[..])
    }

    /// A channel of every row, interpolated when it is a posture, filtered.
    pub fn full(&self, numbers: &[f64], posture: bool) -> Vec<f64> {
        let mut values = numbers.to_vec();
        if posture {
            values = unwrapped(&values);
            if let Some(fresh) = &self.fresh {
                values = interpolated(&values, &self.all_time_s, fresh);
            }
        }
        if let Some((filter, settle)) = &self.filter {
            filter.apply(&mut values, &self.all_series, *settle);
        }
        values
    }

    /// A channel of the kept rows through the low-pass again; unchanged where rows were decimated or nothing is filtered.
    pub fn again(&self, values: &mut [f64]) {
        if let (Some((filter, settle)), true) = (&self.filter, self.kept.len() == self.all_time_s.len()) {
            filter.apply(values, &self.series, *settle);
        }
    }

    /// The words of a column at the kept rows.
    pub fn words(&self, name: &str) -> Result<Vec<&str>, PrepareError> {
        let column = self.table.chosen(name)?;
        Ok(self.kept.iter().map(|&row| column.words[row].as_str()).collect())
    }

    /// The unit of a quantity.
    pub fn unit(&self, quantity: &str) -> &'static str {
        self.table.quantity(quantity).map_or("", |column| column.unit)
    }

    fn thin(&self, values: &[f64]) -> Vec<f64> {
        self.kept.iter().map(|&row| values[row]).collect()
    }
}

/// When each row was measured, s; without a column of time they follow each other at a rate.
fn times_s(table: &Table, rate_hz: Option<f64>) -> Vec<f64> {
    let step_s = rate_hz.map_or(1.0, |hz| 1.0 / hz);
    let counted = || (0..table.lines.len()).map(|row| row as f64 * step_s).collect();
    table.quantity("time").map_or_else(counted, |column| column.numbers.clone())
}

/// Leaves out rows in which a column of numbers has none; says which.
fn leave_out_gaps(table: &mut Table, findings: &mut Vec<Finding>) {
    let mut keep = vec![true; table.lines.len()];
    for column in &table.columns {
        let numbers = column.numbers.iter().filter(|number| number.is_finite()).count();
        if 2 * numbers <= column.numbers.len() {
            continue;
        }
        for (row, number) in column.numbers.iter().enumerate().filter(|(_, number)| !number.is_finite()) {
            let text =
                format!("{} is `{}`, not a number ({number}): the row is left out", column.name, column.words[row]);
            let finding = Finding::note(FindingKind::NotANumber, text).at_line(table.lines[row]);
            findings.push(finding.in_column(&column.name));
            keep[row] = false;
        }
    }
    if keep.contains(&false) {
        table.retain(&keep);
    }
}

fn constant(table: &Table, findings: &mut Vec<Finding>) {
    for column in table.columns.iter().filter(|column| column.numbers.len() > 10) {
        if column.numbers.windows(2).all(|pair| pair[0] == pair[1]) {
            let finding = Finding::note(FindingKind::ConstantColumn, format!("{} never changes", column.name));
            findings.push(finding.in_column(&column.name));
        }
    }
}

/// Numbers that look like another unit than the one they are read in.
fn units(table: &Table, findings: &mut Vec<Finding>) {
    for column in &table.columns {
        let largest =
            column.numbers.iter().filter(|number| number.is_finite()).fold(0.0f64, |most, n| most.max(n.abs()));
        let joint = column.quantity.strip_prefix('q').is_some_and(|number| number.parse::<u8>().is_ok());
        let doubt = match (column.meaning(), column.unit) {
            (_, "" | "rad") if joint && largest > LARGEST_ANGLE => ("rad", "degrees", "_deg"),
            ("position", "" | "m") if largest > LARGEST_LENGTH => ("m", "millimetres", "_mm"),
            ("pressure", _) if largest > 0.0 && largest < LEAST_PRESSURE => ("Pa", "bar", "_bar"),
            _ => continue,
        };
        let (read, meant, end) = doubt;
        let text = format!(
            "{} goes up to {largest} {read}: are these {meant}? a column whose name ends in {end} is read so",
            column.name
        );
        findings.push(Finding::note(FindingKind::SuspectedUnit, text).in_column(&column.name));
    }
}

/// A low-pass with this corner, and how many rows it settles in.
fn low_pass(corner_hz: f64, rate_hz: f64) -> Result<(LowPass, usize), PrepareError> {
    let none = || {
        let min_rate = 2.0 * corner_hz;
        let what =
            format!("a low-pass at {corner_hz} Hz needs more than {min_rate} rows a second, there are {rate_hz:.1}");
        PrepareError::Nothing(what)
    };
    Ok((LowPass::new(corner_hz, rate_hz).ok_or_else(none)?, 2 * (rate_hz / corner_hz).ceil() as usize))
}

/// The stretch and the motion of each row: a new one where a column of `within` changes, where time runs back, and where
/// rows are missing; a new stretch also where rows begin or end to be held out.
fn series(
    table: &Table,
    within: &[String],
    time_s: &[f64],
    held: &[bool],
    findings: &mut Vec<Finding>,
) -> Result<(Vec<usize>, Vec<usize>), PrepareError> {
    let mut parts = Vec::new();
    for name in within.iter().map(String::as_str).chain(table.quantity("run").map(|column| column.name.as_str())) {
        parts.push(&table.chosen(name)?.words);
    }
    let usual = rate_hz(time_s, &vec![0; time_s.len()]);
    let (mut series, mut motions) = (vec![0; time_s.len()], vec![0; time_s.len()]);
    for row in 1..time_s.len() {
        let step = time_s[row] - time_s[row - 1];
        let is_parted = parts.iter().any(|words| words[row] != words[row - 1]);
        if step < 0.0 && !is_parted {
            let text = "time runs back here: rows before and after are not joined";
            findings.push(Finding::note(FindingKind::TimeRunsBack, text).at_line(table.lines[row]));
        }
        let gap = usual > 0.0 && step * usual > 5.0;
        let border = is_parted || step < 0.0 || gap;
        motions[row] = motions[row - 1] + usize::from(border);
        series[row] = series[row - 1] + usize::from(border || held[row] != held[row - 1]);
    }
    Ok((series, motions))
}

/// Time since a channel last changed, s.
fn since_change(values: &[f64], time_s: &[f64]) -> Vec<f64> {
    let mut changed = time_s.first().copied().unwrap_or_default();
    let mut since = Vec::with_capacity(values.len());
    for (row, time) in time_s.iter().enumerate() {
        if row > 0 && (values[row] != values[row - 1] || *time < time_s[row - 1]) {
            changed = *time;
        }
        since.push(time - changed);
    }
    since
}
