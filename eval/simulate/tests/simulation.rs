//! The whole system under its judges, over the first seeds; `cargo xtask simulate` runs more of them.

use std::path::Path;

use darm_sim::in_process::Chip;
use darm_simulate::mutants;
use darm_simulate::run::{Outcome, run};
use darm_simulate::script::{MIN_MS, Script};
use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};

fn outcomes(chip: Chip, seeds: std::ops::Range<u64>) -> Vec<Outcome> {
    seeds.into_par_iter().map(|seed| run(&Script::on(chip, seed), false)).collect()
}

fn assert_no_rule_is_broken(outcomes: &[Outcome]) {
    let mut broken = Vec::new();
    for outcome in outcomes {
        assert!(outcome.virtual_ms >= MIN_MS, "seed {}", outcome.seed);
        for (violation, _) in outcome.verdict.firsts() {
            broken.push(format!("seed {}: {}: {}", outcome.seed, violation.rule, violation.sentence));
        }
    }
    assert!(broken.is_empty(), "\n{}", broken.join("\n"));
}

#[test]
fn fifty_seeds_break_no_rule_where_the_flash_stops_the_control_tick() {
    assert_no_rule_is_broken(&outcomes(Chip::Rp2040, 0..50));
}

#[test]
fn two_hundred_seeds_break_no_rule_and_have_every_disturbance() {
    let outcomes = outcomes(Chip::Stm32l475, 0..200);
    assert_no_rule_is_broken(&outcomes);
    for kind in [
        "power cut",
        "power cut in a flash operation",
        "reset",
        "host killed",
        "stuck switches",
        "bouncing switches",
        "silent servos",
        "blocked servos",
        "babbling servo bus",
        "emergency stop",
        "hostile frames",
        "hostile text",
        "hostile table",
        "command and stop in one piece",
        "second host",
        "damaged answers of servos",
        "deaf servos",
        "unconfirmed servos",
        "overloaded servos",
        "dead valve",
        "button pressed",
        "damaged profile",
        "table of somebody else",
        "wider profile",
        "table changed in one respect",
        "loose jumper",
        "chain not returned",
        "stuck output enable",
    ] {
        assert!(outcomes.iter().any(|outcome| outcome.injected.contains_key(kind)), "{kind}");
    }
    assert!(outcomes.iter().all(|outcome| outcome.first_upload.is_some_and(|first| first.completed)));
}

#[test]
fn a_seed_repeats_exactly() {
    for seed in [3, 7, 12] {
        let runs = [0; 2].map(|_| run(&Script::of(seed), true));
        assert_eq!(runs[0].digest, runs[1].digest);
        assert_eq!(runs[0].lines, runs[1].lines);
    }
    assert_ne!(run(&Script::of(3), false).digest, run(&Script::of(7), false).digest);
}

#[test]
fn every_mutant_still_applies() {
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mutants = mutants::list(&own.join("mutants")).expect("each begins with its description");
    assert!(mutants.len() >= 116, "{} mutants", mutants.len());
    mutants::check(own.ancestors().nth(2).expect("eval/simulate lies in the workspace"), &mutants)
        .expect("patches that apply");
}
