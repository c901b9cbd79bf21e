//! The subcommands of `darm`, one file each: arguments, the function that runs it, its output.

mod adjust;
mod bench_ik;
mod bringup;
mod bundle;
mod calibrate;
#[cfg(feature = "camera")]
mod camera;
mod camera_lines;
mod com;
mod completions;
mod console;
mod diagnose;
mod doctor;
mod draw;
mod dynamics;
mod fk;
mod flash;
mod generate;
mod grasp;
mod help;
mod ik;
mod import;
mod inertia;
mod jacobian;
mod load;
mod man;
mod map;
mod model;
mod nearest;
mod new;
mod odometry;
mod path;
mod play;
pub(crate) mod profile;
mod record;
mod serve;
mod servos;
mod sim;
mod status;
mod stop;
mod subject;
mod synth;
mod table;
mod upload;
mod wiring;

use crate::ui::Ui;

/// Discretely actuated arms: synthesis, tables, upload, play, measurement, diagnosis, console
#[derive(clap::Parser, Debug)]
#[command(name = "darm", version, disable_help_subcommand = true)]
#[command(help_template = help::template(), after_help = AFTER_HELP)]
pub(crate) struct Cli {
    /// Print JSON on standard output, one object per line, in SI units
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// Overwrite files that exist, without a question
    #[arg(long, global = true, env = FORCE_VARIABLE, hide_env = true, value_parser = clap::builder::FalseyValueParser::new())]
    pub(crate) force: bool,
    /// Command
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// Environment variable that answers for scripts.
const FORCE_VARIABLE: &str = "DARM_FORCE";

const AFTER_HELP: &str = "\
`darm help GROUP` says what the commands of a group do, `darm COMMAND --help` shows options and examples.

A new arm, with the files of the folder `examples`:

  darm synth planar4.toml planar4-frames.toml -o arm.toml         # geometry for desired frames
  darm sim arm.toml --effect stroke-loss                          # or a real board
  darm profile write --arm arm.toml                               # wiring and limits, once
  darm table arm.toml --measurement-plan --plan-words 28 --dwell 0.1 -o plan.darm   # timed rows
  darm upload plan.darm                                           # the board stores them
  darm record plan.darm -o run.csv                                # play and measure
  darm diagnose arm.toml run.csv -o arm2.toml                     # which effect is missing
  darm synth arm2.toml planar4-frames.toml -o arm3.toml           # with the better model
  darm adjust arm.toml arm3.toml                                  # by how many mm to turn stops

`darm calibrate` does the steps from the table on by itself, with fewer visits. `darm sim` runs until Ctrl-C, in its own \
terminal; all commands find the simulated board. `darm serve` shows it in a browser.

Exit codes: 0 done, 1 failed, 2 invalid command line, 3 the board refused or is in its safe state, 4 no connection, \
5 the board did not confirm a stop, 6 interrupted and stopped, 7 stopped by another program before its end.

Units, signs and numbering: `darm help conventions`.";

/// The commands.
#[derive(clap::Subcommand, Debug)]
pub(crate) enum Command {
    Synth(synth::Synth),
    Adjust(adjust::Adjust),
    Nearest(nearest::Nearest),
    Map(map::Map),
    Path(path::Path),
    Bringup(bringup::Bringup),
    Table(table::Table),
    Upload(upload::Upload),
    Play(play::Play),
    Stop(stop::Stop),
    Status(status::Status),
    Record(record::Record),
    Import(import::Import),
    #[cfg(feature = "camera")]
    Camera(camera::CameraCommand),
    Diagnose(diagnose::Diagnose),
    Calibrate(calibrate::Calibrate),
    Bundle(bundle::Bundle),
    Serve(serve::Serve),
    Console(console::Console),
    Flash(flash::Flash),
    Sim(sim::Sim),
    Profile(profile::Command),
    Fk(fk::Fk),
    Jacobian(jacobian::Jacobian),
    Ik(ik::Ik),
    BenchIk(bench_ik::BenchIk),
    Dynamics(dynamics::Dynamics),
    Com(com::Com),
    Model(model::Model),
    Generate(generate::Generate),
    Inertia(inertia::Inertia),
    Odometry(odometry::Odometry),
    Draw(draw::Draw),
    New(new::New),
    Load(load::Load),
    Wiring(wiring::Wiring),
    Grasp(grasp::Grasp),
    Doctor(doctor::Doctor),
    Completions(completions::Completions),
    Man(man::Man),
    Help(help::Help),
}

impl Command {
    /// Runs the command and prints its result.
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        match self {
            Self::Synth(command) => command.run(ui),
            Self::Adjust(command) => command.run(ui),
            Self::Nearest(command) => command.run(ui),
            Self::Map(command) => command.run(ui),
            Self::Path(command) => command.run(ui),
            Self::Bringup(command) => command.run(ui),
            Self::Table(command) => command.run(ui),
            Self::Upload(command) => command.run(ui),
            Self::Play(command) => command.run(ui),
            Self::Stop(command) => command.run(ui),
            Self::Status(command) => command.run(ui),
            Self::Record(command) => command.run(ui),
            Self::Import(command) => command.run(ui),
            #[cfg(feature = "camera")]
            Self::Camera(command) => command.run(ui),
            Self::Diagnose(command) => command.run(ui),
            Self::Calibrate(command) => command.run(ui),
            Self::Bundle(command) => command.run(ui),
            Self::Serve(command) => command.run(ui),
            Self::Console(command) => command.run(ui),
            Self::Flash(command) => command.run(ui),
            Self::Sim(command) => command.run(ui),
            Self::Profile(command) => command.run(ui),
            Self::Fk(command) => command.run(ui),
            Self::Jacobian(command) => command.run(ui),
            Self::Ik(command) => command.run(ui),
            Self::BenchIk(command) => command.run(ui),
            Self::Dynamics(command) => command.run(ui),
            Self::Com(command) => command.run(ui),
            Self::Model(command) => command.run(ui),
            Self::Generate(command) => command.run(ui),
            Self::Inertia(command) => command.run(ui),
            Self::Odometry(command) => command.run(ui),
            Self::Draw(command) => command.run(ui),
            Self::New(command) => command.run(ui),
            Self::Load(command) => command.run(ui),
            Self::Wiring(command) => command.run(ui),
            Self::Grasp(command) => command.run(ui),
            Self::Doctor(command) => command.run(ui),
            Self::Completions(command) => command.run(ui),
            Self::Man(command) => command.run(ui),
            Self::Help(command) => command.run(ui),
        }
    }
}
