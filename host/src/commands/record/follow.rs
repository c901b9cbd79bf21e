//! Follows a running program: tells of each visit, soon after it is over, when it surely was.

use darm::client::Happening;
use darm::clock::BoardClock;
use darm_core::sequencer::Event;

use super::join::Span;
use crate::commands::camera::unix_less_host_s;
use crate::commands::play::End;
use crate::commands::status::seconds;
use crate::commands::visits::Visits;

/// So long after a visit the round trips that bound its end from above have been made.
const BEHIND_S: f64 = 1.0;
/// A picture is exposed for so long: what was taken so near to a motion may be blurred.
const EXPOSURE_S: f64 = 0.02;
/// The board ends a program at most two ticks before its time.
const TICK_S: f64 = 2e-3;

/// A program that is followed.
pub(crate) struct Follow<'a> {
    visits: &'a Visits,
    /// When row 0 went out, on the board's clock.
    pub(crate) start_s: Option<f64>,
    /// The visits that are over.
    pub(crate) spans: Vec<Span>,
    ended_s: Option<f64>,
    offsets_s: (f64, f64),
}

impl<'a> Follow<'a> {
    /// Before the program starts.
    pub(crate) fn new(visits: &'a Visits) -> Self {
        Self { visits, start_s: None, spans: Vec::new(), ended_s: None, offsets_s: (f64::MAX, f64::MIN) }
    }

    /// Takes in what happened since the last look, and the clock as it is known at host time `now_s`.
    pub(crate) fn look(&mut self, happenings: &[Happening], end: Option<End>, clock: &BoardClock, now_s: f64) {
        let first = happenings.iter().find(|happening| matches!(happening.event, Event::Row { row: 0, .. }));
        self.start_s = self.start_s.or(first.map(|happening| seconds(happening.at)));
        if let (Some(_), Some(last)) = (end, happenings.last()) {
            self.ended_s = Some(seconds(last.at));
        }
        let (Some(start_s), Some(offset)) = (self.start_s, clock.offset()) else { return };
        let (least_s, most_s) = self.offsets_s;
        self.offsets_s = (least_s.min(offset.at_s), most_s.max(offset.at_s));
        // A visit is over when the program has gone on, or has ended at its time.
        let board_s = now_s - offset.at_s;
        let over_s = self.ended_s.map_or(board_s - BEHIND_S, |ended_s| ended_s + TICK_S) - start_s;
        while let Some(rest) = self.visits.rests.get(self.spans.len()).filter(|rest| rest.to_s <= over_s) {
            let Some(span) = span(clock, start_s + rest.from_s, start_s + rest.to_s) else { return };
            self.spans.push(span);
        }
    }

    /// How far the board's clock and the host's have departed from each other.
    pub(crate) fn departure_s(&self) -> f64 {
        let (least_s, most_s) = self.offsets_s;
        (most_s - least_s).max(0.0)
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
    use darm::client::Happening;
    use darm::clock::{BoardClock, RoundTrip};
    use darm_core::sequencer::Event;
    use darm_core::units::{Micros, ModelHash};

    use super::Follow;
    use crate::commands::play::End;
    use crate::commands::visits::{Rest, Visits};

    fn rest(from_s: f64, to_s: f64) -> Rest {
        let word = "01".parse().unwrap();
        Rest { label: "A".into(), from_s, to_s, row: 0, word, previous: word, servos_rad: vec![], held_out: false }
    }

    fn happening(at_ms: u32, event: Event) -> Happening {
        Happening { number: 0, at: Micros::from_millis(at_ms), event }
    }

    #[test]
    fn only_completed_visits_have_a_span() {
        let visits = Visits { model: ModelHash(1), rests: vec![rest(0.2, 0.8), rest(1.2, 1.8)] };
        let mut clock = BoardClock::default();
        let mut follow = Follow::new(&visits);
        for tick in 0..30 {
            let board_s = 5.0 + 0.1 * f64::from(tick);
            clock.observe(RoundTrip { sent_s: board_s + 2.0, board_s, received_s: board_s + 2.002 });
        }
        let row = happening(5_000, Event::Row { row: 0, word: "01".parse().unwrap() });
        follow.look(&[row], None, &clock, 8.0);
        assert_eq!(follow.spans.len(), 0, "at board time 6.0 the first visit is too fresh");
        follow.look(&[happening(6_700, Event::Stopped)], Some(End::Stopped), &clock, 9.9);
        assert_eq!(follow.spans.len(), 1, "stopped before the end of the second visit");
        let length_s = follow.spans[0].to_s - follow.spans[0].from_s;
        assert!(length_s > 0.55 && length_s < 0.56, "{length_s}");
        assert!(follow.departure_s() < 1e-6);
    }
}
