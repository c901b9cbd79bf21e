//! The laws of `darm_core::effect::basis` as candidates: columns along the rows of a measurement.
//!
//! Constants that no linear fit finds (the speed at which friction falls, the distance over which it turns round) are taken
//! from a few values spread over what the measurement covers, so that they have the measurement's own scale.

use darm_core::effect::basis::{CoordinateSample, Law, Memory, Per};

use crate::effect::Site;
use crate::linearise::experiment::{Candidate, CandidateValue};
use crate::linearise::model_effects::ModelEffect;
use darm_measure::root_mean_square;
use darm_measure::signal::rate;

/// v₀ over the root mean square of v: from a friction that reverses at once, between two rows, to one that hardly does.
const CREEP: [f64; 5] = [0.003, 0.0125, 0.05, 0.2, 0.5];
/// v₀ over the root mean square of v, of friction that wears.
const WEARING_CREEP: f64 = 0.05;
/// v_s over the root mean square of v.
const STRIBECK: [f64; 3] = [0.1, 0.3, 1.0];
/// d over the range of x.
const PRESLIDING: [f64; 5] = [0.002, 0.005, 0.01, 0.03, 0.1];
/// Half widths of hysteresis in shares of the load's range.
const WIDTHS: [f64; 4] = [0.05, 0.1, 0.2, 0.4];
/// Loads that seat a joint in its gap, in shares of the load's range.
const SEATS: [f64; 2] = [0.01, 0.05];
/// Distances of the memory of direction in shares of the target's range.
const DISTANCES: [f64; 3] = [0.02, 0.1, 0.5];
/// Moments of a step, as shares of the time from the first row to the last. On either side there are seven of 24 pieces of rows
/// at least, which distinguish it from an offset at 1 %.
const STEPS: [f64; 5] = [0.3, 0.4, 0.5, 0.6, 0.7];

/// One coordinate along the rows of a measurement.
#[derive(Clone, Copy)]
pub struct Coordinate<'a> {
    /// Position, m or rad.
    pub position: &'a [f64],
    /// Its rate, m/s or rad/s.
    pub velocity: &'a [f64],
    /// The rate of that, m/s² or rad/s².
    pub acceleration: &'a [f64],
    /// What presses on it or drives it, where that is known.
    pub load: Option<&'a [f64]>,
    /// Temperature less its mean, K, where it was measured.
    pub temperature: Option<&'a [f64]>,
    /// When, s.
    pub time_s: &'a [f64],
    /// The stretch of each row: rates do not reach over a border.
    pub series: &'a [usize],
    /// The motion of each row: memory does not reach beyond it.
    pub motion: &'a [usize],
    /// Units of position, force and load: `m`, `N` and `Pa`.
    pub units: [&'static str; 3],
}

/// Largest less smallest.
pub fn range(values: &[f64]) -> f64 {
    let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    (high - low).max(0.0)
}

impl Coordinate<'_> {
    /// Friction of all kinds.
    pub fn friction(&self) -> Vec<Law<f64>> {
        let (usual, stroke) = (root_mean_square(self.velocity).max(1e-12), range(self.position).max(1e-12));
        let mut laws = vec![Law::ViscousFriction];
        laws.extend(CREEP.map(|share| Law::CoulombFriction(share * usual)));
        laws.extend(STRIBECK.map(|share| Law::StribeckFriction(share * usual)));
        let distances = PRESLIDING.map(|share| share * stroke);
        laws.extend(distances.map(Law::PreslidingFriction));
        laws.extend(distances.map(Law::PositionDependentFriction));
        laws.push(Law::FrictionWear(WEARING_CREEP * usual));
        if self.load.is_some() {
            laws.extend(CREEP.map(|share| Law::LoadDependentFriction(share * usual)));
            laws.extend(distances.map(Law::LoadDependentPresliding));
            laws.push(Law::LoadDependentViscosity);
        }
        if self.temperature.is_some() {
            laws.push(Law::ThermalViscosity);
        }
        laws
    }

    /// The laws of a force that are no friction.
    pub fn others(&self) -> Vec<Law<f64>> {
        let mut laws = vec![Law::Offset, Law::Spring, Law::SpeedDependentOffset];
        laws.extend(self.in_time());
        if self.load.is_some() {
            laws.extend([Law::Gain, Law::Delay]);
        }
        laws
    }

    /// Drift, a step, and what temperature moves.
    pub fn in_time(&self) -> Vec<Law<f64>> {
        let length_s = self.time_s.last().map_or(0.0, |last| last - self.start_s());
        let mut laws = vec![Law::OffsetDrift];
        laws.extend(STEPS.map(|share| Law::StepInTime(share * length_s)));
        if self.temperature.is_some() {
            laws.push(Law::ThermalDrift);
        }
        laws
    }

    /// The laws of a motor and its gear, with periodic errors of these periods per turn of the joint.
    pub fn of_motor(&self, periods_a_turn: &[f64]) -> Vec<Law<f64>> {
        let mut laws = vec![Law::RotorInertia];
        for &per_turn in periods_a_turn {
            laws.push(Law::GearPeriodicSine(per_turn));
            laws.push(Law::GearPeriodicCosine(per_turn));
        }
        laws
    }

    /// The laws of a joint that holds a target: `position` is the target.
    pub fn of_holding(&self) -> Vec<Law<f64>> {
        let width = self.load.map_or(0.0, range).max(1e-12);
        let mut laws = self.in_time();
        laws.push(Law::Offset);
        if range(self.position) > 0.0 {
            laws.extend(DISTANCES.map(|share| Law::Backlash(share * range(self.position))));
        }
        if self.load.is_some() {
            laws.push(Law::JointCompliance);
            laws.extend(SEATS.map(|share| Law::BacklashByLoad(share * width)));
            laws.extend(WIDTHS.map(|share| Law::Hysteresis(share * width)));
        }
        laws
    }

    /// Laws at a place, acting on each axis by its share, and with the constants that the model's own effects have.
    pub fn candidates(
        &self,
        mut laws: Vec<Law<f64>>,
        site: &Site,
        shares: &[f64],
        known: &[ModelEffect],
    ) -> Vec<Candidate> {
        for effect in known.iter().filter(|effect| effect.place == site.code && effect.constant.is_some()) {
            laws.extend(Law::named(effect.law, effect.constant).filter(|law| !laws.contains(law)));
        }
        laws.iter().map(|law| self.candidate(law, site, shares)).collect()
    }

    /// A law at a place, acting on each axis by its share.
    fn candidate(&self, law: &Law<f64>, site: &Site, shares: &[f64]) -> Candidate {
        let unit = self.unit(law.per());
        let shape = law.shape_parameter().map(|constant| (constant.name, constant.value, self.dimension(constant.per)));
        let numbers = self.column(law);
        let column = numbers.iter().flat_map(|number| shares.iter().map(move |share| share * number)).collect();
        let value = CandidateValue {
            name: law.coefficient().into(),
            unit,
            prior: f64::INFINITY,
            min: f64::NEG_INFINITY,
            column,
        };
        Candidate { law: law.name(), site: site.clone(), shape, values: vec![value] }
    }

    /// What a size of one adds in each row.
    pub fn column(&self, law: &Law<f64>) -> Vec<f64> {
        let load_rate = self.load.map(|load| rate(load, self.time_s, self.motion));
        let mut memory = Memory::default();
        let at = |k: usize| {
            if k > 0 && self.motion[k] != self.motion[k - 1] {
                memory = Memory::default();
            }
            law.basis(&self.sample(k, load_rate.as_deref()), &mut memory)
        };
        (0..self.position.len()).map(at).collect()
    }

    /// The coordinate in row `k`; `load_rate` is in the unit of the load per second.
    fn sample(&self, k: usize, load_rate: Option<&[f64]>) -> CoordinateSample<f64> {
        CoordinateSample {
            position: self.position[k],
            velocity: self.velocity[k],
            acceleration: self.acceleration[k],
            time_s: self.time_s[k] - self.start_s(),
            load: self.load.map_or(0.0, |load| load[k]),
            load_rate: load_rate.map_or(0.0, |rate| rate[k]),
            temperature_rise_k: self.temperature.map_or(0.0, |temperature| temperature[k]),
        }
    }

    fn start_s(&self) -> f64 {
        self.time_s.first().copied().unwrap_or_default()
    }

    fn dimension(&self, per: Per) -> String {
        let [length, _, load] = self.units;
        match per {
            Per::One => "1".into(),
            Per::Length => length.into(),
            Per::Speed => format!("{length}/s"),
            Per::Acceleration => format!("{length}/s²"),
            Per::Time => "s".into(),
            Per::Load => load.into(),
            Per::LoadRate => format!("{load}/s"),
            Per::Kelvin => "K".into(),
        }
    }

    /// The unit of a size.
    fn unit(&self, per: &[Per]) -> String {
        let [length, force, load] = self.units;
        let divided = |unit: &str, by: &str| match by.contains(['/', '·']) {
            true => format!("{unit}/({by})"),
            false => format!("{unit}/{by}"),
        };
        match per {
            [Per::Acceleration] if (length, force) == ("rad", "N·m") => "kg·m²".into(),
            [Per::LoadRate] if load == force => "s".into(),
            [Per::Load] if load == force => "1".into(),
            _ => per.iter().fold(force.to_string(), |unit, per| divided(&unit, &self.dimension(*per))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::Place;

    #[test]
    fn memory_ends_at_a_border_and_units_are_told() {
        let position = [0.0, 0.1, 0.2, 0.19, 0.1, 0.5];
        let zero = [0.0; 6];
        let coordinate = Coordinate {
            position: &position,
            velocity: &zero,
            acceleration: &zero,
            load: Some(&zero),
            temperature: None,
            time_s: &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0],
            series: &[0, 0, 1, 1, 1, 2],
            motion: &[0, 0, 0, 0, 0, 1],
            units: ["m", "N", "Pa"],
        };
        let law = Law::PreslidingFriction(0.01);
        let state = coordinate.column(&law);
        assert!((state[2] - 1.0).abs() < 1e-4 && (state[4] + 1.0).abs() < 1e-2 && state[5] == 0.0);
        let of = |law| coordinate.candidate(&law, &Site::new(Place::Actuator, "here"), &[1.0]);
        assert_eq!(of(law).shape, Some(("presliding distance", 0.01, "m".into())));
        assert_eq!(of(Law::LoadDependentViscosity).values[0].unit, "N/(m/s)/Pa");
    }
}
