//! The best of many numbers by their scores, in a room of fixed size.

use heapless::Vec;

use crate::nearest::sort::sort_by;

/// The best of many numbers by their scores.
#[derive(Clone, Debug)]
pub(super) struct Shortlist<const N: usize> {
    pub(super) list: Vec<(f32, u32), N>,
    /// The worst and its place, once there is no room for more.
    worst: Option<(usize, f32)>,
}

impl<const N: usize> Default for Shortlist<N> {
    fn default() -> Self {
        Self { list: Vec::new(), worst: None }
    }
}

impl<const N: usize> Shortlist<N> {
    /// Empties the list.
    pub(super) fn clear(&mut self) {
        self.list.clear();
        self.worst = None;
    }

    pub(super) fn offer(&mut self, score: f32, number: u32) {
        match self.worst {
            Some((_, worst)) if score >= worst => return,
            Some((place, _)) => {
                if let Some(place) = self.list.get_mut(place) {
                    *place = (score, number);
                }
            }
            None => _ = self.list.push((score, number)),
        }
        if self.list.is_full() {
            let scores = self.list.iter().map(|(score, _)| *score).enumerate();
            self.worst = scores.reduce(|a, b| if b.1 > a.1 { b } else { a });
        }
    }

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
