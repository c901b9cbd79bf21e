//! `darm table --show`: contents of a table file.

use std::path::{Path, PathBuf};

use darm_core::output::{ActuatorWiring, Coil, Drive, ServoWiring};
use darm_core::table::{Record, Row};
use darm_core::units::{Digest, Micros};
use serde::Serialize;

use super::SHOWN;
use crate::ui::{Answer, columns};
use darm_arm::table_file::{TableFile, TableFileError};

#[derive(Serialize)]
pub(super) struct Shown {
    file: PathBuf,
    digest: String,
    model: String,
    device: Option<String>,
    profile: String,
    built_in_profile: bool,
    bytes: u32,
    end_s: f64,
    outputs: Vec<OutputReport>,
    actuators: Vec<ActuatorReport>,
    servos: Vec<ServoReport>,
    /// Modules whose frames the board searches.
    modules: usize,
    rows: Vec<RowReport>,
    #[serde(skip)]
    shown: usize,
}

#[derive(Serialize)]
struct OutputReport {
    output: u8,
    drive: &'static str,
    /// Lines of the chain that the drive switches.
    lines: Vec<u8>,
    pulse_s: Option<f64>,
    max_on_s: f64,
    duty_percent: u8,
    window_s: f64,
}

#[derive(Serialize)]
struct ActuatorReport {
    actuator: usize,
    states: u8,
    input: Option<u8>,
    travel_s: f64,
}

#[derive(Serialize)]
struct ServoReport {
    id: u8,
    min_rad: f32,
    max_rad: f32,
    max_speed_rad_s: f32,
    max_torque: f32,
}

#[derive(Serialize)]
struct RowReport {
    at_s: f64,
    word: String,
    servos_rad: Vec<f32>,
}

/// Contents of the file; the text lists every row with `all`.
pub(super) fn shown(path: &Path, all: bool) -> Result<Shown, TableFileError> {
    let file = TableFile::read(path)?;
    let actuators = file.records.iter().filter_map(|record| match record {
        Record::Actuator(actuator) => Some(actuator),
        _ => None,
    });
    Ok(Shown {
        file: path.into(),
        digest: file.digest().to_string(),
        model: file.image.image().model.to_string(),
        device: file.device.map(|device| device.to_string()),
        profile: file.profile.to_string(),
        built_in_profile: file.profile == Digest::default(),
        bytes: file.image.image().len,
        end_s: seconds(file.end()),
        outputs: file.records.iter().filter_map(output).collect(),
        actuators: actuators.enumerate().map(|(number, wiring)| actuator(number, wiring)).collect(),
        servos: file.records.iter().filter_map(servo).collect(),
        modules: file.records.iter().filter(|record| matches!(record, Record::Module { .. })).count(),
        rows: file.records.iter().filter_map(row).collect(),
        shown: if all { usize::MAX } else { SHOWN },
    })
}

fn seconds(at: Micros) -> f64 {
    at.0 as f64 * 1e-6
}

fn output(record: &Record) -> Option<OutputReport> {
    let Record::Coil(Coil { output, drive, limit }) = *record else { return None };
    let (drive, lines, pulse_ms) = match drive {
        Drive::Hold { line } => ("hold", vec![line], None),
        Drive::PeakHold { pull, hold, peak_ms } => ("peak-hold", vec![pull, hold], Some(peak_ms)),
        Drive::Latch { set, reset, pulse_ms } => ("latch", vec![set, reset], Some(pulse_ms)),
    };
    let [max_on_s, window_s] = [limit.max_on_ms, limit.window_ms].map(|ms| 1e-3 * f64::from(ms));
    let pulse_s = pulse_ms.map(|ms: u16| 1e-3 * f64::from(ms));
    Some(OutputReport { output, drive, lines, pulse_s, max_on_s, duty_percent: limit.duty_percent, window_s })
}

fn actuator(number: usize, wiring: &ActuatorWiring) -> ActuatorReport {
    let input = wiring.switch.map(|switch| switch.input);
    ActuatorReport { actuator: number, states: wiring.states, input, travel_s: 1e-3 * f64::from(wiring.travel_ms) }
}

fn servo(record: &Record) -> Option<ServoReport> {
    let Record::Servo(ServoWiring { id, min_rad, max_rad, max_speed_rad_s, max_torque, .. }) = *record else {
        return None;
    };
    Some(ServoReport { id, min_rad, max_rad, max_speed_rad_s, max_torque })
}

fn row(record: &Record) -> Option<RowReport> {
    let Record::Row(Row { at, word, servos }) = record else { return None };
    Some(RowReport { at_s: seconds(*at), word: word.to_string(), servos_rad: servos.to_vec() })
}

impl Shown {
    fn head(&self) -> String {
        let device = self.device.as_ref().map_or("any board".to_owned(), |device| format!("board {device} only"));
        let profile = if self.built_in_profile { "built in" } else { &self.profile };
        let modules = match self.modules {
            0 => "none".to_owned(),
            modules => format!("of {modules} modules, for `darm nearest --on-board`"),
        };
        format!(
            "table    {}\nmodel    {}\nfor      {device}\nprofile  {profile}\nlength   {} bytes, {} rows, {:.3} s\nframes   {modules}",
            self.digest,
            self.model,
            self.bytes,
            self.rows.len(),
            self.end_s
        )
    }

    fn outputs(&self) -> String {
        let titles = ["output", "drive", "lines", "pulse", "max on-time", "duty", "window"].map(str::to_owned).to_vec();
        columns(&std::iter::once(titles).chain(self.outputs.iter().map(OutputReport::cells)).collect::<Vec<_>>())
    }

    fn actuators(&self) -> String {
        let titles = ["actuator", "states", "input", "travel"].map(str::to_owned).to_vec();
        let row = |actuator: &ActuatorReport| {
            let input = actuator.input.map_or("none".to_owned(), |input| input.to_string());
            let travel = format!("{:.3} s", actuator.travel_s);
            vec![actuator.actuator.to_string(), actuator.states.to_string(), input, travel]
        };
        columns(&std::iter::once(titles).chain(self.actuators.iter().map(row)).collect::<Vec<_>>())
    }

    fn servos(&self) -> String {
        let servo = |(number, servo): (usize, &ServoReport)| {
            let [min, max, speed] = [servo.min_rad, servo.max_rad, servo.max_speed_rad_s].map(f32::to_degrees);
            format!(
                "servo {number}, id {}: {min:.2} to {max:.2} deg, at most {speed:.1} deg/s, torque {:.2}\n",
                servo.id, servo.max_torque
            )
        };
        self.servos.iter().enumerate().map(servo).collect()
    }

    fn rows(&self) -> String {
        let servos = if self.servos.is_empty() { "" } else { "servos" };
        let titles = ["row", "time", "word", servos].map(str::to_owned).to_vec();
        let row = |(number, row): (usize, &RowReport)| {
            let servos: Vec<_> = row.servos_rad.iter().map(|angle| format!("{:.2} deg", angle.to_degrees())).collect();
            vec![number.to_string(), format!("{:.3} s", row.at_s), row.word.clone(), servos.join(" ")]
        };
        let rows = self.rows.iter().enumerate().take(self.shown).map(row);
        let text = columns(&std::iter::once(titles).chain(rows).collect::<Vec<_>>());
        match self.rows.len().saturating_sub(self.shown) {
            0 => text,
            more => text + &format!("\n… {more} more rows; --all shows them"),
        }
    }
}

impl OutputReport {
    /// Its cells in the table of outputs.
    fn cells(&self) -> Vec<String> {
        let lines: Vec<String> = self.lines.iter().map(u8::to_string).collect();
        vec![
            self.output.to_string(),
            self.drive.to_owned(),
            lines.join(" "),
            self.pulse_s.map_or(String::new(), |pulse_s| format!("{pulse_s:.3} s")),
            format!("{:.3} s", self.max_on_s),
            format!("{} %", self.duty_percent),
            format!("{:.3} s", self.window_s),
        ]
    }
}

impl Answer for Shown {
    fn text(&self) -> String {
        let servos = self.servos();
        let servos = if servos.is_empty() { servos } else { format!("{servos}\n") };
        format!("{}\n\n{}\n\n{}\n\n{servos}{}", self.head(), self.outputs(), self.actuators(), self.rows())
    }
}
