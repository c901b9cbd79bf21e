//! Position of one joint that holds a target: the model predicts the target.

use crate::effect::{LawName, Place, Site};
use crate::linearise::experiment::{Axis, Candidate, Experiment};
use crate::linearise::laws::{Coordinate, range};
use crate::linearise::model_effects::ModelEffect;
use crate::measured::Measured;
use crate::prepare::signals::Prepared;
use darm_measure::ReadError;
use darm_measure::demean;

/// The experiment of one joint; a load (any unit) and a temperature are used where they were measured.
pub(crate) fn experiment(data: &Prepared, known: &[ModelEffect]) -> Result<Experiment, ReadError> {
    let [target, position] = [data.channel("target")?, data.channel("position")?];
    let unit = data.unit("position");
    let residuals: Vec<f64> = target.iter().zip(&position).map(|(target, position)| target - position).collect();
    let load = data.optional("load");
    let temperature = data.optional("temperature").map(|temperature| demean(&temperature));
    let still = vec![0.0; target.len()];
    let holding = Coordinate {
        position: &target,
        velocity: &still,
        acceleration: &still,
        load: load.as_deref(),
        temperature: temperature.as_deref(),
        time_s: &data.time_s,
        series: &data.series,
        motion: &data.motions,
        units: [unit, unit, "load"],
    };
    let site = Site::new(Place::SingleJoint, "the joint");
    let mut candidates = holding.candidates(holding.of_holding(), &site, &[1.0], known);
    if range(&target) > 0.0 {
        candidates.push(Candidate::one(LawName::EncoderScale, site, ("scale", "1"), target.clone()));
    }
    let mut channels = vec![("time".to_string(), data.time_s.clone())];
    channels.extend(temperature.map(|rise| ("temperature".into(), rise)));
    channels.extend(load.map(|load| ("load".into(), load)));
    channels.push(("target".into(), target));
    let axis = Axis::new("position", unit);
    Ok(Experiment {
        channels,
        measured: Some(position),
        ..Experiment::of_one(Measured::JointPosition, axis, data, residuals, candidates)
    })
}
