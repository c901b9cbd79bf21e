//! The package in a clean Debian 12: a folder that `debootstrap` fills, entered with `chroot`, in its own namespaces of
//! mounts and processes, so that nothing that was started or mounted there outlives the check.

use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::setup;

const BY_HAND: &str = "install debootstrap yourself; it needs root";
const MIRROR: &str = "http://deb.debian.org/debian";
/// What runs in the root.
const SCRIPT: &str = include_str!("check.sh");

/// Installs the package in a clean Debian 12, uses it there without a toolchain, and removes it.
pub(super) fn check(deb: &Path) -> Result<()> {
    if !has("debootstrap") {
        setup::install(&["debootstrap"], BY_HAND)?;
    }
    let folder = tempfile::tempdir().context("no scratch folder for the root")?;
    let root = folder.path().join("root");
    eprintln!("set-up: unpacking a clean Debian 12 (about a minute)");
    let mut debootstrap = Command::new("debootstrap");
    debootstrap.args(["--variant=minbase", "--include=curl,ca-certificates", "bookworm"]).arg(&root).arg(MIRROR);
    run(debootstrap.stdout(std::process::Stdio::null()))?;
    fs::copy(deb, root.join("darm.deb")).with_context(|| format!("{} cannot be copied", deb.display()))?;
    fs::write(root.join("check.sh"), SCRIPT)?;
    let enter = "mount -t proc proc \"$1/proc\" && exec chroot \"$1\" /bin/bash /check.sh";
    let mut inside = Command::new("unshare");
    inside.args(["--mount", "--pid", "--fork", "--kill-child", "sh", "-c", enter, "sh"]).arg(&root);
    // Nothing of this machine's toolchain is found in the root.
    run(inside.env_clear().env("PATH", "/usr/sbin:/usr/bin:/sbin:/bin").env("HOME", "/root"))
}

fn has(program: &str) -> bool {
    Command::new("sh")
        .args(["-c", "command -v \"$1\" > /dev/null", "sh", program])
        .status()
        .is_ok_and(|it| it.success())
}

fn run(command: &mut Command) -> Result<()> {
    let name = command.get_program().to_string_lossy().into_owned();
    let status = command.status().with_context(|| format!("{name} did not start"))?;
    if !status.success() {
        bail!("{name} failed; its output is above");
    }
    Ok(())
}
