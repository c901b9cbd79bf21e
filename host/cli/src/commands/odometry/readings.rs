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
}

/// The readings of a table.
pub(super) fn read(path: &Path, drive: &Drive<f64>, ticks_per_turn: Option<f64>) -> anyhow::Result<Vec<Reading>> {
    let shown = path.display();
    let Rows { kind, t_s, wheels } = rows(path)?;
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
    let (mut wheels, mut times) = (Vec::new(), Vec::new());
    for row in table.rows() {
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
    Ok(Rows { kind, t_s: time.map(|_| times), wheels })
}
