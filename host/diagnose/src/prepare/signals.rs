//! A table prepared: rows chosen, segments found, rows held out, signals filtered and decimated, with findings.

use std::borrow::Cow;
use std::sync::Arc;

use crate::prepare::column_reading::ColumnReading;
use crate::prepare::damaged_cells;
pub use crate::prepare::error::PrepareError;
use crate::prepare::groups::SignalRow;
use crate::prepare::sampling::{self, Sampling};
use crate::prepare::table_findings::{check_times, constant, first_not_a_number, leave_out_gaps, units};
use crate::prepare::thinning::one_of_each_part;
use crate::prepare::turns;
use darm_measure::even_grid::EvenGrid;
use darm_measure::hold_out::{HeldOut, HoldOut};
use darm_measure::select::Selection;
use darm_measure::signal::{LowPass, interpolated, stretches, unwrapped};
use darm_measure::table::Table;
use darm_measure::{Finding, FindingKind, ReadError, demean};

/// Rows up to which all are looked at where nothing is said.
const MAX_ROWS: usize = 10_000;
/// Steps of time longer than this, in usual ones, are gaps: nothing is interpolated across.
pub(crate) const MAX_STEP: f64 = 5.0;

/// What varies by this share within the stretches, of how much it varies in all, is at rest there.
const AT_REST: f64 = 0.01;

/// How a table is made ready.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Preparation {
    /// Rows that count; `None`: all.
    pub keep: Option<Selection>,
    /// Rows that no fit may see.
    pub hold_out: HoldOut,
    /// Columns whose values part the rows into stretches.
    pub segment_by: Vec<String>,
    /// Rows a second, where the table has no time.
    pub rate_hz: Option<f64>,
    /// Rows a second that are kept, as near as integer steps come; `None`: all of them up to 10 000, and of more about as
    /// many.
    pub thin_hz: Option<f64>,
    /// Corner of the low-pass on all channels.
    pub lowpass_hz: Option<f64>,
    /// A column that is 0 where a row only repeats the one before.
    pub interpolate: Option<String>,
    /// Rows sooner than this after a change of target do not count, s.
    pub skip_after_change_s: Option<f64>,
}

/// A table made ready. Channels have one number a row that is kept.
pub struct Prepared {
    /// The rows that are kept.
    pub rows: Vec<SignalRow>,
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
    /// How the table was sampled.
    pub sampling: Sampling,
    all: Arc<AllRows>,
    reading: ColumnReading,
    kept: Vec<usize>,
    is_sample: bool,
}

/// A table before rows of it are kept.
struct AllRows {
    table: Table,
    time_s: Vec<f64>,
    /// The stretch of each row.
    series: Vec<usize>,
    /// Of what is predicted, which no filter carries to or from rows that are held out.
    grid: EvenGrid,
    /// Of positions, from which it is predicted: their rates need the rows on both sides.
    motion_grid: EvenGrid,
    fresh: Option<Vec<bool>>,
    filter: Option<(LowPass, usize)>,
}

impl Prepared {
    /// Makes a table ready; with `each` the rows of that value of the column are held out.
    ///
    /// # Errors
    ///
    /// A column that `how` names is missing, or holds what is not a flag; no row is left; time does not increase; or
    /// the rows are too rare for the low-pass.
    pub fn new(mut table: Table, how: &Preparation, each: Option<&str>) -> Result<Self, PrepareError> {
        let mut findings = Vec::new();
        if let Some(keep) = &how.keep {
            let keep = keep.rows(&table)?;
            table.retain(&keep);
        }
        leave_out_gaps(&mut table, &mut findings);
        damaged_cells::repair(&mut table, &mut findings);
        if table.lines.is_empty() {
            return Err(PrepareError::Nothing("no row is left, there is nothing to diagnose".into()));
        }
        constant(&table, &mut findings);
        units(&table, &mut findings);
        let mut time_s = times_s(&table, how.rate_hz);
        check_times(&table, &time_s)?;
        let chosen = how.hold_out.rows(&table, each)?;
        findings.extend(chosen.nothing(&how.hold_out));
        let HeldOut { rows: is_held_out, description: held_out, keys } = chosen;
        let motions = motions(&table, &how.segment_by, &time_s, &mut findings)?;
        turns::unwrap(&mut table, &motions, &mut findings);
        let sampling = sampling::find(&mut time_s, &motions, &moving_channels(&table));
        findings.extend(sampling.sentence().map(|text| Finding::note(FindingKind::UnevenSampling, text)));
        let series = parted_by(&is_held_out, &motions);
        let [grid, motion_grid] = [&series, &motions].map(|parts| EvenGrid::new(&time_s, parts, sampling.period_s));
        let every = decimation(how, table.lines.len(), sampling.rate_hz(), &mut findings);
        let thinned = |stretch: std::ops::Range<usize>| stretch.step_by(every);
        let mut kept: Vec<usize> = stretches(&series).into_iter().flat_map(thinned).collect();
        if let Some(skip_after_change_s) = how.skip_after_change_s {
            let since = since_change(&table.required("target")?.numbers, &time_s);
            kept.retain(|&row| since[row] >= skip_after_change_s);
        }
        let mut rows = Vec::with_capacity(kept.len());
        for &row in &kept {
            let key = keys.as_ref().map(|keys| keys[row]);
            let (line, time_s, series, motion) = (table.lines[row], time_s[row], series[row], motions[row]);
            rows.push(SignalRow { line, time_s, series, motion, key, held_out: is_held_out[row] });
        }
        let filter = how.lowpass_hz.map(|corner| low_pass(corner, sampling.rate_hz())).transpose()?;
        let fresh = how.interpolate.as_deref().map(|name| table.flags(name)).transpose()?;
        let all = Arc::new(AllRows { table, time_s, series, grid, motion_grid, fresh, filter });
        let data = Self {
            rows,
            time_s: Vec::new(),
            series: Vec::new(),
            motions: Vec::new(),
            held_out,
            findings,
            sampling,
            all,
            reading: ColumnReading::default(),
            kept,
            is_sample: false,
        };
        Ok(data.with_times())
    }

    /// Times, stretches and motions by those of the rows.
    fn with_times(mut self) -> Self {
        self.time_s = self.rows.iter().map(|row| row.time_s).collect();
        self.series = self.rows.iter().map(|row| row.series).collect();
        self.motions = self.rows.iter().map(|row| row.motion).collect();
        self
    }

    /// The same table with its columns read in another way, and at most `max_rows` of those rows from which the one
    /// `rows_later` is in the same stretch.
    pub(crate) fn read_as(&self, reading: ColumnReading, rows_later: isize, max_rows: usize) -> Self {
        let series = &self.all.series;
        let is_inside = |&k: &usize| {
            let other = self.kept[k].checked_add_signed(rows_later);
            other.and_then(|other| series.get(other)) == Some(&series[self.kept[k]])
        };
        let inside: Vec<usize> = (0..self.kept.len()).filter(is_inside).collect();
        let chosen: Vec<usize> =
            one_of_each_part(inside.len(), max_rows).into_iter().map(|drawn| inside[drawn]).collect();
        let data = Self {
            rows: chosen.iter().map(|&k| self.rows[k]).collect(),
            time_s: Vec::new(),
            series: Vec::new(),
            motions: Vec::new(),
            held_out: self.held_out.clone(),
            findings: Vec::new(),
            sampling: self.sampling.clone(),
            all: Arc::clone(&self.all),
            reading,
            kept: chosen.iter().map(|&k| self.kept[k]).collect(),
            is_sample: true,
        };
        data.with_times()
    }

    /// Whether it is a sample of the rows, to compare readings on.
    pub(crate) fn is_sample(&self) -> bool {
        self.is_sample
    }

    /// Rows of the table that count, before any is left out for its rate.
    pub(crate) fn n_all_rows(&self) -> usize {
        self.all.time_s.len()
    }

    /// The channel of a quantity, in SI units.
    ///
    /// # Errors
    ///
    /// [`ReadError::NoQuantity`]: no column holds this quantity.
    pub fn channel(&self, quantity: &str) -> Result<Vec<f64>, ReadError> {
        Ok(self.thin(&self.filtered(self.required(quantity)?.into_owned(), &self.all.grid)))
    }

    /// The signal of a quantity, filtered as [`channel`](Self::channel) does; `None` where no column holds it.
    pub fn optional(&self, quantity: &str) -> Option<Vec<f64>> {
        self.raw(quantity).map(|numbers| self.thin(&self.filtered(numbers.into_owned(), &self.all.grid)))
    }

    /// The numbers of a quantity at the kept rows as the table has them, through no low-pass; `None` where there is none.
    pub fn unfiltered(&self, quantity: &str) -> Option<Vec<f64>> {
        self.raw(quantity).map(|numbers| self.thin(&numbers))
    }

    fn required(&self, quantity: &str) -> Result<Cow<'_, [f64]>, ReadError> {
        self.raw(quantity)
            .map_or_else(|| self.all.table.required(quantity).map(|column| Cow::Borrowed(&column.numbers[..])), Ok)
    }

    /// Position, velocity and acceleration from one channel; `posture`: it is interpolated between fresh rows, and an angle.
    ///
    /// # Errors
    ///
    /// [`ReadError::NoQuantity`]: no column holds this quantity.
    pub fn motion(&self, quantity: &str, posture: bool) -> Result<[Vec<f64>; 3], ReadError> {
        let position = self.full(&self.required(quantity)?, posture);
        Ok(self.rates(position))
    }

    /// A channel of every row with its rates, thinned.
    pub fn rates(&self, position: Vec<f64>) -> [Vec<f64>; 3] {
        let AllRows { motion_grid, filter, .. } = &*self.all;
        let [velocity, acceleration] = match filter {
            Some(_) => motion_grid.rates_of_smooth(&position),
            None => motion_grid.rates(&position),
        };
        [position, velocity, acceleration].map(|channel| self.thin(&channel))
    }

    /// A channel of every row as the table has it; `None` without that quantity.
    pub fn raw(&self, quantity: &str) -> Option<Cow<'_, [f64]>> {
        self.reading.numbers(&self.all.table, quantity)
    }

    /// Why the first row in which a quantity is not a number below `largest` cannot be used; `None` where there is none.
    pub(crate) fn first_not_a_number(&self, quantity: &str, largest: f64) -> Option<PrepareError> {
        first_not_a_number(&self.all.table, quantity, largest)
    }

    /// Whether a quantity changes within the stretches: where a robot is measured at rest, posture after posture, none does.
    pub(crate) fn changes_within_stretches(&self, quantity: &str) -> bool {
        let Some(numbers) = self.raw(quantity) else { return false };
        let squares = |numbers: &[f64]| demean(numbers).iter().map(|off| off * off).sum::<f64>();
        let within: f64 = stretches(&self.all.series).into_iter().map(|stretch| squares(&numbers[stretch])).sum();
        within > AT_REST * AT_REST * squares(&numbers)
    }

    /// Positions in every row, interpolated when they are a posture, filtered.
    pub fn full(&self, numbers: &[f64], posture: bool) -> Vec<f64> {
        let mut values = numbers.to_vec();
        if posture {
            values = unwrapped(&values);
            if let Some(fresh) = &self.all.fresh {
                values = interpolated(&values, &self.all.time_s, fresh);
            }
        }
        self.filtered(values, &self.all.motion_grid)
    }

    fn filtered(&self, mut values: Vec<f64>, grid: &EvenGrid) -> Vec<f64> {
        if let Some((filter, settle)) = &self.all.filter {
            grid.apply(&mut values, |part| filter.smooth(part, *settle));
        }
        values
    }

    /// A channel of the kept rows through the low-pass again; unchanged where rows were decimated or nothing is filtered.
    pub fn again(&self, values: &mut [f64]) {
        if let (Some((filter, settle)), true) = (&self.all.filter, self.kept.len() == self.all.time_s.len()) {
            self.all.grid.apply(values, |part| filter.smooth(part, *settle));
        }
    }

    /// The words of a column at the kept rows.
    ///
    /// # Errors
    ///
    /// [`SelectError::NoColumn`](darm_measure::SelectError::NoColumn): no column has this name.
    pub fn words(&self, name: &str) -> Result<Vec<&str>, PrepareError> {
        let column = self.all.table.chosen(name)?;
        Ok(self.kept.iter().map(|&row| column.words[row].as_str()).collect())
    }

    /// The unit of a quantity.
    pub fn unit(&self, quantity: &str) -> &'static str {
        self.all.table.quantity(quantity).map_or("", |column| column.unit)
    }

    fn thin(&self, values: &[f64]) -> Vec<f64> {
        self.kept.iter().map(|&row| values[row]).collect()
    }
}

/// One row of how many is kept.
fn decimation(how: &Preparation, n_rows: usize, rate_hz: f64, findings: &mut Vec<Finding>) -> usize {
    if let Some(hz) = how.thin_hz {
        return (rate_hz / hz).round().max(1.0) as usize;
    }
    let every = n_rows.div_ceil(MAX_ROWS);
    if every > 1 {
        let text = format!("decimated by {every}, of {n_rows} rows; override with --thin");
        findings.push(Finding::note(FindingKind::Decimated, text));
    }
    every
}

/// When each row was measured, s; without a column of time they follow each other at a rate.
fn times_s(table: &Table, rate_hz: Option<f64>) -> Vec<f64> {
    let step_s = rate_hz.map_or(1.0, |hz| 1.0 / hz);
    let counted = || (0..table.lines.len()).map(|row| row as f64 * step_s).collect();
    table.quantity("time").map_or_else(counted, |column| column.numbers.clone())
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

/// The motion of each row: a new one where a column of `segment_by`, the run or the payload changes, where time runs back, and
/// at gaps.
fn motions(
    table: &Table,
    segment_by: &[String],
    time_s: &[f64],
    findings: &mut Vec<Finding>,
) -> Result<Vec<usize>, PrepareError> {
    let mut parts = Vec::new();
    let own = ["run", "payload"].into_iter().filter_map(|quantity| table.quantity(quantity));
    for name in segment_by.iter().chain(own.map(|column| &column.name)) {
        parts.push(&table.chosen(name)?.words);
    }
    let steps_s: Vec<f64> = time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let longest_s = MAX_STEP * sampling::usual_step_s(&steps_s);
    let (mut motions, mut gaps_s) = (vec![0; time_s.len()], Vec::new());
    for row in 1..time_s.len() {
        let step_s = steps_s[row - 1];
        let is_parted = parts.iter().any(|words| words[row] != words[row - 1]);
        if step_s < 0.0 && !is_parted {
            let text = "time runs back here: rows before and after are not joined";
            findings.push(Finding::note(FindingKind::TimeRunsBack, text).at_line(table.lines[row]));
        }
        let is_gap = longest_s > 0.0 && step_s > longest_s;
        if is_gap && !is_parted {
            gaps_s.push(step_s);
        }
        motions[row] = motions[row - 1] + usize::from(is_parted || step_s < 0.0 || is_gap);
    }
    if !gaps_s.is_empty() {
        let longest_s = gaps_s.iter().copied().fold(0.0, f64::max);
        let text = format!("{} gaps in time, the longest {longest_s:.3} s: not joined", gaps_s.len());
        findings.push(Finding::note(FindingKind::UnevenSampling, text));
    }
    Ok(motions)
}

/// The stretch of each row: a motion, parted where rows begin or end to be held out.
fn parted_by(held_out: &[bool], motions: &[usize]) -> Vec<usize> {
    let mut series = vec![0; motions.len()];
    for row in 1..motions.len() {
        let is_border = motions[row] != motions[row - 1] || held_out[row] != held_out[row - 1];
        series[row] = series[row - 1] + usize::from(is_border);
    }
    series
}

/// Columns of numbers that change in at least a tenth of the rows: their smoothness shows when they were sampled.
fn moving_channels(table: &Table) -> Vec<&[f64]> {
    let is_moving = |numbers: &[f64]| {
        let changes = numbers.windows(2).filter(|pair| pair[0] != pair[1]).count();
        numbers.iter().all(|number| number.is_finite()) && 10 * changes >= numbers.len()
    };
    let columns = table.columns.iter().filter(|column| column.meaning() != "time");
    columns.map(|column| &column.numbers[..]).filter(|numbers| is_moving(numbers)).collect()
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
