//! Known defects, put in one by one: in how many seeds the judges see each. A judge that sees none of them is blind.
//!
//! A mutant is a patch under `eval/simulate/mutants`; the text before its first `diff` line describes it, and a line `Chip: rp2040` there
//! lets it run on that board. It is applied in a copy of
//! the tree with a target folder that begins with the dependencies that the tree has built, so only this workspace's
//! crates are built again. A seed counts as caught where the mutant breaks a rule that the unchanged tree keeps.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result, anyhow, bail};

use darm_figures::figure::Figure;
use darm_figures::items::Job;
use darm_figures::results::Contents;
use darm_figures::shard::Shard;
use darm_sim::in_process::Chip;
use serde::{Deserialize, Serialize};

use crate::run::run;
use crate::script::Script;
use crate::summary::Record;

/// Begins the line that names the chip of a mutant.
const CHIP: &str = "Chip: ";

/// A defect as a patch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mutant {
    /// Its file.
    pub patch: PathBuf,
    /// Name of the file without its ending.
    pub name: String,
    /// What is wrong with it.
    pub description: String,
    /// The chip of the board on which it runs.
    pub chip: Chip,
}

/// A rule that was broken in a seed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Broken {
    /// The seed.
    pub seed: u64,
    /// The rule.
    pub rule: String,
}

/// What the judges saw of a mutant.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Caught {
    /// Seeds that ran.
    pub ran: u64,
    /// Rules that the mutant broke and the unchanged tree keeps, with their seeds; by seed.
    pub broken: Vec<Broken>,
}

impl Caught {
    /// Seeds in which it was caught, in order.
    pub fn seeds(&self) -> Vec<u64> {
        let mut seeds: Vec<u64> = self.broken.iter().map(|broken| broken.seed).collect();
        seeds.dedup();
        seeds
    }

    /// The rules that it broke, by name, with the number of their seeds.
    pub fn rules(&self) -> Vec<(&str, usize)> {
        let mut names: Vec<&str> = self.broken.iter().map(|broken| broken.rule.as_str()).collect();
        names.sort_unstable();
        names.chunk_by(|a, b| a == b).map(|same| (same[0], same.len())).collect()
    }
}

/// The mutants of a folder, by name.
///
/// # Errors
///
/// The folder or a patch cannot be read, or a patch has no description before its first `diff`.
pub fn list(folder: &Path) -> Result<Vec<Mutant>> {
    let mut mutants = Vec::new();
    for entry in std::fs::read_dir(folder).with_context(|| format!("{} cannot be read", folder.display()))? {
        let patch = entry?.path();
        if patch.extension().is_none_or(|extension| extension != "patch") {
            continue;
        }
        let text = std::fs::read_to_string(&patch)?;
        let head = text.lines().take_while(|line| !line.starts_with("diff "));
        let (chips, lines): (Vec<&str>, Vec<&str>) = head.partition(|line| line.starts_with(CHIP));
        let chip = match chips.first() {
            Some(line) => {
                line.trim_start_matches(CHIP).parse().map_err(|error| anyhow!("{}: {error}", patch.display()))?
            }
            None => Chip::default(),
        };
        let description = lines.join(" ");
        if description.trim().is_empty() {
            bail!("{}: the first line must describe the mutant", patch.display());
        }
        let name = patch.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        mutants.push(Mutant { patch, name, description, chip });
    }
    mutants.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(mutants)
}

/// Refuses mutants whose patches do not fit the tree, and names them all.
///
/// # Errors
///
/// A patch does not apply to the tree at `root`.
pub fn check(root: &Path, mutants: &[Mutant]) -> Result<()> {
    let no_longer_fits = |mutant: &&Mutant| {
        let mut apply = Command::new("git");
        // In a folder of another repository git would skip all files and call that a success.
        apply.env("GIT_CEILING_DIRECTORIES", root.parent().unwrap_or(root));
        apply.current_dir(root).args(["apply", "--check"]).arg(&mutant.patch);
        output(&mut apply).is_err()
    };
    let names: Vec<&str> = mutants.iter().filter(no_longer_fits).map(|mutant| mutant.name.as_str()).collect();
    if names.is_empty() {
        return Ok(());
    }
    bail!("these mutants no longer apply; adapt their patches to the code: {}", names.join(", "))
}

/// A copy of the tree in which mutants are put.
#[derive(Clone, Debug)]
pub struct Scratch {
    root: PathBuf,
    tree: PathBuf,
    target: PathBuf,
}

impl Scratch {
    /// The copy below the target folder of the tree at `root`; processes that share the tree have one each.
    ///
    /// # Errors
    ///
    /// What is built of the dependencies cannot be copied.
    pub fn new(root: &Path, shard: Shard) -> Result<Self> {
        let part = if shard.is_part() { format!("-{}", shard.number()) } else { String::new() };
        let [tree, target] =
            ["mutants", "mutants-target"].map(|name| root.join("target").join(name.to_owned() + &part));
        let root = root.to_owned();
        if !target.exists() {
            // Sources must be younger than what was built of others.
            let _ = std::fs::remove_dir_all(&tree);
            copy_dependencies(&root.join("target/debug"), &target.join("debug"))?;
        }
        Ok(Self { root, tree, target })
    }

    /// Puts a mutant in, builds it and runs its seeds; all of them, or until it is caught.
    ///
    /// # Errors
    ///
    /// The tree cannot be copied, the patch does not apply, the mutant does not build or start, or the results of its
    /// run cannot be read.
    pub fn judge(&self, mutant: &Mutant, seeds: Range<u64>, all: bool) -> Result<Caught> {
        self.copy_tree()?;
        let mut apply = Command::new("git");
        // The copy lies within the repository and is not to be taken for a part of it.
        apply.env("GIT_CEILING_DIRECTORIES", self.root.join("target"));
        output(apply.current_dir(&self.tree).arg("apply").arg(&mutant.patch))?;
        self.build()?;
        let mut caught = Caught::default();
        let (first, mut from) = (seeds.start, seeds.start);
        while from < seeds.end && (all || caught.broken.is_empty()) {
            let records = self.run(from..seeds.end, mutant.chip, all)?;
            from += records.len().max(1) as u64;
            caught.broken.extend(broken(&records).filter(|broken| !is_broken_unchanged(broken, mutant.chip)));
        }
        caught.ran = from - first;
        Ok(caught)
    }

    /// Makes the copy what the tree is now. Files that are the same are not touched: nothing is built for them.
    fn copy_tree(&self) -> Result<()> {
        std::fs::create_dir_all(&self.tree)?;
        let files = output(Command::new("git").current_dir(&self.root).args(["ls-files", "-z"]))?;
        for file in files.split('\0').filter(|file| !file.is_empty() && self.root.join(file).is_file()) {
            let (from, to) = (self.root.join(file), self.tree.join(file));
            let text = std::fs::read(&from).with_context(|| format!("{file} cannot be read"))?;
            if std::fs::read(&to).is_ok_and(|old| old == text) {
                continue;
            }
            std::fs::create_dir_all(to.parent().unwrap_or(&self.tree))?;
            std::fs::write(&to, text).with_context(|| format!("{file} cannot be copied"))?;
        }
        Ok(())
    }

    fn build(&self) -> Result<()> {
        let mut build = Command::new("cargo");
        // Not the tree's own: cargo names the artifacts of both alike, and one would be taken for the other.
        // A file or two differ from the mutant before; without this each would take a build of all host tools.
        build.current_dir(&self.tree).env("CARGO_TARGET_DIR", &self.target).env("CARGO_INCREMENTAL", "1");
        output(build.args(["build", "--quiet", "-p", "darm-simulate"])).map(drop)
    }

    fn run(&self, seeds: Range<u64>, chip: Chip, all: bool) -> Result<Vec<Record>> {
        let results = self.target.join("mutant.results");
        let _ = std::fs::remove_file(&results);
        let mut simulate = Command::new(self.target.join("debug/simulate"));
        simulate.args(["--seeds", &format!("{}..{}", seeds.start, seeds.end), "--no-shrink"]);
        simulate.args(["--chip", &chip.to_string(), "--shard", "1/1", "--results"]).arg(&results);
        if !all {
            simulate.arg("--until-broken");
        }
        // It fails when it finds something, which is what is wanted here.
        let ran = simulate.output().context("the mutant did not start")?;
        let bytes = std::fs::read(&results)
            .with_context(|| format!("the mutant did not run: {}", String::from_utf8_lossy(&ran.stderr)))?;
        let items = Contents::parse(&bytes, &results.display().to_string())?.items;
        let mut records: Vec<Record> =
            items.into_iter().map(|(_, record)| serde_json::from_value(record)).collect::<Result<_, _>>()?;
        records.sort_by_key(|record| record.seed);
        Ok(records)
    }
}

/// The rules that were broken, by seed.
fn broken(records: &[Record]) -> impl Iterator<Item = Broken> {
    records.iter().flat_map(|Record { seed, violations, .. }| {
        violations.iter().map(|violation| Broken { seed: *seed, rule: violation.rule.clone() })
    })
}

/// The known defects as independent items.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Mutants {
    /// Names of the mutants.
    names: Vec<String>,
    from: u64,
    to: u64,
    /// All seeds run, also after a mutant was caught.
    all_seeds: bool,
}

impl Mutants {
    /// All mutants, or those of some names.
    ///
    /// # Errors
    ///
    /// There is no mutant of one of these names, or a patch does not fit the tree.
    pub fn new(only: &[String], seeds: Range<u64>, all_seeds: bool) -> Result<Self> {
        let mut mutants = list(&folder())?;
        check(darm_figures::root(), &mutants)?;
        if let Some(name) = only.iter().find(|name| mutants.iter().all(|mutant| mutant.name != **name)) {
            bail!("there is no mutant {name:?} in eval/simulate/mutants");
        }
        mutants.retain(|mutant| only.is_empty() || only.contains(&mutant.name));
        let names = mutants.into_iter().map(|mutant| mutant.name).collect();
        Ok(Self { names, from: seeds.start, to: seeds.end, all_seeds })
    }
}

/// Where the patches are.
fn folder() -> PathBuf {
    darm_figures::root().join("eval/simulate/mutants")
}

impl Job for Mutants {
    const COMMAND: &'static str = "simulate --mutants";
    type Bench = (Scratch, Vec<Mutant>);
    type Outcome = Caught;

    fn items(&self) -> Result<Vec<String>> {
        Ok(self.names.clone())
    }

    fn bench(&self, shard: Shard) -> Result<Self::Bench> {
        Ok((Scratch::new(darm_figures::root(), shard)?, list(&folder())?))
    }

    fn run(&self, (scratch, mutants): &Self::Bench, item: usize) -> Result<Caught> {
        let mutant = mutants.iter().find(|mutant| mutant.name == self.names[item]).context("the patch is missing")?;
        scratch.judge(mutant, self.from..self.to, self.all_seeds)
    }

    /// Each is built in the same copy of the tree.
    fn runs_alone(&self, _: usize) -> bool {
        true
    }

    fn figures(&self, caught: &[Caught]) -> Result<Vec<Figure>> {
        for (name, caught) in self.names.iter().zip(caught) {
            let seeds = caught.seeds();
            match seeds.first() {
                Some(first) => println!("{name}: {} of {} seeds, first seed {first}", seeds.len(), caught.ran),
                None => println!("{name}: NOT CAUGHT in {} seeds", caught.ran),
            }
            caught.rules().iter().for_each(|(rule, count)| println!("  {rule}: {count}"));
        }
        let missed = caught.iter().filter(|caught| caught.broken.is_empty()).count();
        Ok(vec![
            Figure::new("mutants", self.names.len() as f64, "")?,
            Figure::new("mutants: not caught", missed as f64, "")?,
        ])
    }

    fn seed(&self) -> u64 {
        self.from
    }
}

/// Copies what was built of crates from elsewhere, with the times that cargo compares.
fn copy_dependencies(from: &Path, to: &Path) -> Result<()> {
    const OWN: [&str; 4] = ["darm", "libdarm", "xtask", "simulate"];
    for folder in ["deps", "build", ".fingerprint"] {
        let (from, to) = (from.join(folder), to.join(folder));
        std::fs::create_dir_all(&to)?;
        let Ok(entries) = std::fs::read_dir(&from) else { continue };
        let names = entries.filter_map(|entry| Some(entry.ok()?.file_name()));
        let names: Vec<_> =
            names.filter(|name| !OWN.iter().any(|own| name.to_string_lossy().starts_with(own))).collect();
        for some in names.chunks(200) {
            output(Command::new("cp").current_dir(&from).arg("-a").arg("-t").arg(&to).args(some))?;
        }
    }
    Ok(())
}

/// Whether the unchanged tree, which is this program, breaks the same rule in the same seed.
fn is_broken_unchanged(broken: &Broken, chip: Chip) -> bool {
    run(&Script::on(chip, broken.seed), false).verdict.has(&broken.rule)
}

fn output(command: &mut Command) -> Result<String> {
    let output = command.output().with_context(|| format!("{:?} did not start", command.get_program()))?;
    if !output.status.success() {
        bail!("{:?} failed: {}", command.get_program(), String::from_utf8_lossy(&output.stderr).trim());
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}
