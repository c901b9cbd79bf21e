//! The Debian package. Its files are listed in `host/cli/Cargo.toml`; `cargo deb` writes it.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

use super::notice;
use crate::image;
use crate::setup;

/// The version of `cargo-deb` that is tried; a release installs this one.
const CARGO_DEB: &str = "3.8.0";
/// Completion scripts by shell, as `cargo deb` finds them.
const COMPLETIONS: [(&str, &str); 3] = [("bash", "darm"), ("zsh", "_darm"), ("fish", "darm.fish")];

/// Builds images, tool and package; the path of the package.
pub(super) fn build(debug: bool) -> Result<PathBuf> {
    install_cargo_deb()?;
    let tool = build_tool(debug)?;
    // A target folder for `cargo deb`, with what it would have built.
    let target = setup::target().join("deb");
    let release = target.join("release");
    let _ = fs::remove_dir_all(&target);
    fs::create_dir_all(&release)?;
    fs::copy(&tool, release.join("darm")).with_context(|| format!("{} cannot be copied", tool.display()))?;
    write_texts(&tool, &release)?;
    notice::write(&release)?;
    let mut package = cargo(["deb", "--no-build", "--quiet", "--package", "darm"]);
    package.args(maintainer().map(|maintainer| format!("--maintainer={maintainer}")));
    run(package.env("CARGO_TARGET_DIR", &target))?;
    only_package(&target.join("debian"))
}

/// Who makes the package: `DEBFULLNAME` and `DEBEMAIL`, as Debian's tools have it, else the identity that git has in this
/// repository. `None`: the one in `host/cli/Cargo.toml`, which reaches nobody.
fn maintainer() -> Option<String> {
    let variable = |name| std::env::var(name).ok().filter(|value| !value.is_empty());
    let name = variable("DEBFULLNAME").or_else(|| git_config("user.name"))?;
    let address = variable("DEBEMAIL").or_else(|| git_config("user.email"))?;
    Some(format!("{name} <{address}>"))
}

fn git_config(key: &str) -> Option<String> {
    let output = Command::new("git").current_dir(setup::root()).args(["config", key]).output().ok()?;
    let value = String::from_utf8_lossy(&output.stdout).trim().to_owned();
    Some(value).filter(|value| output.status.success() && !value.is_empty())
}

fn install_cargo_deb() -> Result<()> {
    let found = Command::new("cargo").args(["deb", "--version"]).output().is_ok_and(|output| output.status.success());
    if found {
        return Ok(());
    }
    eprintln!("set-up: installing cargo-deb {CARGO_DEB} (minutes)");
    run(&mut cargo(["install", "--locked", "cargo-deb", "--version", CARGO_DEB]))
}

/// Builds the tool with the images of all boards in it.
fn build_tool(debug: bool) -> Result<PathBuf> {
    let images = image::build_all()?;
    let mut command = cargo(["build", "--package", "darm", "--bin", "darm"]);
    run(command.args((!debug).then_some("--release")).env("DARM_IMAGES", images))?;
    Ok(setup::target().join(if debug { "debug" } else { "release" }).join("darm"))
}

/// Completion scripts and manual pages, which Debian wants compressed.
fn write_texts(tool: &Path, folder: &Path) -> Result<()> {
    let pages = folder.join("man");
    run(Command::new(tool).arg("man").arg(&pages))?;
    run(Command::new("gzip").args(["-9", "--no-name", "--recursive"]).arg(&pages))?;
    let completions = folder.join("completions");
    fs::create_dir_all(&completions)?;
    for (shell, file) in COMPLETIONS {
        let output = Command::new(tool).args(["completions", shell]).output().context("the tool did not start")?;
        if !output.status.success() {
            bail!("darm completions {shell} failed: {}", String::from_utf8_lossy(&output.stderr));
        }
        fs::write(completions.join(file), output.stdout)?;
    }
    Ok(())
}

fn only_package(folder: &Path) -> Result<PathBuf> {
    let files = fs::read_dir(folder).with_context(|| format!("{} cannot be read", folder.display()))?;
    let mut files = files.flatten().map(|file| file.path()).filter(|path| path.extension() == Some(OsStr::new("deb")));
    files.next().with_context(|| format!("cargo deb wrote no package to {}", folder.display()))
}

fn cargo<const N: usize>(arguments: [&str; N]) -> Command {
    let mut command = Command::new("cargo");
    command.current_dir(setup::root()).args(arguments);
    command
}

fn run(command: &mut Command) -> Result<()> {
    let name = command.get_program().to_string_lossy().into_owned();
    // Standard output has the path of the package and nothing else.
    let status = command.stdout(std::io::stderr()).status().with_context(|| format!("{name} did not start"))?;
    if !status.success() {
        bail!("{name} failed; its output is above");
    }
    Ok(())
}
