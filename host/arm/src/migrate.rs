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

use std::path::Path;

use darm_core::output::{Drive, SwitchLimit};
use serde::Deserialize;
use toml::{Table, Value};
use toml_edit::{DocumentMut, Item, Key};

use crate::arm::raw::RawHead;
use crate::arm::{Arm, ArmError};
use crate::board_profile::{self, BoardProfile, ProfileFault};
use darm_robot::source::{Fault, FileError};
use darm_robot::source::{Source, path_between};

/// The format that is read here.
const FORMAT: u32 = 1;
/// Comment at a value that the old file did not have.
const DEFAULT: &str = "# default of this version: the old file had none";
/// Keys of a servo in format 1 that belong to the board.
const LIMITS_OF_SERVO: [&str; 3] = ["max_speed_deg_s", "max_torque", "timeout_ms"];

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
        let mut numbered = |coil: &Option<Table>, coils: &Option<Vec<Table>>, switch: Option<OldSwitch>| {
            let coils = coil.iter().chain(coils.iter().flatten()).map(|coil| {
                let place = Value::from(next);
                next += 1;
                // A number that is none is refused where the profile is read.
                (coil.get("output").cloned().unwrap_or(place), coil.clone())
            });
            Actuator { coils: coils.collect(), input: switch.map(|switch| switch.input) }
        };
        let mut actuators = Vec::new();
        for stage in &self.stage {
            actuators.extend(stage.leg.iter().map(|leg| numbered(&leg.coil, &leg.coils, leg.switch)));
            actuators.push(numbered(&stage.coil, &stage.coils, stage.switch));
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

fn pair((key, value): (&str, u32)) -> (String, Value) {
    (key.to_owned(), Value::from(i64::from(value)))
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

fn default_limit(drive: &str) -> Table {
    let limit = match drive {
        "latch" => Drive::Latch { set: 0, reset: 0, pulse_ms: 0 },
        "peak-hold" => Drive::PeakHold { pull: 0, hold: 0, peak_ms: 0 },
        _ => Drive::Hold { line: 0 },
    }
    .default_limit();
    let limits =
        [("max_on_ms", limit.max_on_ms), ("duty_percent", limit.duty_percent.into()), ("window_ms", limit.window_ms)];
    limits.into_iter().map(pair).collect()
}

/// The text of a profile with a comment at each value that the old file did not have.
fn marked(text: &str, arm: &OldArm, actuators: &[Actuator]) -> String {
    let Ok(mut document) = text.parse::<DocumentMut>() else { return text.to_owned() };
    let root = document.as_table_mut();
    if let (None, Some(supply)) = (&arm.switch_limit, root.get_mut("supply").and_then(Item::as_table_mut)) {
        ["new_outputs", "window_ms"].iter().for_each(|key| mark(supply, key));
    }
    let coils: Vec<_> = actuators.iter().flat_map(|actuator| &actuator.coils).collect();
    for output in
        root.get_mut("output").and_then(Item::as_array_of_tables_mut).into_iter().flat_map(|all| all.iter_mut())
    {
        let number = output.get("number").and_then(Item::as_integer);
        let coil = coils.iter().find(|(own, _)| own.as_integer() == number);
        for key in default_limit("").keys().filter(|key| coil.is_some_and(|(_, coil)| !coil.contains_key(*key))) {
            mark(output, key);
        }
    }
    document.to_string()
}

/// Marks the value of a key as a default.
fn mark(table: &mut toml_edit::Table, key: &str) {
    if let Some(value) = table.get_mut(key).and_then(Item::as_value_mut) {
        value.decor_mut().set_suffix(format!(" {DEFAULT}"));
    }
}

/// In format 1 every servo held its angle in the safe state.
fn servo(bus: &Table) -> Table {
    let mut servo = bus.clone();
    servo.insert("fallback".to_owned(), Value::from("hold"));
    servo
}

/// The text of the new arm file. What cannot be edited stays as it is, and is refused when the text is read.
fn edited(text: &str, actuators: &[Actuator], profile: &str) -> String {
    let Ok(mut document) = text.parse::<DocumentMut>() else { return text.to_owned() };
    let mut actuators = actuators.iter();
    let root = document.as_table_mut();
    replace(root, "format", "format", |_| toml_edit::value(i64::from(crate::arm::FORMAT)));
    let supply = root.remove("switch_limit");
    insert_after(root, "name", "profile", profile);
    let Some(stages) = root.get_mut("stage").and_then(Item::as_array_of_tables_mut) else {
        return document.to_string();
    };
    if let (Some(comment), Some(stage)) = (supply.as_ref().and_then(comment), stages.get_mut(0)) {
        let own = stage.decor().prefix().and_then(|prefix| prefix.as_str()).unwrap_or_default().to_owned();
        stage.decor_mut().set_prefix(format!("{comment}{own}"));
    }
    for stage in stages.iter_mut() {
        replace(stage, "bus", "servo", |mut bus| {
            LIMITS_OF_SERVO.iter().for_each(|key| remove(&mut bus, key));
            bus
        });
        if let Some(legs) = stage.get_mut("leg").and_then(Item::as_array_of_tables_mut) {
            legs.iter_mut().for_each(|leg| connect(leg, &mut actuators));
        }
        connect(stage, &mut actuators);
    }
    document.to_string()
}

/// The comment above a table.
fn comment(item: &Item) -> Option<String> {
    let prefix = item.as_table()?.decor().prefix()?.as_str()?;
    prefix.contains('#').then(|| prefix.to_owned())
}

/// Names the outputs of a leg or joint in place of its coils.
fn connect<'a>(table: &mut toml_edit::Table, actuators: &mut impl Iterator<Item = &'a Actuator>) {
    if !table.contains_key("coil") && !table.contains_key("coils") {
        return;
    }
    let Some(actuator) = actuators.next() else { return };
    let numbers: Vec<i64> = actuator.coils.iter().filter_map(|(number, _)| number.as_integer()).collect();
    let all: toml_edit::Array = numbers.iter().copied().collect();
    replace(table, "coil", "output", |_| toml_edit::value(numbers.first().copied().unwrap_or_default()));
    replace(table, "coils", "outputs", |_| toml_edit::value(all.clone()));
    if let Some(switch) = table.get_mut("switch") {
        remove(switch, "input");
    }
}

/// Puts another key and value in the place of a key, with the comments that the old ones had.
fn replace(table: &mut toml_edit::Table, old: &str, new: &str, value: impl Fn(Item) -> Item) {
    rebuild(table, |key, item| {
        if key.get() != old {
            return vec![(key, item)];
        }
        let decor = item.as_value().map(|value| value.decor().clone());
        let mut item = value(item);
        if let (Some(decor), Some(value)) = (decor, item.as_value_mut()) {
            *value.decor_mut() = decor;
        }
        vec![(Key::new(new).with_leaf_decor(key.leaf_decor().clone()), item)]
    });
}

/// Adds a key and its value behind another key.
fn insert_after(table: &mut toml_edit::Table, before: &str, new: &str, value: &str) {
    rebuild(table, |key, item| {
        let added = (key.get() == before).then(|| (Key::new(new), toml_edit::value(value)));
        [(key, item)].into_iter().chain(added).collect()
    });
}

/// Puts what `change` makes of each key and value in its place: a table can only be added to at its end.
fn rebuild(table: &mut toml_edit::Table, change: impl Fn(Key, Item) -> Vec<(Key, Item)>) {
    let keys: Vec<String> = table.iter().map(|(key, _)| key.to_owned()).collect();
    let entries: Vec<_> = keys.iter().filter_map(|key| table.remove_entry(key)).collect();
    for (key, item) in entries.into_iter().flat_map(|(key, item)| change(key, item)) {
        table.insert_formatted(&key, item);
    }
}

/// Removes a key of an inline or other table.
fn remove(item: &mut Item, key: &str) {
    if let Some(table) = item.as_table_like_mut() {
        table.remove(key);
    }
    // The blank before the closing brace is that of the last value.
    let last = item.as_inline_table_mut().and_then(|table| table.iter_mut().last());
    if let Some((_, value)) =
        last.filter(|(_, value)| value.decor().suffix().is_none_or(|suffix| suffix.as_str() == Some("")))
    {
        value.decor_mut().set_suffix(" ");
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use darm_core::table::Record;
    use darm_core::units::Digest;

    use super::*;
    use crate::plan::{Visit, plan};

    fn old(name: &str) -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/arms-format-1").join(name)
    }

    /// The image in a table file: behind the first line and the digest, before the check sum.
    fn golden(name: &str) -> Vec<u8> {
        let file = std::fs::read(old(name)).unwrap();
        file["darm table 2\n".len() + 32..file.len() - 4].to_vec()
    }

    fn records(image: &[u8]) -> Vec<Record> {
        let (mut records, mut rest) = (Vec::new(), image);
        while !rest.is_empty() {
            let (record, after) = postcard::take_from_bytes(rest).unwrap();
            records.push(record);
            rest = after;
        }
        records
    }

    /// The image with another number of its model, which names the text of the arm file and so changes with its format.
    fn with_model(image: &[u8], of: &Record) -> Vec<u8> {
        let mut records = records(image);
        let (Record::Start { model, .. }, Record::Start { model: wanted, .. }) = (&mut records[0], of) else {
            panic!("a table begins with its start");
        };
        *model = *wanted;
        records.iter().flat_map(|record| postcard::to_stdvec(record).unwrap()).collect()
    }

    #[test]
    fn the_table_of_a_migrated_arm_is_that_of_the_old_version_byte_by_byte() {
        let cases: [(&str, &[&str], Option<f64>, f64); 3] = [
            ("planar4", &["000010000000", "111111110000", "000000000000"], None, 0.5),
            ("planar4-hybrid", &["000010000000", "111111110000"], Some(20.0), 0.5),
            ("mixed", &["101", "210", "000"], Some(30.0), 0.1),
        ];
        for (name, words, servo_deg, dwell_s) in cases {
            let migrated = read(&old(&format!("{name}.toml")), Path::new("new.toml"), Path::new("board.toml")).unwrap();
            let arm = Arm::parse(Path::new("new.toml"), &migrated.arm).unwrap();
            assert_eq!(arm.profile.as_deref(), Some(Path::new("board.toml")));
            let profile = BoardProfile::parse(Path::new("board.toml"), &migrated.profile.to_toml()).unwrap();
            assert_ne!(profile.profile.digest, Digest::default());
            let visits = words.iter().map(|word| Visit {
                word: word.parse().unwrap(),
                servos_rad: servo_deg.map(f64::to_radians).into_iter().collect(),
                dwell_s,
                label: (*word).to_owned(),
            });
            let plan = plan(&arm, &visits.collect::<Vec<_>>(), &profile.board(None), &[]).unwrap();
            let golden = golden(&format!("{name}.darm"));
            assert_eq!(with_model(plan.image.bytes(), &records(&golden)[0]), golden, "{name}");
        }
    }

    #[test]
    fn limits_that_the_old_file_did_not_have_are_marked() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("old.toml");
        let text = std::fs::read_to_string(old("mixed.toml")).unwrap();
        std::fs::write(&path, &text).unwrap();
        let given = text.matches("duty_percent").count();
        let made = read(&path, Path::new("new.toml"), Path::new("board.toml")).unwrap();
        let marked = |key: &str| {
            made.profile_text.lines().filter(|line| line.starts_with(key) && line.ends_with(DEFAULT)).count()
        };
        assert_eq!(marked("duty_percent"), made.profile.profile.outputs.iter().flatten().count() - given);
        assert!(marked("duty_percent") > 0 && marked("line") == 0, "{}", made.profile_text);
        let read = BoardProfile::parse(Path::new("board.toml"), &made.profile_text).unwrap();
        assert_eq!(read, made.profile, "comments change nothing");
    }

    #[test]
    fn comments_and_layout_are_kept() {
        let text = std::fs::read_to_string(old("mixed.toml")).unwrap();
        let new = read(&old("mixed.toml"), Path::new("arms/new.toml"), Path::new("boards/board.toml")).unwrap().arm;
        let comments = |text: &str| -> Vec<String> {
            text.lines().filter_map(|line| line.split_once('#')).map(|(_, comment)| comment.to_owned()).collect()
        };
        assert_eq!(comments(&new), comments(&text));
        let lines = [
            "profile = \"../boards/board.toml\"",
            "outputs = [7, 1]",
            "switch = { closed_in = [0, 2] } # a reed contact",
            "output = 9 # the black one",
            "servo = { id = 2, min_deg = -90, max_deg = 90 } # elbow",
        ];
        for line in lines {
            assert!(new.lines().any(|new| new == line), "{line} is not in\n{new}");
        }
        let kept = new.lines().filter(|line| text.lines().any(|old| old == *line)).count();
        assert_eq!(kept, new.lines().count() - 7, "format, profile, outputs, switch and servo\n{new}");
    }

    #[test]
    fn what_is_not_of_format_1_or_makes_no_profile_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("old.toml");
        let text = std::fs::read_to_string(old("mixed.toml")).unwrap();
        let refused = |from: &str, to: &str| {
            assert!(text.contains(from), "{from}");
            std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
            let error = read(&path, &folder.path().join("new.toml"), Path::new("board.toml")).unwrap_err();
            error.to_string().replace(&format!("{}/", folder.path().display()), "")
        };
        assert_eq!(
            refused("format = 1", "format = 2"),
            "old.toml:2:10: the file has format 2; only files of format 1 are brought over"
        );
        let twice = refused("line = 4", "line = 3");
        assert!(twice.contains("make no profile: ") && twice.contains("line 3 is used twice"), "{twice}");
        let twice = refused("output = 9", "output = 7");
        assert!(twice.contains("output 7 is used twice"), "{twice}");
        let unknown = refused("travel_ms", "travels_ms");
        assert!(unknown.contains("is refused: new.toml:") && unknown.contains("`travels_ms`"), "{unknown}");
    }
}
