//! Reads the golden files.

use darm_core::actuator::{Axis, JointKind};
use darm_core::real::{Mat3, Vec3};
use darm_core::se::Pose;
use darm_core::tree::{Inertia, Joint};
use serde_json::Value;
use std::array::from_fn;
use std::io::Read;
use std::path::Path;

pub(crate) fn golden(name: &str) -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("data/golden/{name}.json.gz"));
    let mut text = String::new();
    let file = std::fs::File::open(path).expect("a golden file");
    flate2::read::GzDecoder::new(file).read_to_string(&mut text).expect("gzip");
    serde_json::from_str(&text).expect("JSON")
}

pub(crate) fn list(value: &Value) -> Vec<f64> {
    value.as_array().expect("numbers").iter().map(|x| x.as_f64().expect("a number")).collect()
}

pub(crate) fn array<const N: usize>(value: &Value) -> [f64; N] {
    list(value).try_into().expect("as many numbers as joints")
}

pub(crate) fn column(value: &Value) -> Vec3<f64> {
    Vec3::from_column_slice(&list(value))
}

/// Rows of rows, flattened.
pub(crate) fn flat(value: &Value) -> Vec<f64> {
    value.as_array().expect("rows").iter().flat_map(list).collect()
}

pub(crate) fn square(value: &Value) -> Mat3<f64> {
    Mat3::from_row_slice(&flat(value))
}

/// Angular rows before linear ones.
pub(crate) fn angular_first(rows: &Value) -> Vec<f64> {
    let rows: Vec<_> = rows.as_array().expect("rows").iter().map(list).collect();
    [3, 4, 5, 0, 1, 2].iter().flat_map(|row| rows[*row].clone()).collect()
}

pub(crate) fn pose(value: &Value) -> Pose<f64> {
    let rows: Vec<_> = value.as_array().expect("rows").iter().map(list).collect();
    Pose { rotation: Mat3::from_fn(|row, column| rows[row][column]), position: Vec3::from_fn(|row, _| rows[row][3]) }
}

pub(crate) fn placement(value: &Value) -> Pose<f64> {
    Pose { rotation: square(&value["R"]), position: column(&value["p"]) }
}

pub(crate) fn inertia(link: &Value) -> Inertia<f64> {
    Inertia { mass: link["m"].as_f64().expect("a mass"), com: column(&link["com"]), about_com: square(&link["I_com"]) }
}

pub(crate) fn joint(value: &Value, links_before: i64) -> Joint<f64> {
    let kind = match value["type"].as_str() {
        Some("revolute") => JointKind::Revolute,
        Some("prismatic") => JointKind::Prismatic,
        other => panic!("{other:?} is no joint"),
    };
    let parent = value["parent"].as_i64().expect("a parent") - links_before;
    Joint {
        parent: usize::try_from(parent).ok(),
        axis: Axis { kind, direction: column(&value["axis"]) },
        placement: placement(&value["placement"]),
        inertia: inertia(&value["link"]),
    }
}

pub(crate) fn joints<const N: usize>(file: &Value) -> [Joint<f64>; N] {
    from_fn(|k| joint(&file["joints"][k], 0))
}

pub(crate) fn gravity(file: &Value) -> Vec3<f64> {
    column(&file["gravity_field"])
}
