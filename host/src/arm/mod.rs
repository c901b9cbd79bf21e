//! An arm as a file: its geometry, masses, known effects and wiring in one `arm.toml`.
//!
//! # Format
//!
//! Lengths in m, angles in degrees; the unit is the end of the key. Keys marked `?` may be left out. Actuators and
//! modules (stages) count from 0 at the base; a leg's digit 0 is its shortest state.
//!
//! | key | meaning |
//! | --- | --- |
//! | `format` | version of this format: 1 |
//! | `name` | name of the arm |
//! | `model` ? | number of the model, 0: counts up with every change |
//! | `length_scale_m` ? | ℓ, 0.5: one radian weighs as much as this length |
//! | `conditions.gravity_m_s2` ? | gravity in the base frame, \[0, −9.81, 0\]: y points up |
//! | `conditions.supply_bar`, `.temperature_c` ? | supply and temperature that the geometry was measured at, 6 and 20 |
//! | `conditions.working_supply_bar`, `.working_temperature_c` ? | those that the arm works at; the same where left out |
//! | `mount` ? | pose of the first stage in the base |
//! | `tool.pose`, `.mass_kg`, `.center_m` ? | pose of the tool in the last stage; what it carries, told in its frame |
//! | `switch_limit.new_coils`, `.window_ms` ? | so many coils may go on within so long, 6 in 10 ms |
//! | `[[stage]]` | one stage, from the base on |
//! | `kind` | `planar-platform`, `spatial-platform`, `discrete-joint`, `servo` or `link` |
//! | `name`, `mass_kg`, `center_m` ? | its name; what moves with its top, told in the top's frame |
//! | `home` | of a platform: a pose of the top near those that are meant; it names the assembly mode |
//! | `[[stage.leg]]` | three (left, diagonal, right) or six, in the order of their digits |
//! | `name` ?, `base_m`, `top_m` | anchors on the base and the top plate, two or three coordinates |
//! | `length_m` | distance of the anchors in each state, two to four |
//! | `motion`, `axis` ? | of a joint: `revolute` or `prismatic`; direction, \[0, 0, 1\] |
//! | `value_deg`, `value_m` | of a discrete joint: its value in each state |
//! | `coil`, `coils` | of a leg or discrete joint: one coil for two states, two for more |
//! | `coil.drive` | `hold` (`line`), `peak-hold` (`pull`, `hold`, `peak_ms`) or `latch` (`set`, `reset`, `pulse_ms`) |
//! | `coil.max_on_ms`, `.duty_percent`, `.window_ms` ? | limits of the current, see [`Drive::default_limit`] |
//! | `switch.input`, `.closed_in` ? | limit switch, and the states in which it is closed |
//! | `travel_ms` ? | longest time to the stop, 100 |
//! | `offset_deg` ?, `bus` | of a servo: its angle at 0; `id`, `min_deg`, `max_deg`, `max_speed_deg_s`, `max_torque` (0 to 1), `timeout_ms` |
//! | `pose` | of a link: pose of its top |
//! | `[[effect]]` | `law`, `actuator`, `module` or `servo` (all of the arm without any), `state`, `plate`, `since_s` of a step, `until_s` of a drift, `until_switches` of wear, `along`, `square` and `frame` of a fitted term, and `values` with their units |
//!
//! A pose is `{ position_m = [x, y], angle_deg = a }` in the plane, in space `{ position_m = [x, y, z], rotation_deg = [..] }`
//! with a rotation vector.
//!
//! [`Arm::write`] writes every key in one order, lengths to the last bit and angles to 10⁻¹² degrees, so that what is
//! written reads as it was, and [`Arm::hash`] names it.
//!
//! [`Drive::default_limit`]: darm_core::output::Drive::default_limit

mod build;
mod constant;
mod effects;
mod fault;
pub mod frames;
pub(crate) mod raw;
pub mod rounding;
pub(crate) mod source;
mod write;

use std::path::Path;

use darm_core::actuator::{JointKind, Stage};
use darm_core::chain::Scratch;
use darm_core::model::Model;
use darm_core::output::Wiring;
use darm_core::units::{ModelHash, Word};
use sha2::{Digest, Sha256};

pub(crate) use fault::reason_of;
pub use fault::{ArmFault, FrameFault};
pub use source::{Fault, FileError, Place};

/// The version of the file format.
pub const FORMAT: u32 = 1;

/// 0 °C, K: files tell °C, models hold K.
pub const ZERO_CELSIUS: f64 = 273.15;

/// Stages that one arm can have.
pub const MAX_STAGES: usize = 24;

/// The model of an arm on the host.
pub type ArmModel = Model<f64, MAX_STAGES>;

/// A posture of an arm on the host, and the room to compute it in.
pub type ArmScratch = Scratch<f64, MAX_STAGES>;

/// Why a file gives no arm.
pub type ArmError = FileError<ArmFault>;

/// An arm: what is known of it, and how it is wired.
#[derive(Clone, Debug, PartialEq)]
pub struct Arm {
    /// Its name.
    pub name: String,
    /// Where its tool stands: geometry, masses, effects, and the model's number.
    pub model: ArmModel,
    /// How it is wired, and the limits that hold.
    pub wiring: Wiring,
    /// One radian weighs as much as this length when poses are compared.
    pub length_scale_m: f64,
    /// What its parts are called.
    pub labels: Labels,
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
    pub fn read(path: &Path) -> Result<Self, ArmError> {
        build::arm(&source::Source::read(path)?)
    }

    /// The arm that `text` describes; `path` only serves messages.
    pub fn parse(path: &Path, text: &str) -> Result<Self, ArmError> {
        build::arm(&source::Source::of_text(path, text))
    }

    /// Writes an arm file.
    pub fn write(&self, path: &Path) -> Result<(), ArmError> {
        let text = format!("# Arm of `darm`: lengths in m, angles in degrees.\n\n{}", self.to_toml());
        std::fs::write(path, text).map_err(|error| FileError {
            path: path.into(),
            place: None,
            fault: Fault::Io(error),
        })
    }

    /// The arm file's text: every key, in one order, without comments.
    pub fn to_toml(&self) -> String {
        write::toml(self)
    }

    /// Fingerprint of the arm file's text: the first eight bytes of its SHA-256.
    pub fn hash(&self) -> ModelHash {
        let digest = Sha256::digest(self.to_toml().as_bytes());
        ModelHash(digest.iter().take(8).fold(0, |hash, &byte| hash << 8 | u64::from(byte)))
    }

    /// The same of the arm without what a diagnosis changes: effects, working conditions and the model's number. Two
    /// models of one arm with the same stops and wiring have the same.
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
    pub fn rest(&self) -> Word {
        Word::zeros(self.n_actuators() as u8).unwrap_or_default()
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

    /// A stage as a person would call it.
    pub fn stage_name(&self, stage: usize) -> String {
        self.labels.stages.get(stage).cloned().unwrap_or_else(|| format!("module {stage}"))
    }
}

#[cfg(test)]
mod tests;
