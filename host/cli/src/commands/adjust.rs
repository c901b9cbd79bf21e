//! `darm adjust`: by how much to move stops and anchors to turn one arm into another.

use std::path::PathBuf;

use darm_arm::arm::Arm;
use darm_arm::stops::{Setting, differences};
use serde::Serialize;

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
}

#[derive(Serialize)]
struct Report {
    settings: Vec<Line>,
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
        let settings = differences(&old, &new)?;
        ui.print(&Report { settings: settings.iter().map(line).collect() })
    }
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

impl Answer for Report {
    fn text(&self) -> String {
        if self.settings.is_empty() {
            return "no adjustment: stops and anchors of both arms are the same".to_owned();
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
            "{}\n\n`out` lengthens an actuator, `in` shortens it; anchors move forward or back along their axis",
            columns(&rows)
        )
    }
}
