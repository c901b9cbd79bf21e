//! Position of one joint that holds against its target: the model says that it stands on it.

use super::experiment::{Axis, Candidate, Experiment};
use super::laws::{presliding, range};
use super::prepared::Prepared;
use crate::measurement::ReadError;

/// Half widths of play in shares of the load's range.
const WIDTHS: [f64; 4] = [0.05, 0.1, 0.2, 0.4];
/// Distances of the memory of direction in shares of the target's range.
const DISTANCES: [f64; 3] = [0.02, 0.1, 0.5];

/// The experiment of one joint; a load (any unit) and a temperature are used where they were measured.
pub(super) fn experiment(data: &Prepared) -> Result<Experiment, ReadError> {
    let [target, position] = [data.channel("target")?, data.channel("position")?];
    let unit = data.unit("position");
    let place = "the joint";
    let residuals: Vec<f64> = target.iter().zip(&position).map(|(target, position)| target - position).collect();
    let one = |law, name, column| Candidate::one(law, place, (name, unit), column);
    let mut candidates = vec![one("joint-offset", "offset", vec![1.0; target.len()])];
    let start = data.time_s.first().copied().unwrap_or_default();
    let time: Vec<f64> = data.time_s.iter().map(|t| t - start).collect();
    candidates.push(Candidate::one("drift", place, ("rate", &format!("{unit}/s")), time.clone()));
    let mut channels = vec![("time".to_string(), time)];
    if range(&target) > 0.0 {
        let slope = Candidate::one("encoder-scale", place, ("scale", "1"), target.clone());
        candidates.push(slope);
        for share in DISTANCES {
            let distance = share * range(&target);
            let column = presliding(&target, &data.series, distance);
            candidates.push(one("backlash", "half width", column).shaped("memory of direction", distance, unit));
        }
    }
    if let Some(temperature) = data.optional("temperature") {
        let mean = temperature.iter().sum::<f64>() / temperature.len().max(1) as f64;
        let rise: Vec<f64> = temperature.iter().map(|t| t - mean).collect();
        candidates.push(Candidate::one("thermal-drift", place, ("slope", &format!("{unit}/K")), rise.clone()));
        channels.push(("temperature".into(), rise));
    }
    if let Some(load) = data.optional("load") {
        candidates.extend(of_load(&load, data, unit, place));
        channels.push(("load".into(), load));
    }
    channels.push(("target".into(), target));
    Ok(Experiment {
        kind: "joint-position",
        axes: vec![Axis { name: "position".into(), unit }],
        n_norm: 1,
        rows: data.rows.clone(),
        residuals,
        candidates,
        channels,
        masses: Vec::new(),
        relinearise: None,
    })
}

/// The joint gives way to a load, at once or with memory.
fn of_load(load: &[f64], data: &Prepared, unit: &'static str, place: &str) -> Vec<Candidate> {
    let width = range(load).max(1e-12);
    let per_load = format!("{unit}/load");
    let sign = |share: f64| load.iter().map(|l| (l / (share * width)).tanh()).collect::<Vec<f64>>();
    let mut candidates = vec![Candidate::one("joint-compliance", place, ("compliance", &per_load), load.to_vec())];
    for share in [0.01, 0.05] {
        let column = sign(share);
        candidates.push(
            Candidate::one("backlash-by-load", place, ("half width", unit), column).shaped(
                "load that seats",
                share * width,
                "load",
            ),
        );
    }
    for share in WIDTHS {
        let column = play(load, &data.series, share * width);
        candidates.push(
            Candidate::one("hysteresis", place, ("compliance", &per_load), column).shaped(
                "half width",
                share * width,
                "load",
            ),
        );
    }
    candidates
}

/// The play operator: what follows the load with a slack of this half width; Krasnosel'skii and Pokrovskii, 1989.
fn play(load: &[f64], series: &[usize], half: f64) -> Vec<f64> {
    let mut state: Vec<f64> = Vec::with_capacity(load.len());
    for (k, load) in load.iter().enumerate() {
        let before = if k > 0 && series[k] == series[k - 1] { state[k - 1] } else { *load };
        state.push(before.clamp(load - half, load + half));
    }
    state
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn play_follows_with_slack() {
        assert_eq!(play(&[0.0, 1.0, 3.0, 2.0, 0.0], &[0; 5], 1.0), [0.0, 0.0, 2.0, 2.0, 1.0]);
    }
}
