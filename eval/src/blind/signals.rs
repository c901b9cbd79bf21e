//! A simulated measurement of signals: torques of a serial arm in motion, or the wrench under a floating base at rest.
//!
//! The nominal torques and weights are those of the model, since that is what is diagnosed; what is added has equations of
//! its own:
//!
//! | mechanism | equation |
//! | --- | --- |
//! | dry friction | c·v/√(v² + v₀²) |
//! | thick grease | d·v/(1 + 0.1·\|v\|/v_max) |
//! | a hose that pulls | c |
//! | a cable that winds up | k·q |
//! | a heavy motor | J·a |
//! | a lump bolted to a link | m·(p̈ − g) by virtual work, p̈ by differences of the forward kinematics |
//! | cogging | c·sin(7·q) |
//! | a joint beside its encoder, a base that is not level | torques of the robot that is so, less those of the model |
//! | torques that are recorded late | τ(t − δ) less τ(t) |
//! | a payload in the second half of the rows | as a lump, on the last link |
//! | a hose that another joint pulls taut, outside the list | c·max(q of the other less the middle of its range, 0)² |
//! | a backpack on a link, held postures | weight of a point, by statics |
//! | a plate that drifts, outside the list | Δ(cop x) = c·sin(2πt/P) |

use darm_measure::csv_text::csv_text;
use std::fmt;
use std::path::Path;

use anyhow::Result;
use darm_diagnose::effect::{LawName, Place, Site};
use darm_measure::root_mean_square;
use darm_measure::table::{Names, Table};
use nalgebra::DMatrix;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::judge::Named;

/// Outliers: share of the rows, in units of the noise.
const OUTLIERS: f64 = 0.02;
const OUTLIER_NOISES: f64 = 60.0;
/// Size of a mechanism on its axis, in units of the noise.
const TIMES_NOISE: std::ops::Range<f64> = 8.0..32.0;
/// Postures and motions reach so far from the middle of each joint's range, rad.
pub(super) const SWING_RAD: f64 = 0.7;
/// Error of a gear, in whatever phase.
pub(super) const PERIODIC: LawName = LawName::GearPeriodicSine;

/// What was added.
pub(super) struct Added {
    /// What is right for it.
    pub(super) cause: Cause,
    /// What it adds on each axis.
    pub(super) shape: Vec<Vec<f64>>,
}

/// What a diagnosis is to find.
pub(super) enum Cause {
    /// A law at a place.
    Law(LawName, Place),
    /// No law: what the residual depends on.
    Variable(String),
}

impl Cause {
    /// The law and its place, where there is one.
    pub(super) fn named(&self) -> Option<Named> {
        match self {
            Self::Law(law, place) => Some((*law, *place)),
            Self::Variable(_) => None,
        }
    }
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Law(law, place) => write!(f, "{law} {place:?}"),
            Self::Variable(name) => f.write_str(name),
        }
    }
}

/// What laws add.
pub(super) trait Elsewhere {
    /// A law's columns, one a value: rows × axes of the run, or of other conditions that were drawn; `None` where that is not
    /// known.
    fn columns(&self, law: LawName, site: &Site, elsewhere: bool) -> Result<Option<DMatrix<f64>>>;
}

/// Names and numbers of channels.
pub(super) struct Channels {
    pub(super) names: Vec<String>,
    pub(super) values: Vec<Vec<f64>>,
}

/// One measurement that is being made.
pub(super) struct Bench {
    /// Columns of the table that are not measured with noise.
    pub(super) names: Vec<String>,
    pub(super) given: Vec<Vec<f64>>,
    /// Those that are, with their noise.
    pub(super) axes: Vec<String>,
    pub(super) measured: Vec<Vec<f64>>,
    pub(super) noise: Vec<f64>,
    pub(super) spoiled: Vec<usize>,
    pub(super) added: Vec<Added>,
    /// Axes of the diagnosis that make the norm, and their noise.
    pub(super) norm_noise: Vec<f64>,
    /// What the model predicts.
    pub(super) nominal: Vec<Vec<f64>>,
    /// What laws add under other conditions.
    pub(super) elsewhere: Option<Box<dyn Elsewhere>>,
}

impl Bench {
    /// A bench on which nothing is added yet: what is given, what the model predicts, its noise, and that of the axes that
    /// make the norm.
    pub(super) fn new(given: Channels, nominal: Channels, noise: Vec<f64>, norm_noise: Vec<f64>) -> Self {
        let Channels { names, values: given } = given;
        let Channels { names: axes, values: nominal } = nominal;
        let (measured, spoiled, added) = (nominal.clone(), Vec::new(), Vec::new());
        Self { names, given, axes, measured, noise, spoiled, added, norm_noise, nominal, elsewhere: None }
    }

    fn rows(&self) -> usize {
        self.given.first().map_or(0, Vec::len)
    }

    /// Adds noise and outliers.
    pub(super) fn spoil(&mut self, rng: &mut ChaCha8Rng) {
        let rows = self.rows();
        for (channel, noise) in self.measured.iter_mut().zip(&self.noise) {
            channel.iter_mut().for_each(|value| *value += noise * normal(rng));
        }
        for row in 0..rows {
            if rng.random_bool(OUTLIERS) {
                let axis = rng.random_range(0..self.measured.len());
                self.measured[axis][row] += OUTLIER_NOISES * self.noise[axis] * normal(rng).signum();
                self.spoiled.push(row);
            }
        }
    }

    pub(super) fn table(&self) -> Result<Table> {
        Ok(Table::read_text(Path::new("blind.csv"), self.text().as_bytes(), &Names::new())?.0)
    }

    /// The table as comma-separated text.
    pub(super) fn text(&self) -> String {
        let distractors = ["temperature_c", "supply_v"].map(str::to_owned);
        let header: Vec<String> = self.names.iter().chain(&self.axes).cloned().chain(distractors).collect();
        let row = |row: usize| -> Vec<String> {
            let numbers = self.given.iter().chain(&self.measured).map(|channel| format!("{:.9}", channel[row]));
            let slow = row as f64 / self.rows() as f64;
            let distractors = [20.0 + 8.0 * slow, 24.0 - (7.0 * slow).sin()].map(|number| format!("{number:.4}"));
            numbers.chain(distractors).collect()
        };
        csv_text(std::iter::once(header).chain((0..self.rows()).map(row)))
    }

    pub(super) fn truth(&self) -> String {
        self.added.iter().map(|added| added.cause.to_string()).collect::<Vec<_>>().join(" + ")
    }

    /// Adds a mechanism of a size that is drawn: `shape` gives it on each axis.
    pub(super) fn add(&mut self, cause: Cause, shape: Vec<Vec<f64>>, rng: &mut ChaCha8Rng) {
        let size = rng.random_range(TIMES_NOISE) / self.in_noise(&shape);
        self.add_as_it_is(cause, shape.into_iter().map(|axis| axis.iter().map(|x| size * x).collect()).collect());
    }

    /// Whether a mechanism changes a channel by its noise at least, root mean square.
    pub(super) fn shows(&self, shape: &[Vec<f64>]) -> bool {
        self.in_noise(shape) >= 1.0
    }

    /// Root mean square of the channel that a mechanism changes most, in units of its noise.
    fn in_noise(&self, shape: &[Vec<f64>]) -> f64 {
        let noises = shape.iter().zip(&self.noise).map(|(column, noise)| root_mean_square(column) / noise);
        noises.fold(f64::MIN_POSITIVE, f64::max)
    }

    /// Adds a mechanism that has its size already.
    pub(super) fn add_as_it_is(&mut self, cause: Cause, shape: Vec<Vec<f64>>) {
        for (channel, column) in self.measured.iter_mut().zip(&shape) {
            channel.iter_mut().zip(column).for_each(|(value, more)| *value += more);
        }
        self.added.push(Added { cause, shape });
    }
}

/// The law, of whatever phase where it is periodic.
pub(super) fn law_of(law: LawName) -> LawName {
    match law {
        LawName::GearPeriodicSine | LawName::GearPeriodicCosine => PERIODIC,
        other => other,
    }
}

/// Standard normal, by the polar method.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    loop {
        let (x, y) = (rng.random_range(-1.0..1.0f64), rng.random_range(-1.0..1.0f64));
        let square = x * x + y * y;
        if square > 0.0 && square < 1.0 {
            return x * (-2.0 * square.ln() / square).sqrt();
        }
    }
}

pub(super) fn middle(limits: Option<[f64; 2]>) -> f64 {
    limits.map_or(0.0, |[low, high]| 0.5 * (low + high))
}
