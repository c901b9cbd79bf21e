//! Times our kinematics and dynamics beside Pinocchio and the crates `k` and `dynibo` on the same models, postures and targets.
//!
//! Arguments: the folder with the golden data, and Pinocchio's program (`pinocchio.cpp`, built header-only); without it ours
//! and the crates are timed alone. Prints a line for each work: arm, work, ours, Pinocchio's, `k`'s, `dynibo`'s, in ns or as
//! the work says; `-` where there is none. Fails when the sides' results differ.

mod dynibo_crate;
mod k_crate;
mod models;
mod ours;
mod pinocchio;

use std::collections::HashMap;
use std::error::Error;
use std::path::Path;
use std::time::Instant;

use models::{Arm, POSTURES};

/// Repetitions of which the least time counts.
const RUNS: usize = 60;
/// How often the sides take turns, so that both meet the machine's quiet moments.
const ROUNDS: usize = 3;
/// What is not a time.
const REACHED: &str = "targets-reached";

/// What one side measured, by arm and work: nanoseconds, and a number by which the sides are compared.
type Measured = HashMap<String, (f64, f64)>;

/// Puts in what a later round measured: the least time counts.
fn keep_min(all: &mut Measured, round: Measured) {
    for (name, (ns, sum)) in round {
        let before = all.entry(name).or_insert((ns, sum));
        before.0 = before.0.min(ns);
    }
}

/// Times one work on all postures of an arm.
fn time<const N: usize>(into: &mut Measured, arm: &Arm<N>, work: &str, mut run: impl FnMut(&[[f64; N]; 3]) -> f64) {
    let (mut fastest, mut sum) = (f64::INFINITY, 0.0);
    for _ in 0..RUNS {
        sum = 0.0;
        let start = Instant::now();
        for posture in &arm.postures {
            sum += run(std::hint::black_box(posture));
        }
        fastest = fastest.min(start.elapsed().as_secs_f64() * 1e9 / POSTURES as f64);
    }
    into.insert(format!("{} {work}", arm.name), (fastest, sum));
}

/// Times inverse kinematics on all targets: the mean, the 99th percentile, and how many were reached.
fn time_inverse<const N: usize>(into: &mut Measured, arm: &Arm<N>, runs: usize, mut solve: impl FnMut(usize) -> bool) {
    let mut fastest = (f64::INFINITY, 0.0, 0);
    for _ in 0..runs {
        let mut reached = 0;
        let mut times = Vec::with_capacity(arm.targets.len());
        for index in 0..arm.targets.len() {
            let start = Instant::now();
            reached += usize::from(solve(index));
            times.push(start.elapsed().as_secs_f64() * 1e9);
        }
        let mean = times.iter().sum::<f64>() / times.len() as f64;
        if mean < fastest.0 {
            times.sort_by(f64::total_cmp);
            fastest = (mean, times[times.len() * 99 / 100], reached);
        }
    }
    let (mean, late, reached) = fastest;
    into.insert(format!("{} inverse-kinematics", arm.name), (mean, 0.0));
    into.insert(format!("{} inverse-kinematics-late", arm.name), (late, 0.0));
    into.insert(format!("{} {REACHED}", arm.name), (reached as f64, 0.0));
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args_os().skip(1);
    let (Some(folder), program) = (arguments.next(), arguments.next()) else {
        return Err("usage: peers GOLDEN_FOLDER [PROGRAM]".into());
    };
    let folder = Path::new(&folder);
    let panda = models::read::<7>(folder, "panda_urdf", 1)?;
    let ur10 = models::read::<6>(folder, "ur10_urdf", 2)?;
    let puma = models::read::<6>(folder, "puma560_dh", 3)?;
    let texts = [panda.text.as_str(), &ur10.text, &puma.text];
    let [mut ours, mut theirs, mut k, mut dynibo] = [(); 4].map(|()| Measured::new());
    for _ in 0..ROUNDS {
        let mut round = Measured::new();
        ours::measure(&mut round, &panda);
        ours::measure(&mut round, &ur10);
        ours::measure(&mut round, &puma);
        keep_min(&mut ours, round);
        let mut round = Measured::new();
        dynibo_crate::measure(&mut round, &panda)?;
        dynibo_crate::measure(&mut round, &ur10)?;
        dynibo_crate::measure(&mut round, &puma)?;
        keep_min(&mut dynibo, round);
        if let Some(program) = &program {
            keep_min(&mut theirs, pinocchio::measure(Path::new(program), &texts)?);
        }
    }
    k_crate::measure(&mut k, &panda)?;
    k_crate::measure(&mut k, &ur10)?;
    k_crate::measure(&mut k, &puma)?;
    let mut names: Vec<_> = ours.keys().collect();
    names.sort();
    for name in names {
        let (ns, sum) = ours[name];
        let shown = |side: &Measured| side.get(name).map_or("-".to_owned(), |(ns, _)| format!("{ns:.0}"));
        println!("{name} {ns:.0} {} {} {}", shown(&theirs), shown(&k), shown(&dynibo));
        for side in [&theirs, &k, &dynibo] {
            let Some((_, other)) = side.get(name) else { continue };
            // Not a number, which is what a refusal gives, is not near.
            let is_near = (sum - other).abs() <= 1e-9 * (1.0 + other.abs()) * POSTURES as f64;
            if !is_near {
                return Err(format!("{name}: the results differ: {sum} is not {other}").into());
            }
        }
    }
    Ok(())
}
