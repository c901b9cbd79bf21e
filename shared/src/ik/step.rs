//! One step of each method: joint motions that take away an error, as far as the linearised arm goes.
//!
//! All take the Jacobian J (6 × N) and the error ε expressed as the Jacobian is. To hold radians equal to metres, or
//! to leave a component out, scale its row of both ([`scale`](super::scale)).

use nalgebra::SMatrix;

use crate::real::{Real, real};
use crate::se::Twist;
use crate::tree::fused;
use crate::tree::singular::manipulability_ellipsoid;

/// ε_Θ = J⁻¹ ε (rad or m); `None` when J has no inverse.
///
/// Rows of zeros, which no joint moves or which were left out, do not count; as many rows as joints have to be left.
/// By elimination with the largest pivot of a column.
pub fn inverse_step<T: Real, const N: usize>(jacobian: &SMatrix<T, 6, N>, error: &Twist<T>) -> Option<[T; N]> {
    let mut rows = [([T::zero(); N], T::zero()); N];
    let mut free = rows.iter_mut();
    for (number, right) in six(error).into_iter().enumerate() {
        let row = jacobian.data.0.map(|column| column.get(number).copied().unwrap_or(T::zero()));
        if row.iter().any(|entry| *entry != T::zero()) {
            *free.next()? = (row, right);
        }
    }
    if free.next().is_some() {
        return None;
    }
    for k in 0..N {
        let size = |row: &([T; N], T)| row.0.get(k).map_or(T::zero(), |entry| entry.abs());
        let mut largest = k;
        for index in k + 1..N {
            if size(rows.get(index)?) > size(rows.get(largest)?) {
                largest = index;
            }
        }
        rows.swap(k, largest);
        let (pivot_row, right) = *rows.get(k)?;
        let pivot = *pivot_row.get(k)?;
        if pivot.abs() <= T::default_epsilon() {
            return None;
        }
        for (index, (row, value)) in rows.iter_mut().enumerate() {
            let factor = *row.get(k)? / pivot;
            if index != k {
                row.iter_mut().zip(&pivot_row).for_each(|(entry, above)| *entry -= factor * *above);
                *value -= factor * right;
            }
        }
    }
    let mut step = [T::zero(); N];
    for (k, (step, (row, right))) in step.iter_mut().zip(&rows).enumerate() {
        *step = *right / *row.get(k)?;
    }
    Some(step)
}

/// ε_Θ = J⁺ ε (rad or m): of all steps that leave the least error the shortest.
///
/// From the singular values σ and left singular vectors u of J, J⁺ = Jᵀ Σ u uᵀ/σ² over those σ that rounding does not explain.
pub fn pseudo_inverse_step<T: Real, const N: usize>(jacobian: &SMatrix<T, 6, N>, error: &Twist<T>) -> [T; N] {
    let ellipsoid = manipulability_ellipsoid(jacobian);
    let [longest, ..] = ellipsoid.lengths;
    let floor = longest * T::default_epsilon() * real(64.0);
    let error = six(error);
    let mut force = [T::zero(); 6];
    for (axis, length) in ellipsoid.axes.data.0.iter().zip(&ellipsoid.lengths) {
        if *length > floor {
            let part = dot(axis, &error) / (*length * *length);
            force.iter_mut().zip(axis).for_each(|(force, axis)| *force += *axis * part);
        }
    }
    transposed(jacobian, &force)
}

/// ε_Θ = α Jᵀ ε (rad or m): the torques of a virtual force that pulls the tool to its target, with the α that leaves least of
/// the error, α = ⟨ε, J Jᵀ ε⟩ / |J Jᵀ ε|² (Buss 2004, eq. 8).
pub fn transpose_step<T: Real, const N: usize>(jacobian: &SMatrix<T, 6, N>, error: &Twist<T>) -> [T; N] {
    let error = six(error);
    let pull = transposed(jacobian, &error);
    let mut moved = [T::zero(); 6];
    for (column, pull) in jacobian.data.0.iter().zip(&pull) {
        moved.iter_mut().zip(column).for_each(|(moved, entry)| *moved += *entry * *pull);
    }
    let square = dot(&moved, &moved);
    let alpha = if square > T::zero() { dot(&error, &moved) / square } else { T::zero() };
    pull.map(|pull| pull * alpha)
}

/// ε_Θ = Jᵀ (J Jᵀ + μ 1)⁻¹ ε (rad or m): the step that makes |J ε_Θ − ε|² + μ |ε_Θ|² least, with μ = `damping` above zero.
#[inline]
pub fn damped_step<T: Real, const N: usize>(jacobian: &SMatrix<T, 6, N>, error: &Twist<T>, damping: T) -> [T; N] {
    let columns = &jacobian.data.0;
    let product = |i: usize, j: usize| {
        let of = |column: &[T; 6]| (column[i], column[j]);
        let first = columns.first().map(of).map_or(T::zero(), |(a, b)| a * b);
        columns.iter().skip(1).map(of).fold(first, |sum, (a, b)| fused(a, b, sum))
    };
    let mut matrix = [[T::zero(); 6]; 6];
    for (i, row) in matrix.iter_mut().enumerate() {
        for (j, entry) in row.iter_mut().enumerate().take(i + 1) {
            *entry = product(i, j);
        }
        row[i] += damping;
    }
    transposed(jacobian, &solved(matrix, six(error), damping))
}

/// The solution of A x = b from the lower triangle of the symmetric A, whose pivots are not below `least` (L·D·Lᵀ).
#[inline(always)]
#[expect(
    clippy::needless_range_loop,
    reason = "loops over numbers are unrolled, iterators are not: four times as fast"
)]
fn solved<T: Real>(mut a: [[T; 6]; 6], mut b: [T; 6], floor: T) -> [T; 6] {
    let mut inverse = [T::zero(); 6];
    for k in 0..6 {
        let pivot = if a[k][k] > floor { a[k][k] } else { floor };
        inverse[k] = T::one() / pivot;
        for i in k + 1..6 {
            let factor = a[i][k] * inverse[k];
            for j in k + 1..i + 1 {
                a[i][j] = fused(-factor, a[j][k], a[i][j]);
            }
            b[i] = fused(-factor, b[k], b[i]);
        }
    }
    for k in (0..6).rev() {
        b[k] *= inverse[k];
        for i in k + 1..6 {
            b[k] = fused(-(a[i][k] * inverse[k]), b[i], b[k]);
        }
    }
    b
}

/// Jᵀ F.
#[inline(always)]
fn transposed<T: Real, const N: usize>(jacobian: &SMatrix<T, 6, N>, force: &[T; 6]) -> [T; N] {
    let mut product = [T::zero(); N];
    for (entry, column) in product.iter_mut().zip(&jacobian.data.0) {
        *entry = dot(column, force);
    }
    product
}

#[inline(always)]
fn six<T: Real>(twist: &Twist<T>) -> [T; 6] {
    let (a, l) = (&twist.angular, &twist.linear);
    [a.x, a.y, a.z, l.x, l.y, l.z]
}

#[inline(always)]
fn dot<T: Real>(a: &[T; 6], b: &[T; 6]) -> T {
    a.iter().zip(b).fold(T::zero(), |sum, (a, b)| fused(*a, *b, sum))
}
