//! One discrete actuator: it leaves its stop at once and reaches the next one after its travel.

use darm_core::output::LimitSwitch;

/// State of one actuator.
#[derive(Clone, Debug)]
pub(super) struct Actuator {
    travel_s: f64,
    switch: Option<LimitSwitch>,
    /// The stop where it rests, or rested last.
    digit: u8,
    /// The stop that it travels to, and when it arrives.
    travels: Option<(u8, f64)>,
}

impl Actuator {
    pub(super) fn new(travel_s: f64, switch: Option<LimitSwitch>) -> Self {
        Self { travel_s, switch, digit: 0, travels: None }
    }

    /// Its travel takes longer by this factor from now on.
    pub(super) fn scale_travel(&mut self, factor: f64) {
        self.travel_s *= factor;
    }

    /// The stop where it rests, or rested last.
    pub(super) fn digit(&self) -> u8 {
        self.digit
    }

    /// Whether it is between two stops.
    pub(super) fn is_moving(&self) -> bool {
        self.travels.is_some()
    }

    /// Lets its coils push it to `digit` from `now_s` on. One that is called back on its way needs as long back as it
    /// was under way.
    pub(super) fn drive(&mut self, now_s: f64, digit: u8) {
        match self.travels {
            Some((to, _)) if to == digit => {}
            Some((_, arrives_s)) if digit == self.digit => {
                let under_way_s = self.travel_s - (arrives_s - now_s);
                self.travels = Some((digit, now_s + under_way_s));
            }
            None if digit == self.digit => {}
            _ => self.travels = Some((digit, now_s + self.travel_s)),
        }
    }

    /// Lets time pass.
    pub(super) fn advance(&mut self, now_s: f64) {
        if let Some((digit, arrives_s)) = self.travels
            && arrives_s <= now_s
        {
            self.digit = digit;
            self.travels = None;
        }
    }

    /// When it arrives.
    pub(super) fn next_event_s(&self) -> Option<f64> {
        self.travels.map(|(_, arrives_s)| arrives_s)
    }

    /// The bit of its closed limit switch: a switch between two stops is open.
    pub(super) fn switch_bit(&self) -> u32 {
        let closed = self.switch.filter(|switch| !self.is_moving() && switch.closed(self.digit));
        closed.map_or(0, |switch| 1 << switch.input)
    }
}

#[cfg(test)]
mod tests {
    use darm_core::output::LimitSwitch;

    use super::Actuator;

    #[test]
    fn the_switch_opens_at_once_and_closes_on_arrival() {
        let switch = LimitSwitch { input: 3, closed_in: 0b11 };
        let mut actuator = Actuator::new(0.1, Some(switch));
        assert_eq!(actuator.switch_bit(), 8);
        actuator.drive(1.0, 1);
        assert_eq!((actuator.switch_bit(), actuator.digit()), (0, 0));
        actuator.advance(1.1);
        assert_eq!((actuator.switch_bit(), actuator.digit()), (8, 1));
    }

    #[test]
    fn called_back_it_returns_as_long_as_it_went() {
        let mut actuator = Actuator::new(0.1, None);
        actuator.drive(0.0, 1);
        actuator.drive(0.03, 0);
        let arrives_s = actuator.next_event_s().unwrap();
        assert!((arrives_s - 0.06).abs() < 1e-12);
        actuator.advance(0.06 + 1e-9);
        assert!(!actuator.is_moving() && actuator.digit() == 0);
    }
}
