//! Rests with every coil off, as long as the limits of the outputs demand before the next visit.

use darm_core::output::Wiring;
use darm_core::table::{Board, Checker, Record};
use darm_core::units::Micros;

use super::Visit;
use super::timeline::Timeline;

/// The shortest rest that is tried, and what a rest is longer than it has to be by at most.
const STEP: Micros = Micros::from_millis(50);

/// The rows so far, passed by the board's own checker.
#[derive(Clone)]
pub(super) struct Rests<'a> {
    checker: Checker,
    board: &'a Board<'a>,
    admitted: usize,
    /// After a rest of this length every output may be on again as if it had never been.
    longest: Micros,
}

impl<'a> Rests<'a> {
    pub(super) fn new(head: impl Iterator<Item = Record>, board: &'a Board<'a>, wiring: &Wiring) -> Self {
        let mut checker = Checker::default();
        // What is wrong with these is found again, and reported, when the complete table is checked.
        for record in head {
            let _ = checker.admit(&record, board);
        }
        let windows_ms = wiring.coils.iter().map(|coil| coil.limit.window_ms.max(coil.limit.max_on_ms));
        let longest = Micros::from_millis(2 * windows_ms.max().unwrap_or_default());
        Self { checker, board, admitted: 0, longest }
    }

    /// Passes the rows that were added to the timeline.
    pub(super) fn admit(&mut self, timeline: &Timeline<'_>) {
        for row in timeline.rows.iter().skip(self.admitted) {
            // The first error is found again when the complete table is checked.
            let _ = self.checker.admit(&Record::Row(row.clone()), self.board);
        }
        self.admitted = timeline.rows.len();
    }

    /// Adds the rest that a visit needs, no longer than that, and returns its end; `None` where it needs none or no rest
    /// helps. The arm is free from `free` on.
    pub(super) fn before(
        &mut self,
        timeline: &mut Timeline<'_>,
        visit: &Visit,
        index: usize,
        free: Micros,
    ) -> Option<Micros> {
        if index == 0 || self.keeps_limits(timeline.clone(), visit, index, free) {
            return None;
        }
        let with_rest = |length: Micros| {
            let mut rested = timeline.clone();
            let until = rested.rest(index, free) + length;
            (rested, until)
        };
        let helps = |length: Micros| {
            let (rested, until) = with_rest(length);
            self.keeps_limits(rested, visit, index, until)
        };
        let mut long = STEP;
        while !helps(long) {
            if long >= self.longest {
                return None;
            }
            long = Micros(2 * long.0);
        }
        let mut short = Micros(long.0 / 2);
        while long.0 - short.0 > STEP.0 {
            let middle = Micros((short.0 + long.0) / 2);
            if helps(middle) { long = middle } else { short = middle }
        }
        let (rested, until) = with_rest(long);
        *timeline = rested;
        Some(until)
    }

    /// Whether the board accepts the rows of a visit that begins at `free`, to the end of its dwell.
    fn keeps_limits(&self, mut timeline: Timeline<'_>, visit: &Visit, index: usize, free: Micros) -> bool {
        let end = timeline.go_to(visit, index, free) + visit.dwell();
        let mut checker = self.checker.clone();
        let rows = timeline.rows.iter().skip(self.admitted).map(|row| Record::Row(row.clone()));
        rows.chain([Record::End { at: end }]).all(|record| checker.admit(&record, self.board).is_ok())
    }
}
