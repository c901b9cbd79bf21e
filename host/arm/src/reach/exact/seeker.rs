//! What a search looks for: the nearest words, or the word that switches the fewest actuators.

use std::cmp::Ordering;
use std::sync::atomic::{AtomicU64, Ordering as Memory};
use std::sync::{Mutex, PoisonError};

use darm_core::units::Word;

use super::{Near, Pattern};

/// Who looks for words.
pub(in crate::reach) trait Seeker {
    /// Whether a head that begins with the word may be part of the answer.
    fn wants(&self, head: impl FnOnce() -> Word) -> bool;
    /// Words further away than this are of no use, m.
    fn reach_m(&self) -> f64;
    /// Sees a word within reach.
    fn see(&mut self, near: Near);
}

/// Looks for the nearest words.
#[derive(Clone)]
pub(in crate::reach) struct Nearest<'a> {
    pub(in crate::reach) count: usize,
    pub(in crate::reach) forbidden: &'a [Pattern],
    pub(in crate::reach) best: Vec<Near>,
}

impl Seeker for Nearest<'_> {
    fn wants(&self, _: impl FnOnce() -> Word) -> bool {
        true
    }

    fn reach_m(&self) -> f64 {
        if self.best.len() < self.count { f64::INFINITY } else { self.best.last().map_or(0.0, |last| last.distance_m) }
    }

    fn see(&mut self, near: Near) {
        let place = self.best.partition_point(|other| order(other, &near).is_lt());
        let known = self.best.get(place).is_some_and(|other| other.word == near.word);
        if !known && !named(&near.word, self.forbidden) {
            self.best.insert(place, near);
            self.best.truncate(self.count);
        }
    }
}

/// The nearest words for several threads, which share their reach.
pub(super) struct Shared<'a> {
    nearest: Mutex<Nearest<'a>>,
    /// The bits of the reach, m.
    reach: AtomicU64,
}

impl<'a> Shared<'a> {
    pub(super) fn new(nearest: Nearest<'a>) -> Self {
        let reach = AtomicU64::new(nearest.reach_m().to_bits());
        Self { nearest: Mutex::new(nearest), reach }
    }

    pub(super) fn reach_m(&self) -> f64 {
        f64::from_bits(self.reach.load(Memory::Relaxed))
    }

    pub(super) fn into_best(self) -> Vec<Near> {
        self.nearest.into_inner().unwrap_or_else(PoisonError::into_inner).best
    }
}

impl Seeker for &Shared<'_> {
    fn wants(&self, _: impl FnOnce() -> Word) -> bool {
        true
    }

    fn reach_m(&self) -> f64 {
        (*self).reach_m()
    }

    fn see(&mut self, near: Near) {
        let mut nearest = self.nearest.lock().unwrap_or_else(PoisonError::into_inner);
        nearest.see(near);
        self.reach.store(nearest.reach_m().to_bits(), Memory::Relaxed);
    }
}

/// Looks for the word that switches the fewest actuators.
pub(super) struct FewestSwitches<'a> {
    pub(super) tolerance_m: f64,
    pub(super) from: &'a Word,
    /// How many digits a head has.
    pub(super) head: usize,
    pub(super) forbidden: &'a [Pattern],
    pub(super) best: Option<(usize, Near)>,
}

impl Seeker for FewestSwitches<'_> {
    fn wants(&self, head: impl FnOnce() -> Word) -> bool {
        self.best.as_ref().is_none_or(|(fewest, _)| switches(&head(), self.from, self.head) <= *fewest)
    }

    fn reach_m(&self) -> f64 {
        self.tolerance_m
    }

    fn see(&mut self, near: Near) {
        let count = switches(&near.word, self.from, near.word.len());
        let better = |(fewest, other): &(usize, Near)| count.cmp(fewest).then(order(&near, other)).is_lt();
        if self.best.as_ref().is_none_or(better) && !named(&near.word, self.forbidden) {
            self.best = Some((count, near));
        }
    }
}

/// Nearer words first, of equally near ones the smaller.
fn order(a: &Near, b: &Near) -> Ordering {
    a.distance_m.total_cmp(&b.distance_m).then(a.word.cmp(&b.word))
}

/// How many of the first `digits` actuators stand otherwise in `word` than in `from`.
pub fn switches(word: &Word, from: &Word, digits: usize) -> usize {
    (0..digits).filter(|&actuator| word.digit(actuator) != from.digit(actuator)).count()
}

fn named(word: &Word, patterns: &[Pattern]) -> bool {
    patterns.iter().any(|pattern| pattern.names(word))
}
