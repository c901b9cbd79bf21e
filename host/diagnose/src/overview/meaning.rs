//! What a column is taken for, by its name.

use darm_measure::column::Column;
use darm_measure::table::Table;

/// Joints whose quantities are listed.
const MAX_JOINTS: usize = 12;
/// Quantities of numbered columns.
const NUMBERED: [(&str, &str); 7] = [
    ("q", "position of joint"),
    ("v", "velocity of joint"),
    ("a", "acceleration of joint"),
    ("tau", "torque of joint"),
    ("qm", "position of motor"),
    ("taum", "torque of motor"),
    ("servo", "position of servo"),
];
/// Quantities of columns with the name of a joint.
const OF_NAMED_JOINT: [(&str, &str); 3] = [("v_", "velocity"), ("a_", "acceleration"), ("tau_", "torque")];
/// Other quantities.
const OTHERS: [(&str, &str); 33] = [
    ("time", "time"),
    ("word", "word: one state per actuator"),
    ("previous", "word before"),
    ("angle", "orientation of the tool"),
    ("rx", "orientation of the tool, x of the rotation vector"),
    ("ry", "orientation of the tool, y of the rotation vector"),
    ("rz", "orientation of the tool, z of the rotation vector"),
    ("qx", "orientation, x of the quaternion"),
    ("qy", "orientation, y of the quaternion"),
    ("qz", "orientation, z of the quaternion"),
    ("qw", "orientation, w of the quaternion"),
    ("px", "position of the base, x"),
    ("py", "position of the base, y"),
    ("pz", "position of the base, z"),
    ("y", "position of the tool, y"),
    ("z", "position of the tool, z"),
    ("pressure", "pressure in the actuator"),
    ("supply", "supply pressure"),
    ("temperature", "temperature"),
    ("force", "force of the actuator"),
    ("load", "load"),
    ("target", "target position"),
    ("position", "position"),
    ("fx", "force on the surroundings, x"),
    ("fy", "force on the surroundings, y"),
    ("fz", "force on the surroundings, z"),
    ("mx", "moment on the surroundings, x"),
    ("my", "moment on the surroundings, y"),
    ("mz", "moment on the surroundings, z"),
    ("held_out", "1 in held-out rows"),
    ("run", "number of the run"),
    ("visit", "number of the visit"),
    ("fresh", "1 in rows with a new posture"),
];

/// Quantities that a column can hold, with what they are; of joints the first 12.
pub fn quantities() -> impl Iterator<Item = (String, String)> {
    let joint =
        |k: usize| NUMBERED.iter().map(move |(quantity, what)| (format!("{quantity}{k}"), format!("{what} {k}")));
    let numbered = (1..=MAX_JOINTS).flat_map(joint);
    let others = OTHERS.iter().map(|(quantity, what)| ((*quantity).to_owned(), (*what).to_owned()));
    others.chain([("x".to_owned(), "position of the tool, x".to_owned())]).chain(numbered)
}

/// What a column is taken for; empty where its name says nothing.
pub(super) fn of(table: &Table, column: &Column) -> String {
    let quantity = column.quantity.as_str();
    if let Some((prefix, number)) = numbered(quantity)
        && let Some((_, what)) = NUMBERED.iter().find(|(known, _)| *known == prefix)
    {
        return format!("{what} {number}");
    }
    let of_joint = OF_NAMED_JOINT.iter().find_map(|(prefix, what)| Some((what, quantity.strip_prefix(prefix)?)));
    if let Some((what, joint)) = of_joint.filter(|(_, joint)| !joint.is_empty()) {
        return format!("{what} of joint {joint}");
    }
    if is_named_joint(table, quantity) {
        return format!("position of joint {quantity}");
    }
    if quantity == "x" && table.quantity("y").is_some() {
        return "position of the tool, x".into();
    }
    let known = OTHERS.iter().find(|(known, _)| *known == column.meaning());
    known.map_or(String::new(), |(_, what)| (*what).into())
}

/// A name of letters and the number that it ends in.
pub(super) fn numbered(quantity: &str) -> Option<(&str, usize)> {
    let letters = quantity.trim_end_matches(|c: char| c.is_ascii_digit());
    Some((letters, quantity[letters.len()..].parse().ok()?))
}

/// Whether a column is the position of a joint with its name: the table has its torque or its velocity.
pub(super) fn is_named_joint(table: &Table, quantity: &str) -> bool {
    ["tau_", "v_"].iter().any(|prefix| table.quantity(&format!("{prefix}{quantity}")).is_some())
}
