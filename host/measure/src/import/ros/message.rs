//! Messages of ROS 2 and ROS 1 that are read: their fields as columns, in the units of REP 103.

use std::collections::HashSet;

use super::cdr::Cdr;

/// A message: its time stamp, and its fields by name.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Message {
    /// Of the header, ns since 1970; 0 where nobody set it.
    pub(super) stamp_ns: i64,
    pub(super) fields: Vec<(String, f64)>,
    /// What of it is not read, and why.
    pub(super) unread: Option<String>,
}

/// Types that are a header and numbers, by their names in ROS 1; those in ROS 2 have `msg/` in between, and some programs leave it out.
const STAMPED: [(&str, &[&str]); 5] = [
    (
        "geometry_msgs/PoseStamped",
        &["position.x", "position.y", "position.z", "orientation.x", "orientation.y", "orientation.z", "orientation.w"],
    ),
    ("geometry_msgs/WrenchStamped", &["force.x", "force.y", "force.z", "torque.x", "torque.y", "torque.z"]),
    ("geometry_msgs/TwistStamped", &["linear.x", "linear.y", "linear.z", "angular.x", "angular.y", "angular.z"]),
    ("geometry_msgs/PointStamped", &["point.x", "point.y", "point.z"]),
    ("geometry_msgs/Vector3Stamped", &["vector.x", "vector.y", "vector.z"]),
];
/// The encoding of messages of ROS 1.
const ROS_1: &str = "ros1";
const JOINT_STATE: &str = "sensor_msgs/JointState";

/// Units of fields by what their names begin with; those of joints are of revolute ones.
const UNITS: [(&str, &str); 9] = [
    ("position.x", "m"),
    ("position.y", "m"),
    ("position.z", "m"),
    ("force.", "N"),
    ("torque.", "N·m"),
    ("linear.", "m/s"),
    ("angular.", "rad/s"),
    ("point.", "m"),
    ("rotation.", "rad"),
];
const JOINT_UNITS: [(&str, &str); 3] = [("position.", "rad"), ("velocity.", "rad/s"), ("effort.", "N·m")];

/// Whether a type is the one of this name in ROS 1.
fn is_of(kind: &str, known: &str) -> bool {
    kind == known || kind.split_once("/msg/").is_some_and(|parts| Some(parts) == known.split_once('/'))
}

/// The fields of a type that is a header and numbers.
fn stamped(kind: &str) -> Option<&'static [&'static str]> {
    STAMPED.iter().find(|(known, _)| is_of(kind, known)).map(|(_, names)| *names)
}

/// Whether messages of this type in this encoding are read.
pub(super) fn is_known(kind: &str, encoding: &str) -> bool {
    matches!(encoding, "cdr" | ROS_1) && (is_of(kind, JOINT_STATE) || stamped(kind).is_some())
}

/// The unit of a field of a type.
pub(super) fn unit(kind: &str, field: &str) -> Option<String> {
    let units = if is_of(kind, JOINT_STATE) { &JOINT_UNITS[..] } else { &UNITS };
    units.iter().find(|(start, _)| field.starts_with(start)).map(|(_, unit)| (*unit).to_owned())
}

/// A message of a type that [`is_known`], or what is wrong with it; `joints` are the names of the last message that had some.
pub(super) fn read(kind: &str, encoding: &str, bytes: &[u8], joints: &mut Vec<String>) -> Result<Message, String> {
    let mut cdr = if encoding == ROS_1 { Cdr::ros_1(bytes) } else { Cdr::new(bytes)? };
    let cut = || "the message ends early or holds a wrong length: the log is damaged".to_owned();
    // The header of ROS 1 begins with a number of the message.
    if encoding == ROS_1 {
        cdr.u32().ok_or_else(cut)?;
    }
    let (seconds, nanoseconds) = cdr.i32().zip(cdr.u32()).ok_or_else(cut)?;
    let _frame = cdr.text().ok_or_else(cut)?;
    let stamp_ns = i64::from(seconds) * 1_000_000_000 + i64::from(nanoseconds);
    let (fields, unread) = match stamped(kind) {
        Some(names) => {
            let field = |name: &&str| Some(((*name).to_owned(), cdr.f64()?));
            (names.iter().map(field).collect::<Option<_>>().ok_or_else(cut)?, None)
        }
        None => of_joints(&mut cdr, joints).ok_or_else(cut)?,
    };
    Ok(Message { stamp_ns, fields, unread })
}

/// A quantity and its number.
type Field = (String, f64);

/// Positions, velocities and efforts by the names of the joints. Without names they are as many as in a message before, or the
/// numbers of the joints. Empty lists are not measured, and of one of another length it is not known which joints it is of.
fn of_joints(cdr: &mut Cdr, before: &mut Vec<String>) -> Option<(Vec<Field>, Option<String>)> {
    let mut names = cdr.sequence(4, Cdr::text)?;
    let (mut fields, mut unread) = (Vec::new(), None);
    let n_different = names.iter().collect::<HashSet<_>>().len();
    if n_different < names.len() {
        unread = Some("names, of which some are equal".to_owned());
        names.clear();
    } else if !names.is_empty() {
        before.clone_from(&names);
    }
    for quantity in ["position", "velocity", "effort"] {
        let numbers = cdr.sequence(8, Cdr::f64)?;
        if names.is_empty() && !before.is_empty() && before.len() == numbers.len() {
            names.clone_from(before);
            unread = Some("names, and have those of a message before".to_owned());
        } else if names.is_empty() {
            names = (1..=numbers.len()).map(|number| number.to_string()).collect();
        }
        if !numbers.is_empty() && numbers.len() != names.len() {
            unread =
                Some(format!("{quantity}, of which there are {} numbers for {} joints", numbers.len(), names.len()));
            continue;
        }
        fields.extend(names.iter().zip(numbers).map(|(name, number)| (format!("{quantity}.{name}"), number)));
    }
    Some((fields, unread))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A `JointState` in little-endian CDR with a position for each joint.
    fn joint_state(names: &[&str], positions: &[f64]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let number = |bytes: &mut Vec<u8>, number: usize| {
            bytes.resize(bytes.len().next_multiple_of(4), 0);
            bytes.extend((number as u32).to_le_bytes());
        };
        let text = |bytes: &mut Vec<u8>, text: &str| {
            number(bytes, text.len() + 1);
            bytes.extend(text.bytes().chain([0]));
        };
        number(&mut bytes, 5);
        number(&mut bytes, 0);
        text(&mut bytes, "");
        number(&mut bytes, names.len());
        names.iter().for_each(|name| text(&mut bytes, name));
        number(&mut bytes, positions.len());
        bytes.resize(bytes.len().next_multiple_of(8), 0);
        bytes.extend(positions.iter().flat_map(|position| position.to_le_bytes()));
        number(&mut bytes, 0);
        number(&mut bytes, 0);
        [&[0, 1, 0, 0], &bytes[..]].concat()
    }

    #[test]
    fn a_message_of_ros_1_has_no_alignment_and_a_number_before_its_stamp() {
        let texts = |text: &str| [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat();
        let number = |number: u32| number.to_le_bytes().to_vec();
        let header = [number(7), number(5), number(250_000_000), texts("")];
        let names = [number(2), texts("a"), texts("bcd")];
        let positions =
            [number(2), 1.5f64.to_le_bytes().to_vec(), (-2.0f64).to_le_bytes().to_vec(), number(0), number(0)];
        let bytes = [header.concat(), names.concat(), positions.concat()].concat();
        for kind in ["sensor_msgs/JointState", "sensor_msgs/msg/JointState"] {
            assert!(is_known(kind, "ros1") && !is_known(kind, "protobuf"));
            let message = read(kind, "ros1", &bytes, &mut Vec::new()).unwrap();
            assert_eq!(message.stamp_ns, 5_250_000_000);
            assert_eq!(message.fields, [("position.a".to_owned(), 1.5), ("position.bcd".to_owned(), -2.0)]);
            assert!(read(kind, "ros1", &bytes[..bytes.len() - 5], &mut Vec::new()).is_err(), "cut");
        }
    }

    #[test]
    fn joints_without_names_have_those_of_a_message_before_and_equal_names_are_none() {
        let mut joints = Vec::new();
        let mut fields = |names: &[&str]| {
            let message = read(JOINT_STATE, "cdr", &joint_state(names, &[1.0, 2.0]), &mut joints).unwrap();
            message.fields.into_iter().map(|(name, _)| name).collect::<Vec<_>>().join(" ")
        };
        assert_eq!(fields(&["a", "a"]), "position.1 position.2");
        assert_eq!(fields(&["b", "a"]), "position.b position.a");
        assert_eq!(fields(&[]), "position.b position.a");
    }
}
