//! One measured experiment in numbers: residuals of the model as it is, and how each effect that may be missing moves them.

use darm_core::actuator::JointKind;
use darm_robot::robot::RobotJoint;

use crate::effect::{LawName, Place, Site};
use crate::measured::Measured;
use crate::prepare::groups::SignalRow;
use crate::prepare::signals::Prepared;
use darm_measure::Finding;

/// What one axis of a residual is.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: &'static str,
    /// Of an axis whose rows repeat each other, its noise as a multiple of that of the axes of the norm; it is fitted, and
    /// proves nothing by itself. `None`: each row is a group by itself, and the residuals give the noise.
    pub noise_if_repeated: Option<f64>,
}

/// One value of an effect.
#[derive(Clone, Debug, PartialEq)]
pub struct CandidateValue {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// How large it may be before anything is measured (standard deviation); infinite where nothing is known.
    pub prior: f64,
    /// The least change of it that is possible; −∞ where any is.
    pub min: f64,
    /// How the residuals move with it: rows × axes.
    pub column: Vec<f64>,
}

/// A law at a place, which may be missing in the model.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The law.
    pub law: LawName,
    /// Where it acts.
    pub site: Site,
    /// A number that the law has and no fit changes: its name, value and unit.
    pub shape: Option<(&'static str, f64, String)>,
    /// What a fit determines.
    pub values: Vec<CandidateValue>,
}

/// The ten inertial parameters of a body as its model has them, and the candidate that may change them.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyCandidate {
    /// Index of the candidate, whose values are changes of these numbers in this order.
    pub candidate: usize,
    /// m, m·c, and I about the frame's origin (xx, xy, yy, xz, yz, zz).
    pub nominal: [f64; 10],
}

/// How residuals depart from their columns where values are not small. All values in, rows × axes out.
#[derive(Default)]
pub enum Curvature {
    /// They do not: residuals are linear in all values.
    #[default]
    None,
    /// The residuals, and a column for each value, at these values.
    Relinearise(Box<Relinearise>),
    /// What these values add beyond the columns, which change little; `None` where it is nothing.
    Beyond(Box<Beyond>),
}

/// See [`Curvature::Relinearise`].
pub type Relinearise = dyn Fn(&[f64]) -> (Vec<f64>, Vec<Vec<f64>>) + Send + Sync;
/// See [`Curvature::Beyond`].
pub type Beyond = dyn Fn(&[f64]) -> Option<Vec<f64>> + Send + Sync;

/// The columns of a table that an experiment reads.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TableColumns {
    /// What is predicted: groups whose signs or names a log may have confused as one.
    pub(crate) measured: Vec<Vec<String>>,
    /// What moves, joint by joint.
    pub(crate) moving: Vec<Moving>,
}

/// The columns of one joint's motion.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Moving {
    /// Position, and the rates that the table has.
    pub(crate) columns: Vec<String>,
    /// Whether it turns: its position is an angle.
    pub(crate) turns: bool,
}

/// An experiment.
pub struct Experiment {
    /// What was measured.
    pub kind: Measured,
    /// The axes of a residual.
    pub axes: Vec<Axis>,
    /// How many of the axes, from the first, have one unit and make the norm.
    pub n_norm: usize,
    /// The rows.
    pub rows: Vec<SignalRow>,
    /// Predicted minus measured of the model as it is: rows × axes.
    pub residuals: Vec<f64>,
    /// What was measured: rows × axes, of an orientation 0; `None` where only differences of predictions are.
    pub measured: Option<Vec<f64>>,
    /// What may be missing.
    pub candidates: Vec<Candidate>,
    /// Quantities that the residual may depend on, one number a row.
    pub channels: Vec<(String, Vec<f64>)>,
    /// Bodies whose mass distribution must stay possible.
    pub bodies: Vec<BodyCandidate>,
    /// What its values rest on.
    pub findings: Vec<Finding>,
    /// How the residuals depart from the columns.
    pub curvature: Curvature,
}

impl Moving {
    /// The columns of a robot's joint.
    pub(crate) fn of(joint: &RobotJoint, columns: Vec<String>) -> Self {
        Self { columns, turns: joint.joint.axis.kind == JointKind::Revolute }
    }
}

impl Axis {
    /// An axis of which each row is a group by itself.
    pub fn new(name: impl Into<String>, unit: &'static str) -> Self {
        Self { name: name.into(), unit, noise_if_repeated: None }
    }

    /// Whether its rows prove something: each is a group by itself.
    pub fn proves(&self) -> bool {
        self.noise_if_repeated.is_none()
    }
}

impl Candidate {
    /// A law with one value.
    pub fn one(law: LawName, site: Site, (name, unit): (&str, &str), column: Vec<f64>) -> Self {
        let value = CandidateValue {
            name: name.into(),
            unit: unit.into(),
            prior: f64::INFINITY,
            min: f64::NEG_INFINITY,
            column,
        };
        Self { law, site, shape: None, values: vec![value] }
    }

    /// Whether both are the same law at the same place, whatever their shapes.
    pub fn is_same(&self, other: &Self) -> bool {
        self.law == other.law && self.site == other.site
    }

    /// Whether it is what all joints have in common.
    pub fn is_common(&self) -> bool {
        self.site.place == Place::AllJoints
    }

    /// Whether it has values with priors.
    pub fn has_prior(&self) -> bool {
        self.values.iter().any(|value| value.prior.is_finite())
    }
}

impl Curvature {
    /// That of a model which has values already: what is given are changes of them.
    pub(crate) fn around(self, base: Vec<f64>) -> Self {
        let sum = |values: &[f64], base: &[f64]| -> Vec<f64> {
            values.iter().zip(base).map(|(value, base)| value + base).collect()
        };
        match self {
            Self::None => Self::None,
            Self::Relinearise(inner) => Self::Relinearise(Box::new(move |values| inner(&sum(values, &base)))),
            Self::Beyond(inner) => {
                let at_base: Option<Vec<f64>> = inner(&base).map(|own| own.iter().map(|own| -own).collect());
                Self::Beyond(Box::new(move |values| {
                    let mut beyond = inner(&sum(values, &base));
                    match &mut beyond {
                        Some(beyond) => add(beyond, at_base.as_deref()),
                        None => beyond.clone_from(&at_base),
                    }
                    beyond
                }))
            }
        }
    }

    /// That of the values with these numbers among `n_all`; the others stay zero.
    pub(crate) fn of(self, kept: Vec<usize>, n_all: usize) -> Self {
        let all = move |values: &[f64], kept: &[usize]| {
            let mut all = vec![0.0; n_all];
            kept.iter().zip(values).for_each(|(&at, value)| all[at] = *value);
            all
        };
        match self {
            Self::None => Self::None,
            Self::Relinearise(inner) => Self::Relinearise(Box::new(move |values| {
                let (residuals, mut columns) = inner(&all(values, &kept));
                (residuals, kept.iter().map(|&at| std::mem::take(&mut columns[at])).collect())
            })),
            Self::Beyond(inner) => Self::Beyond(Box::new(move |values| inner(&all(values, &kept)))),
        }
    }
}

/// Adds numbers of rows × axes, where there are any.
fn add(numbers: &mut [f64], more: Option<&[f64]>) {
    numbers.iter_mut().zip(more.into_iter().flatten()).for_each(|(number, more)| *number += more);
}

impl Experiment {
    /// An experiment with one axis whose residuals are linear in all values, without channels.
    pub(crate) fn of_one(
        kind: Measured,
        axis: Axis,
        data: &Prepared,
        residuals: Vec<f64>,
        candidates: Vec<Candidate>,
    ) -> Self {
        Self {
            kind,
            axes: vec![axis],
            n_norm: 1,
            rows: data.rows.clone(),
            residuals,
            measured: None,
            candidates,
            channels: Vec::new(),
            bodies: Vec::new(),
            findings: Vec::new(),
            curvature: Curvature::None,
        }
    }

    /// Whether all values are small errors with priors, so that all candidates can stand in one model; a body's mass is none.
    pub fn all_priors_informative(&self) -> bool {
        self.bodies.is_empty()
            && self.candidates.iter().flat_map(|candidate| &candidate.values).all(|value| value.prior.is_finite())
    }

    /// The unit of the norm.
    pub fn unit(&self) -> &'static str {
        self.axes.first().map_or("", |axis| axis.unit)
    }

    /// Where the values of each candidate begin among all values, and how many there are.
    pub fn offsets(&self) -> (Vec<usize>, usize) {
        let mut next = 0;
        let offsets = self.candidates.iter().map(|candidate| {
            let offset = next;
            next += candidate.values.len();
            offset
        });
        (offsets.collect(), next)
    }

    /// The numbers of the rows that fits see, of those of all rows × axes.
    pub(crate) fn training_rows(&self, all: &[f64]) -> Vec<f64> {
        self.rows_where(all, |row| !row.held_out)
    }

    /// The numbers of the rows that are held out, of those of all rows × axes.
    pub(crate) fn held_out_rows(&self, all: &[f64]) -> Vec<f64> {
        self.rows_where(all, |row| row.held_out)
    }

    fn rows_where(&self, all: &[f64], choose: impl Fn(&SignalRow) -> bool) -> Vec<f64> {
        let n_axes = self.axes.len();
        let rows = self.rows.iter().enumerate().filter(|(_, row)| choose(row));
        rows.flat_map(|(row, _)| &all[row * n_axes..(row + 1) * n_axes]).copied().collect()
    }

    /// Mean square of an axis of rows × axes.
    pub(crate) fn mean_square(&self, residuals: &[f64], axis: usize) -> f64 {
        let n_axes = self.axes.len();
        residuals.iter().skip(axis).step_by(n_axes).map(|r| r * r).sum::<f64>() / (residuals.len() / n_axes) as f64
    }

    /// Root mean square of the norm of rows × axes; `None` without rows.
    pub(crate) fn norm(&self, residuals: &[f64]) -> Option<f64> {
        let square = (0..self.n_norm).map(|axis| self.mean_square(residuals, axis)).sum::<f64>();
        (!residuals.is_empty()).then(|| square.sqrt())
    }

    /// Residuals with these values of all candidates.
    pub fn at(&self, values: &[f64]) -> Vec<f64> {
        if let Curvature::Relinearise(relinearise) = &self.curvature {
            return relinearise(values).0;
        }
        let mut residuals = self.residuals.clone();
        if let Curvature::Beyond(beyond) = &self.curvature {
            add(&mut residuals, beyond(values).as_deref());
        }
        let all = self.candidates.iter().flat_map(|candidate| &candidate.values);
        for (value, size) in all.zip(values).filter(|(_, size)| **size != 0.0) {
            residuals.iter_mut().zip(&value.column).for_each(|(residual, slope)| *residual += slope * size);
        }
        residuals
    }
}
