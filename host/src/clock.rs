//! Board time and host time: offset and uncertainty from round trips.
//!
//! # Model
//!
//! A request leaves at host time `a`, the board stamps it at its own time `b`, the answer arrives at `c`. The stamp was
//! taken somewhere between: `b` on the board is host time `(a + c)/2 ± (c − a)/2`. The round trip with the smallest
//! bound counts; a bound grows with its age by [`DRIFT`], for two quartz clocks part.
//!
//! # Example
//!
//! ```
//! use darm::clock::{BoardClock, RoundTrip};
//! let mut clock = BoardClock::default();
//! clock.observe(RoundTrip { sent_s: 10.0, board_s: 3.0, received_s: 10.2 });
//! let (host_s, uncertainty_s) = clock.host_time(3.5, 10.2).unwrap();
//! assert!((host_s - 10.6).abs() < 1e-12 && uncertainty_s < 0.1001);
//! ```

use std::sync::OnceLock;
use std::time::Instant;

/// How fast two clocks part, s/s: RC and quartz clocks of boards stay below.
pub const DRIFT: f64 = 100e-6;

/// The host's time since the first call, in seconds: one time for all links and the plant.
pub fn host_now_s() -> f64 {
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_secs_f64()
}

/// One request and its time-stamped answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoundTrip {
    /// Host time before the request was sent.
    pub sent_s: f64,
    /// The board's time stamp.
    pub board_s: f64,
    /// Host time after the answer arrived.
    pub received_s: f64,
}

/// Offset of host time over board time, and how far it can be wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offset {
    /// Host time minus board time.
    pub offset_s: f64,
    /// Bound of the error at `at_s`.
    pub uncertainty_s: f64,
    /// Host time of the observation.
    pub at_s: f64,
}

impl Offset {
    /// The bound of the error at a host time.
    pub fn uncertainty_at_s(&self, host_s: f64) -> f64 {
        self.uncertainty_s + DRIFT * (host_s - self.at_s).abs()
    }
}

impl From<RoundTrip> for Offset {
    fn from(trip: RoundTrip) -> Self {
        Offset {
            offset_s: 0.5 * (trip.sent_s + trip.received_s) - trip.board_s,
            uncertainty_s: 0.5 * (trip.received_s - trip.sent_s),
            at_s: trip.received_s,
        }
    }
}

/// Best known relation between the board's clock and the host's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BoardClock {
    best: Option<Offset>,
}

impl BoardClock {
    /// Takes in a round trip; keeps the older one where that is still the better. A board that has started anew, or a
    /// virtual time that jumped, contradicts the old offset and replaces it.
    pub fn observe(&mut self, trip: RoundTrip) {
        let new = Offset::from(trip);
        let keep = self.best.is_some_and(|old| {
            let old_uncertainty_s = old.uncertainty_at_s(new.at_s);
            let agree = (old.offset_s - new.offset_s).abs() <= old_uncertainty_s + new.uncertainty_s;
            agree && old_uncertainty_s <= new.uncertainty_s
        });
        if !keep {
            self.best = Some(new);
        }
    }

    /// The best offset, if any round trip was seen.
    pub fn offset(&self) -> Option<Offset> {
        self.best
    }

    /// Host time of a board time and the bound of its error, told at host time `now_s`.
    pub fn host_time(&self, board_s: f64, now_s: f64) -> Option<(f64, f64)> {
        self.best.map(|best| (board_s + best.offset_s, best.uncertainty_at_s(now_s)))
    }
}

#[cfg(test)]
mod tests {
    use super::{BoardClock, RoundTrip};

    fn trip(sent_s: f64, board_s: f64, received_s: f64) -> RoundTrip {
        RoundTrip { sent_s, board_s, received_s }
    }

    #[test]
    fn the_shorter_round_trip_counts() {
        let mut clock = BoardClock::default();
        clock.observe(trip(1.0, 0.0, 1.001));
        let good = clock.offset();
        clock.observe(trip(2.0, 1.004, 2.1));
        assert_eq!(clock.offset(), good);
    }

    #[test]
    fn an_old_bound_grows_until_a_new_one_is_better() {
        let mut clock = BoardClock::default();
        clock.observe(trip(0.0, 0.0, 0.002));
        clock.observe(trip(100.0, 100.001, 100.004));
        assert_eq!(clock.offset().unwrap().at_s, 100.004);
    }

    #[test]
    fn a_board_that_started_anew_is_believed() {
        let mut clock = BoardClock::default();
        clock.observe(trip(50.0, 50.0, 50.001));
        clock.observe(trip(51.0, 0.1, 51.1));
        assert!((clock.offset().unwrap().offset_s - 50.95).abs() < 1e-9);
    }

    #[test]
    fn the_true_time_is_within_the_bound() {
        let mut clock = BoardClock::default();
        for n in 0..50u32 {
            let sent_s = f64::from(n);
            let (out_s, back_s) = (0.001 * f64::from(n % 7), 0.002 * f64::from(n % 3) + 1e-4);
            clock.observe(trip(sent_s, sent_s + out_s - 5.0, sent_s + out_s + back_s));
            let (host_s, bound_s) = clock.host_time(sent_s - 5.0, sent_s).unwrap();
            assert!((host_s - sent_s).abs() <= bound_s + 1e-12);
        }
    }
}
