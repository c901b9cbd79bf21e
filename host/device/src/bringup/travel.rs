//! Times of strokes, and the time of travel that follows from them.
//!
//! The inputs are asked as fast as the line allows, so a time is known to lie between two samples: on a serial line of 115200
//! baud a request of 15 bytes and an answer of about 50 take 6 ms. The bounds are those of the samples and of the command.

use serde::Serialize;

use super::response::Response;
use super::stroke::{Edge, Span, Stroke};
use super::subject::Subject;

/// Margin of the time of travel over the longest stroke: cold grease, low supply, load.
const MARGIN: f64 = 1.5;
/// Added for what bounces and settles, ms.
const SETTLE_MS: f64 = 20.0;
/// Times of travel are multiples of this, ms.
const ROUND_MS: f64 = 10.0;

/// Time from switching an output to the change of its switch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Travel {
    /// The actuator.
    pub actuator: usize,
    /// Number of the output.
    pub output: u8,
    /// Whether the output was switched on, or off.
    pub on: bool,
    /// Whether the switch closed (the actuator arrived at it) or opened (it left).
    pub closed: bool,
    /// Not shorter, µs.
    pub min_us: u32,
    /// Not longer, µs.
    pub max_us: u32,
}

/// The times of the strokes that did what they should.
pub fn travels(subject: &Subject, strokes: &[Stroke]) -> Vec<Travel> {
    strokes.iter().flat_map(|stroke| of_stroke(subject, stroke)).collect()
}

/// The time of travel that the strokes of an actuator ask for: one and a half times the longest and 20 ms more, rounded up to
/// 10 ms. `None` where no stroke reached a switch: the time at which an actuator leaves its switch says nothing of when it
/// arrives elsewhere.
pub fn travel_ms(travels: &[Travel], actuator: usize) -> Option<u16> {
    let own = || travels.iter().filter(|travel| travel.actuator == actuator);
    own().find(|travel| travel.closed)?;
    let longest_ms = own().map(|travel| f64::from(travel.max_us) * 1e-3).fold(0.0, f64::max);
    Some((((MARGIN * longest_ms + SETTLE_MS) / ROUND_MS).ceil() * ROUND_MS) as u16)
}

fn of_stroke(subject: &Subject, stroke: &Stroke) -> Vec<Travel> {
    let Some(response) = Response::new(subject, stroke).filter(|response| response.kind().is_none()) else {
        return Vec::new();
    };
    let Some((switch, _)) = response.place.expected() else { return Vec::new() };
    let last = |edges: Vec<Edge>| edges.into_iter().rfind(|edge| edge.input == switch.input);
    let halves = [(true, stroke.on, last(stroke.on_edges())), (false, stroke.off(), last(stroke.off_edges()))];
    let of_half = |(on, switched, edge): (bool, Span, Option<Edge>)| Some(travel(&response, on, switched, edge?));
    halves.into_iter().filter_map(of_half).collect()
}

fn travel(response: &Response<'_>, on: bool, switched: Span, edge: Edge) -> Travel {
    let [min_us, max_us] = between(switched, edge.at);
    let (actuator, output) = (response.place.actuator, response.stroke.output);
    Travel { actuator, output, on, closed: edge.closed, min_us, max_us }
}

/// Shortest and longest time between the two, µs.
fn between(from: Span, to: Span) -> [u32; 2] {
    [to.first - from.last, to.last - from.first].map(|time| u32::try_from(time.0).unwrap_or(u32::MAX))
}

#[cfg(test)]
mod tests {
    use super::{Travel, travel_ms};

    #[test]
    fn the_time_of_travel_has_a_margin_and_needs_an_arrival() {
        let travel = |closed, max_us| Travel { actuator: 1, output: 1, on: true, closed, min_us: 0, max_us };
        assert_eq!(travel_ms(&[travel(true, 40_000), travel(false, 62_000)], 1), Some(120));
        assert_eq!(travel_ms(&[travel(false, 62_000)], 1), None);
        assert_eq!(travel_ms(&[travel(true, 40_000)], 0), None);
    }
}
