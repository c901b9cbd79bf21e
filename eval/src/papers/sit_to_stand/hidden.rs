//! The loop closed on identification: a mass that nobody declared, on robots that are drawn, and a person on a force plate.

use anyhow::{Context, Result};
use darm_core::real::Vec3;
use darm_diagnose::diagnosis::{SignalOptions, diagnose_file};
use darm_diagnose::linearise::model::{Model, Predictor};
use darm_diagnose::prepare::signals::Preparation;
use darm_measure::hold_out::HoldOut;
use darm_measure::table::Names;
use darm_papers::identify::{Kind, Missing, body_name, missing, separable};
use darm_robot::urdf::{self, Locks};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::figure::figure;
use super::postures::{carry, equations, golden, measured, planar};
use darm_figures::figure::Figure;
use darm_figures::progress::Progress;
use xtask::setup;

/// The mass over that of the robot.
const SHARE: [f64; 2] = [0.05, 0.15];
/// Where it can be: so far before and behind the axis of a link, m, and along the link from its joint to so far, m.
const ASIDE_M: f64 = 0.2;
const ALONG_M: [(&str, [f64; 2]); 5] = [
    ("foot", [-0.08, 0.08]),
    ("shank", [0.0, 0.4]),
    ("thigh", [0.0, 0.42]),
    ("pelvis", [0.0, 0.18]),
    ("torso", [0.0, 0.5]),
];

/// What came of one robot.
struct Found {
    link: String,
    mass_kg: f64,
    missing: Missing,
}

/// Robots with a mass on a link that is drawn, and complete ones.
pub(super) fn search(figures: &mut Vec<Figure>, progress: &Progress, robots: u64, seed: u64) -> Result<()> {
    let bar = progress.bar("robots", 2 * robots);
    let one = |k: u64, hidden: bool| {
        let found = robot(seed.wrapping_mul(1_000_003).wrapping_add(k), hidden);
        bar.inc(1);
        found
    };
    let found = (0..robots).into_par_iter().map(|k| one(k, true)).collect::<Result<Vec<_>>>()?;
    let clean = (0..robots).into_par_iter().map(|k| one(robots + k, false)).collect::<Result<Vec<_>>>()?;
    bar.finish_and_clear();
    let first = |found: &Found| found.missing.named.first().map(|named| named.links.clone()).unwrap_or_default();
    let right: Vec<&Found> = found.iter().filter(|f| first(f).contains(&f.link)).collect();
    for wrong in found.iter().filter(|f| !first(f).contains(&f.link)) {
        println!("  not found: {:.1} kg on the {}; named: {:?}", wrong.mass_kg, wrong.link, wrong.missing.named);
    }
    let alone = right.iter().filter(|f| first(f).len() == 1).count();
    let median = |numbers: Vec<f64>| {
        let mut sorted = numbers;
        sorted.sort_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
    };
    let off = right.iter().map(|f| (f.missing.named[0].mass_kg - f.mass_kg).abs()).collect();
    figures.push(figure(&format!("undeclared masses found on their link, of {robots}"), right.len() as f64, "")?);
    figures.push(figure("of them with one link named and no other", alone as f64, "")?);
    figures.push(figure(
        "robots with a second mass named that is not there",
        found.iter().filter(|f| f.missing.named.len() > 1).count() as f64,
        "",
    )?);
    figures.push(figure(
        &format!("masses named on {robots} complete robots"),
        clean.iter().filter(|f| !f.missing.named.is_empty()).count() as f64,
        "",
    )?);
    figures.push(figure("error of the mass, median", median(off), "kg")?);
    figures.push(figure(
        "held-out centre of pressure before, median",
        1e3 * median(found.iter().map(|f| f.missing.before_m[0]).collect()),
        "mm",
    )?);
    figures.push(figure(
        "held-out centre of pressure with the mass, median",
        1e3 * median(found.iter().map(|f| f.missing.after_m[0]).collect()),
        "mm",
    )?);
    Ok(())
}

fn robot(seed: u64, hidden: bool) -> Result<Found> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let cad = planar()?;
    let (postures, _) = golden()?;
    let links = separable(&cad, &equations(&cad, &measured(&cad, &postures, 0.0, &mut random), Kind::Static)?);
    let link = *links.get(random.random_range(0..links.len().max(1))).context("the postures separate no link")?;
    let name = body_name(&cad, link);
    let [low, high] = ALONG_M.iter().find(|(link, _)| *link == name).map_or([0.0, 0.1], |(_, along)| *along);
    let mass_kg = if hidden { cad.mass() * random.random_range(SHARE[0]..SHARE[1]) } else { 0.0 };
    let at = Vec3::new(random.random_range(-ASIDE_M..ASIDE_M), 0.0, random.random_range(low..high));
    let mut real = cad.clone();
    carry(&mut real, link, mass_kg, at);
    let equations = equations(&cad, &measured(&real, &postures, 0.0, &mut random), Kind::Static)?;
    let mut held_out: Vec<usize> = (0..postures.len()).collect();
    for k in 0..9 {
        let other = random.random_range(k..held_out.len());
        held_out.swap(k, other);
    }
    Ok(Found { link: name, mass_kg, missing: missing(&cad, &equations, &held_out[..9]) })
}

/// The person of `human_forceplate`, split A: bodies that can be, and the held-out centre of pressure.
pub(super) fn person(figures: &mut Vec<Figure>) -> Result<()> {
    let folder = setup::root().join("tests/data/measured");
    let robot = urdf::read(&folder.join("human.urdf"), &Locks::new())?;
    let preparation = Preparation {
        hold_out: HoldOut::Column("heldout".into()),
        lowpass_hz: Some(3.0),
        interpolate: Some("fresh".into()),
        ..Preparation::default()
    };
    let options =
        SignalOptions { preparation, always: vec!["mass-distribution".into()], seed: 1, ..SignalOptions::default() };
    let model = Model::from(Predictor::Wrench(robot));
    let diagnosis =
        diagnose_file(&model, &folder.join("human_wholebody_30hz.csv.gz"), &Names::new(), &options)?.diagnosis;
    let norm = |errors: &darm_diagnose::outcome::Errors| {
        errors.held_out.as_ref().map_or(f64::NAN, |figure| 1e3 * figure.norm.value)
    };
    figures.push(figure("person A, centre of pressure held out, tables", norm(&diagnosis.error.before), "mm")?);
    let after = (1e3 * norm(&diagnosis.error.after)).round() / 1e3;
    figures.push(figure("person A, centre of pressure held out, identified", after, "mm")?);
    Ok(())
}
