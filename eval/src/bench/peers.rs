//! Speed beside Pinocchio and the crates `k` and `dynibo`, on the same models, postures and targets in one run.
//!
//! Pinocchio comes as the PyPI wheel `pin`, headers and all, into a virtual environment under `target/peers`; the program
//! `xtask/peers/pinocchio.cpp` is compiled against it header-only for this machine, and so is our side. Both are cached.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use anyhow::{Context, Result, bail, ensure};

use darm_figures::figure::Figure;
use xtask::{setup, step};

use crate::python;

/// The release whose figures are in the README.
const PIN: &str = "pin==4.1.0";
const EIGEN: &str = "cmeel-eigen";
const BY_HAND: &str = "xtask/peers/README.md has the commands to do it by hand";
/// Boost's lists are as long as Pinocchio's list of joints.
const DEFINES: [&str; 5] = [
    "-DNDEBUG",
    "-DBOOST_MPL_LIMIT_LIST_SIZE=30",
    "-DBOOST_MPL_LIMIT_VECTOR_SIZE=30",
    "-DBOOST_FUSION_INVOKE_MAX_ARITY=12",
    "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
];
/// What has to be twice as fast as Pinocchio; the rest is shown.
const PROMISED: [&str; 8] = [
    "pose",
    "jacobian",
    "inverse-dynamics",
    "mass-matrix",
    "gravity",
    "com-jacobian",
    "regressor",
    "inverse-kinematics",
];
const REACHED: &str = "targets-reached";
/// How often all sides run: the ratio of one run differs from that of the next, and on a busy machine more so.
const RUNS: usize = 5;

/// Builds what is missing, runs both sides, and gives the times and their ratios.
pub(super) fn measure() -> Result<Vec<Figure>> {
    let root = setup::root();
    let folder = root.join("target/peers");
    fs::create_dir_all(&folder).with_context(|| format!("{} cannot be made", folder.display()))?;
    let theirs = pinocchio(&root, &folder, &python_wheel(&folder)?)?;
    let ours = ours(&root, &folder)?;
    let mut texts = Vec::new();
    for index in 1..=RUNS {
        eprintln!("running all sides, {index} of {RUNS} (about a minute)");
        let output = Command::new(&ours)
            .arg(root.join("tests/data/golden"))
            .arg(&theirs)
            .output()
            .with_context(|| format!("{} did not start", ours.display()))?;
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        if !output.status.success() {
            bail!("the comparison failed:\n{text}{}", String::from_utf8_lossy(&output.stderr));
        }
        texts.push(text);
    }
    figures(&texts)
}

/// Pinocchio's headers and libraries: the folder of the wheel, installed when it is missing.
fn python_wheel(folder: &Path) -> Result<PathBuf> {
    let venv = folder.join("venv");
    if let Some(found) = prefix(&venv) {
        return Ok(found);
    }
    python::environment(&venv, &[PIN, EIGEN])?;
    prefix(&venv).with_context(|| format!("{PIN} brought no headers; {BY_HAND}"))
}

/// The wheel's folder in a virtual environment, when its headers are there.
fn prefix(venv: &Path) -> Option<PathBuf> {
    let pythons = fs::read_dir(venv.join("lib")).ok()?.flatten();
    let folders = pythons.map(|python| python.path().join("site-packages/cmeel.prefix"));
    folders.into_iter().find(|folder| {
        let has = |header: &str| folder.join("include").join(header).exists();
        has("pinocchio/multibody.hpp") && has("boost/version.hpp") && has("eigen3/Eigen/Core")
    })
}

/// Compiles Pinocchio's side when its source is newer.
fn pinocchio(root: &Path, folder: &Path, prefix: &Path) -> Result<PathBuf> {
    let (source, program) = (root.join("xtask/peers/pinocchio.cpp"), folder.join("pinocchio"));
    let changed = |path: &Path| fs::metadata(path).and_then(|about| about.modified());
    if changed(&program).is_ok_and(|built| changed(&source).is_ok_and(|written| built > written)) {
        return Ok(program);
    }
    if Command::new("g++").arg("--version").output().is_err() {
        setup::install(&["g++"], BY_HAND)?;
    }
    let (include, lib) = (prefix.join("include"), prefix.join("lib"));
    // Compiled aside and moved, so that a build that was cut short is not taken for a program.
    let fresh = folder.join("pinocchio.new");
    let mut compile = Command::new("g++");
    compile.args(["-std=c++17", "-O3", "-march=native"]).args(DEFINES);
    compile.arg(format!("-I{}", include.display())).arg(format!("-I{}", include.join("eigen3").display()));
    compile.arg(&source).arg("-o").arg(&fresh).arg(format!("-L{}", lib.display()));
    compile.args(["-lboost_serialization", "-lboost_filesystem"]).arg(format!("-Wl,-rpath,{}", lib.display()));
    let what = "compiling Pinocchio for this machine (three to eight minutes, once)";
    step::run(what, &mut compile, Duration::from_secs(3600), BY_HAND)?;
    fs::rename(&fresh, &program).with_context(|| format!("{} cannot be moved", fresh.display()))?;
    Ok(program)
}

/// Compiles our side.
fn ours(root: &Path, folder: &Path) -> Result<PathBuf> {
    let target = folder.join("cargo");
    let mut build = Command::new("cargo");
    build.current_dir(root).args(["build", "--release", "--locked", "--manifest-path", "xtask/peers/Cargo.toml"]);
    build.env("RUSTFLAGS", "-C target-cpu=native").env("CARGO_TARGET_DIR", &target);
    step::run("compiling our side for this machine", &mut build, Duration::from_secs(1800), BY_HAND)?;
    Ok(target.join("release/peers"))
}

/// A line of the program: an arm, a work, and what the sides came to, where they do it.
struct Line<'a> {
    arm: &'a str,
    work: &'a str,
    ours: f64,
    /// Of Pinocchio, `k` and `dynibo`.
    theirs: [Option<f64>; 3],
}

fn line(text: &str) -> Result<Line<'_>> {
    let words: Vec<&str> = text.split_whitespace().collect();
    let [arm, work, ours, pinocchio, k, dynibo] = words[..] else { bail!("{text:?} is no line of six words") };
    let side = |word: &str| if word == "-" { Ok(None) } else { word.parse().map(Some) };
    Ok(Line { arm, work, ours: ours.parse()?, theirs: [side(pinocchio)?, side(k)?, side(dynibo)?] })
}

/// Prints the table of the least times of all runs, and gives median and worst of the ratios of each run beside their goals.
fn figures(runs: &[String]) -> Result<Vec<Figure>> {
    let runs: Vec<Vec<Line<'_>>> = runs.iter().map(|text| text.lines().map(line).collect()).collect::<Result<_>>()?;
    let first = runs.first().context("nothing was run")?;
    ensure!(!first.is_empty(), "the comparison printed nothing");
    println!("{:40} {:>10} {:>10} {:>10} {:>10}", "", "ours, ns", "Pinocchio", "k", "dynibo");
    let mut figures = Vec::new();
    for (index, &Line { arm, work, .. }) in first.iter().enumerate() {
        let same: Vec<&Line<'_>> = runs.iter().filter_map(|run| run.get(index)).collect();
        let is_same = same.iter().all(|line| (line.arm, line.work) == (arm, work));
        ensure!(same.len() == runs.len() && is_same, "the runs have different works");
        let min_of = |values: Vec<f64>| values.into_iter().fold(f64::INFINITY, f64::min);
        let ours = min_of(same.iter().map(|line| line.ours).collect());
        let theirs: [Vec<f64>; 3] = [0, 1, 2].map(|peer| same.iter().filter_map(|line| line.theirs[peer]).collect());
        let shown = |values: &Vec<f64>| if values.is_empty() { "-".into() } else { min_of(values.clone()).to_string() };
        let [pinocchio, k, dynibo] = theirs.each_ref().map(shown);
        println!("{:40} {ours:>10} {pinocchio:>10} {k:>10} {dynibo:>10}", format!("{arm} {work}"));
        if work == REACHED {
            figures.push(Figure::new(&format!("{arm}: {work}"), ours, "of 1000")?);
            continue;
        }
        for (name, peer) in [("Pinocchio's", 0), ("dynibo's", 2)] {
            let ratios = same.iter().filter_map(|line| line.theirs[peer].map(|theirs| line.ours / theirs));
            let mut ratios: Vec<f64> = ratios.map(|ratio| (ratio * 1000.0).round() / 1000.0).collect();
            ratios.sort_by(f64::total_cmp);
            if !PROMISED.contains(&work) || ratios.len() < runs.len() {
                continue;
            }
            let name = format!("{arm}: {work} over {name}");
            figures.push(Figure::new(&name, ratios[ratios.len() / 2], "of the time")?);
            figures.push(Figure::new(&format!("{name}, worst run"), ratios[ratios.len() - 1], "of the time")?);
        }
    }
    Ok(figures)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(runs: &[&str]) -> Result<Vec<f64>> {
        let runs: Vec<String> = runs.iter().map(|run| (*run).to_owned()).collect();
        Ok(figures(&runs)?.iter().map(|figure| figure.value).collect())
    }

    #[test]
    fn lines_become_ratios_of_each_run() {
        let [a, b, c] = ["100 400", "120 300", "90 300"].map(|times| {
            format!("ur10 pose {times} - 500\nur10 regressor 100 200 - -\nur10 targets-reached 1000 999 800 -\n")
        });
        let c = c.replace("reached 1000", "reached 998");
        let expected = [0.3, 0.4, 0.2, 0.24, 0.5, 0.5, 998.0];
        assert_eq!(values(&[&a, &b, &c]).unwrap(), expected, "median and worst, and the fewest targets of all runs");
    }

    #[test]
    fn what_is_no_comparison_is_refused() {
        for runs in [&[][..], &[""], &["words\n"], &["a pose 1 2 - 4\n", ""], &["a pose 1 2 - 4\n", "a mass 1 2 - 4\n"]]
        {
            assert!(values(runs).is_err(), "{runs:?}");
        }
    }
}
