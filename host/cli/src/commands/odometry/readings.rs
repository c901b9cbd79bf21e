//! Readings of two encoders from a table.

use std::f64::consts::{PI, TAU};
use std::path::Path;

use darm_core::odometry::Drive;
use darm_robot::csv_table::{CsvError, CsvFault, CsvTable};

use crate::failure::Usage;

/// What the wheels did between two rows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reading {
    /// Time at its end, s.
    pub(super) t_s: Option<f64>,
    pub(super) duration_s: Option<f64>,
    /// Travel of the left and the right wheel, m.
    pub(super) travel_m: [f64; 2],
}

/// What the columns of a table hold.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Ticks,
    Counts,
    Speeds,
}

/// Endings of the columns, their meaning, and the factor to ticks or rad/s.
const COLUMNS: [(&str, Kind, f64); 4] = [
    ("ticks", Kind::Ticks, 1.0),
    ("count", Kind::Counts, 1.0),
    ("rad_s", Kind::Speeds, 1.0),
    ("deg_s", Kind::Speeds, PI / 180.0),
];

/// Numbers of the table, row by row.
struct Rows {
    kind: Kind,
    t_s: Option<Vec<f64>>,
    wheels: Vec<[f64; 2]>,
    /// The line of each row.
    lines: Vec<usize>,
}

/// The readings of a table.
pub(super) fn read(
    path: &Path,
    drive: &Drive<f64>,
    ticks_per_turn: Option<f64>,
    counter_bits: Option<u32>,
) -> anyhow::Result<Vec<Reading>> {
    let shown = path.display();
    let Rows { kind, t_s, mut wheels, lines } = rows(path)?;
    let counter = match (counter_bits, kind) {
        (Some(_), Kind::Speeds) => {
            return Err(Usage(format!("--counter-bits: {shown} has speeds, which no counter wraps")).into());
        }
        (Some(bits), Kind::Counts | Kind::Ticks) => Some(f64::from(bits).exp2()),
        (None, _) => None,
    };
    match kind {
        Kind::Counts => {
            for side in [0, 1] {
                unwrap(&mut wheels, side, counter, &|row| format!("{shown}:{}", lines[row]))?;
            }
        }
        Kind::Ticks => {
            for (row, ticks) in wheels.iter_mut().enumerate() {
                for ticks in ticks {
                    *ticks = step(*ticks, counter)
                        .map_err(|bits| asked(&format!("{shown}:{}", lines[row]), *ticks, bits))?;
                }
            }
        }
        Kind::Speeds => {}
    }
    if kind != Kind::Speeds && ticks_per_turn.is_none() {
        return Err(Usage(format!("{shown}: the columns are ticks; give --ticks-per-turn")).into());
    }
    let per_tick = TAU * drive.radius_m / drive.ticks_per_turn;
    let time = |row: usize| t_s.as_ref().map(|times| times[row]);
    let duration = |row: usize| time(row).zip(row.checked_sub(1).and_then(time)).map(|(end, start)| end - start);
    let reading = |row: usize, travel_m: [f64; 2]| Reading { t_s: time(row), duration_s: duration(row), travel_m };
    let pairs = || wheels.windows(2).enumerate().map(|(row, pair)| (row + 1, pair[0], pair[1]));
    Ok(match kind {
        Kind::Ticks => {
            wheels.iter().enumerate().map(|(row, ticks)| reading(row, ticks.map(|ticks| ticks * per_tick))).collect()
        }
        Kind::Counts => pairs()
            .map(|(row, before, after)| reading(row, [0, 1].map(|k| (after[k] - before[k]) * per_tick)))
            .collect(),
        Kind::Speeds => pairs()
            .map(|(row, speeds, _)| {
                let seconds = duration(row).unwrap_or(0.0);
                reading(row, speeds.map(|speed| speed * drive.radius_m * seconds))
            })
            .collect(),
    })
}

/// Widths of counters of encoders whose wraps no step of a wheel is as long as, bits.
const WIDTHS: [u32; 3] = [16, 24, 32];
/// Values of the narrowest counter.
const MIN_VALUES: f64 = 16.0;
/// A step that is so near to a complete counter, as a share of it, is one of a counter that wrapped.
const NEAR_WRAP: f64 = 0.25;

/// A step of a counter of this many values that wraps: the one nearest to 0. `Err` where no width was given and the step is as
/// long as one of a counter that wrapped: its bits.
fn step(ticks: f64, counter: Option<f64>) -> Result<f64, u32> {
    if let Some(values) = counter {
        return Ok(ticks - values * (ticks / values).round());
    }
    let is_wrapped = |bits: &&u32| {
        let values = f64::from(**bits).exp2();
        ticks.abs() < values && ticks.abs() > (1.0 - NEAR_WRAP) * values
    };
    WIDTHS.iter().find(is_wrapped).map_or(Ok(ticks), |bits| Err(*bits))
}

/// Running totals without the wraps of their counter.
fn unwrap(
    wheels: &mut [[f64; 2]],
    side: usize,
    counter: Option<f64>,
    place: &dyn Fn(usize) -> String,
) -> Result<(), Usage> {
    let steps: Vec<f64> = wheels.windows(2).map(|pair| pair[1][side] - pair[0][side]).collect();
    let counts = || wheels.iter().map(|counts| counts[side]);
    // All counts are within those that the counter has.
    let min_values = (counts().fold(f64::MIN, f64::max) - counts().fold(f64::MAX, f64::min)).max(MIN_VALUES);
    for (row, ticks) in (1..).zip(&steps) {
        if let Some(values) = wrapped(&steps, row - 1).filter(|values| counter.is_none() && *values >= min_values) {
            let bits = values.log2().round();
            let is_binary = (bits.exp2() - values).abs() < NEAR_WRAP * values;
            return Err(if is_binary {
                asked(&place(row), *ticks, bits as u32)
            } else {
                begun_again(&place(row), *ticks)
            });
        }
        let ticks = step(*ticks, counter).map_err(|bits| asked(&place(row), *ticks, bits))?;
        wheels[row][side] = wheels[row - 1][side] + ticks;
    }
    Ok(())
}

/// How many values a counter has that wrapped in this step: one against those before and after it, and longer than both together.
fn wrapped(steps: &[f64], at: usize) -> Option<f64> {
    let [before, own, after] = *steps.get(at.checked_sub(1)?..=at + 1)? else { return None };
    let is_against = own * before < 0.0 && own * after < 0.0;
    (is_against && own.abs() > (before + after).abs()).then(|| own.abs() + 0.5 * (before + after).abs())
}

/// Whether a counter wrapped, as a question with both answers.
fn asked(place: &str, ticks: f64, bits: u32) -> Usage {
    let values = f64::from(bits).exp2();
    let short = ticks - values * ticks.signum();
    Usage(format!(
        "{place}: a step of {ticks} ticks: did a counter of {bits} bits wrap, a step of {short}? give --counter-bits {bits}; if \
         the wheel turned so far, give --counter-bits 53"
    ))
}

fn rows(path: &Path) -> Result<Rows, CsvError> {
    let table = CsvTable::read(path)?;
    let at = |name: &str| table.column(name);
    let found = COLUMNS.iter().find_map(|(ending, kind, factor)| {
        Some(([at(&format!("left_{ending}"))?, at(&format!("right_{ending}"))?], *kind, *factor))
    });
    let Some((sides, kind, factor)) = found else {
        let pairs = "left_ticks and right_ticks, left_count and right_count, or left_rad_s and right_rad_s";
        return Err(table.no_column(pairs));
    };
    let time = at("t_s");
    if kind == Kind::Speeds && time.is_none() {
        return Err(table.no_column("t_s, the time of each row in s, which speeds need"));
    }
    let (mut wheels, mut times, mut lines) = (Vec::new(), Vec::new(), Vec::new());
    for row in table.rows() {
        lines.push(row.line());
        wheels.push([row.number(sides[0])? * factor, row.number(sides[1])? * factor]);
        if let Some(column) = time {
            let time_s = row.number(column)?;
            if times.last().is_some_and(|before| *before >= time_s) {
                let what = "the time does not increase; sort the rows by time";
                return Err(row.wrong(column, CsvFault::Row(what.into())));
            }
            times.push(time_s);
        }
    }
    let min_rows = if kind == Kind::Ticks { 1 } else { 2 };
    if wheels.len() < min_rows {
        return Err(table.wrong(CsvFault::Row("too few rows; add rows, counts and speeds need two".into())));
    }
    Ok(Rows { kind, t_s: time.map(|_| times), wheels, lines })
}

/// That a counter began again, and not as one of bits does.
fn begun_again(place: &str, ticks: f64) -> Usage {
    Usage(format!(
        "{place}: a step of {ticks} ticks against those before and after it: did the counter begin again? write totals that run on, or \
         the ticks since the row before in left_ticks and right_ticks; if the wheel turned so far, give --counter-bits 53"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_counter_that_wraps_gives_the_step_nearest_to_zero_and_is_asked_for() {
        let bits = |bits: u32| Some(f64::from(bits).exp2());
        assert_eq!(
            [step(65_236.0, bits(16)), step(-65_236.0, bits(16)), step(-300.0, bits(16))],
            [Ok(-300.0), Ok(300.0), Ok(-300.0)]
        );
        assert_eq!(
            (step(65_236.0, None), step(-300.0, None), step(4_294_967_000.0, None)),
            (Err(16), Ok(-300.0), Err(32))
        );
        assert_eq!(step(65_236.0, bits(53)), Ok(65_236.0));
        let mut wheels = [[100.0, 130.0], [65_336.0, 65_376.0], [65_036.0, 65_086.0], [100.0, 130.0]];
        for side in [0, 1] {
            unwrap(&mut wheels, side, bits(16), &|row| row.to_string()).unwrap();
        }
        assert_eq!(wheels, [[100.0, 130.0], [-200.0, -160.0], [-500.0, -450.0], [100.0, 130.0]]);
        // Of 12 bits, and one that an index sets to 0 after 4000.
        let asks = |values: f64| {
            let mut wheels: Vec<[f64; 2]> = (0..9).map(|k| [(f64::from(k) * 600.0) % values; 2]).collect();
            unwrap(&mut wheels, 0, None, &|row| row.to_string()).map_err(|error| error.0)
        };
        assert!(asks(4096.0).unwrap_err().starts_with("7: a step of -3496 ticks: did a counter of 12 bits wrap"));
        assert!(asks(2900.0).unwrap_err().contains("write totals that run on"), "{:?}", asks(2900.0));
        assert_eq!(asks(1e9), Ok(()));
        let asked = asked("a.csv:5", 65_236.0, 16).0;
        assert!(asked.contains("a.csv:5: a step of 65236 ticks") && asked.contains("--counter-bits 16;"), "{asked}");
    }
}
