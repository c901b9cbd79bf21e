//! `darm stops`: what a person with a screwdriver is to do to make one arm the other.

use std::path::PathBuf;

use darm_arm::arm::Arm;
use darm_arm::stops::{Setting, differences};
use serde::Serialize;

use crate::voice::{Answer, Voice, columns};

const EXAMPLES: &str = "\
Examples:
  darm stops arm.toml arm2.toml          which stop goes which way, by how many mm
  darm --json stops arm.toml arm2.toml";

/// Say by how many mm each stop and anchor is to be moved from one arm to the other
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Stops {
    /// The arm as it is set
    #[arg(value_name = "OLD.toml")]
    old: PathBuf,
    /// The arm as it is to be
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
    from: f64,
    to: f64,
    change: f64,
    unit: &'static str,
    direction: &'static str,
}

impl Stops {
    pub(crate) fn run(&self, voice: Voice) -> anyhow::Result<()> {
        let (old, new) = (Arm::read(&self.old)?, Arm::read(&self.new)?);
        let settings = differences(&old, &new)?;
        voice.tell(&Report { settings: settings.iter().map(line).collect() })
    }
}

fn line(setting: &Setting) -> Line {
    let shown = |value: f64| if setting.is_angle { value.to_degrees() } else { 1e3 * value };
    Line {
        actuator: setting.actuator,
        name: setting.name.clone(),
        part: setting.part.to_string(),
        from: shown(setting.from),
        to: shown(setting.to),
        change: setting.change(),
        unit: setting.unit(),
        direction: setting.direction(),
    }
}

impl Answer for Report {
    fn text(&self) -> String {
        if self.settings.is_empty() {
            return "nothing to move: stops and anchors are the same".to_owned();
        }
        let head = ["actuator", "", "part", "from", "to", "move by", ""];
        let mut rows = vec![head.map(str::to_owned).to_vec()];
        rows.extend(self.settings.iter().map(|line| {
            let shown = |value: f64| format!("{value:.3} {}", line.unit);
            vec![
                line.actuator.to_string(),
                line.name.clone(),
                line.part.clone(),
                shown(line.from),
                shown(line.to),
                shown(line.change.abs()),
                line.direction.to_owned(),
            ]
        }));
        format!(
            "{}\n\n`out` makes an actuator longer, `in` shorter; anchors go forward along their axis or back",
            columns(&rows)
        )
    }
}
