//! Known defects, put in one by one: in how many seeds the judges see each. A judge that sees none of them is blind.
//!
//! A mutant is a patch under `eval/mutants`; what stands before its first `diff` line describes it.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result, bail};
use serde_json::Value;

/// A defect as a patch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mutant {
    /// Its file.
    pub patch: PathBuf,
    /// Name of the file without its ending.
    pub name: String,
    /// What is wrong with it.
    pub description: String,
}

/// In how many seeds a mutant broke which rules.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Caught {
    /// Seeds with any violation.
    pub seeds: u64,
    /// Seeds by rule.
    pub rules: Vec<(String, u64)>,
}

impl Caught {
    /// Rules that were broken in more seeds than before: rule, seeds, seeds before.
    pub fn more_than(&self, before: &Self) -> Vec<(&str, u64, u64)> {
        let seeds_before =
            |rule: &str| before.rules.iter().find(|(name, _)| name == rule).map_or(0, |(_, seeds)| *seeds);
        let compared = self.rules.iter().map(|(rule, seeds)| (rule.as_str(), *seeds, seeds_before(rule)));
        compared.filter(|(_, seeds, before)| seeds > before).collect()
    }
}

/// The mutants of a folder, by name.
pub fn list(folder: &Path) -> Result<Vec<Mutant>> {
    let mut mutants = Vec::new();
    for entry in std::fs::read_dir(folder).with_context(|| format!("{} cannot be read", folder.display()))? {
        let patch = entry?.path();
        if patch.extension().is_none_or(|extension| extension != "patch") {
            continue;
        }
        let text = std::fs::read_to_string(&patch)?;
        let description = text.lines().take_while(|line| !line.starts_with("diff ")).collect::<Vec<_>>().join(" ");
        if description.trim().is_empty() {
            bail!("{}: the first line must describe the mutant", patch.display());
        }
        let name = patch.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        mutants.push(Mutant { patch, name, description });
    }
    mutants.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(mutants)
}

/// Puts a fresh copy of the workspace's committed and changed files at `scratch`.
pub fn copy(root: &Path, scratch: &Path) -> Result<()> {
    std::fs::create_dir_all(scratch)?;
    let files = output(Command::new("git").current_dir(root).args(["ls-files", "-z"]))?;
    for file in files.split('\0').filter(|file| !file.is_empty() && root.join(file).is_file()) {
        let (from, to) = (root.join(file), scratch.join(file));
        let same = std::fs::read(&to).is_ok_and(|old| std::fs::read(&from).is_ok_and(|new| new == old));
        if same {
            continue;
        }
        std::fs::create_dir_all(to.parent().unwrap_or(scratch))?;
        std::fs::copy(&from, &to).with_context(|| format!("{file} cannot be copied"))?;
    }
    Ok(())
}

/// Applies a mutant in the scratch copy, builds it and runs it over the seeds. The unchanged tree where `mutant` is `None`.
pub fn judge(root: &Path, scratch: &Path, mutant: Option<&Mutant>, seeds: &str) -> Result<Caught> {
    copy(root, scratch)?;
    if let Some(Mutant { patch, name, .. }) = mutant {
        let mut apply = Command::new("git");
        // The copy lies within the repository and is not to be taken for a part of it.
        apply.env("GIT_CEILING_DIRECTORIES", scratch.parent().unwrap_or(scratch));
        apply.current_dir(scratch).arg("apply").arg(patch);
        output(&mut apply)
            .with_context(|| format!("the mutant {name} no longer applies; adapt {}", patch.display()))?;
    }
    let json = scratch.join("caught.json");
    let mut simulate = Command::new("cargo");
    // Not the tree's own: cargo names the artifacts of both alike, and one would be taken for the other.
    simulate.current_dir(scratch).env("CARGO_TARGET_DIR", root.join("target/mutants-target"));
    simulate.args(["run", "--quiet", "-p", "darm-eval", "--bin", "simulate", "--"]);
    simulate.args(["--seeds", seeds, "--no-shrink", "--json"]).arg(&json);
    // It fails when it finds something, which is what is wanted here: its figures tell.
    let _ = std::fs::remove_file(&json);
    let ran = simulate.output().context("cargo did not start")?;
    let text = std::fs::read_to_string(&json)
        .with_context(|| format!("the mutant did not run: {}", String::from_utf8_lossy(&ran.stderr)))?;
    caught(&text)
}

fn caught(json: &str) -> Result<Caught> {
    let figures: Value = serde_json::from_str(json)?;
    let rows = figures["rows"].as_array().context("no rows")?;
    let mut caught = Caught { seeds: 0, rules: Vec::new() };
    for row in rows {
        let (Some(name), Some(value)) = (row["name"].as_str(), row["value"].as_f64()) else { continue };
        if name == "simulate: seeds with a violation" {
            caught.seeds = value as u64;
        } else if let Some(rule) = name.strip_prefix("violated, ") {
            caught.rules.push((rule.to_owned(), value as u64));
        }
    }
    Ok(caught)
}

fn output(command: &mut Command) -> Result<String> {
    let output = command.output().with_context(|| format!("{:?} did not start", command.get_program()))?;
    if !output.status.success() {
        bail!("{:?} failed: {}", command.get_program(), String::from_utf8_lossy(&output.stderr).trim());
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}
