//! The candidate that changes the inertial parameters of a body.

use darm_robot::rigid_body::inertia::{INERTIAL_PARAMETERS, prior_deviations};

use crate::linearise::experiment::{Candidate, Mass, Value};

/// A candidate that changes the inertial parameters of a body by about their
/// [`prior_deviations`], and the body as it is.
pub(crate) fn candidate(
    index: usize,
    link: &str,
    inertial_parameters: &[f64; 10],
    robot_kg: f64,
    columns: [Vec<f64>; 10],
) -> (Candidate, Mass) {
    let priors = prior_deviations(inertial_parameters, robot_kg);
    let value = |(((name, unit), prior), column): (((&str, &str), f64), Vec<f64>)| Value {
        name: name.into(),
        unit: unit.into(),
        prior,
        column,
    };
    let candidate = Candidate {
        law: "mass-distribution",
        place: link.into(),
        shape: None,
        values: INERTIAL_PARAMETERS.into_iter().zip(priors).zip(columns).map(value).collect(),
    };
    (candidate, Mass { candidate: index, ten: *inertial_parameters })
}
