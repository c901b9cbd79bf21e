//! Which kinds of measurement a log has the columns of, with which model, and what would make a better diagnosis.

use serde::Serialize;

use super::Repeats;
use super::meaning::{is_named_joint, numbered};
use crate::error::MIN_WORDS;
use crate::measured::Measured;
use crate::prepare::repeatability::MIN_DOF;
use darm_measure::column::Column;
use darm_measure::table::Table;

/// Columns that are no condition of a measurement.
const NO_CONDITION: [&str; 6] = ["time", "temperature", "held_out", "run", "visit", "fresh"];
/// The wrench on the surroundings.
const WRENCH: [&str; 6] = ["fx", "fy", "fz", "mx", "my", "mz"];
/// The tool as it is measured from outside.
const TOOL: [&str; 10] = ["x", "y", "z", "qx", "qy", "qz", "qw", "rx", "ry", "rz"];

/// A kind of measurement that a log can be diagnosed as.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Possible {
    /// The kind.
    pub kind: Measured,
    /// What the model is.
    pub model: &'static str,
    /// A name for the file of the model.
    pub model_file: &'static str,
    /// Lines of the model's file, where it is short.
    pub lines: Vec<String>,
    /// What would make a better diagnosis.
    pub missing: Vec<String>,
}

impl Possible {
    fn new(kind: Measured, model: &'static str, model_file: &'static str) -> Self {
        Self { kind, model, model_file, lines: Vec::new(), missing: Vec::new() }
    }

    fn with_lines(self, lines: &[&str]) -> Self {
        Self { lines: lines.iter().map(ToString::to_string).collect(), ..self }
    }

    /// Adds what is missing, where `is_missing`.
    fn better_with(mut self, is_missing: bool, what: impl Into<String>) -> Self {
        self.missing.extend(is_missing.then(|| what.into()));
        self
    }
}

/// What can be diagnosed from a table.
pub(super) fn possible(table: &Table, repeats: &Repeats) -> Vec<Possible> {
    let has = |all: &[&str]| all.iter().all(|quantity| table.quantity(quantity).is_some());
    let joints = joints(table);
    let is_posture = !joints.is_empty();
    let is_tool = is_posture && has(&["x", "y", "z"]);
    let is_planar = has(&["x", "y", "angle"]);
    let found = [
        (has(&["word", "time"]) && (is_planar || has(&["x", "y", "z", "rx", "ry", "rz"]))).then(|| visits(table)),
        joints.iter().any(|joint| has(&[&torque(joint)])).then(|| torques(table, &joints)),
        (is_posture && has(&["qm1", "taum1"])).then(motor_torques),
        (is_posture && has(&["fz"])).then(|| wrench(table)),
        is_tool.then(|| tool(has(&["qx", "qy", "qz", "qw"]))),
        is_posture.then(|| points(table)).flatten(),
        has(&["pressure", "force"]).then(|| cylinder(table)),
        has(&["target", "position"]).then(|| servo(table)),
    ];
    let dof = repeats.dof;
    let what = format!(
        "conditions measured several times, for the repeatability: {dof} degrees of freedom, {MIN_DOF} are needed"
    );
    found.into_iter().flatten().map(|one| one.better_with(dof < MIN_DOF, what.clone())).collect()
}

/// Whether a prediction may rest on a column: it is not what is measured, nor time and what goes with it.
pub(super) fn is_condition(table: &Table, column: &Column) -> bool {
    let quantity = column.quantity.as_str();
    let prefix = numbered(quantity).map_or("", |(prefix, _)| prefix);
    let is_torque = ["tau", "taum"].contains(&prefix) || quantity.starts_with("tau_");
    let is_measured = match column.meaning() {
        "force" => table.quantity("pressure").is_some(),
        "position" if table.quantity("target").is_some() => true,
        _ => !joints(table).is_empty() && TOOL.contains(&quantity) || WRENCH.contains(&quantity),
    };
    !is_torque && !is_measured && !NO_CONDITION.contains(&column.meaning())
}

/// The quantities that are positions of joints.
fn joints(table: &Table) -> Vec<String> {
    let quantities = table.columns.iter().map(|column| &column.quantity);
    let is_joint = |quantity: &&String| {
        numbered(quantity).is_some_and(|(prefix, _)| prefix == "q") || is_named_joint(table, quantity)
    };
    quantities.filter(is_joint).cloned().collect()
}

/// The quantity that is the torque of a joint.
fn torque(joint: &str) -> String {
    rate("tau", joint)
}

/// A quantity of a joint: of `q1` it is `v1`, of `elbow` `v_elbow`.
fn rate(prefix: &str, joint: &str) -> String {
    match numbered(joint) {
        Some(("q", number)) => format!("{prefix}{number}"),
        _ => format!("{prefix}_{joint}"),
    }
}

fn visits(table: &Table) -> Possible {
    let words =
        table.quantity("word").map_or(0, |column| column.words.iter().collect::<std::collections::BTreeSet<_>>().len());
    let is_absent = |quantity: &str| table.quantity(quantity).is_none();
    Possible::new(Measured::ToolPose, "an arm file", "ARM.toml")
        .better_with(words < MIN_WORDS, format!("{MIN_WORDS} different words at least, there are {words}"))
        .better_with(is_absent("supply"), "a column supply_bar, for effects of the supply pressure")
        .better_with(is_absent("temperature"), "a column temperature_c, for effects of temperature")
}

fn torques(table: &Table, joints: &[String]) -> Possible {
    let is_absent = |prefix: &str| joints.iter().any(|joint| table.quantity(&rate(prefix, joint)).is_none());
    Possible::new(Measured::JointTorque, "the URDF or MJCF of the robot", "ROBOT.urdf")
        .better_with(is_absent("v"), "velocities (v1, … or v_JOINT): they are differentiated from the positions")
        .better_with(is_absent("a"), "accelerations (a1, … or a_JOINT): they are differentiated from the positions")
        .better_with(table.quantity("time").is_none(), "a column of time, or --rate HZ")
}

fn motor_torques() -> Possible {
    let lines = ["kind = \"robot\"", "urdf = \"ROBOT.urdf\"", "observed = \"torque\"", "transmission = [[…], …]"];
    Possible::new(Measured::JointTorque, "a TOML file with the transmission", "MODEL.toml").with_lines(&lines)
}

fn wrench(table: &Table) -> Possible {
    let pose = ["px", "py", "pz", "qx", "qy", "qz", "qw"].iter().all(|quantity| table.quantity(quantity).is_some());
    Possible::new(Measured::ContactWrench, "the URDF or MJCF of the robot", "ROBOT.urdf")
        .better_with(!pose, "the pose of the base (px, py, pz, qx, qy, qz, qw), without which there is no prediction")
}

fn tool(is_pose: bool) -> Possible {
    let observed = if is_pose { "observed = \"tool-pose\"" } else { "observed = \"tool-position\"" };
    Possible::new(Measured::ToolPosition, "a TOML file that names the robot", "MODEL.toml")
        .with_lines(&["kind = \"robot\"", "urdf = \"ROBOT.urdf\"", observed])
        .better_with(!is_pose, "the orientation of the tool (qx, qy, qz, qw)")
}

/// Columns of text name the points that are touched.
fn points(table: &Table) -> Option<Possible> {
    let is_text = |column: &&Column| !column.words[0].is_empty() && column.numbers.iter().all(|number| number.is_nan());
    let names = table.columns.iter().filter(is_text).map(|column| format!("{:?}", column.name));
    let names: Vec<String> = names.collect();
    let point = format!("point = [{}]", names.join(", "));
    let possible = Possible::new(Measured::PointContact, "a TOML file that names the robot", "MODEL.toml");
    let lines = ["kind = \"robot\"", "urdf = \"ROBOT.urdf\"", "observed = \"point-contact\"", &point];
    (!names.is_empty()).then(|| possible.with_lines(&lines))
}

fn cylinder(table: &Table) -> Possible {
    Possible::new(Measured::ActuatorForce, "a TOML file with the bore", "MODEL.toml")
        .with_lines(&["kind = \"cylinder\"", "bore_mm = …"])
        .better_with(table.quantity("position").is_none(), "the position, for friction and what else depends on motion")
        .better_with(table.quantity("time").is_none(), "a column of time, or --rate HZ")
}

fn servo(table: &Table) -> Possible {
    Possible::new(Measured::JointPosition, "a TOML file of one line", "MODEL.toml")
        .with_lines(&["kind = \"servo\""])
        .better_with(table.quantity("load").is_none(), "the load, for compliance and hysteresis")
}
