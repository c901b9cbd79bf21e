//! The Jacobian of the hand referred to the thumb's contact, in the five coordinates that each contact constrains.
//!
//! The thumb stays on its contact, so its joints move the rest of the hand instead: their columns act on all other
//! fingers with the sign reversed, and φ_T turns all of them about the thumb's contact normal.
//!
//! # The paper's 18 × 25 Jacobian
//!
//! With P = (p₁, r₁, p₂, r₂, p₃, r₃) and pᵢ = rᵢ + ρnᵢ the paper's J has rank 15 at most, for |pᵢ − rᵢ| is constant:
//! J = B·K, where K (15 × 25) says how rᵢ moves (3 rows) and nᵢ turns (2 rows, along tᵢ₁ and tᵢ₂ across nᵢ), and B has the
//! block (I, ρ\[t₁ t₂\]; I, 0) for each finger. Both have full rank, so J⁺ = K⁺B⁺ = Kᵀ(KKᵀ)⁻¹(BᵀB)⁻¹Bᵀ, and
//!
//! B⁺ΔP = (Δr + ½ρ(n·n* − 1)·n, t₁·n*, t₂·n*) for ΔP = P* − P,
//!
//! which needs a Cholesky factorisation of 15 × 15 numbers in place of a singular value decomposition of 18 × 25. Only
//! where K loses rank itself is the pseudo-inverse truncated by its singular values.

use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_robot::svd::svd;
use nalgebra::{SMatrix, SVector};

use super::contact::Contacts;
use super::hand::{Axis, Hand, Placed};
use super::layout::{ANGLES, COORDINATES, FINGERS, THUMB};

/// Constraints of the three fingers besides the thumb.
pub const ROWS: usize = 5 * (FINGERS - 1);
/// φ_T and the angles of all joints: Q of the paper.
pub const COLUMNS: usize = 1 + ANGLES;
/// K: rows (rᵢ along the palm's axes in m, nᵢ along the tip's x and y in rad) for index, medium and ring.
pub type Jacobian = SMatrix<f64, ROWS, COLUMNS>;
/// A step of φ_T and all angles, rad.
pub type Step = SVector<f64, COLUMNS>;
/// Five numbers for each of the three fingers.
pub type Rows = SVector<f64, ROWS>;

/// Singular values below this share of the largest are none.
const TRUNCATED: f64 = 1e-5;

/// K in one posture, expressed in the palm.
pub fn jacobian(placed: &Placed) -> Jacobian {
    let mut jacobian = Jacobian::zeros();
    let thumb = Axis { direction: placed.normal(THUMB), point: placed.tips[THUMB].position };
    for (i, tip) in placed.tips.iter().enumerate().take(THUMB) {
        let normal = placed.normal(i);
        let mut column = |k: usize, axis: &Axis, sign: f64| {
            jacobian.fixed_view_mut::<5, 1>(5 * i, k).copy_from(&slopes(tip, &normal, axis, sign));
        };
        column(0, &thumb, 1.0);
        for j in 0..COORDINATES {
            column(1 + COORDINATES * i + j, &placed.axes[COORDINATES * i + j], 1.0);
            column(1 + COORDINATES * THUMB + j, &placed.axes[COORDINATES * THUMB + j], -1.0);
        }
    }
    jacobian
}

/// How a tip moves, m/rad, and its normal turns across, rad/rad, about `axis`; where `sign` is −1, the other way.
fn slopes(tip: &Pose<f64>, normal: &Vec3<f64>, axis: &Axis, sign: f64) -> SVector<f64, 5> {
    let moved = axis.direction.cross(&(tip.position - axis.point)) * sign;
    let turned: Vec3<f64> = axis.direction.cross(normal) * sign;
    let across = |k: usize| tip.rotation.column(k).into_owned().dot(&turned);
    SVector::from([moved.x, moved.y, moved.z, across(0), across(1)])
}

impl Hand {
    /// B⁺ΔP for the requested contacts, expressed in the palm as `placed` is.
    pub fn paper_rows(&self, placed: &Placed, wanted: &Contacts) -> Rows {
        let mut rows = Rows::zeros();
        for (i, tip) in placed.tips.iter().enumerate().take(THUMB) {
            let rho = self.fingers[i].tip_radius_m;
            let (normal, direction) = (placed.normal(i), wanted[i].direction);
            let moved = wanted[i].center(rho) - tip.position + normal * (0.5 * rho * (normal.dot(&direction) - 1.0));
            rows.fixed_rows_mut::<3>(5 * i).copy_from(&moved);
            rows[5 * i + 3] = tip.rotation.column(0).dot(&direction);
            rows[5 * i + 4] = tip.rotation.column(1).dot(&direction);
        }
        rows
    }
}

/// K·Kᵀ: φ_T and the thumb's joints move all fingers, any other joint its own alone, so that most products are of zeros.
fn gram(jacobian: &Jacobian) -> SMatrix<f64, ROWS, ROWS> {
    let columns = &jacobian.data.0;
    let mut gram = SMatrix::<f64, ROWS, ROWS>::zeros();
    for column in columns.iter().take(1).chain(columns.iter().skip(1 + COORDINATES * THUMB)) {
        for (b, sums) in gram.data.0.iter_mut().enumerate() {
            // Above the diagonal too: a loop of constant length is the faster one.
            sums.iter_mut().zip(column).for_each(|(sum, part)| *sum += part * column[b]);
        }
    }
    for (k, column) in columns.iter().enumerate().skip(1).take(COORDINATES * THUMB) {
        let first = 5 * ((k - 1) / COORDINATES);
        let own: SVector<f64, 5> = SVector::from_column_slice(&column[first..first + 5]);
        let mut block = gram.fixed_view_mut::<5, 5>(first, first);
        block += own * own.transpose();
    }
    gram
}

/// K⁺·rows: the floor step that makes these changes, truncated where K has lost rank.
pub fn smallest_step(jacobian: &Jacobian, rows: &Rows) -> Step {
    let gram = gram(jacobian);
    let floor = TRUNCATED * TRUNCATED * gram.trace();
    if let Some(factor) = gram.cholesky()
        && factor.l_dirty().diagonal().iter().all(|pivot| pivot * pivot > floor)
    {
        return jacobian.tr_mul(&factor.solve(rows));
    }
    let step = svd(jacobian).and_then(|parts| parts.solve(rows, TRUNCATED * parts.singular_values.max()).ok());
    step.map_or_else(Step::zeros, |step| Step::from_iterator(step.iter().copied()))
}
