//! Force of a single fluid actuator: predicted p·A from its gauge pressure and bore, beside a load cell.

use super::experiment::{Axis, Candidate, Experiment};
use super::laws::Coordinate;
use super::prepared::Prepared;
use super::signal::rate;
use crate::measurement::ReadError;

/// The experiment of one actuator with this bore, m.
pub(super) fn experiment(data: &Prepared, bore_m: f64) -> Result<Experiment, ReadError> {
    let [pressure, position, force] = [data.channel("pressure")?, data.channel("position")?, data.channel("force")?];
    let velocity = match data.optional("velocity") {
        Some(velocity) => velocity,
        None => rate(&position, &data.time_s, &data.series),
    };
    let area_m2 = std::f64::consts::FRAC_PI_4 * bore_m * bore_m;
    let residuals = pressure.iter().zip(&force).map(|(p, f)| p * area_m2 - f).collect();
    let motion = Coordinate {
        position: &position,
        velocity: &velocity,
        time_s: &data.time_s,
        series: &data.series,
        units: ("m", "N"),
    };
    let loads = [("per pressure", "Pa", pressure.clone())];
    let place = "the actuator";
    let mut candidates: Vec<Candidate> =
        motion.friction(&loads).iter().chain(&motion.others()).map(|law| law.on_axis(place, 0, 1)).collect();
    let product = |other: &[f64]| pressure.iter().zip(other).map(|(p, x)| p * x).collect::<Vec<f64>>();
    candidates.extend([
        Candidate::one("effective-area", place, ("area over the bore's", "m²"), pressure.clone()),
        Candidate::one("area-along-stroke", place, ("slope", "m²/m"), product(&position)),
        Candidate::one("pressure-dependent-viscosity", place, ("coefficient", "N/(m/s)/Pa"), product(&velocity)),
        Candidate::one("pressure-delay", place, ("delay × area", "s·m²"), rate(&pressure, &data.time_s, &data.series)),
    ]);
    let channels = vec![
        ("pressure".into(), pressure),
        ("position".into(), position),
        ("velocity".into(), velocity),
        ("time".into(), data.time_s.clone()),
    ];
    Ok(Experiment {
        kind: "actuator-force",
        axes: vec![Axis { name: "force".into(), unit: "N" }],
        n_norm: 1,
        rows: data.rows.clone(),
        residuals,
        candidates,
        channels,
        masses: Vec::new(),
        relinearise: None,
    })
}
