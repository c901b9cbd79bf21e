//! `darm`: the command-line tool of discretely actuated arms. Exit codes and errors: [`failure`].

mod commands;
mod console;
mod failure;
mod finite;
mod firmware_image;
mod interrupt;
mod interrupted;
mod number_text;
mod output_file;
mod port;
mod state_folder;
mod ui;
mod visits;

use std::process::ExitCode;

use clap::Parser as _;
use ui::Ui;

fn main() -> ExitCode {
    let cli = commands::Cli::parse();
    let ui = Ui { json: cli.json };
    match cli.command.run(ui) {
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
