//! Robots with one thing that their model does not have: what the columns are, and what a diagnosis names.

use std::collections::BTreeMap;
use std::path::Path;

use darm_core::real::{Mat3, Vec3};
use darm_core::se::{Pose, rotation_exp};
use darm_robot::description;
use darm_robot::robot::{Motion, Robot};

use super::experiment;
use super::placement::{Misplaced, Placement};
use crate::diagnosis::{SignalOptions, diagnose_table};
use crate::effect::{LawName, Place, Site};
use crate::linearise::experiment::Candidate;
use crate::linearise::model::{Model, Predictor};
use crate::linearise::model_effects::ModelEffect;
use crate::linearise::serial_chain::site_of_joint;
use crate::outcome::{Diagnosis, Verdict};
use crate::prepare::signals::{Preparation, Prepared};
use crate::progress::Progress;
use darm_measure::table::{Names, Table};

const JOINTS: usize = 4;
const ROWS: u32 = 240;
const STEP_S: f64 = 0.1;
/// Noise of each torque, N·m, peak to peak.
const NOISE_NM: f64 = 0.2;

/// A TX40 whose fourth and sixth joints are locked, so that the tests take less time.
fn tx40() -> Robot {
    locked(&["joint_4", "joint_6"])
}

/// A TX40 with these joints locked.
fn locked(joints: &[&str]) -> Robot {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/measured/tx40.urdf");
    let locks: BTreeMap<String, f64> = joints.iter().map(|joint| ((*joint).to_owned(), 0.0)).collect();
    description::read(&path, &locks).unwrap()
}

/// The robot with a joint that is `offset` further than its encoder shows.
fn with_offset(joint: usize, offset: f64) -> Robot {
    let mut robot = tx40();
    let own = &mut robot.joints[joint].joint;
    own.placement = own.placement * Pose::new(&(own.axis.direction * offset), Vec3::zeros());
    robot
}

/// The robot on a base that is turned by this vector.
fn tilted(turn: Vec3<f64>) -> Robot {
    let mut robot = tx40();
    robot.gravity = rotation_exp(&turn).transpose() * robot.gravity;
    robot
}

/// The robot with a point mass on its last link, there in its frame.
fn loaded(mass_kg: f64, place: Vec3<f64>) -> Robot {
    let mut robot = tx40();
    let own = &mut robot.joints.last_mut().unwrap().joint.inertia;
    let both_kg = own.mass + mass_kg;
    let com = (own.com * own.mass + place * mass_kg) / both_kg;
    // The parallel axis theorem for each of the two.
    let of_mass = |m: f64, off: Vec3<f64>| (Mat3::identity() * off.dot(&off) - off * off.transpose()) * m;
    own.about_com += of_mass(own.mass, own.com - com) + of_mass(mass_kg, place - com);
    (own.mass, own.com) = (both_kg, com);
    robot
}

fn torque(robot: &Robot, [q, v, a]: &[Vec<f64>; 3]) -> Vec<f64> {
    robot.dynamics(&Motion { state: [q, v, a], load: None }).unwrap().torque
}

/// A motion of the joints at this time, each at two frequencies.
fn state(time_s: f64) -> [Vec<f64>; 3] {
    let wave = |order: u32| {
        let joint = |k: usize| {
            let of = |size: f64, rate: f64| {
                let turn = rate * time_s + k as f64 + f64::from(order) * std::f64::consts::FRAC_PI_2;
                size * rate.powi(order as i32) * turn.sin()
            };
            of(0.7, 0.9 + 0.13 * k as f64) + of(0.3, 2.3 - 0.17 * k as f64)
        };
        (0..JOINTS).map(joint).collect()
    };
    [wave(0), wave(1), wave(2)]
}

/// The diagnosis of the model of the robot as it is with torques that were measured, and with the number of a payload.
fn diagnosed(measured: impl Fn(f64) -> (Vec<f64>, u32)) -> Diagnosis {
    diagnosed_with(NOISE_NM, measured)
}

/// The same with another noise, peak to peak.
fn diagnosed_with(noise_nm: f64, measured: impl Fn(f64) -> (Vec<f64>, u32)) -> Diagnosis {
    let of_joints =
        ["q", "v", "a", "tau"].map(|letter| (1..=JOINTS).map(|k| format!("{letter}{k},")).collect::<String>());
    let mut text = format!("t,{}payload\n", of_joints.concat());
    let mut noise = 12345u64;
    for row in 0..ROWS {
        let time_s = f64::from(row) * STEP_S;
        let (torques, payload) = measured(time_s);
        let noisy = torques.into_iter().map(|torque| {
            noise = noise.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            torque + noise_nm * ((noise >> 40) as f64 / f64::from(1 << 24) - 0.5)
        });
        let numbers = std::iter::once(time_s).chain(state(time_s).concat()).chain(noisy);
        let cells: Vec<String> = numbers.map(|number| format!("{number:.7}")).collect();
        text += &format!("{},{payload}\n", cells.join(","));
    }
    let table = Table::read_text(Path::new("a.csv"), text.as_bytes(), &Names::new()).unwrap().0;
    let options = SignalOptions { seed: 1, ..SignalOptions::default() };
    diagnose_table(&Model::from(Predictor::Torque(tx40(), None)), &table, &options).unwrap().diagnosis
}

/// Intervals of the values of the only effect that is named, by their names.
fn alone(found: &Diagnosis, law: LawName, place: Place) -> BTreeMap<String, [f64; 2]> {
    assert_eq!(found.verdict, Verdict::EffectFound, "{:?}", found.plain);
    let named: Vec<(LawName, Place)> = found.effects.iter().map(|effect| (effect.law, effect.site.place)).collect();
    assert_eq!(named, [(law, place)], "{:?}", found.plain);
    found.effects[0].values.iter().map(|value| (value.name.clone(), value.ci95.unwrap())).collect()
}

fn holds([low, high]: [f64; 2], value: f64, within: f64) {
    assert!(low < value && value < high && high - low < within, "{low} to {high} for {value}");
}

fn candidates(robot: &Robot, states: &[[Vec<f64>; 3]], sites: &[Site]) -> Vec<Candidate> {
    let (near, off) = (Placement::of(robot, sites, &[]), vec![0.0; 10 * robot.joints.len()]);
    Misplaced::new(robot, states.to_vec(), vec![None; states.len()], near, &off).unwrap().candidates(robot, sites)
}

#[test]
fn columns_are_the_first_order_of_what_moved_robots_need() {
    let (robot, size) = (tx40(), 1e-4);
    let states: Vec<[Vec<f64>; 3]> = (0..5).map(|k| state(0.37 * f64::from(k))).collect();
    let sites: Vec<Site> = (0..JOINTS).map(|joint| site_of_joint(&robot, joint, joint)).collect();
    let candidates = candidates(&robot, &states, &sites);
    let all = |robot: &Robot| states.iter().flat_map(|state| torque(robot, state)).collect::<Vec<_>>();
    let nominal = all(&robot);
    let largest = nominal.iter().fold(0.0, |largest: f64, torque| largest.max(torque.abs()));
    let check = |moved: &Robot, column: &[f64]| {
        for ((moved, nominal), slope) in all(moved).iter().zip(&nominal).zip(column) {
            // The second order: size² times the torque, by a factor of a few.
            assert!((moved - nominal - slope * size).abs() < 10.0 * size * size * largest, "{moved} {nominal}");
        }
    };
    // The first joint turns about gravity: its place changes no torque.
    let offsets: Vec<Place> = candidates.iter().map(|candidate| candidate.site.place).collect();
    assert_eq!(offsets, [Place::Joint(1), Place::Joint(2), Place::Joint(3), Place::Base]);
    for joint in 1..JOINTS {
        check(&with_offset(joint, size), &candidates[joint - 1].values[0].column);
    }
    for (axis, value) in [Vec3::x(), Vec3::y()].iter().zip(&candidates[3].values) {
        check(&tilted(axis * size), &value.column);
    }
}

/// An effect of a model, with these values.
fn effect<const N: usize>(law: LawName, place: &str, values: [(&str, f64); N]) -> ModelEffect {
    let values = BTreeMap::from(values.map(|(name, value)| (name.to_string(), value)));
    ModelEffect { law, place: place.into(), constant: None, values, along: None, points: Vec::new() }
}

#[test]
fn what_columns_leave_out_of_moved_robots_is_added() {
    let (robot, bodies) = (tx40(), 10 * (JOINTS + 1));
    let sites: Vec<Site> = (0..JOINTS).map(|joint| site_of_joint(&robot, joint, joint)).collect();
    let states: Vec<[Vec<f64>; 3]> = (0..5).map(|k| state(0.37 * f64::from(k))).collect();
    let payload = Some((JOINTS, JOINTS - 1));
    let carried = vec![None, payload, payload, None, None];
    // A payload of 2 kg at the link's origin, and joint 3 and the base far from their places.
    let (offset, turn, mut off) = (0.2, Vec3::new(0.0, 0.15, 0.0), vec![0.0; bodies]);
    off[10 * JOINTS] = 2.0;
    let nominal = Placement::of(&robot, &sites, &[]);
    let misplaced = Misplaced::new(&robot, states.clone(), carried.clone(), nominal, &vec![0.0; bodies]).unwrap();
    assert_eq!(misplaced.beyond(&[&off[..], &[0.0; 5]].concat()), None);
    let beyond = |misplaced: &Misplaced, sizes: [f64; 2]| {
        let candidates = misplaced.candidates(&robot, &sites).into_iter().flat_map(|one| one.values);
        let columns: Vec<Vec<f64>> = candidates.map(|value| value.column).collect();
        let mut values = vec![0.0; columns.len()];
        // The first joint shows where the base is not level.
        let first = columns.len() - 5;
        (values[first + 1], values[first + 4]) = (sizes[0], sizes[1]);
        let beyond = misplaced.beyond(&[&off[..], &values].concat()).unwrap();
        let linear = |at: usize| sizes[0] * columns[first + 1][at] + sizes[1] * columns[first + 4][at];
        (0..beyond.len()).map(|at| beyond[at] + linear(at)).collect::<Vec<f64>>()
    };
    let moved = |robot: Robot, [offset, turn_y]: [f64; 2]| {
        let mut moved = robot;
        let own = &mut moved.joints[2].joint;
        own.placement = own.placement * Pose::new(&(own.axis.direction * offset), Vec3::zeros());
        moved.gravity = rotation_exp(&Vec3::new(0.0, turn_y, 0.0)).transpose() * moved.gravity;
        moved
    };
    let found = [
        effect(LawName::JointOffset, &sites[2].code, [("offset", 0.19)]),
        effect(LawName::BaseTilt, "the base", [("second turn across", 0.14)]),
    ];
    let near = Placement::of(&robot, &sites, &found);
    let misplaced_near = Misplaced::new(&robot, states.clone(), carried.clone(), near, &off).unwrap();
    let [far, near] = [&misplaced, &misplaced_near].map(|misplaced| beyond(misplaced, [offset, turn.y]));
    for (row, state) in states.iter().enumerate() {
        let shown = if carried[row].is_some() { loaded(2.0, Vec3::zeros()) } else { tx40() };
        let of = |robot: Robot, sizes| torque(&moved(robot, sizes), state);
        let (real, level) = (of(shown.clone(), [offset, turn.y]), torque(&shown, state));
        // The columns of bodies near a placement are those of the robot there.
        let bodies = of(shown, [0.19, 0.14]).into_iter().zip(of(tx40(), [0.19, 0.14]));
        let bodies: Vec<f64> = bodies.map(|(loaded, empty)| loaded - empty).collect();
        for (joint, nominal) in torque(&robot, state).into_iter().enumerate() {
            let at = row * JOINTS + joint;
            assert!((level[joint] + far[at] - real[joint]).abs() < 1e-9, "row {row}, joint {joint}");
            assert!((nominal + bodies[joint] + near[at] - real[joint]).abs() < 1e-9, "row {row}, joint {joint}");
        }
    }
}

#[test]
fn the_base_of_a_robot_with_parallel_axes_tilts_as_its_first_joint_is_offset() {
    let robot = locked(&["joint_1", "joint_4", "joint_5", "joint_6"]);
    let first_two = |time_s: f64| state(time_s).map(|of| of[..2].to_vec());
    let states: Vec<[Vec<f64>; 3]> = (0..5).map(|k| first_two(0.37 * f64::from(k))).collect();
    let sites: Vec<Site> = (0..2).map(|joint| site_of_joint(&robot, joint, joint)).collect();
    let candidates = candidates(&robot, &states, &sites);
    let [offset, _, tilt] = &candidates[..] else { panic!("{}", candidates.len()) };
    assert_eq!((tilt.law, tilt.values.len()), (LawName::BaseTilt, 1));
    // Differences with a step of 1e-4 are good to 1e-8 of the torque.
    let largest = offset.values[0].column.iter().fold(0.0, |largest: f64, slope| largest.max(slope.abs()));
    let pairs = || offset.values[0].column.iter().zip(&tilt.values[0].column);
    let differ = |sign: f64| pairs().map(|(a, b)| (a - sign * b).abs()).fold(0.0, f64::max);
    assert!(differ(1.0).min(differ(-1.0)) < 1e-6 * largest, "{} {}", differ(1.0), differ(-1.0));
}

#[test]
fn an_offset_of_a_joint_is_named_alone_with_its_size() {
    let real = with_offset(1, 0.01);
    let values = alone(&diagnosed(|t| (torque(&real, &state(t)), 0)), LawName::JointOffset, Place::Joint(1));
    holds(values["offset"], 0.01, 0.003);
}

#[test]
fn a_large_offset_is_named_alone_where_noise_is_small() {
    let real = with_offset(2, 0.05);
    let values = alone(&diagnosed_with(0.01, |t| (torque(&real, &state(t)), 0)), LawName::JointOffset, Place::Joint(2));
    holds(values["offset"], 0.05, 0.001);
}

#[test]
fn a_tilted_base_is_named_alone_with_its_size() {
    let real = tilted(Vec3::new(0.0, 0.01, 0.0));
    let values = alone(&diagnosed(|t| (torque(&real, &state(t)), 0)), LawName::BaseTilt, Place::Base);
    holds(values["first turn across"], 0.0, 0.003);
    holds(values["second turn across"], 0.01, 0.003);
}

#[test]
fn a_heavy_link_on_a_tilted_base_is_named_beside_the_tilt() {
    let mut real = loaded(2.0, Vec3::new(0.03, 0.0, 0.1));
    real.gravity = tilted(Vec3::new(0.0, 0.08, 0.0)).gravity;
    let found = diagnosed_with(0.02, |t| (torque(&real, &state(t)), 0));
    let mut named: Vec<(LawName, Place)> = found.effects.iter().map(|effect| (effect.law, effect.site.place)).collect();
    named.sort_unstable();
    assert_eq!(
        named,
        [(LawName::BaseTilt, Place::Base), (LawName::MassDistribution, Place::Link(3))],
        "{:?}",
        found.plain
    );
}

#[test]
fn what_is_carried_in_a_part_of_the_rows_is_named_alone_with_its_mass() {
    let (empty, full) = (tx40(), loaded(2.0, Vec3::new(0.03, 0.0, 0.1)));
    let half_s = STEP_S * f64::from(ROWS / 2);
    let measured = |t: f64| if t < half_s { (&empty, 0) } else { (&full, 3) };
    let found = diagnosed(|t| (torque(measured(t).0, &state(t)), measured(t).1));
    let values = alone(&found, LawName::MassDistribution, Place::Payload(3));
    holds(values["m"], 2.0, 0.3);
    holds(values["m·cz"], 0.2, 0.1);
}

/// Without a column `payload` the moment is that of one cause, and steps of the joints' torques are no names for it.
#[test]
fn what_is_carried_from_some_time_on_is_no_offset_of_each_joint() {
    let (empty, full) = (tx40(), loaded(6.0, Vec3::new(0.03, 0.0, 0.1)));
    let from_s = 0.6 * STEP_S * f64::from(ROWS);
    let found = diagnosed(|t| (torque(if t < from_s { &empty } else { &full }, &state(t)), 0));
    assert_ne!(found.verdict, Verdict::EffectFound, "{:?}", found.plain);
    assert!(!found.effects.iter().any(|effect| effect.law == LawName::StepInTime), "{:?}", found.plain);
}

#[test]
fn what_is_carried_in_all_rows_is_a_part_of_the_link_that_carries_it() {
    let full = loaded(2.0, Vec3::new(0.03, 0.0, 0.1));
    let values = alone(&diagnosed(|t| (torque(&full, &state(t)), 1)), LawName::MassDistribution, Place::Link(3));
    holds(values["m"], 2.0, 0.3);
}

#[test]
fn torques_that_all_come_late_have_one_delay() {
    let (real, late_s) = (tx40(), 0.02);
    let values = alone(&diagnosed(|t| (torque(&real, &state(t - late_s)), 0)), LawName::Delay, Place::AllJoints);
    holds(values["delay"], late_s, 0.003);
}

#[test]
fn rows_that_are_far_off_make_no_wrong_log() {
    let real = tx40();
    let found = diagnosed(|t| {
        let mut measured = torque(&real, &state(t));
        measured[1] += if (t / STEP_S).round() % 40.0 == 7.0 { 100.0 } else { 0.0 };
        (measured, 0)
    });
    assert_eq!(found.verdict, Verdict::NoEffect, "{:?}", found.plain);
}

#[test]
fn joints_that_only_the_log_has_are_reported() {
    let named: Vec<String> =
        ["q", "tau"].iter().flat_map(|letter| (1..=6).map(move |k| format!("{letter}{k}"))).collect();
    let row = |row: u32| (0..named.len() as u32).map(|k| format!(",{}", f64::from(row * k).sin())).collect::<String>();
    let rows: String = (0..40).map(|k| format!("{}{}\n", f64::from(k) * STEP_S, row(k))).collect();
    let text = format!("t,{}\n{rows}", named.join(","));
    let findings = |robot: &Robot| {
        let table = Table::read_text(Path::new("a.csv"), text.as_bytes(), &Names::new()).unwrap().0;
        let data = Prepared::new(table, &Preparation::default(), None).unwrap();
        experiment(&data, robot, None, &[], None, &Progress::default()).unwrap().findings
    };
    assert!(findings(&tx40())[0].text.starts_with("the log has joints 5 to 6, the model has 4 joints"));
    assert_eq!(findings(&locked(&[])), []);
}

/// The torques of the robot, changed by what is added to that of its second joint, N·m.
fn changed_at_the_second_joint(change: impl Fn(f64, f64, f64) -> f64) -> Diagnosis {
    diagnosed(|time_s| {
        let state = state(time_s);
        let mut torques = torque(&tx40(), &state);
        torques[1] += change(time_s, state[0][1], torques[1]);
        (torques, 0)
    })
}

#[test]
fn a_spring_that_balances_a_link_is_not_told_from_the_weight_of_the_link() {
    let found = changed_at_the_second_joint(|_, q, _| 12.0 * (q + 0.4).sin());
    assert_eq!(found.verdict, Verdict::NotIdentifiable, "{:?}", found.plain);
    let laws: Vec<LawName> = found.alternatives.iter().map(|other| other.law).collect();
    assert!(laws.contains(&LawName::MassDistribution) && laws.contains(&LawName::Spring), "{laws:?}");
    assert!(found.next_measurement.is_none(), "no motion distinguishes them");
}

#[test]
fn a_gain_that_drifts_is_no_drift_of_an_offset_alone() {
    let found = changed_at_the_second_joint(|time_s, _, torque| -0.02 * time_s * torque);
    assert!(found.verdict != Verdict::EffectFound && found.is_more_left, "{:?}", found.plain);
    let with_time = |one: &crate::outcome::Dependence| one.variable == "time with predicted torque of joint 2";
    assert!(found.remaining.depends_on.iter().any(with_time), "{:?}", found.plain);
}
