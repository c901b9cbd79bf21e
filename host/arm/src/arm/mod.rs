//! An arm as a file: its geometry, masses, known effects, and the outputs of the board that feed it, in one `arm.toml`.
//!
//! What an output is, its drive, lines and limits, belongs to the board and is in its [profile](crate::board_profile);
//! [`wiring`] joins the two. An arm of which only the kinematics matter names no profile and no outputs.
//!
//! # Format
//!
//! Lengths in m, angles in degrees; the unit is the end of the key. Keys marked `?` are optional. Actuators and
//! modules (stages) count from 0 at the base; a leg's digit 0 is its shortest state.
//!
//! | key | meaning |
//! | --- | --- |
//! | `format` | version of this format: 2 |
//! | `name` | name of the arm |
//! | `profile` ? | profile of the board that drives it; the path is relative to this file |
//! | `model` ? | number of the model, 0: counts up with every change |
//! | `length_scale_m` ? | ℓ, 0.5: one radian weighs as much as this length |
//! | `conditions.gravity_m_s2` ? | gravity in the base frame, \[0, −9.81, 0\]: y points up |
//! | `conditions.supply_bar`, `.temperature_c` ? | supply and temperature that the geometry was measured at, 6 and 20 |
//! | `conditions.working_supply_bar`, `.working_temperature_c` ? | those that the arm works at; the same where left out |
//! | `mount` ? | pose of the first stage in the base |
//! | `tool.pose`, `.mass_kg`, `.center_m` ? | pose of the tool in the last stage; what it carries, expressed in its frame |
//! | `[[stage]]` | one stage, from the base on |
//! | `kind` | `planar-platform`, `spatial-platform`, `discrete-joint`, `servo` or `link` |
//! | `name`, `mass_kg`, `center_m` ? | its name; what moves with its top, expressed in the top's frame |
//! | `home` | of a platform: a pose of the top near those that are meant; it names the assembly mode |
//! | `[[stage.leg]]` | three (left, diagonal, right) or six, in the order of their digits |
//! | `name` ?, `base_m`, `top_m` | anchors on the base and the top plate, two or three coordinates |
//! | `length_m` | distance of the anchors in each state, two to four |
//! | `motion`, `axis` ? | of a joint: `revolute` or `prismatic`; direction, \[0, 0, 1\] |
//! | `value_deg`, `value_m` | of a discrete joint: its value in each state |
//! | `output` ?, `outputs` ? | of a leg or discrete joint: number of the board's output that feeds it; of three or four states two, for bits 0 and 1 of the digit |
//! | `switch.closed_in` ? | the states in which its limit switch is closed; the profile has the input, at its first output |
//! | `travel_ms` ? | longest time to the stop, 100 |
//! | `cylinder`, `force`, `torque_nm` ? | one of them: what the actuator gives, as bore and rod, as push and pull, or as a torque |
//! | `offset_deg` ?, `servo` | of a servo: its angle at 0; its address on the bus `id`, and the range of the joint `min_deg`, `max_deg` |
//! | `pose` | of a link: pose of its top |
//! | `[[effect]]` | `law`, `actuator`, `module` or `servo` (all of the arm without any), `state`, `plate`, `since_s` of a step, `until_s` of a drift, `until_switches` of wear, `along`, `square` and `frame` of a fitted term, and `values` with their units |
//!
//! The digit of an actuator is the number of its state. With two outputs it says which are on: digit 0 neither, 1 the
//! first, 2 the second, 3 both. States are given in growing order: `length_m`, `value_m` or `value_deg` of a digit is not
//! below that of the digit before. So a spring-centred actuator of two opposed coils, whose digit 1 moves to one side of
//! digit 0 and whose digit 2 to the other, is not supported yet.
//!
//! A pose is `{ position_m = [x, y], angle_deg = a }` in the plane, in space `{ position_m = [x, y, z], rotation_deg = [..] }`
//! with a rotation vector.
//!
//! [`Arm::write`] writes every key in one order, lengths to the last bit and angles to 10⁻¹² degrees, so that what is
//! written reads as it was, and [`Arm::hash`] names it.

mod build;
mod constant;
mod effects;
mod fault;
pub mod frames;
mod quantities;
pub(crate) mod raw;
pub mod rounding;
mod strength;
mod travel;
mod wiring;
mod write;

use std::ops::Range;
use std::path::{Path, PathBuf};

use darm_core::actuator::{JointKind, Stage};
use darm_core::chain::Scratch;
use darm_core::model::{Condition, Model};
use darm_core::output::Wiring;
use darm_core::profile::Profile;
use darm_core::units::{ModelHash, Word};
use sha2::{Digest, Sha256};

use darm_robot::files::FileRef;
use darm_robot::source::{Fault, FileError, Source, path_between};
pub(crate) use fault::reason_of;

pub use fault::{ArmFault, FrameFault};
pub use strength::Strength;
pub use travel::with_travel_ms;
pub use wiring::{Part, WiringFault, WiringReason, contradictions, wiring};

/// The version of the file format.
pub const FORMAT: u32 = 2;

/// 0 °C, K: files give °C, models hold K.
pub const ZERO_CELSIUS: f64 = 273.15;

/// Stages that one arm can have.
pub const MAX_STAGES: usize = 24;

/// The model of an arm on the host.
pub type ArmModel = Model<f64, MAX_STAGES>;

/// A posture of an arm on the host, and the room to compute it in.
pub type ArmScratch = Scratch<f64, MAX_STAGES>;

/// Why a file gives no arm.
pub type ArmError = FileError<ArmFault>;

/// An arm: what is known of it, and which outputs of a board feed it.
#[derive(Clone, Debug, PartialEq)]
pub struct Arm {
    /// Its name.
    pub name: String,
    /// What decides the pose of its tool: geometry, masses, effects, and the model's number.
    pub model: ArmModel,
    /// File of the profile of the board that drives it.
    pub profile: Option<PathBuf>,
    /// How each discrete actuator is connected to the board.
    pub connections: Vec<Connection>,
    /// What each discrete actuator gives; `None` where the file does not say it.
    pub strengths: Vec<Option<Strength>>,
    /// Each servo joint on the bus.
    pub servos: Vec<Servo>,
    /// One radian weighs as much as this length when poses are compared.
    pub length_scale_m: f64,
    /// What its parts are called.
    pub labels: Labels,
}

/// How a discrete actuator is connected to the board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Connection {
    /// Numbers of the outputs that feed it, one for each bit of its digit, bit 0 first; empty where none is named.
    pub outputs: Vec<u8>,
    /// Digits in which its limit switch is closed, bit `d` for digit `d`; `None` without a switch.
    pub closed_in: Option<u8>,
    /// Longest time from the output's change to the stop, ms.
    pub travel_ms: u16,
}

/// A servo joint on the bus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Servo {
    /// Address of the servo.
    pub id: u8,
    /// Smallest angle of the joint, rad.
    pub min_rad: f32,
    /// Largest angle of the joint, rad.
    pub max_rad: f32,
}

/// What the parts of an arm are called.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Labels {
    /// Each stage.
    pub stages: Vec<String>,
    /// Each discrete actuator: the leg within its platform, `left` say; the stage's own name for a joint.
    pub actuators: Vec<String>,
}

impl Arm {
    /// Reads an arm file.
    ///
    /// # Errors
    ///
    /// The file cannot be read; or as [`parse`](Self::parse).
    pub fn read<'a>(file: impl Into<FileRef<'a>>) -> Result<Self, ArmError> {
        Ok(ArmFile::read(file)?.arm)
    }

    /// The arm that `text` describes; `path` only serves messages.
    ///
    /// # Errors
    ///
    /// The text is not TOML of this format, a key is missing or unknown, or a value describes no arm. The error names
    /// line and column.
    pub fn parse(path: &Path, text: &str) -> Result<Self, ArmError> {
        Self::of_source(&Source::of_text(path, text))
    }

    /// The arm of what was read already.
    ///
    /// # Errors
    ///
    /// As [`parse`](Self::parse).
    pub fn of_source(source: &Source) -> Result<Self, ArmError> {
        Ok(build::arm(source)?.0)
    }

    /// Writes an arm file. It names the same profile, by the path from its own folder. An arm that could not be read again
    /// is not written.
    ///
    /// # Errors
    ///
    /// The arm could not be read again, or the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), ArmError> {
        let profile = self.profile.as_ref().map(|profile| path_between(path, profile));
        let text = write::toml(self, profile.as_deref());
        let text = format!("# Arm of `darm`: lengths in m, angles in degrees.\n\n{text}");
        Self::parse(path, &text)?;
        std::fs::write(path, text).map_err(|error| FileError::unwritable(path, error))
    }

    /// The arm file's text: every key, in one order, without comments.
    pub fn to_toml(&self) -> String {
        write::toml(self, self.profile.as_deref())
    }

    /// Fingerprint of the arm file's text without the path of the profile and what the actuators give, neither of which
    /// moves the tool: the first eight bytes of its SHA-256.
    pub fn hash(&self) -> ModelHash {
        let plain = Self { strengths: Vec::new(), ..self.clone() };
        let digest = Sha256::digest(write::toml(&plain, None).as_bytes());
        ModelHash(digest.iter().take(8).fold(0, |hash, &byte| hash << 8 | u64::from(byte)))
    }

    /// The same of the arm without what a diagnosis changes: effects, working conditions and the model's number. Two
    /// models of one arm with the same stops and outputs have the same.
    pub fn geometry_hash(&self) -> ModelHash {
        let mut plain = self.clone();
        plain.model.effects.clear();
        plain.model.number = 0;
        plain.model.working_supply = plain.model.nominal_supply;
        plain.model.working_temperature_k = plain.model.reference_temperature_k;
        plain.hash()
    }

    /// How many discrete actuators it has, and so digits of a word.
    pub fn n_actuators(&self) -> usize {
        self.model.chain.n_actuators()
    }

    /// How many servo joints it has.
    pub fn n_servos(&self) -> usize {
        self.model.chain.n_servos()
    }

    /// Whether a discrete actuator turns: its states are angles, not lengths.
    pub fn turns(&self, actuator: usize) -> bool {
        let stage = self.model.chain.actuator(actuator).map(|(stage, _)| &self.model.chain.stages[stage]);
        matches!(stage, Some(Stage::Discrete(joint)) if joint.axis.kind == JointKind::Revolute)
    }

    /// The word at rest: every actuator contracted, no coil fed.
    #[expect(clippy::missing_panics_doc, reason = "an arm has at most as many actuators as a word has digits")]
    pub fn rest(&self) -> Word {
        Word::zeros(self.n_actuators() as u8).expect("an arm has at most as many actuators as a word has digits")
    }

    /// A word under the supply and temperature that the arm works at, with no word before. Commands that take single
    /// postures predict under it, so that they agree with what a diagnosis has fitted.
    pub fn working_condition<'a>(&self, word: Word, servos_rad: &'a [f64]) -> Condition<'a, f64> {
        Condition { previous: None, ..self.model.working(word, word, servos_rad) }
    }

    /// An actuator as a person would call it: `module 2, left leg`.
    pub fn actuator_name(&self, actuator: usize) -> String {
        let Some((stage, _)) = self.model.chain.actuator(actuator) else {
            return format!("actuator {actuator}");
        };
        let (stage_name, own) = (self.stage_name(stage), &self.labels.actuators[actuator]);
        match self.model.chain.stages[stage].n_actuators() {
            1 => stage_name,
            _ => format!("{stage_name}, {own} leg"),
        }
    }

    /// An actuator in a drawing: number, name and outputs.
    pub fn actuator_label(&self, actuator: usize) -> String {
        let outputs = match self.connections.get(actuator).map_or(&[][..], |connection| &connection.outputs) {
            [] => String::new(),
            [one] => format!(", output {one}"),
            more => format!(", outputs {}", more.iter().map(u8::to_string).collect::<Vec<_>>().join(" and ")),
        };
        format!("actuator {actuator}: {}{outputs}", self.actuator_name(actuator))
    }

    /// A servo joint as a person would call it: by its stage.
    pub fn servo_name(&self, servo: usize) -> String {
        let stages = self.model.chain.stages.iter().enumerate();
        let stage = stages.filter(|(_, stage)| matches!(stage, Stage::Servo(_))).nth(servo);
        stage.map_or_else(|| format!("servo {servo}"), |(stage, _)| self.stage_name(stage))
    }

    /// A stage as a person would call it.
    pub fn stage_name(&self, stage: usize) -> String {
        self.labels.stages.get(stage).cloned().unwrap_or_else(|| format!("module {stage}"))
    }
}

/// An arm with its file, for errors that are found where another file meets it.
pub(crate) struct ArmFile {
    pub(crate) arm: Arm,
    source: Source,
    places: Places,
}

/// Where in the file each actuator and servo is connected.
#[derive(Default)]
struct Places {
    outputs: Vec<Range<usize>>,
    switches: Vec<Range<usize>>,
    servos: Vec<Range<usize>>,
}

impl ArmFile {
    pub(crate) fn read<'a>(file: impl Into<FileRef<'a>>) -> Result<Self, ArmError> {
        let source = Source::read(file)?;
        let (arm, places) = build::arm(&source)?;
        Ok(Self { arm, source, places })
    }

    /// The [wiring](wiring()) under a profile; its errors name line and column of the arm file.
    pub(crate) fn wiring(&self, profile: &Profile) -> Result<Wiring, ArmError> {
        wiring(&self.arm, profile).map_err(|fault| {
            let span = self.place_of(&fault);
            self.source.error(span, Fault::Content(Box::new(ArmFault::Profile(fault))))
        })
    }

    fn place_of(&self, fault: &WiringFault) -> Option<Range<usize>> {
        let Places { outputs, switches, servos } = &self.places;
        let span = match (fault.part, &fault.reason) {
            (Part::Actuator(actuator), WiringReason::NoInput { .. }) => switches.get(actuator),
            (Part::Actuator(actuator), _) => outputs.get(actuator),
            (Part::Servo(servo), _) => servos.get(servo),
            (Part::Arm, _) => None,
        };
        span.cloned()
    }
}

#[cfg(test)]
mod tests;
