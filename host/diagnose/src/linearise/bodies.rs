//! The candidate that changes the inertial parameters of a body.

use darm_robot::rigid_body::inertia::{INERTIAL_PARAMETERS, prior_deviations};

use crate::effect::{Law, Site};
use crate::linearise::experiment::{BodyCandidate, Candidate, Value};

/// A candidate that changes the inertial parameters of a body by about their
/// [`prior_deviations`], and the body as it is.
pub(crate) fn candidate(
    index: usize,
    site: Site,
    inertial_parameters: &[f64; 10],
    robot_kg: f64,
    columns: [Vec<f64>; 10],
) -> (Candidate, BodyCandidate) {
    let priors = prior_deviations(inertial_parameters, robot_kg);
    let value = |(((name, unit), prior), column): (((&str, &str), f64), Vec<f64>)| Value {
        name: name.into(),
        unit: unit.into(),
        prior,
        min: f64::NEG_INFINITY,
        column,
    };
    let candidate = Candidate {
        law: Law::MassDistribution,
        site,
        shape: None,
        values: INERTIAL_PARAMETERS.into_iter().zip(priors).zip(columns).map(value).collect(),
    };
    (candidate, BodyCandidate { candidate: index, nominal: *inertial_parameters })
}
