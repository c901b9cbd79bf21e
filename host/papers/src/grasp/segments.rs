//! The nearest points of two segments.
//!
//! Source: Ericson, Real-Time Collision Detection, 2005, section 5.1.9.

use darm_core::real::Vec3;

/// The nearest points of the segments a–b and c–d.
pub(super) fn nearest_points(a: &Vec3<f64>, b: &Vec3<f64>, c: &Vec3<f64>, d: &Vec3<f64>) -> [Vec3<f64>; 2] {
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
