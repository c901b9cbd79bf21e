//! `darm profile`: wiring of a board, and the limits that no table can exceed.

mod answers;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use darm_arm::arm::{Arm, Servo};
use darm_arm::board_profile::BoardProfile;
use darm_arm::wired_arm::WiredArm;
use darm_core::profile::Servo as ProfileServo;
use darm_core::wire::message::Refusal;
use darm_device::client::{Client, ClientError};
use darm_robot::source::path_between;

use crate::commands::status::ProfileState;
use crate::output_file;
use crate::overwrite::OutputFile;
use crate::port::PortArgs;
use crate::ui::Ui;
use answers::{Checked, LimitReport, Made, OutputReport, Shown};

const EXAMPLES: &str = "\
Examples:
  darm profile make arm.toml -o profile.toml                   # conservative, to be edited
  darm profile check planar4.profile.toml --arm arm.toml       # against the needs of an arm
  darm profile write planar4.profile.toml                      # hold the user button
  darm profile show                                            # limits and remaining on-times

A board accepts a profile only while a person holds its user button (B2, blue, on the B-L475E-IOT01A), then restarts \
with it. A table can tighten a profile and never widen it. Without a profile a board drives 16 outputs for at most 1 s \
in 10 s, one at a time, and no servo.";

const WRITE_EXAMPLES: &str = "\
Examples:
  darm profile write planar4.profile.toml   # hold the user button of the board
  darm profile write --arm arm.toml         # the profile that the arm names

The command waits up to 60 s for the button. A simulated board has no button: `darm sim arm.toml --profile \
PROFILE.toml` writes a profile when it starts.";

/// Longest wait of `write` for the button and for the restart of the board.
const BUTTON_LIMIT: Duration = Duration::from_secs(60);
const RESTART_LIMIT: Duration = Duration::from_secs(10);
const POLL: Duration = Duration::from_millis(200);

/// Make, check, write and show board profiles: wiring, and limits that no table can exceed
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Command {
    #[command(subcommand)]
    action: Action,
}

#[derive(clap::Subcommand, Debug)]
enum Action {
    /// Make a conservative first profile for the outputs and servos that an arm names
    #[command(after_help = "Examples:\n  darm profile make arm.toml -o first.toml")]
    Make {
        /// The arm
        #[arg(value_name = "ARM.toml")]
        arm: PathBuf,
        /// Profile to write
        #[arg(short, long, value_name = "PROFILE.toml")]
        output: OutputFile,
    },
    /// Check a profile; with --arm, whether it has the outputs, limit switches and servos that the arm needs
    #[command(after_help = "Examples:\n  darm profile check planar4.profile.toml --arm arm.toml")]
    Check {
        /// The profile
        #[arg(value_name = "PROFILE.toml")]
        profile: PathBuf,
        /// Arm to check it against
        #[arg(long, value_name = "ARM.toml")]
        arm: Option<PathBuf>,
    },
    /// Store a profile on the board, whose user button must be held; the board restarts with it
    #[command(after_help = WRITE_EXAMPLES)]
    Write {
        /// The profile
        #[arg(value_name = "PROFILE.toml", required_unless_present = "arm")]
        profile: Option<PathBuf>,
        /// Write the profile that this arm names
        #[arg(long, value_name = "ARM.toml", conflicts_with = "profile")]
        arm: Option<PathBuf>,
        #[command(flatten)]
        port: PortArgs,
    },
    /// Show the profile of the board, and the remaining on-time of each output
    #[command(after_help = "Examples:\n  darm profile show")]
    Show {
        #[command(flatten)]
        port: PortArgs,
    },
}

/// Why a profile was not written.
#[derive(Debug, thiserror::Error)]
enum ProfileCommandError {
    #[error("the user button of the board was not held within {} s; hold it and repeat the command", BUTTON_LIMIT.as_secs())]
    NobodyPresent,
    #[error("the board did not restart with the profile within {} s; run `darm status`", RESTART_LIMIT.as_secs())]
    NoRestart,
    #[error("{} names no profile; give PROFILE.toml, or add `profile = \"PROFILE.toml\"` to the arm file", .0.display())]
    NoProfile(PathBuf),
}

impl Command {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        match &self.action {
            Action::Make { arm, output } => make(arm, output, ui),
            Action::Check { profile, arm } => check(profile, arm.as_deref(), ui),
            Action::Write { profile, arm, port } => {
                let profile = match (profile, arm) {
                    (Some(path), _) => BoardProfile::read(path)?,
                    (None, Some(arm)) => named_by(arm)?,
                    (None, None) => unreachable!("clap requires one of the two"),
                };
                let mut client = port.connect()?;
                if has(&mut client, &profile) {
                    return ui.print(&Made::new(&profile, None, "already in force on the board"));
                }
                ui.note(&format!(
                    "hold the user button of the board within {} s. A simulated board has no button: end the simulator, then \
                     start it with `darm sim ARM.toml --profile PROFILE.toml`",
                    BUTTON_LIMIT.as_secs()
                ));
                let spinner = ui.spinner("waiting for the user button");
                let written = write(&mut client, &profile);
                spinner.finish_and_clear();
                written?;
                ui.print(&Made::new(&profile, None, "stored; the board has restarted with it"))
            }
            Action::Show { port } => show(&mut port.connect()?, ui),
        }
    }
}

/// The profile that an arm file names.
fn named_by(arm: &Path) -> anyhow::Result<BoardProfile> {
    let profile = Arm::read(arm)?.profile.ok_or_else(|| ProfileCommandError::NoProfile(arm.into()))?;
    Ok(BoardProfile::read(&profile)?)
}

fn make(arm: &Path, output: &Path, ui: Ui) -> anyhow::Result<()> {
    let profile = BoardProfile::first(&Arm::read(arm)?);
    output_file::write_all(&[(output, profile.to_toml_with_advice().as_bytes())])?;
    // Requirements of the arm that a first profile cannot meet are reported by their position in the arm file.
    let WiredArm { arm: wired, profile, .. } = WiredArm::read(arm, Some(output))?;
    let is_named = wired.profile.as_deref().is_some_and(|named| output_file::refuse_same(named, output).is_err());
    if !is_named {
        let named = path_between(arm, output);
        let named = format!("profile = {:?}", named.display().to_string());
        ui.note(&match wired.profile {
            Some(other) => format!("{} names {}; replace it by `{named}`", arm.display(), other.display()),
            None => format!("add `{named}` to {}, before its first [table]", arm.display()),
        });
    }
    ui.print(&Made::new(&profile, Some(output), "edit it before writing it to a board; written"))
}

fn check(path: &Path, arm: Option<&Path>, ui: Ui) -> anyhow::Result<()> {
    let (profile, ranges) = match arm {
        Some(arm) => {
            let wired = WiredArm::read(arm, Some(path))?;
            let ranges = servo_warnings(&wired);
            (wired.profile, ranges)
        }
        None => (BoardProfile::read(path)?, Vec::new()),
    };
    let warnings = [profile.warnings(), ranges].concat();
    warnings.iter().for_each(|warning| ui.note(&format!("warning: {warning}")));
    let limits = LimitReport::all(&profile);
    ui.print(&Checked { made: Made::new(&profile, Some(path), "valid"), limits, warnings })
}

/// Warnings for servos whose joint range exceeds the range of the shaft in the profile; an offset in the servo can
/// make up for that.
fn servo_warnings(wired: &WiredArm) -> Vec<String> {
    let joints = wired.arm.servos.iter().zip(&wired.profile.profile.servos).enumerate();
    let outside =
        joints.filter(|(_, (joint, servo))| joint.min_rad < servo.limit.min_rad || joint.max_rad > servo.limit.max_rad);
    outside.map(|(number, (joint, servo))| servo_warning(wired, number, joint, servo)).collect()
}

/// The warning for the servo with this number.
fn servo_warning(wired: &WiredArm, number: usize, joint: &Servo, servo: &ProfileServo) -> String {
    let angles = [joint.min_rad, joint.max_rad, servo.limit.min_rad, servo.limit.max_rad];
    let [from, to, min, max] = angles.map(f32::to_degrees);
    format!(
        "{}: servo {number} has the range {from:.1} to {to:.1} deg in the arm file, but the profile allows {min:.1} to \
         {max:.1} deg without a zero offset; `darm table` refuses angles outside it",
        wired.arm.servo_name(number),
    )
}

/// Stores a profile and waits until the board has restarted with it.
pub(crate) fn write(client: &mut Client, profile: &BoardProfile) -> anyhow::Result<()> {
    let start = Instant::now();
    loop {
        match client.upload(&profile.image(), &mut |_| {}) {
            Ok(_) => break,
            // The answer was lost in the restart.
            Err(ClientError::Refused(Refusal::NobodyPresent)) if has(client, profile) => return Ok(()),
            Err(ClientError::Refused(Refusal::NobodyPresent)) if start.elapsed() < BUTTON_LIMIT => {
                std::thread::sleep(POLL)
            }
            Err(ClientError::Refused(Refusal::NobodyPresent)) => return Err(ProfileCommandError::NobodyPresent.into()),
            Err(error) => return Err(error.into()),
        }
    }
    let start = Instant::now();
    while start.elapsed() < RESTART_LIMIT {
        // The board does not answer while it restarts.
        if has(client, profile) {
            return Ok(());
        }
        std::thread::sleep(POLL);
    }
    Err(ProfileCommandError::NoRestart.into())
}

fn has(client: &mut Client, profile: &BoardProfile) -> bool {
    client.say_hello().is_ok_and(|hello| hello.profile == profile.profile.digest)
}

fn show(client: &mut Client, ui: Ui) -> anyhow::Result<()> {
    let profile = client.say_hello()?.profile;
    let outputs = client.outputs()?;
    let state = ProfileState::of(client, &outputs);
    ui.print(&Shown {
        profile: profile.to_string(),
        state,
        built_in: state == ProfileState::BuiltIn,
        outputs: outputs.iter().map(OutputReport::from).collect(),
    })
}
