//! Edits of TOML texts that keep their comments and layout.

use toml_edit::{DocumentMut, Item, Key};

use super::limit::default_limit;
use super::{Actuator, OldArm};

/// Comment at a value that the old file did not have.
pub(super) const DEFAULT: &str = "# default of this version: the old file had none";
/// Keys of a servo in format 1 that belong to the board.
const LIMITS_OF_SERVO: [&str; 3] = ["max_speed_deg_s", "max_torque", "timeout_ms"];

/// The text of a profile with a comment at each value that the old file did not have.
pub(super) fn marked(text: &str, arm: &OldArm, actuators: &[Actuator]) -> String {
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

/// The text of the new arm file. What cannot be edited stays as it is, and is refused when the text is read.
pub(super) fn edited(text: &str, actuators: &[Actuator], profile: &str) -> String {
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
    // The profile was read from these numbers before.
    let first = *numbers.first().expect("an actuator has a coil, and each coil the number of an output");
    let all: toml_edit::Array = numbers.iter().copied().collect();
    replace(table, "coil", "output", |_| toml_edit::value(first));
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
