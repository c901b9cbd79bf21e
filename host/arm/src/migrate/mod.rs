//! From arm files of format 1, which carried the drives and limits of their board, to an arm file of format 2 and a profile.
//!
//! Nothing else reads format 1: once no such file is left, this module, its test and `darm profile migrate` can go.
//!
//! | key of format 1 | becomes |
//! | --- | --- |
//! | `coil`, `coils` of a leg or joint | `output`, `outputs`; drive, lines and limits an `[[output]]` of the profile |
//! | `switch.input` | `input` of the actuator's first output in the profile; `switch.closed_in` stays |
//! | `bus` of a servo | `servo` with address and range of the joint; all of it a `[[servo]]` of the profile |
//! | `[switch_limit]` | `[supply]` of the profile |

mod edit;
mod limit;

use std::path::Path;

use darm_core::output::SwitchLimit;
use serde::Deserialize;
use toml::{Table, Value};

use self::edit::{edited, marked};
use self::limit::{default_limit, pair};
use crate::arm::raw::RawHead;
use crate::arm::{Arm, ArmError};
use crate::board_profile::{self, BoardProfile, ProfileFault};
use darm_robot::source::{Fault, FileError};
use darm_robot::source::{Source, path_between};

/// The format that is read here.
const FORMAT: u32 = 1;

/// An arm file of format 1, in two.
#[derive(Clone, Debug, PartialEq)]
pub struct Migrated {
    /// Text of the arm file, with the comments and the layout of the old one.
    pub arm: String,
    /// What the board's profile has to have for this arm.
    pub profile: BoardProfile,
    /// Text of the profile's file. A comment marks each value that is a default because the old file had none.
    pub profile_text: String,
}

/// Why an arm file is not brought over.
#[derive(Debug, thiserror::Error)]
pub enum MigrateFault {
    /// It has another format.
    #[error("the file has format {found}; only files of format {FORMAT} are brought over")]
    Format {
        /// The number in the file.
        found: u32,
    },
    /// Its limits make no profile.
    #[error("the drives and limits of this arm make no profile: {0}")]
    Profile(Fault<ProfileFault>),
    /// What it becomes is no arm.
    #[error("brought over, the file is refused: {0}")]
    Arm(ArmError),
}

/// Why an arm file of format 1 gives no arm and profile.
pub type MigrateError = FileError<MigrateFault>;

/// Reads the arm file of format 1 at `old`. The new arm file at `new` will name the profile at `profile`.
///
/// # Errors
///
/// The file cannot be read, has another format than 1, or does not describe an arm; its limits make no profile that the
/// board could run safely; or what it becomes is not an arm.
pub fn read(old: &Path, new: &Path, profile: &Path) -> Result<Migrated, MigrateError> {
    let source = Source::read(old)?;
    let head: RawHead = source.parse()?;
    let found = *head.format.get_ref();
    if found != FORMAT {
        return Err(source.wrong(head.format.span(), MigrateFault::Format { found }));
    }
    let arm: OldArm = source.parse()?;
    let wrong = |fault| source.error(None, Fault::Content(Box::new(fault)));
    let actuators = arm.numbered();
    let text = arm.profile(&actuators).to_string();
    // Written angles are rounded: the digest is that of the file.
    let made = BoardProfile::parse(profile, &text).and_then(|made| BoardProfile::parse(profile, &made.to_toml()));
    let made = made.map_err(|error| wrong(MigrateFault::Profile(error.fault)))?;
    let profile_text = marked(&made.to_toml(), &arm, &actuators);
    let named = path_between(new, profile).to_string_lossy().into_owned();
    let text = edited(source.text(), &actuators, &named);
    Arm::parse(new, &text).map_err(|error| wrong(MigrateFault::Arm(error)))?;
    Ok(Migrated { arm: text, profile: made, profile_text })
}

/// What format 1 knows of the board; every other key stays as it is.
#[derive(Deserialize)]
struct OldArm {
    name: String,
    switch_limit: Option<OldSwitchLimit>,
    #[serde(default)]
    stage: Vec<OldStage>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OldSwitchLimit {
    new_coils: u8,
    window_ms: u16,
}

#[derive(Deserialize)]
struct OldStage {
    #[serde(default)]
    leg: Vec<OldActuator>,
    bus: Option<Table>,
    coil: Option<Table>,
    coils: Option<Vec<Table>>,
    switch: Option<OldSwitch>,
}

#[derive(Deserialize)]
struct OldActuator {
    coil: Option<Table>,
    coils: Option<Vec<Table>>,
    switch: Option<OldSwitch>,
}

#[derive(Clone, Copy, Deserialize)]
struct OldSwitch {
    input: u8,
}

/// The coils of one leg or joint with the numbers of their outputs, and the input of its limit switch.
struct Actuator {
    coils: Vec<(Value, Table)>,
    input: Option<u8>,
}

impl OldArm {
    /// Every leg and joint in the order of the file. A coil that names no output has the number of its place.
    fn numbered(&self) -> Vec<Actuator> {
        let mut next = 0i64;
        let mut actuators = Vec::new();
        for stage in &self.stage {
            for leg in &stage.leg {
                actuators.push(Actuator::new(leg.coil.iter().chain(leg.coils.iter().flatten()), leg.switch, &mut next));
            }
            let coils = stage.coil.iter().chain(stage.coils.iter().flatten());
            actuators.push(Actuator::new(coils, stage.switch, &mut next));
        }
        actuators.retain(|actuator| !actuator.coils.is_empty());
        actuators
    }

    /// The keys of the profile file.
    fn profile(&self, actuators: &[Actuator]) -> Table {
        let default = SwitchLimit::default();
        let (new_outputs, window_ms) = self
            .switch_limit
            .as_ref()
            .map_or((default.new_coils, default.window_ms), |limit| (limit.new_coils, limit.window_ms));
        let supply = [("new_outputs", u32::from(new_outputs)), ("window_ms", window_ms.into())];
        let outputs = actuators.iter().flat_map(outputs).map(Value::Table).collect();
        let servos = self.stage.iter().filter_map(|stage| stage.bus.as_ref()).map(servo).map(Value::Table).collect();
        Table::from_iter([
            ("format".to_owned(), Value::from(i64::from(board_profile::FORMAT))),
            ("name".to_owned(), Value::from(self.name.clone())),
            ("supply".to_owned(), Value::Table(supply.into_iter().map(pair).collect())),
            ("output".to_owned(), Value::Array(outputs)),
            ("servo".to_owned(), Value::Array(servos)),
        ])
    }
}

impl Actuator {
    /// The actuator of these coils, the first of which has the place `next`; afterwards `next` is the place behind them.
    fn new<'a>(coils: impl Iterator<Item = &'a Table>, switch: Option<OldSwitch>, next: &mut i64) -> Self {
        let coils = coils.map(|coil| {
            let place = Value::from(*next);
            *next += 1;
            // A number that is none is refused where the profile is read.
            (coil.get("output").cloned().unwrap_or(place), coil.clone())
        });
        Self { coils: coils.collect(), input: switch.map(|switch| switch.input) }
    }
}

/// The outputs of an actuator as the profile has them: the keys of a coil, and the limits that format 1 gave by itself.
fn outputs(actuator: &Actuator) -> impl Iterator<Item = Table> {
    actuator.coils.iter().enumerate().map(|(index, (number, coil))| {
        let drive = coil.get("drive").and_then(Value::as_str).unwrap_or_default();
        let mut output = default_limit(drive);
        output.extend(coil.clone());
        output.remove("output");
        output.insert("number".to_owned(), number.clone());
        output.extend(actuator.input.filter(|_| index == 0).map(|input| pair(("input", input.into()))));
        output
    })
}

/// In format 1 every servo held its angle in the safe state.
fn servo(bus: &Table) -> Table {
    let mut servo = bus.clone();
    servo.insert("fallback".to_owned(), Value::from("hold"));
    servo
}

#[cfg(test)]
mod tests;
