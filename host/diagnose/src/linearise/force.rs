//! Force of a single fluid actuator: predicted p·A from its gauge pressure and bore, beside a load cell.

use crate::effect::{LawName, Place, Site};
use crate::linearise::experiment::{Axis, Candidate, Experiment};
use crate::linearise::laws::Coordinate;
use crate::linearise::model_effects::ModelEffect;
use crate::measured::Measured;
use crate::prepare::signals::Prepared;
use darm_measure::ReadError;
use darm_measure::demean;

/// The experiment of one actuator with this bore, m.
pub(crate) fn experiment(data: &Prepared, bore_m: f64, known: &[ModelEffect]) -> Result<Experiment, ReadError> {
    let [pressure, position, force] = [data.channel("pressure")?, data.channel("position")?, data.channel("force")?];
    let [velocity, acceleration] = match data.raw("velocity") {
        Some(velocity) => {
            let [velocity, acceleration, _] = data.rates(data.full(&velocity, false));
            [velocity, acceleration]
        }
        None => {
            let [_, velocity, acceleration] = data.motion("position", false)?;
            [velocity, acceleration]
        }
    };
    let temperature = data.optional("temperature").map(|temperature| demean(&temperature));
    let area_m2 = std::f64::consts::FRAC_PI_4 * bore_m * bore_m;
    let residuals = pressure.iter().zip(&force).map(|(p, f)| p * area_m2 - f).collect();
    let motion = Coordinate {
        position: &position,
        velocity: &velocity,
        acceleration: &acceleration,
        load: Some(&pressure),
        temperature: temperature.as_deref(),
        time_s: &data.time_s,
        series: &data.series,
        motion: &data.motions,
        units: ["m", "N", "Pa"],
    };
    let site = Site::new(Place::Actuator, "the actuator");
    let mut candidates = motion.candidates([motion.friction(), motion.others()].concat(), &site, &[1.0], known);
    let along_stroke = pressure.iter().zip(&position).map(|(p, x)| p * x).collect();
    candidates.push(Candidate::one(LawName::AreaAlongStroke, site, ("slope", "m²/m"), along_stroke));
    let mut channels = vec![
        ("pressure".into(), pressure),
        ("position".into(), position),
        ("velocity".into(), velocity),
        ("time".into(), data.time_s.clone()),
    ];
    channels.extend(temperature.map(|rise| ("temperature".into(), rise)));
    let axis = Axis::new("force", "N");
    Ok(Experiment {
        channels,
        measured: Some(force),
        ..Experiment::of_one(Measured::ActuatorForce, axis, data, residuals, candidates)
    })
}
