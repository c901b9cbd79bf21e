//! What is missing on a fresh machine: the chip's target for the pinned toolchain, an emulator that knows the
//! board, a browser.
//!
//! Nothing is done twice: each part first looks whether it is there.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use crate::step;
use anyhow::{Context, Result};

// The source of the host tools, which are not built yet where a machine is set up.
#[expect(unreachable_pub, reason = "it is public there")]
#[path = "../../host/sim/src/qemu/version.rs"]
mod qemu;

/// The chip's target.
pub const TARGET: &str = "thumbv7em-none-eabihf";
/// The smallest core that `darm-core` is built for.
pub const SMALL_TARGET: &str = "thumbv6m-none-eabi";

/// The root of the workspace.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new(".")).to_path_buf()
}

/// The folder that cargo builds into.
pub fn target() -> PathBuf {
    env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), |folder| root().join(folder))
}

/// The toolchain that `rust-toolchain.toml` pins.
fn toolchain() -> Result<String> {
    let path = root().join("rust-toolchain.toml");
    let text = fs::read_to_string(&path).with_context(|| format!("{} cannot be read", path.display()))?;
    let file: toml::Table = text.parse().with_context(|| format!("{} is no TOML", path.display()))?;
    let channel = file.get("toolchain").and_then(|table| table.get("channel")).and_then(toml::Value::as_str);
    Ok(channel.with_context(|| format!("{} names no channel", path.display()))?.to_owned())
}

/// Adds the chip's target, and the smallest that the tests build for, to the pinned toolchain.
///
/// # Errors
///
/// The pinned toolchain cannot be read, or `rustup` cannot add a target to it.
pub fn rust() -> Result<()> {
    let toolchain = toolchain()?;
    let installed = Command::new("rustup").args(["target", "list", "--installed", "--toolchain", &toolchain]).output();
    let has = |output: &std::process::Output, target: &str| {
        String::from_utf8_lossy(&output.stdout).lines().any(|line| line == target)
    };
    if installed.is_ok_and(|output| has(&output, TARGET) && has(&output, SMALL_TARGET)) {
        return Ok(());
    }
    step::run(
        &format!("adding the targets {TARGET} and {SMALL_TARGET} to Rust {toolchain} (a few seconds)"),
        Command::new("rustup").args(["target", "add", "--toolchain", &toolchain, TARGET, SMALL_TARGET]),
        Duration::from_secs(300),
        &format!("run `rustup target add --toolchain {toolchain} {TARGET} {SMALL_TARGET}` where there is a network"),
    )
}

/// The emulator, or why there is none.
pub enum Emulator {
    /// It is there.
    Ready,
    /// It cannot be had here: one sentence why.
    Absent(String),
}

/// Finds the emulator or installs it. On a machine where neither works the reason comes back, not an error.
pub fn emulator() -> Emulator {
    match qemu::find() {
        Ok(_) => Emulator::Ready,
        Err(missing) => match install_emulator().and_then(|()| Ok(qemu::find()?)) {
            Ok(version) => {
                eprintln!("set-up: {version} is installed");
                Emulator::Ready
            }
            Err(error) => Emulator::Absent(format!("{missing}; {error:#}")),
        },
    }
}

const BY_HAND: &str = "install qemu-system-arm 9.1 or newer yourself (Debian 12: from bookworm-backports)";

/// Installs from the distribution where its version suffices, else from Debian's backports.
fn install_emulator() -> Result<()> {
    let scratch = tempfile::tempdir().context("no scratch folder for the package lists")?;
    let lists = scratch.path().join("lists");
    fs::create_dir_all(lists.join("partial"))?;
    let mut options = vec![format!("Dir::State::lists={}", lists.display())];
    let mut release = Vec::new();
    if let Some(sources) = backports(Path::new("/etc/apt"), &os_release())? {
        let parts = scratch.path().join("sources");
        fs::create_dir_all(&parts)?;
        fs::write(parts.join("backports.sources"), sources.text)?;
        options.push("Dir::Etc::sourcelist=/dev/null".into());
        options.push(format!("Dir::Etc::sourceparts={}", parts.display()));
        release = vec!["-t".to_owned(), sources.suite];
    }
    let apt = |arguments: &[&str]| {
        let mut command = as_root("apt-get");
        command.env("DEBIAN_FRONTEND", "noninteractive");
        command.args(options.iter().flat_map(|option| ["-o", option])).args(arguments);
        command
    };
    step::run("reading the package lists", &mut apt(&["update"]), Duration::from_secs(180), BY_HAND)?;
    let mut install = apt(&["install", "-y", "--no-install-recommends"]);
    install.args(&release).arg("qemu-system-arm");
    step::run("installing qemu-system-arm (about 15 s)", &mut install, Duration::from_secs(600), BY_HAND)
}

/// Finds the browser that the live page is tested in, with its driver, or installs both from the distribution.
///
/// # Errors
///
/// They are missing and cannot be installed here.
pub fn browser() -> Result<()> {
    if has("chromium") && has("chromedriver") {
        return Ok(());
    }
    install(&["chromium", "chromium-driver"], "install Chromium and chromedriver yourself")
}

/// Whether a program of this name can be started.
pub fn has(program: &str) -> bool {
    Command::new(program).arg("--version").stdin(Stdio::null()).output().is_ok_and(|output| output.status.success())
}

/// Where the emulator of the Pico is installed: Node.js looks for packages there.
pub fn pico_emulator_folder() -> PathBuf {
    target().join("pico-emulator")
}

/// Finds the emulator of the Pico or installs it: Node.js from the distribution, the package by `npm`, in the version that
/// the lock file pins.
pub fn pico_emulator() -> Emulator {
    let folder = pico_emulator_folder();
    let is_there = |folder: &Path| folder.join("node_modules/rp2040js/dist/esm/index.js").is_file();
    match install_pico_emulator(&folder, is_there(&folder)) {
        Ok(()) if is_there(&folder) => Emulator::Ready,
        Ok(()) => Emulator::Absent(format!("{} has no package rp2040js", folder.display())),
        Err(error) => Emulator::Absent(format!("{error:#}")),
    }
}

const NODE_BY_HAND: &str = "install Node.js 18 or newer with npm yourself";

fn install_pico_emulator(folder: &Path, is_there: bool) -> Result<()> {
    if !has("node") || !is_there && !has("npm") {
        install(&["nodejs", "npm"], NODE_BY_HAND)?;
    }
    if is_there {
        return Ok(());
    }
    fs::create_dir_all(folder)?;
    for name in ["package.json", "package-lock.json"] {
        fs::copy(root().join("host/sim/pico").join(name), folder.join(name))?;
    }
    let mut npm = Command::new("npm");
    npm.current_dir(folder).args(["ci", "--ignore-scripts", "--no-audit", "--no-fund"]);
    step::run(
        "installing rp2040js (a few seconds)",
        &mut npm,
        Duration::from_secs(120),
        "run `npm ci` where there is a network",
    )
}

/// Installs packages of the distribution.
///
/// # Errors
///
/// `apt-get` fails or takes longer than its limit. The error says `by_hand`: what a person can do.
pub fn install(packages: &[&str], by_hand: &str) -> Result<()> {
    let apt = |arguments: &[&str]| {
        let mut command = as_root("apt-get");
        command.env("DEBIAN_FRONTEND", "noninteractive").args(arguments);
        command
    };
    step::run("reading the package lists", &mut apt(&["update"]), Duration::from_secs(180), by_hand)?;
    let mut install = apt(&["install", "-y", "--no-install-recommends"]);
    let what = format!("installing {}", packages.join(", "));
    step::run(&what, install.args(packages), Duration::from_secs(600), by_hand)
}

/// Root runs the program itself; another user through `sudo` where that asks for no password.
fn as_root(program: &str) -> Command {
    let is_root = Command::new("id").arg("-u").output().is_ok_and(|output| output.stdout.trim_ascii() == b"0");
    if is_root {
        return Command::new(program);
    }
    let mut command = Command::new("sudo");
    command.args(["--non-interactive", program]).stderr(Stdio::inherit());
    command
}

/// A source list for one call of apt.
#[derive(Debug, PartialEq)]
struct Backports {
    text: String,
    suite: String,
}

fn os_release() -> String {
    fs::read_to_string("/etc/os-release").unwrap_or_default()
}

/// On Debian 12, whose own QEMU is too old: the machine's own Debian mirror with the backports beside its suite.
///
/// Elsewhere `None`: the distribution's package is taken as it is.
fn backports(apt: &Path, os_release: &str) -> Result<Option<Backports>> {
    if !os_release.lines().any(|line| line == "VERSION_CODENAME=bookworm") {
        return Ok(None);
    }
    let mirror = mirror(apt).unwrap_or_else(|| "http://deb.debian.org/debian".into());
    let suite = "bookworm-backports";
    let text = format!(
        "Types: deb\nURIs: {mirror}\nSuites: bookworm {suite}\nComponents: main\n\
         Signed-By: /usr/share/keyrings/debian-archive-keyring.gpg\n"
    );
    Ok(Some(Backports { text, suite: suite.into() }))
}

/// The mirror that serves the suite `bookworm` in the machine's own source entries, in either of apt's formats.
fn mirror(apt: &Path) -> Option<String> {
    let mut files: Vec<_> =
        fs::read_dir(apt.join("sources.list.d")).ok()?.flatten().map(|entry| entry.path()).collect();
    files.push(apt.join("sources.list"));
    files.sort();
    files.iter().filter_map(|path| fs::read_to_string(path).ok()).find_map(|text| mirror_in(&text))
}

fn mirror_in(text: &str) -> Option<String> {
    let is_bookworm = |words: &str| words.split_whitespace().any(|word| word == "bookworm");
    let stanza = text
        .split("\n\n")
        .find(|stanza| stanza.lines().filter_map(|line| line.strip_prefix("Suites:")).any(is_bookworm));
    let from_stanza = stanza.and_then(|stanza| stanza.lines().find_map(|line| line.strip_prefix("URIs:")));
    let from_line = || {
        let line = text.lines().find(|line| line.starts_with("deb ") && is_bookworm(line))?;
        line.split_whitespace().find(|word| word.contains("://"))
    };
    from_stanza.map(str::trim).or_else(from_line).map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_machines_own_mirror_is_found_in_both_formats() {
        let stanzas = "Types: deb\nURIs: http://other/security\nSuites: bookworm-security\n\n\
                       Types: deb\n# a remark\nURIs: http://mirror/debian\nSuites: bookworm bookworm-updates\n";
        assert_eq!(mirror_in(stanzas).as_deref(), Some("http://mirror/debian"));
        let lines = "deb http://a/security bookworm-security main\ndeb [arch=amd64] http://b/debian bookworm main\n";
        assert_eq!(mirror_in(lines).as_deref(), Some("http://b/debian"));
        assert_eq!(mirror_in("deb https://packages.example.org/apt cloud main\n"), None);
    }

    #[test]
    fn only_bookworm_needs_backports() {
        let none = Path::new("/nonexistent");
        assert_eq!(backports(none, "VERSION_CODENAME=trixie\n").unwrap(), None);
        let sources = backports(none, "ID=debian\nVERSION_CODENAME=bookworm\n").unwrap().unwrap();
        assert!(sources.text.contains("Suites: bookworm bookworm-backports\n"), "{}", sources.text);
    }
}
