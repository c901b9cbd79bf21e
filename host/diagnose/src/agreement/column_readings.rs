//! The ways in which the columns of a log, or its robot's mounting, may be read.

use std::f64::consts::FRAC_PI_2;

use darm_core::real::Vec3;

use crate::linearise::experiment::Columns;
use crate::linearise::model::{Model, What};
use crate::misreading::Misreading;
use crate::prepare::column_reading::ColumnReading;
use crate::prepare::signals::Prepared;

/// Delays that are tried first, rows either way.
const DELAYS: [isize; 14] = [1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 64, 128, 256, 512];
/// A delay that is shorter is that of a drive, for which there is a law.
const MIN_DELAY_S: f64 = 0.01;
/// The longest delay that is tried, share of the rows.
const LONGEST: f64 = 0.1;
/// Joints up to which the motions of each two are exchanged, and each is turned round.
const MAX_JOINTS: usize = 12;

/// One way to read model and log.
pub(super) struct Reading {
    pub(super) misreading: Misreading,
    pub(super) columns: ColumnReading,
    /// The model, where that is read in another way.
    pub(super) model: Option<Model>,
}

impl Reading {
    /// Model and log as they are.
    pub(super) fn as_it_is() -> Self {
        Self::of(Misreading::Delay { delay_s: 0.0 }, ColumnReading::default())
    }

    fn of(misreading: Misreading, columns: ColumnReading) -> Self {
        Self { misreading, columns, model: None }
    }
}

/// The readings that are tried.
pub(super) fn readings(model: &Model, data: &Prepared, columns: &Columns) -> Vec<Reading> {
    let Columns { measured, moving } = columns;
    let mut all = pairs_exchanged(measured);
    let few = if moving.len() <= MAX_JOINTS { &moving[..] } else { &[] };
    all.extend(pairs_exchanged(few));
    if few.len() > 2 {
        let (half, reversed) = (few.len() / 2, few.iter().rev().cloned().collect::<Vec<_>>());
        all.push(exchanged(&few[..half].concat(), &reversed[..half].concat()));
    }
    // Of a wrench forces or moments alone may have the other sign.
    let kinds = (0..measured.first().map_or(0, Vec::len))
        .map(|kind| measured.iter().filter_map(|group| group.get(kind).cloned()).collect());
    for columns in measured.iter().cloned().chain([measured.concat()]).chain(kinds).chain(few.iter().cloned()) {
        let reading = ColumnReading::scaled(&columns, -1.0);
        all.push(Reading::of(Misreading::InvertedColumns { columns }, reading));
    }
    for column in few.iter().filter_map(|columns| columns.first()) {
        for quarters in [1.0, 2.0, -1.0] {
            let zero = quarters * FRAC_PI_2;
            let misreading = Misreading::OtherZero { column: column.clone(), zero };
            all.push(Reading::of(misreading, ColumnReading::from_zero(column, zero)));
        }
    }
    let positions: Vec<String> = moving.iter().map(|columns| columns[0].clone()).collect();
    let in_degrees = ColumnReading::scaled(&positions, 1f64.to_radians());
    let misreading = Misreading::ColumnScale { columns: positions, factor: 1f64.to_degrees() };
    all.push(Reading::of(misreading, in_degrees));
    let longest = (LONGEST * data.n_all_rows() as f64) as isize;
    let is_tried = |rows: &isize| *rows <= longest && *rows as f64 * data.sampling.period_s >= MIN_DELAY_S;
    let delays = DELAYS.into_iter().filter(is_tried).flat_map(|rows| [rows, -rows]);
    all.extend(delays.map(|rows| late(data, &measured.concat(), rows)));
    all.extend(mounted(model));
    all
}

/// Each two groups of columns exchanged.
fn pairs_exchanged(groups: &[Vec<String>]) -> Vec<Reading> {
    let pairs = (0..groups.len()).flat_map(|a| (a + 1..groups.len()).map(move |b| (a, b)));
    pairs.map(|(a, b)| exchanged(&groups[a], &groups[b])).collect()
}

/// Two groups of columns exchanged.
fn exchanged(a: &[String], b: &[String]) -> Reading {
    let columns = [a, b].map(|columns| columns.join(", "));
    Reading::of(Misreading::ExchangedColumns { columns }, ColumnReading::exchanged(a, b))
}

/// Measured columns late or early.
fn late(data: &Prepared, measured: &[String], rows: isize) -> Reading {
    let misreading = Misreading::Delay { delay_s: rows as f64 * data.sampling.period_s };
    Reading::of(misreading, ColumnReading::late(measured, rows))
}

/// Delays near one, which is among them.
pub(super) fn around(data: &Prepared, measured: &[String], delay_s: f64) -> Vec<Reading> {
    let rows = (delay_s / data.sampling.period_s).round() as isize;
    let step = (rows.abs() / 16).max(1);
    let near = (-6..=6).map(|k| rows + k * step);
    let is_tried = |other: &isize| {
        other.signum() == rows.signum() && other.unsigned_abs() as f64 * data.sampling.period_s >= MIN_DELAY_S
    };
    near.filter(is_tried).map(|rows| late(data, measured, rows)).collect()
}

/// The robot mounted in other ways.
fn mounted(model: &Model) -> Vec<Reading> {
    let Some(robot) = model.what.robot().filter(|robot| !robot.floating) else { return Vec::new() };
    let size = robot.gravity.norm();
    let axes = (0..3).flat_map(|axis| [1.0, -1.0].map(|sign| Vec3::ith(axis, sign)));
    let other = axes.filter(|down| down.dot(&robot.gravity) < 0.5 * size);
    let reading = |down: Vec3<f64>| {
        let mut model = model.clone();
        if let What::Torque(robot, _) | What::Any(robot) | What::Wrench(robot) = &mut model.what {
            robot.gravity = down * size;
        }
        let misreading = Misreading::Mounting { down: [down.x, down.y, down.z] };
        Reading { misreading, columns: ColumnReading::default(), model: Some(model) }
    };
    other.map(reading).collect()
}
