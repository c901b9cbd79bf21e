//! Whether parts of the hand touch: capsules, and how near each pair of them comes.
//!
//! The distance of two capsules is that of two segments less both radii, which is all that is needed of a collision
//! library here; its gradient comes from the two nearest points, which the solver takes as a constraint.
//! Source of the segments' nearest points: Ericson, Real-Time Collision Detection, 2005, section 5.1.9.

use darm_core::real::Vec3;
use darm_core::se::Pose;

use super::hand::{Hand, JOINTS, Links};

/// A segment with a radius, fixed to a link or to the palm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    /// The link, numbered finger by finger; `None`: the palm.
    pub link: Option<usize>,
    /// One end of the segment in the frame of the link, m.
    pub from: Vec3<f64>,
    /// The other end.
    pub to: Vec3<f64>,
    /// Radius, m.
    pub radius_m: f64,
}

/// Two capsules, by their numbers, that must not touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pair {
    /// The one.
    pub first: usize,
    /// The other.
    pub second: usize,
}

/// How near two capsules are, told in the palm.
#[derive(Clone, Copy, Debug)]
pub struct Gap {
    /// Which two.
    pub pair: Pair,
    /// Distance of their surfaces, m; below zero they overlap.
    pub distance_m: f64,
    /// The nearest points of the two segments.
    pub points: [Vec3<f64>; 2],
}

impl Capsule {
    /// The ends of the segment in the palm, for one posture.
    pub fn ends(&self, links: &Links) -> [Vec3<f64>; 2] {
        let pose = self.link.map_or(Pose::identity(), |link| links[link]);
        [pose * self.from, pose * self.to]
    }

    /// The finger that it belongs to, and its joints between the palm and the capsule; the palm has none.
    pub fn joints(&self) -> Option<(usize, usize)> {
        self.link.map(|link| (link / JOINTS, link % JOINTS + 1))
    }
}

impl Hand {
    /// Calls `visit` with each pair nearer than `margin_m`.
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

/// The pairs of capsules of different links that are apart in this posture.
pub(super) fn pairs(capsules: &[Capsule], links: &Links) -> Vec<Pair> {
    let apart = |a: &Capsule, b: &Capsule| {
        let ([p, q], [r, s]) = (a.ends(links), b.ends(links));
        let [x, y] = nearest_points(&p, &q, &r, &s);
        (x - y).norm() > a.radius_m + b.radius_m
    };
    let all = (0..capsules.len()).flat_map(|second| (0..second).map(move |first| Pair { first, second }));
    all.filter(|pair| {
        let (a, b) = (&capsules[pair.first], &capsules[pair.second]);
        a.link != b.link && apart(a, b)
    })
    .collect()
}

/// The nearest points of the segments a–b and c–d.
fn nearest_points(a: &Vec3<f64>, b: &Vec3<f64>, c: &Vec3<f64>, d: &Vec3<f64>) -> [Vec3<f64>; 2] {
    let (u, v, w) = (b - a, d - c, a - c);
    let (uu, vv, uv, uw, vw) = (u.dot(&u), v.dot(&v), u.dot(&v), u.dot(&w), v.dot(&w));
    let share = |top: f64, bottom: f64| if bottom > f64::MIN_POSITIVE { (top / bottom).clamp(0.0, 1.0) } else { 0.0 };
    // Parallel segments have many nearest points: any start will do.
    let s = share(uv * vw - uw * vv, uu * vv - uv * uv);
    let t = share(uv * s + vw, vv);
    let s = share(uv * t - uw, uu);
    [a + u * s, c + v * t]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::{prop_assert, proptest};

    fn point([x, y, z]: [f64; 3]) -> Vec3<f64> {
        Vec3::new(x, y, z)
    }

    #[test]
    fn parallel_crossing_and_empty_segments_have_nearest_points() {
        let apart = |a, b, c, d| {
            let [p, q] = nearest_points(&point(a), &point(b), &point(c), &point(d));
            (p - q).norm()
        };
        assert_eq!(apart([0.0; 3], [1.0, 0.0, 0.0], [0.5, 2.0, 0.0], [3.0, 2.0, 0.0]), 2.0);
        assert_eq!(apart([-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.5], [0.0, 1.0, 0.5]), 0.5);
        assert_eq!(apart([0.0; 3], [0.0; 3], [0.0, 3.0, 4.0], [0.0, 3.0, 4.0]), 5.0);
    }

    proptest! {
        #[test]
        fn no_other_points_of_two_segments_are_nearer(ends in proptest::array::uniform4(proptest::array::uniform3(-1.0..1.0f64))) {
            let [a, b, c, d] = ends.map(point);
            let [p, q] = nearest_points(&a, &b, &c, &d);
            for i in 0..=20 {
                for j in 0..=20 {
                    let other = (a + (b - a) * (f64::from(i) / 20.0)) - (c + (d - c) * (f64::from(j) / 20.0));
                    prop_assert!((p - q).norm() <= other.norm() + 1e-12);
                }
            }
        }
    }
}
