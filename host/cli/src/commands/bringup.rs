//! `darm bringup`: checks the wiring of a new arm, one output at a time, with consent.

mod files;
mod person;
mod report;

use std::path::{Path, PathBuf};

use darm_arm::wired_arm::WiredArm;
use darm_core::units::{Digest, ShortDigest};
use darm_device::bringup::{self, Outcome, Subject, correct};
use darm_device::client::Client;

use crate::failure::{Findings, Unfinished, Usage};
use crate::guests::Role;
use crate::interrupt::InterruptHandler;
use crate::overwrite::OutputFile;
use crate::port::PortArgs;
use crate::ui::Ui;
use crate::{output_file, port};
use files::Corrected;
use person::Person;
use report::Report;

const EXAMPLES: &str = "\
Examples:
  darm bringup arm.toml --yes --actuator 0 --actuator 1   # asks nothing: for scripts and simulators
  darm bringup arm.toml --yes -o board.toml --new-arm checked.toml --force

Without --yes it asks before each output, and what moved: switches alone cannot distinguish exchanged outputs from exchanged \
switches. The board must hold the profile (`darm profile write`), with its limits; nothing outside it is driven.

Each output is on once, for twice its time of travel, at most 2 s; everything is off between two outputs and at the end. \
Ctrl-C, `darm stop` and the emergency stop act at any time. Keep clear of the arm: every actuator moves alone, and not in \
the order of a program.

The board's table is replaced by one without limit switches; upload yours again afterwards.

-o writes the profile with exchanged lines and inputs corrected, --new-arm the arm file with the measured `travel_ms`: one \
and a half times the longest stroke and 20 ms more, rounded up to 10 ms. Comments and all else stay.

Exit code 1: something was found; 7: ended before the last output. `docs/bring-up.md` explains each finding.";

/// Check the wiring of a new arm: switches one output at a time, reads switches back, measures travel times
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Bringup {
    /// The arm
    #[arg(value_name = "ARM.toml")]
    arm: PathBuf,
    /// Profile that the board holds; default: the one that the arm names
    #[arg(long, value_name = "PROFILE.toml")]
    profile: Option<PathBuf>,
    /// Check this actuator only; can be given several times
    #[arg(long, value_name = "N")]
    actuator: Vec<usize>,
    /// Ask nothing: somebody has made sure that the arm may move
    #[arg(long)]
    yes: bool,
    /// Corrected profile to write
    #[arg(short, long, value_name = "NEW_PROFILE.toml")]
    output: Option<OutputFile>,
    /// Arm file to write, with measured times of travel
    #[arg(long, value_name = "NEW_ARM.toml")]
    new_arm: Option<OutputFile>,
    #[command(flatten)]
    port: PortArgs,
}

/// Why a bring-up does not begin.
#[derive(Debug, thiserror::Error)]
enum StartError {
    #[error(
        "the board has the profile {board}, this is {file}; store it with `darm profile write`, or give that of the board by --profile"
    )]
    OtherProfile { board: ShortDigest, file: ShortDigest },
    #[error("{} names no profile, so there is none to correct; make one with `darm profile make`", .0.display())]
    NoProfile(PathBuf),
}

impl Bringup {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let wired = WiredArm::read(&self.arm, self.profile.as_deref())?;
        let actuators = self.actuators(&wired)?;
        let profile = self.profile.as_deref().or(wired.arm.profile.as_deref());
        self.check_outputs(profile)?;
        let subject = Subject::of(&wired);
        let outcome = self.bring_up(&wired, &subject, &actuators)?;
        let correction = correct(&wired.profile.profile, &subject, &outcome.findings);
        let corrected = Corrected { wired: &wired, subject: &subject, outcome: &outcome, correction: &correction };
        corrected.write(&self.arm, profile, [self.output.as_deref(), self.new_arm.as_deref()])?;
        let written = [&self.output, &self.new_arm].map(|path| path.as_deref().map(Path::to_path_buf));
        let report = Report::new(&corrected, written);
        ui.print(&report)?;
        end(&outcome, actuators.iter().map(|&actuator| wired.wiring.actuators[actuator].coils()).sum())
    }

    /// The actuators to check; each once, along the arm.
    fn actuators(&self, wired: &WiredArm) -> Result<Vec<usize>, Usage> {
        let count = wired.wiring.actuators.len();
        if let Some(other) = self.actuator.iter().find(|&&actuator| actuator >= count) {
            let last = count.saturating_sub(1);
            return Err(Usage(format!("--actuator {other}: {} has actuators 0 to {last}", self.arm.display())));
        }
        let is_wanted = |actuator: &usize| self.actuator.is_empty() || self.actuator.contains(actuator);
        Ok((0..count).filter(is_wanted).collect())
    }

    /// Refuses files that cannot be written, before anything moves.
    fn check_outputs(&self, profile: Option<&Path>) -> anyhow::Result<()> {
        if self.output.is_some() && profile.is_none() {
            return Err(StartError::NoProfile(self.arm.clone()).into());
        }
        let outputs: Vec<&Path> = self.output.iter().chain(&self.new_arm).map(|path| &**path).collect();
        outputs.iter().try_for_each(|path| output_file::refuse_other_than_toml(path, &[]))?;
        if let [first, second] = outputs.as_slice() {
            output_file::refuse_same(first, second)?;
        }
        Ok(())
    }

    fn bring_up(&self, wired: &WiredArm, subject: &Subject, actuators: &[usize]) -> anyhow::Result<Outcome> {
        let name = self.port.name()?;
        let (mut client, handle) = port::connect(&name, Role::Controls)?;
        let profile = wired.profile.profile.digest;
        check_profile(&client, profile)?;
        let interrupt = InterruptHandler::start(&name, handle)?;
        let mut person = Person::new(interrupt.clone(), self.yes);
        let outcome = bringup::run(&mut client, subject, profile, actuators, &mut person);
        match interrupt.interrupted() {
            Some(interrupted) => Err(interrupted.into()),
            None => Ok(outcome?),
        }
    }
}

fn check_profile(client: &Client, file: Digest) -> Result<(), StartError> {
    match client.hello().map(|hello| hello.profile) {
        Some(board) if board != file => Err(StartError::OtherProfile { board: board.short(), file: file.short() }),
        _ => Ok(()),
    }
}

/// Findings and an early end are errors of the command, after its report.
fn end(outcome: &Outcome, all: usize) -> anyhow::Result<()> {
    if !outcome.is_complete {
        return Err(Unfinished::Bringup { done: outcome.strokes.len(), all }.into());
    }
    match outcome.findings.len() {
        0 => Ok(()),
        count => Err(Findings(count).into()),
    }
}
