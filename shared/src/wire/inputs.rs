//! Changes of the inputs, as the control tick saw them: the raw data of stroke times.
//!
//! The tick reads all inputs at its start, once a millisecond. A change carries the time of the tick that saw it first: it
//! happened at most one tick before, and the lateness of that tick earlier.

use serde::{Deserialize, Serialize};

use crate::units::Micros;

/// Changes in one answer, at most.
pub const INPUT_CHANGES: usize = 16;

/// Changes of the inputs, in order.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputChanges {
    /// Number of the first change in the list; larger than requested when older ones are lost.
    pub first: u32,
    /// When a tick saw other inputs than the one before, and which were closed then: bit `i` is input `i`.
    pub list: heapless::Vec<(Micros, u32), INPUT_CHANGES>,
}

#[cfg(test)]
mod tests {
    use super::InputChanges;
    use crate::units::Micros;
    use crate::wire::message::{Answer, Reply, Request};

    #[test]
    fn golden_bytes_both_ways() {
        let mut bytes = [0; 64];
        assert_eq!(postcard::to_slice(&Request::Inputs { from: 300 }, &mut bytes).unwrap(), [14, 0xac, 2]);
        let mut changes = InputChanges { first: 300, ..InputChanges::default() };
        changes.list.extend([(Micros(1000), 0b101), (Micros(2001), 0x1000)]);
        let reply = Reply { at: Micros(5), result: Ok(Answer::Inputs(changes)) };
        let encoded = postcard::to_slice(&reply, &mut bytes).unwrap();
        assert_eq!(encoded, [5, 0, 12, 0xac, 2, 2, 0xe8, 7, 5, 0xd1, 0xf, 0x80, 0x20]);
        assert_eq!(postcard::from_bytes::<Reply>(encoded), Ok(reply));
    }

    #[test]
    fn the_longest_answer_fits_a_frame() {
        let mut changes = InputChanges { first: u32::MAX, ..InputChanges::default() };
        while changes.list.push((Micros(u64::MAX), u32::MAX)).is_ok() {}
        let reply = Reply { at: Micros(u64::MAX), result: Ok(Answer::Inputs(changes)) };
        assert!(postcard::to_slice(&reply, &mut [0; crate::wire::frame::MAX_PAYLOAD]).is_ok());
    }
}
