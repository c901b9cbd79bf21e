//! Arms whose postures are known by heart: the elbow of two links, the wrist and shoulder of the Puma.

use darm_core::real::Vec3;
use darm_core::se::Pose;
use proptest::prelude::*;

use super::Configurations;
use crate::dh;
use crate::ik::Options;
use crate::robot::Robot;
use crate::robot::planar::planar_arm;

const PI: f64 = std::f64::consts::PI;

fn all(links: usize, target: &Pose<f64>, orientation_rad: f64, most: usize) -> Configurations {
    let (arm, tip) = planar_arm(&vec![0.3; links], &vec![[-PI, PI]; links]);
    let options = Options { orientation_rad, starts: 300, ..Options::default() };
    let found = arm.configurations(&tip, target, &[], &options, most).unwrap();
    for posture in &found.postures {
        let reached = arm.kinematics(&tip, &posture.q).unwrap().pose_base_frame.to(target);
        assert!(reached.position.norm() <= 1e-9 && (orientation_rad.is_infinite() || reached.angle_rad() <= 1e-9));
        assert!(posture.met > 0 && posture.q.iter().all(|q| q.abs() <= PI));
    }
    assert_eq!(found.postures.iter().map(|posture| posture.met).sum::<usize>(), found.reached);
    found
}

proptest! {
    #![proptest_config(crate::testing::seeded(16))]

    /// Two links reach a point with the elbow on either side; three reach a pose so.
    #[test]
    fn an_elbow_bends_both_ways(angle in -2.8..2.8f64, radius in 0.1..0.55f64, turn in -2.8..2.8f64) {
        let point = Vec3::new(radius * angle.cos(), radius * angle.sin(), 0.0);
        let two = all(2, &Pose::at(point), f64::INFINITY, 9);
        prop_assert_eq!((two.freedom, two.postures.len()), (0, 2));
        // The elbow turns by as much the other way.
        prop_assert!((two.postures[0].q[1] + two.postures[1].q[1]).abs() < 1e-6);
        let hand = Pose::new(&Vec3::new(0.0, 0.0, turn), point + Vec3::new(0.3 * turn.cos(), 0.3 * turn.sin(), 0.0));
        let three = all(3, &hand, 1e-5, 9);
        prop_assert_eq!((three.freedom, three.postures.len()), (0, 2));
    }
}

#[test]
fn a_redundant_arm_has_a_sample_of_its_self_motion() {
    let point = Pose::at(Vec3::new(0.4, 0.2, 0.0));
    for (links, freedom) in [(3, 1), (4, 2)] {
        let found = all(links, &point, f64::INFINITY, 10);
        assert_eq!((found.freedom, found.postures.len()), (freedom, 10));
    }
}

#[test]
fn what_is_out_of_reach_has_no_posture() {
    let found = all(2, &Pose::at(Vec3::new(2.0, 0.0, 0.0)), f64::INFINITY, 9);
    assert_eq!((found.postures.len(), found.reached, found.freedom), (0, 0, 0));
    assert_eq!(all(3, &Pose::at(Vec3::new(f64::NAN, 0.0, 0.0)), f64::INFINITY, 9).postures.len(), 0);
}

/// Shoulder, elbow and wrist each two ways, where no limit forbids it.
#[test]
fn the_puma_has_eight_postures() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/puma560.toml");
    let mut puma: Robot = dh::read(&path).unwrap();
    puma.joints.iter_mut().for_each(|joint| joint.limits = Some([-PI, PI]));
    let tool = puma.tool().unwrap().clone();
    let q = [0.3, 0.8, -2.0, 0.5, 0.9, -0.4];
    let target = puma.kinematics(&tool, &q).unwrap().pose_base_frame;
    let options = Options { starts: 400, ..Options::default() };
    let found = puma.configurations(&tool, &target, &q, &options, 9).unwrap();
    assert_eq!((found.freedom, found.postures.len()), (0, 8), "{found:?}");
    assert!(found.postures[0].q.iter().zip(&q).all(|(a, b)| (a - b).abs() < 1e-6), "that of the start comes first");
}
