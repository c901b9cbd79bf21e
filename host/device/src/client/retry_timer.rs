//! How long to wait for an answer before asking again: learnt from the line, as TCP does.
//!
//! # Model
//!
//! wait = clamp(s + 4·d, 0.15 s, 1 s)·2ⁿ, at most 1 s, with the smoothed round trip s, its smoothed deviation d and n
//! silences in a row. A new round trip r moves d by a quarter towards |s − r| and s by an eighth towards r.
//! Source: RFC 6298, section 2; its constants α = 1/8, β = 1/4, K = 4.

/// Shortest wait: a long frame and its answer take 50 ms at 115200 baud, a flash page 25 ms.
const SHORTEST_S: f64 = 0.15;
/// Longest wait.
const LONGEST_S: f64 = 1.0;

/// What is known of the line's round trips.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RetryTimer {
    /// Smoothed round trip and deviation, after the first answer.
    round_trip_s: Option<(f64, f64)>,
    /// Silences in a row.
    silences: u32,
}

impl RetryTimer {
    /// How long to wait now.
    pub(super) fn wait_s(&self) -> f64 {
        let (smooth_s, deviation_s) = self.round_trip_s.unwrap_or((0.0, 0.0));
        let wait_s = (smooth_s + 4.0 * deviation_s).max(SHORTEST_S);
        (wait_s * f64::from(1u32 << self.silences.min(8))).min(LONGEST_S)
    }

    /// An answer came to a request that was sent once.
    pub(super) fn on_answer(&mut self, round_trip_s: f64) {
        self.silences = 0;
        self.round_trip_s = Some(match self.round_trip_s {
            None => (round_trip_s, 0.5 * round_trip_s),
            Some((smooth_s, deviation_s)) => {
                let deviation_s = deviation_s + 0.25 * ((smooth_s - round_trip_s).abs() - deviation_s);
                (smooth_s + 0.125 * (round_trip_s - smooth_s), deviation_s)
            }
        });
    }

    /// No answer came in time.
    pub(super) fn on_silence(&mut self) {
        self.silences += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::{LONGEST_S, RetryTimer, SHORTEST_S};

    #[test]
    fn a_fast_line_waits_shortest_and_silence_doubles() {
        let mut retry_timer = RetryTimer::default();
        retry_timer.on_answer(0.001);
        assert_eq!(retry_timer.wait_s(), SHORTEST_S);
        retry_timer.on_silence();
        assert_eq!(retry_timer.wait_s(), 2.0 * SHORTEST_S);
        (0..40).for_each(|_| retry_timer.on_silence());
        assert_eq!(retry_timer.wait_s(), LONGEST_S);
    }

    #[test]
    fn a_slow_line_is_given_its_time() {
        let mut retry_timer = RetryTimer::default();
        (0..50).for_each(|n| retry_timer.on_answer(0.2 + 0.02 * f64::from(n % 2)));
        assert!((0.22..0.3).contains(&retry_timer.wait_s()), "{}", retry_timer.wait_s());
    }
}
