//! What the inputs showed while one output was switched on and off again.

use darm_core::output::MAX_INPUTS;
use darm_core::units::Micros;

/// The control tick: what the board reports was seen at most this long before it answered, and a command acts at most this
/// long after.
pub(super) const TICKS: Micros = Micros(2_000);

/// Earliest and latest time of something, on the board's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// Not before.
    pub first: Micros,
    /// Not after.
    pub last: Micros,
}

/// The inputs at one time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample {
    /// When the board reported them.
    pub at: Micros,
    /// Bit `i` is input `i`, set when closed.
    pub inputs: u32,
}

/// What a person saw.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sight {
    /// Actuators that moved.
    pub moved: Vec<usize>,
    /// Whether the output's actuator was in the state of its coil while the output was on; `None` where it is unknown.
    pub in_state: Option<bool>,
}

/// What the inputs showed while one output was switched on and off again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stroke {
    /// Number of the output.
    pub output: u8,
    /// When it was switched on.
    pub on: Span,
    /// How long it was on.
    pub on_for: Micros,
    /// In order of time, the first one before the output was on.
    pub samples: Vec<Sample>,
    /// What a person saw; `None` where nobody looked.
    pub sight: Option<Sight>,
}

/// A change of an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edge {
    /// The input.
    pub input: u8,
    /// Whether it closed.
    pub closed: bool,
    /// When.
    pub at: Span,
}

impl Stroke {
    /// When the output was switched off.
    pub fn off(&self) -> Span {
        Span { first: self.on.first + self.on_for, last: self.on.last + self.on_for + TICKS }
    }

    /// Inputs before the output was on.
    pub fn at_rest(&self) -> u32 {
        self.samples.first().map_or(0, |sample| sample.inputs)
    }

    /// Inputs at the end of the time in which the output was on.
    pub fn when_on(&self) -> u32 {
        let off = self.off().first;
        self.samples.iter().rfind(|sample| sample.at < off).map_or(0, |sample| sample.inputs)
    }

    /// Inputs at the end.
    pub fn at_end(&self) -> u32 {
        self.samples.last().map_or(0, |sample| sample.inputs)
    }

    /// Changes of the inputs while the output was on, in order.
    pub fn on_edges(&self) -> Vec<Edge> {
        let off = self.off().first;
        self.edges().into_iter().filter(|edge| edge.at.last < off).collect()
    }

    /// Changes of the inputs after that, in order.
    pub fn off_edges(&self) -> Vec<Edge> {
        let off = self.off().first;
        self.edges().into_iter().filter(|edge| edge.at.last >= off).collect()
    }

    fn edges(&self) -> Vec<Edge> {
        let pairs = self.samples.windows(2);
        pairs.flat_map(|pair| edges_between(pair[0], pair[1])).collect()
    }
}

fn edges_between(before: Sample, after: Sample) -> impl Iterator<Item = Edge> {
    let changed = before.inputs ^ after.inputs;
    let at = Span { first: before.at - TICKS, last: after.at };
    (0..MAX_INPUTS as u8).filter(move |input| changed >> input & 1 == 1).map(move |input| Edge {
        input,
        closed: after.inputs >> input & 1 == 1,
        at,
    })
}

/// The inputs of a mask.
pub(super) fn inputs_of(mask: u32) -> Vec<u8> {
    (0..MAX_INPUTS as u8).filter(|input| mask >> input & 1 == 1).collect()
}

#[cfg(test)]
mod tests {
    use darm_core::units::Micros;

    use super::{Sample, Span, Stroke};

    #[test]
    fn edges_lie_between_the_samples_that_show_them() {
        let sample = |at_ms, inputs| Sample { at: Micros::from_millis(at_ms), inputs };
        let on = Span { first: Micros::from_millis(100), last: Micros::from_millis(105) };
        let samples =
            vec![sample(99, 0b10), sample(110, 0b00), sample(150, 0b01), sample(290, 0b01), sample(320, 0b10)];
        let stroke = Stroke { output: 0, on, on_for: Micros::from_millis(200), samples, sight: None };
        assert_eq!((stroke.at_rest(), stroke.when_on(), stroke.at_end()), (0b10, 0b01, 0b10));
        let edges = stroke.on_edges();
        assert_eq!(edges.iter().map(|edge| (edge.input, edge.closed)).collect::<Vec<_>>(), [(1, false), (0, true)]);
        assert_eq!(edges[1].at, Span { first: Micros(108_000), last: Micros(150_000) });
        assert_eq!(stroke.off_edges().len(), 2);
    }
}
