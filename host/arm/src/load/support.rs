//! The support function of a set of directions: for a vector, the largest product with any of them, and never less.
//!
//! It is tabulated at the nodes of a grid on the six faces of a cube. A vector goes through a cell of a face at a point that is
//! a convex combination of the four corners of the cell, with the weights of bilinear interpolation. The support function is convex, so
//! the interpolated value is an upper bound. It exceeds the function by the order of the square of a cell: by a thousandth.

use darm_core::real::Vec3;
use rayon::prelude::*;

/// Cells along an edge of the cube.
const CELLS: usize = 32;
const NODES: usize = CELLS + 1;

/// An upper bound that is convex and grows with the length of the vector.
pub(super) struct Support {
    /// By face, row and column.
    values: Vec<f64>,
}

impl Support {
    /// The bound of a function that gives the largest product, or more.
    pub(super) fn new(largest: impl Fn(&Vec3<f64>) -> f64 + Sync) -> Self {
        let nodes = (0..6 * NODES * NODES).into_par_iter();
        Self { values: nodes.map(|number| largest(&node(number))).collect() }
    }

    /// What no product with `vector` exceeds.
    pub(super) fn bound(&self, vector: &Vec3<f64>) -> f64 {
        let axis = vector.iamax();
        let size = vector[axis].abs();
        if size == 0.0 {
            return 0.0;
        }
        let face = 2 * axis + usize::from(vector[axis] < 0.0);
        let [(row, up), (column, right)] = [1, 2].map(|next| {
            let place = 0.5 * (vector[(axis + next) % 3] / size + 1.0) * CELLS as f64;
            let cell = (place as usize).min(CELLS - 1);
            (cell, place - cell as f64)
        });
        let value = |row: usize, column: usize| self.values[(face * NODES + row) * NODES + column];
        let below = (1.0 - right) * value(row, column) + right * value(row, column + 1);
        let above = (1.0 - right) * value(row + 1, column) + right * value(row + 1, column + 1);
        size * ((1.0 - up) * below + up * above)
    }
}

/// The node with this number, on the cube from −1 to 1.
fn node(number: usize) -> Vec3<f64> {
    let (face, row, column) = (number / (NODES * NODES), number / NODES % NODES, number % NODES);
    let along = |cell: usize| 2.0 * cell as f64 / CELLS as f64 - 1.0;
    let (axis, mut node) = (face / 2, Vec3::zeros());
    node[axis] = if face.is_multiple_of(2) { 1.0 } else { -1.0 };
    node[(axis + 1) % 3] = along(row);
    node[(axis + 2) % 3] = along(column);
    node
}

#[cfg(test)]
mod tests {
    use darm_core::real::Vec3;
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    use super::Support;

    #[test]
    fn the_bound_is_never_below_and_hardly_above() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut random = || Vec3::from_fn(|_, _| rng.random_range(-1.0..1.0));
        let directions: Vec<Vec3<f64>> = (0..40).map(|_| random().normalize()).collect();
        let largest =
            |vector: &Vec3<f64>| directions.iter().map(|direction| direction.dot(vector)).fold(f64::MIN, f64::max);
        let support = Support::new(largest);
        for _ in 0..2000 {
            let vector = random() * 7.0;
            let above = support.bound(&vector) - largest(&vector);
            assert!((-1e-12..0.04 * vector.norm()).contains(&above), "{vector} {above}");
        }
        assert_eq!(support.bound(&Vec3::zeros()), 0.0);
    }
}
