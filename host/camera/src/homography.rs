//! Homography of a plane: from points on it to where they are seen, by the normalised direct linear transform.
//!
//! Source: R. Hartley, IEEE PAMI 19 (1997) 580.

use darm_core::real::{Mat3, Vec2};
use nalgebra::{OMatrix, SVector, SymmetricEigen, U9};

/// The matrix H with seen ∝ H · (x, y, 1) that fits pairs (point of the plane, where it is seen) best; `None` of fewer than four
/// pairs, and of points on one line.
pub fn homography(pairs: &[(Vec2<f64>, Vec2<f64>)]) -> Option<Mat3<f64>> {
    if pairs.len() < 4 {
        return None;
    }
    let from_plane = normalisation(pairs.iter().map(|pair| pair.0))?;
    let from_seen = normalisation(pairs.iter().map(|pair| pair.1))?;
    let mut products = OMatrix::<f64, U9, U9>::zeros();
    for (on_plane, seen) in pairs {
        let [p, s] = [from_plane * on_plane.push(1.0), from_seen * seen.push(1.0)];
        let first = [p.x, p.y, p.z, 0.0, 0.0, 0.0, -s.x * p.x, -s.x * p.y, -s.x * p.z];
        let second = [0.0, 0.0, 0.0, p.x, p.y, p.z, -s.y * p.x, -s.y * p.y, -s.y * p.z];
        for row in [first, second].map(SVector::from) {
            products += row * row.transpose();
        }
    }
    let eigen = SymmetricEigen::try_new(products, f64::EPSILON, 0)?;
    // One direction of the nine is free; a second one means points on a line.
    let mut sizes: Vec<f64> = eigen.eigenvalues.iter().copied().collect();
    sizes.sort_by(f64::total_cmp);
    if sizes[1] <= 1e-12 * sizes[8] {
        return None;
    }
    let flat = eigen.eigenvectors.column(eigen.eigenvalues.imin());
    let normalised = Mat3::from_row_iterator(flat.iter().copied());
    let found = from_seen.try_inverse()? * normalised * from_plane;
    let scaled = found / found[(2, 2)];
    scaled.iter().all(|number| number.is_finite()).then_some(scaled)
}

/// The homography from the unit square to four points: (0, 0), (1, 0), (1, 1), (0, 1) to the first to the fourth. Entries that
/// are not finite where three of them are on a line.
///
/// Source: P. Heckbert, "Fundamentals of texture mapping and image warping", Berkeley 1989, 2.2.3.
pub fn of_unit_square([p0, p1, p2, p3]: &[Vec2<f64>; 4]) -> Mat3<f64> {
    let (right, down, sum) = (p1 - p2, p3 - p2, p0 - p1 + p2 - p3);
    let determinant = right.perp(&down);
    let (g, h) = (sum.perp(&down) / determinant, right.perp(&sum) / determinant);
    let (by_x, by_y) = (p1 - p0 + p1 * g, p3 - p0 + p3 * h);
    Mat3::from_columns(&[by_x.push(g), by_y.push(h), p0.push(1.0)])
}

/// Where a homography shows a point of the plane.
pub fn seen_at(homography: &Mat3<f64>, on_plane: &Vec2<f64>) -> Vec2<f64> {
    let seen = homography * on_plane.push(1.0);
    seen.xy() / seen.z
}

/// Moves points to the origin and scales them to a mean square distance of 2; `None` where they are one point.
fn normalisation(points: impl Iterator<Item = Vec2<f64>> + Clone) -> Option<Mat3<f64>> {
    let count = points.clone().count() as f64;
    let middle = points.clone().sum::<Vec2<f64>>() / count;
    let spread = (points.map(|point| (point - middle).norm_squared()).sum::<f64>() / count / 2.0).sqrt();
    let usable = spread > 0.0 && spread.is_finite();
    usable.then(|| Mat3::new(1.0, 0.0, -middle.x, 0.0, 1.0, -middle.y, 0.0, 0.0, spread).map(|entry| entry / spread))
}

#[cfg(test)]
mod tests {
    use darm_core::real::{Mat3, Vec2};

    use super::{homography, of_unit_square, seen_at};

    const SQUARE: [[f64; 2]; 5] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.3, 0.8]];

    #[test]
    fn four_or_more_points_give_the_homography_that_moved_them() {
        let truth = Mat3::new(300.0, 20.0, 640.0, -15.0, 310.0, 350.0, 0.2, -0.1, 1.0);
        let pairs: Vec<_> = SQUARE.map(|[x, y]| Vec2::new(x, y)).map(|p| (p, seen_at(&truth, &p))).into();
        for pairs in [&pairs[..4], &pairs] {
            let found = homography(pairs).unwrap();
            assert!((found - truth).abs().max() < 1e-6, "{found}");
        }
    }

    #[test]
    fn the_unit_square_is_shown_at_its_corners() {
        let corners = [[3.0, 4.0], [50.0, 9.0], [44.0, 60.0], [-2.0, 41.0]].map(|[x, y]| Vec2::new(x, y));
        let shown = of_unit_square(&corners);
        for ([x, y], corner) in [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].into_iter().zip(corners) {
            assert!((seen_at(&shown, &Vec2::new(x, y)) - corner).norm() < 1e-9);
        }
    }

    #[test]
    fn points_on_a_line_give_none() {
        let pairs: Vec<_> = (0..5).map(|k| f64::from(k) * Vec2::new(1.0, 2.0)).map(|point| (point, point)).collect();
        assert_eq!(homography(&pairs), None);
        assert_eq!(homography(&pairs[..3]), None);
    }
}
