//! Board time and host time: what round trips tell, and how uncertain it is.
//!
//! # Model
//!
//! A request leaves at host time a, the board stamps it at its own time b, the answer arrives at c: the stamp was taken
//! at a host time between a and c. A board's clock never runs ahead of the host's by more than [`DRIFT`], but it may fall
//! behind: an emulator that does not get the processor loses ticks. So for any board time t
//!
//! a + (t − b)·(1 − DRIFT) ≤ host time of t, from every round trip with b ≤ t,
//!
//! host time of t ≤ c − (b − t)·(1 − DRIFT), from every round trip with b ≥ t.
//!
//! The tightest of these bounds count; their middle is the estimate and half their distance its uncertainty. Before the
//! first and after the last round trip, where one side has no bound, the clock is taken to lose nothing.
//!
//! # Example
//!
//! ```
//! use darm::clock::{BoardClock, RoundTrip};
//! let mut clock = BoardClock::default();
//! clock.observe(RoundTrip { sent_s: 10.0, board_s: 3.0, received_s: 10.2 });
//! let host = clock.host_time(3.5).unwrap();
//! assert!((host.at_s - 10.6).abs() < 1e-3 && host.uncertainty_s < 0.101);
//! ```

use std::collections::VecDeque;
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

/// A host time and how far it can be wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HostTime {
    /// The estimate.
    pub at_s: f64,
    /// Bound of its error.
    pub uncertainty_s: f64,
}

/// Round trips that are kept: a quarter of an hour of forty a second.
const KEPT: usize = 36_000;

/// What is known of the relation between the board's clock and the host's.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BoardClock {
    /// In order of board time.
    trips: VecDeque<RoundTrip>,
}

impl BoardClock {
    /// Takes in a round trip. A board whose time went back has started anew; what was known before is forgotten.
    pub fn observe(&mut self, trip: RoundTrip) {
        if self.trips.back().is_some_and(|last| trip.board_s < last.board_s) {
            self.trips.clear();
        }
        if self.trips.len() == KEPT {
            self.trips.pop_front();
        }
        self.trips.push_back(trip);
    }

    /// Host time of a board time, if any round trip was seen.
    pub fn host_time(&self, board_s: f64) -> Option<HostTime> {
        let passed = |trip: &RoundTrip, rate: f64| (board_s - trip.board_s) * rate;
        let (fast, slow) = (1.0 - DRIFT, 1.0 + DRIFT);
        let lower =
            self.trips.iter().filter(|trip| trip.board_s <= board_s).map(|trip| trip.sent_s + passed(trip, fast));
        let upper =
            self.trips.iter().filter(|trip| trip.board_s >= board_s).map(|trip| trip.received_s + passed(trip, fast));
        let first = self.trips.front()?;
        let last = self.trips.back()?;
        let lower_s = lower.reduce(f64::max).unwrap_or(first.sent_s + passed(first, slow));
        let upper_s = upper.reduce(f64::min).unwrap_or(last.received_s + passed(last, slow));
        let (at_s, uncertainty_s) = (0.5 * (lower_s + upper_s), 0.5 * (upper_s - lower_s).abs());
        Some(HostTime { at_s, uncertainty_s })
    }

    /// Host time minus board time at the last round trip, and how far it can be wrong.
    pub fn offset(&self) -> Option<HostTime> {
        let board_s = self.trips.back()?.board_s;
        self.host_time(board_s).map(|host| HostTime { at_s: host.at_s - board_s, ..host })
    }
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    use super::{BoardClock, RoundTrip};

    fn trip(sent_s: f64, board_s: f64, received_s: f64) -> RoundTrip {
        RoundTrip { sent_s, board_s, received_s }
    }

    #[test]
    fn short_round_trips_on_both_sides_bound_what_lies_between() {
        let mut clock = BoardClock::default();
        clock.observe(trip(1.0, 0.0, 1.001));
        clock.observe(trip(1.5, 0.51, 1.9));
        clock.observe(trip(2.0, 1.0005, 2.001));
        let host = clock.host_time(0.7).unwrap();
        assert!((host.at_s - 1.7).abs() < 1e-3 && host.uncertainty_s < 1e-3, "{host:?}");
    }

    #[test]
    fn lost_ticks_widen_the_bound() {
        let mut clock = BoardClock::default();
        clock.observe(trip(1.0, 1.0, 1.001));
        clock.observe(trip(3.0, 2.5, 3.001));
        let host = clock.host_time(2.0).unwrap();
        assert!(host.at_s - host.uncertainty_s <= 2.0 && host.at_s + host.uncertainty_s >= 2.5, "{host:?}");
    }

    #[test]
    fn a_board_that_started_anew_is_believed() {
        let mut clock = BoardClock::default();
        clock.observe(trip(50.0, 50.0, 50.001));
        clock.observe(trip(51.0, 0.1, 51.1));
        assert!((clock.offset().unwrap().at_s - 50.95).abs() < 1e-9);
    }

    #[test]
    fn the_true_time_is_within_the_bound() {
        let mut clock = BoardClock::default();
        let board_s = |host_s: f64| 0.99995 * host_s - 5.0;
        for n in 0..50u32 {
            let sent_s = f64::from(n);
            let (out_s, back_s) = (0.001 * f64::from(n % 7), 0.002 * f64::from(n % 3) + 1e-4);
            clock.observe(trip(sent_s, board_s(sent_s + out_s), sent_s + out_s + back_s));
            for asked_s in [0.3 * sent_s, 0.9 * sent_s] {
                let host = clock.host_time(board_s(asked_s)).unwrap();
                assert!((host.at_s - asked_s).abs() <= host.uncertainty_s + 1e-12);
            }
        }
    }

    /// A board whose clock runs at a rate of its own, over a line with delays of its own in each direction.
    #[derive(Clone, Debug)]
    struct Line {
        rate: f64,
        gap_s: f64,
        /// Delays out and back of each round trip, of which the last are repeated.
        delays_s: Vec<(f64, f64)>,
    }

    fn line() -> impl Strategy<Value = Line> {
        let delays = (1e-4..2e-3f64, 1e-4..2e-2f64, 0.0..1.0f64, 0.0..1.0f64);
        let delay = move |(least_s, jitter_s, out, back): (f64, f64, f64, f64)| {
            (least_s + jitter_s * out * out, least_s + jitter_s * back * back * back)
        };
        (0.98..=1.02f64, 0.01..0.5f64, vec(delays.prop_map(delay), 20..200)).prop_map(|(rate, gap_s, delays_s)| Line {
            rate,
            gap_s,
            delays_s,
        })
    }

    impl Line {
        fn board_s(&self, host_s: f64) -> f64 {
            self.rate * (host_s - 7.0)
        }

        /// The first `count` round trips.
        fn clock(&self, count: usize) -> BoardClock {
            let mut clock = BoardClock::default();
            for (k, &(out_s, back_s)) in self.delays_s.iter().take(count).enumerate() {
                let sent_s = 10.0 + self.gap_s * k as f64;
                clock.observe(trip(sent_s, self.board_s(sent_s + out_s), sent_s + out_s + back_s));
            }
            clock
        }

        fn end_s(&self) -> f64 {
            10.0 + self.gap_s * self.delays_s.len() as f64
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 300, rng_seed: RngSeed::Fixed(7), failure_persistence: None, ..Default::default() })]

        #[test]
        fn the_true_time_is_within_the_bound_at_any_rate(line in line(), share in -0.1..1.2f64, known in 0.1..=1.0f64) {
            let clock = line.clock((known * line.delays_s.len() as f64) as usize + 1);
            let asked_s = 10.0 + share * (line.end_s() - 10.0);
            let host = clock.host_time(line.board_s(asked_s)).unwrap();
            prop_assert!((host.at_s - asked_s).abs() <= host.uncertainty_s + 1e-9, "{host:?} {asked_s}");
        }
    }
}
