//! Masses of the links from the plates: those whose centre of pressure is the measured one.

use nalgebra::{DMatrix, DVector};

use super::groups::Groups;
use super::{CORNER_HZ, CopError};
use crate::motion::markers::Capture;
use crate::motion::placed::{dynamic, wrench};
use crate::motion::smooth::Smooth;
use crate::motion::trajectory::{Trajectory, TrajectoryError};
use darm_robot::robot::Robot;

/// The centre of pressure of a good model, m, and its weight as a share.
const GOOD: (f64, f64) = (0.004, 0.01);
/// A moment has the wrong sign when its centre of pressure is this far off, mm, and turned this share of it.
const TURNED: (f64, f64) = (60.0, 0.3);
/// No link is lighter than this share of the average one.
const LIGHTEST: f64 = 0.3;

/// A simulated centre of pressure.
pub(super) struct Simulated {
    pub(super) cop: Vec<[f64; 2]>,
    pub(super) error: CopError,
    /// Wrench of each group in each frame: Fz, Mx, My.
    parts: Vec<Vec<[f64; 3]>>,
}

pub(super) fn simulated(tree: &Robot, groups: &Groups, motion: &Trajectory, capture: &Capture) -> Simulated {
    let moving = dynamic(&motion.postures, &capture.time_s, CORNER_HZ, &tree.gravity);
    let mut parts = Vec::new();
    for frame in wrench(tree, &moving) {
        let mut of = vec![[0.0; 3]; groups.names.len()];
        for (own, group) in frame.iter().zip(&groups.of) {
            [5, 0, 1].iter().enumerate().for_each(|(k, &part)| of[*group][k] += own[part]);
        }
        parts.push(of);
    }
    let total = |frame: &Vec<[f64; 3]>| -> [f64; 3] { std::array::from_fn(|k| frame.iter().map(|part| part[k]).sum()) };
    let cop: Vec<[f64; 2]> = parts.iter().map(total).map(|[fz, mx, my]| [-my / fz, mx / fz]).collect();
    let apart = |(own, plate): (&[f64; 2], [f64; 2])| (own[0] - plate[0]).hypot(own[1] - plate[1]);
    let distances: Vec<f64> = cop.iter().zip(measured_cop(capture)).map(apart).collect();
    let square: f64 = distances.iter().map(|d| d * d).sum();
    let error = CopError {
        rms_m: (square / distances.len().max(1) as f64).sqrt(),
        worst_m: distances.iter().copied().fold(0.0, f64::max),
    };
    Simulated { cop, error, parts }
}

/// The measured centre of pressure, as slow as the simulated one.
pub fn measured_cop(capture: &Capture) -> Vec<[f64; 2]> {
    let smooth = Smooth::new(&capture.time_s, CORNER_HZ);
    let [x, y]: [Vec<f64>; 2] = std::array::from_fn(|k| smooth.pass(capture.plates.iter().map(|p| p.cop[k]).collect()));
    x.into_iter().zip(y).map(|(x, y)| [x, y]).collect()
}

impl Simulated {
    /// Whether the plates' moments have the sign that the motion asks for.
    pub(super) fn agrees(&self, capture: &Capture) -> Result<(), TrajectoryError> {
        let plates = measured_cop(capture);
        for (axis, column) in ["My", "Mx"].into_iter().enumerate() {
            let rms_mm = |sign: f64| {
                let square: f64 = self.cop.iter().zip(&plates).map(|(a, b)| (a[axis] - sign * b[axis]).powi(2)).sum();
                1e3 * (square / plates.len().max(1) as f64).sqrt()
            };
            let (off_mm, turned_mm) = (rms_mm(1.0), rms_mm(-1.0));
            if off_mm > TURNED.0 && turned_mm < TURNED.1 * off_mm {
                return Err(TrajectoryError::Turned { column, off_mm, turned_mm });
            }
        }
        Ok(())
    }

    /// Scales of the masses, in those of the general tree, whose centre of pressure and weight are the measured ones.
    pub(super) fn masses(&self, now: &[f64], capture: &Capture, spread: f64) -> Vec<f64> {
        let g = now.len();
        let smooth = Smooth::new(&capture.time_s, CORNER_HZ);
        let forces = smooth.pass(capture.plates.iter().map(|plate| plate.force_n).collect());
        let spread = spread.powi(-2);
        let mut matrix = DMatrix::from_diagonal_element(g, g, spread);
        let mut right = DVector::from_element(g, spread);
        let share = (self.parts.len() as f64 / 10.0).max(1.0);
        for ((parts, [x, y]), force) in self.parts.iter().zip(measured_cop(capture)).zip(&forces) {
            let row = |of: &dyn Fn(&[f64; 3]) -> f64| {
                DVector::from_iterator(g, parts.iter().zip(now).map(|(part, scale)| of(part) / scale))
            };
            // Neighbouring frames are not independent.
            let mut add = |row: DVector<f64>, value: f64, sigma: f64| {
                let weight = (sigma * sigma * share).recip();
                matrix += &row * row.transpose() * weight;
                right += row * (value * weight);
            };
            add(row(&|[fz, _, my]| (-my - x * fz) / force), 0.0, GOOD.0);
            add(row(&|[fz, mx, _]| (mx - y * fz) / force), 0.0, GOOD.0);
            add(row(&|[fz, ..]| fz / force), 1.0, GOOD.1);
        }
        let found = matrix.cholesky().map_or_else(|| DVector::from_element(g, 1.0), |factor| factor.solve(&right));
        found.iter().map(|scale| scale.max(LIGHTEST)).collect()
    }
}
