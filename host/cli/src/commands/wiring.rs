//! `darm wiring`: the wires between a board and an arm, one by one.

use std::path::PathBuf;

use darm_arm::arm::Arm;
use darm_arm::wired_arm::profile_of;
use darm_arm::wiring_list::{CoilWire, InputWire, ServoWire, SwitchWire, WiringList, spaced};
use serde::Serialize;

use crate::output_file::{self, Syntax};
use crate::overwrite::OutputFile;
use crate::ui::{Answer, Ui, columns};

const EXAMPLES: &str = "\
Examples:
  darm wiring pneumatic9.toml                                 # every wire, as a table
  darm wiring pneumatic9.toml -o wires.csv                    # the same as CSV
  darm wiring planar4-hybrid.toml --profile planar4-hybrid.profile.toml

The arm file names the outputs of each actuator, the profile the lines and the input of each output. A line is a pin of the chain \
of 74HC595: chip 0 is next to the board, QA of it is line 0; the number behind the name is that of the pin. A 5/2 valve with a \
spring is a `valve`; one with two coils, and a latch, have `set` and `reset`. The pins of inputs are those of the `board` of the profile. \
Where arm file and profile contradict each other, the command names all contradictions and fails.";

/// List each wire of an arm: output, pin of the register chain, coil, actuator, switch, input
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Wiring {
    /// The arm
    #[arg(value_name = "ARM.toml")]
    arm: PathBuf,
    /// Profile of the board [default: the one that the arm names]
    #[arg(long, value_name = "PROFILE.toml")]
    profile: Option<PathBuf>,
    /// CSV file to write
    #[arg(short, long, value_name = "FILE.csv")]
    output: Option<OutputFile>,
}

#[derive(Serialize)]
struct WiringReport {
    arm: String,
    profile: String,
    coils: Vec<CoilLine>,
    servos: Vec<ServoLine>,
    emergency_stop: Option<InputLine>,
    contradictions: Vec<String>,
    remarks: Vec<String>,
}

#[derive(Serialize)]
struct CoilLine {
    output: u8,
    line: u8,
    chip: u8,
    chip_pin: &'static str,
    chip_pin_number: u8,
    coil: &'static str,
    actuator: usize,
    name: String,
    on_in: Vec<u8>,
    switch: Option<SwitchLine>,
}

#[derive(Serialize)]
struct SwitchLine {
    #[serde(flatten)]
    input: InputLine,
    closed_in: Vec<u8>,
}

#[derive(Serialize)]
struct InputLine {
    input: u8,
    pin: Option<&'static str>,
}

#[derive(Serialize)]
struct ServoLine {
    servo: usize,
    id: u8,
    name: String,
    pin: Option<&'static str>,
}

impl Wiring {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let arm = Arm::read(&self.arm)?;
        let profile = profile_of(&arm, self.profile.as_deref())?;
        let list = WiringList::new(&arm, &profile);
        ui.print(&report(&arm, &profile.name, &list))?;
        list.remarks.iter().for_each(|remark| ui.note(&format!("note: {remark}")));
        if !list.contradictions.is_empty() {
            anyhow::bail!("arm file and profile contradict each other:\n  {}", list.contradictions.join("\n  "));
        }
        if let Some(output) = &self.output {
            output_file::write_text(output, Syntax::Csv, &list.csv())?;
            ui.note(&format!("{} wires in {}", list.coils.len(), output.display()));
        }
        Ok(())
    }
}

fn report(arm: &Arm, profile: &str, list: &WiringList) -> WiringReport {
    WiringReport {
        arm: arm.name.clone(),
        profile: profile.to_owned(),
        coils: list.coils.iter().map(CoilLine::from).collect(),
        servos: list.servos.iter().map(ServoLine::from).collect(),
        emergency_stop: list.emergency_stop.map(InputLine::from),
        contradictions: list.contradictions.clone(),
        remarks: list.remarks.clone(),
    }
}

impl From<&CoilWire> for CoilLine {
    fn from(wire: &CoilWire) -> Self {
        let (chip_pin, chip_pin_number) = wire.chip_pin();
        Self {
            output: wire.output,
            line: wire.line,
            chip: wire.chip(),
            chip_pin,
            chip_pin_number,
            coil: wire.coil.name(),
            actuator: wire.actuator,
            name: wire.actuator_name.clone(),
            on_in: wire.on_in.clone(),
            switch: wire.switch.as_ref().map(SwitchLine::from),
        }
    }
}

impl From<&SwitchWire> for SwitchLine {
    fn from(switch: &SwitchWire) -> Self {
        Self { input: switch.input.into(), closed_in: switch.closed_in.clone() }
    }
}

impl From<InputWire> for InputLine {
    fn from(InputWire { input, pin }: InputWire) -> Self {
        Self { input, pin }
    }
}

impl From<&ServoWire> for ServoLine {
    fn from(servo: &ServoWire) -> Self {
        let ServoWire { servo, id, name, pin } = servo.clone();
        Self { servo, id, name, pin }
    }
}

impl InputLine {
    fn text(&self) -> String {
        self.pin.map_or_else(|| self.input.to_string(), |pin| format!("{} ({pin})", self.input))
    }
}

impl Answer for WiringReport {
    fn text(&self) -> String {
        let head = ["output", "line", "chip", "pin", "coil", "actuator", "", "on in", "input", "closed in"];
        let mut rows = vec![head.map(str::to_owned).to_vec()];
        rows.extend(self.coils.iter().map(|wire| {
            let switch = wire.switch.as_ref();
            vec![
                wire.output.to_string(),
                wire.line.to_string(),
                wire.chip.to_string(),
                format!("{} ({})", wire.chip_pin, wire.chip_pin_number),
                wire.coil.to_owned(),
                wire.actuator.to_string(),
                wire.name.clone(),
                spaced(&wire.on_in),
                switch.map_or(String::new(), |switch| switch.input.text()),
                switch.map_or(String::new(), |switch| spaced(&switch.closed_in)),
            ]
        }));
        let bus = |pin: Option<&str>| pin.map_or(String::new(), |pin| format!(", pin {pin}"));
        let servo = |servo: &ServoLine| {
            format!("\nservo {} ({}): address {} on the servo bus{}", servo.servo, servo.name, servo.id, bus(servo.pin))
        };
        let stop = self.emergency_stop.as_ref().map(|stop| format!("\nemergency stop: input {}", stop.text()));
        let below: String = self.servos.iter().map(servo).chain(stop).collect();
        let gap = if below.is_empty() { "" } else { "\n" };
        format!("{} on the board of the profile {}\n\n{}{gap}{below}", self.arm, self.profile, columns(&rows))
    }
}
