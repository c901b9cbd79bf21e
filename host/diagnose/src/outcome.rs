//! What a diagnosis says: plain data in the shape of the JSON report, the same for all kinds of measurement.
//!
//! Numbers are in SI units and radians; every number has its unit next to it or in its name.
//!
//! | key | meaning |
//! | --- | --- |
//! | `kind` | what was measured: `tool-pose`, `actuator-force`, `joint-position`, `joint-torque`, `contact-wrench`, `tool-position`, `point-contact` |
//! | `rows.train`, `rows.held_out` | rows that fits saw, and rows that no fit has seen |
//! | `held_out`, `left_out` | how the latter were chosen; what cross-validation leaves out together |
//! | `cross_validated` | whether the rows of `held_out` were left out in turn and chose the effects, so that no row is held out for good |
//! | `repeatability` | scatter of repeated conditions with its degrees of freedom, or null where too little is repeated |
//! | `noise_known` | whether the noise is known well enough to say that nothing else is left |
//! | `more_left` | whether more than noise is left with the effects that are named |
//! | `error.before`, `error.after` | root mean square of predicted minus measured on `train` and `held_out`: each axis, and the norm |
//! | `verdict` | `effect-found`, `partly-explained`, `no-effect`, `unexplained-structure`, `not-identifiable`, `too-little-data`, `wrong-model-or-log` |
//! | `other_reading` | of a wrong model or log: how it agrees, and the error then; null where no reading that was tried does |
//! | `effects` | law, where, values with unit and 95 % interval, by how much the held-out norm grows without it |
//! | `alternatives` | what would explain the rows as well in an effect's place |
//! | `unobservable` | values that these rows do not identify, without numbers |
//! | `unconfirmed` | effects that the errors after rest on too, and that these rows do not confirm each by itself |
//! | `structure`, `remaining` | what the residual depends on before and after |
//! | `outliers` | rows that no model explains, by line |
//! | `next_measurement` | what to measure to distinguish alternatives, or null |
//! | `selection_path`, `condition` | every effect that was tried; condition number of the information, of tool poses |
//! | `rejected` | effects that the user rejected, with the reasons: they were no candidates |
//! | `plain`, `findings` | the sentences of the report; what was found in the table, by line and column |
//! | `points` | residuals of rows, for plots |
//! | `seed`, `version` | of the shuffling into folds; of this program |

mod structure;

use std::collections::BTreeMap;
use std::fmt;

pub use crate::number::Number;
use serde::Serialize;

pub use crate::effect::{Effect, EffectValue};
use crate::effect::{LawName, Site, as_str};
pub use crate::measured::Measured;
pub use crate::misreading::Misreading;
pub use crate::rejection::Rejection;
pub use crate::select::forward::SelectionStep;
use darm_measure::{Finding, FindingKind};
pub use structure::{Dependence, Regressor, Shape, Structure};

/// What was found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Diagnosis {
    /// What was measured.
    pub kind: Measured,
    /// Number of the arm's model that was diagnosed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<u32>,
    /// How many rows there were.
    pub rows: Rows,
    /// How the rows were chosen that the fit did not see.
    pub held_out: String,
    /// Whether these rows were seen by fits, each left out in turn, and chose the effects: the error on them is cross-validated, not held
    /// out.
    #[serde(rename = "cross_validated")]
    pub is_cross_validated: bool,
    /// What cross-validation leaves out together.
    pub left_out: &'static str,
    /// Scatter of repeated conditions; `None` where too little is repeated.
    pub repeatability: Option<Repeatability>,
    /// Whether the noise is known well enough to say that nothing else is left.
    #[serde(rename = "noise_known")]
    pub is_noise_known: bool,
    /// Whether more than noise is left with the effects selected.
    #[serde(rename = "more_left")]
    pub is_more_left: bool,
    /// Predicted minus measured, of the model as it was and with the effects found.
    pub error: BeforeAfter,
    /// The verdict.
    pub verdict: Verdict,
    /// Of a wrong model or log: the reading under which they agree; `None` where none that was tried does.
    pub other_reading: Option<OtherReading>,
    /// The effects that are named.
    pub effects: Vec<Effect>,
    /// What explains the measurements as well as an effect found does.
    pub alternatives: Vec<Alternative>,
    /// Values that these measurements do not identify.
    pub unobservable: Vec<String>,
    /// Effects that the errors after rest on too and that a corrected model holds, though these measurements do not confirm
    /// each by itself.
    pub unconfirmed: Vec<String>,
    /// Rows that no model explains.
    pub outliers: Vec<Outlier>,
    /// What the residual depends on before any effect is added; not looked for in signals.
    pub structure: Option<Structure>,
    /// What it depends on with the effects found.
    pub remaining: Structure,
    /// Everything that was tried.
    pub selection_path: Vec<SelectionStep>,
    /// Condition number of the information about all values found, each scaled to its own; not computed for signals.
    pub condition: Option<f64>,
    /// What to measure to distinguish alternatives; `None` where there are none.
    pub next_measurement: Option<NextMeasurement>,
    /// The outcome for a person, a sentence each.
    pub plain: Vec<String>,
    /// Effects that the user rejected: they were no candidates.
    pub rejected: Vec<Rejection>,
    /// What the owner of the data should know.
    pub findings: Vec<Finding>,
    /// Residuals of each row for plots.
    pub points: Vec<Point>,
    /// Of the shuffling of words into folds.
    pub seed: u64,
    /// Of this program.
    pub version: &'static str,
}

impl Diagnosis {
    /// Whether what is left follows something that was recorded.
    fn has_clue(&self) -> bool {
        self.remaining.depends_on.iter().any(|one| one.regressor != Regressor::Condition)
    }

    /// What the rows are that the errors beside those of the fitted rows are on: `held out`, or `left out` in turn where each of them has
    /// chosen the effects as well.
    pub fn unseen(&self) -> &'static str {
        if self.is_cross_validated { "left out" } else { "held out" }
    }

    /// What a person does next: first about conditions that were not read, then what the verdict asks for.
    pub fn next_step(&self) -> String {
        let unread = self.findings.iter().filter(|finding| finding.kind == FindingKind::UnreadCondition);
        let columns: Vec<&str> = unread.filter_map(|finding| finding.column.as_deref()).collect();
        let step = match self.verdict {
            Verdict::PartlyExplained if !self.is_more_left => {
                "write the corrected model, and record again with some of the rows repeated: only that shows whether another cause is \
                 left."
            }
            Verdict::PartlyExplained if !self.has_clue() => {
                "write the corrected model; another cause is left, which follows nothing that was recorded: record again what else \
                 changes, such as temperature, supply or load."
            }
            Verdict::NotIdentifiable if self.next_measurement.is_none() => {
                "look at the robot which of the candidates it has, and exclude the others with --reject: no motion distinguishes them."
            }
            Verdict::UnexplainedStructure if !self.has_clue() => {
                "record again what else changes, such as time, temperature, supply or load: what is left follows nothing that was \
                 recorded."
            }
            verdict => verdict.next_step(),
        };
        match &columns[..] {
            [] => step.into(),
            columns => format!(
                "give {} a unit and diagnose again: no effect of what was not read is tested. With the columns read so far: {step}",
                columns.join(" and ")
            ),
        }
    }
}

/// The answer in one word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The effects named explain what was beyond a known noise.
    EffectFound,
    /// The effects named are there, and more than noise is left beside them, or how large the noise is is not known.
    PartlyExplained,
    /// There is nothing beyond a known noise.
    NoEffect,
    /// There is something beyond the noise that no law explains.
    UnexplainedStructure,
    /// Several explanations are as good as each other: none of them is named.
    NotIdentifiable,
    /// Nothing was found, and what these rows cannot show is not known.
    TooLittleData,
    /// The model is not that of what was measured, or the log is not read as it was written.
    WrongModelOrLog,
}

impl Verdict {
    /// Whether effects are named that belong in the model.
    pub fn names_effects(self) -> bool {
        matches!(self, Self::EffectFound | Self::PartlyExplained)
    }

    /// What a person does next.
    pub fn next_step(self) -> &'static str {
        match self {
            Self::EffectFound => {
                "write the corrected model, make the next table from it, and record again: the error should be near the \
                 repeatability."
            }
            Self::PartlyExplained => {
                "write the corrected model, and look below at what the residual correlates with: another cause is left."
            }
            Self::NoEffect => "keep the model: these measurements show nothing that it is missing.",
            Self::UnexplainedStructure => {
                "look below at what the residual correlates with, and record again with that quantity measured or varied."
            }
            Self::NotIdentifiable => "measure what is proposed: it distinguishes the candidates.",
            Self::TooLittleData => "record again, with more rows and with some of them repeated.",
            Self::WrongModelOrLog => "correct the model or the log, and diagnose again.",
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::EffectFound => "effect-found",
            Self::PartlyExplained => "partly-explained",
            Self::NoEffect => "no-effect",
            Self::UnexplainedStructure => "unexplained-structure",
            Self::NotIdentifiable => "not-identifiable",
            Self::TooLittleData => "too-little-data",
            Self::WrongModelOrLog => "wrong-model-or-log",
        })
    }
}

/// A reading of model and log other than the one that was given.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OtherReading {
    /// What would have to be so.
    #[serde(flatten)]
    pub misreading: Misreading,
    /// The error of the log as it is read, where it is of other axes than those of the norm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub as_read: Option<Number>,
    /// The error of the model as it is, in that reading; of signals with all laws fitted, in turn.
    pub error: Number,
}

/// Numbers of rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Rows {
    /// That the fit saw.
    pub train: usize,
    /// That it did not.
    pub held_out: usize,
}

/// Scatter of repeated conditions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Repeatability {
    /// Standard deviation of the norm.
    pub norm: Number,
    /// Standard deviation of each axis.
    pub axes: Vec<AxisFigure>,
    /// Degrees of freedom that it rests on, per axis.
    pub dof: usize,
    /// What the scatter is of.
    pub repeated_in: RepeatedIn,
}

/// What a repeatability is the scatter of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum RepeatedIn {
    /// Rows under the same conditions.
    Rows,
    /// Each row and its neighbours in time.
    Neighbours,
}

/// Errors of two models.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BeforeAfter {
    /// Of the model as it was.
    pub before: Errors,
    /// With the effects found.
    pub after: Errors,
}

/// Errors of one model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Errors {
    /// On the rows that the fit saw.
    pub train: ErrorFigure,
    /// On the rows that it did not see; `None` where none were held out.
    pub held_out: Option<ErrorFigure>,
}

impl Errors {
    /// On rows that no fit has seen; on those that it saw where none were held out.
    pub fn held_out_or_train(&self) -> &ErrorFigure {
        self.held_out.as_ref().unwrap_or(&self.train)
    }
}

/// Root mean squares of an error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ErrorFigure {
    /// Of each axis.
    pub axes: Vec<AxisFigure>,
    /// Of poses the distance d, m; of signals the axes that share the first one's unit, together.
    pub norm: Number,
    /// The largest norm of a row.
    pub largest: Number,
    /// The norm without the hundredth of the rows that is farthest off, at least one: a bad row decides nothing in it.
    pub without_farthest: Number,
}

/// One number of one axis.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AxisFigure {
    /// Its name: of a tool pose `x`, `y`, `z` or `about x`, ….
    pub axis: String,
    /// The number.
    pub value: f64,
    /// Its unit.
    pub unit: &'static str,
}

impl AxisFigure {
    /// Of a component of a twist, ω first: rad or m.
    pub(crate) fn of_twist(component: usize, value: f64) -> Self {
        Self { axis: axis_name(component).into(), value, unit: if component < 3 { "rad" } else { "m" } }
    }
}

/// The name of a component of a twist, ω first.
pub(crate) fn axis_name(component: usize) -> &'static str {
    ["about x", "about y", "about z", "x", "y", "z"][component]
}

/// Another explanation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Alternative {
    /// Number of the effect, among those that explain the measurements best, whose place it could take.
    pub instead_of: usize,
    /// The law.
    #[serde(serialize_with = "as_str")]
    pub law: LawName,
    /// Where it acts.
    #[serde(flatten)]
    pub site: Site,
    /// Cross-validated error with it, in the unit of the norm.
    pub cross_validated: f64,
    /// Confidence that it is worse than the best one.
    pub worse_with: f64,
}

/// A row that no model explains.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Outlier {
    /// Its line in the file, the header being 1.
    pub line: usize,
    /// The norm of its error.
    pub error: Number,
    /// The norm of its error in units of the noise.
    pub sigmas: f64,
}

/// A measurement that would distinguish explanations.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NextMeasurement {
    /// Of an arm: words to visit in this order.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub words: Vec<String>,
    /// Under which conditions, where those of this measurement would not do.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub conditions: Option<String>,
    /// Of signals: rows whose conditions to repeat, the most informative first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub rows: Vec<NextRow>,
    /// What it distinguishes.
    pub distinguishes: String,
}

/// One row to repeat.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NextRow {
    /// The line of this measurement that had the same conditions.
    pub line: usize,
    /// What the signals were, in SI units and radians.
    pub conditions: BTreeMap<String, f64>,
}

/// One row in the plots.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Point {
    /// When.
    pub time_s: f64,
    /// Whether the fit did not see it.
    pub held_out: bool,
    /// The residual's axes before, in the order of the error's axes.
    pub before: Vec<f64>,
    /// The residual's axes with the effects found.
    pub after: Vec<f64>,
    /// The visit of an arm.
    #[serde(flatten)]
    pub visit: Option<Visit>,
}

/// The visit of a word by an arm.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Visit {
    /// The word.
    pub word: String,
    /// Positions of the servo joints, rad or m.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub servos_rad: Vec<f64>,
    /// Supply, Pa.
    pub supply_pa: Option<f64>,
    /// Temperature.
    pub temperature_c: Option<f64>,
    /// Distance d between predicted and measured pose of the model as it was, m.
    pub before_m: f64,
    /// Distance d of the model with the effects found, m.
    pub after_m: f64,
}
