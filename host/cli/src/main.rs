//! `darm`: the command-line tool of discretely actuated arms. Exit codes and errors: [`failure`].

mod commands;
mod console;
mod failure;
mod finite;
mod firmware_image;
mod guests;
mod interrupt;
mod interrupted;
mod number_text;
mod output_file;
mod overwrite;
mod pages;
mod port;
mod question;
mod state_folder;
mod swapped_files;
mod ui;

use std::process::ExitCode;

use clap::error::{ContextKind, ContextValue};
use clap::{CommandFactory as _, FromArgMatches as _};
use commands::Cli;
use overwrite::Overwrite;
use ui::Ui;

fn main() -> ExitCode {
    let matches = Cli::command().try_get_matches().unwrap_or_else(|error| without_dashes(error).exit());
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| without_dashes(error).exit());
    let ui = Ui { json: cli.json, overwrite: Overwrite::new(cli.force, cli.json) };
    let done = ui.overwrite.check_all(&matches).map_err(Into::into).and_then(|()| cli.command.run(ui));
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // The fault or the failed checks are in the command's own JSON.
            if ui.json && !failure::is_reported(&error) {
                println!("{}", failure::json(&error));
            }
            eprintln!("darm: {}", failure::sentence(&error));
            ExitCode::from(failure::code(&error))
        }
    }
}

/// The error of a command line without the tip to put `--` before an option that does not exist: no command has values that
/// look like options.
fn without_dashes(mut error: clap::Error) -> clap::Error {
    let Some(ContextValue::String(argument)) = error.get(ContextKind::InvalidArg).cloned() else { return error };
    let Some(ContextValue::StyledStrs(mut tips)) = error.remove(ContextKind::Suggested) else { return error };
    tips.retain(|tip| !tip.to_string().contains(&format!("-- {argument}")));
    if !tips.is_empty() {
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(tips));
    }
    error
}
