//! What is added to signals and is no law: a column for each row on one axis, of what was recorded, of chance, or of both.
//!
//! None of the equations is that of a law, and none uses their code. What a right answer may depend on is named as the report
//! names channels.

use darm_diagnose::outcome::Regressor;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::numbers::{centred, hum, normal, on_and_off, pulses, quantile, ranks, walk};
use super::{Right, Secret};

/// What a generator sees of the axis that it changes.
pub(super) struct Seen {
    pub(super) times: Vec<f64>,
    /// What the axis moves along, and its rate: name in a report, numbers. Without a rate nothing moves: postures.
    pub(super) own: (String, Vec<f64>),
    pub(super) rate: Option<(String, Vec<f64>)>,
    /// Something else that moves.
    pub(super) other: Option<(String, Vec<f64>)>,
    /// What the model predicts of this axis, and of another one.
    pub(super) loads: Option<[Vec<f64>; 2]>,
}

/// A generator.
pub(super) struct World {
    pub(super) name: &'static str,
    needs: Needs,
    draw: fn(&Seen, &mut ChaCha8Rng) -> Shape,
}

/// What a generator needs.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Needs {
    Nothing,
    /// Something that moves.
    Motion,
    /// Postures or targets in any order, at rest.
    Rest,
    /// Another joint.
    Other,
    /// Another joint, in motion.
    OtherInMotion,
    /// What the model predicts.
    Loads,
}

/// A column, and the channels of which any is a right answer; none where nothing that was recorded shows it.
type Shape = (Vec<f64>, Vec<String>);

/// All of them.
pub(super) const WORLDS: [World; 21] = [
    World { name: "a wave in time", needs: Needs::Nothing, draw: |seen, rng| of_time(seen, hum(&seen.times, rng)) },
    World { name: "on and off", needs: Needs::Nothing, draw: |seen, rng| of_time(seen, on_and_off(&seen.times, rng)) },
    World {
        name: "a zero that wanders",
        needs: Needs::Nothing,
        draw: |seen, rng| of_time(seen, walk(&seen.times, rng)),
    },
    World { name: "pulses", needs: Needs::Nothing, draw: |seen, rng| of_time(seen, pulses(&seen.times, rng)) },
    World { name: "a track that gets finer", needs: Needs::Nothing, draw: chirp },
    World { name: "a kink on the way", needs: Needs::Nothing, draw: kink },
    World { name: "a step on the way", needs: Needs::Nothing, draw: edge },
    World { name: "a catch that lets go late", needs: Needs::Nothing, draw: catch },
    World { name: "a swing that grows with time", needs: Needs::Nothing, draw: growing },
    World { name: "a friction that fades", needs: Needs::Motion, draw: fading_friction },
    World { name: "each way off by its own", needs: Needs::Motion, draw: each_way },
    World { name: "a jolt behind each turn", needs: Needs::Motion, draw: jolts },
    World { name: "each posture off by its own", needs: Needs::Rest, draw: each_posture },
    World { name: "two joints together", needs: Needs::Other, draw: together },
    World { name: "a hose past an edge", needs: Needs::Other, draw: hose },
    World { name: "a friction by another joint", needs: Needs::OtherInMotion, draw: friction_by_other },
    World { name: "a gain that wanders", needs: Needs::Loads, draw: wandering_gain },
    World { name: "a sensor that bends", needs: Needs::Loads, draw: |seen, _| of_loads(seen, |own, _| own.powi(3)) },
    World { name: "a dead band", needs: Needs::Loads, draw: dead_band },
    World {
        name: "a sensor that hears another one",
        needs: Needs::Loads,
        draw: |seen, _| of_loads(seen, |_, other| other),
    },
    World { name: "a value that is held for some rows", needs: Needs::Loads, draw: repeated_for_some_rows },
];

impl World {
    /// Whether it can act on this axis.
    pub(super) fn can_act_on(&self, seen: &Seen) -> bool {
        let moves = seen.rate.is_some();
        match self.needs {
            Needs::Nothing => true,
            Needs::Motion => moves,
            Needs::Rest => !moves,
            Needs::Other => seen.other.is_some(),
            Needs::OtherInMotion => moves && seen.other.is_some(),
            Needs::Loads => moves && seen.loads.is_some(),
        }
    }

    /// What it adds to the axis, `times` its noise (root mean square), and the secret.
    pub(super) fn plant(&self, seen: &Seen, (times, noise): (f64, f64), rng: &mut ChaCha8Rng) -> (Vec<f64>, Secret) {
        let (column, names) = (self.draw)(seen, rng);
        let is_recorded = !names.is_empty();
        let is_right =
            move |of: &Regressor| matches!(of, Regressor::Signals(own) if own.iter().any(|name| names.contains(name)));
        let column = centred(&column).iter().map(|share| times * noise * share).collect();
        let is_right = is_recorded.then(|| Box::new(is_right) as Right);
        (column, Secret { world: self.name, is_right })
    }
}

fn of_time(_: &Seen, column: Vec<f64>) -> Shape {
    // The temperature of a bench rises with time.
    (column, vec!["time".into(), "temperature".into()])
}

fn of_own(seen: &Seen, shape: impl Fn(f64) -> f64) -> Shape {
    let rate = seen.rate.iter().map(|(name, _)| name.clone());
    (ranks(&seen.own.1).into_iter().map(shape).collect(), std::iter::once(seen.own.0.clone()).chain(rate).collect())
}

fn chirp(seen: &Seen, rng: &mut ChaCha8Rng) -> Shape {
    let waves = rng.random_range(10.0..16.0);
    of_own(seen, |share| (waves * share * share).sin())
}

fn kink(seen: &Seen, rng: &mut ChaCha8Rng) -> Shape {
    let at = rng.random_range(0.3..0.7);
    of_own(seen, |share| (share - at).abs())
}

fn edge(seen: &Seen, rng: &mut ChaCha8Rng) -> Shape {
    let share = rng.random_range(0.3..0.7);
    let at = quantile(&ranks(&seen.own.1), share);
    of_own(seen, |share| f64::from(u8::from(share > at)))
}

/// On above a place, off below another one, and as it was between them.
fn catch(seen: &Seen, _: &mut ChaCha8Rng) -> Shape {
    let mut is_on = 0.0;
    let shares = ranks(&seen.own.1);
    let column = shares.iter().map(|&share| {
        is_on = if share > 0.7 {
            1.0
        } else if share < 0.3 {
            0.0
        } else {
            is_on
        };
        is_on
    });
    let column = column.collect();
    (column, of_own(seen, |share| share).1)
}

/// A wave of the position whose size grows with time.
fn growing(seen: &Seen, _: &mut ChaCha8Rng) -> Shape {
    let (time, own) = (ranks(&seen.times), ranks(&seen.own.1));
    let column = time.iter().zip(&own).map(|(time, own)| time * (8.0 * own).sin()).collect();
    (column, [of_own(seen, |share| share).1, vec!["time".into()]].concat())
}

/// The direction of a rate, which turns round within a hundredth of what is usual.
fn direction(rate: &[f64]) -> Vec<f64> {
    let sizes: Vec<f64> = rate.iter().map(|rate| rate.abs()).collect();
    let slow = 0.03 * quantile(&sizes, 0.5);
    rate.iter().map(|rate| rate / (rate * rate + slow * slow).sqrt()).collect()
}

fn rate(seen: &Seen) -> (&str, &[f64]) {
    seen.rate.as_ref().map_or(("", &[]), |(name, rate)| (name, rate))
}

fn fading_friction(seen: &Seen, rng: &mut ChaCha8Rng) -> Shape {
    let ((name, rate), fades) = (rate(seen), rng.random_range(0.1..0.4));
    let column =
        ranks(&seen.times).iter().zip(direction(rate)).map(|(time, way)| (-time / fades).exp() * way).collect();
    (column, vec![name.into(), "time".into()])
}

/// Rows between two turns of a motion have one number of their own.
fn each_way(seen: &Seen, rng: &mut ChaCha8Rng) -> Shape {
    let (mut own, mut last) = (normal(rng), 0.0);
    let column = rate(seen).1.iter().map(|rate| {
        if rate * last < 0.0 {
            own = normal(rng);
        }
        last = *rate;
        own
    });
    (column.collect(), Vec::new())
}

/// A push that dies away behind each turn of a motion.
fn jolts(seen: &Seen, _: &mut ChaCha8Rng) -> Shape {
    let ((name, rate), mut last, mut push) = (rate(seen), 0.0, 0.0);
    let column = rate.iter().map(|rate| {
        push = if rate * last < 0.0 { 1.0 } else { 0.9 * push };
        last = *rate;
        push
    });
    (column.collect(), vec![name.into(), seen.own.0.clone()])
}

fn each_posture(seen: &Seen, rng: &mut ChaCha8Rng) -> Shape {
    let mut own = std::collections::BTreeMap::new();
    let column = seen.own.1.iter().map(|at| *own.entry(at.to_bits()).or_insert_with(|| normal(rng))).collect();
    (column, Vec::new())
}

fn other(seen: &Seen) -> (&str, Vec<f64>) {
    seen.other.as_ref().map_or(("", Vec::new()), |(name, other)| (name, ranks(other)))
}

fn together(seen: &Seen, _: &mut ChaCha8Rng) -> Shape {
    let (name, other) = other(seen);
    let column = ranks(&seen.own.1).iter().zip(other).map(|(own, other)| (own - 0.5) * (other - 0.5)).collect();
    (column, vec![seen.own.0.clone(), name.into()])
}

fn hose(seen: &Seen, rng: &mut ChaCha8Rng) -> Shape {
    let ((name, other), edge) = (other(seen), rng.random_range(0.4..0.6));
    (other.iter().map(|other| (other - edge).max(0.0)).collect(), vec![name.into()])
}

fn friction_by_other(seen: &Seen, _: &mut ChaCha8Rng) -> Shape {
    let ((of_rate, rate), (name, other)) = (rate(seen), other(seen));
    let column = direction(rate).iter().zip(other).map(|(way, other)| way * (other - 0.5)).collect();
    (column, vec![of_rate.into(), name.into()])
}

fn of_loads(seen: &Seen, shape: impl Fn(f64, f64) -> f64) -> Shape {
    let Some([own, other]) = &seen.loads else { return (Vec::new(), Vec::new()) };
    (own.iter().zip(other).map(|(own, other)| shape(*own, *other)).collect(), Vec::new())
}

fn wandering_gain(seen: &Seen, rng: &mut ChaCha8Rng) -> Shape {
    let wanders = hum(&seen.times, rng);
    let (loads, _) = of_loads(seen, |own, _| own);
    (loads.iter().zip(wanders).map(|(load, gain)| load * gain).collect(), Vec::new())
}

fn dead_band(seen: &Seen, _: &mut ChaCha8Rng) -> Shape {
    let (loads, _) = of_loads(seen, |own, _| own.abs());
    let band = quantile(&loads, 0.3);
    of_loads(seen, |own, _| if own.abs() < band { -own } else { 0.0 })
}

fn repeated_for_some_rows(seen: &Seen, rng: &mut ChaCha8Rng) -> Shape {
    let (n, (loads, _)) = (rng.random_range(5..9), of_loads(seen, |own, _| own));
    ((0..loads.len()).map(|row| loads[row - row % n] - loads[row]).collect(), Vec::new())
}
