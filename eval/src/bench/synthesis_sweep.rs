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
use darm_figures::figure::Figure;
use darm_figures::items::Job;
use darm_figures::shard::Shard;
use nalgebra::Vector3;
use rand::seq::index::sample;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use xtask::setup;

use super::SEED;

const DRAWS: u64 = 200;
/// Draws of frames that any words may serve, and how many frames.
const CHOICES: u64 = 100;
const CHOSEN: usize = 8;
/// Starts of one synthesis, and of one within tight bounds, where most draws have no solution to be found.
const STARTS: u32 = 64;
const BOUNDED_STARTS: u32 = 6;
const PLANAR_WORDS: [&str; 5] = ["000000000000", "111000000000", "000111000000", "000000111000", "000000000111"];
const SERIAL_WORDS: [&str; 3] = ["000000000000", "111111000000", "000000111111"];

/// Sizes by which the frames of each arm move, m.
const PLANAR_SIZES: [f64; 4] = [0.1, 0.3, 0.5, 0.8];
const SERIAL_SIZES: [f64; 3] = [0.1, 0.3, 1.0];
const CHOICE: &str = "eight frames";

/// The complete sweep; it has no options.
#[derive(Serialize, Deserialize)]
pub(crate) struct SynthesisSweep {}

/// One arm, moved by one size, under one set of bounds.
struct Case {
    arm: &'static str,
    is_bounded: bool,
    size: f64,
}

impl Case {
    /// All cases, in the order of the report.
    fn all() -> Vec<Self> {
        let arms = [("planar", &PLANAR_SIZES[..]), ("serial", &SERIAL_SIZES[..])];
        let of = |is_bounded: bool| {
            arms.iter().flat_map(move |(arm, sizes)| sizes.iter().map(move |&size| Self { arm, is_bounded, size }))
        };
        of(false).chain(of(true)).collect()
    }

    fn title(&self) -> String {
        let note = if self.is_bounded { ", stroke >= 0, bounded" } else { "" };
        format!("{} synthesis exact at {}{note}", self.arm, self.size)
    }

    /// Bounds and starts. The wide ones keep leg lengths above zero; a joint turns freely.
    fn bounds(&self) -> (Bounds, u32) {
        let wide = Bounds { shortest: 1e-3, ..Bounds::none() };
        if self.is_bounded { (Bounds::default(), BOUNDED_STARTS) } else { (wide, STARTS) }
    }
}

/// The arms with their own frames.
pub(crate) struct Bench {
    cases: Vec<Case>,
    planar: Own,
    serial: Own,
}

/// What came of one item.
#[derive(Serialize, Deserialize)]
pub(crate) enum Outcome {
    /// One draw of one case.
    Draw { is_exact_plain: bool, is_exact: bool, obstacle: Option<String>, nearest_mm: f64 },
    /// One draw of eight frames.
    Choice { is_exact_chosen: bool, is_exact_fixed: bool },
}

impl Job for SynthesisSweep {
    const COMMAND: &'static str = "bench --synthesis-sweep";
    type Bench = Bench;
    type Outcome = Outcome;

    fn items(&self) -> Result<Vec<String>> {
        let cases = Case::all();
        let draws = cases.iter().flat_map(|case| (0..DRAWS).map(|draw| format!("{}, draw {draw}", case.title())));
        Ok(draws.chain((0..CHOICES).map(|draw| format!("{CHOICE}, draw {draw}"))).collect())
    }

    fn bench(&self, _: Shard) -> Result<Bench> {
        let planar = own_frames("planar4.toml", &PLANAR_WORDS)?;
        let serial = own_frames("serial12.toml", &SERIAL_WORDS)?;
        Ok(Bench { cases: Case::all(), planar, serial })
    }

    fn run(&self, bench: &Bench, item: usize) -> Result<Outcome> {
        let seed = (item as u64) % DRAWS;
        match bench.cases.get(item / DRAWS as usize) {
            Some(case) => draw(if case.arm == "planar" { &bench.planar } else { &bench.serial }, case, seed),
            None => choice(seed),
        }
    }

    fn figures(&self, outcomes: &[Outcome]) -> Result<Vec<Figure>> {
        let mut figures = Vec::new();
        let cases = Case::all();
        for (case, outcomes) in cases.iter().zip(outcomes.chunks(DRAWS as usize)) {
            figures.extend(figures_of(&case.title(), outcomes)?);
        }
        let chosen = &outcomes[cases.len() * DRAWS as usize..];
        let share =
            |is: fn(&Outcome) -> bool| 100.0 * chosen.iter().filter(|one| is(one)).count() as f64 / CHOICES as f64;
        let words_chosen = share(|one| matches!(one, Outcome::Choice { is_exact_chosen: true, .. }));
        let words_as_drawn = share(|one| matches!(one, Outcome::Choice { is_exact_fixed: true, .. }));
        figures.push(Figure::new("eight frames exact, words chosen", words_chosen, "%")?);
        figures.push(Figure::new("eight frames exact, words as drawn", words_as_drawn, "%")?);
        Ok(figures)
    }

    fn seed(&self) -> u64 {
        SEED
    }
}

/// Whether all frames of a draw are met, by a plain search and by the default; what kept the default from them.
fn draw(own: &Own, case: &Case, seed: u64) -> Result<Outcome> {
    let (bounds, starts) = case.bounds();
    let frames = moved(&own.frames, case.size, own.arm.model.chain.is_planar(), seed);
    let found =
        |method, starts| synthesize(&own.arm, &frames, &Options { method, bounds, starts, ..Options::default() });
    // What a plain search ends at may break the bounds: then it counts as not found.
    let is_exact = |found: &Synthesis| found.status == Status::Reached && found.kept;
    let (plain, ours) = (found(Method::Plain, 1)?, found(Method::Newton, starts)?);
    let obstacle = match &ours.obstacle {
        Some(Obstacle::Bounds(_)) | None => "held back by bounds",
        Some(Obstacle::Singular { .. }) => "stopped by a singular platform",
        Some(Obstacle::OutOfReach) => "stretched, or in a hollow",
        Some(Obstacle::Unsettled) => "not at its end",
    };
    Ok(Outcome::Draw {
        is_exact_plain: is_exact(&plain),
        is_exact: is_exact(&ours),
        obstacle: (!is_exact(&ours)).then(|| obstacle.to_owned()),
        nearest_mm: 1e3 * ours.frames.iter().map(|frame| frame.error_m).fold(0.0, f64::max),
    })
}

/// Whether eight frames of any eight words, moved by 0.1, are met: with chosen words, and with the words as drawn.
fn choice(seed: u64) -> Result<Outcome> {
    let arm = Arm::read(&setup::root().join("examples/planar4.toml"))?;
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
    let [is_exact_chosen, is_exact_fixed] = [&chosen, &fixed].map(|found| found.status == Status::Reached);
    Ok(Outcome::Choice { is_exact_chosen, is_exact_fixed })
}

/// The shares of one case, and why the others are not exact.
fn figures_of(title: &str, outcomes: &[Outcome]) -> Result<Vec<Figure>> {
    let share = 100.0 / outcomes.len() as f64;
    let (mut plain, mut exact) = (0, 0);
    let (mut obstacles, mut missed_mm) = (BTreeMap::<&str, usize>::new(), Vec::new());
    for outcome in outcomes {
        let Outcome::Draw { is_exact_plain, is_exact, obstacle, nearest_mm } = outcome else { continue };
        plain += usize::from(*is_exact_plain);
        exact += usize::from(*is_exact);
        if let Some(obstacle) = obstacle {
            *obstacles.entry(obstacle).or_default() += 1;
            missed_mm.push(*nearest_mm);
        }
    }
    let mut figures = vec![
        Figure::new(&format!("{title}, plain Gauss-Newton"), share * plain as f64, "%")?,
        Figure::new(title, share * exact as f64, "%")?,
    ];
    for (obstacle, count) in obstacles {
        figures.push(Figure::new(&format!("{title}: {obstacle}"), share * count as f64, "%")?);
    }
    missed_mm.sort_by(f64::total_cmp);
    if let Some(median) = missed_mm.get(missed_mm.len() / 2) {
        figures.push(Figure::new(&format!("{title}: largest error of the nearest, median"), *median, "mm")?);
    }
    Ok(figures)
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

fn moved(frames: &[DesiredFrame], size: f64, planar: bool, seed: u64) -> Vec<DesiredFrame> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut within = |limit: f64| rng.random_range(-limit..limit);
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
