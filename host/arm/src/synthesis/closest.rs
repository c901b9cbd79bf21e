//! The closest geometry, where the frames cannot be met: the sum of squares of their distances is made small.
//!
//! Here the error does not vanish at the end, so that the model of Gauss–Newton is wrong by as much as the error and the
//! arm are curved. Steps are therefore damped, until the sum of squares falls no further. Its gradient is exact: the error
//! of a frame is written by parts (see `by_parts` of its target).

use nalgebra::DVector;

use super::SearchHandle;
use super::newton::{EXACT, Keep, Search};

/// The best ends of all starts are improved.
const IMPROVED: usize = 8;
/// Steps from one of them.
const MAX_STEPS: u32 = 2000;
/// The search has settled when a step lowers the sum of squares by less than this share of it, this number of times in a row.
const SETTLED: f64 = 1e-13;
const SETTLED_STEPS: u32 = 3;
/// Distances that differ by less than this share are equal.
const EQUAL: f64 = 1e-9;

impl Search<'_, '_> {
    /// The closest geometry from the ends of several searches, of which the first began at the base-line; of equally close
    /// ones that with the least changes. `None` where none of them can be assembled. From here on errors are written by parts,
    /// those by which the answer is judged too.
    pub(super) fn closest(&mut self, ends: &[(f64, DVector<f64>)], handle: &SearchHandle) -> Option<DVector<f64>> {
        self.problem.targets.iter_mut().for_each(|target| target.by_parts = true);
        let by_distance = self.by_distance(ends).into_iter().enumerate();
        let candidates = by_distance.filter(|(rank, at)| *rank < IMPROVED || *at == 0);
        let improved = candidates.filter_map(|(_, at)| self.improve(&ends[at].1, handle));
        let improved: Vec<(f64, DVector<f64>)> = improved.collect();
        let min = improved.iter().map(|(distance, _)| *distance).min_by(f64::total_cmp)?;
        let equal = improved.into_iter().filter(|(distance, _)| *distance <= (1.0 + EQUAL) * min);
        equal
            .map(|(_, unknowns)| unknowns)
            .min_by(|a, b| self.problem.alteration(a).total_cmp(&self.problem.alteration(b)))
    }

    /// The ends by their distances from the frames, without those that cannot be assembled.
    fn by_distance(&mut self, ends: &[(f64, DVector<f64>)]) -> Vec<usize> {
        let distances = ends.iter().enumerate();
        let mut by_distance: Vec<(f64, usize)> =
            distances.filter_map(|(at, (_, end))| Some((self.problem.residual(end).ok()?.norm(), at))).collect();
        by_distance.sort_by(|a, b| a.0.total_cmp(&b.0));
        by_distance.into_iter().map(|(_, at)| at).collect()
    }

    /// As [`closest`](Self::closest), but every needed word can be assembled all the way: from the best ends, from the best of
    /// those that are so already, and from `others`.
    pub(super) fn closest_with_words(
        &mut self,
        ends: &[(f64, DVector<f64>)],
        others: &[DVector<f64>],
        handle: &SearchHandle,
    ) -> Option<DVector<f64>> {
        let by_distance = self.by_distance(ends);
        let is_complete = |at: &&usize| self.problem.missed_m(&ends[**at].1) == 0.0;
        let complete: Vec<usize> = by_distance.iter().filter(is_complete).take(IMPROVED).copied().collect();
        let nearest = by_distance.into_iter().take(IMPROVED).filter(|at| !complete.contains(at));
        let starts: Vec<&DVector<f64>> =
            nearest.chain(complete.iter().copied()).map(|at| &ends[at].1).chain(others).collect();
        let mut best: Option<(f64, DVector<f64>)> = None;
        for start in starts {
            let Some(complete) = self.with_words(start, Keep::Little) else { continue };
            self.keeps_words = true;
            let improved = self.improve(&complete, handle);
            self.keeps_words = false;
            best = improved.into_iter().chain(best).min_by(|a, b| a.0.total_cmp(&b.0));
        }
        best.map(|(_, unknowns)| unknowns)
    }

    /// Lowers the sum of squares until it settles, or somebody ends the search; its root and the unknowns.
    fn improve(&mut self, start: &DVector<f64>, handle: &SearchHandle) -> Option<(f64, DVector<f64>)> {
        let mut settled = 0;
        let has_settled = |before: f64, after: f64, _| {
            settled = if 1.0 - (after / before).powi(2) < SETTLED { settled + 1 } else { 0 };
            settled == SETTLED_STEPS || handle.is_ended()
        };
        let (residual, unknowns) = self.lower(start, MAX_STEPS, EXACT, has_settled).ok()?;
        Some((residual.norm(), unknowns))
    }
}
