//! What a diagnosis of channels says: plain data in the shape of the JSON report.
//!
//! | key | meaning |
//! | --- | --- |
//! | `kind` | what was observed: `actuator-force`, `joint-position`, `joint-torque`, `contact-wrench`, `closure` |
//! | `rows.train`, `rows.heldout` | rows that fits saw, and rows that nothing saw |
//! | `held_out`, `left_out` | how the latter were chosen; what cross-validation leaves out together |
//! | `repeatability` | scatter of rows under the very same conditions, or null where there are few of them |
//! | `error.before`, `error.after` | root mean square of predicted minus measured on `train` and `heldout`: each axis, and the norm |
//! | `verdict` | `effect-found`, `no-effect`, `unexplained-structure`, `not-identifiable` |
//! | `effects` | law, where, values with unit and 95 % interval, by how much the held-out norm grows without it |
//! | `alternatives` | what would do as well in an effect's place |
//! | `unobservable` | values that these rows do not tell: no number is given |
//! | `remaining` | channels that what remains of an axis depends on, and how, with no law behind them; `heldout_gain` is the fall of that axis's error, `curve` what remains along the channel |
//! | `outliers` | rows that fit nothing, by line |
//! | `next_measurement` | `rows` (line of this file, `conditions` by channel) that would tell alternatives apart, and `tells`; or null |

use std::collections::BTreeMap;

use serde::Serialize;

use crate::linearise::model_effects::Known;
use crate::outcome::{self, AxisFigure, Rows, Rung, Verdict};

/// What was found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Diagnosis {
    /// What was observed.
    pub kind: &'static str,
    /// How many rows there were.
    pub rows: Rows,
    /// How held-out rows were chosen.
    pub held_out: String,
    /// What cross-validation leaves out together.
    pub left_out: &'static str,
    /// Scatter of rows under the very same conditions: root mean square of the norm.
    pub repeatability: Option<Number>,
    /// Predicted minus measured, of the model as it was and with the effects found.
    pub error: BeforeAfter,
    /// The verdict.
    pub verdict: Verdict,
    /// The effects found, in the order in which they were.
    pub effects: Vec<Found>,
    /// What would do as well in their place.
    pub alternatives: Vec<Alternative>,
    /// Values that these rows do not tell.
    pub unobservable: Vec<String>,
    /// Terms without a law that still lower the error.
    pub remaining: Vec<Term>,
    /// Rows that fit nothing.
    pub outliers: Vec<Outlier>,
    /// What to measure next.
    pub next_measurement: Option<NextMeasurement>,
    /// The same for a person, a sentence each.
    pub plain: Vec<String>,
    /// What the owner of the data should know.
    pub findings: Vec<String>,
    /// Everything that was tried.
    pub ladder: Vec<Rung>,
    /// Residuals of each row for plots.
    pub points: Vec<Point>,
    /// Of whatever is drawn by chance; nothing is.
    pub seed: u64,
    /// Of this program.
    pub version: &'static str,
    /// What the model holds with what was found: all values, those that are not told among them.
    #[serde(skip)]
    pub(crate) model_effects: Vec<Known>,
}

impl Diagnosis {
    /// Keeps the terms without a law in the model, as what they are; whether there are any.
    pub fn keep_terms(&mut self) -> bool {
        let n_effects = self.model_effects.len();
        self.model_effects.extend(self.remaining.iter().filter(|term| !term.curve.is_empty()).map(Known::fitted));
        self.model_effects.len() > n_effects
    }
}

/// Rows that would tell explanations apart.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NextMeasurement {
    /// Conditions to measure once more, the most telling first.
    pub rows: Vec<NextRow>,
    /// What they tell apart.
    pub tells: String,
}

/// One row to measure once more.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NextRow {
    /// The line of this measurement that had the same conditions.
    pub line: usize,
    /// What the channels were, in SI units and radians.
    pub conditions: BTreeMap<String, f64>,
}

/// A number with its unit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Number {
    /// The number.
    pub value: f64,
    /// Its unit.
    pub unit: String,
}

/// Errors of two models, axis by axis.
pub type BeforeAfter = outcome::BeforeAfter<Figure>;

/// Errors of one model, axis by axis.
pub type Errors = outcome::Errors<Figure>;

/// Root mean squares of an error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figure {
    /// Of each axis.
    pub axes: Vec<AxisFigure>,
    /// Of the axes that share the first one's unit, together.
    pub norm: Number,
}

/// An effect found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Found {
    /// The law.
    pub law: &'static str,
    /// Where it acts.
    #[serde(rename = "where")]
    pub place: String,
    /// Its values that these rows tell.
    pub parameters: Vec<Parameter>,
    /// By how much the held-out norm is larger without it.
    pub heldout_gain: Option<f64>,
}

/// One value.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// The value.
    pub value: f64,
    /// Its unit.
    pub unit: String,
    /// With 95 % confidence it lies in here; `None` of a number that was chosen and not fitted.
    pub ci95: Option<[f64; 2]>,
}

/// Another explanation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Alternative {
    /// Number of the effect whose place it could take.
    pub instead_of: usize,
    /// The law.
    pub law: &'static str,
    /// Where it acts.
    #[serde(rename = "where")]
    pub place: String,
    /// Confidence that it is worse.
    pub worse_with: f64,
}

/// A fitted term.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Term {
    /// The axis of the residual.
    pub axis: String,
    /// What it depends on, and how.
    pub term: String,
    /// The channel of `curve`.
    #[serde(skip)]
    pub(crate) channel: String,
    /// Share of the remaining mean square of the axis that it takes up.
    pub share: f64,
    /// By how much the held-out error of the axis is smaller with it.
    pub heldout_gain: Option<f64>,
    /// The channel, in SI units and radians, and what remains there; empty of a term of several channels.
    pub curve: Vec<[f64; 2]>,
}

/// A row that fits nothing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Outlier {
    /// Its line in the file, the header being 1.
    pub line: usize,
    /// How far it is off, in units of the noise.
    pub sigmas: f64,
}

/// One row in the plots.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Point {
    /// When.
    pub time_s: f64,
    /// Whether the fit did not see it.
    pub held_out: bool,
    /// The residual's axes before.
    pub before: Vec<f64>,
    /// The same after.
    pub after: Vec<f64>,
}
