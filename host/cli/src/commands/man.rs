//! `darm man`: the manual pages, one a command.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use clap::CommandFactory as _;
use clap::builder::Resettable;
use clap_mangen::Man as Page;
use serde::Serialize;

use super::Cli;
use super::help::CONVENTIONS;
use crate::ui::{Answer, Ui};

const EXAMPLES: &str = "\
Examples:
  darm man man1    # then: man -l man1/darm-synth.1

They are the texts of --help. The Debian package has these files already.";

/// Write the manual pages, one a command
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Man {
    /// Folder of the pages; it is made where it is missing
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
}

#[derive(Serialize)]
struct Pages {
    folder: PathBuf,
}

impl Answer for Pages {
    fn text(&self) -> String {
        format!("manual pages are in {}", self.folder.display())
    }
}

impl Man {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let folder = &self.folder;
        std::fs::create_dir_all(folder).with_context(|| format!("cannot create the folder {}", folder.display()))?;
        let mut command = Cli::command();
        // Names of subcommands become `darm-synth`, `darm-com-map`.
        command.build();
        write(&command, folder).with_context(|| format!("cannot write manual pages to {}", folder.display()))?;
        ui.print(&Pages { folder: folder.clone() })
    }
}

/// Writes the pages of a command and of its subcommands.
fn write(command: &clap::Command, folder: &Path) -> std::io::Result<()> {
    for subcommand in command.get_subcommands() {
        write(subcommand, folder)?;
    }
    let mut after = command.get_after_help().map(ToString::to_string).unwrap_or_default();
    if command.get_name() == "darm" {
        after += &format!("\n\n{CONVENTIONS}");
    }
    let notes = if after.is_empty() { after } else { notes(&after) };
    let source = format!("darm {}", env!("CARGO_PKG_VERSION"));
    let page = Page::new(command.clone().after_help(Resettable::Reset)).source(source).manual("darm");
    let mut text = Vec::new();
    page.render(&mut text)?;
    text.extend(notes.into_bytes());
    std::fs::write(folder.join(page.get_filename()), text)
}

/// What follows the options in the help: its indented lines are command lines, which keep their line ends.
fn notes(text: &str) -> String {
    let mut page = ".SH NOTES\n".to_owned();
    for line in text.lines() {
        let line = line.replace('\\', "\\e").replace('-', "\\-");
        // Writing to a string cannot fail.
        let _ = match line.starts_with("  ") {
            true => writeln!(page, ".nf\n{line}\n.fi"),
            false => writeln!(page, ".PP\n\\&{line}"),
        };
    }
    page
}

#[cfg(test)]
mod tests {
    use super::notes;

    #[test]
    fn command_lines_keep_their_line_ends() {
        let page = notes("Examples:\n  darm fk a.toml   # --word\n\n.hidden");
        assert_eq!(
            page,
            ".SH NOTES\n.PP\n\\&Examples:\n.nf\n  darm fk a.toml   # \\-\\-word\n.fi\n.PP\n\\&\n.PP\n\\&.hidden\n"
        );
    }
}
