//! How many host seconds a second of the board takes: the interval that pairs of round trips leave.

use super::{LARGEST_RATE_ERROR, RoundTrip};

/// The time over which the pace is taken to be constant: temperature changes it over longer times. In seconds of the
/// board.
const CONSTANT_S: f64 = 600.0;

/// An interval of host seconds per board second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pace {
    pub(super) low: f64,
    pub(super) high: f64,
}

impl Pace {
    /// What any board's oscillator keeps.
    pub(super) const LIMITS: Self =
        Self { low: 1.0 / (1.0 + LARGEST_RATE_ERROR), high: 1.0 / (1.0 - LARGEST_RATE_ERROR) };

    fn and(self, other: Self) -> Self {
        Self { low: self.low.max(other.low), high: self.high.min(other.high) }
    }

    fn is_contradiction(self) -> bool {
        self.low > self.high
    }

    /// The interval over a span of board time: beyond the time for which the pace is constant only the limits hold.
    pub(super) fn near(self, span_s: f64) -> Self {
        if span_s.abs() <= CONSTANT_S { self } else { Self::LIMITS }
    }

    /// Least and most host time over a span of board time, which may be negative.
    pub(super) fn passed_s(self, span_s: f64) -> [f64; 2] {
        let [a_s, b_s] = [span_s * self.low, span_s * self.high];
        [a_s.min(b_s), a_s.max(b_s)]
    }
}

/// The pace over the last two windows of [`CONSTANT_S`].
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Paces {
    before: Option<Window>,
    now: Option<Window>,
}

impl Paces {
    pub(super) fn observe(&mut self, trip: &RoundTrip) {
        if self.now.as_ref().is_some_and(|now| trip.board_s - now.since_s > CONSTANT_S) {
            self.before = self.now.take();
        }
        self.now.get_or_insert_with(|| Window::new(trip.board_s)).observe(trip);
    }

    /// The pace, if no pair of round trips contradicts that it is constant.
    pub(super) fn steady(&self) -> Option<Pace> {
        let all = self.windows().fold(Pace::LIMITS, |pace, window| pace.and(window.pace));
        (!all.is_contradiction()).then_some(all)
    }

    /// The pace; where ticks were lost only its upper end is better than the limits, and where the board has caught up
    /// lost ticks not even that.
    pub(super) fn pace(&self) -> Pace {
        self.steady().unwrap_or_else(|| {
            let high = self.windows().map(|window| window.pace.high).fold(Pace::LIMITS.high, f64::min);
            if high > Pace::LIMITS.low { Pace { high, ..Pace::LIMITS } } else { Pace::LIMITS }
        })
    }

    fn windows(&self) -> impl Iterator<Item = &Window> {
        self.before.iter().chain(&self.now)
    }
}

/// Round trips of some minutes.
#[derive(Clone, Debug, PartialEq)]
struct Window {
    since_s: f64,
    pace: Pace,
    /// The latest sendings: they bound the pace from above.
    sent: Hull,
    /// The earliest receptions, times −1: they bound it from below.
    received: Hull,
}

impl Window {
    fn new(since_s: f64) -> Self {
        Self { since_s, pace: Pace::LIMITS, sent: Hull::default(), received: Hull::default() }
    }

    fn observe(&mut self, trip: &RoundTrip) {
        if let Some(steepest) = self.sent.steepest(trip.board_s, -trip.received_s) {
            self.pace.high = self.pace.high.min(-steepest);
        }
        if let Some(steepest) = self.received.steepest(trip.board_s, trip.sent_s) {
            self.pace.low = self.pace.low.max(steepest);
        }
        self.sent.push([trip.board_s, trip.sent_s]);
        self.received.push([trip.board_s, -trip.received_s]);
    }
}

/// The upper convex hull of points (x, y) whose x never falls: all that a steepest line can touch.
///
/// Source: A. M. Andrew, Another efficient algorithm for convex hulls in two dimensions, 1979 (monotone chain).
#[derive(Clone, Debug, Default, PartialEq)]
struct Hull(Vec<[f64; 2]>);

impl Hull {
    fn push(&mut self, point: [f64; 2]) {
        if let Some(last) = self.0.last()
            && last[0] == point[0]
        {
            if last[1] >= point[1] {
                return;
            }
            self.0.pop();
        }
        while let [.., a, b] = self.0[..]
            && (b[1] - a[1]) * (point[0] - b[0]) <= (point[1] - b[1]) * (b[0] - a[0])
        {
            self.0.pop();
        }
        self.0.push(point);
    }

    /// The largest (y + yᵢ)/(x − xᵢ) over the points before x.
    fn steepest(&self, x: f64, y: f64) -> Option<f64> {
        let before = self.0.iter().filter(|point| point[0] < x);
        before.map(|point| (y + point[1]) / (x - point[0])).reduce(f64::max)
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    use super::Hull;

    #[test]
    fn the_hull_gives_the_steepest_of_all_points() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let (mut hull, mut points): (Hull, Vec<[f64; 2]>) = Default::default();
        for k in 0..500 {
            let point = [f64::from(k / 2), rng.random_range(-1.0..1.0)];
            let (x, y) = (point[0] + 1.0, -rng.random_range(5.0..9.0));
            hull.push(point);
            points.push(point);
            let all = points.iter().map(|point| (y + point[1]) / (x - point[0])).reduce(f64::max);
            assert_eq!(hull.steepest(x, y), all);
        }
        assert!(hull.0.len() < 60, "{}", hull.0.len());
    }
}
