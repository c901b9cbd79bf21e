//! `darm completions`: the completion script of a shell.

use clap::CommandFactory as _;
use clap_complete::Shell;
use serde::Serialize;

use super::Cli;
use crate::ui::{Answer, Ui};

const EXAMPLES: &str = "\
Examples:
  darm completions bash > darm                # to ~/.local/share/bash-completion/completions
  darm completions zsh > _darm                # to a folder of $fpath
  darm completions fish > darm.fish           # to ~/.config/fish/completions

The Debian package has these files already.";

/// Print the completion script of a shell
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Completions {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

#[derive(Serialize)]
struct Script {
    shell: String,
    script: String,
}

impl Answer for Script {
    fn text(&self) -> String {
        self.script.trim_end().to_owned()
    }
}

impl Completions {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut Cli::command(), "darm", &mut script);
        ui.print(&Script { shell: self.shell.to_string(), script: String::from_utf8(script)? })
    }
}
