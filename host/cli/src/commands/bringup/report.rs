//! What a bring-up prints.

use std::path::PathBuf;

use darm_device::bringup::{Finding, Travel};
use serde::Serialize;

use super::files::Corrected;
use crate::ui::{Answer, columns};

/// Result of a bring-up.
#[derive(Serialize)]
pub(super) struct Report {
    /// Outputs that were switched.
    outputs: Vec<u8>,
    skipped: Vec<u8>,
    complete: bool,
    /// A person said of each output what moved.
    watched: bool,
    /// Whether the emergency stop was pressed and seen; `None` without one.
    emergency_stop_checked: Option<bool>,
    findings: Vec<Finding>,
    strokes: Vec<StrokeReport>,
    actuators: Vec<ActuatorReport>,
    /// What was changed in the profile.
    changes: Vec<String>,
    profile: Option<PathBuf>,
    arm: Option<PathBuf>,
}

/// Time from switching an output to the change of its switch.
#[derive(Serialize)]
struct StrokeReport {
    actuator: usize,
    output: u8,
    /// Whether the output was switched on, or off.
    on: bool,
    /// Whether the switch closed.
    closed: bool,
    min_s: f64,
    max_s: f64,
}

/// Time of travel of one actuator.
#[derive(Serialize)]
struct ActuatorReport {
    actuator: usize,
    #[serde(skip)]
    name: String,
    /// In the arm file.
    travel_s: f64,
    /// As measured, with its margin.
    new_travel_s: f64,
}

impl Report {
    pub(super) fn new(corrected: &Corrected<'_>, [profile, arm]: [Option<PathBuf>; 2]) -> Self {
        let Corrected { wired, subject, outcome, correction } = corrected;
        let actuators = wired.wiring.actuators.iter().zip(corrected.travel_ms()).enumerate();
        let seconds = |ms: u16| 1e-3 * f64::from(ms);
        let measured = actuators.filter_map(|(actuator, (wiring, travel_ms))| {
            let (name, travel_s) = (subject.name(actuator), seconds(wiring.travel_ms));
            Some(ActuatorReport { actuator, name, travel_s, new_travel_s: seconds(travel_ms?) })
        });
        Self {
            outputs: outcome.strokes.iter().map(|stroke| stroke.output).collect(),
            skipped: outcome.skipped.clone(),
            complete: outcome.is_complete,
            watched: outcome.strokes.iter().all(|stroke| stroke.sight.is_some()),
            emergency_stop_checked: subject.emergency_stop.map(|_| outcome.is_stop_checked),
            findings: outcome.findings.clone(),
            strokes: outcome.travels.iter().map(StrokeReport::from).collect(),
            actuators: measured.collect(),
            changes: correction.changes.clone(),
            profile,
            arm,
        }
    }

    fn times(&self, actuator: usize) -> String {
        let own = self.strokes.iter().filter(|stroke| stroke.actuator == actuator);
        own.map(StrokeReport::text).collect::<Vec<_>>().join(", ")
    }

    fn table(&self) -> String {
        let rows: Vec<Vec<String>> = self.actuators.iter().map(|actuator| self.row(actuator)).collect();
        if rows.is_empty() { String::new() } else { columns(&rows) }
    }

    fn row(&self, actuator: &ActuatorReport) -> Vec<String> {
        let [old_ms, new_ms] = [actuator.travel_s, actuator.new_travel_s].map(|travel_s| 1e3 * travel_s);
        vec![actuator.name.clone(), self.times(actuator.actuator), format!("travel_ms {new_ms:.0}, was {old_ms:.0}")]
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if !self.skipped.is_empty() {
            let skipped: Vec<String> = self.skipped.iter().map(u8::to_string).collect();
            notes.push(format!("not checked: outputs {}", skipped.join(", ")));
        }
        if !self.watched {
            notes.push(
                "nobody looked at every output: outputs and switches that are exchanged together look right".to_owned(),
            );
        }
        if self.emergency_stop_checked == Some(false) {
            notes.push("the emergency stop was not checked".to_owned());
        }
        notes.extend(self.changes.iter().map(|change| format!("corrected: {change}")));
        notes.extend(self.profile.iter().map(|path| format!("profile written: {}", path.display())));
        notes.extend(self.arm.iter().map(|path| format!("arm written: {}", path.display())));
        if !self.outputs.is_empty() {
            notes.push("all outputs are off; the board's table is one without limit switches: upload yours".to_owned());
        }
        notes
    }
}

impl From<&Travel> for StrokeReport {
    fn from(travel: &Travel) -> Self {
        let Travel { actuator, output, on, closed, min_us, max_us } = *travel;
        let [min_s, max_s] = [min_us, max_us].map(|us| 1e-6 * f64::from(us));
        Self { actuator, output, on, closed, min_s, max_s }
    }
}

impl StrokeReport {
    fn text(&self) -> String {
        let (switched, seen) = (if self.on { "on" } else { "off" }, if self.closed { "arrives" } else { "leaves" });
        format!("{switched}: {seen} after {:.0} to {:.0} ms", 1e3 * self.min_s, 1e3 * self.max_s)
    }
}

fn finding(finding: &Finding) -> String {
    let Finding { kind, wire, expected, seen, cure } = finding;
    format!("{}: {wire}\n  expected  {expected}\n  seen      {seen}\n  do        {cure}\n", kind.name())
}

impl Answer for Report {
    fn text(&self) -> String {
        let mut parts: Vec<String> = self.findings.iter().map(finding).collect();
        parts.push(self.table());
        parts.extend(self.notes());
        let count = match self.findings.len() {
            0 => "no finding".to_owned(),
            1 => "1 finding".to_owned(),
            count => format!("{count} findings"),
        };
        parts.push(format!("{} outputs checked, {count}", self.outputs.len()));
        parts.retain(|part| !part.is_empty());
        parts.join("\n")
    }
}
