//! What displaces the tool of an arm of words and is no law: a share for each row, along a direction that is drawn.
//!
//! The equations are of what was recorded, of chance, or of both; none is that of a law, and none uses their code.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use darm_arm::arm::Arm;
use darm_core::real::Vec3;
use darm_core::se::{Pose, Twist};
use darm_core::units::Word;
use darm_diagnose::outcome::Regressor;
use darm_measure::{Run, Sample};
use rand::RngExt;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use super::numbers::{centred, hum, normal, on_and_off, quantile, ranks, walk};
use super::{Right, Secret};

/// A generator.
pub(super) struct World {
    pub(super) name: &'static str,
    draw: fn(&Rows, &mut ChaCha8Rng) -> Shape,
}

/// All of them.
pub(super) const WORLDS: [World; 19] = [
    World { name: "a stand that hums", draw: |rows, rng| of_time(hum(&rows.times(), rng)) },
    World { name: "a magnet nearby, on and off", draw: |rows, rng| of_time(on_and_off(&rows.times(), rng)) },
    World { name: "a camera that wanders", draw: |rows, rng| of_time(walk(&rows.times(), rng)) },
    World { name: "a thermostat", draw: thermostat },
    World { name: "a bracket that buckles back and forth as it warms", draw: buckling },
    World { name: "a valve that opens below a pressure", draw: pilot_valve },
    World { name: "a leg that pulls at the tool as the supply falls", draw: weak_leg },
    World { name: "three legs that twist the plate, odd or even", draw: parity },
    World { name: "a frame that sags by the square of the long legs", draw: crowd },
    World { name: "each word off by its own", draw: |rows, rng| each(rows, rng, |row| row.word.to_string()) },
    World { name: "each visit off by its own", draw: each_visit },
    World { name: "a slip now and then", draw: slips },
    World { name: "a shake that grows with the number of blows", draw: blows },
    World { name: "a blow of one leg that shifts the tool", draw: blow },
    World { name: "a digit beside what another one was", draw: before },
    World { name: "a lens with ripples", draw: ripples },
    World { name: "a lens with a seam", draw: seam },
    World { name: "a screen behind a part of the room", draw: screen },
    World { name: "a servo whose horn is bent", draw: horn },
];

/// Which of them an arm may have.
pub(super) fn of_arm(arm: &Arm) -> Vec<&'static World> {
    WORLDS.iter().filter(|world| world.name != "a servo whose horn is bent" || arm.n_servos() > 0).collect()
}

/// What a generator adds: a share for each row, and what it follows.
struct Shape {
    share: Vec<f64>,
    is_right: Option<Right>,
}

impl Shape {
    fn new(share: Vec<f64>, is_right: impl Fn(&Regressor) -> bool + 'static) -> Self {
        Self { share, is_right: Some(Box::new(is_right)) }
    }
}

/// What a generator sees.
struct Rows<'a> {
    samples: &'a [Sample],
    /// Number of the stay of each row: its repeats in place belong to it.
    stays: Vec<usize>,
    n_actuators: usize,
}

impl<'a> Rows<'a> {
    fn new(arm: &Arm, samples: &'a [Sample]) -> Self {
        let mut stays = vec![0; samples.len()];
        for k in 1..samples.len() {
            let is_same = samples[k].word == samples[k - 1].word && samples[k].previous == samples[k - 1].previous;
            stays[k] = stays[k - 1] + usize::from(!is_same);
        }
        Self { samples, stays, n_actuators: arm.n_actuators() }
    }

    fn times(&self) -> Vec<f64> {
        self.of(|sample| sample.time_s)
    }

    fn of(&self, number: impl Fn(&Sample) -> f64) -> Vec<f64> {
        self.samples.iter().map(number).collect()
    }

    /// Some different actuators.
    fn actuators<const N: usize>(&self, rng: &mut ChaCha8Rng) -> [usize; N] {
        let mut all: Vec<usize> = (0..self.n_actuators).collect();
        all.shuffle(rng);
        std::array::from_fn(|k| all[k])
    }
}

/// A run with what one generator does to it, `times` the scatter of the camera (root mean square of the distance), and the secret.
pub(super) fn plant(
    arm: &Arm,
    run: &mut Run,
    world: &World,
    (times, scatter_m): (f64, f64),
    rng: &mut ChaCha8Rng,
) -> Secret {
    let Shape { share, is_right } = (world.draw)(&Rows::new(arm, &run.samples), rng);
    let (is_planar, at_the_tool) = (arm.model.chain.is_planar(), rng.random_bool(0.5));
    let mut linear = Vec3::from_fn(|_, _| normal(rng));
    let mut angular = Vec3::from_fn(|_, _| if at_the_tool { normal(rng) / arm.length_scale_m } else { 0.0 });
    if is_planar {
        (linear.z, angular.x, angular.y) = (0.0, 0.0, 0.0);
    }
    let size = (linear.norm_squared() + (arm.length_scale_m * angular).norm_squared()).sqrt();
    let aside = Twist { linear: linear / size, angular: angular / size };
    for (sample, share) in run.samples.iter_mut().zip(centred(&share)) {
        let moved = Pose::exp(&(aside * (times * scatter_m * share)));
        sample.pose = if at_the_tool { sample.pose * moved } else { moved * sample.pose };
    }
    Secret { world: world.name, is_right }
}

fn flag(is: bool) -> f64 {
    f64::from(u8::from(is))
}

fn of_time(share: Vec<f64>) -> Shape {
    Shape::new(share, |of| *of == Regressor::Time)
}

fn celsius(rows: &Rows) -> Vec<f64> {
    rows.of(|sample| sample.temperature_c.unwrap_or_default())
}

fn supply(rows: &Rows) -> Vec<f64> {
    rows.of(|sample| sample.supply.unwrap_or_default())
}

fn thermostat(rows: &Rows, rng: &mut ChaCha8Rng) -> Shape {
    let (celsius, share) = (celsius(rows), rng.random_range(0.3..0.7));
    let limit = quantile(&celsius, share);
    Shape::new(celsius.iter().map(|c| flag(*c > limit)).collect(), |of| *of == Regressor::Temperature)
}

fn buckling(rows: &Rows, rng: &mut ChaCha8Rng) -> Shape {
    let (ranks, phase) = (ranks(&celsius(rows)), rng.random_range(0.0..TAU));
    Shape::new(ranks.iter().map(|r| (TAU * 1.3 * r + phase).sin()).collect(), |of| *of == Regressor::Temperature)
}

fn pilot_valve(rows: &Rows, rng: &mut ChaCha8Rng) -> Shape {
    let (supply, share) = (supply(rows), rng.random_range(0.3..0.7));
    let limit = quantile(&supply, share);
    Shape::new(supply.iter().map(|p| flag(*p < limit)).collect(), |of| *of == Regressor::Supply)
}

fn weak_leg(rows: &Rows, rng: &mut ChaCha8Rng) -> Shape {
    let ([leg], ranks) = (rows.actuators(rng), ranks(&supply(rows)));
    let share = rows.samples.iter().zip(ranks).map(|(sample, rank)| rank * f64::from(sample.word.digit(leg))).collect();
    Shape::new(share, move |of| *of == Regressor::Supply || of.is_of_actuator(leg))
}

/// Whether something is known of the word, at one of these actuators or of all digits.
fn is_of_word(of: &Regressor, actuators: &[usize]) -> bool {
    let is_digit = matches!(of, Regressor::Digit(_) | Regressor::Digits(_));
    *of == Regressor::Word || is_digit && actuators.iter().any(|&k| of.is_of_actuator(k))
}

fn is_of_place(of: &Regressor) -> bool {
    matches!(of, Regressor::ToolPosition | Regressor::Word | Regressor::Digit(_) | Regressor::Digits(_))
}

fn parity(rows: &Rows, rng: &mut ChaCha8Rng) -> Shape {
    let legs: [usize; 3] = rows.actuators(rng);
    let odd = |word: &Word| legs.iter().map(|&leg| u32::from(word.digit(leg) > 0)).sum::<u32>() % 2;
    Shape::new(rows.of(|sample| f64::from(odd(&sample.word))), move |of| is_of_word(of, &legs))
}

fn crowd(rows: &Rows, _: &mut ChaCha8Rng) -> Shape {
    let long = |word: &Word| (0..word.len()).filter(|&k| word.digit(k) > 0).count() as f64;
    let middle = 0.5 * rows.n_actuators as f64;
    let all: Vec<usize> = (0..rows.n_actuators).collect();
    Shape::new(rows.of(|sample| (long(&sample.word) - middle).powi(2)), move |of| is_of_word(of, &all))
}

fn each(rows: &Rows, rng: &mut ChaCha8Rng, key: impl Fn(&Sample) -> String) -> Shape {
    let mut own = BTreeMap::new();
    let share = rows.samples.iter().map(|sample| *own.entry(key(sample)).or_insert_with(|| normal(rng))).collect();
    Shape::new(share, is_of_place)
}

fn each_visit(rows: &Rows, rng: &mut ChaCha8Rng) -> Shape {
    let own: Vec<f64> = rows.stays.iter().map(|_| normal(rng)).collect();
    Shape { share: rows.stays.iter().map(|&stay| own[stay]).collect(), is_right: None }
}

fn slips(rows: &Rows, rng: &mut ChaCha8Rng) -> Shape {
    let often = rng.random_range(0.2..0.4);
    let slips: Vec<bool> = rows.stays.iter().map(|_| rng.random_bool(often)).collect();
    Shape { share: rows.stays.iter().map(|&stay| flag(slips[stay])).collect(), is_right: None }
}

/// Whether an actuator came to its digit by a stroke.
fn moved(sample: &Sample, actuator: usize) -> bool {
    sample.previous.is_some_and(|previous| previous.digit(actuator) != sample.word.digit(actuator))
}

fn blows(rows: &Rows, _: &mut ChaCha8Rng) -> Shape {
    let n = rows.n_actuators;
    let share = rows.of(|sample| ((0..n).filter(|&k| moved(sample, k)).count() as f64).powf(1.5));
    Shape::new(share, |of| matches!(of, Regressor::WordBefore(_)))
}

fn blow(rows: &Rows, rng: &mut ChaCha8Rng) -> Shape {
    let [leg] = rows.actuators(rng);
    Shape::new(rows.of(|sample| flag(moved(sample, leg))), move |of| *of == Regressor::WordBefore(leg))
}

fn before(rows: &Rows, rng: &mut ChaCha8Rng) -> Shape {
    let [leg, other] = rows.actuators(rng);
    let share = rows.of(|sample| {
        let was = sample.previous.is_some_and(|previous| previous.digit(other) > 0);
        flag(was != (sample.word.digit(leg) > 0))
    });
    Shape::new(share, move |of| *of == Regressor::WordBefore(other) || of.is_of_actuator(leg))
}

/// A coordinate of the tool, the one that varies most of two.
fn coordinate(rows: &Rows) -> Vec<f64> {
    let [x, y] = [0, 1].map(|axis| rows.of(|sample| sample.pose.position[axis]));
    let spread = |all: &[f64]| quantile(all, 0.9) - quantile(all, 0.1);
    if spread(&x) > spread(&y) { x } else { y }
}

fn ripples(rows: &Rows, rng: &mut ChaCha8Rng) -> Shape {
    let (ranks, waves) = (ranks(&coordinate(rows)), rng.random_range(1.2..2.5));
    Shape::new(ranks.iter().map(|r| (TAU * waves * r).sin()).collect(), is_of_place)
}

fn seam(rows: &Rows, rng: &mut ChaCha8Rng) -> Shape {
    let (ranks, seam) = (ranks(&coordinate(rows)), rng.random_range(0.3..0.7));
    Shape::new(ranks.iter().map(|r| (r - seam).abs()).collect(), is_of_place)
}

fn screen(rows: &Rows, rng: &mut ChaCha8Rng) -> Shape {
    let (ranks, edge) = (ranks(&coordinate(rows)), rng.random_range(0.3..0.7));
    Shape::new(ranks.iter().map(|r| flag(*r > edge)).collect(), is_of_place)
}

fn horn(rows: &Rows, _: &mut ChaCha8Rng) -> Shape {
    let servo = rows.of(|sample| sample.servos_rad.first().copied().unwrap_or_default());
    Shape::new(ranks(&servo).iter().map(|r| (TAU * 1.4 * r).cos()).collect(), |of| *of == Regressor::Servo(0))
}
