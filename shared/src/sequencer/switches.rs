//! Limit switches: after the time of travel each must show its actuator's digit.

use super::FaultKind;
use super::bits::Bits;
use crate::output::{ActuatorWiring, MAX_ACTUATORS, MAX_INPUTS, Wiring};
use crate::units::{ActuatorId, Micros, Word};

/// A switch must contradict in this many ticks in a row before that is a fault: contacts bounce.
const BOUNCE_TICKS: u8 = 3;

/// What the switches must show. A tick touches the actuators that travel and the switches that contradict.
#[derive(Debug)]
pub(super) struct Switches {
    /// Actuators that have a switch, bit `a` for actuator `a`, and the bit of its input.
    watched: u64,
    input: [u32; MAX_ACTUATORS],
    /// Actuators that may still travel.
    travelling: u64,
    since: [Micros; MAX_ACTUATORS],
    /// Inputs whose actuators have arrived, bit `i` for input `i`.
    arrived: u32,
    /// Inputs that must be closed, of those.
    closed: u32,
    /// Inputs that contradicted in the last tick, and in how many ticks in a row.
    contradicting: u32,
    ticks: [u8; MAX_INPUTS],
}

impl Default for Switches {
    fn default() -> Self {
        Self {
            watched: 0,
            input: [0; MAX_ACTUATORS],
            travelling: 0,
            since: [Micros(0); MAX_ACTUATORS],
            arrived: 0,
            closed: 0,
            contradicting: 0,
            ticks: [0; MAX_INPUTS],
        }
    }
}

impl Switches {
    /// Makes ready for the switches of another table, and expects nothing.
    pub(super) fn load(&mut self) {
        self.watched = 0;
        self.expect_nothing();
    }

    /// Takes over the switch of one actuator.
    pub(super) fn wire(&mut self, index: usize, actuator: &ActuatorWiring) {
        if let Some((switch, input)) = actuator.switch.zip(self.input.get_mut(index)) {
            *input = 1 << switch.input;
            self.watched |= 1 << index;
        }
    }

    /// Nothing is expected of any switch.
    pub(super) fn expect_nothing(&mut self) {
        self.travelling = 0;
        self.arrived = 0;
        self.contradicting = 0;
    }

    /// All actuators may travel from `now` on.
    pub(super) fn begin(&mut self, now: Micros) {
        self.expect_nothing();
        self.travelling = self.watched;
        self.since = [now; MAX_ACTUATORS];
    }

    /// These actuators, bit `a` for actuator `a`, travel from `now` on.
    pub(super) fn travel(&mut self, now: Micros, actuators: u64) {
        let actuators = actuators & self.watched;
        self.travelling |= actuators;
        for (index, _) in Bits::of(actuators) {
            if let Some((since, input)) = self.since.get_mut(index).zip(self.input.get(index)) {
                *since = now;
                self.arrived &= !input;
            }
        }
    }

    /// Finds the switch that contradicts its actuator's digit after the time of travel. `seen`: bit `i` is input `i`.
    pub(super) fn check(&mut self, now: Micros, seen: u32, word: &Word, wiring: &Wiring) -> Result<(), FaultKind> {
        for (index, bit) in Bits::of(self.travelling) {
            let Some((actuator, &since)) = wiring.actuators.get(index).zip(self.since.get(index)) else {
                continue;
            };
            if now - since < Micros::from_millis(u32::from(actuator.travel_ms)) {
                continue;
            }
            self.travelling &= !bit;
            if let Some(switch) = actuator.switch {
                let input = 1 << switch.input;
                self.arrived |= input;
                self.closed &= !input;
                self.closed |= u32::from(switch.closed(word.digit(index))) << switch.input;
            }
        }
        let before = self.contradicting;
        self.contradicting = (seen ^ self.closed) & self.arrived;
        for (input, _) in Bits::of(u64::from(self.contradicting)) {
            let Some(ticks) = self.ticks.get_mut(input) else { continue };
            *ticks = if before >> input & 1 == 1 { ticks.saturating_add(1) } else { 1 };
            if *ticks >= BOUNCE_TICKS {
                return self.fault(input, seen, wiring);
            }
        }
        Ok(())
    }

    fn fault(&self, input: usize, seen: u32, wiring: &Wiring) -> Result<(), FaultKind> {
        let at = |switch: crate::output::LimitSwitch| usize::from(switch.input) == input;
        let actuator = wiring.actuators.iter().position(|actuator| actuator.switch.is_some_and(at));
        let [expected_closed, seen_closed] = [self.closed, seen].map(|closed| closed >> input & 1 == 1);
        let actuator = ActuatorId(actuator.unwrap_or_default() as u8);
        Err(FaultKind::Switch { actuator, expected_closed, seen_closed })
    }
}
