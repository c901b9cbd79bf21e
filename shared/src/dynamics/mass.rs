//! The mass matrix by composite bodies, and the solution of its linear system.

use nalgebra::SMatrix;

use super::Vec3;
use crate::actuator::JointKind;
use crate::real::Real;
use crate::tree::{Body, Frame, Frames, Link, Symmetric, Tree};

impl<T: Real> Body<T> {
    /// The same body told along the axes of the base about the base's origin.
    #[inline(always)]
    pub(super) fn in_base(&self, frame: &Frame<T>) -> Self {
        let p = &frame.origin;
        let h = frame.turn(&self.moment);
        let half = T::one() / (T::one() + T::one());
        // With d = h + m·p/2, the shift by p adds 2(p·d)·1 − (p dᵀ + d pᵀ).
        let d = h + p * (self.mass * half);
        let (xx, yy, zz) = (p.x * d.x, p.y * d.y, p.z * d.z);
        let (xx, yy, zz) = (xx + xx, yy + yy, zz + zz);
        let about = self.inertia.in_base(frame);
        Self {
            mass: self.mass,
            moment: h + p * self.mass,
            inertia: Symmetric {
                xx: about.xx + yy + zz,
                xy: about.xy - (p.x * d.y + p.y * d.x),
                yy: about.yy + xx + zz,
                xz: about.xz - (p.x * d.z + p.z * d.x),
                yz: about.yz - (p.y * d.z + p.z * d.y),
                zz: about.zz + xx + yy,
            },
        }
    }

    /// Two bodies fixed to each other.
    #[inline(always)]
    pub(super) fn joined(&self, other: &Self) -> Self {
        let (a, b) = (&self.inertia, &other.inertia);
        Self {
            mass: self.mass + other.mass,
            moment: self.moment + other.moment,
            inertia: Symmetric {
                xx: a.xx + b.xx,
                xy: a.xy + b.xy,
                yy: a.yy + b.yy,
                xz: a.xz + b.xz,
                yz: a.yz + b.yz,
                zz: a.zz + b.zz,
            },
        }
    }

    /// Angular and linear momentum of the body in a motion told where the body is.
    #[inline(always)]
    pub(super) fn momentum(&self, angular: &Vec3<T>, linear: &Vec3<T>) -> (Vec3<T>, Vec3<T>) {
        (self.inertia.times(angular) + self.moment.cross(linear), linear * self.mass + angular.cross(&self.moment))
    }
}

impl<T: Real> Symmetric<T> {
    /// R·I·Rᵀ for the axes R of `frame`.
    #[inline(always)]
    fn in_base(&self, frame: &Frame<T>) -> Self {
        let Frame { x, y, z, .. } = frame;
        // Columns of R·I; then the products of their rows with those of R.
        let a = x * self.xx + y * self.xy + z * self.xz;
        let b = x * self.xy + y * self.yy + z * self.yz;
        let c = x * self.xz + y * self.yz + z * self.zz;
        Self {
            xx: a.x * x.x + b.x * y.x + c.x * z.x,
            xy: a.y * x.x + b.y * y.x + c.y * z.x,
            yy: a.y * x.y + b.y * y.y + c.y * z.y,
            xz: a.z * x.x + b.z * y.x + c.z * z.x,
            yz: a.z * x.y + b.z * y.y + c.z * z.y,
            zz: a.z * x.z + b.z * y.z + c.z * z.z,
        }
    }
}

impl<T: Real> Link<T> {
    /// The joint's unit motion, told along the axes of the base about the base's origin.
    #[inline(always)]
    pub(super) fn screw(&self, frame: &Frame<T>) -> (Vec3<T>, Vec3<T>) {
        match self.kind {
            JointKind::Revolute => (frame.z, frame.origin.cross(&frame.z)),
            JointKind::Prismatic => (Vec3::zeros(), frame.z),
        }
    }
}

/// Every link with all that it carries as one rigid body, told in the base; and the whole tree.
#[inline(always)]
pub(super) fn composites<T: Real, const N: usize>(tree: &Tree<T, N>, frames: &Frames<T, N>) -> ([Body<T>; N], Body<T>) {
    let mut bodies = [Body::none(); N];
    for ((body, link), frame) in bodies.iter_mut().zip(&tree.links).zip(frames.links()) {
        *body = link.body.in_base(frame);
    }
    let mut whole = Body::none();
    for (index, link) in tree.links.iter().enumerate().rev() {
        if let Some(body) = bodies.get(index).copied() {
            let carrier = bodies.get_mut(usize::from(link.parent)).unwrap_or(&mut whole);
            *carrier = carrier.joined(&body);
        }
    }
    (bodies, whole)
}

/// M(q), N × N, kg·m², kg·m or kg: M_ij = Sᵢᵀ I_j S_j, the momentum along joint i of all that joint j carries when
/// joint j moves by one unit; zero when neither carries the other.
///
/// The composite-rigid-body algorithm, told in the base throughout, so that bodies add up without being moved.
pub fn mass_matrix<T: Real, const N: usize>(tree: &Tree<T, N>, frames: &Frames<T, N>) -> SMatrix<T, N, N> {
    let (bodies, _) = composites(tree, frames);
    let mut screws = [(Vec3::zeros(), Vec3::zeros()); N];
    for ((screw, link), frame) in screws.iter_mut().zip(&tree.links).zip(frames.links()) {
        *screw = link.screw(frame);
    }
    let mut matrix = SMatrix::<T, N, N>::zeros();
    for (j, body) in bodies.iter().enumerate() {
        let Some((angular, linear)) = screws.get(j) else { continue };
        let (about, along) = body.momentum(angular, linear);
        let mut i = j;
        for _ in 0..N {
            let (Some(link), Some((angular, linear))) = (tree.links.get(i), screws.get(i)) else { break };
            let entry = angular.dot(&about) + linear.dot(&along);
            set(&mut matrix, i, j, entry);
            set(&mut matrix, j, i, entry);
            i = usize::from(link.parent);
        }
    }
    matrix
}

#[inline(always)]
pub(super) fn set<T: Real, const N: usize>(matrix: &mut SMatrix<T, N, N>, row: usize, column: usize, value: T) {
    if let Some(entry) = matrix.data.0.get_mut(column).and_then(|column| column.get_mut(row)) {
        *entry = value;
    }
}

/// The solution x of M x = b for a symmetric positive definite M (L·D·Lᵀ without a root); `None` when it is singular.
pub fn solve<T: Real, const N: usize>(matrix: &SMatrix<T, N, N>, right: &[T; N]) -> Option<[T; N]> {
    let mut rows = matrix.data.0;
    let mut x = *right;
    let mut pivots = [T::zero(); N];
    for k in 0..N {
        let (above, rest) = rows.split_at_mut_checked(k + 1)?;
        let pivot_row = above.last()?;
        let pivot = *pivot_row.get(k)?;
        if pivot.partial_cmp(&T::zero()) != Some(core::cmp::Ordering::Greater) {
            return None;
        }
        *pivots.get_mut(k)? = pivot;
        let known = *x.get(k)?;
        for (row, value) in rest.iter_mut().zip(x.get_mut(k + 1..)?) {
            let factor = *row.get(k)? / pivot;
            for (entry, above) in row.iter_mut().zip(pivot_row).skip(k + 1) {
                *entry -= factor * *above;
            }
            *value -= factor * known;
        }
    }
    for k in (0..N).rev() {
        let row = rows.get(k)?;
        let sum = row.iter().zip(&x).skip(k + 1).fold(*x.get(k)?, |sum, (entry, x)| sum - *entry * *x);
        *x.get_mut(k)? = sum / *pivots.get(k)?;
    }
    Some(x)
}
