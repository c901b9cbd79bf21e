//! The candidates that change the inertial parameters of a body.

use darm_robot::rigid_body::inertia::{INERTIAL_PARAMETERS, prior_deviations};

use crate::effect::{LawName, Site};
use crate::linearise::experiment::{BodyCandidate, Candidate, CandidateValue};

/// What a tool or a payload may weigh before anything is measured, in shares of the robot's mass, and how far out that is, m.
const CARRIED_SHARE: f64 = 0.1;
const CARRIED_RADIUS_M: f64 = 0.1;

/// A candidate that changes the inertial parameters of a body by about their
/// [`prior_deviations`], and the body as it is.
pub(crate) fn candidate(
    index: usize,
    site: Site,
    inertial_parameters: &[f64; 10],
    robot_kg: f64,
    columns: [Vec<f64>; 10],
) -> (Candidate, BodyCandidate) {
    with_priors(index, site, inertial_parameters, prior_deviations(inertial_parameters, robot_kg), columns)
}

/// A candidate that changes the inertial parameters of a body which may carry what the model does not have, or which is such a
/// load itself.
pub(crate) fn carrying(
    index: usize,
    site: Site,
    inertial_parameters: &[f64; 10],
    robot_kg: f64,
    columns: [Vec<f64>; 10],
) -> (Candidate, BodyCandidate) {
    let own = prior_deviations(inertial_parameters, robot_kg);
    let mass_kg = CARRIED_SHARE * robot_kg;
    let priors = std::array::from_fn(|k| match k {
        0 => own[k].max(mass_kg),
        1..=3 => own[k].max(mass_kg * CARRIED_RADIUS_M),
        _ => own[k].max(mass_kg * CARRIED_RADIUS_M.powi(2)),
    });
    with_priors(index, site, inertial_parameters, priors, columns)
}

fn with_priors(
    index: usize,
    site: Site,
    nominal: &[f64; 10],
    priors: [f64; 10],
    columns: [Vec<f64>; 10],
) -> (Candidate, BodyCandidate) {
    let value = |(((name, unit), prior), column): (((&str, &str), f64), Vec<f64>)| CandidateValue {
        name: name.into(),
        unit: unit.into(),
        prior,
        min: f64::NEG_INFINITY,
        column,
    };
    let candidate = Candidate {
        law: LawName::MassDistribution,
        site,
        shape: None,
        values: INERTIAL_PARAMETERS.into_iter().zip(priors).zip(columns).map(value).collect(),
    };
    (candidate, BodyCandidate { candidate: index, nominal: *nominal })
}
