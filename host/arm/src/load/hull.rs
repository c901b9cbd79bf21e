//! The vertices of the convex hull of points: those that are the farthest in some direction.
//!
//! A point that is inside the hull of the vertices found so far is none; for any other a plane separates it from them, and the
//! point that is the farthest along the normal of the plane is the next vertex (Clarkson, More output-sensitive geometric
//! algorithms, FOCS 1994). Whether a point is inside is decided by the point of the hull that is the nearest to it (Wolfe,
//! Finding the nearest point in a polytope, Mathematical Programming 11, 1976), so that points on a line or in a plane need no
//! case of their own. Where rounding leaves it open, the point counts as a vertex, which is one too many and changes no maximum.

use darm_core::real::{Mat3, Vec3};
use darm_core::units::Word;

/// Points closer to the hull than this share of their size count as inside.
const TOLERANCE: f64 = 1e-10;
/// Steps of the search for the nearest point; it ends by itself after a few.
const MAX_STEPS: usize = 64;

/// A point, and the digits that bring it about.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Point {
    pub(super) at: Vec3<f64>,
    pub(super) word: Word,
}

/// The vertices of the convex hull of `points`.
pub(super) fn vertices(points: &[Point]) -> Vec<Point> {
    let size = points.iter().fold(0.0, |size: f64, point| size.max(point.at.norm()));
    let mut found: Vec<Point> = Vec::new();
    let sign = |k: usize| k as f64 - 1.0;
    let directions = (0..27).map(|k| Vec3::new(sign(k % 3), sign(k / 3 % 3), sign(k / 9)));
    for direction in directions.filter(|direction| *direction != Vec3::zeros()) {
        found.extend(farthest(points, &direction).filter(|point| !found.contains(point)));
    }
    // Few vertices suffice for most points, and are soon looked at.
    let coarse = found.clone();
    for point in points {
        if let Side::Inside = side(&point.at, &coarse, TOLERANCE * size) {
            continue;
        }
        loop {
            match side(&point.at, &found, TOLERANCE * size) {
                Side::Inside => break,
                Side::Open => {
                    found.push(*point);
                    break;
                }
                Side::Outside { normal } => {
                    let next = farthest(points, &normal).filter(|next| !found.contains(next));
                    let is_itself = next.is_none_or(|next| next == *point);
                    found.push(next.unwrap_or(*point));
                    if is_itself {
                        break;
                    }
                }
            }
        }
    }
    found
}

fn farthest(points: &[Point], direction: &Vec3<f64>) -> Option<Point> {
    points.iter().max_by(|a, b| a.at.dot(direction).total_cmp(&b.at.dot(direction))).copied()
}

/// Where a point is, seen from a convex hull.
enum Side {
    Inside,
    /// The point is farther along the normal than all of the hull.
    Outside {
        normal: Vec3<f64>,
    },
    /// Rounding does not let it be decided.
    Open,
}

fn side(point: &Vec3<f64>, hull: &[Point], tolerance: f64) -> Side {
    let Some(first) = hull.first() else { return Side::Open };
    // The corners of the simplex that the nearest point is in, and the shares of them that give it, all from `point`.
    let (mut corners, mut shares) = (vec![first.at - point], vec![1.0]);
    for _ in 0..MAX_STEPS {
        let nearest = weighted(&corners, &shares);
        if nearest.norm() <= tolerance {
            return Side::Inside;
        }
        let along = |corner: &Vec3<f64>| nearest.dot(corner);
        let next = hull.iter().map(|other| other.at - point).min_by(|a, b| along(a).total_cmp(&along(b)));
        let Some(next) = next else { return Side::Open };
        if along(&next) > 0.0 {
            return Side::Outside { normal: -nearest };
        }
        corners.push(next);
        shares.push(0.0);
        if reduce(&mut corners, &mut shares).is_none() {
            return Side::Open;
        }
    }
    Side::Open
}

fn weighted(corners: &[Vec3<f64>], shares: &[f64]) -> Vec3<f64> {
    corners.iter().zip(shares).fold(Vec3::zeros(), |sum, (corner, share)| sum + corner * *share)
}

/// Drops corners until the point of their plane that is the nearest to the origin is among them; `shares` gives it. `None` where
/// rounding does not let it be computed.
fn reduce(corners: &mut Vec<Vec3<f64>>, shares: &mut Vec<f64>) -> Option<()> {
    loop {
        let best = nearest_shares(corners)?;
        if best.iter().all(|share| *share > 0.0) {
            *shares = best;
            return Some(());
        }
        // As far towards the best shares as none falls below zero.
        let until = shares.iter().zip(&best).filter(|(_, best)| **best <= 0.0);
        let step = until.map(|(share, best)| share / (share - best)).fold(1.0, f64::min);
        shares.iter_mut().zip(&best).for_each(|(share, best)| *share += step * (best - *share));
        let smallest = (0..shares.len()).min_by(|&a, &b| shares[a].total_cmp(&shares[b]))?;
        corners.remove(smallest);
        shares.remove(smallest);
    }
}

/// The shares, of sum one, of the point nearest to the origin in the plane of at most four corners.
fn nearest_shares(corners: &[Vec3<f64>]) -> Option<Vec<f64>> {
    let (first, others) = corners.split_first()?;
    if others.len() > 3 {
        return None;
    }
    let edge = |k: usize| others.get(k).map(|corner| corner - first);
    // The equations of an edge that is not there are 1·share = 0.
    let normal = Mat3::from_fn(|row, column| match (edge(row), edge(column)) {
        (Some(a), Some(b)) => a.dot(&b),
        _ => f64::from(u8::from(row == column)),
    });
    let right = Vec3::from_fn(|row, _| edge(row).map_or(0.0, |edge| -edge.dot(first)));
    let of_others = normal.lu().solve(&right)?;
    let of_first = 1.0 - of_others.iter().sum::<f64>();
    let shares: Vec<f64> = [of_first].into_iter().chain(of_others.iter().copied().take(others.len())).collect();
    shares.iter().all(|share| share.is_finite()).then_some(shares)
}

#[cfg(test)]
mod tests {
    use darm_core::real::Vec3;
    use darm_core::units::Word;
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    use super::{Point, vertices};

    fn points(at: impl IntoIterator<Item = Vec3<f64>>) -> Vec<Point> {
        at.into_iter().map(|at| Point { at, word: Word::default() }).collect()
    }

    #[test]
    fn a_box_has_its_corners_however_flat_it_is() {
        for [depth, height] in [[1.0, 1.0], [1.0, 0.0], [0.0, 0.0]] {
            let step = |k: usize| [0.0, 0.5, 1.0][k];
            let grid = (0..27).map(|k| Vec3::new(step(k % 3), depth * step(k / 3 % 3), height * step(k / 9)));
            let found = vertices(&points(grid));
            let is_corner = |point: &Point| point.at.iter().all(|x| *x == 0.0 || *x == 1.0);
            let corners = 2 << (usize::from(depth > 0.0) + usize::from(height > 0.0));
            assert_eq!((found.len(), found.iter().all(is_corner)), (corners, true), "{found:?}");
        }
    }

    #[test]
    fn no_point_is_farther_in_any_direction() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut random = || Vec3::from_fn(|_, _| rng.random_range(-1.0..1.0));
        let all = points((0..2000).map(|_| random()));
        let found = vertices(&all);
        assert!(found.len() < 200, "{}", found.len());
        for _ in 0..200 {
            let direction = random();
            let largest =
                |points: &[Point]| points.iter().map(|point| point.at.dot(&direction)).fold(f64::MIN, f64::max);
            assert!(largest(&all) - largest(&found) < 1e-9);
        }
    }
}
