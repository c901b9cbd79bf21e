//! Python with packages: a virtual environment that is made where it is missing.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use anyhow::Result;
use xtask::{setup, step};

/// The interpreter of the environment in `folder`, with these packages.
pub(crate) fn environment(folder: &Path, packages: &[&str]) -> Result<PathBuf> {
    let by_hand =
        format!("make it by hand: python3 -m venv {0}; {0}/bin/pip install {1}", folder.display(), packages.join(" "));
    let (python, complete) = (folder.join("bin/python"), folder.join("complete"));
    if complete.exists() {
        return Ok(python);
    }
    let create = || {
        let mut create = Command::new("python3");
        create.args(["-m", "venv"]).arg(folder);
        step::run("making a virtual environment", &mut create, Duration::from_secs(120), &by_hand)
    };
    if !python.exists() && create().is_err() {
        setup::install(&["python3-venv"], &by_hand)?;
        create()?;
    }
    let mut install = Command::new(folder.join("bin/pip"));
    install.args(["install", "--quiet"]).args(packages);
    step::run(&format!("installing {}", packages.join(", ")), &mut install, Duration::from_secs(3600), &by_hand)?;
    std::fs::write(&complete, packages.join("\n"))?;
    Ok(python)
}
