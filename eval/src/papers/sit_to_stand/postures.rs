//! Identification: from static postures, and with friction from motions.

use darm_measure::csv_text::csv_text;
use std::fs;
use std::io::Read as _;
use std::path::Path;

use anyhow::{Context, Result};
use darm_core::real::{Mat3, Vec3};
use darm_core::se::Pose;
use darm_core::tree::Inertia;
use darm_papers::identify::{self, Equations, Kind, Noise, Rows, Sample, Unknown, simulated};
use darm_robot::rigid_body::regressor::BodyMotion;
use darm_robot::robot::Robot;
use darm_robot::robot::base_parameters::BaseParameters;
use darm_robot::urdf::{self, Locks};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

use super::figure::figure;
use darm_figures::figure::Figure;
use xtask::setup;

/// Noise of the sensors, as the goal has it.
pub(super) const NOISE: Noise = Noise { torque_nm: 5.0, force_n: 5.0, moment_nm: 2.0 };
/// The sagittal plane: My, Fx, Fz.
const PLANE: [bool; 6] = [false, true, false, true, false, true];
/// Splits into 90 % and 10 %.
const SPLITS: usize = 1000;
/// What is missing in the CAD data, link by link: kg and place in the link, m. Half of it is a backpack.
const UNDECLARED: [(&str, f64, [f64; 3]); 4] = [
    ("shank", 6.0, [-0.05, 0.0, 0.22]),
    ("thigh", 9.0, [-0.06, 0.0, 0.20]),
    ("pelvis", 7.0, [-0.08, 0.0, 0.06]),
    ("torso", 26.0, [-0.22, 0.0, 0.26]),
];

/// How far masses (as a share) and their places (m) are drawn from these.
const DRAWN: (f64, f64) = (0.4, 0.03);

/// The robot as its file has it, as it is, and as it was identified.
pub(super) struct Robots {
    pub(super) cad: Robot,
    pub(super) real: Robot,
    pub(super) identified: Robot,
}

/// The planar robot.
pub(super) fn planar() -> Result<Robot> {
    let mut robot = urdf::read(&setup::root().join("tests/data/urdf/planar5.urdf"), &Locks::new())?;
    robot.floating = true;
    Ok(robot)
}

/// Adds a point of mass to a link.
pub(super) fn carry(robot: &mut Robot, joint: Option<usize>, mass: f64, at: Vec3<f64>) {
    let point = Inertia { mass, com: at, about_com: Mat3::zeros() };
    let inertia = match joint {
        Some(joint) => &mut robot.joints[joint].joint.inertia,
        None => &mut robot.base,
    };
    *inertia = inertia.joined(&point);
}

/// Joint positions of the 88 golden postures.
pub(super) fn golden() -> Result<(Vec<Vec<f64>>, Value)> {
    let path = setup::root().join("tests/data/golden/planar5_sit_to_stand.json.gz");
    let mut text = String::new();
    let file = fs::File::open(&path).with_context(|| format!("{} cannot be read", path.display()))?;
    flate2::read::GzDecoder::new(file).read_to_string(&mut text)?;
    let value: Value = serde_json::from_str(&text)?;
    let numbers =
        |posture: &Value| -> Option<Vec<f64>> { posture["q"].as_array()?.iter().skip(4).map(Value::as_f64).collect() };
    let postures = value["postures"].as_array().context("the golden data has no postures")?;
    let q =
        postures.iter().map(numbers).collect::<Option<Vec<_>>>().context("a golden posture is no row of numbers")?;
    Ok((q, value))
}

/// What the sensors of a robot measure in these postures, with its foot tilted by some angle in each.
pub(super) fn measured(robot: &Robot, postures: &[Vec<f64>], tilt: f64, random: &mut ChaCha8Rng) -> Vec<Sample> {
    let zero = vec![0.0; robot.joints.len()];
    let sample = |(line, q): (usize, &Vec<f64>)| {
        let mut base = BodyMotion::resting(&robot.gravity);
        base.pose = Pose::new(&Vec3::new(0.0, tilt * random.random_range(-1.0..1.0), 0.0), Vec3::zeros());
        let mut sample = simulated(robot, base, [q.clone(), zero.clone(), zero.clone()], &NOISE, random);
        sample.line = line + 2;
        sample
    };
    postures.iter().enumerate().map(sample).collect()
}

pub(super) fn equations(robot: &Robot, samples: &[Sample], kind: Kind) -> Result<Equations> {
    let rows = Rows { wrench: PLANE, torque: vec![true; robot.joints.len()] };
    Ok(Equations::new(robot, samples, &rows, NOISE, kind)?)
}

/// A robot whose undeclared masses are drawn about [`UNDECLARED`], identified from the golden postures.
pub(super) fn drawn(cad: &Robot, seed: u64) -> Result<Robots> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut real = cad.clone();
    for (link, mass, at) in UNDECLARED {
        let joint = real.joints.iter().position(|joint| joint.link == link);
        let aside = Vec3::new(random.random_range(-DRAWN.1..DRAWN.1), 0.0, random.random_range(-DRAWN.1..DRAWN.1));
        carry(&mut real, joint, mass * random.random_range(1.0 - DRAWN.0..1.0 + DRAWN.0), Vec3::from(at) + aside);
    }
    let samples = measured(&real, &golden()?.0, 0.0, &mut random);
    let equations = equations(cad, &samples, Kind::Static)?;
    let fit = equations.fit(Kind::Static);
    let identified = identify::with_masses(cad, &identify::link_masses(cad, &equations, &fit.values));
    Ok(Robots { cad: cad.clone(), real, identified })
}

pub(super) fn identify(figures: &mut Vec<Figure>, seed: u64, folder: &Path) -> Result<Robots> {
    let cad = planar()?;
    let mut real = cad.clone();
    for (link, mass, at) in UNDECLARED {
        let joint = real.joints.iter().position(|joint| joint.link == link);
        carry(&mut real, joint, mass, at.into());
    }
    let (postures, golden) = golden()?;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let samples = measured(&real, &postures, 0.0, &mut random);
    fs::write(folder.join("postures.csv"), csv(&cad, &samples))?;
    let flat = equations(&cad, &samples, Kind::Static)?;
    let tilted = equations(&cad, &measured(&real, &postures, 0.1, &mut random), Kind::Static)?;
    let rank = |key: &str| golden[key].as_f64().unwrap_or(f64::NAN);
    for (name, own, expected) in
        [("flat foot", &flat, rank("rank_flat_foot")), ("tilted foot", &tilted, rank("rank_with_tilt"))]
    {
        println!("base parameters, {name}: rank {} (golden data {expected})", own.directions().0);
        for parameter in &own.base_parameters().base {
            println!("  {}", BaseParameters::words(parameter, &cad));
        }
        figures.push(figure(&format!("rank, {name}, less the golden one"), own.directions().0 as f64 - expected, "")?);
    }
    let fit = flat.fit(Kind::Static);
    let held_out = identify::hold_out(&flat, 0.9, SPLITS, seed);
    let x = |of: [Option<f64>; 2]| of[0].unwrap_or(f64::NAN);
    let (own, noise) = (x(held_out.identified_m), x(held_out.noise_m));
    figures.push(figure("held-out centre of pressure, CAD", 1e3 * x(held_out.nominal_m), "mm")?);
    figures.push(figure("held-out centre of pressure, identified (paper 19.6)", 1e3 * own, "mm")?);
    figures.push(figure("noise of the centre of pressure", 1e3 * noise, "mm")?);
    figures.push(figure("held-out centre of pressure over its noise", own / noise, "")?);
    figures.push(figure("worst of 1000 splits over the noise", held_out.worst_m.unwrap_or(f64::NAN) / noise, "")?);
    let identified = identify::with_masses(&cad, &identify::link_masses(&cad, &flat, &fit.values));
    let [by_cad, by_own] = [com_error(&cad, &real, &postures)?, com_error(&identified, &real, &postures)?];
    figures.push(figure("centre of mass forward, CAD against the truth", 1e3 * by_cad, "mm")?);
    figures.push(figure("centre of mass forward, identified against the truth", 1e3 * by_own, "mm")?);
    named(figures, &cad, &flat)?;
    Ok(Robots { cad, real, identified })
}

/// RMS of x of the centre of mass over postures, m.
fn com_error(believed: &Robot, real: &Robot, postures: &[Vec<f64>]) -> Result<f64> {
    let mut sum = 0.0;
    for q in postures {
        sum += (believed.com(q)?.position.x - real.com(q)?.position.x).powi(2);
    }
    Ok((sum / postures.len() as f64).sqrt())
}

/// The masses on back and hoses, found one by one.
fn named(figures: &mut Vec<Figure>, cad: &Robot, equations: &Equations) -> Result<()> {
    let held_out: Vec<usize> = (0..equations.samples.len()).step_by(10).collect();
    let missing = identify::missing(cad, equations, &held_out);
    println!("undeclared: {UNDECLARED:?}");
    for named in &missing.named {
        println!(
            "  found: {} {:.2} kg (sd {:.2}), {}",
            named.links.join(" or "),
            named.mass_kg,
            named.mass_sd_kg,
            named.side
        );
    }
    let right =
        UNDECLARED.iter().filter(|(link, ..)| missing.named.iter().any(|named| named.links.iter().any(|l| l == link)));
    figures.push(figure("links of backpack and hoses found, of 4", right.count() as f64, "")?);
    figures.push(figure("held-out centre of pressure before they are added", 1e3 * missing.before_m[0], "mm")?);
    figures.push(figure("held-out centre of pressure after", 1e3 * missing.after_m[0], "mm")?);
    Ok(())
}

/// Equations (1) and (2): all ten parameters and friction, from a motion on the spot.
pub(super) fn from_motions(figures: &mut Vec<Figure>, robots: &Robots, seed: u64) -> Result<()> {
    let mut real = robots.real.clone();
    let friction = [(8.0, 3.0), (6.0, 2.0), (7.0, 4.0), (5.0, 1.5)];
    for (joint, (coulomb, viscous)) in real.joints.iter_mut().zip(friction) {
        (joint.friction, joint.damping) = (coulomb, viscous);
    }
    let mut random = ChaCha8Rng::seed_from_u64(seed + 1);
    let fitted = equations(&robots.cad, &samples(&real, &mut random), Kind::Moving)?;
    let fit = fitted.fit(Kind::Moving);
    let other = equations(&robots.cad, &samples(&real, &mut random), Kind::Moving)?;
    let all: Vec<usize> = (0..other.samples.len()).collect();
    let [own, _] = identify::rms_cop(&other, &fit.values, &all);
    let [cad, _] = identify::rms_cop(&other, &other.nominal, &all);
    let (columns, right) = other.stacked();
    let residual = (right.clone() - &columns * &fit.values).norm() / (right.len() as f64).sqrt();
    figures.push(figure("motions: identifiable sums, of 58", fit.rank as f64, "")?);
    figures.push(figure("motions: centre of pressure of another motion, CAD", 1e3 * cad, "mm")?);
    figures.push(figure("motions: the same, identified", 1e3 * own, "mm")?);
    figures.push(figure("motions: residual of all rows of another motion over the noise", residual, "")?);
    let error = |wanted: fn(&Unknown) -> Option<usize>, of: fn(&(f64, f64)) -> f64| {
        let found = fitted.unknowns.iter().zip(&fit.values).filter_map(|(u, value)| Some((wanted(u)?, *value)));
        found.map(|(joint, value)| (value - of(&friction[joint])).abs()).fold(0.0, f64::max)
    };
    let coulomb = error(|u| if let Unknown::Coulomb(k) = u { Some(*k) } else { None }, |f| f.0);
    let viscous = error(|u| if let Unknown::Viscous(k) = u { Some(*k) } else { None }, |f| f.1);
    figures.push(figure("motions: largest error of f_c (5 to 8 N m)", coulomb, "N·m")?);
    figures.push(figure("motions: largest error of f_v (1.5 to 4 N m s)", viscous, "N·m·s")?);
    figures.push(figure("motions: every body possible without a worse fit", f64::from(u8::from(fit.is_possible)), "")?);
    Ok(())
}

/// Samples of `real` on the spot, with its joints in waves.
fn samples(real: &Robot, random: &mut ChaCha8Rng) -> Vec<Sample> {
    let waves: Vec<[f64; 6]> =
        real.joints.iter().map(|_| std::array::from_fn(|_| random.random_range(-1.0..1.0))).collect();
    let sample = |k: u32| {
        let (base, state) = (BodyMotion::resting(&real.gravity), moving(&waves, f64::from(k) * 0.02));
        Sample { line: k as usize + 2, ..simulated(real, base, state, &NOISE, random) }
    };
    (0..400).map(sample).collect()
}

/// Positions, velocities and accelerations of three waves in each joint.
fn moving(waves: &[[f64; 6]], time_s: f64) -> [Vec<f64>; 3] {
    std::array::from_fn(|order| waves.iter().map(|wave| derivative(wave, order, time_s)).collect())
}

/// The derivative of this order of three waves of a joint, rad per second to that power.
fn derivative(wave: &[f64; 6], order: usize, time_s: f64) -> f64 {
    const RATES: [f64; 3] = [2.1, 3.7, 6.3];
    let part = |k: usize| {
        let (w, size) = (RATES[k], 0.35 / RATES[k] * 2.1);
        let phase = w * time_s + 3.0 * wave[k + 3];
        let turned = phase + order as f64 * std::f64::consts::FRAC_PI_2;
        size * wave[k] * w.powi(order as i32) * turned.sin()
    };
    (0..3).map(part).sum()
}

/// Samples as `darm com identify` reads them.
fn csv(robot: &Robot, samples: &[Sample]) -> String {
    let joints = || robot.joints.iter().map(|joint| joint.name.as_str());
    let head = joints().map(|name| format!("{name}_rad")).chain(joints().map(|name| format!("tau_{name}_nm")));
    let head: Vec<String> = head.chain(["Fx_n", "Fz_n", "My_nm"].map(str::to_owned)).collect();
    let rows = samples.iter().map(|sample| {
        let wrench = &sample.contacts[0].wrench;
        let ground = [wrench.force.x, wrench.force.z, wrench.moment.y];
        let cells = sample.state[0].iter().chain(&sample.torque).chain(&ground).map(|x| format!("{x:.6}"));
        cells.collect()
    });
    csv_text(std::iter::once(head).chain(rows))
}
