//! What acts on several joints of a motion at once: motors that turn with sums of joints, and one delay of all torques.

use darm_core::effect::basis::Law;
use darm_core::effect::law_name::LawName;

use super::{Motion, Transmission};
use crate::effect::{Place, Site};
use crate::linearise::experiment::Candidate;
use crate::linearise::laws::Coordinate;
use crate::linearise::model_effects::ModelEffect;
use crate::prepare::groups::SignalRow;
use darm_measure::signal::rate;

/// When the rows were, and how they hang together.
pub(super) struct Clock {
    time_s: Vec<f64>,
    series: Vec<usize>,
    motion: Vec<usize>,
}

impl Clock {
    pub(super) fn new(rows: &[SignalRow]) -> Self {
        let [series, motion] = [|row: &SignalRow| row.series, |row: &SignalRow| row.motion]
            .map(|of| rows.iter().map(of).collect::<Vec<usize>>());
        Self { time_s: rows.iter().map(|row| row.time_s).collect(), series, motion }
    }

    pub(super) fn coordinate<'a>(
        &'a self,
        [position, velocity, acceleration]: [&'a [f64]; 3],
        load: Option<&'a [f64]>,
    ) -> Coordinate<'a> {
        let (time_s, series, motion) = (&self.time_s[..], &self.series[..], &self.motion[..]);
        let units = ["rad", "N·m", "N·m"];
        Coordinate { position, velocity, acceleration, load, temperature: None, time_s, series, motion, units }
    }
}

/// Friction and inertia of a motor that turns with a sum of neighbouring joints: by the transmission where it is known,
/// else the sum and the difference of each two.
pub(super) fn couplings(
    clock: &Clock,
    motion: &Motion,
    transmission: Option<&Transmission>,
    known: &[ModelEffect],
) -> Vec<Candidate> {
    let n = motion.q.len();
    let mut candidates = Vec::new();
    let mixes: Vec<(Site, Vec<f64>)> = match transmission {
        Some(transmission) => {
            let row = |k: usize| -> Vec<f64> {
                let largest = transmission.matrix.row(k).amax().max(f64::MIN_POSITIVE);
                (0..n).map(|joint| transmission.matrix[(k, joint)] / largest).collect()
            };
            let several = (0..n).map(|k| (Site::new(Place::Motor(k), format!("motor {}", k + 1)), row(k)));
            several.filter(|(_, mix)| mix.iter().filter(|share| **share != 0.0).count() > 1).collect()
        }
        None => (1..n)
            .flat_map(|k| {
                let places = [(1.0, "with", Place::JointWithLast(k)), (-1.0, "against", Place::JointAgainstLast(k))];
                places.map(|(sign, word, place)| {
                    let mix = (0..n)
                        .map(|j| {
                            if j == k - 1 {
                                1.0
                            } else if j == k {
                                sign
                            } else {
                                0.0
                            }
                        })
                        .collect();
                    (Site::new(place, format!("joint {} {word} joint {k}", k + 1)), mix)
                })
            })
            .collect(),
    };
    for (site, mix) in mixes {
        let sum = |of: &[Vec<f64>]| -> Vec<f64> {
            (0..clock.time_s.len())
                .map(|row| mix.iter().zip(of).map(|(share, channel)| share * channel[row]).sum())
                .collect()
        };
        let (q, v, a) = (sum(&motion.q), sum(&motion.v), sum(&motion.a));
        let coordinate = clock.coordinate([&q, &v, &a], None);
        let mut laws = coordinate.friction();
        laws.retain(|law| matches!(law, Law::CoulombFriction(_) | Law::ViscousFriction));
        laws.push(Law::RotorInertia);
        candidates.extend(coordinate.candidates(laws, &site, &mix, known));
    }
    candidates
}

/// All torques come late by the same time: −δ·dτ/dt of the predicted ones, rows × joints.
pub(super) fn common_delay(clock: &Clock, nominal: &[f64], n: usize) -> Candidate {
    let of_joint = |joint: usize| {
        let torque: Vec<f64> = nominal.iter().skip(joint).step_by(n).copied().collect();
        rate(&torque, &clock.time_s, &clock.motion)
    };
    let rates: Vec<Vec<f64>> = (0..n).map(of_joint).collect();
    let column = (0..nominal.len()).map(|k| -rates[k % n][k / n]).collect();
    Candidate::one(LawName::Delay, Site::new(Place::AllJoints, "all joints"), ("delay", "s"), column)
}
