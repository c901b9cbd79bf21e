//! Whether a motion keeps its balance: centre of mass and zero-moment point over what the ground bears, and how little the
//! centre of mass has to move so that the zero-moment point stays there.

use darm_core::real::Vec3;
use nalgebra::{DVector, SVector};
use serde::Serialize;

use super::banded::Banded;
use crate::convex_hull::{convex_hull, turn};

/// A plan keeps the zero-moment point this far from the edge of what bears it, m.
pub(super) const MARGIN_M: f64 = 0.03;
/// The feet alone bear a plan this long before the chair is left, s.
const LEAD_S: f64 = 0.1;
/// Turns in which a point is pulled inside the edges of a polygon.
const PULLS: usize = 20;
/// The axes cross an edge whose normal has this share along them at least.
const CROSSED: f64 = 0.3;

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
    /// The convex hull of these points.
    pub fn hull(points: &[[f64; 2]]) -> Self {
        Self { corners: convex_hull(points.to_vec()) }
    }

    /// Distance of a point from the nearest edge, m: positive inside, negative outside.
    pub fn margin(&self, point: [f64; 2]) -> f64 {
        self.edges(point).map(|(distance, _)| distance).fold(f64::INFINITY, f64::min)
    }

    /// The point, moved along these axes as little as brings it `margin` inside the edges that they cross.
    pub fn pulled_in(&self, point: [f64; 2], margin: f64, axes: [bool; 2]) -> [f64; 2] {
        let mut point = point;
        let along = |inwards: [f64; 2]| [0, 1].map(|k| if axes[k] { inwards[k] } else { 0.0 });
        for _ in 0..PULLS {
            let crossed = self.edges(point).map(|(distance, inwards)| (distance, along(inwards)));
            let short = crossed.filter(|(distance, [x, y])| *distance < margin && x.hypot(*y) > CROSSED);
            let Some((distance, [x, y])) = short.min_by(|a, b| a.0.total_cmp(&b.0)) else { break };
            let step = (margin - distance) / (x * x + y * y);
            point = [point[0] + step * x, point[1] + step * y];
        }
        point
    }

    /// Distance of a point from each edge, and the direction from there inwards.
    fn edges(&self, point: [f64; 2]) -> impl Iterator<Item = (f64, [f64; 2])> {
        let next = self.corners.iter().cycle().skip(1);
        self.corners.iter().zip(next).map(move |(&a, &b)| {
            let length = (b[0] - a[0]).hypot(b[1] - a[1]).max(f64::MIN_POSITIVE);
            (turn(a, b, point) / length, [(a[1] - b[1]) / length, (b[0] - a[0]) / length])
        })
    }
}

/// What bears a motion on its way.
pub(super) struct Support {
    feet: Polygon,
    sitting: Polygon,
    /// The first frame off the chair.
    lift_off: usize,
    /// Frames before it in which the feet alone shall bear.
    lead: usize,
}

impl Support {
    /// The feet, and the chair too before `lift_off` (a frame from 0).
    pub(super) fn new(feet: &[[f64; 2]], chair: &[[f64; 2]], lift_off: usize, step_s: f64) -> Self {
        let lead = (LEAD_S / step_s).round() as usize;
        Self { feet: Polygon::hull(feet), sitting: Polygon::hull(&[feet, chair].concat()), lift_off, lead }
    }

    fn at(&self, frame: usize) -> &Polygon {
        if frame < self.lift_off { &self.sitting } else { &self.feet }
    }

    /// How far the zero-moment point of each frame has to move to be [`MARGIN_M`] inside what bears it.
    pub(super) fn pulls(&self, zmp: &[[f64; 2]], axes: [bool; 2]) -> Vec<[f64; 2]> {
        let pull = |(frame, point): (usize, &[f64; 2])| {
            let inside = self.at(frame + self.lead).pulled_in(*point, MARGIN_M, axes);
            [inside[0] - point[0], inside[1] - point[1]]
        };
        zmp.iter().enumerate().map(pull).collect()
    }

    /// The balance of a motion with this centre of mass and zero-moment point.
    pub(super) fn balance(&self, zmp_m: Vec<[f64; 2]>, com: &[Vec3<f64>]) -> Balance {
        let minimum = |at: &dyn Fn(usize) -> [f64; 2]| {
            let margins = (0..zmp_m.len()).map(|k| (self.at(k).margin(at(k)), k + 1));
            margins.fold((f64::INFINITY, 0), |a, b| if b.0 < a.0 { b } else { a })
        };
        let (zmp_margin_m, zmp_frame) = minimum(&|k| zmp_m[k]);
        let (com_margin_m, com_frame) = minimum(&|k| [com[k].x, com[k].y]);
        Balance { zmp_margin_m, zmp_frame, com_margin_m, com_frame, zmp_m }
    }
}

/// Where the ground's wrench (moment first, about the world's origin) has no moment across, x and y, m.
pub(super) fn zmp(wrench: &SVector<f64, 6>) -> [f64; 2] {
    [-wrench[1] / wrench[5], wrench[0] / wrench[5]]
}

/// How the centre of mass moves so that the zero-moment point moves by `pull` in every frame, as that of a cart on a table does:
/// the a of a − c ä = pull, at rest at both ends, with c the height of the centre of mass over gravity, s².
pub(super) fn cart(pull: &[f64], step_s: f64, c: f64) -> Option<Vec<f64>> {
    let (n, bend) = (pull.len(), c / (step_s * step_s));
    let mut matrix = Banded::zeros(n, 1);
    for k in 0..n {
        matrix.add(k, k, 1.0);
        if k > 0 {
            matrix.add(k, k, bend);
            matrix.add(k - 1, k - 1, bend);
            matrix.add(k, k - 1, -bend);
        }
    }
    Some(matrix.solve(DVector::from_column_slice(pull))?.iter().copied().collect())
}
