//! What the columns of a recording most likely mean, by their names: a mapping to begin with.

use crate::import::mapping::{Entry, Mapping, Scale};
use crate::import::recording::{Column, Part, Recording};
use crate::unit::{self, Unit};

/// Names of time, in small letters without unit.
const TIMES: [&str; 15] = [
    "time",
    "t",
    "stamp",
    "timestamp",
    "time_stamp",
    "times",
    "tout",
    "elapsed",
    "elapsed_time",
    "zeit",
    "zeitstempel",
    "datetime",
    "date_time",
    "date",
    "clock",
];

/// Words that name a quantity of joints, by what our columns call it, and its unit of SI.
const JOINT_WORDS: [(&str, &str, &[&str]); 5] = [
    ("qm", "rad", &["qm", "motor_position", "motor_pos", "theta_m"]),
    (
        "q",
        "rad",
        &[
            "q",
            "qpos",
            "position",
            "pos",
            "angle",
            "theta",
            "joint",
            "j",
            "axis",
            "joint_position",
            "joint_pos",
            "actual_q",
            "achse",
            "winkel",
        ],
    ),
    ("v", "rad_s", &["v", "qd", "dq", "qdot", "qvel", "velocity", "vel", "speed", "actual_qd", "joint_velocity"]),
    ("a", "rad_s2", &["qdd", "ddq", "qacc", "acceleration", "acc", "joint_acceleration"]),
    ("tau", "nm", &["tau", "torque", "effort", "moment", "joint_torque", "trq"]),
];

/// Names of our columns that are kept as they are, and the unit of SI that they need.
const OWN: [(&str, &str); 30] = [
    ("position", "m"),
    ("target", "m"),
    ("pressure", "pa"),
    ("force", "n"),
    ("load", "n"),
    ("supply", "pa"),
    ("temperature", "c"),
    ("x", "m"),
    ("y", "m"),
    ("z", "m"),
    ("rx", "rad"),
    ("ry", "rad"),
    ("rz", "rad"),
    ("angle", "rad"),
    ("fx", "n"),
    ("fy", "n"),
    ("fz", "n"),
    ("mx", "nm"),
    ("my", "nm"),
    ("mz", "nm"),
    ("px", "m"),
    ("py", "m"),
    ("pz", "m"),
    ("qx", ""),
    ("qy", ""),
    ("qz", ""),
    ("qw", ""),
    ("word", ""),
    ("run", ""),
    ("held_out", ""),
];

/// Words of a name that may be time: where no column is called so alone, one of them whose numbers only increase.
const TIME_WORDS: [&str; 8] = ["time", "timestamp", "stamp", "ts", "unix", "epoch", "clock", "zeit"];

/// The column of time of a part, and its unit.
pub fn time_column(part: &Part) -> Option<(usize, Unit)> {
    let found = |unit: fn(&Column) -> Option<Unit>| {
        part.columns.iter().enumerate().find_map(|(k, column)| Some((k, unit(column)?)))
    };
    found(time_unit).or_else(|| found(increasing_unit))
}

/// The unit of a column that is time by its name.
pub(crate) fn time_unit(column: &Column) -> Option<Unit> {
    let (base, unit) = time_name(column);
    let unit = unit.unwrap_or_else(|| unit::of_times(&column.numbers));
    (is_time(&base) && unit.dimension() == "time" && column.is_mostly_numeric()).then_some(unit)
}

/// The unit of a column that may be time by its name or unit, and whose numbers only increase.
fn increasing_unit(column: &Column) -> Option<Unit> {
    let (base, unit) = time_name(column);
    if unit.is_none() && unit::in_brackets(&column.name).is_some() {
        return None;
    }
    increasing_time(&base, unit, &column.numbers)
}

/// The unit of numbers that may be time by their name or unit, and only increase: a duration does not.
pub(crate) fn increasing_time(base: &str, unit: Option<Unit>, numbers: &[f64]) -> Option<Unit> {
    let mut words = base.split(|c: char| !c.is_alphanumeric());
    let unit = match unit {
        Some(unit) => Some(unit).filter(|unit| unit.dimension() == "time"),
        None => words.any(|word| TIME_WORDS.contains(&word)).then(|| unit::of_times(numbers)),
    };
    let mut steps = numbers.windows(2).map(|pair| pair[1] - pair[0]);
    unit.filter(|_| numbers.len() > 2 && steps.all(|step| step > 0.0))
}

/// Whether a name without prefix and unit is one of time: a unit alone is, but for those of one letter or in brackets.
fn is_time(base: &str) -> bool {
    let is_unit = || unit::split(&format!("_ {base}")).1.is_some_and(|unit| unit.dimension() == "time");
    TIMES.contains(&base) || base.len() > 3 && is_unit() || base == "sec"
}

/// Whether a column is called time and has texts.
pub(crate) fn is_named_time(column: &Column) -> bool {
    is_time(&time_name(column).0) && !column.is_mostly_numeric()
}

/// Whether the unit of a column of time is neither in the file nor in its name.
pub(crate) fn is_guessed(column: &Column) -> bool {
    time_name(column).1.is_none()
}

/// What a column is called, without prefix and unit, and the unit that it names.
fn time_name(column: &Column) -> (String, Option<Unit>) {
    let (base, unit) = unit::split(&column.name);
    let base = base.rsplit(['/', '.']).next().unwrap_or(base).to_lowercase().replace(' ', "_");
    // `__time` of PlotJuggler, `%time` of rostopic.
    let base = base.trim_matches(|c: char| !c.is_alphanumeric()).to_owned();
    // The unit of a column such as `sec` is its name.
    let unit = Unit::named(column.unit.as_deref().unwrap_or("")).or(unit).or_else(|| Unit::named(&base));
    (base, unit)
}

/// A mapping of all columns; columns whose meaning is not known keep their names.
pub fn propose(recording: &Recording, units: &[(String, Unit)]) -> Mapping {
    let known = Mapping { units: units.to_vec(), ..Mapping::default() };
    let mut mapping = known.clone();
    let parts = usable(recording);
    for part in parts {
        let time = time_column(part).filter(|_| !mapping.entries.iter().any(|entry| entry.target == "time_s"));
        if let Some((k, unit)) = time {
            let column = &part.columns[k];
            let is_named = known.unit_of(column).is_some();
            add(&mut mapping, "time_s".into(), column, if is_named { Scale::OfFile } else { Scale::In(unit) });
        }
        let (zero_based, pose) = (zero_based(part), pose(part));
        for (k, column) in part.columns.iter().enumerate() {
            let is_stamp = !part.stamps_ns.is_empty() && time_unit(column).is_some();
            // A column without any value has nothing to say.
            if time.map(|(at, _)| at) != Some(k) && !is_stamp && column.n_values() > 0 {
                let of_pose =
                    pose.iter().find(|(column, ..)| *column == k).map(|(_, name, unit)| ((*name).to_owned(), *unit));
                let (name, needed) = of_pose.unwrap_or_else(|| meaning(part, column, &zero_based));
                let unit = known
                    .unit_of(column)
                    .map(Unit::written)
                    .or_else(|| Unit::named(needed).filter(|_| column.unit.is_none()));
                let numeric = unit.filter(|_| column.is_mostly_numeric());
                let target = numeric.map_or(name.clone(), |unit| format!("{name}_{}", unit.name));
                add(&mut mapping, target, column, Scale::OfFile);
            }
        }
    }
    mapping
}

/// Parts that can be one table: of topics all, of arrays those with as many rows as the longest of them that has a time.
fn usable(recording: &Recording) -> Vec<&Part> {
    let read: Vec<&Part> = recording.parts.iter().filter(|part| part.n_rows() > 0).collect();
    let timed =
        read.iter().filter(|part| part.stamps_ns.is_empty() && time_column(part).is_some()).map(|part| part.n_rows());
    let usual =
        || read.iter().map(|part| part.n_rows()).max_by_key(|n| read.iter().filter(|part| part.n_rows() == *n).count());
    let rows = timed.max().or_else(usual);
    let is_stamped = |part: &&&Part| !part.stamps_ns.is_empty();
    let mut parts: Vec<&Part> = match read.iter().any(|part| is_stamped(&part)) {
        // Poses first: angles are not to be interpolated.
        true => read.iter().filter(is_stamped).copied().collect(),
        false => read.iter().filter(|part| Some(part.n_rows()) == rows).copied().collect(),
    };
    parts.sort_by_key(|part| !part.kind.ends_with("PoseStamped"));
    parts
}

fn add(mapping: &mut Mapping, target: String, column: &Column, scale: Scale) {
    let is_taken = |name: &str| mapping.entries.iter().any(|entry| entry.target == name);
    let mut free = target.clone();
    for k in 2.. {
        if !is_taken(&free) {
            break;
        }
        let unit = Unit::of_target(&target).map_or(String::new(), |unit| format!("_{}", unit.name));
        free = format!("{}_{k}{unit}", target.strip_suffix(&unit).unwrap_or(&target));
    }
    let origin = format!("`{free}={}`", column.name);
    mapping.entries.push(Entry { target: free, source: column.name.clone(), scale, origin });
}

/// Quantities whose columns are numbered from 0 in a part.
fn zero_based(part: &Part) -> Vec<&'static str> {
    let numbered = part.columns.iter().filter_map(|column| joint(unit::split(&column.name).0));
    numbered.filter(|(.., number)| *number == 0).map(|(quantity, ..)| quantity).collect()
}

/// The name of one of our columns without unit, and the unit of SI that it needs; empty where it needs none.
fn meaning(part: &Part, column: &Column, zero_based: &[&str]) -> (String, &'static str) {
    let (base, _) = unit::split(&column.name);
    if part.kind.ends_with("JointState") || part.stamps_ns.len() == part.n_rows() && !part.stamps_ns.is_empty() {
        return of_topic(part, column);
    }
    if let Some((quantity, unit, number)) = joint(base) {
        return (format!("{quantity}{}", number + usize::from(zero_based.contains(&quantity))), unit);
    }
    let plain = plain(base);
    let english = [("wort", "word"), ("winkel", "angle")].into_iter().find(|(own, _)| plain.eq_ignore_ascii_case(own));
    let plain = english.map_or(plain, |(_, english)| english.to_owned());
    let own = OWN.iter().find(|(name, _)| plain.eq_ignore_ascii_case(name));
    own.map_or((plain.clone(), ""), |(_, unit)| (plain.clone(), unit))
}

/// The columns of the first pose of a table, as EuRoC, TUM, `rostopic echo -p` and Motive name them: a position and a
/// quaternion; none where one of the seven is missing.
fn pose(part: &Part) -> Vec<(usize, &'static str, &'static str)> {
    const POSITION: [&str; 6] = ["position", "translation", "pos", "trans", "p", "t"];
    const ROTATION: [&str; 6] = ["orientation", "rotation", "quaternion", "quat", "rot", "q"];
    const WANTED: [(&str, &str, &[&str], &str); 7] = [
        ("x", "x", &POSITION, "m"),
        ("y", "y", &POSITION, "m"),
        ("z", "z", &POSITION, "m"),
        ("qx", "x", &ROTATION, ""),
        ("qy", "y", &ROTATION, ""),
        ("qz", "z", &ROTATION, ""),
        ("qw", "w", &ROTATION, ""),
    ];
    if !part.stamps_ns.is_empty() {
        return Vec::new();
    }
    let words = |column: &Column| -> Vec<String> {
        let base = unit::split(&column.name).0.to_lowercase();
        let mut words: Vec<String> = base.split(|c: char| !c.is_alphanumeric()).map(str::to_owned).collect();
        // `tx`, `qw`
        if let Some(last) = words.pop() {
            match last.split_at_checked(1) {
                Some((kind @ ("t" | "p" | "q"), axis @ ("x" | "y" | "z" | "w"))) => {
                    words.extend([kind, axis].map(str::to_owned))
                }
                _ => words.push(last),
            }
        }
        words
    };
    let named: Vec<Vec<String>> = part.columns.iter().map(words).collect();
    let found = WANTED.iter().map(|(name, axis, kinds, unit)| {
        let is_meant = |words: &Vec<String>| {
            words
                .split_last()
                .is_some_and(|(last, rest)| last == axis && rest.iter().any(|word| kinds.contains(&word.as_str())))
        };
        Some((named.iter().position(is_meant)?, *name, *unit))
    });
    found.collect::<Option<_>>().unwrap_or_default()
}

/// A quantity of a joint and the number of the joint as the name counts it: `q[:,0]` is 1, `joint_3` is 3.
fn joint(base: &str) -> Option<(&'static str, &'static str, usize)> {
    let small = base.to_lowercase();
    let small = small.rsplit(['/', '.']).next().unwrap_or(&small);
    let (word, number) = match small.split_once('[') {
        Some((word, index)) => {
            let digits = index.trim_end_matches(']').trim_matches([':', ',']);
            (word.to_owned(), digits.parse::<usize>().ok()? + 1)
        }
        None => {
            let words: Vec<&str> = small.split(['_', ' ', '-']).filter(|word| !word.is_empty()).collect();
            let split: Vec<(String, Option<usize>)> = words
                .iter()
                .map(|word| {
                    let letters = word.trim_end_matches(|c: char| c.is_ascii_digit());
                    (letters.to_owned(), word[letters.len()..].parse().ok())
                })
                .collect();
            let mut numbers = split.iter().filter_map(|(_, number)| *number);
            let number = numbers.next().filter(|_| numbers.next().is_none())?;
            let letters: Vec<&str> =
                split.iter().map(|(word, _)| word.as_str()).filter(|word| !word.is_empty()).collect();
            // `joint_3_velocity` is a velocity.
            let rest: Vec<&str> =
                letters.iter().filter(|word| !["joint", "j", "axis", "achse"].contains(word)).copied().collect();
            (if rest.is_empty() { letters.join("_") } else { rest.join("_") }, number)
        }
    };
    let found = JOINT_WORDS.iter().find(|(_, _, words)| words.contains(&word.as_str()));
    found.map(|(quantity, unit, _)| (*quantity, *unit, number))
}

/// Columns of topics: those of joints by the names of the joints, poses and wrenches by ours.
fn of_topic(part: &Part, column: &Column) -> (String, &'static str) {
    let field = column.name.strip_prefix(&format!("{}/", part.name)).unwrap_or(&column.name);
    if part.kind.ends_with("JointState") {
        let (quantity, name) = field.split_once('.').unwrap_or(("position", field));
        // Of messages without names the number.
        if let Ok(number) = name.parse::<usize>() {
            return match quantity {
                "velocity" => (format!("v{number}"), ""),
                "effort" => (format!("tau{number}"), ""),
                _ => (format!("q{number}"), ""),
            };
        }
        let name = plain(name);
        return match quantity {
            "velocity" => (format!("v_{name}"), ""),
            "effort" => (format!("tau_{name}"), ""),
            _ => (name, ""),
        };
    }
    let known = match (part.kind.rsplit('/').next().unwrap_or_default(), field) {
        ("PoseStamped", "position.x") => "x",
        ("PoseStamped", "position.y") => "y",
        ("PoseStamped", "position.z") => "z",
        ("PoseStamped", "rotation.x") => "rx",
        ("PoseStamped", "rotation.y") => "ry",
        ("PoseStamped", "rotation.z") => "rz",
        ("PoseStamped", "orientation.x") => "qx",
        ("PoseStamped", "orientation.y") => "qy",
        ("PoseStamped", "orientation.z") => "qz",
        ("PoseStamped", "orientation.w") => "qw",
        ("WrenchStamped", "force.x") => "Fx",
        ("WrenchStamped", "force.y") => "Fy",
        ("WrenchStamped", "force.z") => "Fz",
        ("WrenchStamped", "torque.x") => "Mx",
        ("WrenchStamped", "torque.y") => "My",
        ("WrenchStamped", "torque.z") => "Mz",
        _ => return (plain(field), ""),
    };
    (known.into(), "")
}

/// A name of letters, digits and `_`.
fn plain(name: &str) -> String {
    let mut plain = String::new();
    for c in name.trim().chars() {
        let c = if c.is_alphanumeric() { c } else { '_' };
        if c != '_' || !plain.ends_with('_') {
            plain.push(c);
        }
    }
    let plain = plain.trim_matches('_');
    if plain.is_empty() || plain.starts_with(|c: char| c.is_ascii_digit()) {
        format!("column_{plain}")
    } else {
        plain.into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn proposed(names: &[&str]) -> Vec<String> {
        let column = |name: &&str| Column {
            unit: unit::split(name).1.map(|unit| unit.name.to_owned()),
            ..Column::of_numbers(*name, vec![0.0, 1.0])
        };
        let part = Part { kind: "table".into(), columns: names.iter().map(column).collect(), ..Part::default() };
        let recording = Recording { parts: vec![part], ..Recording::default() };
        propose(&recording, &[]).entries.into_iter().map(|entry| entry.target).collect()
    }

    #[test]
    fn names_of_joints_and_of_time_are_recognised() {
        let names = [
            "Time [ms]",
            "joint_1 position [deg]",
            "q2",
            "joint_1_velocity",
            "Torque 1 (Nm)",
            "Fx",
            "note",
            "motor temp (°C)",
        ];
        let expected = ["time_s", "q1_deg", "q2_rad", "v1_rad_s", "tau1_nm", "Fx_n", "note", "motor_temp_c"];
        assert_eq!(proposed(&names), expected);
        assert_eq!(proposed(&["q0", "q1"]), ["q1_rad", "q2_rad"]);
        assert_eq!(proposed(&["tau[:,0]", "tau[:,1]"]), ["tau1_nm", "tau2_nm"]);
        assert_eq!(proposed(&["1", "a", "a"]), ["column_1", "a", "a_2"]);
        assert_eq!(proposed(&["timestamp_ms", "Wort"]), ["time_s", "word"]);
    }

    #[test]
    fn poses_are_recognised_as_other_programs_name_them() {
        let expected = ["x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"];
        let euroc =
            ["p_RS_R_x [m]", "p_RS_R_y [m]", "p_RS_R_z [m]", "q_RS_w []", "q_RS_x []", "q_RS_y []", "q_RS_z []"];
        assert_eq!(proposed(&euroc), expected);
        assert_eq!(proposed(&["tx", "ty", "tz", "qw", "qx", "qy", "qz"]), expected);
        let of = |axis: &str, kind: &str| format!("field.pose.{kind}.{axis}");
        let ros = [("x", "position"), ("y", "position"), ("z", "position")].map(|(axis, kind)| of(axis, kind));
        let turn = ["w", "x", "y", "z"].map(|axis| of(axis, "orientation"));
        let names: Vec<&str> = ros.iter().chain(&turn).map(String::as_str).collect();
        assert_eq!(proposed(&names), expected);
        // Without a w it is no quaternion.
        assert_eq!(proposed(&["tx", "ty", "tz"]), ["tx", "ty", "tz"]);
    }
}
