//! The beam search beside trying every word, and what it refuses.

extern crate std;

use proptest::prelude::*;
use std::vec::Vec;

use super::{Beam, Coordinates, Frame, Module, frames, nearest, pose_base_tool, typical};
use crate::arms::{planar_arm, seeded, word};
use crate::chain::Scratch;
use crate::se::Pose;
use crate::units::Word;

/// The frames of each module of the planar arm in `f32`.
fn tables() -> Vec<Vec<Frame<f32>>> {
    let chain = planar_arm().cast::<f32>();
    let one = Pose::identity();
    chain.stages.iter().map(|stage| frames(stage, &one, &one).collect()).collect()
}

fn modules(tables: &[Vec<Frame<f32>>]) -> Vec<Module<'_, f32>> {
    tables.iter().map(|frames| Module { frames, actuators: 3, typical: typical(frames) }).collect()
}

proptest! {
    #![proptest_config(seeded(64))]

    #[test]
    fn look_ups_stand_where_the_chain_does(word in word(planar_arm())) {
        let tables = tables();
        let pose = pose_base_tool(&modules(&tables), &word).unwrap();
        let exact = planar_arm().pose_base_tool(&word, &[], &mut Scratch::default()).unwrap();
        prop_assert!(pose.distance(&exact.cast(), 0.5) < 1e-5);
    }

    #[test]
    fn a_beam_as_wide_as_the_arm_finds_the_word(word in word(planar_arm())) {
        let tables = tables();
        let modules = modules(&tables);
        let target = pose_base_tool(&modules, &word).unwrap();
        let found = nearest(&modules, &target, 0.5, &mut Beam::<f32, 512>::default()).unwrap();
        prop_assert!(found.distance_m < 1e-3, "{found:?}");
        let again = pose_base_tool(&modules, &found.word).unwrap();
        prop_assert!((again.distance(&target, 0.5) - found.distance_m).abs() < 1e-3);
    }

    #[test]
    fn any_target_is_answered_by_a_narrow_beam(numbers in prop::array::uniform6(-1e30f32..1e30)) {
        let tables = tables();
        let [x, y, z, a, b, c] = numbers;
        let turn = crate::real::Vec3::new(a, b, c) / 1e30;
        let target = Pose::new(&turn, crate::real::Vec3::new(x, y, z));
        let found = nearest(&modules(&tables), &target, 0.5, &mut Beam::<f32, 2>::default());
        prop_assert!(found.is_some_and(|found| found.word.len() == 12));
    }
}

#[test]
fn coordinates_are_those_of_the_pose_and_no_others_are_sound() {
    let pose = Pose::new(&crate::real::Vec3::new(0.3, -0.2, 1.0), crate::real::Vec3::new(0.1, 2.0, -3.0));
    let coordinates = Coordinates::of(&pose);
    assert!(coordinates.pose().distance(&pose.cast(), 1.0) < 1e-6);
    assert!(coordinates.is_sound());
    for wrong in [f32::NAN, f32::INFINITY, -1e4] {
        assert!(!Coordinates { turn_rad: [0.0, wrong, 0.0], ..coordinates }.is_sound());
        assert!(!Coordinates { position_m: [0.0, 0.0, wrong], ..coordinates }.is_sound());
    }
}

#[test]
fn what_cannot_be_answered_is_none() {
    let tables = tables();
    let all = modules(&tables);
    assert_eq!(pose_base_tool(&all, &Word::zeros(11).unwrap()), None);
    let empty = [Module { frames: &[], ..all[0] }];
    assert_eq!(nearest(&empty, &Pose::identity(), 0.5, &mut Beam::<f32, 4>::default()), None);
    assert_eq!(nearest(&[], &Pose::identity(), 0.5, &mut Beam::<f32, 4>::default()), None);
    let long = [Module { actuators: 65, ..all[0] }];
    assert_eq!(nearest(&long, &Pose::identity(), 0.5, &mut Beam::<f32, 4>::default()), None);
}
