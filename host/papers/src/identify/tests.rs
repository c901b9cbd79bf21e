//! Masses of the planar robot from its golden postures: ranks, held-out errors, undeclared masses.

use std::path::Path;

use darm_core::dynamics::floating;
use darm_core::se::Wrench;
use darm_core::tree::Frames;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

use super::{Contact, Equations, Kind, Noise, Robot, Rows, Sample, hold_out, missing, simulated};
use darm_core::real::Vec3;
use darm_robot::rigid_body::regressor::{BodyMotion, link_motions};
use darm_robot::urdf::{Locks, parse};

fn robot() -> Robot {
    let text = include_str!("../../../../tests/data/urdf/planar5.urdf");
    let mut robot = parse(Path::new("planar5.urdf"), text, &Locks::new()).unwrap();
    robot.floating = true;
    robot
}

fn golden() -> Value {
    let packed = include_bytes!("../../../../tests/data/golden/planar5_sit_to_stand.json.gz");
    serde_json::from_reader(flate2::read::GzDecoder::new(&packed[..])).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

/// My, Fx and Fz.
const PLANE: [bool; 6] = [false, true, false, true, false, true];
const NOISE: Noise = Noise { torque_nm: 5.0, force_n: 5.0, moment_nm: 2.0 };

fn rows() -> Rows {
    Rows { wrench: PLANE, torque: vec![true; 4] }
}

/// The golden postures as samples: f is (Fx, Fy, M about the foot, τ) in their plane, y up.
fn samples() -> Vec<Sample> {
    let postures = golden();
    let of = |(line, posture): (usize, &Value)| {
        let (q, f) = (numbers(&posture["q"]), numbers(&posture["f"]));
        let wrench = Wrench { force: Vec3::new(f[0], 0.0, f[1]), moment: Vec3::new(0.0, -f[2], 0.0) };
        Sample {
            line: line + 2,
            base: BodyMotion::resting(&Vec3::new(0.0, 0.0, -9.81)),
            state: [q[4..].to_vec(), vec![0.0; 4], vec![0.0; 4]],
            torque: f[3..].to_vec(),
            contacts: vec![Contact { joint: None, wrench }],
        }
    };
    postures["postures"].as_array().unwrap().iter().enumerate().map(of).collect()
}

fn equations(samples: &[Sample]) -> Equations {
    Equations::new(&robot(), samples, &rows(), NOISE, Kind::Static).unwrap()
}

#[test]
fn rows_and_rank_are_those_of_the_golden_postures() {
    let (robot, golden, samples) = (robot(), golden(), samples());
    let sharp = Noise { torque_nm: 1.0, force_n: 1.0, moment_nm: 1.0 };
    let equations = Equations::new(&robot, &samples, &rows(), sharp, Kind::Static).unwrap();
    for (equation, posture) in equations.samples.iter().zip(golden["postures"].as_array().unwrap()) {
        let residual = &equation.columns * &equations.nominal - &equation.right;
        assert!(residual.amax() < 1e-9, "line {}: {residual}", equation.line);
        for (row, expected) in posture["Kg"].as_array().unwrap().iter().enumerate().skip(3) {
            let expected = numbers(expected);
            let ours = |k: usize| equation.columns[(row, 4 * (k / 3) + [0, 1, 3][k % 3])];
            assert!((0..15).all(|k| (ours(k) - expected[k]).abs() < 1e-5), "row {row}");
        }
    }
    assert_eq!(equations.directions().0, golden["rank_flat_foot"].as_u64().unwrap() as usize);
    assert_eq!(equations.base_parameters().base.len(), 10);
}

#[test]
fn a_tilted_foot_tells_one_more() {
    let (robot, mut samples) = (robot(), samples());
    for (k, sample) in samples.iter_mut().enumerate() {
        sample.base.pose = darm_core::se::Pose::new(&Vec3::new(0.0, 0.01 * (k % 7) as f64, 0.0), Vec3::zeros());
    }
    // The right side does not matter for the rank, and the check of signs leaves room for a few degrees.
    let equations = Equations::new(&robot, &samples, &rows(), NOISE, Kind::Static).unwrap();
    assert_eq!(equations.directions().0, golden()["rank_with_tilt"].as_u64().unwrap() as usize);
}

#[test]
fn exact_postures_give_back_what_they_tell() {
    let (mut robot, samples) = (robot(), samples());
    robot.joints[3].joint.inertia.mass = 30.0;
    robot.joints[1].joint.inertia.com.x = 0.05;
    let equations = Equations::new(&robot, &samples, &rows(), NOISE, Kind::Static).unwrap();
    let fit = equations.fit(Kind::Static);
    assert_eq!((fit.rank, fit.is_possible), (10, true));
    assert!(fit.scatter < 1e-16, "{}", fit.scatter);
    let held_out = hold_out(&equations, 0.9, 20, 1);
    assert!(held_out.identified_m[0].unwrap() < 1e-9 && held_out.nominal_m[0].unwrap() > 5e-3);
    assert_eq!(held_out.identified_m[1], None, "the lateral moment is not measured");
}

#[test]
fn a_hidden_mass_is_found_on_its_link_and_nothing_where_nothing_is() {
    let (robot, clean) = (robot(), samples());
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let mut noisy = |mut samples: Vec<Sample>| {
        for sample in &mut samples {
            let mut any = |size: f64| random.sample::<f64, _>(rand_distr::StandardNormal) * size;
            sample.torque.iter_mut().for_each(|torque| *torque += any(5.0));
            let wrench = &mut sample.contacts[0].wrench;
            wrench.force += Vec3::new(any(5.0), 0.0, any(5.0));
            wrench.moment.y += any(2.0);
        }
        samples
    };
    let held_out: Vec<usize> = (0..9).collect();
    let none = missing(&robot, &equations(&noisy(clean.clone())), &held_out);
    assert!(none.named.is_empty(), "{:?}", none.named);
    let mut loaded = robot.clone();
    let pack =
        darm_core::tree::Inertia { mass: 10.0, com: Vec3::new(-0.2, 0.0, 0.3), ..darm_core::tree::Inertia::none() };
    loaded.joints[3].joint.inertia = loaded.joints[3].joint.inertia.joined(&pack);
    let tree = loaded.tree::<4>().unwrap();
    let mut carried = clean;
    for sample in &mut carried {
        let mut frames = Frames::default();
        tree.place(&std::array::from_fn(|k| sample.state[0][k]), &mut frames);
        let (load, torque) = floating::gravity(&tree, &frames);
        sample.torque = torque.to_vec();
        sample.contacts[0].wrench = load;
    }
    let found = missing(&robot, &equations(&noisy(carried)), &held_out);
    assert_eq!(found.named[0].links, ["torso"]);
    assert!((found.named[0].mass_kg - 10.0).abs() < 1.0 && found.named[0].side.contains("behind"), "{:?}", found.named);
    assert!(found.after_m[0] < 4e-3 && found.before_m[0] > 8e-3, "{found:?}");
}

/// The wrench of one plate under the base, as two feet bear it: shares of it, and the joints' torques less what they feel of it.
fn on_feet(robot: &Robot, sample: &mut Sample, feet: [usize; 2]) {
    let [q, qd, qdd] = &sample.state;
    let moving = link_motions(robot, &sample.base, [q, qd, qdd]);
    let whole = sample.contacts[0].wrench;
    let contact = |(joint, share): (usize, f64)| {
        let wrench = Wrench { moment: whole.moment * share, force: whole.force * share };
        Contact { joint: Some(joint), wrench }
    };
    sample.contacts = feet.into_iter().zip([0.3, 0.7]).map(contact).collect();
    for contact in &sample.contacts {
        let parent = |joint: &usize| robot.joints[*joint].joint.parent;
        for joint in std::iter::successors(contact.joint, parent) {
            let pose = moving[joint].pose;
            let axis = pose.rotation * robot.joints[joint].joint.axis.direction;
            let moment = contact.wrench.moment - pose.position.cross(&contact.wrench.force);
            sample.torque[joint] -= axis.dot(&moment);
        }
    }
}

#[test]
fn two_feet_tell_as_much_as_one_plate() {
    let text = include_str!("../../../../tests/data/urdf/simple_humanoid.urdf");
    let mut robot = parse(Path::new("simple_humanoid.urdf"), text, &Locks::new()).unwrap();
    robot.floating = true;
    let foot = |name: &str| robot.frame(name).and_then(|frame| frame.joint).unwrap();
    let feet = [foot("l_ankle"), foot("r_ankle")];
    let mut real = robot.clone();
    let torso = robot.frame("torso").and_then(|frame| frame.joint).unwrap();
    let pack =
        darm_core::tree::Inertia { mass: 6.0, com: Vec3::new(-0.1, 0.05, 0.2), ..darm_core::tree::Inertia::none() };
    real.joints[torso].joint.inertia = real.joints[torso].joint.inertia.joined(&pack);
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let still = Noise { torque_nm: 0.0, force_n: 0.0, moment_nm: 0.0 };
    let n = robot.joints.len();
    let plate: Vec<Sample> = (0..14)
        .map(|line| {
            let mut base = BodyMotion::resting(&robot.gravity);
            let tilt = Vec3::from_fn(|_, _| random.random_range(-0.2..0.2));
            base.pose = darm_core::se::Pose::new(&tilt, Vec3::new(0.1, 0.0, 0.9));
            let q = (0..n).map(|_| random.random_range(-0.6..0.6)).collect();
            Sample { line, ..simulated(&real, base, [q, vec![0.0; n], vec![0.0; n]], &still, &mut random) }
        })
        .collect();
    let mut two = plate.clone();
    two.iter_mut().for_each(|sample| on_feet(&robot, sample, feet));
    let rows = Rows { wrench: [true; 6], torque: vec![true; n] };
    let of = |samples: &[Sample]| Equations::new(&robot, samples, &rows, NOISE, Kind::Static).unwrap();
    let (one, two) = (of(&plate), of(&two));
    assert_eq!(one.directions().0, two.directions().0);
    for (one, two) in one.samples.iter().zip(&two.samples) {
        let apart = one.measured_cop().into_iter().zip(two.measured_cop());
        assert!(apart.into_iter().all(|(a, b)| (a - b).abs() < 1e-12), "the centre of pressure of both feet together");
    }
    let fit = two.fit(Kind::Static);
    assert!(fit.scatter < 1e-16, "{}", fit.scatter);
    let held_out = hold_out(&two, 0.8, 3, 1);
    for k in 0..2 {
        assert!(held_out.identified_m[k].unwrap() < 0.2 * held_out.nominal_m[k].unwrap(), "{held_out:?}");
    }
}

#[test]
fn bad_samples_are_told() {
    let (robot, samples) = (robot(), samples());
    let new = |samples: &[Sample]| {
        Equations::new(&robot, samples, &rows(), NOISE, Kind::Static)
            .err()
            .map(|error| format!("{:?}: {error}", error.line()))
            .unwrap()
    };
    assert!(new(&samples[..1]).contains("at least 10"), "{}", new(&samples[..1]));
    let mut reversed = samples.clone();
    for sample in &mut reversed {
        sample.contacts[0].wrench = -sample.contacts[0].wrench;
    }
    assert!(new(&reversed).starts_with("Some(2): the contacts pull"), "{}", new(&reversed));
    let mut opposite = samples.clone();
    opposite.iter_mut().for_each(|sample| sample.torque[1] = -sample.torque[1]);
    assert!(new(&opposite).contains("knee"), "{}", new(&opposite));
    let equations = |samples: &[Sample]| Equations::new(&robot, samples, &rows(), NOISE, Kind::Static).unwrap();
    let turned = |samples: &[Sample]| {
        let equations = equations(samples);
        equations.turned(&equations.fit(Kind::Static))
    };
    let mut moment = samples.clone();
    moment.iter_mut().for_each(|sample| sample.contacts[0].wrench.moment.y *= -1.0);
    assert_eq!(turned(&moment).map(|(component, _)| component), Some(1), "My");
    let mut lost = samples;
    lost[4].torque[0] = f64::NAN;
    assert!(new(&lost).starts_with("Some(6):"), "{}", new(&lost));
}
