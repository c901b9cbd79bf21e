//! Sorts of wrong models, wrong logs and unusable logs of joint torques and of a wrench.

use darm_core::se::rotation_exp;
use darm_robot::robot::Robot;
use rand::RngExt as _;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;

use super::cells::Cells;
use super::damage::Sort as S;

/// A robot beside its log.
#[derive(Clone)]
pub(super) struct SignalLog {
    pub(super) robot: Robot,
    /// Another robot with as many joints.
    pub(super) other: Robot,
    pub(super) cells: Cells,
}

/// What are no torques of this robot.
pub(super) const WRONG_TORQUES: [S<SignalLog>; 18] = [
    S::wrong("two torques are exchanged", |log, rng| {
        let [a, b] = two_joints(log, rng);
        exchange(log, &["tau"], a, b);
    }),
    S::wrong("two joints' motions are exchanged", |log, rng| {
        let [a, b] = two_joints(log, rng);
        exchange(log, &["q", "v", "a"], a, b);
    }),
    S::wrong("joints are in reverse order", |log, _| {
        let n = log.robot.joints.len();
        (0..n / 2).for_each(|k| exchange(log, &["q", "v", "a"], k, n - 1 - k));
    }),
    S::wrong("all torques are inverted", |log, _| scale(log, "tau", -1.0)),
    S::wrong("one torque is inverted", |log, rng| {
        let joint = largest_torques(log)[rng.random_range(0..3)];
        let column = of_joint(log, "tau", joint);
        log.cells.change(column, |number| -number);
    }),
    S::wrong("one joint turns the other way", |log, rng| {
        let joint = rng.random_range(1..3);
        for kind in ["q", "v", "a"] {
            let column = of_joint(log, kind, joint);
            log.cells.change(column, |number| -number);
        }
    }),
    S::wrong("degrees in columns of radians", |log, _| scale(log, "q", 1f64.to_degrees())),
    S::wrong("torques come 0.15 s late", |log, _| {
        let torques = log.cells.columns("tau");
        log.cells.take(&torques, |row| row.saturating_sub(3));
    }),
    S::wrong("torques come 1 s late", |log, _| {
        let torques = log.cells.columns("tau");
        log.cells.take(&torques, |row| row.saturating_sub(20));
    }),
    S::wrong("torques of another recording", |log, _| {
        let (n, torques) = (log.cells.rows.len(), log.cells.columns("tau"));
        log.cells.take(&torques, |row| (row + n / 2) % n);
    }),
    S::wrong("rows of torques are shuffled", |log, rng| {
        let mut order: Vec<usize> = (0..log.cells.rows.len()).collect();
        order.shuffle(rng);
        let torques = log.cells.columns("tau");
        log.cells.take(&torques, |row| order[row]);
    }),
    S::wrong("the model of another robot", |log, _| log.robot = log.other.clone()),
    S::wrong("N·mm in columns of N·m", |log, _| scale(log, "tau", 1000.0)),
    S::wrong("torques before the gears", |log, _| scale(log, "tau", 0.01)),
    S::wrong("the robot hangs from the ceiling", |log, _| log.robot.gravity = -log.robot.gravity),
    S::wrong("the robot is mounted on a wall", |log, _| {
        let g = log.robot.gravity.norm();
        log.robot.gravity = rotation_exp(&nalgebra::Vector3::new(std::f64::consts::FRAC_PI_2, 0.0, 0.0))
            * nalgebra::Vector3::new(0.0, 0.0, -g);
    }),
    S::wrong("the second joint counts from another zero", |log, _| {
        let column = of_joint(log, "q", 1);
        log.cells.change(column, |number| number + std::f64::consts::FRAC_PI_2);
    }),
    S::wrong("speeds in the columns of positions", |log, _| {
        for joint in 0..log.robot.joints.len() {
            let (q, v) = (of_joint(log, "q", joint), of_joint(log, "v", joint));
            log.cells.rows.iter_mut().for_each(|row| row[q] = row[v].clone());
        }
    }),
];

/// What is no wrench under this robot.
pub(super) const WRONG_WRENCHES: [S<SignalLog>; 7] = [
    S::wrong("the wrench is inverted", |log, _| ["F", "M"].into_iter().for_each(|kind| scale(log, kind, -1.0))),
    S::wrong("y and z of the plate are exchanged", |log, _| {
        for kind in ["F", "M"] {
            let axes = log.cells.columns(kind);
            log.cells.swap(axes[1], axes[2]);
        }
    }),
    S::wrong("x and y of the plate are exchanged", |log, _| {
        for kind in ["F", "M"] {
            let axes = log.cells.columns(kind);
            log.cells.swap(axes[0], axes[1]);
        }
    }),
    S::wrong("N·mm in columns of N·m", |log, _| scale(log, "M", 1000.0)),
    S::wrong("moments are inverted", |log, _| scale(log, "M", -1.0)),
    S::wrong("wrenches of other postures", |log, _| {
        let n = log.cells.rows.len();
        let wrench = [log.cells.columns("F"), log.cells.columns("M")].concat();
        log.cells.take(&wrench, |row| (row + n / 2) % n);
    }),
    S::wrong("degrees in columns of radians", |log, _| {
        for joint in log.robot.joints.clone() {
            scale(log, &format!("{}_rad", joint.name), 1f64.to_degrees());
        }
    }),
];

/// What holds nothing that could be diagnosed.
pub(super) const UNUSABLE_TORQUES: [S<SignalLog>; 16] = [
    S::unusable("torques of zeros", |log, _| scale(log, "tau", 0.0)),
    S::unusable("torques that never change", |log, _| {
        let torques = log.cells.columns("tau");
        log.cells.take(&torques, |_| 0);
    }),
    S::unusable("noise in the place of torques", |log, rng| {
        for column in log.cells.columns("tau") {
            log.cells.change(column, |_| rng.random_range(-30.0..30.0));
        }
    }),
    S::unusable("a robot at rest", |log, rng| {
        for kind in ["q", "v", "a"] {
            for column in log.cells.columns(kind) {
                log.cells.change(column, |_| 0.0);
            }
        }
        for column in log.cells.columns("tau") {
            log.cells.change(column, |_| rng.random_range(-0.1..0.1));
        }
    }),
    S::unusable("five rows", |log, _| log.cells.rows.truncate(5)),
    S::unusable("twenty rows", |log, _| log.cells.rows.truncate(20)),
    S::unusable("no row", |log, _| log.cells.rows.clear()),
    S::unusable("nan in a torque", |log, _| log.cells.rewrite("tau1", |_| "nan".into())),
    S::unusable("empty cells in a torque", |log, _| log.cells.rewrite("tau2", |_| String::new())),
    S::unusable("a torque is infinite", |log, _| log.cells.rewrite("tau3", |_| "inf".into())),
    S::unusable("a torque is out of range", |log, _| {
        let column = of_joint(log, "tau", 3);
        log.cells.change(column, |number| number * 1e300);
    }),
    S::unusable("no column of a joint", |log, _| {
        let column = of_joint(log, "q", 2);
        log.cells.header[column] = "third".into();
    }),
    S::unusable("stamps that are all the same", |log, _| log.cells.rewrite("time_s", |_| "3.5".into())),
    S::unusable("stamps at random", |log, rng| {
        let column = log.cells.column("time_s");
        log.cells.change(column, |_| rng.random_range(0.0..40.0));
        ["v", "a"].into_iter().for_each(|kind| drop_columns(log, kind));
    }),
    S::unusable("torques as signs only", |log, _| {
        for column in log.cells.columns("tau") {
            log.cells.change(column, f64::signum);
        }
    }),
    S::unusable("decimal commas", |log, _| log.cells.rewrite("q1", |number| number.replace('.', ","))),
];

fn two_joints(log: &SignalLog, rng: &mut ChaCha8Rng) -> [usize; 2] {
    // Of those that carry: what the wrist's joints carry is below friction and noise.
    let carry = largest_torques(log);
    let first = rng.random_range(0..3);
    [carry[first], carry[(first + rng.random_range(1..3)) % 3]]
}

/// The joints, the one with the largest torques first.
fn largest_torques(log: &SignalLog) -> Vec<usize> {
    let size = |joint: usize| {
        let numbers = log.cells.numbers(of_joint(log, "tau", joint)).unwrap_or_default();
        numbers.iter().map(|number| number * number).sum::<f64>()
    };
    let mut joints: Vec<usize> = (0..log.robot.joints.len()).collect();
    joints.sort_by(|a, b| size(*b).total_cmp(&size(*a)));
    joints
}

/// The column of a channel of a joint.
fn of_joint(log: &SignalLog, kind: &str, joint: usize) -> usize {
    let name = format!("{kind}{}", joint + 1);
    let is_it = |text: &String| *text == name || text.strip_prefix(&name).is_some_and(|rest| rest.starts_with('_'));
    (0..log.cells.header.len()).find(|&k| is_it(&log.cells.header[k])).expect("the log has every channel of each joint")
}

fn exchange(log: &mut SignalLog, kinds: &[&str], a: usize, b: usize) {
    for kind in kinds {
        let (a, b) = (of_joint(log, kind, a), of_joint(log, kind, b));
        log.cells.swap(a, b);
    }
}

fn scale(log: &mut SignalLog, beginning: &str, by: f64) {
    for column in log.cells.columns(beginning) {
        log.cells.change(column, |number| by * number);
    }
}

fn drop_columns(log: &mut SignalLog, beginning: &str) {
    let dropped = log.cells.columns(beginning);
    let kept = |cells: &[String]| -> Vec<String> {
        cells.iter().enumerate().filter(|(k, _)| !dropped.contains(k)).map(|(_, cell)| cell.clone()).collect()
    };
    log.cells.header = kept(&log.cells.header);
    log.cells.rows = log.cells.rows.iter().map(|row| kept(row)).collect();
}
