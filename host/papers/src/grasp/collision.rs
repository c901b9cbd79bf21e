//! Whether parts of the hand touch, and how near each pair of capsules comes.
//!
//! The distance of two capsules is that of two segments less both radii; its gradient comes from the two nearest points,
//! which the solver takes as a constraint.

use darm_core::real::Vec3;

use super::hand::{Hand, Links, Pair};
use super::segments::nearest_points;

/// How near two capsules are, in the frame of the palm.
#[derive(Clone, Copy, Debug)]
pub struct Gap {
    /// Which two.
    pub pair: Pair,
    /// Distance of their surfaces, m; below zero they overlap.
    pub distance_m: f64,
    /// The nearest points of the two segments.
    pub points: [Vec3<f64>; 2],
}

impl Hand {
    /// Calls `visit` with each pair closer than `margin_m`.
    pub fn near(&self, links: &Links, margin_m: f64, mut visit: impl FnMut(Gap)) {
        let ends: Vec<_> = self.capsules.iter().map(|capsule| capsule.ends(links)).collect();
        for pair in &self.pairs {
            let radii = self.capsules[pair.first].radius_m + self.capsules[pair.second].radius_m;
            let ([a, b], [c, d]) = (ends[pair.first], ends[pair.second]);
            // Spheres around both segments first: most pairs are far apart.
            let reach = 2.0 * (radii + margin_m);
            let between = (a + b - c - d).norm_squared();
            let lengths = (b - a).norm_squared().sqrt() + (d - c).norm_squared().sqrt();
            if between > (reach + lengths).powi(2) {
                continue;
            }
            let points = nearest_points(&a, &b, &c, &d);
            let distance_m = (points[0] - points[1]).norm() - radii;
            if distance_m < margin_m {
                visit(Gap { pair: *pair, distance_m, points });
            }
        }
    }

    /// The deepest overlap or, where nothing touches, `None`.
    pub fn collision(&self, links: &Links) -> Option<Gap> {
        let mut deepest: Option<Gap> = None;
        self.near(links, 0.0, |gap| {
            if deepest.is_none_or(|known| gap.distance_m < known.distance_m) {
                deepest = Some(gap);
            }
        });
        deepest
    }
}
