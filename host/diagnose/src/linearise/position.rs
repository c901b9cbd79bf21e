//! Position of one joint that holds against its target: the model says that it stands on it.

use crate::linearise::experiment::{Axis, Candidate, Experiment};
use crate::linearise::laws::{Coordinate, less_mean, range};
use crate::linearise::model_effects::Known;
use crate::measurement::ReadError;
use crate::prepare::signals::Prepared;

/// The experiment of one joint; a load (any unit) and a temperature are used where they were measured.
pub(crate) fn experiment(data: &Prepared, known: &[Known]) -> Result<Experiment, ReadError> {
    let [target, position] = [data.channel("target")?, data.channel("position")?];
    let unit = data.unit("position");
    let residuals: Vec<f64> = target.iter().zip(&position).map(|(target, position)| target - position).collect();
    let load = data.optional("load");
    let temperature = data.optional("temperature").map(|temperature| less_mean(&temperature));
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
    let place = "the joint";
    let mut candidates = holding.candidates(holding.of_holding(), place, &[1.0], known);
    if range(&target) > 0.0 {
        candidates.push(Candidate::one("encoder-scale", place, ("scale", "1"), target.clone()));
    }
    let mut channels = vec![("time".to_string(), data.time_s.clone())];
    channels.extend(temperature.map(|rise| ("temperature".into(), rise)));
    channels.extend(load.map(|load| ("load".into(), load)));
    channels.push(("target".into(), target));
    let axis = Axis::new("position", unit);
    Ok(Experiment::of_one("joint-position", axis, data, residuals, candidates, channels))
}
