//! The arms that are timed, random postures and targets of them, as our trees and as the numbers that the other side reads.

use std::array::from_fn;
use std::io::{Error, Read};
use std::path::Path;

use darm_core::actuator::{Axis, JointKind};
use darm_core::real::{Mat3, Vec3};
use darm_core::se::Pose;
use darm_core::tree::{Inertia, Joint, LinkFrame, Tree};
use serde_json::Value;

/// How many postures one timing runs through.
pub(crate) const POSTURES: usize = 1000;

/// One arm with its postures.
pub(crate) struct Arm<const N: usize> {
    pub(crate) name: String,
    pub(crate) tree: Tree<f64, N>,
    pub(crate) tool: LinkFrame<f64>,
    /// As the file has them, for other libraries.
    pub(crate) joints: [Joint<f64>; N],
    /// The tool in the last link.
    pub(crate) end: Pose<f64>,
    /// Lowest and highest position of each joint.
    pub(crate) limits: [[f64; 2]; N],
    /// Positions, velocities and accelerations.
    pub(crate) postures: Vec<[[f64; N]; 3]>,
    /// Starts and poses of inverse kinematics.
    pub(crate) targets: Vec<([f64; N], Pose<f64>)>,
    /// The same for the other side.
    pub(crate) text: String,
}

fn list(value: &Value) -> Vec<f64> {
    value.as_array().into_iter().flatten().filter_map(Value::as_f64).collect()
}

fn vector(value: &Value) -> Vec3<f64> {
    Vec3::from_iterator(list(value).into_iter().chain([0.0; 3]).take(3))
}

fn matrix(value: &Value) -> Mat3<f64> {
    let rows = value.as_array().into_iter().flatten().flat_map(list);
    Mat3::from_iterator(rows.chain([0.0; 9]).take(9)).transpose()
}

fn joint(value: &Value) -> Joint<f64> {
    let kind = if value["type"] == "revolute" { JointKind::Revolute } else { JointKind::Prismatic };
    let link = &value["link"];
    Joint {
        parent: value["parent"].as_u64().map(|parent| parent as usize),
        axis: Axis { kind, direction: vector(&value["axis"]) },
        placement: pose(&value["placement"]),
        inertia: Inertia {
            mass: link["m"].as_f64().unwrap_or(0.0),
            com: vector(&link["com"]),
            about_com: matrix(&link["I_com"]),
        },
    }
}

fn pose(value: &Value) -> Pose<f64> {
    Pose { rotation: matrix(&value["R"]), position: vector(&value["p"]) }
}

fn json(path: &Path) -> Result<Value, Error> {
    let mut text = String::new();
    flate2::read::GzDecoder::new(std::fs::File::open(path)?).read_to_string(&mut text)?;
    Ok(serde_json::from_str(&text)?)
}

/// Reads an arm of N joints and its targets from the golden data in `folder`.
pub(crate) fn read<const N: usize>(folder: &Path, name: &str, seed: u64) -> Result<Arm<N>, Error> {
    let file = json(&folder.join(format!("{name}.json.gz")))?;
    let joints: [Joint<f64>; N] = from_fn(|k| joint(&file["joints"][k]));
    let gravity = vector(&file["gravity_field"]);
    let tree = Tree::new(&joints, gravity).map_err(Error::other)?;
    let end = pose(&file["ee"]);
    let postures = postures(seed);
    let file = json(&folder.join(format!("ik_targets_{name}.json.gz")))?;
    let [low, high] = [0, 1].map(|side| list(&file["limits"][side]));
    let limits = from_fn(|k| [low[k], high[k]]);
    let targets: Vec<_> = file["targets"].as_array().into_iter().flatten().map(target).collect();
    let text = numbers(name, &joints, &gravity, &end, &postures) + &targets_text(&limits, &targets);
    Ok(Arm { name: name.to_owned(), tool: tree.frame(N - 1, &end), tree, joints, end, limits, postures, targets, text })
}

/// A start, a rotation vector and a position.
fn target<const N: usize>(row: &Value) -> ([f64; N], Pose<f64>) {
    let row = list(row);
    (from_fn(|k| row[k]), Pose::new(&vector_of(&row[N..]), vector_of(&row[N + 3..])))
}

fn vector_of(numbers: &[f64]) -> Vec3<f64> {
    Vec3::from_iterator(numbers.iter().copied().take(3))
}

/// Positions within ±3, velocities and accelerations within ±1.
fn postures<const N: usize>(seed: u64) -> Vec<[[f64; N]; 3]> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    (0..POSTURES).map(|_| [3.0, 1.0, 1.0].map(|size| from_fn(|_| size * next()))).collect()
}

fn numbers<const N: usize>(
    name: &str,
    joints: &[Joint<f64>; N],
    gravity: &Vec3<f64>,
    end: &Pose<f64>,
    postures: &[[[f64; N]; 3]],
) -> String {
    let mut text = format!("{name} {N}\n");
    let mut put = |values: &[f64]| text.extend(values.iter().map(|x| format!("{x:e} ")));
    put(gravity.as_slice());
    for joint in joints {
        put(&[joint.parent.map_or(-1.0, |parent| parent as f64)]);
        put(&[f64::from(u8::from(joint.axis.kind == JointKind::Revolute))]);
        put(joint.axis.direction.as_slice());
        put(joint.placement.rotation.transpose().as_slice());
        put(joint.placement.position.as_slice());
        put(&[joint.inertia.mass]);
        put(joint.inertia.com.as_slice());
        put(joint.inertia.about_com.as_slice());
    }
    put(&[N as f64 - 1.0]);
    put(end.rotation.transpose().as_slice());
    put(end.position.as_slice());
    put(&[postures.len() as f64]);
    postures.iter().flatten().for_each(|numbers| put(numbers));
    text.push('\n');
    text
}

fn targets_text<const N: usize>(limits: &[[f64; 2]; N], targets: &[([f64; N], Pose<f64>)]) -> String {
    let mut text = format!("{} ", targets.len());
    let mut put = |values: &[f64]| text.extend(values.iter().map(|x| format!("{x:e} ")));
    put(&limits.map(|[low, _]| low));
    put(&limits.map(|[_, high]| high));
    for (start, pose) in targets {
        put(start);
        put(pose.rotation.transpose().as_slice());
        put(pose.position.as_slice());
    }
    text.push('\n');
    text
}
