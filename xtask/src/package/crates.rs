//! The crates that are published, with what a registry requires of them.

use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};
use serde_json::Value;

use crate::setup;

/// Checks the manifests, and lets `cargo package` put the files of all published crates together, offline.
///
/// # Errors
///
/// Something is missing in a manifest, or `cargo package` refuses a crate.
pub fn check() -> Result<()> {
    let crates = published()?;
    let names = crates.iter().flat_map(|it| ["--package", it["name"].as_str().unwrap_or_default()]);
    let faults: Vec<String> = crates.iter().flat_map(|it| faults(it, &crates)).collect();
    if !faults.is_empty() {
        bail!("{}", faults.join("\n"));
    }
    let mut command = cargo(&["package", "--offline", "--allow-dirty", "--no-verify", "--quiet"]);
    if !command.args(names).status().context("cargo did not start")?.success() {
        bail!("cargo package failed; its output is above");
    }
    Ok(())
}

/// The members of the workspace that may be published, as `cargo metadata` describes them.
///
/// # Errors
///
/// `cargo metadata` fails.
pub fn published() -> Result<Vec<Value>> {
    let mut command = cargo(&["metadata", "--offline", "--no-deps", "--format-version", "1"]);
    let output = command.stderr(Stdio::inherit()).output().context("cargo did not start")?;
    let mut metadata: Value = serde_json::from_slice(&output.stdout).context("cargo metadata failed")?;
    let Some(Value::Array(members)) = metadata.get_mut("packages").map(Value::take) else {
        bail!("cargo metadata lists no packages");
    };
    Ok(members.into_iter().filter(|member| member["publish"].is_null()).collect())
}

/// What is missing in a manifest: texts that a registry shows, versions of path dependencies, dependencies that are published.
#[must_use]
pub fn faults(member: &Value, published: &[Value]) -> Vec<String> {
    let name = member["name"].as_str().unwrap_or_default();
    let is_published = |other: &Value| published.iter().any(|it| it["name"] == *other);
    let texts = ["description", "license", "readme"].into_iter();
    let without = texts.filter(|key| member[key].is_null()).map(|key| format!("{name}: no {key} in its Cargo.toml"));
    let dependencies = member["dependencies"].as_array().into_iter().flatten();
    let paths = dependencies.filter(|it| !it["path"].is_null() && it["kind"] != "dev");
    let unpublishable = paths
        .filter(|it| it["req"] == "*" || !is_published(&it["name"]))
        .map(|it| format!("{name}: its dependency on {} has no version, or that crate is not published", it["name"]));
    let folder = member["manifest_path"].as_str().map(Path::new).and_then(Path::parent);
    let licence = folder.is_some_and(|folder| folder.join("LICENSE").is_file());
    let unlicensed = (!licence).then(|| format!("{name}: no LICENSE in its folder; link that of the workspace"));
    without.chain(unpublishable).chain(unlicensed).collect()
}

fn cargo(arguments: &[&str]) -> Command {
    let mut command = Command::new("cargo");
    command.current_dir(setup::root()).args(arguments);
    command
}
