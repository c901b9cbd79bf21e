//! What is published: the Debian package of the tool, and the crates.
//!
//! | file         | holds                                                                  |
//! |--------------|------------------------------------------------------------------------|
//! | `deb`        | builds the package: tool with the images in it, completions, man pages  |
//! | `clean_root` | installs, uses and removes it in a clean Debian 12                      |
//! | `check.sh`   | the same as commands, which run in that Debian                          |
//! | `notice`     | the notice of what others wrote                                         |
//! | `crates`     | which crates are published, and that `cargo package` accepts them       |

mod clean_root;
pub mod crates;
mod deb;
pub mod notice;

use std::path::PathBuf;

use anyhow::Result;

/// Builds the Debian package of the tool and prints its path, or checks what is published
#[derive(clap::Args)]
pub struct Command {
    /// Build the tool as tests do, which is faster; not for a release
    #[arg(long)]
    debug: bool,
    /// Install the package in a clean Debian 12, use it there without a toolchain, remove it; needs root and a network
    #[arg(long)]
    check: bool,
    /// Package of an earlier call to check
    #[arg(long, value_name = "DEB", requires = "check")]
    deb: Option<PathBuf>,
    /// Only check that `cargo package` accepts every crate that is published, without a network and without compiling them
    #[arg(long, conflicts_with_all = ["debug", "check"])]
    crates: bool,
}

impl Command {
    /// Builds or checks.
    ///
    /// # Errors
    ///
    /// The package does not build, or a check fails.
    pub fn run(self) -> Result<()> {
        if self.crates {
            return crates::check();
        }
        let deb = match self.deb {
            Some(deb) => deb,
            None => deb::build(self.debug)?,
        };
        if self.check {
            clean_root::check(&deb)?;
        }
        println!("{}", deb.display());
        Ok(())
    }
}
