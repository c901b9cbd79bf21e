//! The subcommands of `darm`, one file each: arguments, one function that runs it, what it says.

mod bench_ik;
mod camera;
mod com;
mod console;
mod diagnose;
mod doctor;
mod draw;
mod dynamics;
mod fk;
mod flash;
mod grasp;
mod ik;
mod jacobian;
mod map;
mod model;
mod nearest;
mod path;
mod plant;
mod play;
pub(crate) mod profile;
mod record;
mod status;
mod stop;
mod stops;
mod subject;
mod synth;
mod table;
pub(crate) mod table_file;
mod upload;
pub(crate) mod visits;

use crate::voice::Voice;

/// Discretely actuated arms: synthesis, tables, upload, play, measurement, diagnosis, console
///
/// A new arm goes this way:
///
///   darm synth base.toml frames.toml -o arm.toml       geometry that reaches the frames
///   darm profile write --arm arm.toml                  what is wired to the board, once, at the board
///   darm table arm.toml frames.toml -o visits.darm     timed rows, checked against the limits
///   darm upload visits.darm && darm play               the board runs them on its own clock
///   darm record visits.darm -o run.csv                 play and measure
///   darm diagnose arm.toml run.csv -o arm2.toml        which effect the model lacks
///   darm stops arm.toml arm2.toml                      by how many mm each stop is to be turned
///
/// Any arm, robot as URDF or table of Denavit and Hartenberg: `darm fk`, `jacobian`, `ik`, `bench-ik`, `dynamics`, `com`, `model`, `draw`.
///
/// Without hardware: `darm plant arm.toml` starts a board in the emulator and says its port.
#[derive(clap::Parser, Debug)]
#[command(name = "darm", version, verbatim_doc_comment, after_help = EXIT_CODES)]
pub(crate) struct Cli {
    /// JSON on the standard output, one object a line, for programs
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// What to do
    #[command(subcommand)]
    pub(crate) command: Command,
}

const EXIT_CODES: &str = "\
Exit codes: 0 done, 1 failed, 2 bad usage, 3 the board refused or is in its safe state, 4 no connection, \
5 the board did not confirm a stop, 6 interrupted and stopped, 7 stopped by another program before its end. \
`darm COMMAND --help` shows examples.";

/// What to do.
#[derive(clap::Subcommand, Debug)]
pub(crate) enum Command {
    Synth(synth::Synth),
    Stops(stops::Stops),
    Nearest(nearest::Nearest),
    Map(map::Map),
    Path(path::Path),
    Table(table::Table),
    Upload(upload::Upload),
    Play(play::Play),
    Stop(stop::Stop),
    Status(status::Status),
    Record(record::Record),
    Diagnose(diagnose::Diagnose),
    Console(console::Console),
    Flash(flash::Flash),
    Plant(plant::Plant),
    Profile(profile::Command),
    Fk(fk::Fk),
    Jacobian(jacobian::Jacobian),
    Ik(ik::Ik),
    BenchIk(bench_ik::BenchIk),
    Dynamics(dynamics::Dynamics),
    Com(com::Com),
    Model(model::Model),
    Draw(draw::Draw),
    Grasp(grasp::Grasp),
    Doctor(doctor::Doctor),
}

impl Command {
    /// Runs the command and says what came of it.
    pub(crate) fn run(&self, voice: Voice) -> anyhow::Result<()> {
        match self {
            Self::Synth(command) => command.run(voice),
            Self::Stops(command) => command.run(voice),
            Self::Nearest(command) => command.run(voice),
            Self::Map(command) => command.run(voice),
            Self::Path(command) => command.run(voice),
            Self::Table(command) => command.run(voice),
            Self::Upload(command) => command.run(voice),
            Self::Play(command) => command.run(voice),
            Self::Stop(command) => command.run(voice),
            Self::Status(command) => command.run(voice),
            Self::Record(command) => command.run(voice),
            Self::Diagnose(command) => command.run(voice),
            Self::Console(command) => command.run(voice),
            Self::Flash(command) => command.run(voice),
            Self::Plant(command) => command.run(voice),
            Self::Profile(command) => command.run(voice),
            Self::Fk(command) => command.run(voice),
            Self::Jacobian(command) => command.run(voice),
            Self::Ik(command) => command.run(voice),
            Self::BenchIk(command) => command.run(voice),
            Self::Dynamics(command) => command.run(voice),
            Self::Com(command) => command.run(voice),
            Self::Model(command) => command.run(voice),
            Self::Draw(command) => command.run(voice),
            Self::Grasp(command) => command.run(voice),
            Self::Doctor(command) => command.run(voice),
        }
    }
}
