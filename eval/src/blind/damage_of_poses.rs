//! Sorts of wrong models, wrong logs and unusable logs of tool poses.

use darm_arm::arm::Arm;
use darm_core::actuator::Stage;
use darm_core::real::Vec3;
use darm_core::se::{Pose, Pose2};
use rand::seq::SliceRandom as _;
use rand::{Rng as _, RngExt as _};

use super::cells::Cells;
use super::damage::Sort as S;

/// An arm beside its log.
#[derive(Clone)]
pub(super) struct PoseLog {
    pub(super) arm: Arm,
    pub(super) cells: Cells,
}

/// Columns of the pose.
const POSE: [&str; 7] = ["x_m", "y_m", "z_m", "angle_deg", "rx_deg", "ry_deg", "rz_deg"];
/// Columns of what was commanded.
const WORDS: [&str; 2] = ["word", "previous"];

/// What is no log of this arm.
pub(super) const WRONG: [S<PoseLog>; 22] = [
    S::wrong("each row has the word of the row after", |log, _| shifted(log, 1)),
    S::wrong("each row has the word of the row before", |log, _| shifted(log, -1)),
    S::wrong("a row of words is lost in the middle", |log, rng| {
        let n = log.cells.rows.len();
        let from = rng.random_range(n / 4..3 * n / 4);
        let words = columns(log, &WORDS);
        log.cells.take(&words, |row| if row >= from { row + 1 } else { row });
    }),
    S::wrong("digits are inverted", |log, _| {
        words(log, |word| word.chars().map(|digit| if digit == '0' { '1' } else { '0' }).collect());
    }),
    S::wrong("digits are in reverse order", |log, _| words(log, |word| word.chars().rev().collect())),
    S::wrong("two actuators are exchanged", |log, rng| {
        let n = log.arm.n_actuators();
        let first = rng.random_range(0..n);
        let second = (first + rng.random_range(1..n)) % n;
        words(log, |word| exchanged(word, |k| other_of_two(first, second, k)));
    }),
    S::wrong("two modules are exchanged", |log, rng| {
        let stages = &log.arm.model.chain.stages;
        let of_module = stages.iter().map(|stage| stage.n_actuators()).max().unwrap_or(1);
        let modules = log.arm.n_actuators() / of_module;
        let first = rng.random_range(0..modules);
        let second = (first + rng.random_range(1..modules)) % modules;
        let module = |m: usize| other_of_two(first, second, m);
        words(log, |word| exchanged(word, |k| module(k / of_module) * of_module + k % of_module));
    }),
    S::wrong("all sockets are shuffled", |log, rng| {
        let mut order: Vec<usize> = (0..log.arm.n_actuators()).collect();
        order.shuffle(rng);
        words(log, |word| exchanged(word, |k| order[k]));
    }),
    S::wrong("one actuator is inverted", |log, rng| {
        let of = rng.random_range(0..log.arm.n_actuators());
        let digit = |(k, digit): (usize, char)| match (k == of, digit) {
            (true, '0') => '1',
            (true, _) => '0',
            (false, digit) => digit,
        };
        words(log, |word| word.chars().enumerate().map(digit).collect());
    }),
    S::wrong("x and y are exchanged", |log, _| {
        let (x, y) = (log.cells.column("x_m"), log.cells.column("y_m"));
        log.cells.swap(x, y);
    }),
    S::wrong("x is mirrored", |log, _| scaled(log, &["x_m"], -1.0)),
    S::wrong("the base is given in the tool", |log, _| inverted(log)),
    S::wrong("mm in columns of m", |log, _| scaled(log, &["x_m", "y_m", "z_m"], 1000.0)),
    S::wrong("cm in columns of m", |log, _| scaled(log, &["x_m", "y_m", "z_m"], 100.0)),
    S::wrong("radians in columns of degrees", |log, _| scaled(log, &POSE[3..], 1f64.to_radians())),
    S::wrong("angles turn the other way", |log, _| scaled(log, &POSE[3..], -1.0)),
    S::wrong("words of another table", |log, rng| {
        let mut order: Vec<usize> = (0..log.cells.rows.len()).collect();
        order.shuffle(rng);
        let words = columns(log, &WORDS);
        log.cells.take(&words, |row| order[row]);
    }),
    S::wrong("poses of another recording", |log, _| {
        let (n, poses) = (log.cells.rows.len(), columns(log, &POSE));
        log.cells.take(&poses, |row| (row + n / 2) % n);
    }),
    S::wrong("the camera is frozen from the middle on", |log, _| {
        let (n, poses) = (log.cells.rows.len(), columns(log, &POSE));
        log.cells.take(&poses, |row| row.min(n / 2));
    }),
    S::wrong("the model of an arm that is larger by a half", |log, _| {
        let chain = &mut log.arm.model.chain;
        chain.stages.iter_mut().for_each(|stage| enlarge(stage, 1.5));
        chain.tool.position *= 1.5;
    }),
    S::wrong("the first and the last leg of each module are exchanged", |log, _| {
        let mut order = Vec::new();
        for stage in &log.arm.model.chain.stages {
            let (first, n) = (order.len(), stage.n_actuators());
            order.extend(first..first + n);
            if n > 1 {
                order.swap(first, first + n - 1);
            }
        }
        words(log, |word| exchanged(word, |k| order[k]));
    }),
    S::wrong("poses of another arm", |log, rng| {
        let (poses, seed) = (columns(log, &POSE), rng.next_u64());
        for &column in &poses {
            let mut turn = 0u64;
            log.cells.change(column, |number| {
                turn = turn.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(seed | 1);
                number * ((turn >> 40) as f64 / f64::from(1u32 << 24) - 0.5)
            });
        }
    }),
];

/// What holds nothing that could be diagnosed.
pub(super) const UNUSABLE: [S<PoseLog>; 18] = [
    S::unusable("one word only", |log, _| {
        let first = log.cells.rows[0].clone();
        columns(log, &WORDS)
            .into_iter()
            .for_each(|k| log.cells.rows.iter_mut().for_each(|row| row[k].clone_from(&first[k])));
    }),
    S::unusable("five rows", |log, _| log.cells.rows.truncate(5)),
    S::unusable("no row", |log, _| log.cells.rows.clear()),
    S::unusable("all rows held out", |log, _| log.cells.rewrite("held_out", |_| "1".into())),
    S::unusable("a pose that never changes", |log, _| {
        let poses = columns(log, &POSE);
        log.cells.take(&poses, |_| 0);
    }),
    S::unusable("poses of zeros", |log, _| scaled(log, &POSE, 0.0)),
    S::unusable("nan in x", |log, _| log.cells.rewrite("x_m", |_| "nan".into())),
    S::unusable("x is infinite", |log, _| log.cells.rewrite("x_m", |_| "inf".into())),
    S::unusable("x is out of range", |log, _| scaled(log, &["x_m"], 1e300)),
    S::unusable("empty cells in y", |log, _| log.cells.rewrite("y_m", |_| String::new())),
    S::unusable("letters in the words", |log, _| words(log, |word| word.replace('1', "x"))),
    S::unusable("words one digit short", |log, _| words(log, |word| word[1..].into())),
    S::unusable("words with a state too many", |log, _| words(log, |word| word.replace('1', "3"))),
    S::unusable("no column of words", |log, _| rename(log, "word", "command")),
    S::unusable("no column of x", |log, _| rename(log, "x_m", "first")),
    S::unusable("noise in the place of poses", |log, rng| {
        for column in columns(log, &POSE) {
            log.cells.change(column, |_| rng.random_range(-1.0..1.0));
        }
    }),
    S::unusable("decimal commas", |log, _| log.cells.rewrite("x_m", |x| x.replace('.', ","))),
    S::unusable("every word once, then nothing new", |log, _| {
        let poses = columns(log, &POSE);
        log.cells.take(&poses, |row| row % 4);
    }),
];

/// The columns of these names that a log has.
fn columns(log: &PoseLog, names: &[&str]) -> Vec<usize> {
    (0..log.cells.header.len()).filter(|&k| names.contains(&&log.cells.header[k][..])).collect()
}

fn words(log: &mut PoseLog, change: impl Fn(&str) -> String) {
    WORDS.iter().for_each(|name| log.cells.rewrite(name, &change));
}

/// A word whose digit k is that of another place.
fn exchanged(word: &str, of: impl Fn(usize) -> usize) -> String {
    let digits: Vec<char> = word.chars().collect();
    (0..digits.len()).map(|k| digits[of(k)]).collect()
}

/// The other one of `first` and `second`; any other place stays.
fn other_of_two(first: usize, second: usize, place: usize) -> usize {
    match place {
        _ if place == first => second,
        _ if place == second => first,
        _ => place,
    }
}

fn shifted(log: &mut PoseLog, by: isize) {
    let words = columns(log, &WORDS);
    log.cells.take(&words, |row| row.saturating_add_signed(by));
}

fn scaled(log: &mut PoseLog, names: &[&str], by: f64) {
    columns(log, names).into_iter().for_each(|column| log.cells.change(column, |number| by * number));
}

fn rename(log: &mut PoseLog, name: &str, new: &str) {
    let column = log.cells.column(name);
    log.cells.header[column] = new.into();
}

/// The inverse of each pose in its place.
fn inverted(log: &mut PoseLog) {
    let names = if log.cells.header.iter().any(|name| name == "z_m") {
        &["x_m", "y_m", "z_m", "rx_deg", "ry_deg", "rz_deg"][..]
    } else {
        &["x_m", "y_m", "angle_deg"]
    };
    let columns: Vec<usize> = names.iter().map(|name| log.cells.column(name)).collect();
    for row in &mut log.cells.rows {
        let numbers: Vec<f64> = columns.iter().filter_map(|&k| row[k].parse().ok()).collect();
        let pose = match numbers[..] {
            [x, y, z, rx, ry, rz] => {
                let turn = Vec3::new(rx, ry, rz).map(f64::to_radians);
                Pose::new(&turn, Vec3::new(x, y, z))
            }
            [x, y, angle] => Pose2::new(x, y, angle.to_radians()).into(),
            _ => continue,
        };
        let back = pose.inverse();
        let turn = back.log().angular.map(f64::to_degrees);
        let p = back.position;
        let new = if columns.len() == 6 { vec![p.x, p.y, p.z, turn.x, turn.y, turn.z] } else { vec![p.x, p.y, turn.z] };
        columns.iter().zip(new).for_each(|(&k, number)| row[k] = format!("{number:.9}"));
    }
}

/// The same stage of another size.
fn enlarge(stage: &mut Stage<f64>, by: f64) {
    match stage {
        Stage::Link(pose) => pose.position *= by,
        Stage::Planar(platform) => platform.home.position *= by,
        Stage::Spatial(platform) => platform.home.position *= by,
        Stage::Discrete(_) | Stage::Servo(_) => {}
    }
    for k in 0..stage.n_actuators() {
        let Some(leg) = stage.leg_mut(k) else { continue };
        leg.base *= by;
        leg.top *= by;
        leg.length_m.iter_mut().for_each(|length| *length *= by);
    }
}
