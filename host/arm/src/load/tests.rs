//! The search against looking at every word, and against chance where there are too many.

use std::path::Path;

use darm_core::effect::Effect;
use darm_core::model::Mass;
use darm_core::real::Vec3;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::capacity::{Capacity, gives, usage, worst};
use super::*;
use crate::arm::Strength;

fn arm(name: &str) -> Arm {
    Arm::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name)).unwrap()
}

/// The arm with other masses, centres and gravity.
fn with_random_masses(mut arm: Arm, rng: &mut ChaCha8Rng) -> Arm {
    let mut vector = |size: f64| Vec3::from_fn(|_, _| rng.random_range(-size..size));
    let n = arm.model.chain.stages.len();
    for mass in &mut arm.model.masses[..n] {
        *mass = Mass { mass_kg: 1.0 + vector(1.0).norm(), center: vector(0.2) };
    }
    arm.model.payload = Mass { mass_kg: 0.5, center: vector(0.3) };
    arm.model.gravity = vector(9.81);
    arm
}

fn laden(arm: &Arm, payload_kg: f64) -> Laden<'_> {
    Laden { arm, servos_rad: vec![0.2; arm.n_servos()], payload_kg }
}

/// Every word of an arm.
fn words(arm: &Arm) -> impl Iterator<Item = Word> {
    let states: Vec<usize> = (0..arm.n_actuators()).map(|actuator| arm.model.chain.n_states(actuator)).collect();
    let rest = arm.rest();
    (0..states.iter().product()).map(move |mut index: usize| {
        states.iter().enumerate().fold(rest, |word, (actuator, n_states)| {
            let digit = index % n_states;
            index /= n_states;
            word.with_digit(actuator, digit as u8)
        })
    })
}

fn random_word(arm: &Arm, rng: &mut ChaCha8Rng) -> Word {
    let digit = |actuator: usize, rng: &mut ChaCha8Rng| rng.random_range(0..arm.model.chain.n_states(actuator)) as u8;
    (0..arm.n_actuators()).fold(arm.rest(), |word, actuator| word.with_digit(actuator, digit(actuator, rng)))
}

/// No word that is tried is outside of the ranges; with `is_exact` some word is at either end of each.
#[track_caller]
fn check(arm: &Arm, payload_kg: f64, tried: impl Iterator<Item = Word>, is_exact: bool) {
    let laden = laden(arm, payload_kg);
    let ranges = laden.ranges().unwrap();
    let mut seen: Vec<Vec<Option<[f64; 2]>>> = ranges.iter().map(|states| vec![None; states.len()]).collect();
    for word in tried {
        let Ok(loads) = laden.loads(&word) else { continue };
        for (actuator, load) in loads.into_iter().enumerate() {
            let range = &mut seen[actuator][usize::from(word.digit(actuator))];
            let [smallest, largest] = range.unwrap_or([load; 2]);
            *range = Some([smallest.min(load), largest.max(load)]);
        }
    }
    for (actuator, (ranges, seen)) in ranges.iter().zip(&seen).enumerate() {
        for (range, seen) in ranges.iter().zip(seen) {
            let (Some(range), Some([smallest, largest])) = (range, seen) else {
                assert!(!is_exact || range.is_none() && seen.is_none(), "actuator {actuator}: {range:?}, {seen:?}");
                continue;
            };
            let room = 1e-9 + 2.0 * PRECISION * range.smallest.force.abs().max(range.largest.force.abs());
            let found = [range.smallest.force - smallest, largest - range.largest.force];
            let is_right = |beyond: f64| if is_exact { beyond.abs() < room } else { beyond < room };
            assert!(found.into_iter().all(is_right), "actuator {actuator}: {range:?}, {seen:?}");
        }
    }
}

#[test]
fn the_ranges_are_those_of_all_words() {
    let mut rng = ChaCha8Rng::seed_from_u64(48);
    for name in ["planar4.toml", "serial12.toml", "planar4-hybrid.toml", "serial2.toml"] {
        let arm = with_random_masses(arm(name), &mut rng);
        check(&arm, 2.0, words(&arm), true);
    }
    let plain = arm("planar4.toml");
    check(&plain, 0.0, words(&plain), true);
}

#[test]
fn the_ranges_are_those_of_all_words_in_space() {
    let mut rng = ChaCha8Rng::seed_from_u64(49);
    for n_stages in 1..=3 {
        let mut arm = with_random_masses(arm("spatial3.toml"), &mut rng);
        arm.model.chain.stages.truncate(n_stages);
        check(&arm, 2.0, words(&arm), true);
    }
}

#[test]
fn chance_finds_no_larger_load() {
    let mut rng = ChaCha8Rng::seed_from_u64(50);
    let arm = with_random_masses(arm("spatial6.toml"), &mut rng);
    let tried: Vec<Word> = (0..20_000).map(|_| random_word(&arm, &mut rng)).collect();
    check(&arm, 2.0, tried.into_iter(), false);
}

/// The arm with a cylinder or a torque for each actuator.
fn with_strengths(mut arm: Arm, rng: &mut ChaCha8Rng) -> Arm {
    let mut strength = |turns: bool| match turns {
        true => Strength::Torque { torque_nm: rng.random_range(80.0..200.0) },
        false => Strength::Cylinder { bore_m: rng.random_range(0.05..0.1), rod_m: 0.02 },
    };
    arm.strengths = (0..arm.n_actuators()).map(|actuator| Some(strength(arm.turns(actuator)))).collect();
    arm
}

#[test]
fn at_its_capacity_the_worst_word_needs_all_and_no_word_more() {
    let mut rng = ChaCha8Rng::seed_from_u64(51);
    for name in ["planar4.toml", "serial12.toml"] {
        let arm = with_strengths(arm(name), &mut rng);
        let Some(Capacity::UpTo { payload_kg, worst: named }) = laden(&arm, 0.0).capacity().unwrap() else {
            panic!("{name} has no capacity")
        };
        assert!((named.share() - 1.0).abs() < 1e-5 && payload_kg > 0.0, "{name}: {named:?}, {payload_kg} kg");
        let at = laden(&arm, payload_kg);
        let used = |word: Word| {
            let loads = at.loads(&word).unwrap();
            let of = |(actuator, &force): (usize, &f64)| {
                usage(&arm, actuator, word.digit(actuator).into(), Load { force, word })
            };
            loads.iter().enumerate().filter_map(of).map(|usage| usage.share()).fold(0.0, f64::max)
        };
        let largest = words(&arm).map(used).fold(0.0, f64::max);
        assert!((largest - 1.0).abs() < 1e-5, "{name}: {largest}");
    }
}

#[test]
fn capacity_without_a_strength_overloaded_or_without_bound() {
    let mut arm = arm("planar4.toml");
    arm.strengths.fill(None);
    assert_eq!(laden(&arm, 0.0).capacity().unwrap(), None);
    assert_eq!(gives(&arm, 0), None);
    arm.strengths[1] = Some(Strength::Force { push_n: 1.0, pull_n: 1.0 });
    let Some(Capacity::Overloaded(usage)) = laden(&arm, 0.0).capacity().unwrap() else { panic!("it is") };
    assert_eq!(usage.actuator, 1);
    arm.model.gravity = Vec3::zeros();
    assert_eq!(laden(&arm, 0.0).capacity().unwrap(), Some(Capacity::Unlimited));
    assert_eq!(worst(&arm, &laden(&arm, 0.0).ranges().unwrap()).map(|usage| usage.share()), Some(0.0));
}

#[test]
fn effects_change_no_load() {
    let mut arm = arm("planar4.toml");
    let before = laden(&arm, 1.0).ranges().unwrap();
    arm.model.effects.push(Effect::StrokeLoss { actuator: 4, state: 1, loss_m: 4e-3 }).unwrap();
    assert_eq!(laden(&arm, 1.0).ranges().unwrap(), before);
}

#[test]
fn a_wrong_number_of_servo_angles_is_refused() {
    let arm = arm("planar4.toml");
    let wrong = Laden { servos_rad: vec![0.0], ..laden(&arm, 0.0) };
    assert!(matches!(wrong.ranges(), Err(LoadError::NoPosture(ChainError::ServoCount { .. }))));
}
