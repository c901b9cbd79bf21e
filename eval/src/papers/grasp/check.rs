//! An independent judge of collisions: MuJoCo reads the same file of the hand, places its links and looks what touches.

use std::path::Path;
use std::process::Command;

use anyhow::{Context as _, Result, bail};
use darm_papers::grasp::assembly::HandFile;
use darm_papers::grasp::contact::Configuration;
use darm_papers::grasp::layout::{COORDINATES, JOINTS};
use serde_json::json;
use xtask::setup;

use crate::python;

const PACKAGES: [&str; 2] = ["mujoco==4.0.0", "numpy==2.4.6"];
/// Overlaps up to this are rounding of two programs, m.
const ROUNDING_M: f64 = 1e-8;

/// How many of the configurations collide.
pub(super) fn collisions(robot: &Path, file: &HandFile, configurations: &[Configuration]) -> Result<usize> {
    let folder = setup::root().join("target/papers/grasp");
    let python = python::environment(&folder.join("python"), &PACKAGES)?;
    let joints = file.cross_check.joints.as_flattened();
    let names: Vec<&str> = joints.iter().map(|joint| file.cross_check.robot.joints[*joint].name.as_str()).collect();
    let of_joints = |configuration: &Configuration| -> Vec<f64> {
        configuration.angles.chunks(COORDINATES).flat_map(|finger| &finger[..JOINTS]).copied().collect()
    };
    let question = json!({
        "robot": robot,
        "joints": names,
        "postures": configurations.iter().map(of_joints).collect::<Vec<_>>(),
        "unchecked": file.hand.overlapping(),
    });
    let path = folder.join("postures.json");
    std::fs::write(&path, question.to_string()).with_context(|| format!("{} cannot be written", path.display()))?;
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/src/papers/grasp/check.py");
    let output = Command::new(&python).arg(script).arg(&path).output()?;
    if !output.status.success() {
        bail!("{script} failed:\n{}", String::from_utf8_lossy(&output.stderr));
    }
    let found: Vec<(f64, Option<[String; 2]>)> =
        serde_json::from_slice(&output.stdout).context("check.py printed no JSON")?;
    if found.len() != configurations.len() {
        bail!("check.py judged {} of {} postures", found.len(), configurations.len());
    }
    let colliding = found.iter().filter(|(depth_m, _)| *depth_m > ROUNDING_M);
    for (depth_m, bodies) in colliding.clone().take(10) {
        eprintln!("by MuJoCo {} overlap by {:.2e} m", bodies.clone().unwrap_or_default().join(" and "), depth_m);
    }
    Ok(colliding.count())
}
