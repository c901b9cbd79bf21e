//! What `darm profile` prints.

use std::path::{Path, PathBuf};

use darm_arm::board_profile::{BoardProfile, longest_on_s};
use darm_core::output::CoilLimit;
use darm_core::wire::message::OutputState;
use serde::Serialize;

use crate::commands::status::{LOST, ProfileState};
use crate::ui::{Answer, columns};

#[derive(Serialize)]
pub(super) struct Made {
    file: Option<PathBuf>,
    name: String,
    digest: String,
    outputs: usize,
    servos: usize,
    #[serde(skip)]
    done: &'static str,
}

impl Made {
    pub(super) fn new(profile: &BoardProfile, file: Option<&Path>, done: &'static str) -> Self {
        Self {
            file: file.map(Path::to_owned),
            name: profile.name.clone(),
            digest: profile.profile.digest.to_string(),
            outputs: profile.profile.outputs.iter().flatten().count(),
            servos: profile.profile.servos.len(),
            done,
        }
    }
}

impl Answer for Made {
    fn text(&self) -> String {
        let file = self.file.as_ref().map_or(String::new(), |file| format!(" in {}", file.display()));
        let short = self.digest.get(..16).unwrap_or(&self.digest);
        let (outputs, servos) = (counted(self.outputs, "output"), counted(self.servos, "servo"));
        format!("profile \"{}\" {short}: {outputs}, {servos}; {}{file}", self.name, self.done)
    }
}

fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// Result of a check.
#[derive(Serialize)]
pub(super) struct Checked {
    #[serde(flatten)]
    pub(super) made: Made,
    /// Limits in force for each output, after derating.
    pub(super) limits: Vec<LimitReport>,
    pub(super) warnings: Vec<String>,
}

#[derive(Serialize)]
pub(super) struct LimitReport {
    output: u8,
    max_on_s: f64,
    duty_percent: u8,
    window_s: f64,
    /// Longest on-time that all three allow.
    longest_on_s: f64,
}

impl LimitReport {
    pub(super) fn all(profile: &BoardProfile) -> Vec<Self> {
        let outputs = (0..).zip(&profile.profile.outputs);
        let report = |(output, limit): (u8, CoilLimit)| Self {
            output,
            max_on_s: 1e-3 * f64::from(limit.max_on_ms),
            duty_percent: limit.duty_percent,
            window_s: 1e-3 * f64::from(limit.window_ms),
            longest_on_s: longest_on_s(&limit),
        };
        outputs.filter_map(|(number, output)| Some((number, output.as_ref()?.limit))).map(report).collect()
    }

    /// Its cells in the table of limits.
    fn cells(&self) -> Vec<String> {
        vec![
            self.output.to_string(),
            format!("{:.3} s", self.max_on_s),
            format!("{} %", self.duty_percent),
            format!("{:.3} s", self.window_s),
            format!("{:.3} s", self.longest_on_s),
        ]
    }
}

impl Answer for Checked {
    fn text(&self) -> String {
        let path = self.made.file.as_deref().unwrap_or(Path::new("the profile"));
        let made =
            Made { file: None, done: "", name: self.made.name.clone(), digest: self.made.digest.clone(), ..self.made };
        let head = format!("{} is valid: {}", path.display(), made.text().trim_end_matches("; "));
        let titles = ["output", "max on-time", "duty", "window", "effective max on-time"].map(str::to_owned).to_vec();
        let rows: Vec<_> = std::iter::once(titles).chain(self.limits.iter().map(LimitReport::cells)).collect();
        format!("{head}\n\nlimits in force, after derating:\n{}", columns(&rows))
    }
}

#[derive(Serialize)]
pub(super) struct Shown {
    pub(super) profile: String,
    pub(super) state: ProfileState,
    pub(super) built_in: bool,
    pub(super) outputs: Vec<OutputReport>,
}

#[derive(Serialize)]
pub(super) struct OutputReport {
    output: u8,
    max_on_s: f64,
    duty_percent: u8,
    window_s: f64,
    left_s: f64,
    recovery_s: f64,
}

impl From<&OutputState> for OutputReport {
    fn from(state: &OutputState) -> Self {
        let seconds = |ms: u32| f64::from(ms) / 1000.0;
        Self {
            output: state.output,
            max_on_s: seconds(state.limit.max_on_ms),
            duty_percent: state.limit.duty_percent,
            window_s: seconds(state.limit.window_ms),
            left_s: seconds(state.left_ms.min(state.limit.max_on_ms)),
            recovery_s: seconds(state.recovery_ms),
        }
    }
}

impl OutputReport {
    /// Its cells in the table of outputs.
    fn cells(&self) -> Vec<String> {
        vec![
            self.output.to_string(),
            format!("{:.1} s", self.max_on_s),
            format!("{} %", self.duty_percent),
            format!("{:.1} s", self.window_s),
            format!("{:.1} s", self.left_s),
            format!("{:.0} s", self.recovery_s),
        ]
    }
}

impl Answer for Shown {
    fn text(&self) -> String {
        let head = match self.state {
            ProfileState::Lost => format!("the profile of the board is {LOST}"),
            ProfileState::BuiltIn => {
                "the board has no profile: the built-in limits are in force, servos are off".to_owned()
            }
            ProfileState::Written => format!("profile {}", self.profile.get(..16).unwrap_or(&self.profile)),
        };
        if self.outputs.is_empty() {
            return head;
        }
        let titles =
            ["output", "max on-time", "duty", "window", "left now", "recovered in"].map(str::to_owned).to_vec();
        let rows: Vec<_> = std::iter::once(titles).chain(self.outputs.iter().map(OutputReport::cells)).collect();
        format!("{head}\n\n{}", columns(&rows))
    }
}
