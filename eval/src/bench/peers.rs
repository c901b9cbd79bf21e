//! Speed beside Pinocchio and the crates `k` and `dynibo`, on the same models, postures and targets in one run.
//!
//! Pinocchio comes as the PyPI wheel `pin`, headers and all, into a virtual environment under `target/peers`; the program
//! `xtask/peers/pinocchio.cpp` is compiled against it header-only for this machine, and so is our side. Both are cached.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use anyhow::{Context, Result, bail};

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

/// Builds what is missing, runs both sides, and gives the times and their ratios.
pub(super) fn measure() -> Result<Vec<Figure>> {
    let root = setup::root();
    let folder = root.join("target/peers");
    fs::create_dir_all(&folder).with_context(|| format!("{} cannot be made", folder.display()))?;
    let theirs = pinocchio(&root, &folder, &python_wheel(&folder)?)?;
    let ours = ours(&root, &folder)?;
    eprintln!("running all sides (about a minute)");
    let output = Command::new(&ours)
        .arg(root.join("tests/data/golden"))
        .arg(&theirs)
        .output()
        .with_context(|| format!("{} did not start", ours.display()))?;
    let text = String::from_utf8_lossy(&output.stdout);
    if !output.status.success() {
        bail!("the comparison failed:\n{text}{}", String::from_utf8_lossy(&output.stderr));
    }
    figures(&text)
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

/// Prints the table, and gives the ratios beside their goals.
fn figures(text: &str) -> Result<Vec<Figure>> {
    println!("{:40} {:>10} {:>10} {:>10} {:>10}", "", "ours, ns", "Pinocchio", "k", "dynibo");
    let mut figures = Vec::new();
    for line in text.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let [arm, work, ours, theirs, k, dynibo] = words[..] else { bail!("{line:?} is no line of six words") };
        println!("{:40} {ours:>10} {theirs:>10} {k:>10} {dynibo:>10}", format!("{arm} {work}"));
        let (ours, theirs): (f64, f64) = (ours.parse()?, theirs.parse()?);
        if work == REACHED {
            figures.push(Figure::new(&format!("{arm}: {work}"), ours, "of 1000")?);
        } else if PROMISED.contains(&work) {
            let mut push = |peer: &str, theirs: f64| -> Result<()> {
                let ratio = (ours / theirs * 1000.0).round() / 1000.0;
                figures.push(Figure::new(&format!("{arm}: {work} over {peer}"), ratio, "of the time")?);
                Ok(())
            };
            push("Pinocchio's", theirs)?;
            // It has no regressor, no Jacobian of the centre of mass, and another kind of inverse kinematics.
            if let Ok(dynibo) = dynibo.parse() {
                push("dynibo's", dynibo)?;
            }
        }
    }
    if figures.is_empty() {
        bail!("the comparison printed nothing");
    }
    Ok(figures)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_become_ratios_with_goals() {
        let lines = "panda_urdf pose 100 400 - 500\npanda_urdf regressor 100 200 - -\npanda_urdf targets-reached 1000 999 800 -\n";
        let reported = figures(lines).unwrap();
        assert_eq!(reported.iter().map(|figure| figure.value).collect::<Vec<_>>(), [0.25, 0.2, 0.5, 1000.0]);
        assert!(reported[1].name.ends_with("dynibo's"));
        assert!(figures("").is_err() && figures("words\n").is_err());
    }
}
