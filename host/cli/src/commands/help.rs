//! `darm help`: the commands of a group in a sentence each, or the help of one command. The overview of `darm --help`.

use std::fmt::Write as _;

use clap::CommandFactory as _;
use serde::Serialize;

use super::Cli;
use crate::failure::Usage;
use crate::ui::{Answer, Ui};

const EXAMPLES: &str = "\
Examples:
  darm help boards         # what each command of this group does
  darm help profile write  # the same as darm profile write --help
  darm help conventions    # units, signs, numbering";

/// Commands that are used together.
struct Group {
    /// What `darm help` takes.
    name: &'static str,
    /// What they are for.
    about: &'static str,
    commands: &'static [&'static str],
}

/// Every command is in one group: a test compares them with what the overview lists.
const GROUPS: [Group; 7] = [
    Group {
        name: "loop",
        about: "From desired frames to an arm that reaches them, and again with what was measured",
        commands: &["synth", "adjust", "nearest", "map", "path", "table", "upload", "play", "record"],
    },
    Group {
        name: "build",
        about: "An arm of your own: its files, the strength of its actuators, its wires and drawings",
        commands: &["new", "load", "wiring", "draw"],
    },
    Group {
        name: "boards",
        about: "A board, simulated or real",
        commands: &["sim", "console", "status", "stop", "profile", "bringup", "serve"],
    },
    Group {
        name: "diagnosis",
        about: "What a model does not have, from measurements of an arm or a robot",
        commands: if cfg!(feature = "camera") {
            &["import", "camera", "diagnose", "calibrate", "bundle"]
        } else {
            &["import", "diagnose", "calibrate", "bundle"]
        },
    },
    Group {
        name: "robots",
        about: "Kinematics and dynamics of arms and of robots as URDF, MJCF and Denavit-Hartenberg tables",
        commands: &["fk", "jacobian", "ik", "dynamics", "model", "generate", "inertia", "odometry"],
    },
    Group { name: "papers", about: "Methods of the five papers", commands: &["grasp", "com", "bench-ik"] },
    Group {
        name: "set-up",
        about: "This machine and a new board",
        commands: &["flash", "doctor", "completions", "man"],
    },
];

/// The name under which [`CONVENTIONS`] are printed.
const CONVENTIONS_NAME: &str = "conventions";

/// Units, signs and numbers of all commands.
pub(super) const CONVENTIONS: &str = "\
Options take mm, degrees and seconds; JSON has SI units, named by the ending of the key (_m, _rad, _s, _n).

Orientations are rotation vectors (axis times angle) in the frame of the base. A wrench is what the environment exerts on \
the tool: moments first, then forces, along the axes of the base.

Actuators, servos, outputs, inputs, rows and visits are numbered from 0, actuators from the base; the first digit of a word \
is actuator 0. Modules, frames, postures and targets are counted from 1, as their files list them.";

/// Print what the commands of a group do, or the help of a command
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Help {
    /// A group, a command, or a command and its subcommand; without it, the overview
    #[arg(value_name = "NAME")]
    names: Vec<String>,
}

/// The overview: groups with the names of their commands, in place of clap's list with a sentence each.
pub(super) fn template() -> String {
    let mut groups = String::new();
    for Group { name, commands, .. } in &GROUPS {
        // Writing to a string cannot fail.
        let _ = writeln!(groups, "  {name:11}{}", commands.join(", "));
    }
    format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\nCommands:\n{groups}\nOptions:\n{{options}}{{after-help}}"
    )
}

#[derive(Serialize)]
struct Sentences {
    group: &'static str,
    about: &'static str,
    commands: Vec<Sentence>,
}

#[derive(Serialize)]
struct Sentence {
    command: &'static str,
    about: String,
}

impl Answer for Sentences {
    fn text(&self) -> String {
        let lines = self.commands.iter().map(|it| format!("  {:12}{}", it.command, it.about));
        let lines: Vec<String> = lines.collect();
        format!("{}.\n\n{}\n\n`darm COMMAND --help` shows options and examples.", self.about, lines.join("\n"))
    }
}

#[derive(Serialize)]
struct Text {
    help: String,
}

impl Answer for Text {
    fn text(&self) -> String {
        self.help.trim_end().to_owned()
    }
}

impl Help {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let darm = Cli::command();
        let names: Vec<&str> = self.names.iter().map(String::as_str).collect();
        if names == [CONVENTIONS_NAME] {
            return ui.print(&Text { help: CONVENTIONS.to_owned() });
        }
        if let [name] = names[..]
            && let Some(group) = GROUPS.iter().find(|group| group.name == name)
        {
            let about = |name: &str| darm.find_subcommand(name).and_then(clap::Command::get_about);
            let sentence = |command: &&'static str| Sentence {
                command,
                about: about(command).map(ToString::to_string).unwrap_or_default(),
            };
            let commands = group.commands.iter().map(sentence).collect();
            return ui.print(&Sentences { group: group.name, about: group.about, commands });
        }
        let mut command = &darm;
        for name in &names {
            command = command.find_subcommand(name).ok_or_else(|| unknown(&names))?;
        }
        // What clap answers to --help: it is an error to clap, with the text of the help.
        let line = ["darm"].into_iter().chain(names.iter().copied()).chain(["--help"]);
        let help = Cli::command().try_get_matches_from(line).err().map(|help| help.to_string()).unwrap_or_default();
        ui.print(&Text { help })
    }
}

fn unknown(names: &[&str]) -> Usage {
    let groups: Vec<&str> = GROUPS.iter().map(|group| group.name).collect();
    let asked = names.join(" ");
    Usage(format!("help {asked}: no such command or group; the groups are {}, and conventions", groups.join(", ")))
}
