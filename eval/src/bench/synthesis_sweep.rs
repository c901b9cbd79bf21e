//! In how many draws a synthesis is exact, as the desired frames move away from the base-line's own.
//!
//! Each desired frame is moved in its own coordinates by exp(v): in the plane v_xy uniform in ±s m and v_θ in ±s/2 rad,
//! in space every component of v_p in ±s m and of v_ω in ±s/3 rad.

use std::collections::BTreeMap;

use anyhow::{Context, Result};
use darm_arm::arm::frames::DesiredFrame;
use darm_arm::arm::{Arm, ArmScratch};
use darm_arm::synthesis::{Bounds, Method, Obstacle, Options, Status, Synthesis, choose_words, synthesize};
use darm_core::se::{Pose, Twist};
use nalgebra::Vector3;
use rand::seq::index::sample;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::{IntoParallelIterator, ParallelIterator};

use crate::figures::Figure;
use crate::progress::Progress;
use xtask::setup;

const DRAWS: u64 = 200;
/// Draws of frames that any words may serve, and how many frames.
const CHOICES: u64 = 100;
const CHOSEN: usize = 8;
/// Starts of one synthesis, and of one within tight bounds, where most draws have no solution to be found.
const STARTS: u32 = 64;
const BOUNDED_STARTS: u32 = 6;
const PLANAR_WORDS: [&str; 5] = ["000000000000", "111000000000", "000111000000", "000000111000", "000000000111"];
const SERIAL_WORDS: [&str; 3] = ["000000000000", "111111000000", "000000111111"];

pub(super) fn measure() -> Result<Vec<Figure>> {
    let progress = Progress::shown();
    let mut figures = Vec::new();
    // Leg lengths above zero; a joint turns as it likes.
    let wide = Bounds { shortest: 1e-3, ..Bounds::none() };
    let planar = own_frames("planar4.toml", &PLANAR_WORDS)?;
    let serial = own_frames("serial12.toml", &SERIAL_WORDS)?;
    let bounded = (Bounds::default(), BOUNDED_STARTS, ", stroke >= 0, bounded");
    for (bounds, starts, note) in [(wide, STARTS, ""), bounded] {
        for (name, frames, sizes) in
            [("planar", &planar, &[0.1, 0.3, 0.5, 0.8][..]), ("serial", &serial, &[0.1, 0.3, 1.0][..])]
        {
            for &size in sizes {
                let share =
                    |method, starts| outcome(frames, size, Options { method, bounds, starts, ..Options::default() });
                let plain = share(Method::Plain, 1)?.exact;
                let ours = share(Method::Newton, starts)?;
                let title = format!("{name} synthesis exact at {size}{note}");
                progress.say(format!("{title}: {} %, plain Gauss-Newton {plain} %", ours.exact));
                figures.push(Figure::new(&format!("{title}, plain Gauss-Newton"), plain, "%")?);
                figures.push(Figure::new(&title, ours.exact, "%")?);
                figures.extend(ours.explained(&title)?);
            }
        }
    }
    figures.extend(chosen_words(&progress)?);
    Ok(figures)
}

/// In how many of 100 draws eight frames of any eight words, moved by s = 0.1, are met: words chosen, and words as drawn.
fn chosen_words(progress: &Progress) -> Result<Vec<Figure>> {
    let arm = Arm::read(&setup::root().join("examples/planar4.toml"))?;
    let exact = |seed: u64| -> Result<(bool, bool)> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let words: Vec<String> = sample(&mut rng, 1 << arm.n_actuators(), CHOSEN)
            .iter()
            .map(|word| format!("{word:0width$b}", width = arm.n_actuators()))
            .collect();
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        let own = own_frames("planar4.toml", &words)?;
        let desired = moved(&own.frames, 0.1, true, seed);
        let chosen = choose_words(&arm, &desired, &Options::default(), &|_| true)?;
        let fixed = synthesize(&arm, &desired, &Options::default())?;
        Ok((chosen.status == Status::Reached, fixed.status == Status::Reached))
    };
    let exact = (0..CHOICES).into_par_iter().map(exact).collect::<Result<Vec<_>>>()?;
    let share = |exact: usize| 100.0 * exact as f64 / CHOICES as f64;
    let chosen = share(exact.iter().filter(|(chosen, _)| *chosen).count());
    let fixed = share(exact.iter().filter(|(_, fixed)| *fixed).count());
    progress.say(format!("eight frames: {chosen} % with chosen words, {fixed} % with the words as drawn"));
    Ok(vec![
        Figure::new("eight frames exact, words chosen", chosen, "%")?,
        Figure::new("eight frames exact, words as drawn", fixed, "%")?,
    ])
}

/// An arm and its own frames for some words.
struct Own {
    arm: Arm,
    frames: Vec<DesiredFrame>,
}

fn own_frames(file: &str, words: &[&str]) -> Result<Own> {
    let arm = Arm::read(&setup::root().join("examples").join(file))?;
    let mut scratch = ArmScratch::default();
    let mut frames = Vec::new();
    for text in words {
        let word = text.parse().with_context(|| format!("{text} is no word"))?;
        let pose_base_tool = arm.model.chain.pose_base_tool(&word, &[], &mut scratch)?;
        frames.push(DesiredFrame {
            name: (*text).to_owned(),
            word,
            previous: arm.rest(),
            servos_rad: Vec::new(),
            pose_base_tool,
            weights: Default::default(),
        });
    }
    Ok(Own { arm, frames })
}

/// What became of the draws.
struct Outcome {
    /// Share with all frames met, %.
    exact: f64,
    /// Shares by what kept the nearest geometry from the frames, %.
    obstacles: BTreeMap<&'static str, f64>,
    /// Of each draw that is not exact the largest position error of the nearest geometry, mm.
    nearest_mm: Vec<f64>,
}

impl Outcome {
    /// Why the others are not exact, and how near the nearest geometry comes.
    fn explained(&self, title: &str) -> Result<Vec<Figure>> {
        let obstacle = |(obstacle, share): (&&str, &f64)| Figure::new(&format!("{title}: {obstacle}"), *share, "%");
        let mut figures = self.obstacles.iter().map(obstacle).collect::<Result<Vec<_>>>()?;
        let mut nearest_mm = self.nearest_mm.clone();
        nearest_mm.sort_by(f64::total_cmp);
        if let Some(median) = nearest_mm.get(nearest_mm.len() / 2) {
            figures.push(Figure::new(&format!("{title}: largest error of the nearest, median"), *median, "mm")?);
        }
        Ok(figures)
    }
}

/// In how many draws all frames are met, and why not in the others.
fn outcome(own: &Own, size: f64, options: Options) -> Result<Outcome> {
    let planar = own.arm.model.chain.is_planar();
    let found = |seed: u64| -> Result<Synthesis> {
        Ok(synthesize(&own.arm, &moved(&own.frames, size, planar, seed), &options)?)
    };
    let found = (0..DRAWS).into_par_iter().map(found).collect::<Result<Vec<_>>>()?;
    // What a plain search ends at may break the bounds: then it counts as not found.
    let (exact, missed): (Vec<_>, Vec<_>) =
        found.iter().partition(|found| found.status == Status::Reached && found.kept);
    let share = 100.0 / DRAWS as f64;
    let mut obstacles = BTreeMap::new();
    for missed in &missed {
        let name = match &missed.obstacle {
            Some(Obstacle::Bounds(_)) | None => "held back by bounds",
            Some(Obstacle::Singular { .. }) => "stopped by a singular platform",
            Some(Obstacle::OutOfReach) => "stretched, or in a hollow",
            Some(Obstacle::Unsettled) => "not at its end",
        };
        *obstacles.entry(name).or_default() += share;
    }
    let largest_mm = |found: &&Synthesis| 1e3 * found.frames.iter().map(|frame| frame.error_m).fold(0.0, f64::max);
    Ok(Outcome { exact: share * exact.len() as f64, obstacles, nearest_mm: missed.iter().map(largest_mm).collect() })
}

fn moved(frames: &[DesiredFrame], size: f64, planar: bool, seed: u64) -> Vec<DesiredFrame> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut within = |most: f64| rng.random_range(-most..most);
    let mut motion = || {
        if planar {
            let linear = Vector3::new(within(size), within(size), 0.0);
            return Twist { angular: Vector3::new(0.0, 0.0, within(size / 2.0)), linear };
        }
        let linear = Vector3::from_fn(|_, _| within(size));
        Twist { angular: Vector3::from_fn(|_, _| within(size / 3.0)), linear }
    };
    let moved = |frame: &DesiredFrame| {
        let pose_base_tool = frame.pose_base_tool * Pose::exp(&motion());
        DesiredFrame { pose_base_tool, ..frame.clone() }
    };
    frames.iter().map(moved).collect()
}
