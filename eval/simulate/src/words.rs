//! Words that a host commands: some that the arm has, some that it does not have.

use darm_core::units::Word;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use crate::arm::ArmPlan;

/// A word of the arm.
///
/// # Panics
///
/// An actuator has no state or more than four, or there are more actuators than a word has digits.
pub fn word(arm: &ArmPlan, seed: u64) -> Word {
    Word::new(&digits(arm, seed)).expect("a few actuators of at most four states")
}

/// A word that the arm does not have, in whichever order a table wires its actuators.
///
/// # Panics
///
/// An actuator has no state, or there are as many actuators as a word has digits, or more.
pub fn wrong_word(arm: &ArmPlan, seed: u64) -> Word {
    let mut digits = digits(arm, seed);
    let states = arm.actuators.iter().map(|actuator| actuator.states).max().unwrap_or(0);
    match digits.first_mut() {
        Some(first) if seed & 1 == 0 && states <= Word::MAX_DIGIT => *first = states,
        _ => digits.push(0),
    }
    Word::new(&digits).expect("a few digits of at most 3")
}

fn digits(arm: &ArmPlan, seed: u64) -> Vec<u8> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    arm.actuators.iter().map(|actuator| rng.random_range(0..actuator.states)).collect()
}
