//! The ways in which the columns of a log, or its robot's mounting, may be read.

use std::collections::BTreeSet;
use std::f64::consts::FRAC_PI_2;

use darm_core::real::Vec3;

use crate::linearise::experiment::{Moving, TableColumns};
use crate::linearise::model::Model;
use crate::misreading::Misreading;
use crate::prepare::column_reading::ColumnReading;
use crate::prepare::signals::Prepared;

/// Delays that are tried first, rows either way.
const DELAYS: [isize; 14] = [1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 64, 128, 256, 512];
/// Units of the same quantity that are mistaken for each other: N·mm, mN, kN.
const THOUSAND: [f64; 2] = [1e3, 1e-3];
/// Rows of a short delay.
const SHORT: isize = 8;
/// A delay that is shorter is that of a drive, for which there is a law.
const MIN_DELAY_S: f64 = 0.01;
/// The longest delay that is tried, share of the rows.
const LONGEST: f64 = 0.1;
/// Joints up to which the motions of each two are exchanged, and each is turned round.
const MAX_JOINTS: usize = 12;

/// What may be wrong, and model and log as they would have to be read then.
pub(super) struct Hypothesis {
    pub(super) misreading: Misreading,
    pub(super) columns: ColumnReading,
    /// The model, where that is read in another way.
    pub(super) model: Option<Model>,
}

impl Hypothesis {
    fn of(misreading: Misreading, columns: ColumnReading) -> Self {
        Self { misreading, columns, model: None }
    }

    /// Whether columns are late or early by a few rows.
    pub(super) fn is_short_delay(&self) -> bool {
        matches!(self.misreading, Misreading::Delay { .. }) && self.columns.rows_later().abs() <= SHORT
    }
}

/// What is tried.
pub(super) fn hypotheses(model: &Model, data: &Prepared, columns: &TableColumns) -> Vec<Hypothesis> {
    let TableColumns { measured, moving } = columns;
    let joints: Vec<Vec<String>> = moving.iter().map(|joint| joint.columns.clone()).collect();
    let mut all = pairs_exchanged(measured);
    let few = if joints.len() <= MAX_JOINTS { &joints[..] } else { &[] };
    all.extend(pairs_exchanged(few));
    if few.len() > 2 {
        let (half, reversed) = (few.len() / 2, few.iter().rev().cloned().collect::<Vec<_>>());
        all.push(exchanged(&few[..half].concat(), &reversed[..half].concat()));
    }
    all.extend(units(columns));
    let kinds = kinds(measured);
    let inverted: BTreeSet<Vec<String>> =
        measured.iter().cloned().chain([measured.concat()]).chain(kinds).chain(few.iter().cloned()).collect();
    all.extend(inverted.into_iter().filter(|columns| !columns.is_empty()).map(|columns| {
        let reading = ColumnReading::scaled(&columns, -1.0);
        Hypothesis::of(Misreading::InvertedColumns { columns }, reading)
    }));
    all.extend(of_angles(moving));
    if is_in_motion(data, moving) {
        let longest = (LONGEST * data.n_all_rows() as f64) as isize;
        let is_tried = |rows: &isize| *rows <= longest && *rows as f64 * data.sampling.period_s >= MIN_DELAY_S;
        let delays = DELAYS.into_iter().filter(is_tried).flat_map(|rows| [rows, -rows]);
        all.extend(delays.map(|rows| late(data, &measured.concat(), rows)));
    }
    all.extend(mounted(model));
    all
}

/// Whether a joint moves within the stretches: where all are at rest nothing shows a delay.
fn is_in_motion(data: &Prepared, moving: &[Moving]) -> bool {
    let mut positions = moving.iter().filter_map(|joint| joint.columns.first());
    moving.is_empty() || positions.any(|position| data.changes_within_stretches(position))
}

/// What was measured in units a thousand times larger or smaller.
pub(super) fn units(columns: &TableColumns) -> Vec<Hypothesis> {
    let kinds = kinds(&columns.measured).into_iter();
    kinds.flat_map(|columns| THOUSAND.map(|factor| in_unit(columns.clone(), factor))).collect()
}

/// Of a wrench forces or moments, which alone may have the other sign or unit.
fn kinds(measured: &[Vec<String>]) -> Vec<Vec<String>> {
    let of_kind = |kind: usize| measured.iter().filter_map(|group| group.get(kind).cloned()).collect();
    (0..measured.first().map_or(0, Vec::len)).map(of_kind).collect()
}

/// Angles from another zero, a few joints at most, and in degrees, with their rates or without.
fn of_angles(moving: &[Moving]) -> Vec<Hypothesis> {
    let turning: Vec<&Moving> = moving.iter().filter(|joint| joint.turns).collect();
    let angles: Vec<String> = turning.iter().filter_map(|joint| joint.columns.first().cloned()).collect();
    let mut all = Vec::new();
    for column in angles.iter().take(MAX_JOINTS) {
        for quarters in [1.0, 2.0, -1.0] {
            let zero = quarters * FRAC_PI_2;
            let misreading = Misreading::OtherZero { column: column.clone(), zero };
            all.push(Hypothesis::of(misreading, ColumnReading::from_zero(column, zero)));
        }
    }
    let with_rates: Vec<String> = turning.iter().flat_map(|joint| joint.columns.iter().cloned()).collect();
    let in_degrees: BTreeSet<Vec<String>> = [angles, with_rates].into_iter().filter(|all| !all.is_empty()).collect();
    all.extend(in_degrees.into_iter().map(|columns| in_unit(columns, 1f64.to_degrees())));
    all
}

/// Columns in another unit.
fn in_unit(columns: Vec<String>, factor: f64) -> Hypothesis {
    let reading = ColumnReading::scaled(&columns, 1.0 / factor);
    Hypothesis::of(Misreading::ColumnScale { columns, factor }, reading)
}

/// A quaternion whose columns hold its numbers in another order, or the inverse turn.
pub(super) fn quaternions() -> Vec<(Misreading, ColumnReading)> {
    let mut all = Vec::new();
    // What the columns qx, qy, qz and qw hold; as `scipy` and ROS write it, and as Eigen's constructor, MuJoCo and most papers do.
    for hold in [['x', 'y', 'z', 'w'], ['w', 'x', 'y', 'z'], ['y', 'z', 'w', 'x']] {
        for inverse in [false, true] {
            if hold[0] == 'x' && !inverse {
                continue;
            }
            let columns = ["qx", "qy", "qz", "qw"];
            let of = hold.iter().zip(columns).map(|(part, column)| {
                let factor = if inverse && *part != 'w' { -1.0 } else { 1.0 };
                (format!("q{part}"), column.to_string(), factor)
            });
            all.push((Misreading::Quaternion { hold, inverse }, ColumnReading::taken(of)));
        }
    }
    all
}

/// Each two groups of columns exchanged.
fn pairs_exchanged(groups: &[Vec<String>]) -> Vec<Hypothesis> {
    let pairs = (0..groups.len()).flat_map(|a| (a + 1..groups.len()).map(move |b| (a, b)));
    pairs.map(|(a, b)| exchanged(&groups[a], &groups[b])).collect()
}

/// Two groups of columns exchanged.
fn exchanged(a: &[String], b: &[String]) -> Hypothesis {
    let columns = [a, b].map(|columns| columns.join(", "));
    Hypothesis::of(Misreading::ExchangedColumns { columns }, ColumnReading::exchanged(a, b))
}

/// Measured columns late or early.
fn late(data: &Prepared, measured: &[String], rows: isize) -> Hypothesis {
    let misreading = Misreading::Delay { delay_s: rows as f64 * data.sampling.period_s };
    Hypothesis::of(misreading, ColumnReading::late(measured, rows))
}

/// Delays near one, which is among them.
pub(super) fn around(data: &Prepared, measured: &[String], delay_s: f64) -> Vec<Hypothesis> {
    let rows = (delay_s / data.sampling.period_s).round() as isize;
    let step = (rows.abs() / 16).max(1);
    let near = (-6..=6).map(|k| rows + k * step);
    let is_tried = |other: &isize| {
        other.signum() == rows.signum() && other.unsigned_abs() as f64 * data.sampling.period_s >= MIN_DELAY_S
    };
    near.filter(is_tried).map(|rows| late(data, measured, rows)).collect()
}

/// The robot mounted in other ways.
fn mounted(model: &Model) -> Vec<Hypothesis> {
    let Some(robot) = model.what.robot().filter(|robot| !robot.floating) else { return Vec::new() };
    let size = robot.gravity.norm();
    let axes = (0..3).flat_map(|axis| [1.0, -1.0].map(|sign| Vec3::ith(axis, sign)));
    let other = axes.filter(|down| down.dot(&robot.gravity) < 0.5 * size);
    other.map(|down| mounted_with(model.clone(), down, size)).collect()
}

/// The robot mounted with this direction down, where gravity is `size` (m/s²).
fn mounted_with(mut model: Model, down: Vec3<f64>, size: f64) -> Hypothesis {
    if let Some(robot) = model.what.weighing_robot_mut() {
        robot.gravity = down * size;
    }
    let misreading = Misreading::Mounting { down: [down.x, down.y, down.z] };
    Hypothesis { misreading, columns: ColumnReading::default(), model: Some(model) }
}
