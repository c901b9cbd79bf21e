//! Joints that turn without end, logged within one turn: their positions jump by a turn, their motion does not.

use std::f64::consts::{PI, TAU};

use darm_measure::signal::{stretches, unwrapped};
use darm_measure::table::Table;
use darm_measure::{Finding, FindingKind, median};

/// Orientations, which jump by themselves and are compared as rotations.
const ORIENTATIONS: [&str; 4] = ["angle", "rx", "ry", "rz"];
/// A position in steps larger than this, rad, as their median, is a list of postures and no motion.
const LARGEST_STEP: f64 = 0.5;
/// Beyond a turn a position is not wrapped; with this much for noise and rounding, rad.
const SLACK: f64 = 0.1;

/// Takes the jumps by a turn out of positions; says in which columns.
///
/// A column is one that was wrapped where it is a motion, stays within a turn, and each of its jumps by more than half a turn is
/// from near one end of this turn to near the other, within as much as the joint moves from row to row elsewhere.
pub(super) fn unwrap(table: &mut Table, motions: &[usize], findings: &mut Vec<Finding>) {
    let stretches = stretches(motions);
    let mut names = Vec::new();
    let is_angle = |unit: &str, meaning: &str| unit == "rad" && !ORIENTATIONS.contains(&meaning);
    for column in table.columns.iter_mut().filter(|column| is_angle(column.unit, column.meaning())) {
        if !is_wrapped(&column.numbers, &stretches) {
            continue;
        }
        for stretch in &stretches {
            let turned = unwrapped(&column.numbers[stretch.clone()]);
            column.numbers[stretch.clone()].copy_from_slice(&turned);
        }
        names.push(column.name.clone());
    }
    if !names.is_empty() {
        let text = format!("{} jumps by a turn where the joint continues: its turns are added up", names.join(", "));
        findings.push(Finding::note(FindingKind::UnwrappedTurns, text));
    }
}

fn is_wrapped(numbers: &[f64], stretches: &[std::ops::Range<usize>]) -> bool {
    let finite = || numbers.iter().copied().filter(|number| number.is_finite());
    let (Some(low), Some(high)) = (finite().reduce(f64::min), finite().reduce(f64::max)) else { return false };
    if high - low > TAU + SLACK || high - low <= PI {
        return false;
    }
    let pairs =
        || stretches.iter().flat_map(|stretch| numbers[stretch.clone()].windows(2)).map(|pair| [pair[0], pair[1]]);
    let (jumps, steps): (Vec<[f64; 2]>, Vec<[f64; 2]>) = pairs().partition(|[a, b]| (b - a).abs() > PI);
    let steps = || steps.iter().map(|[a, b]| (b - a).abs());
    let (Some(usual), largest) = (median(steps()), steps().fold(0.0, f64::max)) else { return false };
    let is_turn = |[a, b]: &[f64; 2]| {
        let rest = TAU - (b - a).abs();
        let [near, far] = if a < b { [a, b] } else { [b, a] };
        rest.abs() <= 2.0 * largest + SLACK
            && near - low <= 2.0 * largest + SLACK
            && high - far <= 2.0 * largest + SLACK
    };
    !jumps.is_empty() && usual < LARGEST_STEP && largest < PI / 2.0 && jumps.iter().all(is_turn)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn table(column: &str, numbers: impl Iterator<Item = f64>) -> Table {
        let rows: String = numbers.enumerate().map(|(k, number)| format!("{},{number}\n", 0.01 * k as f64)).collect();
        Table::read_text(Path::new("a.csv"), format!("time_s,{column}\n{rows}").as_bytes(), &Default::default())
            .unwrap()
            .0
    }

    fn unwrapped(column: &str, numbers: impl Iterator<Item = f64>) -> (Vec<f64>, usize) {
        let (mut table, mut findings) = (table(column, numbers), Vec::new());
        let motions = vec![0; table.lines.len()];
        unwrap(&mut table, &motions, &mut findings);
        (table.columns[1].numbers.clone(), findings.len())
    }

    #[test]
    fn a_joint_that_turns_several_times_is_one_motion() {
        // Seven turns, there and back, by sines.
        let turned = |k: usize| 44.0 * (0.004 * k as f64).sin();
        let logged = |low: f64| move |k: usize| (turned(k) - low).rem_euclid(TAU) + low;
        for low in [-PI, 0.0] {
            let (found, n) = unwrapped("q1_rad", (0..2000).map(logged(low)));
            let off = found[0] - turned(0);
            assert_eq!(n, 1);
            assert!((0..2000).all(|k| (found[k] - turned(k) - off).abs() < 1e-9), "{low}");
        }
        let (found, n) = unwrapped("q1_deg", (0..2000).map(|k| logged(-PI)(k).to_degrees().round()));
        assert!(n == 1 && (found[900] - turned(900)).abs() < 0.02, "{}", found[900]);
    }

    #[test]
    fn postures_orientations_and_joints_within_a_turn_stay() {
        let random = |k: usize| 3.1 * (12.9898 * k as f64).sin();
        assert_eq!(unwrapped("q1_rad", (0..300).map(random)).1, 0);
        assert_eq!(unwrapped("q1_rad", (0..300).map(|k| 3.1 * (0.05 * k as f64).sin())).1, 0);
        let turning = |k: usize| (0.1 * k as f64 + PI).rem_euclid(TAU) - PI;
        assert_eq!(
            (unwrapped("angle_rad", (0..300).map(turning)).1, unwrapped("q1_rad", (0..300).map(turning)).1),
            (0, 1)
        );
    }
}
