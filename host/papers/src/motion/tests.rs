//! Markers, scaling, mapping and balance of a person who stands up, on the planar robot.

use std::path::Path;
use std::sync::OnceLock;

use darm_core::real::Vec3;
use darm_core::se::Pose;
use nalgebra::{DMatrix, DVector};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::balance::cart;
use super::banded::Banded;
use super::demonstration::{Style, demonstrate};
use super::execution::{Gains, execute};
use super::mapping::map;
use super::person::{Person, person};
use super::placed::Placed;
use super::setup::{Setup, SetupError};
use super::{BodyPoint, Capture, CaptureError, LiftOffBy, Polygon, Posture, feed_forward};
use darm_measure::table::{Names, Table};
use darm_robot::robot::Robot;
use darm_robot::urdf::{Locks, parse};

const HUMAN: &str = include_str!("../../../../tests/data/stand/person.urdf");
const PLANAR: &str = include_str!("../../../../tests/data/urdf/planar5.urdf");
const SETUP: &str = include_str!("../../../../tests/data/stand/stand.toml");

fn floating(text: &str) -> Robot {
    let mut robot = parse(Path::new("robot.urdf"), text, &Locks::new()).unwrap();
    robot.floating = true;
    robot
}

fn setup(text: &str) -> Result<Setup, SetupError> {
    Setup::parse(Path::new("stand.toml"), text, &floating(HUMAN), &floating(PLANAR))
}

#[test]
fn a_banded_system_is_solved_as_a_full_one() {
    let (n, width) = (23, 5);
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let (mut banded, mut full) = (Banded::zeros(n, width), DMatrix::zeros(n, n));
    for row in 0..n {
        for column in row.saturating_sub(width)..=row {
            let value = if row == column { 12.0 } else { random.random_range(-1.0..1.0) };
            banded.add(row, column, value);
            (full[(row, column)], full[(column, row)]) = (value, value);
        }
    }
    let right = DVector::from_fn(n, |k, _| k as f64 - 7.0);
    let solved = banded.solve(right.clone()).unwrap();
    assert!((full * solved - right).amax() < 1e-12);
    let mut negative = Banded::zeros(2, 1);
    negative.add(0, 0, -1.0);
    assert!(negative.solve(DVector::zeros(2)).is_none());
}

#[test]
fn jacobians_are_differences() {
    let robot = floating(HUMAN);
    let mut placed = Placed::new(&robot).unwrap();
    let posture = Posture {
        base: Pose::new(&Vec3::new(0.3, -0.2, 0.5), Vec3::new(0.1, 0.2, 0.9)),
        q: (0..robot.joints.len()).map(|k| 0.3 * (k as f64).sin()).collect(),
    };
    let marker = BodyPoint { joint: Some(18), point: Vec3::new(0.02, -0.1, 0.03) };
    placed.place(&posture);
    let (of_point, (com, of_com)) = (placed.jacobian(marker.joint, &Pose::at(marker.point)), placed.com());
    let point = placed.point(&marker);
    for k in 0..6 + posture.q.len() {
        let mut change = DVector::zeros(6 + posture.q.len());
        change[k] = 1e-6;
        placed.place(&posture.moved(&change));
        let slope = (placed.point(&marker) - point) / 1e-6;
        assert!((slope - of_point.fixed_view::<3, 1>(3, k)).norm() < 1e-5, "column {k}");
        assert!(((placed.com().0 - com) / 1e-6 - of_com.column(k)).norm() < 1e-5, "column {k}");
    }
    let mut change = DVector::from_fn(6 + posture.q.len(), |k, _| 0.01 * (k as f64).cos());
    change[1] = -0.02;
    let there = posture.to(&posture.moved(&change));
    assert!((there - change).amax() < 1e-3, "turn and shift agree to first order");
}

#[test]
fn a_hull_has_its_corners_and_tells_how_far_inside_a_point_is() {
    let square = Polygon::hull(&[[0.0, 0.0], [2.0, 0.0], [1.0, 0.5], [2.0, 2.0], [0.0, 2.0], [0.0, 1.0]]);
    assert_eq!(square.corners.len(), 4);
    assert!((square.margin([1.0, 0.25]) - 0.25).abs() < 1e-12 && (square.margin([2.5, 1.0]) + 0.5).abs() < 1e-12);
}

#[test]
fn a_point_is_pulled_inside_along_the_axes_that_are_free() {
    let square = Polygon::hull(&[[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]);
    let near = |point: [f64; 2], axes, expected: [f64; 2]| {
        let pulled = square.pulled_in(point, 0.1, axes);
        assert!(pulled.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{pulled:?}");
    };
    near([1.0, 1.0], [true; 2], [1.0, 1.0]);
    near([-0.5, 2.3], [true; 2], [0.1, 1.9]);
    near([-0.5, 2.3], [true, false], [0.1, 2.3]);
    near([-0.5, 2.3], [false; 2], [-0.5, 2.3]);
}

#[test]
fn a_cart_moves_its_zero_moment_point_as_asked() {
    let (step_s, c) = (0.02, 0.09);
    let pull: Vec<f64> = (0..200).map(|k| if (80..100).contains(&k) { 0.02 } else { 0.0 }).collect();
    let moved = cart(&pull, step_s, c).unwrap();
    for k in 1..199 {
        let bend = (moved[k - 1] - 2.0 * moved[k] + moved[k + 1]) / (step_s * step_s);
        assert!((moved[k] - c * bend - pull[k]).abs() < 1e-12);
    }
    let most = moved.iter().copied().fold(0.0, f64::max);
    assert!(most < 0.02 && moved[0] < 1e-4, "less than the zero-moment point, and nothing long before: {most}");
}

/// A person who stands up, every fourth frame of it, as cameras and plates saw it and as it was fitted: once for all tests.
fn shown(setup: &Setup) -> &'static (Capture, Person) {
    static SHOWN: OnceLock<(Capture, Person)> = OnceLock::new();
    SHOWN.get_or_init(|| {
        let human = floating(HUMAN);
        let shown = demonstrate(&human, setup, Style::Natural, 5).unwrap();
        let mut capture = Capture {
            time_s: shown.capture.time_s.iter().step_by(4).copied().collect(),
            places: shown.capture.places.iter().step_by(4).cloned().collect(),
            plates: shown.capture.plates.iter().step_by(4).copied().collect(),
            chair_n: shown.capture.chair_n.as_ref().map(|all| all.iter().step_by(4).copied().collect()),
            ..shown.capture
        };
        // A marker may hide for a while.
        capture.places[3][3] = None;
        let found = person(&human, &setup.on_person(), &capture).unwrap();
        (capture, found)
    })
}

#[test]
fn a_motion_is_mapped_with_the_centre_of_mass_held() {
    let (robot, setup) = (floating(PLANAR), setup(SETUP).unwrap());
    let (capture, found) = shown(&setup);
    assert!(found.after.rms_m < found.before.rms_m, "{:?} {:?}", found.before, found.after);
    assert!(found.after.worst_m < 0.02, "{:?}", found.after);
    let mapped = map(&robot, &setup, found, capture).unwrap();
    assert_eq!(mapped.axes, [true, false, true], "in the sagittal plane");
    assert_eq!(mapped.lift_off_by, LiftOffBy::ChairForce);
    let lift_off_s = mapped.time_s[mapped.lift_off];
    assert!((1.3..1.5).contains(&lift_off_s), "the thighs begin to turn at 1.25 s: {lift_off_s}");
    assert!(mapped.com_error_m < 1e-6 && mapped.trajectory.worst_constraint < 1e-6, "{}", mapped.com_error_m);
    assert!(mapped.balance.zmp_margin_m > 0.02, "{:?}", mapped.balance);
    for posture in &mapped.trajectory.postures {
        for (joint, q) in robot.joints.iter().zip(&posture.q) {
            let [low, high] = joint.limits.unwrap();
            assert!((low..=high).contains(q), "{} at {q}", joint.name);
        }
    }
    let mut placed = Placed::new(&robot).unwrap();
    let mut seat = |frame: usize| {
        placed.place(&mapped.trajectory.postures[frame]);
        0.5 * (placed.point(&setup.seat[0]) + placed.point(&setup.seat[1]))
    };
    assert!((seat(mapped.lift_off - 1) - seat(0)).norm() < 1e-6, "at rest on the chair until it is left");
    assert!(seat(mapped.time_s.len() - 1).z > seat(0).z + 0.2);
    let torque = feed_forward(&robot, &setup, &mapped).unwrap();
    let executed = execute(&robot, &setup, &mapped, (Gains::default(), &torque)).unwrap();
    assert!(!executed.fell && executed.cop_margin_m > 0.0, "{}", executed.cop_margin_m);
    assert!(*executed.chair_n.last().unwrap() == 0.0 && executed.chair_n[0] > 300.0);
}

/// Plates of floor, chair and arm rests are one wrench: they add, and chair and hands are kept apart.
#[test]
fn separate_plates_are_one_wrench() {
    let names: Vec<String> = ["A", "B", "C"].map(str::to_owned).to_vec();
    let read = |head: &str, row: &str| {
        let mut text = format!("t_s,A_x,A_y,A_z,B_x,B_y,B_z,C_x,C_y,C_z,{head}\n");
        for k in 0..12 {
            text += &format!("{},0,0,1,1,0,1,0,1,1,{row}\n", 0.02 * f64::from(k));
        }
        let (table, _) = Table::read_text(Path::new("c.csv"), text.as_bytes(), &Names::new()).unwrap();
        Capture::of(&table, &names)
    };
    let one = read("Fz_n,Mx_nm,My_nm,chair_Fz_n", "700,14,-70,400").unwrap();
    let parts =
        "floor_Fz_n,floor_Mx_nm,floor_My_nm,chair_Fz_n,chair_Mx_nm,chair_My_nm,hands_Fz_n,hands_Mx_nm,hands_My_nm";
    let separate = read(parts, "200,4,-10,400,10,-50,100,0,-10").unwrap();
    assert_eq!((&one.plates, &one.chair_n), (&separate.plates, &separate.chair_n));
    assert_eq!((one.hands_n, separate.hands_n), (None, Some(vec![100.0; 12])));
    assert!((separate.plates[0].cop[0] - 0.1).abs() < 1e-12 && (separate.plates[0].cop[1] - 0.02).abs() < 1e-12);
    let lost = read("floor_Fz_n,floor_Mx_nm,floor_My_nm,chair_Fz_n", "700,14,-70,400").unwrap_err().to_string();
    assert!(lost.contains("chair_mx"), "{lost}");
    let empty = read("Fz_n,Mx_nm,My_nm,chair_Fz_n", "700,14,-70,").unwrap_err();
    assert!(matches!(empty, CaptureError::Pulls { frame: 1, .. }), "{empty}");
}

#[test]
fn plates_whose_moment_is_turned_are_told() {
    let setup = setup(SETUP).unwrap();
    let (capture, found) = shown(&setup);
    let mut turned = Capture {
        time_s: capture.time_s[..12].to_vec(),
        places: capture.places[..12].to_vec(),
        plates: capture.plates[..12].to_vec(),
        ..capture.clone()
    };
    turned.plates.iter_mut().for_each(|plate| plate.cop[0] *= -1.0);
    let error = person(&found.tree, &found.markers, &turned).unwrap_err().to_string();
    assert!(error.starts_with("the plates' My:"), "{error}");
}

#[test]
fn what_is_out_of_reach_is_told_with_its_frame_and_name() {
    let setup = setup(SETUP).unwrap();
    let (capture, found) = shown(&setup);
    let mut stiff = floating(PLANAR);
    // A knee that does not bend.
    stiff.joints[1].limits = Some([-0.05, 0.3]);
    let error = map(&stiff, &setup, found, capture).unwrap_err().to_string();
    assert!(error.starts_with("frame 1: no posture within the limits") && error.contains("has the "), "{error}");
}

#[test]
fn two_feet_bear_a_plan_together() {
    const LEGS: &str = r#"[robot.feet]
l_ankle = [[-0.08, -0.05, -0.09], [0.16, -0.05, -0.09], [0.16, 0.05, -0.09], [-0.08, 0.05, -0.09]]
r_ankle = [[-0.08, -0.05, -0.09], [0.16, -0.05, -0.09], [0.16, 0.05, -0.09], [-0.08, 0.05, -0.09]]
[robot.seat]
BODY = [[-0.02, -0.08, -0.1], [-0.02, 0.08, -0.1]]
[robot.sitting_deg]
LLEG_HIP_P = -85
RLEG_HIP_P = -85
LLEG_KNEE = 100
RLEG_KNEE = 100
LLEG_ANKLE_P = -15
RLEG_ANKLE_P = -15
[robot.links]
middle_pelvis = "BODY"
middle_thorax = "torso"
left_upperleg = "LLEG_LINK3"
right_upperleg = "RLEG_LINK3"
left_lowerleg = "LLEG_LINK4"
right_lowerleg = "RLEG_LINK4"
"#;
    const ARMS: [&str; 7] = ["SHOULDER_P", "SHOULDER_R", "SHOULDER_Y", "ELBOW", "WRIST_Y", "WRIST_P", "WRIST_R"];
    let hanging = ["L", "R"].iter().flat_map(|side| ARMS.map(|joint| (format!("{side}ARM_{joint}"), 0.0)));
    let text = include_str!("../../../../tests/data/urdf/simple_humanoid.urdf");
    let mut robot = parse(Path::new("two.urdf"), text, &hanging.collect()).unwrap();
    robot.floating = true;
    // The limits of this file's legs are those of other joints: it could not sit.
    for joint in robot.joints.iter_mut().filter(|joint| joint.name.contains("LEG")) {
        joint.limits = Some([-2.6, 2.6]);
    }
    let text = SETUP.split("[robot]").next().unwrap().to_owned() + LEGS;
    let setup = Setup::parse(Path::new("two.toml"), &text, &floating(HUMAN), &robot).unwrap();
    let (capture, found) = shown(&setup);
    let mapped = map(&robot, &setup, found, capture).unwrap();
    assert_eq!(mapped.axes, [true; 3]);
    assert!(mapped.com_error_m < 1e-6 && mapped.trajectory.worst_constraint < 1e-6, "{}", mapped.com_error_m);
    let between = [mapped.sole.iter().map(|at| at[0]).sum::<f64>() / 8.0, 0.0];
    assert!((Polygon::hull(&mapped.sole).margin(between) - 0.12).abs() < 1e-9, "the ground between the feet bears too");
    assert!(mapped.balance.com_margin_m > 0.0, "{:?}", mapped.balance.com_margin_m);
    let torque = feed_forward(&robot, &setup, &mapped).unwrap();
    let last = torque.last().unwrap();
    let knee = |side: &str| last[robot.joints.iter().position(|j| j.name == format!("{side}LEG_KNEE")).unwrap()];
    assert!((knee("L") - knee("R")).abs() < 0.2 * knee("L").abs(), "both legs carry: {} {}", knee("L"), knee("R"));
}

#[test]
fn bad_captures_and_setups_are_told() {
    let names: Vec<String> = ["A", "B", "C"].map(str::to_owned).to_vec();
    let table = |change: &dyn Fn(usize) -> (String, String)| {
        let mut text = "t_s,A_x,A_y,A_z,B_x,B_y,B_z,C_x,C_y,C_z,Fz_n,Mx_nm,My_nm\n".to_owned();
        for k in 0..12 {
            let (marker, force) = change(k);
            text += &format!("{},{marker},0,1,1,0,1,0,1,1,{force},0,0\n", 0.02 * f64::from(k as u8));
        }
        let (table, _) = Table::read_text(Path::new("c.csv"), text.as_bytes(), &Names::new()).unwrap();
        Capture::of(&table, &names)
    };
    let seen = || "0.5".to_owned();
    let pull = table(&|k| (seen(), if k == 4 { "-700" } else { "700" }.into())).unwrap_err();
    assert!(pull.line() == Some(6) && pull.to_string().contains("-700 N in frame 5"), "{pull}");
    let few = table(&|k| (if k == 2 { String::new() } else { seen() }, "700".into())).unwrap_err().to_string();
    assert!(few.contains("frame 3") && few.ends_with("A are missing"), "{few}");
    let long = table(&|k| (if k > 3 { String::new() } else { seen() }, "700".into())).unwrap_err().to_string();
    assert!(long.starts_with("marker A is missing in 8 of 12 frames, first in frame 5"), "{long}");
    let lost = Capture::of(&Table::default(), &names);
    assert!(matches!(lost, Err(CaptureError::Read(_))), "{lost:?}");
    let unknown = setup(&SETUP.replace("\"middle_thorax\"", "\"middle_chest\"")).unwrap_err().to_string();
    assert!(unknown.contains("no link `middle_chest`; give one of middle_pelvis"), "{unknown}");
    let flat = setup(&SETUP.replace("ankle = -20", "ankles = -20")).unwrap_err().to_string();
    assert!(flat.starts_with("stand.toml:") && flat.contains(": planar5 has no joint `ankles`"), "{flat}");
}
