//! `darm adjust`: by how much to move stops and anchors to turn one arm into another.

use std::path::PathBuf;

use darm_arm::arm::Arm;
use darm_arm::stops::{Setting, differences};
use serde::Serialize;

use crate::failure::Usage;
use crate::ui::{Answer, Ui, columns};

const EXAMPLES: &str = "\
Examples:
  darm adjust arm.toml arm3.toml          # by how many mm to move each stop, and in which direction
  darm --json adjust arm.toml arm3.toml   # the same in m and rad";

/// List the adjustment of each stop and anchor from one arm to another
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Adjust {
    /// The arm as it is
    #[arg(value_name = "OLD.toml")]
    old: PathBuf,
    /// The arm as it should be
    #[arg(value_name = "NEW.toml")]
    new: PathBuf,
    /// Smallest adjustment that is listed, in mm; of an angle at the length scale of the arm
    #[arg(long = "resolution", value_name = "MM", default_value_t = RESOLUTION_MM)]
    resolution_mm: f64,
}

/// Smallest adjustment that is listed, mm.
pub(super) const RESOLUTION_MM: f64 = 0.05;

/// The adjustments from one arm to another.
#[derive(Serialize)]
pub(super) struct Report {
    settings: Vec<Line>,
    /// Stops and anchors that differ by less than the resolution.
    below_resolution: usize,
    resolution_m: f64,
}

#[derive(Serialize)]
struct Line {
    actuator: usize,
    name: String,
    part: String,
    #[serde(flatten)]
    values: Values,
    direction: &'static str,
}

/// Setting before and after, and the difference.
#[derive(Serialize)]
#[serde(untagged)]
enum Values {
    Length { from_m: f64, to_m: f64, change_m: f64 },
    Angle { from_rad: f64, to_rad: f64, change_rad: f64 },
}

impl Values {
    /// Before, after, absolute difference and unit, as a person reads them.
    fn shown(&self) -> ([f64; 3], &'static str) {
        match *self {
            Self::Length { from_m, to_m, change_m } => ([from_m, to_m, change_m.abs()].map(|m| 1e3 * m), "mm"),
            Self::Angle { from_rad, to_rad, change_rad } => {
                ([from_rad, to_rad, change_rad.abs()].map(f64::to_degrees), "deg")
            }
        }
    }
}

impl Adjust {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let (old, new) = (Arm::read(&self.old)?, Arm::read(&self.new)?);
        ui.print(&report(&old, &new, self.resolution_mm)?)
    }
}

/// The adjustments of at least this size.
pub(super) fn report(old: &Arm, new: &Arm, resolution_mm: f64) -> anyhow::Result<Report> {
    let resolution_m = 1e-3 * resolution_mm;
    if !(resolution_m >= 0.0 && resolution_m.is_finite()) {
        return Err(Usage(format!("--resolution {resolution_mm}: give a length of at least 0 mm")).into());
    }
    let changes = |setting: &Setting| {
        let per_unit_m = if setting.is_angle { old.length_scale_m } else { 1.0 };
        (setting.to - setting.from).abs() * per_unit_m > resolution_m
    };
    let (listed, below): (Vec<_>, Vec<_>) = differences(old, new)?.into_iter().partition(changes);
    Ok(Report { settings: listed.iter().map(line).collect(), below_resolution: below.len(), resolution_m })
}

fn line(setting: &Setting) -> Line {
    let Setting { from, to, .. } = *setting;
    let values = match setting.is_angle {
        true => Values::Angle { from_rad: from, to_rad: to, change_rad: to - from },
        false => Values::Length { from_m: from, to_m: to, change_m: to - from },
    };
    Line {
        actuator: setting.actuator,
        name: setting.name.clone(),
        part: setting.part.to_string(),
        values,
        direction: setting.direction(),
    }
}

impl Report {
    /// The adjustments in a sentence: `actuator 3 (leg), stop out, 0.512 mm out; …`.
    pub(super) fn sentence(&self) -> String {
        let one = |line: &Line| {
            let ([.., change], unit) = line.values.shown();
            format!("{} (actuator {}), {}, {change:.3} {unit} {}", line.name, line.actuator, line.part, line.direction)
        };
        let all: Vec<String> = self.settings.iter().map(one).collect();
        if all.is_empty() { "none has to be turned".into() } else { all.join("; ") }
    }
}

impl Answer for Report {
    fn text(&self) -> String {
        let below = match self.below_resolution {
            0 => String::new(),
            1 => format!("\nthe other one stays: it differs by less than {} mm", 1e3 * self.resolution_m),
            n => format!("\nthe other {n} stay: they differ by less than {} mm", 1e3 * self.resolution_m),
        };
        if self.settings.is_empty() {
            return format!("no adjustment: stops and anchors of both arms are the same{below}");
        }
        let head = ["actuator", "", "part", "from", "to", "adjustment", ""];
        let mut rows = vec![head.map(str::to_owned).to_vec()];
        rows.extend(self.settings.iter().map(|line| {
            let (values, unit) = line.values.shown();
            let [from, to, change] = values.map(|value| format!("{value:.3} {unit}"));
            let head = [line.actuator.to_string(), line.name.clone(), line.part.clone()];
            head.into_iter().chain([from, to, change, line.direction.to_owned()]).collect()
        }));
        format!(
            "{}{below}\n\n`out` lengthens an actuator, `in` shortens it; anchors move forward or back along their axis",
            columns(&rows)
        )
    }
}
