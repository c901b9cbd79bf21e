//! The measurement plan keeps its promises for the paper's arm.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::*;

fn arm() -> Arm {
    Arm::parse(Path::new("planar4.toml"), include_str!("../../../../examples/planar4.toml")).unwrap()
}

#[test]
fn every_word_is_visited_after_different_words() {
    let options = PlanOptions::default();
    let steps = plan(&arm(), &options);
    let mut before: BTreeMap<Word, BTreeSet<Word>> = BTreeMap::new();
    for step in steps.iter().filter(|step| !step.repeat) {
        assert_ne!(step.word, step.previous);
        before.entry(step.word).or_default().insert(step.previous);
    }
    assert_eq!(before.len(), options.words);
    assert!(before.values().all(|words| words.len() == options.visits));
    assert_eq!(steps.len(), options.words * options.visits + options.repeated_words * options.repeats);
}

#[test]
fn nearly_every_actuator_comes_to_nearly_every_word_moved_and_unmoved() {
    let steps = plan(&arm(), &PlanOptions::default());
    let mut ways: BTreeMap<(Word, usize), BTreeSet<bool>> = BTreeMap::new();
    for step in steps.iter().filter(|step| !step.repeat) {
        for k in 0..12 {
            ways.entry((step.word, k)).or_default().insert(step.word.digit(k) == step.previous.digit(k));
        }
    }
    let both = ways.values().filter(|ways| ways.len() == 2).count();
    assert!(both * 100 > 95 * ways.len(), "{both} of {}", ways.len());
}

#[test]
fn every_state_is_among_the_words_that_are_held_out() {
    // A state that three of thirty words have, and that comes late in the draw.
    let word = |k: u8| Word::new(&[k % 2, if [25, 26, 28].contains(&k) { 2 } else { k % 3 % 2 }]).unwrap();
    let words: Vec<Word> = (0..30).map(word).collect();
    let (held_out, training) = held_out_and_training(&words, (0..30).collect(), 8);
    assert_eq!((held_out.len(), training.len()), (8, 22));
    assert!(held_out.contains(&25) && held_out.contains(&26) && training.contains(&28), "{held_out:?}");
    let states: BTreeSet<(usize, u8)> = held_out.iter().flat_map(|&k| words[k].iter().enumerate()).collect();
    assert_eq!(states.len(), 5);
}

#[test]
fn a_quarter_of_the_words_is_held_out_whole_and_not_repeated() {
    let steps = plan(&arm(), &PlanOptions::default());
    let words = |held_out| steps.iter().filter(|s| s.held_out == held_out).map(|s| s.word).collect::<BTreeSet<_>>();
    assert_eq!(words(true).len(), 24);
    assert!(words(true).is_disjoint(&words(false)));
    assert!(steps.iter().all(|step| !(step.repeat && step.held_out)));
}

#[test]
fn the_words_tell_more_than_random_ones() {
    let arm = arm();
    let steps = candidates(&arm, 7);
    let observations = Observations::new(&arm, &run_off_nominal(&arm, &steps), NOISE, |_| true);
    let columns = candidate_columns(&arm, &observations);
    let information = |words: &[Word]| {
        let rows: Vec<usize> = (0..steps.len()).filter(|&row| words.contains(&steps[row].word)).collect();
        let j = DMatrix::from_fn(rows.len() * 3, columns.len(), |k, c| columns[c][rows[k / 3] * 3 + k % 3]);
        (DMatrix::identity(columns.len(), columns.len()) + j.transpose() * j)
            .cholesky()
            .unwrap()
            .l()
            .diagonal()
            .map(f64::ln)
            .sum()
    };
    let chosen = information(&informative_words(&arm, &PlanOptions { seed: 7, ..PlanOptions::default() }));
    let random: f64 = information(&steps.iter().take(96).map(|step| step.word).collect::<Vec<_>>());
    assert!(chosen > random + 1.0, "{chosen} {random}");
}

#[test]
fn a_plan_that_no_diagnosis_could_use_is_refused() {
    let visits = |arm: &Arm, words| {
        let options = PlanOptions { words, ..PlanOptions::default() };
        measurement_visits(arm, &options, 0.2).map(|visits| visits.len()).map_err(|error| error.to_string())
    };
    let planar4 = arm();
    for words in [0, 1, 26] {
        let refused =
            format!("a plan of {words} words is too small to distinguish an effect from chance; give at least 27");
        assert_eq!(visits(&planar4, words), Err(refused));
    }
    let steps = plan(&planar4, &PlanOptions { words: 27, ..PlanOptions::default() });
    let training: BTreeSet<Word> = steps.iter().filter(|step| !step.held_out).map(|step| step.word).collect();
    assert!(visits(&planar4, 27).is_ok() && training.len() >= MIN_WORDS, "{}", training.len());
    let text = include_str!("../../../../examples/serial2.toml");
    let small = Arm::parse(Path::new("serial2.toml"), text).unwrap();
    let refused = "the arm has 9 words, and a diagnosis needs a plan of 27 to distinguish an effect from chance; measure single \
                   words by `--words`, and compare them with `darm fk`";
    assert_eq!(visits(&small, 96), Err(refused.to_owned()));
}
