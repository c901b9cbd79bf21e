//! The wires between a board and an arm, one by one: output, pin of the register chain, coil, actuator, switch, input.
//!
//! The arm file names the outputs of each actuator, the profile the lines of each output; a line is a pin of the chain of 74HC595,
//! eight to a chip. What the two files contradict each other in is listed with the wires that they agree on.

use std::fmt::Write as _;

use darm_core::output::Drive;
use darm_core::profile::{LINES_PER_CHIP, PinTable, Profile};

use crate::arm::{Arm, Connection, contradictions};
use crate::board_profile::BoardProfile;

/// Outputs of a 74HC595 in the order of their lines: name, and number of the pin. Nexperia, 74HC595 data sheet, pinning.
const CHIP_PINS: [(&str, u8); LINES_PER_CHIP as usize] =
    [("QA", 15), ("QB", 1), ("QC", 2), ("QD", 3), ("QE", 4), ("QF", 5), ("QG", 6), ("QH", 7)];

/// First line of the [table in CSV](WiringList::csv).
pub const CSV_HEADER: &str =
    "output,line,chip,chip_pin,chip_pin_number,coil,actuator,actuator_name,on_in,input,input_pin,closed_in";

/// The wires of an arm on its board.
#[derive(Clone, Debug, PartialEq)]
pub struct WiringList {
    /// A wire from the register chain to each coil, in the order of the actuators.
    pub coils: Vec<CoilWire>,
    /// The servos on their bus, in the order of the arm.
    pub servos: Vec<ServoWire>,
    /// Input of the emergency stop.
    pub emergency_stop: Option<InputWire>,
    /// Where arm file and profile contradict each other.
    pub contradictions: Vec<String>,
    /// What is no contradiction and may be a mistake.
    pub remarks: Vec<String>,
}

/// A line of the register chain to a coil, and the limit switch of the actuator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CoilWire {
    /// Number of the output.
    pub output: u8,
    /// Line of the chain.
    pub line: u8,
    /// What the line feeds.
    pub coil: Coil,
    /// The actuator that it moves.
    pub actuator: usize,
    /// Its name.
    pub actuator_name: String,
    /// States of the actuator in which the output is on.
    pub on_in: Vec<u8>,
    /// Its limit switch.
    pub switch: Option<SwitchWire>,
}

/// What a line feeds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coil {
    /// The coil of a valve or magnet, as long as the output is on.
    Valve,
    /// The full current of a coil, when the output switches on.
    PullIn,
    /// The holding current of a coil.
    Holding,
    /// The coil that sets a latch, when the output switches on.
    Set,
    /// The coil that resets a latch, when the output switches off.
    Reset,
}

/// An input of the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InputWire {
    /// Its number.
    pub input: u8,
    /// Its pin, where the profile names the board.
    pub pin: Option<&'static str>,
}

/// A limit switch at an input.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SwitchWire {
    /// The input.
    pub input: InputWire,
    /// States of the actuator in which it is closed.
    pub closed_in: Vec<u8>,
}

/// A servo on the bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServoWire {
    /// Number of the servo joint.
    pub servo: usize,
    /// Its address.
    pub id: u8,
    /// Its name.
    pub name: String,
    /// Pin of the bus, where the profile names the board.
    pub pin: Option<&'static str>,
}

impl CoilWire {
    /// Number of the 74HC595; that next to the board is chip 0.
    pub fn chip(&self) -> u8 {
        self.line / LINES_PER_CHIP
    }

    /// Name and number of the pin of the chip.
    pub fn chip_pin(&self) -> (&'static str, u8) {
        CHIP_PINS[usize::from(self.line % LINES_PER_CHIP)]
    }
}

impl Coil {
    /// Its name in a list.
    pub fn name(self) -> &'static str {
        match self {
            Self::Valve => "valve",
            Self::PullIn => "pull-in",
            Self::Holding => "holding",
            Self::Set => "set",
            Self::Reset => "reset",
        }
    }
}

impl WiringList {
    /// The wires of `arm` on a board with this profile.
    pub fn new(arm: &Arm, profile: &BoardProfile) -> Self {
        let profile = &profile.profile;
        let pins = profile.board.layout.and_then(PinTable::of_layout);
        let coils = (arm.connections.iter().enumerate())
            .flat_map(|(actuator, connection)| coils(arm, actuator, connection, profile, pins));
        let servo = |(servo, joint): (usize, &crate::arm::Servo)| ServoWire {
            servo,
            id: joint.id,
            name: arm.servo_name(servo),
            pin: pins.map(|pins| pins.servo_bus),
        };
        Self {
            coils: coils.collect(),
            servos: arm.servos.iter().enumerate().map(servo).collect(),
            emergency_stop: profile.emergency_stop.map(|stop| InputWire::new(stop.input, pins)),
            contradictions: contradictions(arm, profile).iter().map(ToString::to_string).collect(),
            remarks: remarks(arm, profile),
        }
    }

    /// The wires of the coils as a table in CSV; states are separated by spaces.
    pub fn csv(&self) -> String {
        let mut text = format!("{CSV_HEADER}\n");
        for wire in &self.coils {
            let CoilWire { output, line, coil, actuator, .. } = wire;
            let (pin, number) = wire.chip_pin();
            let (chip, coil, name) = (wire.chip(), coil.name(), quoted(&wire.actuator_name));
            let switch = wire.switch.as_ref();
            let input = switch.map_or(String::new(), |switch| switch.input.input.to_string());
            let input_pin = switch.and_then(|switch| switch.input.pin).unwrap_or_default();
            let (on_in, closed_in) = (spaced(&wire.on_in), spaced(switch.map_or(&[], |switch| &switch.closed_in)));
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "{output},{line},{chip},{pin},{number},{coil},{actuator},{name},{on_in},{input},{input_pin},{closed_in}"
            );
        }
        text
    }
}

impl InputWire {
    fn new(input: u8, pins: Option<&'static PinTable>) -> Self {
        let pin = pins.and_then(|pins| pins.inputs.get(usize::from(input)).copied());
        Self { input, pin }
    }
}

/// The wires of an actuator: those of its outputs that the profile has.
fn coils(
    arm: &Arm,
    actuator: usize,
    connection: &Connection,
    profile: &Profile,
    pins: Option<&'static PinTable>,
) -> Vec<CoilWire> {
    let n_states = arm.model.chain.n_states(actuator) as u8;
    let states = |is_in: &dyn Fn(u8) -> bool| (0..n_states).filter(|state| is_in(*state)).collect::<Vec<_>>();
    let first = connection.outputs.first().and_then(|&first| profile.output(first));
    let switch = connection.closed_in.zip(first.and_then(|first| first.input)).map(|(closed_in, input)| SwitchWire {
        input: InputWire::new(input, pins),
        closed_in: states(&|state| closed_in >> state & 1 == 1),
    });
    let mut wires = Vec::new();
    for (bit, &output) in connection.outputs.iter().enumerate() {
        let lines = profile.output(output).map(|wired| lines(&wired.drive)).unwrap_or_default();
        wires.extend(lines.into_iter().map(|(line, coil)| CoilWire {
            output,
            line,
            coil,
            actuator,
            actuator_name: arm.actuator_name(actuator),
            on_in: states(&|state| state >> bit & 1 == 1),
            switch: switch.clone().filter(|_| bit == 0),
        }));
    }
    wires
}

/// The lines of an output, and what each feeds.
fn lines(drive: &Drive) -> Vec<(u8, Coil)> {
    match *drive {
        Drive::Hold { line } => vec![(line, Coil::Valve)],
        Drive::PeakHold { pull, hold, .. } => vec![(pull, Coil::PullIn), (hold, Coil::Holding)],
        Drive::Latch { set, reset, .. } => vec![(set, Coil::Set), (reset, Coil::Reset)],
    }
}

fn remarks(arm: &Arm, profile: &Profile) -> Vec<String> {
    let named = |output: u8| arm.connections.iter().position(|connection| connection.outputs.contains(&output));
    let outputs = (0u8..).zip(&profile.outputs).filter_map(|(number, output)| Some((number, output.as_ref()?)));
    let remark = |(number, output): (u8, &darm_core::profile::Output)| match (named(number), output.input) {
        (None, _) => Some(format!("output {number} of the profile moves nothing of this arm; leave its lines open")),
        (Some(actuator), Some(input)) if arm.connections[actuator].closed_in.is_none() => Some(format!(
            "input {input} belongs to output {number} in the profile, but {} has no `switch` in the arm file: it is not \
             checked",
            arm.actuator_name(actuator)
        )),
        _ => None,
    };
    outputs.filter_map(remark).collect()
}

/// States as they are listed, with spaces between them.
pub fn spaced(states: &[u8]) -> String {
    states.iter().map(u8::to_string).collect::<Vec<_>>().join(" ")
}

/// A text as a cell of CSV.
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\""))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    const ARM: &str = "format = 2
name = \"three\"
[[stage]]
kind = \"discrete-joint\"
name = \"base\"
value_deg = [0.0, 10.0, 20.0]
outputs = [5, 3]
switch = { closed_in = [0, 2] }
[[stage]]
kind = \"discrete-joint\"
name = \"wrist, \\\"new\\\"\"
value_deg = [0.0, 10.0]
output = 4
[[stage]]
kind = \"servo\"
name = \"elbow\"
servo = { id = 2, min_deg = -30.0, max_deg = 40.0 }
";

    const PROFILE: &str = "format = 1
name = \"board\"
board = \"Pico\"
supply = { new_outputs = 2, window_ms = 20 }
emergency_stop = { input = 12, opens = true }
[[output]]
number = 3
drive = \"latch\"
set = 8
reset = 9
pulse_ms = 20
max_on_ms = 100
duty_percent = 20
window_ms = 5000
[[output]]
number = 4
drive = \"peak-hold\"
pull = 15
hold = 16
peak_ms = 20
max_on_ms = 100
duty_percent = 20
window_ms = 5000
[[output]]
number = 5
drive = \"hold\"
line = 1
max_on_ms = 4000
duty_percent = 35
window_ms = 9000
input = 7
[[servo]]
id = 2
min_deg = -90.0
max_deg = 90.0
max_speed_deg_s = 30.0
max_torque = 0.4
timeout_ms = 80
fallback = \"hold\"
";

    fn list(arm: &str, profile: &str) -> WiringList {
        let arm = Arm::parse(Path::new("arm.toml"), arm).unwrap();
        WiringList::new(&arm, &BoardProfile::parse(Path::new("board.toml"), profile).unwrap())
    }

    #[test]
    fn every_wire_is_listed_with_the_pins_of_chip_and_board() {
        let list = list(ARM, PROFILE);
        assert_eq!(
            list.csv(),
            format!(
                "{CSV_HEADER}\n\
                 5,1,0,QB,1,valve,0,\"base\",1,7,GP13,0 2\n\
                 3,8,1,QA,15,set,0,\"base\",2,,,\n\
                 3,9,1,QB,1,reset,0,\"base\",2,,,\n\
                 4,15,1,QH,7,pull-in,1,\"wrist, \"\"new\"\"\",1,,,\n\
                 4,16,2,QA,15,holding,1,\"wrist, \"\"new\"\"\",1,,,\n"
            )
        );
        assert_eq!(list.servos[0], ServoWire { servo: 0, id: 2, name: "elbow".into(), pin: Some("GP0") });
        assert_eq!(list.emergency_stop, Some(InputWire { input: 12, pin: Some("GP18") }));
        assert_eq!((list.contradictions, list.remarks), (vec![], vec![]));
    }

    #[test]
    fn all_contradictions_are_named_and_what_may_be_a_mistake() {
        let arm = ARM.replace("[5, 3]", "[3, 6]").replace("id = 2", "id = 9");
        let list = list(&arm, PROFILE);
        let cure = "or name the right profile, by `profile` in the arm file or by --profile";
        assert_eq!(
            list.contradictions,
            [
                format!(
                    "base: output 3 has no limit switch in the board's profile; add its `input` to the profile, {cure}"
                ),
                format!("elbow: the board's profile has no servo with the id 9; add it to the profile, {cure}"),
            ]
        );
        assert_eq!(list.remarks, ["output 5 of the profile moves nothing of this arm; leave its lines open"]);
        let without_switch = ARM.replace("switch = { closed_in = [0, 2] }\n", "");
        assert_eq!(
            self::list(&without_switch, PROFILE).remarks,
            ["input 7 belongs to output 5 in the profile, but base has no `switch` in the arm file: it is not checked"]
        );
    }
}
