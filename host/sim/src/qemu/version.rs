//! Which emulator is installed.

use std::io;
use std::process::{Command, Stdio};

/// Name of the emulator's program.
pub const PROGRAM: &str = "qemu-system-arm";
/// Oldest version that knows the machine with its GPIO and USARTs.
pub const OLDEST: Version = Version { major: 9, minor: 1 };
/// A version of QEMU.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Version {
    /// First number.
    pub major: u32,
    /// Second number.
    pub minor: u32,
}

impl std::fmt::Display for Version {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}.{}", self.major, self.minor)
    }
}

/// Why there is no emulator.
#[derive(Debug, thiserror::Error)]
pub enum VersionError {
    /// The program is not installed.
    #[error(
        "{PROGRAM} is not installed; `sudo apt install qemu-system-arm`, on Debian 12 with `-t bookworm-backports`"
    )]
    Missing,
    /// The program is too old.
    #[error("{PROGRAM} is version {found}, {OLDEST} or newer is needed; Debian 12 has it in its backports")]
    TooOld {
        /// The version that is installed.
        found: Version,
    },
    /// The program did not print its version.
    #[error("{PROGRAM} --version said {text:?}")]
    Unreadable {
        /// What it said.
        text: String,
    },
    /// The program did not start.
    #[error("{PROGRAM}: {0}")]
    Io(#[from] io::Error),
}

/// Finds the emulator and its version; refuses one that is too old.
///
/// # Errors
///
/// The emulator is not installed, does not start, reports no version that can be read, or is too old.
pub fn find() -> Result<Version, VersionError> {
    let output = Command::new(PROGRAM).arg("--version").stdin(Stdio::null()).output().map_err(|e| match e.kind() {
        io::ErrorKind::NotFound => VersionError::Missing,
        _ => VersionError::Io(e),
    })?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let found = parse_version(&text).ok_or(VersionError::Unreadable { text })?;
    if found < OLDEST { Err(VersionError::TooOld { found }) } else { Ok(found) }
}

/// Reads `QEMU emulator version 10.0.2 (Debian …)`.
fn parse_version(text: &str) -> Option<Version> {
    let mut numbers = text.split("version ").nth(1)?.split(|c: char| !c.is_ascii_digit());
    Some(Version { major: numbers.next()?.parse().ok()?, minor: numbers.next()?.parse().ok()? })
}

#[cfg(test)]
mod tests {
    use super::{Version, parse_version};

    #[test]
    fn versions_are_read_and_compared() {
        let debian = "QEMU emulator version 10.0.2 (Debian 1:10.0.2+ds-2+deb13u1~bpo12+1)\nCopyright";
        assert_eq!(parse_version(debian), Some(Version { major: 10, minor: 0 }));
        assert!(parse_version("QEMU emulator version 7.2.19").is_some_and(|found| found < super::OLDEST));
        assert_eq!(parse_version("qemu"), None);
    }
}
