//! Markers, scaling, mapping and balance of a person who stands up, on the planar robot.

use std::path::Path;

use darm_core::real::Vec3;
use darm_core::se::Pose;
use nalgebra::{DMatrix, DVector};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::banded::Banded;
use super::demonstration::{Style, demonstrate};
use super::mapping::map;
use super::person::person;
use super::placed::Placed;
use super::setup::{Setup, SetupError};
use super::{Capture, CaptureError, Fixed, Polygon, Posture};
use crate::measurement::table::{Names, Table};
use crate::robot::Robot;
use crate::urdf::{Locks, parse};

const HUMAN: &str = include_str!("../../../tests/data/stand/person.urdf");
const PLANAR: &str = include_str!("../../../tests/data/urdf/planar5.urdf");
const SETUP: &str = include_str!("../../../tests/data/stand/stand.toml");

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
    let marker = Fixed { joint: Some(18), point: Vec3::new(0.02, -0.1, 0.03) };
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
fn a_motion_is_mapped_with_the_centre_of_mass_held() {
    let (human, robot, setup) = (floating(HUMAN), floating(PLANAR), setup(SETUP).unwrap());
    let names: Vec<String> = setup.markers.iter().map(|marker| marker.name.clone()).collect();
    let markers: Vec<Fixed> = setup.markers.iter().map(|marker| marker.on_person).collect();
    let shown = demonstrate(&human, (&names, &markers), &setup.person_feet, Style::Natural, 5).unwrap();
    // Every fifth frame is motion enough here, and a marker may hide for a while.
    let mut capture = Capture {
        time_s: shown.capture.time_s.iter().step_by(5).copied().collect(),
        places: shown.capture.places.iter().step_by(5).cloned().collect(),
        plates: shown.capture.plates.iter().step_by(5).copied().collect(),
        ..shown.capture
    };
    capture.places[7][3] = None;
    let found = person(&human, &markers, &capture).unwrap();
    assert!(
        found.after.rms_m < found.before.rms_m && found.after.worst_m < 0.02,
        "{:?} {:?}",
        found.before,
        found.after
    );
    let mapped = map(&robot, &setup, &found, &capture).unwrap();
    assert_eq!(mapped.axes, [true, false, true], "in the sagittal plane");
    assert!(mapped.com_error_m < 1e-6 && mapped.trajectory.worst_constraint < 1e-6, "{}", mapped.com_error_m);
    for posture in &mapped.trajectory.postures {
        for (joint, q) in robot.joints.iter().zip(&posture.q) {
            let [low, high] = joint.limits.unwrap();
            assert!((low..=high).contains(q), "{} at {q}", joint.name);
        }
    }
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
    let pull = table(&|k| (seen(), if k == 4 { "-700" } else { "700" }.into())).unwrap_err().to_string();
    assert!(pull.starts_with("frame 5 (line 6)"), "{pull}");
    let few = table(&|k| (if k == 2 { String::new() } else { seen() }, "700".into())).unwrap_err().to_string();
    assert!(few.starts_with("frame 3 (line 4)") && few.ends_with("missing: A"), "{few}");
    let long = table(&|k| (if k > 3 { String::new() } else { seen() }, "700".into())).unwrap_err().to_string();
    assert!(long.starts_with("marker A is missing in 8 of 12 frames, first in frame 5"), "{long}");
    let lost = Capture::of(&Table::default(), &names);
    assert!(matches!(lost, Err(CaptureError::Read(_))), "{lost:?}");
    let unknown = setup(&SETUP.replace("\"middle_thorax\"", "\"middle_chest\"")).unwrap_err().to_string();
    assert!(unknown.contains("no link `middle_chest`; there are middle_pelvis"), "{unknown}");
    let flat = setup(&SETUP.replace("ankle = -20", "ankles = -20")).unwrap_err().to_string();
    assert!(flat.starts_with("robot.sitting_deg: planar5 has no joint `ankles`"), "{flat}");
}
