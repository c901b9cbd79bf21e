//! Board time and host time: what round trips determine, and how uncertain it is.
//!
//! # Model
//!
//! A request leaves at host time a, the board stamps it at its own time b, the answer arrives at c: the stamp was taken
//! at a host time between a and c. While the board's clock advances by Δb, the host's advances by p·Δb, with a pace p that
//! is constant but not known: oscillators of boards stay within [`LARGEST_RATE_ERROR`]. A board in an emulator that does
//! not get the processor also loses ticks: then the host's clock advances by more. So for two round trips i before j
//!
//! p ≤ (c_j − a_i)/(b_j − b_i), always,
//!
//! p ≥ (a_j − c_i)/(b_j − b_i), unless ticks were lost in between.
//!
//! The tightest of these over all pairs within the last minutes are the interval of the pace, [p₋, p₊]. Where they
//! contradict each other, ticks were lost; p₋ then falls back to the limit of oscillators. For any board time t
//!
//! a + (t − b)·p₋ ≤ host time of t ≤ c + (t − b)·p₊, from every round trip with b ≤ t,
//!
//! a − (b − t)·p₊ ≤ host time of t ≤ c − (b − t)·p₋, from every round trip with b ≥ t.
//!
//! Where ticks were lost only those with p₋ hold; before the first and after the last round trip, where these give no
//! second bound, no further ticks are taken to be lost. The tightest bounds count; their middle is the estimate and half
//! their distance its uncertainty. A loss that contradicts no pair is shorter than the two longest round trips together,
//! and so is the error that it causes.
//!
//! # Example
//!
//! ```
//! use darm_device::clock::{BoardClock, RoundTrip};
//! let mut clock = BoardClock::default();
//! clock.observe(RoundTrip { sent_s: 10.0, board_s: 3.0, received_s: 10.2 });
//! let host = clock.host_time(3.5).unwrap();
//! assert!((host.at_s - 10.6).abs() < 1e-3 && host.uncertainty_s < 0.12);
//! ```

mod pace;

use std::collections::VecDeque;
use std::sync::OnceLock;
use std::time::Instant;

use pace::{Pace, Paces};

/// How far a board's clock is off at most, s/s: RC oscillators over their complete temperature range stay below.
pub const LARGEST_RATE_ERROR: f64 = 0.02;
/// The board's stamps are integer microseconds, rounded down; the rest is rounding of the host's numbers.
const STAMP_S: f64 = 1.1e-6;

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

/// How fast a board's clock runs, and how far that can be wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rate {
    /// The estimate less 1: seconds that the board gains in a second of the host.
    pub error: f64,
    /// Bound of the estimate's own error.
    pub uncertainty: f64,
}

/// Round trips that are kept: a quarter of an hour of forty a second.
const KEPT: usize = 36_000;

/// What is known of the relation between the board's clock and the host's.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BoardClock {
    /// In order of board time.
    trips: VecDeque<RoundTrip>,
    paces: Paces,
    lost_s: f64,
}

impl BoardClock {
    /// Takes in a round trip. A board whose time went back has started again; what was known before is forgotten.
    pub fn observe(&mut self, trip: RoundTrip) {
        let trip = RoundTrip { sent_s: trip.sent_s - STAMP_S, ..trip };
        if self.trips.back().is_some_and(|last| trip.board_s < last.board_s) {
            *self = Self::default();
        }
        if let Some(last) = self.trips.back() {
            let passed_s = Pace::LIMITS.high * (trip.board_s - last.board_s);
            self.lost_s += (trip.sent_s - last.received_s - passed_s).max(0.0);
        }
        if self.trips.len() == KEPT {
            self.trips.pop_front();
        }
        self.paces.observe(&trip);
        self.trips.push_back(trip);
    }

    /// Host time of a board time, if any round trip was seen.
    pub fn host_time(&self, board_s: f64) -> Option<HostTime> {
        let steady =
            self.paces.steady().map(|pace| self.bounds_s(board_s, pace)).filter(|[low_s, high_s]| low_s <= high_s);
        let [low_s, high_s] = match steady {
            Some(bounds_s) => bounds_s,
            None => self.bounds_with_losses_s(board_s)?,
        };
        (low_s.is_finite() && high_s.is_finite())
            .then(|| HostTime { at_s: 0.5 * (low_s + high_s), uncertainty_s: 0.5 * (high_s - low_s).abs() })
    }

    /// Host time minus board time at the last round trip, and how far it can be wrong.
    pub fn offset(&self) -> Option<HostTime> {
        let board_s = self.trips.back()?.board_s;
        self.host_time(board_s).map(|host| HostTime { at_s: host.at_s - board_s, ..host })
    }

    /// How fast the board's clock runs while it loses no ticks; within [`LARGEST_RATE_ERROR`] where nothing more is known.
    pub fn rate(&self) -> Rate {
        let pace = self.paces.pace();
        let (slowest, fastest) = (1.0 / pace.high, 1.0 / pace.low);
        Rate { error: 0.5 * (slowest + fastest) - 1.0, uncertainty: 0.5 * (fastest - slowest) }
    }

    /// Time that the board's clock has lost at least, in seconds, beyond what its rate explains.
    pub fn lost_s(&self) -> f64 {
        self.lost_s
    }

    /// Bounds of the host time where no ticks were lost.
    fn bounds_s(&self, board_s: f64, pace: Pace) -> [f64; 2] {
        self.trips.iter().fold([f64::NEG_INFINITY, f64::INFINITY], |[low_s, high_s], trip| {
            let passed_s = board_s - trip.board_s;
            let [min_s, max_s] = pace.near(passed_s).passed_s(passed_s);
            [low_s.max(trip.sent_s + min_s), high_s.min(trip.received_s + max_s)]
        })
    }

    /// Bounds of the host time where ticks may have been lost between round trips.
    fn bounds_with_losses_s(&self, board_s: f64) -> Option<[f64; 2]> {
        let (first, last) = (self.trips.front()?, self.trips.back()?);
        let pace = self.paces.pace();
        let passed_s = |trip: &RoundTrip| pace.low * (board_s - trip.board_s);
        let before = self.trips.iter().filter(|trip| trip.board_s <= board_s);
        let after = self.trips.iter().filter(|trip| trip.board_s >= board_s);
        let low_s = before.map(|trip| trip.sent_s + passed_s(trip)).reduce(f64::max);
        let high_s = after.map(|trip| trip.received_s + passed_s(trip)).reduce(f64::min);
        Some([
            low_s.unwrap_or(first.sent_s + pace.high * (board_s - first.board_s)),
            high_s.unwrap_or(last.received_s + pace.high * (board_s - last.board_s)),
        ])
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
        assert!((0.46..0.5).contains(&clock.lost_s()), "{}", clock.lost_s());
    }

    #[test]
    fn a_board_that_catches_up_leaves_the_rate_uncertain() {
        let mut clock = BoardClock::default();
        clock.observe(trip(1.0, 0.99, 1.0001));
        clock.observe(trip(1.05, 1.05, 1.0501));
        let rate = clock.rate();
        assert!(rate.error.abs() <= rate.uncertainty, "{rate:?}");
    }

    #[test]
    fn a_board_that_started_anew_is_believed() {
        let mut clock = BoardClock::default();
        clock.observe(trip(50.0, 50.0, 50.001));
        clock.observe(trip(51.0, 0.1, 51.1));
        assert!((clock.offset().unwrap().at_s - 50.95).abs() < 1e-5);
        assert_eq!(clock.lost_s(), 0.0);
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
        let delay = move |(min_s, jitter_s, out, back): (f64, f64, f64, f64)| {
            (min_s + jitter_s * out * out, min_s + jitter_s * back * back * back)
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

        /// Round trips one after the other, of a board with this time.
        fn trips(&self, board_s: impl Fn(f64) -> f64) -> Vec<RoundTrip> {
            let mut sent_s = 10.0;
            let mut one = |&(out_s, back_s): &(f64, f64)| {
                let one = trip(sent_s, board_s(sent_s + out_s), sent_s + out_s + back_s);
                sent_s = one.received_s + self.gap_s;
                one
            };
            self.delays_s.iter().map(&mut one).collect()
        }

        /// The clock after the first `count` round trips.
        fn clock(&self, count: usize) -> BoardClock {
            let mut clock = BoardClock::default();
            self.trips(|host_s| self.board_s(host_s)).into_iter().take(count).for_each(|trip| clock.observe(trip));
            clock
        }

        fn end_s(&self) -> f64 {
            self.trips(|_| 0.0).last().map_or(10.0, |last| last.received_s)
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

        #[test]
        fn the_rate_is_within_its_bound_and_a_minute_of_questions_makes_it_narrow(line in line()) {
            let rate = line.clock(usize::MAX).rate();
            prop_assert!((rate.error - (line.rate - 1.0)).abs() <= rate.uncertainty + 1e-9, "{rate:?}");
            let span_s = line.end_s() - 10.0;
            prop_assert!(span_s < 10.0 || rate.uncertainty < 0.05 / span_s, "{rate:?} after {span_s} s");
        }

        /// Ticks are lost at one moment.
        #[test]
        fn the_true_time_is_within_the_bound_where_ticks_were_lost(
            line in line(), share in 0.0..1.0f64, at in 0.1..0.9f64, loss_s in 0.0..1.0f64,
        ) {
            let lost_at_s = 10.0 + at * (line.end_s() - 10.0);
            let kept_s = |host_s: f64| host_s.min(lost_at_s) + (host_s - lost_at_s - loss_s).max(0.0);
            let board_s = |host_s: f64| line.board_s(kept_s(host_s));
            let mut clock = BoardClock::default();
            line.trips(board_s).into_iter().for_each(|trip| clock.observe(trip));
            let asked_s = 10.0 + share * (line.end_s() - 10.0);
            prop_assume!(asked_s < lost_at_s || asked_s > lost_at_s + loss_s);
            let host = clock.host_time(board_s(asked_s)).unwrap();
            let longest_s = line.delays_s.iter().map(|(out_s, back_s)| out_s + back_s).fold(0.0, f64::max);
            let hidden_s = if clock.paces.steady().is_some() { 2.0 * longest_s } else { 1e-9 };
            prop_assert!((host.at_s - asked_s).abs() <= host.uncertainty_s + hidden_s, "{host:?} {asked_s}");
        }
    }
}
