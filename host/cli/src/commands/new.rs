//! `darm new`: arm file, board profile and frames of a new arm, from a few choices.

use std::fmt::Display;
use std::path::PathBuf;
use std::str::FromStr;

use clap::ValueEnum;
use darm_arm::new_arm::{Choices, Topology, Valve, arm_file, frames_file, profile_file};
use darm_core::profile::{B_L475E_IOT01A, PICO, PinTable};
use serde::Serialize;

use crate::failure::Usage;
use crate::output_file;
use crate::question;
use crate::ui::{Answer, Ui};

const EXAMPLES: &str = "\
Examples:
  darm new lift                                                  # asks for the choices
  darm new reach --topology planar --modules 2 --valve bistable
  darm new six --topology spatial --modules 3 --size 400 --bore 32 --board b-l475e-iot01a
  darm new snake --topology serial --modules 6 --angle 40 --torque 12

It writes NAME.toml, NAME.profile.toml and NAME-frames.toml, which load, give a table and simulate as they are. Modules are alike \
and stand on each other. Then correct lengths, masses and limits by the data sheets of your parts: comments in the files say which. \
A monostable 5/2 valve becomes the drive `hold` of the profile, a bistable one or another latch `latch`.";

/// Make arm file, board profile and frames of a new arm, from topology, strokes and valves
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct New {
    /// Name of the arm, and of its files
    #[arg(value_name = "NAME")]
    name: String,
    /// Folder of the files
    #[arg(long, value_name = "FOLDER", default_value = ".")]
    folder: PathBuf,
    /// What the arm is made of [default: planar]
    #[arg(long, value_enum)]
    topology: Option<TopologyChoice>,
    /// Number of modules: platforms, or joints [default: 3]
    #[arg(long, value_name = "N")]
    modules: Option<usize>,
    /// Width of the plates or length of the links, in mm [default: 200]
    #[arg(long, value_name = "MM")]
    size: Option<f64>,
    /// Stroke of the cylinders, in mm [default: an eighth of the size]
    #[arg(long, value_name = "MM")]
    stroke: Option<f64>,
    /// Angle between the two positions of a joint, in degrees [default: 30]
    #[arg(long, value_name = "DEG", conflicts_with = "stroke")]
    angle: Option<f64>,
    /// What feeds the actuators: a 5/2 valve with a spring, or one with two coils or another latch [default: monostable]
    #[arg(long, value_enum)]
    valve: Option<ValveChoice>,
    /// Bore of the cylinders, in mm [default: 20]
    #[arg(long, value_name = "MM")]
    bore: Option<f64>,
    /// Rod of the cylinders, in mm [default: 0.4 of the bore]
    #[arg(long, value_name = "MM")]
    rod: Option<f64>,
    /// Torque of the joints, in N m [default: 5]
    #[arg(long, value_name = "NM", conflicts_with_all = ["bore", "rod"])]
    torque: Option<f64>,
    /// The board [default: pico]
    #[arg(long, value_enum)]
    board: Option<BoardChoice>,
    /// Without limit switches
    #[arg(long)]
    no_switches: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum TopologyChoice {
    /// Plates on three cylinders each, in a plane
    Planar,
    /// Plates on six cylinders each, in space
    Spatial,
    /// Joints with two positions, one after the other, in a plane
    Serial,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum ValveChoice {
    /// One coil and a spring
    Monostable,
    /// Two coils, or another latch
    Bistable,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum BoardChoice {
    /// Raspberry Pi Pico
    Pico,
    /// B-L475E-IOT01A
    #[value(name = "b-l475e-iot01a")]
    BL475eIot01a,
    /// The profile names no board
    Any,
}

impl BoardChoice {
    fn pins(self) -> Option<&'static PinTable> {
        match self {
            Self::Pico => Some(&PICO),
            Self::BL475eIot01a => Some(&B_L475E_IOT01A),
            Self::Any => None,
        }
    }
}

#[derive(Serialize)]
struct Made {
    arm: PathBuf,
    profile: PathBuf,
    frames: PathBuf,
    actuators: usize,
    switches: usize,
    chips: usize,
    board: Option<&'static str>,
}

impl New {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let choices = self.choices(ui)?;
        let files = choices.files()?;
        let name = &choices.name;
        let [arm, profile, frames] =
            [arm_file(name), profile_file(name), frames_file(name)].map(|file| self.folder.join(file));
        ui.overwrite.check(&[&arm, &profile, &frames])?;
        output_file::write_all(&[
            (&arm, files.arm.as_bytes()),
            (&profile, files.profile.as_bytes()),
            (&frames, files.frames.as_bytes()),
        ])?;
        ui.print(&Made {
            arm,
            profile,
            frames,
            actuators: choices.n_actuators(),
            switches: choices.n_switches(),
            chips: choices.n_chips(),
            board: choices.board.map(|pins| pins.board),
        })
    }

    /// The options, and what the person at the terminal chooses for those that are not given.
    fn choices(&self, ui: Ui) -> anyhow::Result<Choices> {
        let questions = Questions { are_asked: !ui.json && question::is_possible() };
        let topology = match questions.choice("made of", self.topology, TopologyChoice::Planar)? {
            TopologyChoice::Planar => Topology::Planar,
            TopologyChoice::Spatial => Topology::Spatial,
            TopologyChoice::Serial => Topology::Serial,
        };
        self.check_options(topology)?;
        let modules = questions.number("number of modules", self.modules, 3)?;
        let size = questions.number("width of the plates or length of the links, mm", self.size, 200.0)?;
        let valve = match questions.choice("valves", self.valve, ValveChoice::Monostable)? {
            ValveChoice::Monostable => Valve::Monostable,
            ValveChoice::Bistable => Valve::Bistable,
        };
        let (mut cylinder, mut torque_nm) = ([20.0, 8.0], 5.0);
        let stroke = if topology == Topology::Serial {
            torque_nm = questions.number("torque of the joints, N m", self.torque, torque_nm)?;
            questions.number("angle between the two positions, degrees", self.angle, 30.0)?.to_radians()
        } else {
            let bore = questions.number("bore of the cylinders, mm", self.bore, 20.0)?;
            cylinder = [bore, questions.number("rod of the cylinders, mm", self.rod, 0.4 * bore)?];
            1e-3 * questions.number("stroke of the cylinders, mm", self.stroke, size / 8.0)?
        };
        let board = questions.choice("board", self.board, BoardChoice::Pico)?.pins();
        Ok(Choices {
            name: self.name.clone(),
            topology,
            modules,
            size_m: 1e-3 * size,
            stroke,
            valve,
            cylinder_m: cylinder.map(|mm| 1e-3 * mm),
            torque_nm,
            board,
            has_switches: !self.no_switches,
        })
    }

    /// Refuses options that mean nothing for this topology.
    fn check_options(&self, topology: Topology) -> Result<(), Usage> {
        let is_serial = topology == Topology::Serial;
        let useless = [
            ("--stroke", self.stroke.is_some() && is_serial, "joints turn; give --angle"),
            ("--bore", self.bore.is_some() && is_serial, "joints turn; give --torque"),
            ("--rod", self.rod.is_some() && is_serial, "joints turn; give --torque"),
            ("--angle", self.angle.is_some() && !is_serial, "cylinders have a stroke; give --stroke"),
            ("--torque", self.torque.is_some() && !is_serial, "cylinders push and pull; give --bore and --rod"),
        ];
        match useless.into_iter().find(|(_, is_given, _)| *is_given) {
            Some((option, _, cure)) => Err(Usage(format!("{option}: {cure}"))),
            None => Ok(()),
        }
    }
}

/// Asks for what no option gives, or takes the defaults.
struct Questions {
    are_asked: bool,
}

/// The input ended before the last answer.
#[derive(Debug, thiserror::Error)]
#[error("the input ended before the last answer; nothing was written")]
struct NoAnswer;

impl Questions {
    fn number<T: FromStr + Display + Copy>(&self, question: &str, given: Option<T>, default: T) -> Result<T, NoAnswer> {
        self.answer(&format!("{question} [{default}]"), given, default, |answer| answer.parse().ok())
    }

    fn choice<T: ValueEnum + Copy>(&self, question: &str, given: Option<T>, default: T) -> Result<T, NoAnswer> {
        let names: Vec<String> = T::value_variants().iter().map(name).collect();
        let question = format!("{question}: {} [{}]", names.join(", "), name(&default));
        self.answer(&question, given, default, |answer| T::from_str(answer, true).ok())
    }

    fn answer<T>(
        &self,
        question: &str,
        given: Option<T>,
        default: T,
        parse: impl Fn(&str) -> Option<T>,
    ) -> Result<T, NoAnswer> {
        if !self.are_asked || given.is_some() {
            return Ok(given.unwrap_or(default));
        }
        loop {
            let answer = question::ask(question).ok_or(NoAnswer)?;
            if answer.is_empty() {
                return Ok(default);
            }
            if let Some(value) = parse(&answer) {
                return Ok(value);
            }
            eprintln!("  {answer} is no answer; press Enter for the value in brackets");
        }
    }
}

fn name<T: ValueEnum>(value: &T) -> String {
    value.to_possible_value().map_or(String::new(), |value| value.get_name().to_owned())
}

impl Answer for Made {
    fn text(&self) -> String {
        let [arm, profile, frames] = [&self.arm, &self.profile, &self.frames].map(|path| path.display().to_string());
        let board = self.board.map_or(String::new(), |board| format!(", {board}"));
        let words = 2f64.powi(self.actuators as i32);
        format!(
            "arm      {arm}: {} actuators, {words:.0} words\nprofile  {profile}: {} chips 74HC595, {} limit switches{board}\n\
             frames   {frames}\n\n\
             Next: `darm wiring {arm}`, `darm load {arm}`, `darm draw {arm} -o {}.svg`, `darm sim {arm}`",
            self.actuators,
            self.chips,
            self.switches,
            arm.trim_end_matches(".toml"),
        )
    }
}
