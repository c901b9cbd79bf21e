//! Numbers, vectors and poses as Rust source, for models that lie in a chip's flash.

use darm_core::real::{Mat3, Vec3, to_f32};
use darm_core::se::Pose;

/// A pose as Rust source.
pub fn pose(pose: &Pose<f64>) -> String {
    format!("Pose {{ rotation: {}, position: {} }}", matrix(&pose.rotation), vector(&pose.position))
}

/// A vector as Rust source.
pub fn vector(v: &Vec3<f64>) -> String {
    format!("Vec3::new({}, {}, {})", number(v.x), number(v.y), number(v.z))
}

/// A matrix as Rust source: by rows, as its constructor takes them.
pub fn matrix(m: &Mat3<f64>) -> String {
    let rows: Vec<String> = m.transpose().iter().map(|x| number(*x)).collect();
    format!("Mat3::new({})", rows.join(", "))
}

/// A list of numbers as Rust source.
pub fn numbers(list: &[f64]) -> String {
    format!("[{}]", list.iter().map(|x| number(*x)).collect::<Vec<_>>().join(", "))
}

/// The nearest `f32`, with as many digits as identify it.
pub fn number(x: f64) -> String {
    match to_f32(x) {
        x if x.is_finite() => format!("{x:?}"),
        x if x > 0.0 => "f32::INFINITY".into(),
        _ => "f32::NEG_INFINITY".into(),
    }
}
