//! Stage 6: the outcome as plain data, in sentences, and as tables and plots.

pub mod numbers;
mod plots;
pub mod poses;
mod residuals;
pub mod sentences;
pub mod signals;
pub mod tables;

use crate::judge::Judgement;
use crate::outcome::{BeforeAfter, Diagnosis, Measured, OtherReading, Outlier, Point, Rows, SelectionStep};
use crate::rejection::Rejection;
use darm_measure::Finding;

/// What a report shows of the rows of a measurement and of the search.
pub(crate) struct Summary {
    pub(crate) kind: Measured,
    pub(crate) model: Option<u32>,
    pub(crate) rows: Rows,
    pub(crate) held_out: String,
    pub(crate) is_cross_validated: bool,
    pub(crate) left_out: &'static str,
    pub(crate) error: BeforeAfter,
    pub(crate) other_reading: Option<OtherReading>,
    pub(crate) outliers: Vec<Outlier>,
    pub(crate) selection_path: Vec<SelectionStep>,
    pub(crate) condition: Option<f64>,
    pub(crate) points: Vec<Point>,
    pub(crate) findings: Vec<Finding>,
    pub(crate) rejected: Vec<Rejection>,
    pub(crate) seed: u64,
}

/// The diagnosis; `worded` words it once its data are there.
pub(crate) fn diagnosis(
    summary: Summary,
    judgement: Judgement,
    worded: impl Fn(&Diagnosis) -> Vec<String>,
) -> Diagnosis {
    let data = Diagnosis {
        kind: summary.kind,
        model: summary.model,
        rows: summary.rows,
        held_out: summary.held_out,
        is_cross_validated: summary.is_cross_validated,
        left_out: summary.left_out,
        repeatability: judgement.repeatability,
        is_noise_known: judgement.is_noise_known,
        is_more_left: judgement.is_more_left,
        error: summary.error,
        verdict: judgement.verdict,
        other_reading: summary.other_reading,
        effects: judgement.effects,
        alternatives: judgement.alternatives,
        unobservable: judgement.unobservable,
        unconfirmed: judgement.unconfirmed,
        outliers: summary.outliers,
        structure: judgement.structure,
        remaining: judgement.remaining,
        selection_path: summary.selection_path,
        condition: summary.condition,
        next_measurement: judgement.next_measurement,
        plain: Vec::new(),
        findings: summary.findings,
        rejected: summary.rejected,
        points: summary.points,
        seed: summary.seed,
        version: env!("CARGO_PKG_VERSION"),
    };
    let plain = worded(&data).into_iter().chain(sentences::of_rejections(&data.rejected)).collect();
    Diagnosis { plain, ..data }
}
