//! `cargo xtask demo`.

use std::process::ExitCode;

use clap::Parser as _;
use darm_demo::Demo;

#[derive(clap::Parser)]
#[command(name = "cargo xtask demo", bin_name = "cargo xtask demo")]
struct Arguments {
    #[command(flatten)]
    demo: Demo,
}

fn main() -> ExitCode {
    match Arguments::parse().demo.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}
