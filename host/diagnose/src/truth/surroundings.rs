//! Supply and temperature of the true arm as they go with time: slow, seeded, and never nominal.
//!
//! The temperature rises from 0.8 of its settled rise with one time constant while the coils warm the arm, and swings
//! by a twentieth. The supply is low, lower still while its reservoir fills, swings, and drops with the number of
//! coils that are fed. For a blind run both swing widely, each by itself.

use std::f64::consts::TAU;

use darm_core::units::Word;
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};

/// Standard deviation of the supply sensor, share of nominal supply.
const SUPPLY_SENSOR: f64 = 2e-4;
/// Standard deviation of the thermometer, K.
const THERMOMETER_K: f64 = 0.05;

/// How supply and temperature go.
#[derive(Clone, Debug, PartialEq)]
pub struct Surroundings {
    nominal_supply: f64,
    reference_temperature_k: f64,
    rise_k: f64,
    warming_s: f64,
    droop: f64,
    filling_s: f64,
    swing: f64,
    load_drop: f64,
    period_s: f64,
    phase: f64,
    warm_swing: f64,
    warm_period_s: f64,
    warm_phase: f64,
}

/// Supply and temperature at one moment, away from nominal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Conditions {
    /// Supply over nominal supply.
    pub(crate) supply_ratio: f64,
    /// Temperature less reference temperature, K.
    pub(crate) rise_k: f64,
}

impl Surroundings {
    pub(crate) fn draw(rng: &mut impl Rng, nominal_supply: f64, reference_temperature_k: f64) -> Self {
        let rise_k = rng.random_range(10.0..18.0);
        let warming_s = rng.random_range(25.0..45.0);
        let droop = rng.random_range(0.07..0.10);
        let filling_s = rng.random_range(15.0..35.0);
        let swing = rng.random_range(0.008..0.012);
        let period_s = rng.random_range(23.0..41.0);
        let phase = rng.random_range(0.0..TAU);
        Self {
            nominal_supply,
            reference_temperature_k,
            rise_k,
            warming_s,
            droop,
            filling_s,
            swing,
            load_drop: 0.02,
            period_s,
            phase,
            warm_swing: 0.05,
            warm_period_s: period_s,
            warm_phase: phase,
        }
    }

    /// Surroundings with wide swings of supply and temperature that have nothing to do with each other.
    pub(crate) fn draw_wide(rng: &mut impl Rng, nominal_supply: f64, reference_temperature_k: f64) -> Self {
        let settled = Self::draw(rng, nominal_supply, reference_temperature_k);
        Self {
            swing: rng.random_range(0.03..0.05),
            warm_swing: rng.random_range(0.3..0.5),
            warm_period_s: rng.random_range(29.0..53.0),
            warm_phase: rng.random_range(0.0..TAU),
            ..settled
        }
    }

    pub(crate) fn at(&self, time_s: f64, word: &Word) -> Conditions {
        let turn = (TAU * time_s / self.period_s + self.phase).sin();
        let moment = self.settled(word);
        let warm_turn = (TAU * time_s / self.warm_period_s + self.warm_phase).sin();
        let warming = 1.0 - 0.2 * (-time_s / self.warming_s).exp() + self.warm_swing * warm_turn;
        let filling = 0.25 * self.droop * (-time_s / self.filling_s).exp();
        Conditions { supply_ratio: moment.supply_ratio - filling + self.swing * turn, rise_k: moment.rise_k * warming }
    }

    /// What it all comes to in the mean.
    pub(crate) fn settled(&self, word: &Word) -> Conditions {
        let fed = word.iter().filter(|&digit| digit > 0).count() as f64 / word.len().max(1) as f64;
        Conditions { supply_ratio: 1.0 - self.droop - self.load_drop * (fed - 0.5), rise_k: self.rise_k }
    }

    /// Supply and temperature (K) as the sensors measure them.
    pub(crate) fn sensed(&self, time_s: f64, word: &Word, rng: &mut impl Rng) -> (f64, f64) {
        let moment = self.at(time_s, word);
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let supply = self.nominal_supply * (moment.supply_ratio + SUPPLY_SENSOR * normal());
        (supply, self.reference_temperature_k + moment.rise_k + THERMOMETER_K * normal())
    }
}
