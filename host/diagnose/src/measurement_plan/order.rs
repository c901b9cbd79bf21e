//! The order of visits: every word in every round, each time after another word.

use darm_core::units::Word;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

/// For each round the numbers of all words in the order of their visits.
///
/// The next word is the one that shows most of what was not seen yet: an actuator that comes to the word moved, or
/// unmoved. Words that would follow the same word as before, or themselves, wait.
pub(crate) fn rounds(words: &[Word], n_rounds: usize, rest: Word, rng: &mut ChaCha8Rng) -> Vec<Vec<usize>> {
    let mut seen = vec![Seen::default(); words.len()];
    let mut previous = rest;
    (0..n_rounds)
        .map(|_| {
            let mut waiting: Vec<usize> = (0..words.len()).collect();
            waiting.shuffle(rng);
            let mut order = Vec::new();
            while !waiting.is_empty() {
                let worth = |&index: &usize| seen[index].worth(&words[index], &previous);
                let best = (0..waiting.len()).max_by_key(|&position| worth(&waiting[position])).unwrap_or(0);
                let index = waiting.swap_remove(best);
                seen[index].add(&words[index], &previous);
                previous = words[index];
                order.push(index);
            }
            order
        })
        .collect()
}

/// How a word was come to so far.
#[derive(Clone, Default)]
struct Seen {
    after: Vec<Word>,
    moved: u64,
    unmoved: u64,
}

impl Seen {
    /// How many actuators would come to the word as they did not before; negative after the same word.
    fn worth(&self, word: &Word, previous: &Word) -> i32 {
        if word == previous || self.after.contains(previous) {
            return -1;
        }
        let changed = changed(word, previous);
        let all = (1u64 << word.len().min(63)) - 1;
        ((changed & !self.moved).count_ones() + (all & !changed & !self.unmoved).count_ones()) as i32
    }

    fn add(&mut self, word: &Word, previous: &Word) {
        let changed = changed(word, previous);
        self.moved |= changed;
        self.unmoved |= !changed;
        self.after.push(*previous);
    }
}

/// Bit k: whether digit k differs.
fn changed(a: &Word, b: &Word) -> u64 {
    (0..a.len().min(63)).filter(|&k| a.digit(k) != b.digit(k)).fold(0, |bits, k| bits | 1 << k)
}
