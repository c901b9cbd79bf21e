//! Masses and friction from motions of robots of published files, where the truth is known.

use std::path::Path;

use darm_core::real::Mat3;
use darm_core::tree::Inertia;
use darm_robot::rigid_body::inertia::pseudo_inertia;
use darm_robot::rigid_body::regressor::BodyMotion;
use darm_robot::urdf::{Locks, parse};
use darm_robot::{dh, mjcf};
use nalgebra::{DMatrix, DVector};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::fit::Fit;
use super::{Equations, Kind, Noise, Robot, Rows, Sample, Unknown, simulated};

const EXACT: Noise = Noise { torque_nm: 0.0, force_n: 0.0, moment_nm: 0.0 };

/// What a link may really be: as its file says, but with a mass and moments of inertia that a body can have.
fn as_a_body_can_be(said: &Inertia<f64>) -> Inertia<f64> {
    let of_mass = |about_com: Mat3<f64>| Mat3::identity() * (0.5 * about_com.trace()) - about_com;
    let least = Mat3::identity() * 1e-6;
    let mut second = (of_mass(said.about_com) + least).symmetric_eigen();
    let floor = 0.02 * second.eigenvalues.abs().sum();
    second.eigenvalues.apply(|value| *value = value.max(floor));
    let second = second.recompose();
    let about_com = Mat3::identity() * second.trace() - second;
    Inertia { mass: said.mass.max(0.005), about_com, ..*said }
}

/// A robot with other masses than its file says and friction, and rows of it.
fn random_motion(nominal: &Robot, noise: &Noise, seed: u64) -> (Robot, Vec<Sample>) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut real = nominal.clone();
    for joint in &mut real.joints {
        let own = &mut joint.joint.inertia;
        *own = as_a_body_can_be(own);
        let share = random.random_range(0.8..1.25);
        own.mass *= share;
        own.about_com *= share;
        own.com *= random.random_range(0.9..1.1);
        joint.friction = random.random_range(1.0..3.0);
        joint.damping = random.random_range(0.5..2.0);
    }
    let samples = moved(&real, noise, &mut random);
    (real, samples)
}

/// Rows of a robot on a fixed base at random states.
fn moved(real: &Robot, noise: &Noise, random: &mut ChaCha8Rng) -> Vec<Sample> {
    let states: Vec<[Vec<f64>; 3]> = (0..150)
        .map(|_| std::array::from_fn(|_| real.joints.iter().map(|_| random.random_range(-2.0..2.0)).collect()))
        .collect();
    let sample =
        |(line, state)| Sample { line, ..simulated(real, BodyMotion::resting(&real.gravity), state, noise, random) };
    states.into_iter().enumerate().map(sample).collect()
}

/// Noise of 1 % of what the sensors of a robot measure in such a motion.
fn of_sensors(robot: &Robot, seed: u64) -> Noise {
    let (_, samples) = random_motion(robot, &EXACT, seed);
    let size = |values: &dyn Fn(&Sample) -> f64| {
        0.01 * (samples.iter().map(values).sum::<f64>() / samples.len() as f64).sqrt()
    };
    let n = robot.joints.len() as f64;
    Noise {
        torque_nm: size(&|sample| sample.torque.iter().map(|torque| torque * torque).sum::<f64>() / n),
        force_n: size(&|sample| sample.contacts[0].wrench.force.norm_squared() / 3.0),
        moment_nm: size(&|sample| sample.contacts[0].wrench.moment.norm_squared() / 3.0),
    }
}

fn scaled(noise: &Noise, by: f64) -> Noise {
    Noise { torque_nm: by * noise.torque_nm, force_n: by * noise.force_n, moment_nm: by * noise.moment_nm }
}

/// A robot of a file, with the parameters that a motion of it gives back, and the true ones.
struct Identified {
    fit: Fit,
    equations: Equations,
    /// Errors of the parameters in the directions that the rows determine, in units of the priors.
    errors: DVector<f64>,
    /// Their standard deviations, in units of the priors.
    deviations: DVector<f64>,
}

impl Identified {
    fn new((name, text): (&str, &str), noise: f64, seed: u64) -> Self {
        let path = Path::new(name);
        let nominal = match path.extension().and_then(|ending| ending.to_str()) {
            Some("xml") => mjcf::parse(path, text, &Locks::new()).unwrap(),
            Some("toml") => dh::parse(path, text).unwrap(),
            _ => parse(path, text, &Locks::new()).unwrap(),
        };
        let own = of_sensors(&nominal, seed);
        let (real, samples) = random_motion(&nominal, &scaled(&own, noise), seed);
        let rows = Rows { wrench: [true; 6], torque: vec![true; nominal.joints.len()] };
        let equations = Equations::new(&nominal, &samples, &rows, own, Kind::Moving).unwrap();
        let fit = equations.fit(Kind::Moving);
        let truth = Equations::new(&real, &samples, &rows, own, Kind::Moving).unwrap().nominal;
        let reported = equations.directions().1;
        let errors = reported.tr_mul(&(&fit.values - truth).component_div(&equations.prior));
        let in_priors = DMatrix::from_fn(fit.values.len(), fit.values.len(), |a, b| {
            fit.covariance[(a, b)] / (equations.prior[a] * equations.prior[b])
        });
        let deviations = (reported.tr_mul(&in_priors) * &reported).diagonal().map(f64::sqrt);
        Self { fit, equations, errors, deviations }
    }
}

const ROBOTS: [(&str, &str); 11] = [
    ("planar5.urdf", include_str!("../../../../tests/data/urdf/planar5.urdf")),
    ("tx40.urdf", include_str!("../../../../tests/data/urdf/tx40.urdf")),
    ("ur10.urdf", include_str!("../../../../tests/data/urdf/ur10.urdf")),
    ("panda.urdf", include_str!("../../../../tests/data/urdf/panda.urdf")),
    ("allegro_hand.urdf", include_str!("../../../../examples/allegro_hand.urdf")),
    ("leap_hand.xml", include_str!("../../../../examples/leap_hand.xml")),
    ("finger.xml", include_str!("../../../../examples/finger.xml")),
    ("simple_humanoid.urdf", include_str!("../../../../tests/data/urdf/simple_humanoid.urdf")),
    ("human.urdf", include_str!("../../../../tests/data/measured/human.urdf")),
    ("puma560.toml", include_str!("../../../../examples/puma560.toml")),
    ("person.urdf", include_str!("../../../../tests/data/stand/person.urdf")),
];

#[test]
fn exact_motions_give_back_what_they_tell_with_possible_bodies() {
    for robot in ROBOTS {
        let name = robot.0;
        let Identified { fit, equations, errors, .. } = Identified::new(robot, 0.0, 3);
        assert!(
            errors.amax() < 1e-6 && fit.scatter < 1e-12 && fit.is_possible,
            "{name}: {} {}",
            errors.amax(),
            fit.scatter
        );
        assert!(bodies(&fit, &equations).all(|body| pseudo_inertia(&body).cholesky().is_some()), "{name}");
    }
}

/// χ² of n rows over n has the standard deviation √(2/n); of all errors 0.27 % are beyond three of their own.
#[test]
fn motions_with_noise_fit_within_it() {
    let (mut beyond, mut all) = (0.0, 0.0);
    for robot in ROBOTS {
        let name = robot.0;
        let Identified { fit, equations, errors, deviations } = Identified::new(robot, 1.0, 5);
        let n = equations.stacked().1.len() as f64;
        assert!((fit.scatter - 1.0).abs() < 4.0 * (2.0 / n).sqrt(), "{name}: {}", fit.scatter);
        beyond += errors.iter().zip(&deviations).filter(|(error, own)| error.abs() > 3.0 * **own).count() as f64;
        all += errors.len() as f64;
    }
    assert!(beyond < 0.0027 * all + 4.0 * (0.0027 * all).sqrt(), "{beyond} of {all}");
}

/// A link whose moments of inertia no body has: what rows say of it cannot be met.
#[test]
fn bodies_are_possible_where_the_rows_are_not() {
    let nominal =
        parse(Path::new("ur10.urdf"), include_str!("../../../../tests/data/urdf/ur10.urdf"), &Locks::new()).unwrap();
    let own = of_sensors(&nominal, 3);
    let mut wrong = nominal.clone();
    wrong.joints[3].joint.inertia.about_com *= -5.0;
    let samples = moved(&wrong, &EXACT, &mut ChaCha8Rng::seed_from_u64(3));
    let rows = Rows { wrench: [true; 6], torque: vec![true; 6] };
    let equations = Equations::new(&nominal, &samples, &rows, own, Kind::Moving).unwrap();
    let fit = equations.fit(Kind::Moving);
    assert!(!fit.is_possible && fit.scatter.is_finite());
    assert!(bodies(&fit, &equations).all(|body| pseudo_inertia(&body).cholesky().is_some()));
}

/// The inertial parameters of all bodies.
fn bodies<'a>(fit: &'a Fit, equations: &'a Equations) -> impl Iterator<Item = [f64; 10]> + 'a {
    let firsts = equations.unknowns.iter().enumerate();
    let firsts = firsts.filter(|(_, unknown)| matches!(unknown, Unknown::Inertial(inertial) if inertial.number == 0));
    firsts.map(|(first, _)| std::array::from_fn(|k| fit.values[first + k]))
}
