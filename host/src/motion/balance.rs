//! Whether a motion keeps its balance: centre of mass and zero-moment point over what the ground bears.

use darm_core::real::Vec3;
use nalgebra::SVector;
use serde::Serialize;

/// A convex polygon on the ground.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Polygon {
    /// Its corners in order, x and y, m.
    pub corners: Vec<[f64; 2]>,
}

/// Balance of a motion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Balance {
    /// Zero-moment point of each frame, x and y, m.
    pub zmp_m: Vec<[f64; 2]>,
    /// The least distance of the zero-moment point from the edge of its polygon, over the frames; negative: outside. m
    pub zmp_margin_m: f64,
    /// Frame (from 1) where it is.
    pub zmp_frame: usize,
    /// The same of the centre of mass.
    pub com_margin_m: f64,
    /// Frame (from 1) where it is.
    pub com_frame: usize,
}

impl Polygon {
    /// The convex hull of these points: Andrew's chains.
    pub fn hull(points: &[[f64; 2]]) -> Self {
        let mut sorted = points.to_vec();
        sorted.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        let chain = |points: &mut dyn Iterator<Item = [f64; 2]>| {
            let mut chain: Vec<[f64; 2]> = Vec::new();
            for point in points {
                while let [.., a, b] = chain[..]
                    && turn(a, b, point) <= 0.0
                {
                    chain.pop();
                }
                chain.push(point);
            }
            chain.pop();
            chain
        };
        let mut corners = chain(&mut sorted.iter().copied());
        corners.extend(chain(&mut sorted.iter().rev().copied()));
        Self { corners }
    }

    /// Distance of a point from the nearest edge, m: positive inside, negative outside.
    pub fn margin(&self, point: [f64; 2]) -> f64 {
        let n = self.corners.len();
        let edge = |k: usize| {
            let (a, b) = (self.corners[k], self.corners[(k + 1) % n]);
            turn(a, b, point) / (b[0] - a[0]).hypot(b[1] - a[1]).max(f64::MIN_POSITIVE)
        };
        (0..n).map(edge).fold(f64::INFINITY, f64::min)
    }
}

fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// The balance of a motion on its feet, and on the chair too before `lift_off` (a frame from 0).
pub(super) fn balance(
    wrench: &[SVector<f64, 6>],
    com: &[Vec3<f64>],
    (feet, chair): (&[[f64; 2]], &[[f64; 2]]),
    lift_off: usize,
) -> Balance {
    let standing = Polygon::hull(feet);
    let sitting = Polygon::hull(&[feet, chair].concat());
    let zmp_m: Vec<[f64; 2]> = wrench.iter().map(|w| [-w[4] / w[2], w[3] / w[2]]).collect();
    let least = |at: &dyn Fn(usize) -> [f64; 2]| {
        let margin = |k: usize| (if k < lift_off { &sitting } else { &standing }).margin(at(k));
        (0..wrench.len()).map(|k| (margin(k), k + 1)).fold((f64::INFINITY, 0), |a, b| if b.0 < a.0 { b } else { a })
    };
    let (zmp_margin_m, zmp_frame) = least(&|k| zmp_m[k]);
    let (com_margin_m, com_frame) = least(&|k| [com[k].x, com[k].y]);
    Balance { zmp_margin_m, zmp_frame, com_margin_m, com_frame, zmp_m }
}
