//! Cells that a damaged log has: a position of one row that is far off the rows next to it, and a sensor that stays at the end of
//! its range.
//!
//! Rates and accelerations carry one wrong position into the rows around it, thousands of times enlarged. So the row is left out
//! before anything is computed from it, wherever it is, and is listed.

use darm_measure::column::Column;
use darm_measure::signal::unwrapped;
use darm_measure::table::Table;
use darm_measure::{Finding, FindingKind};

/// Rows from which on a column shows what is usual in it.
const MIN_ROWS: usize = 50;
/// A position is far off where it differs from the cubic through its four neighbours by as many times what nearly all rows are, and by
/// such a share of the range. Without it the rows next to it are as near to each other as others are.
const FAR_OFF: f64 = 20.0;
const MIN_SHARE: f64 = 0.02;
/// Share of the rows that counts as nearly all of them, and the largest that may be far off: more of them are no blunders.
const NEARLY_ALL: f64 = 0.95;
const MAX_SHARE: f64 = 0.01;
/// A sensor is at the end of its range where a column has its extreme in this share of the rows and in this number in a row, as many times
/// more often than the next number. A torque may be there for most of a motion, but where it always is the column says nothing.
const AT_END: f64 = 0.01;
const ALWAYS: f64 = 0.9;
const IN_A_ROW: usize = 4;
const MORE_OFTEN: usize = 10;
/// Lines that a finding names.
const MAX_LINES: usize = 8;

/// Leaves out rows in which a position is far off or what is predicted is at the end of its range.
pub(super) fn repair(table: &mut Table, findings: &mut Vec<Finding>) {
    let mut keep = vec![true; table.lines.len()];
    let Table { columns, lines, .. } = &mut *table;
    for column in columns.iter().filter(|column| column.numbers.len() >= MIN_ROWS) {
        let mut leave_out = |column: &Column, kind, rows: &[usize], why: &str| {
            rows.iter().for_each(|&row| keep[row] = false);
            let named: Vec<String> = rows.iter().take(MAX_LINES).map(|&row| lines[row].to_string()).collect();
            let more = if rows.len() > MAX_LINES { ", …" } else { "" };
            let text =
                format!("{} {why}, line {}{more}: {} rows are left out", column.name, named.join(", "), rows.len());
            findings.push(Finding::note(kind, text).at_line(lines[rows[0]]).in_column(&column.name));
        };
        if is_position(column) {
            let rows = far_off(column);
            if !rows.is_empty() {
                let why = "is far off the rows before and after";
                leave_out(column, FindingKind::FarOffNeighbours, &rows, why);
            }
        } else if is_sensor(column) {
            for end in at_ends(&column.numbers) {
                let why = format!("stays at {}, the end of its range", column.words[end[0]]);
                leave_out(column, FindingKind::Saturated, &end, &why);
            }
        }
    }
    if keep.contains(&false) {
        table.retain(&keep);
    }
}

/// Whether rates are computed from it: `q1`, `position`.
fn is_position(column: &Column) -> bool {
    let number = column.quantity.strip_prefix('q').map(|number| number.parse::<u32>().is_ok());
    column.meaning() == "position"
        || number == Some(true)
        || column.unit == "rad" && !column.quantity.starts_with(['x', 'y', 'z', 'r'])
}

/// Whether a sensor of forces or torques fills it.
fn is_sensor(column: &Column) -> bool {
    column.quantity.starts_with("tau") || column.meaning() == "force"
}

/// The rows of a position that are far off, as it is, and of an angle with its turns added up: where it jumps by a turn the rows next to
/// it are no neighbours.
fn far_off(column: &Column) -> Vec<usize> {
    let mut rows = far_off_neighbours(&column.numbers);
    if column.unit == "rad" {
        rows.extend(far_off_neighbours(&unwrapped(&column.numbers)));
        rows.sort_unstable();
        rows.dedup();
    }
    rows
}

/// The rows of a smooth column that are far off; none where there are many.
fn far_off_neighbours(numbers: &[f64]) -> Vec<usize> {
    let off = |numbers: &[f64], k: usize| {
        let at = |k: usize| numbers[k];
        (at(k) - (4.0 * (at(k - 1) + at(k + 1)) - at(k - 2) - at(k + 2)) / 6.0).abs()
    };
    let inside = 2..numbers.len() - 2;
    let usual = quantile(inside.clone().map(|k| off(numbers, k)), NEARLY_ALL);
    let (low, high) = numbers.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), n| (l.min(*n), h.max(*n)));
    let limit = (FAR_OFF * usual).max(MIN_SHARE * (high - low));
    let is_alone = |&k: &usize| {
        let mut without = numbers[k - 2..=k + 2].to_vec();
        without[2] = (4.0 * (without[1] + without[3]) - without[0] - without[4]) / 6.0;
        let apart = |a: usize, b: usize| (without[a] - without[b]).abs();
        off(numbers, k) > limit && (0..4).all(|a| apart(a, a + 1) < 0.25 * off(numbers, k))
    };
    let rows: Vec<usize> = inside.filter(is_alone).collect();
    if usual.is_finite() && rows.len() as f64 <= (MAX_SHARE * numbers.len() as f64).max(3.0) {
        rows
    } else {
        Vec::new()
    }
}

/// The rows at the largest and at the least number, where a sensor stays there.
fn at_ends(numbers: &[f64]) -> Vec<Vec<usize>> {
    let mut sorted = numbers.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let end = |sorted: Vec<f64>| {
        let (extreme, n) = (sorted[0], numbers.len());
        let same = sorted.iter().take_while(|number| **number == extreme).count();
        let next = sorted.get(same).map_or(0, |next| sorted[same..].iter().take_while(|n| *n == next).count());
        let rows: Vec<usize> = (0..n).filter(|&row| numbers[row] == extreme).collect();
        let in_a_row = rows.windows(IN_A_ROW).any(|rows| rows[IN_A_ROW - 1] - rows[0] == IN_A_ROW - 1);
        let is_end =
            same as f64 > AT_END * n as f64 && (same as f64) < ALWAYS * n as f64 && same > MORE_OFTEN * next.max(1);
        (is_end && in_a_row).then_some(rows)
    };
    let rising = sorted.clone();
    sorted.reverse();
    [end(rising), end(sorted)].into_iter().flatten().collect()
}

fn quantile(numbers: impl Iterator<Item = f64>, share: f64) -> f64 {
    let mut sorted: Vec<f64> = numbers.collect();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted.get((share * sorted.len() as f64) as usize).copied().unwrap_or(f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use super::*;

    fn wave(k: usize) -> f64 {
        (0.01 * k as f64).sin() - 0.4
    }

    #[test]
    fn one_position_that_stands_out_is_found_and_a_step_is_none() {
        let smooth: Vec<f64> = (0..1000).map(wave).collect();
        assert!(far_off_neighbours(&smooth).is_empty());
        let mut damaged = smooth.clone();
        [125, 400, 801].iter().for_each(|&row| damaged[row] = 0.0);
        assert_eq!(far_off_neighbours(&damaged), [125, 400, 801]);
        let stepped: Vec<f64> = (0..1000).map(|k| wave(k) + if k < 500 { 0.0 } else { 1.0 }).collect();
        assert!(far_off_neighbours(&stepped).is_empty());
        let postures: Vec<f64> = (0..1000).map(|k| (37.0 * k as f64).sin()).collect();
        assert!(far_off_neighbours(&postures).is_empty(), "no motion");
    }

    #[test]
    fn a_cell_next_to_a_jump_by_a_turn_is_found_and_the_jump_is_none() {
        let turning = |k: usize| 0.03 * k as f64;
        let mut wrapped: Vec<f64> = (0..1000).map(|k| (turning(k) + PI).rem_euclid(TAU) - PI).collect();
        let found = |numbers: &[f64]| {
            let column = Column {
                name: "q1_rad".into(),
                quantity: "q1".into(),
                unit: "rad",
                numbers: numbers.to_vec(),
                words: Vec::new(),
            };
            far_off(&column)
        };
        assert!(found(&wrapped).is_empty());
        wrapped[106] = 0.0;
        wrapped[500] += TAU;
        assert_eq!(found(&wrapped), [106, 500], "a zero behind a jump, and a row that is a turn off");
    }

    #[test]
    fn a_sensor_that_stays_at_the_end_of_its_range_is_found() {
        let torque: Vec<f64> = (0..1000).map(|k| 50.0 * wave(k) + 0.01 * (37.0 * k as f64).sin()).collect();
        assert_eq!(at_ends(&torque).len(), 0);
        let limited: Vec<f64> = torque.iter().map(|torque| torque.clamp(-60.0, 20.0)).collect();
        let ends = at_ends(&limited);
        assert_eq!(ends.len(), 2);
        assert!(ends.iter().flatten().all(|&row| torque[row] >= 20.0 || torque[row] <= -60.0));
        let mostly: Vec<f64> = torque.iter().map(|torque| torque.max(5.0)).collect();
        assert!(mostly.iter().filter(|torque| **torque == 5.0).count() > 500 && at_ends(&mostly).len() == 1);
        let rounded: Vec<f64> = torque.iter().map(|torque| torque.round()).collect();
        assert_eq!(at_ends(&rounded).len(), 0, "coarse steps");
    }
}
