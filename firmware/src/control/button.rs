//! The button of the board, or the jumper in its place: whoever presses it is at the board.
//!
//! A contact that stays closed says nothing: a jumper that was left in its place would let anyone with the port write
//! profiles. A press is a contact that closes after it was open since the start, and it counts for a minute.

use darm_core::sequencer::LATE;
use darm_core::units::Micros;

/// A contact that opens for a shorter time bounces.
const OPEN: Micros = Micros::from_millis(20);
/// A press counts for this time, while the contact stays closed.
const PRESS: Micros = Micros::from_millis(60_000);

/// The contact over time.
pub(super) struct Button {
    closed: bool,
    /// Since when it has this level, later by the time in which nobody looked.
    since: Micros,
    /// The last look.
    seen: Micros,
    /// When it closed last after it was open.
    pressed: Option<Micros>,
}

impl Button {
    /// A contact that may have been closed for ever.
    pub(super) const fn new(now: Micros) -> Self {
        Self { closed: true, since: now, seen: now, pressed: None }
    }

    /// The level in this tick.
    pub(super) fn look(&mut self, now: Micros, closed: bool) {
        let gap = now - core::mem::replace(&mut self.seen, now);
        // One bounce before a gap would count as a contact that was open all the time.
        if gap > LATE {
            self.since = self.since + gap;
        }
        if closed == self.closed {
            return;
        }
        if closed && now - self.since >= OPEN {
            self.pressed = Some(now);
        }
        (self.closed, self.since) = (closed, now);
    }

    /// Whether a person presses it.
    pub(super) fn is_pressed(&self, now: Micros) -> bool {
        self.closed && self.pressed.is_some_and(|at| now - at < PRESS)
    }
}

#[cfg(test)]
mod tests {
    use super::{Button, Micros};

    /// Whether it is pressed at the end of these spans, in ms, closed in turn after it is open.
    fn pressed_after(spans_ms: &[u32]) -> bool {
        let (mut button, mut now, mut closed) = (Button::new(Micros(0)), Micros(0), false);
        for span_ms in spans_ms {
            for _ in 0..*span_ms {
                now = now + Micros::from_millis(1);
                button.look(now, closed);
            }
            closed = !closed;
        }
        button.is_pressed(now)
    }

    #[test]
    fn a_press_counts_for_a_minute_and_a_jumper_that_was_left_does_not() {
        assert!(!pressed_after(&[0, 70_000]), "closed since the start");
        assert!(!pressed_after(&[100]));
        assert!(pressed_after(&[100, 1]));
        assert!(pressed_after(&[100, 60_000]));
        assert!(!pressed_after(&[100, 60_001]));
        assert!(!pressed_after(&[100, 50, 1]), "released");
        assert!(pressed_after(&[100, 60_001, 100, 50]), "pressed again");
    }

    #[test]
    fn a_contact_that_bounces_is_pressed_once() {
        assert!(pressed_after(&[100, 1, 1, 1, 1, 50]));
        assert!(!pressed_after(&[1, 1, 1, 50]), "a loose jumper");
        assert!(!pressed_after(&[100, 59_000, 1, 2_000]), "a bounce is no second press");
    }

    /// While the flash is erased nobody looks.
    #[test]
    fn a_bounce_before_a_pause_is_no_press_and_a_press_within_it_is_one() {
        for (open_ms, is_pressed) in [(1, false), (19, false), (20, true), (100, true)] {
            let mut button = Button::new(Micros(0));
            (1..100).for_each(|ms| button.look(Micros::from_millis(ms), true));
            (100..100 + open_ms).for_each(|ms| button.look(Micros::from_millis(ms), false));
            let after = Micros::from_millis(100 + open_ms + 400);
            button.look(after, false);
            button.look(after + Micros::from_millis(1), true);
            assert_eq!(button.is_pressed(after + Micros::from_millis(2)), is_pressed, "open for {open_ms} ms");
        }
    }
}
