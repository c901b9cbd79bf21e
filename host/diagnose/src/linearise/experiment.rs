//! One measured experiment in numbers: residuals of the model as it is, and how each effect that may be missing moves them.

use crate::prepare::signals::Prepared;

/// What one axis of a residual is.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: &'static str,
    /// Of an axis whose rows repeat each other, its noise as so many times that of the axes of the norm; it is fitted, and
    /// proves nothing by itself. `None`: each row is one of its own, and the residuals tell the noise.
    pub noise_if_repeated: Option<f64>,
}

/// One row of the measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Line of the file, the header being 1.
    pub line: usize,
    /// When, s; the number of the row where there is no time.
    pub time_s: f64,
    /// The stretch of rows that follow each other without a border.
    pub series: usize,
    /// The motion that it belongs to: it goes on where rows begin or end to be held out.
    pub motion: usize,
    /// Number of the value of the column that is held out, where it has few.
    pub key: Option<usize>,
    /// Whether no fit may see it.
    pub held_out: bool,
}

/// One value of an effect.
#[derive(Clone, Debug, PartialEq)]
pub struct Value {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// How large it may be before anything is measured (standard deviation); infinite where nothing is known.
    pub prior: f64,
    /// How the residuals move with it: rows × axes.
    pub column: Vec<f64>,
}

/// A law at a place, which may be missing in the model.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The law.
    pub law: &'static str,
    /// Where it acts.
    pub place: String,
    /// A number that the law has and no fit changes: its name, value and unit.
    pub shape: Option<(&'static str, f64, String)>,
    /// What a fit determines.
    pub values: Vec<Value>,
}

/// The ten inertial parameters of a body as its model has them, and the candidate that may change them.
#[derive(Clone, Debug, PartialEq)]
pub struct Mass {
    /// Index of the candidate, whose values are changes of these numbers in this order.
    pub candidate: usize,
    /// m, m·c, and I about the frame's origin (xx, xy, yy, xz, yz, zz).
    pub ten: [f64; 10],
}

/// Residuals and their derivatives at other values than zero: all values in, residuals and one column a value out.
pub type Relinearise = Box<dyn Fn(&[f64]) -> (Vec<f64>, Vec<Vec<f64>>) + Send + Sync>;

/// An experiment.
pub struct Experiment {
    /// What was observed: `actuator-force`, say.
    pub kind: &'static str,
    /// The axes of a residual.
    pub axes: Vec<Axis>,
    /// How many of the axes, from the first, have one unit and make the norm.
    pub n_norm: usize,
    /// The rows.
    pub rows: Vec<Row>,
    /// Predicted minus measured of the model as it is: rows × axes.
    pub residuals: Vec<f64>,
    /// What may be missing.
    pub candidates: Vec<Candidate>,
    /// Quantities that the residual may depend on, one number a row.
    pub channels: Vec<(String, Vec<f64>)>,
    /// Bodies whose mass distribution must stay possible.
    pub masses: Vec<Mass>,
    /// `None` where the residuals are linear in all values.
    pub relinearise: Option<Relinearise>,
}

impl Axis {
    /// An axis whose rows are each one of its own.
    pub fn new(name: impl Into<String>, unit: &'static str) -> Self {
        Self { name: name.into(), unit, noise_if_repeated: None }
    }

    /// Whether its rows prove something: each is one of its own.
    pub fn proves(&self) -> bool {
        self.noise_if_repeated.is_none()
    }
}

impl Candidate {
    /// A law with one value.
    pub fn one(law: &'static str, place: &str, (name, unit): (&str, &str), column: Vec<f64>) -> Self {
        let value = Value { name: name.into(), unit: unit.into(), prior: f64::INFINITY, column };
        Self { law, place: place.into(), shape: None, values: vec![value] }
    }
}

impl Experiment {
    /// An experiment with one axis whose residuals are linear in all values.
    pub(crate) fn of_one(
        kind: &'static str,
        axis: Axis,
        data: &Prepared,
        residuals: Vec<f64>,
        candidates: Vec<Candidate>,
        channels: Vec<(String, Vec<f64>)>,
    ) -> Self {
        Self {
            kind,
            axes: vec![axis],
            n_norm: 1,
            rows: data.rows.clone(),
            residuals,
            candidates,
            channels,
            masses: Vec::new(),
            relinearise: None,
        }
    }

    /// Whether all values are small errors with priors, so that all candidates can stand in one model; a body's mass is none.
    pub fn is_held_by_priors(&self) -> bool {
        self.masses.is_empty()
            && self.candidates.iter().flat_map(|candidate| &candidate.values).all(|value| value.prior.is_finite())
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

    /// Residuals with these values of all candidates.
    pub fn at(&self, values: &[f64]) -> Vec<f64> {
        if let Some(relinearise) = &self.relinearise {
            return relinearise(values).0;
        }
        let mut residuals = self.residuals.clone();
        let all = self.candidates.iter().flat_map(|candidate| &candidate.values);
        for (value, size) in all.zip(values).filter(|(_, size)| **size != 0.0) {
            residuals.iter_mut().zip(&value.column).for_each(|(residual, slope)| *residual += slope * size);
        }
        residuals
    }
}
