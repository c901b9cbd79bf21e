//! One row of a recording, exactly, with the posture that the model predicts for it.

use darm_arm::wired_arm::WiredArm;
use darm_core::output::Coil;
use darm_core::units::Word;
use serde::Serialize;

use super::curves::PA_PER_BAR;
use super::opened::Opened;
use crate::measured::Residual;
use crate::picture::{Picture, Tool};
use crate::program::{coils_with_actuators, drive_name};

/// A row as pages show it.
#[derive(Debug, Serialize)]
pub(super) struct RowView {
    row: usize,
    /// Line of the file, the header being 1.
    line: usize,
    time_s: f64,
    run: u32,
    visit: u32,
    is_held_out: bool,
    word: String,
    previous: Option<String>,
    servos_rad: Vec<f64>,
    /// The measured pose of the tool.
    measured: Tool,
    /// The predicted posture.
    picture: Option<Picture>,
    /// Why the model has none for this row.
    problem: Option<String>,
    /// Predicted less measured pose.
    residual: Option<Residual>,
    supply_bar: Option<f64>,
    temperature_c: Option<f64>,
    load_kg: Option<f64>,
    /// Outputs that the word switches on.
    outputs: Vec<SwitchedOutput>,
}

/// An output that a word switches on.
#[derive(Debug, Serialize)]
struct SwitchedOutput {
    output: u8,
    actuator: usize,
    /// `hold`, `peak-hold` or `latch`: a latch keeps its state without current.
    drive: &'static str,
}

impl RowView {
    /// `None` behind the last row.
    pub(super) fn of(opened: &Opened, row: usize, wired: Option<&WiredArm>) -> Option<Self> {
        let sample = opened.run.samples.get(row)?;
        let fitting = wired.zip(opened.observations.as_ref());
        let predicted = fitting.and_then(|(wired, observations)| {
            let condition = observations.condition(observations.rows.get(row)?);
            Some(Picture::under(&wired.arm, &condition))
        });
        let (picture, problem) = match predicted {
            Some(Ok(picture)) => (Some(picture), None),
            Some(Err(error)) => (None, Some(error)),
            None => (None, None),
        };
        Some(Self {
            row,
            line: opened.run.line(row),
            time_s: sample.time_s,
            run: sample.run,
            visit: sample.visit,
            is_held_out: sample.held_out,
            word: sample.word.to_string(),
            previous: sample.previous.map(|word| word.to_string()),
            servos_rad: sample.servos_rad.clone(),
            measured: Tool::of(&sample.pose),
            residual: picture.as_ref().map(|picture| Residual::of(&picture.tool.pose(), &sample.pose)),
            picture,
            problem,
            supply_bar: sample.supply.map(|supply_pa| supply_pa / PA_PER_BAR),
            temperature_c: sample.temperature_c,
            load_kg: sample.load_kg,
            outputs: fitting.map_or_else(Vec::new, |(wired, _)| outputs(wired, &sample.word)),
        })
    }
}

/// The outputs that a word of this arm switches on; none of another word.
fn outputs(wired: &WiredArm, word: &Word) -> Vec<SwitchedOutput> {
    if !wired.wiring.has_word(word) {
        return Vec::new();
    }
    let on = wired.wiring.coils_on(word);
    let coils = coils_with_actuators(&wired.wiring).enumerate().filter(|(index, _)| on >> index & 1 == 1);
    let output = |(actuator, coil): (usize, &Coil)| SwitchedOutput {
        output: coil.output,
        actuator,
        drive: drive_name(&coil.drive),
    };
    coils.map(|(_, coil)| output(coil)).collect()
}
