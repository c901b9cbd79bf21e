//! Starts a program that measures. It is built first; its options, its help and its exit code are its own.

use std::process::{Command, ExitCode};
use std::thread;

use anyhow::{Context as _, Result, anyhow, bail};
use xtask::image::{self, Board};
use xtask::setup::{self, Emulator};

/// What is handed on.
#[derive(clap::Args)]
#[command(disable_help_flag = true)]
pub(crate) struct Arguments {
    /// Options of the measurement: see its --help
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    all: Vec<String>,
}

/// A measurement of `eval/`.
pub(crate) fn measurement(name: &str, arguments: &Arguments) -> Result<ExitCode> {
    run(&["--package", "darm-eval", "--", name], arguments)
}

/// The loop end to end: a separate package, because a newcomer waits for it, and it needs neither the server nor the papers.
///
/// Its image is built at the same time: each build ends with work for one core, the linker's optimisation of the image and one crate
/// after another of the host.
pub(crate) fn demo(arguments: &Arguments) -> Result<ExitCode> {
    let board = board_of_demo(&arguments.all);
    let image = thread::spawn(move || match board.map(|board| (board, board.emulator())) {
        Some((board, Emulator::Ready)) => image::build_for(board).map(|_| ()),
        // The demo says why there is none, or what is wrong with its options.
        _ => Ok(()),
    });
    let package = ["--package", "darm-demo"];
    let built = cargo("build").args(package).status().context("cargo did not start")?;
    image.join().map_err(|_| anyhow!("the build of the image panicked"))??;
    if !built.success() {
        bail!("the demo does not build; see the compiler's errors above");
    }
    run(&[&package[..], &["--"]].concat(), arguments)
}

/// The board whose image these options of the demo run in its emulator; `None`: none, or the options are wrong.
fn board_of_demo(options: &[String]) -> Option<Board> {
    let runs_no_image = |option: &String| {
        let name = option.split('=').next().unwrap_or_default();
        ["--in-process", "--sweep", "--help", "-h"].contains(&name)
    };
    if options.iter().any(runs_no_image) {
        return None;
    }
    let mut values = options.iter().skip_while(|option| !option.starts_with("--board"));
    let Some(option) = values.next() else { return Some(Board::BL475eIot01a) };
    let value = option.strip_prefix("--board=").or(values.next().map(String::as_str))?;
    Board::ALL.into_iter().find(|board| board.name() == value)
}

/// The simulation of the complete system: a separate package, because the mutants build it again and again.
pub(crate) fn simulation(arguments: &Arguments) -> Result<ExitCode> {
    run(&["--package", "darm-simulate", "--"], arguments)
}

fn run(what: &[&str], arguments: &Arguments) -> Result<ExitCode> {
    let status = cargo("run").args(what).args(&arguments.all).status();
    let code = status.context("cargo did not start")?.code().unwrap_or(1);
    Ok(ExitCode::from(u8::try_from(code).unwrap_or(1)))
}

/// Not quiet: a first build takes minutes.
fn cargo(command: &str) -> Command {
    let mut cargo = Command::new("cargo");
    cargo.args([command, "--manifest-path"]).arg(setup::root().join("Cargo.toml"));
    cargo
}

#[cfg(test)]
mod tests {
    use xtask::image::Board;

    use super::board_of_demo;

    #[test]
    fn the_image_that_the_demo_runs_is_known_before_the_demo_is_built() {
        let board = |line: &str| board_of_demo(&line.split_whitespace().map(str::to_owned).collect::<Vec<_>>());
        assert_eq!(board("--seed 3"), Some(Board::BL475eIot01a));
        assert_eq!([board("--board pico"), board("--seed 2 --board=pico")], [Some(Board::Pico); 2]);
        for none in ["--in-process", "--arm spatial6 --sweep 20", "--sweep=20", "--help", "--board", "--board toaster"]
        {
            assert_eq!(board(none), None, "{none}");
        }
    }
}
