//! `darm`: the command-line tool of discretely actuated arms. Exit codes and errors: [`failure`].

mod commands;
mod console;
mod failure;
mod firmware_image;
mod interrupt;
mod output_file;
mod port;
mod state_folder;
mod voice;

use std::process::ExitCode;

use clap::Parser as _;
use voice::Voice;

fn main() -> ExitCode {
    let cli = commands::Cli::parse();
    let voice = Voice { json: cli.json };
    match cli.command.run(voice) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // What the safe state says has been told already.
            if voice.json && !error.is::<failure::Safe>() {
                println!("{}", failure::json(&error));
            }
            eprintln!("darm: {}", failure::sentence(&error));
            ExitCode::from(failure::code(&error))
        }
    }
}
