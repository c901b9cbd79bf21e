//! Near a singularity: singular values of a Jacobian, its rank, manipulability, and the ellipsoids of motion and force.
//!
//! For a Jacobian J of R rows, ẋ = J q̇ maps the unit ball of joint rates to the manipulability ellipsoid, whose half axes
//! are the singular values of J along its left singular vectors; τ = Jᵀ F maps the force ellipsoid, with the inverse half
//! axes along the same directions, to the unit ball of joint torques. Rows of angle (rad) and of length (m) have different units:
//! pick the rows with [`rows`], or scale them, before comparing.
//! Source: T. Yoshikawa, Manipulability of Robotic Mechanisms, Int. J. of Robotics Research 4 (1985) 3.

use nalgebra::SMatrix;

use crate::real::{Real, real};
use crate::trig;

/// Sweeps over all pairs of rows: Jacobi's method converges quadratically, and six rows were never seen to need ten.
const SWEEPS: usize = 16;

/// The half axes of an ellipsoid in the space of R coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipsoid<T: Real, const R: usize> {
    /// Unit vectors along the half axes, one a column, as the lengths are ordered.
    pub axes: SMatrix<T, R, R>,
    /// Lengths of the half axes, the longest first.
    pub lengths: [T; R],
}

/// The rows of a matrix with the given numbers; a row that it does not have is zero.
pub fn rows<T: Real, const R: usize, const N: usize, const K: usize>(
    matrix: &SMatrix<T, R, N>,
    numbers: &[usize; K],
) -> SMatrix<T, K, N> {
    let mut picked = SMatrix::zeros();
    for (to, from) in picked.data.0.iter_mut().zip(&matrix.data.0) {
        for (entry, number) in to.iter_mut().zip(numbers) {
            *entry = from.get(*number).copied().unwrap_or(T::zero());
        }
    }
    picked
}

/// The manipulability ellipsoid { J q̇ : |q̇| ≤ 1 }: left singular vectors and singular values of J.
///
/// By Jacobi's method on the rows (one-sided, so that small values keep their digits).
pub fn manipulability_ellipsoid<T: Real, const R: usize, const N: usize>(
    jacobian: &SMatrix<T, R, N>,
) -> Ellipsoid<T, R> {
    let mut rows = jacobian.transpose().data.0;
    let mut axes = SMatrix::<T, R, R>::identity().data.0;
    for _ in 0..SWEEPS {
        let mut turned = false;
        for p in 0..R {
            for q in p + 1..R {
                turned |= rotate(&mut rows, &mut axes, p, q);
            }
        }
        if !turned {
            break;
        }
    }
    let lengths = rows.map(|row| trig::sqrt(dot(&row, &row)));
    sorted(axes, lengths)
}

/// The force ellipsoid { F : |JᵀF| ≤ 1 }, the longest half axis first; infinite along a direction that is lost.
pub fn force_ellipsoid<T: Real, const R: usize, const N: usize>(jacobian: &SMatrix<T, R, N>) -> Ellipsoid<T, R> {
    let motion = manipulability_ellipsoid(jacobian);
    let mut axes = motion.axes.data.0;
    let mut lengths = motion.lengths.map(|length| T::one() / length);
    axes.reverse();
    lengths.reverse();
    let mut matrix = SMatrix::zeros();
    matrix.data.0 = axes;
    Ellipsoid { axes: matrix, lengths }
}

/// The singular values of J, the largest first; zeros past the number of its columns.
pub fn singular_values<T: Real, const R: usize, const N: usize>(jacobian: &SMatrix<T, R, N>) -> [T; R] {
    manipulability_ellipsoid(jacobian).lengths
}

/// How many singular values are above `tolerance`.
pub fn rank<T: Real, const R: usize, const N: usize>(jacobian: &SMatrix<T, R, N>, tolerance: T) -> usize {
    singular_values(jacobian).iter().filter(|value| **value > tolerance).count()
}

/// The least singular value: how far, in the norm of matrices, J is from losing rank.
pub fn distance_to_singularity<T: Real, const R: usize, const N: usize>(jacobian: &SMatrix<T, R, N>) -> T {
    let values = singular_values(jacobian);
    R.min(N).checked_sub(1).and_then(|last| values.get(last).copied()).unwrap_or(T::zero())
}

/// Yoshikawa's manipulability √det(J Jᵀ), or √det(Jᵀ J) when J has fewer columns than rows: the product of the singular
/// values, in proportion to the volume of the manipulability ellipsoid.
pub fn manipulability<T: Real, const R: usize, const N: usize>(jacobian: &SMatrix<T, R, N>) -> T {
    singular_values(jacobian).iter().take(R.min(N)).fold(T::one(), |product, value| product * *value)
}

fn dot<T: Real, const N: usize>(a: &[T; N], b: &[T; N]) -> T {
    a.iter().zip(b).fold(T::zero(), |sum, (a, b)| sum + *a * *b)
}

/// Turns two rows so that they are orthogonal; whether they were not.
fn rotate<T: Real, const R: usize, const N: usize>(
    rows: &mut [[T; N]; R],
    axes: &mut [[T; R]; R],
    p: usize,
    q: usize,
) -> bool {
    let Ok([a, b]) = rows.get_disjoint_mut([p, q]) else { return false };
    let (aa, bb, ab) = (dot(a, a), dot(b, b), dot(a, b));
    if ab * ab <= aa * bb * T::default_epsilon() * T::default_epsilon() || ab == T::zero() {
        return false;
    }
    let zeta = (bb - aa) / (ab * real(2.0));
    let sign = if zeta < T::zero() { -T::one() } else { T::one() };
    let t = sign / (zeta * sign + trig::sqrt(T::one() + zeta * zeta));
    let c = T::one() / trig::sqrt(T::one() + t * t);
    let s = c * t;
    turn(a, b, c, s);
    if let Ok([a, b]) = axes.get_disjoint_mut([p, q]) {
        turn(a, b, c, s);
    }
    true
}

fn turn<T: Real, const N: usize>(a: &mut [T; N], b: &mut [T; N], c: T, s: T) {
    for (a, b) in a.iter_mut().zip(b) {
        (*a, *b) = (*a * c - *b * s, *a * s + *b * c);
    }
}

fn sorted<T: Real, const R: usize>(mut axes: [[T; R]; R], mut lengths: [T; R]) -> Ellipsoid<T, R> {
    for end in (1..R).rev() {
        for k in 0..end {
            if lengths.get(k) < lengths.get(k + 1) {
                lengths.swap(k, k + 1);
                axes.swap(k, k + 1);
            }
        }
    }
    let mut matrix = SMatrix::zeros();
    matrix.data.0 = axes;
    Ellipsoid { axes: matrix, lengths }
}
