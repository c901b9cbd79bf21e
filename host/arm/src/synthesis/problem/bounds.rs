//! The bounds of the unknowns: linear inequalities on stops, anchors and servo angles.

use darm_core::chain::Parameter;
use nalgebra::DVector;
use rand::{Rng, RngExt as _};

use super::Problem;
use super::parameters::{is_leg, turns};
use crate::arm::frames::StopRange;
use crate::synthesis::Bounds;

/// What one linear inequality on the unknowns says: the sum of the terms is at least this.
#[derive(Clone, Debug)]
pub(in crate::synthesis) struct Bound {
    /// Unknown and factor.
    pub(in crate::synthesis) terms: Vec<(usize, f64)>,
    pub(in crate::synthesis) min: f64,
}

/// What one unknown may be, and its difference from the state before it.
#[derive(Clone, Copy)]
struct Limits {
    value: (f64, f64),
    stroke: (f64, f64),
}

impl Bound {
    /// By how much the bound is kept; below zero it is broken.
    pub(in crate::synthesis) fn slack(&self, unknowns: &DVector<f64>) -> f64 {
        self.terms.iter().map(|&(index, factor)| factor * unknowns[index]).sum::<f64>() - self.min
    }
}

impl Problem<'_> {
    /// The unknowns with every bound that rounding broke kept exactly, so that the stops of an actuator are in order. What
    /// is broken by more than `rounding` stays.
    pub(in crate::synthesis) fn without_rounding(&self, mut unknowns: DVector<f64>, rounding: f64) -> DVector<f64> {
        let (single, between): (Vec<_>, Vec<_>) = self.bounds.iter().partition(|bound| bound.terms.len() == 1);
        // The order of two states comes last: a file with stops out of order cannot be read.
        for bound in single.into_iter().chain(between) {
            let slack = bound.slack(&unknowns);
            if let (true, Some(&(index, factor))) = (slack < 0.0 && slack > -rounding, bound.terms.first()) {
                unknowns[index] -= slack / factor;
            }
        }
        unknowns
    }

    /// `from` with every unknown that has two bounds drawn between them; strokes may be broken.
    pub(in crate::synthesis) fn anywhere(&self, from: &DVector<f64>, rng: &mut impl Rng) -> DVector<f64> {
        let mut ranges = vec![(f64::NEG_INFINITY, f64::INFINITY); from.len()];
        for bound in &self.bounds {
            let [(index, factor)] = bound.terms[..] else { continue };
            let (end, (low, high)) = (bound.min / factor, &mut ranges[index]);
            if factor > 0.0 { *low = low.max(end) } else { *high = high.min(end) }
        }
        let drawn = from.iter().zip(ranges).map(|(&value, (low, high))| {
            if (high - low).is_finite() && low < high { rng.random_range(low..high) } else { value }
        });
        DVector::from_iterator(from.len(), drawn)
    }

    pub(super) fn bound_stops(&mut self, bounds: &Bounds, ranges: &[StopRange]) {
        let mut limits: Vec<Limits> =
            self.stops.iter().enumerate().map(|(index, stop)| self.limits_of(index, stop, bounds, ranges)).collect();
        // The stroke to a neighbour is the only inequality of two unknowns. What it leaves of the neighbour's range is taken
        // into the own one: bounds that are kept as equations then never contradict each other.
        let follows = |index: usize| matches!(self.stops[index], Parameter::Stop { state, .. } if state > 0);
        for index in (1..limits.len()).filter(|index| follows(*index)) {
            let (before, stroke) = (limits[index - 1].value, limits[index].stroke);
            let value = &mut limits[index].value;
            *value = (value.0.max(before.0 + stroke.0), value.1.min(before.1 + stroke.1));
        }
        for index in (1..limits.len()).rev().filter(|index| follows(*index)) {
            let Limits { value: after, stroke } = limits[index];
            let value = &mut limits[index - 1].value;
            *value = (value.0.max(after.0 - stroke.1), value.1.min(after.1 - stroke.0));
        }
        for (index, Limits { value, stroke }) in limits.into_iter().enumerate() {
            let mut bound = |terms: &[(usize, f64)], min: f64| {
                if min.is_finite() {
                    self.bounds.push(Bound { terms: terms.to_vec(), min });
                }
            };
            if matches!(self.stops[index], Parameter::Stop { state, .. } if state > 0) {
                bound(&[(index, 1.0), (index - 1, -1.0)], stroke.0);
                bound(&[(index - 1, 1.0), (index, -1.0)], -stroke.1);
            }
            bound(&[(index, 1.0)], value.0);
            bound(&[(index, -1.0)], -value.1);
        }
    }

    fn limits_of(&self, index: usize, stop: &Parameter, bounds: &Bounds, ranges: &[StopRange]) -> Limits {
        let Parameter::Stop { actuator, state } = *stop else {
            let here = self.start[index];
            return Limits {
                value: (here - bounds.anchor_m, here + bounds.anchor_m),
                stroke: (f64::NEG_INFINITY, f64::INFINITY),
            };
        };
        let states = self.base_line.model.chain.n_states(actuator.into());
        let (min, max) = if turns(self.base_line, stop) {
            (-bounds.turn_rad, bounds.turn_rad)
        } else if is_leg(self.base_line, stop) {
            let (short, long) = (index - usize::from(state), index - usize::from(state) + states - 1);
            (bounds.shortest * self.start[short], bounds.longest * self.start[long])
        } else {
            (f64::NEG_INFINITY, f64::INFINITY)
        };
        let is_own =
            |range: &&StopRange| range.actuator == usize::from(actuator) && range.state.is_none_or(|own| own == state);
        let (mut value, mut stroke) = ((min, max), (bounds.stroke, f64::INFINITY));
        for range in ranges.iter().filter(is_own) {
            value = (value.0.max(range.value.0), value.1.min(range.value.1));
            stroke = (stroke.0.max(range.stroke.0), stroke.1.min(range.stroke.1));
        }
        Limits { value, stroke }
    }

    pub(super) fn bound_servos(&mut self) {
        for index in self.n_stops()..self.start.len() {
            let servo = (index - self.n_stops()) % self.n_servos;
            if let Some(servo) = self.base_line.servos.get(servo) {
                self.bounds.push(Bound { terms: vec![(index, 1.0)], min: servo.min_rad.into() });
                self.bounds.push(Bound { terms: vec![(index, -1.0)], min: (-servo.max_rad).into() });
            }
        }
    }
}
