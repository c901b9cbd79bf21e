//! The rows that a look weighs: those measured, the desired frames, and words that could be visited next.

use darm_arm::arm::frames::DesiredFrame;
use darm_arm::arm::{Arm, ArmScratch};
use darm_core::effect::Effect;
use nalgebra::DMatrix;

use crate::linearise::sensitivity::Sensitivity;
use crate::measurement_plan::{PlanStep, as_run};
use crate::prepare::observations::{NoPose, Observations};
use darm_arm::arm::ArmModel;
use darm_measure::{Run, root_mean_square};

/// Time between what was measured and what might be, s.
const GAP_S: f64 = 1.0;

/// Supply, and temperature in K, that an arm is planned of at.
pub(super) type Conditions = (f64, f64);

/// Rows of three sorts in one set of observations.
pub(super) struct Rows {
    observations: Observations,
    n_measured: usize,
    n_frames: usize,
    /// The number of the step of each row that could be next.
    next: Vec<usize>,
    length_scale_m: f64,
}

/// How the rows change with some values.
pub(super) struct Slopes<'a> {
    rows: &'a Rows,
    columns: Vec<Vec<f64>>,
}

/// What is planned of beside the rows that were measured.
pub(super) struct PlannedRows<'a> {
    pub(super) frames: &'a [DesiredFrame],
    pub(super) next: &'a [PlanStep],
    pub(super) conditions: Conditions,
    /// Noise of each component of a twist, rad and m.
    pub(super) sigma: [f64; 6],
}

impl Rows {
    /// Training rows of `run`, then frames and next steps as the model of `arm` has them. Steps without a pose are left out.
    pub(super) fn new(arm: &Arm, run: &Run, planned: &PlannedRows) -> Self {
        let last_s = run.samples.last().map_or(0.0, |sample| sample.time_s);
        let samples_of = |steps: &[PlanStep]| {
            let mut samples = as_run(arm, steps, planned.conditions.0, planned.conditions.1).samples;
            samples.iter_mut().for_each(|sample| (sample.time_s, sample.held_out) = (last_s + GAP_S, false));
            samples
        };
        let at_frames: Vec<PlanStep> = planned.frames.iter().map(at_frame).collect();
        let (frames, next) = (samples_of(&at_frames), samples_of(planned.next));
        let (n_measured, n_frames) = (run.training().count(), frames.len());
        let steps = next.iter().map(|sample| sample.visit as usize).collect();
        // What is planned of comes last, so that no frame is reached by its switches.
        let samples = run.samples.iter().cloned().chain(frames).chain(next).collect();
        let all = Run { samples, ..Run::default() };
        let observations = Observations::new(arm, &all, planned.sigma, |sample| !sample.held_out);
        Self { observations, n_measured, n_frames, next: steps, length_scale_m: arm.length_scale_m }
    }

    /// The postures of `model` in all rows.
    pub(super) fn sensitivity<'a>(&'a self, model: &'a ArmModel) -> Result<Sensitivity<'a>, NoPose> {
        Sensitivity::new(model, &self.observations, &mut ArmScratch::default())
    }

    /// How the rows change with these values of effects; a value that changes none is left out.
    pub(super) fn slopes(&self, sensitivity: &Sensitivity, values: &[(Effect<f64>, usize)]) -> Slopes<'_> {
        let columns = values.iter().filter_map(|(effect, value)| sensitivity.column(effect, *value)).collect();
        Slopes { rows: self, columns }
    }

    /// The rows that could be next, each with the number of its step.
    pub(super) fn next(&self) -> impl Iterator<Item = (usize, usize)> {
        (self.n_measured + self.n_frames..).zip(self.next.iter().copied())
    }

    /// The numbers of the rows of the frames.
    fn frames(&self) -> std::ops::Range<usize> {
        self.n_measured..self.n_measured + self.n_frames
    }
}

impl Slopes<'_> {
    /// How many values there are.
    pub(super) fn n_values(&self) -> usize {
        self.columns.len()
    }

    /// The derivatives of one row, in units of the noise.
    pub(super) fn row(&self, row: usize) -> DMatrix<f64> {
        let n_axes = self.rows.observations.n_axes();
        DMatrix::from_fn(n_axes, self.columns.len(), |axis, value| self.columns[value][row * n_axes + axis])
    }

    /// Each value in units of a size at which the rows that could be next change by this many times the noise, root mean
    /// square. What changes none of these is left out.
    pub(super) fn scaled(mut self, times_noise: f64) -> Self {
        let first = self.rows.frames().end * self.rows.observations.n_axes();
        let rms = |column: &Vec<f64>| root_mean_square(&column[first..]);
        self.columns.retain(|column| rms(column) > f64::MIN_POSITIVE);
        for column in &mut self.columns {
            let scale = times_noise / rms(column);
            column.iter_mut().for_each(|slope| *slope *= scale);
        }
        self
    }

    /// The information of the rows that were measured.
    pub(super) fn information(&self) -> DMatrix<f64> {
        let n = self.rows.n_measured * self.rows.observations.n_axes();
        let all = DMatrix::from_fn(n, self.n_values(), |k, value| self.columns[value][k]);
        all.tr_mul(&all)
    }

    /// The standard deviation of the predicted pose at the frames, as a distance d, root mean square, m, for values with
    /// this covariance.
    pub(super) fn at_frames_m(&self, covariance: &DMatrix<f64>) -> f64 {
        let Observations { axes, sigma, .. } = &self.rows.observations;
        let scale = |axis: usize| sigma[axis] * if axis < 3 { self.rows.length_scale_m } else { 1.0 };
        let square = |row: usize| {
            let j = self.row(row);
            let variance = &j * covariance * j.transpose();
            axes.iter().enumerate().map(|(k, &axis)| variance[(k, k)] * scale(axis).powi(2)).sum::<f64>()
        };
        let frames = self.rows.frames();
        (frames.clone().map(square).sum::<f64>() / frames.len().max(1) as f64).max(0.0).sqrt()
    }
}

/// A visit of a frame.
fn at_frame(frame: &DesiredFrame) -> PlanStep {
    let (word, previous, servos_rad) = (frame.word, frame.previous, frame.servos_rad.clone());
    PlanStep { word, previous, servos_rad, load_kg: None, held_out: false, repeat: false }
}
