//! The packages of others in what is shipped: the tool and the firmware images that it embeds.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};
use serde_json::Value;
use spdx::{Expression, ParseMode};

use crate::image::Board;
use crate::setup;

/// A package of somebody else, in the version that is shipped.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Package {
    /// Its name.
    pub name: String,
    /// Its version.
    pub version: String,
    /// Its licence as an SPDX expression, as its manifest has it; empty where it has none.
    pub licence: String,
    /// Where its source is developed.
    pub repository: Option<String>,
    /// Where the source of this version can be had.
    pub source: String,
    /// The folder of its source on this machine, with its licence texts.
    pub folder: Option<PathBuf>,
    /// The licence text that its manifest names, relative to the folder.
    pub licence_file: Option<String>,
}

impl Package {
    /// Its licence; older manifests write `/` for `OR`.
    ///
    /// # Errors
    ///
    /// The manifest names none, or one that is not in SPDX's list.
    pub fn expression(&self) -> Result<Expression> {
        let Self { name, version, licence, .. } = self;
        Expression::parse_mode(licence, ParseMode::LAX)
            .map_err(|error| anyhow::anyhow!("{name} {version} has the licence {licence:?}: {}", error.reason))
    }
}

/// All packages of others in the tool and the images: crates, scripts of the live page, and the standard library.
///
/// # Errors
///
/// `cargo metadata` fails, or what it prints, the lock file of the scripts or the toolchain cannot be read.
pub fn packages() -> Result<BTreeSet<Package>> {
    let mut found = linked("darm", &host()?)?;
    for board in Board::ALL {
        found.extend(linked(board.package(), board.target())?);
    }
    found.extend(scripts(&setup::root().join("host/serve/vendor"))?);
    found.insert(standard_library()?);
    Ok(found)
}

/// The crates of others that a package of this workspace has in it when built for a target: its normal dependencies, theirs,
/// and so on. Code that these generate (macros) is in it too. Features are those of all packages of the workspace with the
/// boards' images, so a crate may be listed that this package could do without.
///
/// # Errors
///
/// `cargo metadata` fails, or does not know the package.
pub fn linked(package: &str, target: &str) -> Result<BTreeSet<Package>> {
    let chips: Vec<String> = Board::ALL.iter().map(|board| format!("{}/chip", board.package())).collect();
    let mut cargo = Command::new("cargo");
    cargo.current_dir(setup::root()).args(["metadata", "--locked", "--format-version", "1"]);
    cargo.args(["--filter-platform", target, "--features", &chips.join(",")]);
    let output = cargo.stderr(Stdio::inherit()).output().context("cargo did not start")?;
    let metadata: Value = serde_json::from_slice(&output.stdout).context("cargo metadata failed")?;
    let by_id = |list: &Value| -> BTreeMap<String, Value> {
        let all = list.as_array().into_iter().flatten();
        all.map(|it| (text(&it["id"]), it.clone())).collect()
    };
    let (packages, nodes) = (by_id(&metadata["packages"]), by_id(&metadata["resolve"]["nodes"]));
    let is_root = |it: &&Value| it["name"] == package && it["source"].is_null();
    let root = packages.values().find(is_root).with_context(|| format!("cargo metadata has no package {package}"))?;
    let (mut waiting, mut seen) = (vec![text(&root["id"])], BTreeSet::new());
    while let Some(id) = waiting.pop() {
        let dependencies = nodes.get(&id).and_then(|node| node["deps"].as_array()).into_iter().flatten();
        waiting
            .extend(dependencies.filter(|it| is_normal(it)).map(|it| text(&it["pkg"])).filter(|id| !seen.contains(id)));
        seen.insert(id);
    }
    Ok(seen.iter().filter_map(|id| packages.get(id)).filter(|it| !it["source"].is_null()).map(of_crate).collect())
}

/// Whether a dependency is more than one of the build or of tests.
fn is_normal(dependency: &Value) -> bool {
    dependency["dep_kinds"].as_array().into_iter().flatten().any(|it| it["kind"].is_null())
}

fn of_crate(package: &Value) -> Package {
    let [name, version] = ["name", "version"].map(|key| text(&package[key]));
    let manifest = text(&package["manifest_path"]);
    Package {
        licence: text(&package["license"]),
        repository: package["repository"].as_str().map(str::to_owned),
        source: format!("https://crates.io/crates/{name}/{version}"),
        folder: Path::new(&manifest).parent().map(Path::to_owned),
        licence_file: package["license_file"].as_str().map(str::to_owned),
        name,
        version,
    }
}

/// The packages of npm that are copied into a folder and served from there, as its lock file describes them.
fn scripts(folder: &Path) -> Result<BTreeSet<Package>> {
    let lock = folder.join("package-lock.json");
    let bytes = fs::read(&lock).with_context(|| format!("{} cannot be read", lock.display()))?;
    let lock: Value = serde_json::from_slice(&bytes).with_context(|| format!("{} is no JSON", lock.display()))?;
    let packages = lock["packages"].as_object().into_iter().flatten();
    let served = packages.filter(|(_, it)| it["dev"] != true);
    let named = served.filter_map(|(path, it)| Some((path.strip_prefix("node_modules/")?, it)));
    let found = named.map(|(name, it)| {
        let version = text(&it["version"]);
        Package {
            name: name.to_owned(),
            licence: text(&it["license"]),
            repository: None,
            source: format!("https://www.npmjs.com/package/{name}/v/{version}"),
            version,
            folder: Some(folder.join(name)),
            licence_file: None,
        }
    });
    Ok(found.collect())
}

/// The notice of the standard library and of what it contains, as the toolchain has it.
///
/// # Errors
///
/// The toolchain does not say where it is.
pub fn standard_library_notice() -> Result<PathBuf> {
    Ok(Path::new(rustc(&["--print", "sysroot"])?.trim()).join("share/doc/rust/COPYRIGHT-library.html"))
}

/// The standard library of the pinned toolchain, which the compiler links into the tool and, in part, into each image.
fn standard_library() -> Result<Package> {
    let version = rustc(&["--version"])?;
    let version = version.split_whitespace().nth(1).context("rustc --version has no version")?.to_owned();
    Ok(Package {
        name: "std".to_owned(),
        licence: "MIT OR Apache-2.0".to_owned(),
        repository: Some("https://github.com/rust-lang/rust".to_owned()),
        source: format!("https://static.rust-lang.org/dist/rustc-{version}-src.tar.xz"),
        version,
        folder: None,
        licence_file: None,
    })
}

/// The target of this machine.
fn host() -> Result<String> {
    let about = rustc(&["--version", "--verbose"])?;
    let host = about.lines().find_map(|line| line.strip_prefix("host: "));
    Ok(host.context("rustc --version --verbose names no host")?.to_owned())
}

fn rustc(arguments: &[&str]) -> Result<String> {
    // In the workspace, for its toolchain.
    let output = Command::new("rustc").current_dir(setup::root()).args(arguments).output();
    let output = output.context("rustc did not start")?;
    if !output.status.success() {
        bail!("rustc {} failed: {}", arguments.join(" "), String::from_utf8_lossy(&output.stderr));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

fn text(value: &Value) -> String {
    value.as_str().unwrap_or_default().to_owned()
}
