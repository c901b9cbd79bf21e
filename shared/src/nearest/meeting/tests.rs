//! The wider search beside the beam and beside trying every word.

extern crate std;

use proptest::prelude::*;
use std::vec::Vec;

use super::super::{Beam, Frame, Module, frames, nearest, pose_base_tool, typical};
use super::Search;
use crate::actuator::Stage;
use crate::arms::{planar_arm, seeded, spatial_module, word};
use crate::real::Vec3;
use crate::se::Pose;

type Narrow = Search<8, 16, 384>;

/// The frames of the planar arm's modules.
fn planar() -> Vec<Vec<Frame<f32>>> {
    let (chain, one) = (planar_arm().cast::<f32>(), Pose::identity());
    chain.stages.iter().map(|stage| frames(stage, &one, &one).collect()).collect()
}

/// The frames of an arm of this many six-legged modules, each askew in its own way.
fn spatial(modules: usize) -> Vec<Vec<Frame<f32>>> {
    let one = Pose::identity();
    let askew = |k: usize| Pose::<f64>::new(&Vec3::new(0.02 * k as f64, -0.1, 0.15), Vec3::new(0.01, 0.02, 0.0));
    (0..modules)
        .map(|k| frames(&Stage::Spatial(spatial_module()), &askew(k), &one).collect::<Vec<_>>())
        .map(single)
        .collect()
}

fn single(frames: Vec<Frame<f64>>) -> Vec<Frame<f32>> {
    frames.iter().map(|frame| Frame { digits: frame.digits, pose: frame.pose.cast() }).collect()
}

fn modules(tables: &[Vec<Frame<f32>>], actuators: u8) -> Vec<Module<'_, f32>> {
    tables.iter().map(|frames| Module { frames, actuators, typical: typical(frames) }).collect()
}

/// A pose amid those that the arm reaches, and off all of them.
fn amid(tables: &[Vec<Frame<f32>>], numbers: &[usize], off: [f32; 3]) -> Pose<f32> {
    let pose =
        tables.iter().zip(numbers).fold(Pose::identity(), |pose, (frames, k)| pose * frames[k % frames.len()].pose);
    pose * Pose::new(&Vec3::new(0.0, 0.0, off[2]), Vec3::new(off[0], off[1], 0.0))
}

/// What the beam alone finds.
fn beamed(modules: &[Module<f32>], target: &Pose<f32>) -> f32 {
    nearest(modules, target, 0.5, &mut Beam::<f32, 8>::default()).unwrap().distance_m
}

fn off() -> impl Strategy<Value = [f32; 3]> {
    [-0.1f32..0.1, -0.1f32..0.1, -0.1f32..0.1]
}

proptest! {
    #![proptest_config(seeded(32))]

    #[test]
    fn few_words_are_all_tried(numbers in prop::array::uniform4(0usize..8), off in off()) {
        let tables = planar();
        let modules = modules(&tables, 3);
        let target = amid(&tables, &numbers, off);
        let every = (0..4096usize).map(|n| amid(&tables, &[n & 7, n >> 3 & 7, n >> 6 & 7, n >> 9], [0.0; 3]));
        let least_m = every.map(|pose| pose.distance(&target, 0.5)).fold(f32::MAX, f32::min);
        let found = Narrow::default().nearest(&modules, &target, 0.5).unwrap();
        prop_assert!((found.distance_m - least_m).abs() < 1e-3, "{found:?} {least_m}");
    }

    #[test]
    fn the_word_is_where_it_is_told_and_never_worse_than_the_beams(
        count in 1usize..7, numbers in prop::array::uniform6(0usize..64), off in off()
    ) {
        let tables = spatial(count);
        let modules = modules(&tables, 6);
        let target = amid(&tables, &numbers, off);
        let mut search = Narrow::default();
        let found = search.nearest(&modules, &target, 0.5).unwrap();
        let there = pose_base_tool(&modules, &found.word).unwrap();
        prop_assert!((there.distance(&target, 0.5) - found.distance_m).abs() < 1e-3, "{found:?}");
        prop_assert!(found.distance_m <= beamed(&modules, &target));
        // In one go or not, it has an answer at any time that only gets better, but for rounding.
        search.begin(&target, 6 * count);
        for (index, module) in modules.iter().enumerate() {
            let behind = modules[index + 1..].iter().fold(Pose::identity(), |tail, module| tail * module.typical);
            search.module(6, &behind, 0.5);
            module.frames.iter().for_each(|frame| search.offer(frame));
        }
        let (mut steps, mut least_m) = (1, f32::MAX);
        while search.step() {
            let now_m = search.found().unwrap().distance_m;
            prop_assert!(now_m <= 1.01 * least_m, "{now_m} {least_m}");
            (steps, least_m) = (steps + 1, now_m.min(least_m));
        }
        prop_assert_eq!(search.found().unwrap(), found);
        prop_assert!(steps < 4 * (8 + 4 * 16) + 16 * (4 + 16 * (24 + 1) + 2), "{steps}");
    }

    #[test]
    fn any_target_is_answered(numbers in prop::array::uniform6(-1e30f32..1e30)) {
        let tables = planar();
        let [x, y, z, a, b, c] = numbers;
        let target = Pose::new(&(Vec3::new(a, b, c) / 1e30), Vec3::new(x, y, z));
        let found = Narrow::default().nearest(&modules(&tables, 3), &target, 0.5);
        prop_assert!(found.is_some_and(|found| found.word.len() == 12));
    }

    #[test]
    fn a_reachable_pose_is_nearly_reached(word in word(planar_arm())) {
        let tables = planar();
        let modules = modules(&tables, 3);
        let target = pose_base_tool(&modules, &word).unwrap();
        prop_assert!(Narrow::default().nearest(&modules, &target, 0.5).unwrap().distance_m < 1e-3);
    }
}

#[test]
fn modules_without_room_are_left_to_the_beam() {
    let tables = spatial(3);
    let modules = modules(&tables, 6);
    let target = amid(&tables, &[7, 21, 40], [0.03, -0.02, 0.05]);
    let narrow = Search::<8, 16, 100>::default().nearest(&modules, &target, 0.5).unwrap();
    assert_eq!(narrow.distance_m, beamed(&modules, &target));
    let many: Vec<_> = (0..9).map(|_| modules[0]).collect();
    let found = Search::<8, 16, 1000>::default().nearest(&many, &target, 0.5).unwrap();
    assert_eq!(found.distance_m, beamed(&many, &target));
    let empty = [modules[0], Module { frames: &[], ..modules[0] }];
    assert_eq!(Narrow::default().nearest(&empty, &target, 0.5), None);
}
