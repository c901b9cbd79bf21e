//! Follows a running program: gives the certain time span of each visit, soon after its end.

use darm_core::sequencer::Event;
use darm_device::client::TimedEvent;
use darm_device::clock::BoardClock;

use super::join::Span;
use crate::commands::camera_lines::unix_less_host_s;
use crate::commands::status::seconds;
use darm_measure::visits::Visits;

/// Time after a visit until the round trips that bound its end have been made.
const ROUND_TRIP_DELAY_S: f64 = 1.0;
/// Exposure time of the camera: measurements this close to a motion may be blurred.
const EXPOSURE_S: f64 = 0.02;
/// The board ends a program at most two ticks before its time.
const TICK_S: f64 = 2e-3;

/// A program that is followed.
pub(crate) struct VisitTracker<'a> {
    /// All visits of the program.
    pub(crate) visits: &'a Visits,
    /// Time of row 0 on the board's clock.
    pub(crate) start_s: Option<f64>,
    /// The first visit that has not ended.
    pub(crate) next: usize,
    ended_s: Option<f64>,
}

impl<'a> VisitTracker<'a> {
    /// Before the program starts.
    pub(crate) fn new(visits: &'a Visits) -> Self {
        Self { visits, start_s: None, next: 0, ended_s: None }
    }

    /// A program whose row 0 was applied at `start_s` of the board; the visits before `next` are done.
    pub(crate) fn resume(visits: &'a Visits, start_s: f64, next: usize) -> Self {
        Self { start_s: Some(start_s), next, ..Self::new(visits) }
    }

    /// Adds new events and the time at which the program ended, in seconds of the board.
    pub(crate) fn update(&mut self, events: &[TimedEvent], ended_s: Option<f64>) {
        let first = events.iter().find(|timed| matches!(timed.event, Event::Row { row: 0, .. }));
        self.start_s = self.start_s.or(first.map(|timed| seconds(timed.at)));
        self.ended_s = ended_s;
    }

    /// The visits that have ended since the last call, because the program continued or ended at its time. Uses the clock
    /// estimate at host time `now_s`.
    pub(crate) fn over(&mut self, clock: &BoardClock, now_s: f64) -> Vec<(usize, Span)> {
        let mut over = Vec::new();
        let (Some(start_s), Some(offset)) = (self.start_s, clock.offset()) else { return over };
        let board_s = now_s - offset.at_s;
        let over_s = self.ended_s.map_or(board_s - ROUND_TRIP_DELAY_S, |ended_s| ended_s + TICK_S) - start_s;
        while let Some(rest) = self.visits.rests.get(self.next).filter(|rest| rest.to_s <= over_s) {
            let Some(span) = span(clock, start_s + rest.from_s, start_s + rest.to_s) else { break };
            over.push((self.next, span));
            self.next += 1;
        }
        over
    }
}

/// From the latest that the board's time `from_s` can have been to the earliest that `to_s` can have been.
fn span(clock: &BoardClock, from_s: f64, to_s: f64) -> Option<Span> {
    let (from, to) = (clock.host_time(from_s)?, clock.host_time(to_s)?);
    let to_unix_s = unix_less_host_s();
    Some(Span {
        from_s: from.at_s + from.uncertainty_s + EXPOSURE_S + to_unix_s,
        to_s: to.at_s - to.uncertainty_s - EXPOSURE_S + to_unix_s,
    })
}

#[cfg(test)]
mod tests {
    use darm_core::sequencer::Event;
    use darm_core::units::{Digest, Micros, ModelHash};
    use darm_device::client::TimedEvent;
    use darm_device::clock::{BoardClock, RoundTrip};

    use super::VisitTracker;
    use darm_measure::visits::{Rest, Visits};

    fn rest(from_s: f64, to_s: f64) -> Rest {
        let word = "01".parse().unwrap();
        Rest { label: "A".into(), from_s, to_s, row: 0, word, previous: word, servos_rad: vec![], held_out: false }
    }

    fn timed(at_ms: u32, event: Event) -> TimedEvent {
        TimedEvent { number: 0, at: Micros::from_millis(at_ms), event }
    }

    #[test]
    fn only_completed_visits_have_a_span() {
        let visits = Visits {
            model: ModelHash(1),
            geometry: ModelHash(1),
            table: Digest([1; 32]),
            rests: vec![rest(0.2, 0.8), rest(1.2, 1.8)],
        };
        let mut clock = BoardClock::default();
        let mut tracker = VisitTracker::new(&visits);
        for tick in 0..30 {
            let board_s = 5.0 + 0.1 * f64::from(tick);
            clock.observe(RoundTrip { sent_s: board_s + 2.0, board_s, received_s: board_s + 2.002 });
        }
        let row = timed(5_000, Event::Row { row: 0, word: "01".parse().unwrap() });
        tracker.update(&[row], None);
        assert_eq!(tracker.over(&clock, 8.0), [], "at board time 6.0 the first visit is too recent");
        tracker.update(&[timed(6_700, Event::Stopped)], Some(6.7));
        let over = tracker.over(&clock, 9.9);
        assert_eq!(over.len(), 1, "stopped before the end of the second visit");
        let length_s = over[0].1.to_s - over[0].1.from_s;
        assert!(length_s > 0.55 && length_s < 0.56, "{length_s}");
        assert_eq!(tracker.over(&clock, 9.9), [], "each visit once");
        let mut resumed = VisitTracker::resume(&visits, 5.0, 1);
        resumed.update(&[], Some(6.9));
        assert_eq!(resumed.over(&clock, 9.9).first().map(|(visit, _)| *visit), Some(1));
    }
}
