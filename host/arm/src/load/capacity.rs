//! What an arm can carry: the largest payload at which every actuator stays on its stop in every word.
//!
//! An actuator in its first state is pressed on its stop by compression, in its last state by tension; then the stop bears the
//! load. Any other load is borne by what the actuator gives: compression by its push, tension by its pull.
//!
//! The share that is used of an actuator is linear in the payload for one word, so the largest share over all words is convex
//! in it. From a payload that is too large, Newton's method on the worst word comes down to the largest possible one without
//! passing it, in as many steps as there are worst words on the way.

use darm_core::chain::ChainError;

use super::{Laden, Load, LoadError, LoadRange, PRECISION};
use crate::arm::{Arm, Strength};

/// A payload that no arm carries, kg.
const TOO_MUCH_KG: f64 = 1e6;

/// How much is used of what an actuator gives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Usage {
    /// The actuator.
    pub actuator: usize,
    /// What it bears, and in which word.
    pub load: Load,
    /// What it gives against that, N or N·m, above zero.
    pub gives: f64,
}

impl Usage {
    /// The share that is used.
    pub fn share(&self) -> f64 {
        self.load.force.abs() / self.gives
    }
}

/// What an arm carries in addition to its tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Capacity {
    /// It does not carry itself: an actuator without a payload.
    Overloaded(Usage),
    /// Up to this mass, and the actuator that gives all at it.
    UpTo {
        /// The mass, kg.
        payload_kg: f64,
        /// The actuator that is used the most.
        worst: Usage,
    },
    /// The payload loads no actuator off its stop.
    Unlimited,
}

/// The actuator of which the most is used over all words, of those that the arm file says the strength of.
pub fn worst(arm: &Arm, ranges: &[Vec<Option<LoadRange>>]) -> Option<Usage> {
    let usages = ranges.iter().enumerate().flat_map(|(actuator, states)| {
        let of_state = move |(digit, range): (usize, &Option<LoadRange>)| {
            let LoadRange { smallest, largest } = (*range)?;
            let usages = [largest, smallest].into_iter().filter_map(|load| usage(arm, actuator, digit, load));
            usages.max_by(|a, b| a.share().total_cmp(&b.share()))
        };
        states.iter().enumerate().filter_map(of_state)
    });
    usages.max_by(|a, b| a.share().total_cmp(&b.share()))
}

/// How much is used of an actuator in the state `digit`; `None` where its stop bears the load, or where the arm file does not say
/// what the actuator gives.
pub fn usage(arm: &Arm, actuator: usize, digit: usize, load: Load) -> Option<Usage> {
    let [push, pull] = gives(arm, actuator)?;
    let last = arm.model.chain.n_states(actuator).saturating_sub(1);
    let gives = match load.force > 0.0 {
        true if digit > 0 => push,
        false if digit < last => pull,
        _ => return None,
    };
    Some(Usage { actuator, load, gives })
}

/// What an actuator pushes and pulls with at the supply that the arm works at, N or N·m.
pub fn gives(arm: &Arm, actuator: usize) -> Option<[f64; 2]> {
    let strength: Option<&Strength> = arm.strengths.get(actuator)?.as_ref();
    strength.map(|strength| strength.push_and_pull(arm.model.working_supply))
}

impl Laden<'_> {
    /// What the arm carries, whatever the payload of `self` is; `None` where the arm file does not say what any actuator gives.
    ///
    /// # Errors
    ///
    /// As [`ranges`](Self::ranges).
    pub fn capacity(&self) -> Result<Option<Capacity>, LoadError> {
        if self.arm.strengths.iter().all(Option::is_none) {
            return Ok(None);
        }
        let search = self.search()?;
        let too_much = |payload_kg: f64| {
            let ranges = Self { payload_kg, ..self.clone() }.ranges_in(&search)?;
            Ok::<_, LoadError>(worst(self.arm, &ranges).filter(|worst| worst.share() > 1.0 + PRECISION))
        };
        if let Some(worst) = too_much(0.0)? {
            return Ok(Some(Capacity::Overloaded(worst)));
        }
        let (mut payload_kg, mut found) = (TOO_MUCH_KG, Capacity::Unlimited);
        while let Some(worst) = too_much(payload_kg)? {
            let less_kg = self.payload_of_all(&worst, payload_kg)?;
            found = Capacity::UpTo { payload_kg: less_kg, worst: self.at(less_kg, &worst)? };
            if less_kg >= payload_kg {
                break;
            }
            payload_kg = less_kg;
        }
        Ok(Some(found))
    }

    /// What the word of a usage needs of its actuator at another payload.
    fn at(&self, payload_kg: f64, usage: &Usage) -> Result<Usage, ChainError> {
        let word = usage.load.word;
        let force = Self { payload_kg, ..self.clone() }.loads(&word)?[usage.actuator];
        Ok(Usage { load: Load { force, word }, ..*usage })
    }

    /// The payload at which a word needs all that an actuator gives; it needs more at `payload_kg`.
    fn payload_of_all(&self, usage: &Usage, payload_kg: f64) -> Result<f64, ChainError> {
        let (without, with) = (self.at(0.0, usage)?.load.force, usage.load.force);
        let all = usage.gives.copysign(with);
        Ok((payload_kg * (all - without) / (with - without)).max(0.0))
    }
}
