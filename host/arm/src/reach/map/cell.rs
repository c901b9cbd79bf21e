//! Cells of a density, numbered along three axes.

use darm_core::real::Vec3;

/// A cell by its number along each axis; that around 0 is 0.
pub type Place = [i16; 3];

/// The vector amid a cell.
pub(super) fn amid(place: &Place, size: f64) -> Vec3<f64> {
    Vec3::from(*place).map(|number| f64::from(number) * size)
}

/// The cell that a vector lies in; `None` where its number is too large.
pub(super) fn place(vector: &Vec3<f64>, size: f64) -> Option<Place> {
    let cells = vector / size;
    let within = cells.amax() < f64::from(i16::MAX) - 1.0;
    within.then(|| [cells.x, cells.y, cells.z].map(|number| number.round() as i16))
}

/// Picks a number along each axis.
pub(super) fn each<A: Copy, B: Copy, C>(a: [A; 3], b: [B; 3], pick: impl Fn(A, B) -> C) -> [C; 3] {
    std::array::from_fn(|axis| pick(a[axis], b[axis]))
}
