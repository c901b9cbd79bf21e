//! Whether a command may overwrite files that exist: with `--force`, or when the person at the terminal agrees.
//!
//! An option that names a file to write has the type [`OutputFile`]. All of them are looked at before a command runs, so that none
//! computes for minutes to be refused then, and none has to look by itself. Files whose names follow from others are checked by
//! [`Overwrite::check`].

use std::ffi::OsString;
use std::ops::Deref;
use std::path::{Path, PathBuf};

use clap::ArgMatches;

use crate::output_file::holds_bytes;
use crate::question;

/// A file that a command writes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct OutputFile(PathBuf);

impl From<OsString> for OutputFile {
    fn from(path: OsString) -> Self {
        Self(path.into())
    }
}

impl AsRef<Path> for OutputFile {
    fn as_ref(&self) -> &Path {
        &self.0
    }
}

impl Deref for OutputFile {
    type Target = Path;

    fn deref(&self) -> &Path {
        &self.0
    }
}

/// What happens to a file that exists and would be overwritten.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Overwrite {
    /// It is overwritten.
    Always,
    /// The person at the terminal is asked.
    Ask,
    /// The command refuses.
    Never,
}

/// Why a file is not overwritten.
#[derive(Debug, thiserror::Error)]
pub(crate) enum OverwriteError {
    /// Nobody can be asked.
    #[error("{0} exists; overwrite it with --force")]
    Exists(PathBuf),
    /// The person does not want it.
    #[error("{0} is kept; give another name")]
    Kept(PathBuf),
}

impl Overwrite {
    /// What the command line and the terminal allow.
    pub(crate) fn new(force: bool, json: bool) -> Self {
        match force {
            true => Self::Always,
            false if !json && question::is_possible() => Self::Ask,
            false => Self::Never,
        }
    }

    /// Refuses files that exist and shall be kept. Empty files and devices hold nothing to be kept.
    pub(crate) fn check(self, paths: &[&Path]) -> Result<(), OverwriteError> {
        let existing = paths.iter().filter(|path| holds_bytes(path));
        for path in existing.map(|path| path.to_path_buf()) {
            match self {
                Self::Always => {}
                Self::Never => return Err(OverwriteError::Exists(path)),
                Self::Ask => {
                    let answer = question::ask(&format!("{} exists; overwrite it? y, n", path.display()));
                    if !matches!(answer.as_deref(), Some("y" | "yes")) {
                        return Err(OverwriteError::Kept(path));
                    }
                }
            }
        }
        Ok(())
    }

    /// The same for every [`OutputFile`] of a command line, those of its subcommand included.
    pub(crate) fn check_all(self, matches: &ArgMatches) -> Result<(), OverwriteError> {
        let outputs = matches.ids().filter_map(|id| matches.try_get_many::<OutputFile>(id.as_str()).ok().flatten());
        let outputs: Vec<&Path> = outputs.flatten().map(|output| &**output).collect();
        self.check(&outputs)?;
        matches.subcommand().map_or(Ok(()), |(_, matches)| self.check_all(matches))
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::{OutputFile, Overwrite};
    use crate::commands::Cli;

    /// All commands with their subcommands.
    fn commands(command: &clap::Command) -> Vec<clap::Command> {
        let below = command.get_subcommands().flat_map(commands);
        [command.clone()].into_iter().chain(below).collect()
    }

    #[test]
    fn what_o_names_is_never_overwritten_unasked() {
        let mut count = 0;
        // A recording may also be resumed: `darm record` decides by itself what becomes of its file.
        let all = commands(&Cli::command()).into_iter().filter(|command| command.get_name() != "record");
        for command in all {
            let outputs = command.get_arguments().filter(|argument| argument.get_short() == Some('o'));
            for output in outputs {
                let matches = command.clone().ignore_errors(true).get_matches_from(["darm", "-o", "file"]);
                let found = matches.try_get_many::<OutputFile>(output.get_id().as_str());
                assert!(found.is_ok_and(|found| found.is_some()), "{}", command.get_name());
                count += 1;
            }
        }
        assert!(count > 10, "{count}");
    }

    #[test]
    fn a_file_that_holds_something_is_kept_without_force() {
        let folder = tempfile::tempdir().unwrap();
        let [full, empty, new] = ["full", "empty", "new"].map(|name| folder.path().join(name));
        std::fs::write(&full, "something").unwrap();
        std::fs::write(&empty, "").unwrap();
        let refused = Overwrite::Never.check(&[&empty, &new, &full]).unwrap_err().to_string();
        assert_eq!(refused, format!("{} exists; overwrite it with --force", full.display()));
        assert!(Overwrite::Never.check(&[&empty, &new, "/dev/null".as_ref()]).is_ok());
        assert!(Overwrite::Always.check(&[&full]).is_ok());
    }
}
