//! The best of many items by their scores, in a room of fixed size.

use heapless::Vec;

use super::sort::sort_by;
use crate::real::Real;

/// The best of many items by their scores: the lowest.
#[derive(Clone, Debug)]
pub(super) struct Shortlist<T, I, const N: usize> {
    pub(super) list: Vec<(T, I), N>,
    /// The worst and its place, once there is no room for more.
    worst: Option<(usize, T)>,
}

impl<T, I, const N: usize> Default for Shortlist<T, I, N> {
    fn default() -> Self {
        Self { list: Vec::new(), worst: None }
    }
}

impl<T: Real, I, const N: usize> Shortlist<T, I, N> {
    /// Empties the list.
    pub(super) fn clear(&mut self) {
        self.list.clear();
        self.worst = None;
    }

    /// Takes an item if it is one of the best so far.
    pub(super) fn offer(&mut self, score: T, item: impl FnOnce() -> I) {
        match self.worst {
            Some((_, worst)) if score >= worst => return,
            Some((place, _)) => {
                if let Some(place) = self.list.get_mut(place) {
                    *place = (score, item());
                }
            }
            None => _ = self.list.push((score, item())),
        }
        if self.list.is_full() {
            let scores = self.list.iter().map(|(score, _)| *score).enumerate();
            self.worst = scores.reduce(|a, b| if b.1 > a.1 { b } else { a });
        }
    }
}

impl<I: Copy, const N: usize> Shortlist<f32, I, N> {
    /// The best first.
    pub(super) fn sort(&mut self) {
        sort_by(&mut self.list, |a, b| a.0.total_cmp(&b.0).is_lt());
    }
}

/// Makes a list of these items; those beyond its room are left out.
pub(super) fn refill<T, const N: usize>(list: &mut Vec<T, N>, mut items: impl Iterator<Item = T>) {
    list.clear();
    while let (false, Some(item)) = (list.is_full(), items.next()) {
        let _ = list.push(item);
    }
}
