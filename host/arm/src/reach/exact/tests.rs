//! The search agrees with looking at all words.

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use darm_core::actuator::{Axis, DiscreteJoint, JointKind, Stage};
use darm_core::se::Pose;
use darm_core::units::Word;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::{Index, NoPattern, Options, Pattern, Query, switches, words_to_choose_from};
use crate::arm::Arm;
use crate::reach::{ReachError, frames};

fn planar4() -> Arm {
    Arm::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/planar4.toml")).unwrap()
}

/// An arm of up to `digits` discrete joints and planar modules.
fn random_arm(random: &mut ChaCha8Rng, digits: usize) -> Arm {
    let mut arm = planar4();
    let modules: Vec<_> = arm.model.chain.stages.iter().copied().collect();
    arm.model.chain.stages.clear();
    while arm.n_actuators() + 3 <= digits {
        let mut number = || random.random_range(-1.0..1.0);
        let direction = darm_core::real::Vec3::new(number(), number(), number() + 2.0).normalize();
        let mut values = [number(), number(), number(), number()];
        values.sort_by(f64::total_cmp);
        let kind = if number() > 0.0 { JointKind::Revolute } else { JointKind::Prismatic };
        let states = if number() > 0.0 { 2 } else { 4 };
        let joint = Stage::Discrete(DiscreteJoint { axis: Axis { kind, direction }, values, states });
        let stage = if number() > 0.3 { modules[0] } else { joint };
        arm.model.chain.stages.push(stage).unwrap();
    }
    arm
}

fn options(arm: &Arm, max_tails: usize) -> Options {
    Options { max_tails, ..Options::of(arm) }
}

/// All words, nearest first.
fn by_trying_all(arm: &Arm, target: &Pose<f64>, length_scale_m: f64) -> Vec<(f64, Word)> {
    let all = frames::product(&frames::of_stages(arm, &[], |_, _| true).unwrap(), arm.rest());
    let distances = all.poses.iter().map(|pose| pose.distance(target, length_scale_m));
    let mut sorted: Vec<_> = distances.zip(all.words).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    sorted
}

fn random_target(random: &mut ChaCha8Rng) -> Pose<f64> {
    let mut vector = |size: f64| darm_core::real::Vec3::from_fn(|_, _| random.random_range(-size..size));
    Pose::new(&vector(2.0), vector(3.0))
}

#[test]
fn a_search_that_is_given_up_has_no_answer() {
    let arm = planar4();
    let index = Index::new(&arm, &Options::of(&arm)).unwrap();
    let target = Pose::identity();
    let query = Query { target: &target, count: 1, forbidden: &[] };
    assert_eq!(index.nearest_while(&query, || false), None);
    assert_eq!(index.nearest_while(&query, || true), Some(index.nearest(&target, 1, &[])));
}

#[test]
fn the_nearest_words_are_those_of_trying_all() {
    let mut random = ChaCha8Rng::seed_from_u64(0xda24);
    for case in 0..60 {
        let digits = random.random_range(3..=10);
        let arm = random_arm(&mut random, digits);
        let target = random_target(&mut random);
        let scale = [0.5, 0.0, 2.0][case % 3];
        let all = by_trying_all(&arm, &target, scale);
        for max_tails in [1, 64, 1 << 20] {
            let index = Index::new(&arm, &Options { length_scale_m: scale, ..options(&arm, max_tails) }).unwrap();
            assert_eq!(index.words(), all.len() as f64);
            let found = index.nearest(&target, 5, &[]);
            assert_eq!(found.len(), all.len().min(5));
            for (near, (distance_m, _)) in found.iter().zip(&all) {
                assert!((near.distance_m - distance_m).abs() < 1e-12, "case {case}: {near:?} {distance_m}");
            }
        }
    }
}

#[test]
fn an_arm_of_many_words_meets_those_of_a_tree_of_many_buckets() {
    let mut arm = planar4();
    arm.model.chain.stages.push(arm.model.chain.stages[1]).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let index = Index::new(&arm, &options(&arm, 1 << 20)).unwrap();
    for _ in 0..20 {
        let target = random_target(&mut random);
        let (distance_m, _) = by_trying_all(&arm, &target, 0.5)[0];
        assert!((index.nearest(&target, 1, &[])[0].distance_m - distance_m).abs() < 1e-12);
    }
}

#[test]
fn a_forbidden_word_and_a_dead_actuator_stay_out() {
    let arm = planar4();
    let target = random_target(&mut ChaCha8Rng::seed_from_u64(3));
    let all = by_trying_all(&arm, &target, 0.5);
    let forbidden: Pattern = "1**,***,***,**0".parse().unwrap();
    let dead = Options { dead: vec![(4, 1)], ..options(&arm, 64) };
    let wanted = all.iter().find(|(_, word)| word.digit(4) == 1 && !forbidden.names(word)).unwrap();
    let found = Index::new(&arm, &dead).unwrap().nearest(&target, 1, &[forbidden]);
    assert_eq!(found[0].word, wanted.1);
    assert_eq!("10x".parse::<Pattern>(), Err(NoPattern { character: 'x' }));
}

#[test]
fn forbidden_words_are_not_counted() {
    let arm = planar4();
    let dead = Options { dead: vec![(4, 1)], ..options(&arm, 64) };
    let patterns = ["1**,***,***,**0", "11*,***,0**,***", "***,*0*,***,***", "**,**"].map(|text| text.parse().unwrap());
    let all = by_trying_all(&arm, &Pose::identity(), 0.5);
    for count in 0..=patterns.len() {
        let forbidden: &[Pattern] = &patterns[..count];
        let left = |word: &Word| word.digit(4) == 1 && !forbidden.iter().any(|pattern| pattern.names(word));
        let expected = all.iter().filter(|(_, word)| left(word)).count();
        assert_eq!(words_to_choose_from(&arm, &dead, forbidden), Ok(expected as f64));
    }
}

#[test]
fn the_fewest_switches_win_within_the_tolerance() {
    let arm = planar4();
    let mut random = ChaCha8Rng::seed_from_u64(5);
    for _ in 0..10 {
        let target = random_target(&mut random);
        let all = by_trying_all(&arm, &target, 0.5);
        let (from, tolerance_m) = (all[4000].1, all[200].0);
        let fewest = all[..=200].iter().map(|(_, word)| switches(word, &from, 12)).min().unwrap();
        let index = Index::new(&arm, &options(&arm, 64)).unwrap();
        let found = index.fewest_switches(&target, tolerance_m, &from, &[]).unwrap();
        let wanted = all.iter().find(|(_, word)| switches(word, &from, 12) == fewest).unwrap();
        assert_eq!((found.word, switches(&found.word, &from, 12)), (wanted.1, fewest));
        assert_eq!(index.fewest_switches(&target, 0.5 * all[0].0, &from, &[]), None);
    }
}

#[test]
fn an_index_that_is_given_up_while_it_is_formed_is_none() {
    let (arm, calls) = (planar4(), AtomicUsize::new(0));
    let until = |last: usize| {
        calls.store(0, Ordering::Relaxed);
        let go_on = || calls.fetch_add(1, Ordering::Relaxed) < last;
        Index::new_while(&arm, &Options::of(&arm), go_on).map(|index| index.words())
    };
    assert_eq!(until(usize::MAX), Ok(4096.0));
    let all = calls.load(Ordering::Relaxed);
    assert!(all > 50, "it is asked {all} times");
    for last in [0, 1, all / 2, all - 1] {
        assert_eq!(until(last), Err(ReachError::GivenUp), "after {last} of {all}");
    }
}
