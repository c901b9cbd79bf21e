//! The files that a bring-up writes: profile and arm with what was found, all else as it was.

use std::path::Path;

use anyhow::Context as _;
use darm_arm::arm::{Arm, with_travel_ms};
use darm_arm::board_profile::{BoardProfile, with_wires};
use darm_arm::wired_arm::WiredArm;
use darm_device::bringup::{Correction, Outcome, Subject, travel_ms};
use darm_robot::source::path_between;
use toml_edit::DocumentMut;

use crate::output_file::write_all;

/// What was found of an arm, and what follows for its files.
pub(super) struct Corrected<'a> {
    pub(super) wired: &'a WiredArm,
    pub(super) subject: &'a Subject,
    pub(super) outcome: &'a Outcome,
    pub(super) correction: &'a Correction,
}

impl Corrected<'_> {
    /// The time of travel of each actuator as measured; `None` where it was not.
    pub(super) fn travel_ms(&self) -> Vec<Option<u16>> {
        let actuators = 0..self.wired.wiring.actuators.len();
        actuators.map(|actuator| travel_ms(&self.outcome.travels, actuator)).collect()
    }

    /// Writes the profile and the arm file that are wanted; what is written is read again first.
    pub(super) fn write(&self, arm: &Path, profile: Option<&Path>, outputs: [Option<&Path>; 2]) -> anyhow::Result<()> {
        let [new_profile, new_arm] = outputs;
        let mut texts = Vec::new();
        if let Some((old, new)) = profile.zip(new_profile) {
            let text = with_wires(&read(old)?, &self.correction.profile)?;
            BoardProfile::parse(new, &text)?;
            texts.push((new, text));
        }
        if let Some(new) = new_arm {
            let text = with_travel_ms(&read(arm)?, &self.travel_ms())?;
            let text = named(&text, profile.map(|old| path_between(new, new_profile.unwrap_or(old))).as_deref())?;
            Arm::parse(new, &text)?;
            texts.push((new, text));
        }
        write_all(&texts.iter().map(|(path, text)| (*path, text.as_bytes())).collect::<Vec<_>>())
    }
}

/// The text of an arm file with this path of its profile.
fn named(text: &str, profile: Option<&Path>) -> anyhow::Result<String> {
    let mut document: DocumentMut = text.parse()?;
    if let Some(profile) = profile {
        document["profile"] = toml_edit::value(profile.display().to_string());
    }
    Ok(document.to_string())
}

fn read(path: &Path) -> anyhow::Result<String> {
    std::fs::read_to_string(path).with_context(|| format!("{}: cannot be read", path.display()))
}
