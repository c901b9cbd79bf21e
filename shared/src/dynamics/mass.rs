//! The mass matrix by composite bodies, and the solution of its linear system.

use nalgebra::SMatrix;

use super::Vec3;
use super::newton_euler::Turns;
use crate::actuator::JointKind;
use crate::real::Real;
use crate::se::Wrench;
use crate::tree::{Body, Frame, Frames, Link, Symmetric, Tree, Turn, add_cross, add_scaled, cross, fused, rotated};

impl<T: Real> Body<T> {
    /// The same body expressed along the axes of the base about the base's origin.
    pub(super) fn in_base(&self, frame: &Frame<T>) -> Self {
        self.turned(&frame.rotation()).shifted(&frame.origin)
    }

    /// The same body in the frame that was turned by an angle about z to get this one.
    #[inline(always)]
    fn about_z(&self, sine: T, cosine: T) -> Self {
        let (x, y) = rotated(self.moment.x, self.moment.y, sine, cosine);
        let i = &self.inertia;
        let (xx, xy, yy) = rotated_square(i.xx, i.xy, i.yy, sine, cosine);
        let (xz, yz) = rotated(i.xz, i.yz, sine, cosine);
        Self {
            mass: self.mass,
            moment: Vec3::new(x, y, self.moment.z),
            inertia: Symmetric { xx, xy, yy, xz, yz, zz: i.zz },
        }
    }

    /// The same body in the frame that was turned by an angle about x to get this one.
    #[inline(always)]
    fn about_x(&self, sine: T, cosine: T) -> Self {
        let (y, z) = rotated(self.moment.y, self.moment.z, sine, cosine);
        let i = &self.inertia;
        let (yy, yz, zz) = rotated_square(i.yy, i.yz, i.zz, sine, cosine);
        let (xy, xz) = rotated(i.xy, i.xz, sine, cosine);
        Self {
            mass: self.mass,
            moment: Vec3::new(self.moment.x, y, z),
            inertia: Symmetric { xx: i.xx, xy, yy, xz, yz, zz },
        }
    }

    /// As [`about_x`](Self::about_x), for the sine ±1.
    #[inline(always)]
    fn quarter_about_x(&self, sine: T) -> Self {
        let (h, i) = (&self.moment, &self.inertia);
        Self {
            mass: self.mass,
            moment: Vec3::new(h.x, -h.z * sine, h.y * sine),
            inertia: Symmetric { xx: i.xx, xy: -i.xz * sine, yy: i.zz, xz: i.xy * sine, yz: -i.yz, zz: i.yy },
        }
    }

    /// The same body about a point that is at −p from this frame's origin.
    #[inline(always)]
    fn shifted(&self, p: &Vec3<T>) -> Self {
        let (h, i) = (&self.moment, &self.inertia);
        // With d = 2h + m·p, the shift adds (p·d)·1 − (p dᵀ + d pᵀ)/2.
        let moment = add_scaled(h, p, self.mass);
        let d = h + moment;
        let half = T::one() / (T::one() + T::one());
        let (py, pz) = (p.y * half, p.z * half);
        let (dy, dz) = (d.y * half, d.z * half);
        let (xx, yy, zz) = (p.x * d.x, p.y * d.y, p.z * d.z);
        Self {
            mass: self.mass,
            moment,
            inertia: Symmetric {
                xx: i.xx + (yy + zz),
                xy: fused(-p.x, dy, fused(-py, d.x, i.xy)),
                yy: i.yy + (xx + zz),
                xz: fused(-p.x, dz, fused(-pz, d.x, i.xz)),
                yz: fused(-p.y, dz, fused(-pz, d.y, i.yz)),
                zz: i.zz + (xx + yy),
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

    /// Angular and linear momentum of the body in a motion expressed where the body is.
    #[inline(always)]
    pub(super) fn momentum(&self, angular: &Vec3<T>, linear: &Vec3<T>) -> (Vec3<T>, Vec3<T>) {
        (self.inertia.times(angular) + self.moment.cross(linear), linear * self.mass + angular.cross(&self.moment))
    }
}

/// R·A·Rᵀ for the symmetric A of two by two and the rotation R of this sine and cosine.
#[inline(always)]
fn rotated_square<T: Real>(a: T, b: T, c: T, sine: T, cosine: T) -> (T, T, T) {
    let (apart, mixed, square) = (a - c, sine * cosine, sine * sine);
    let moved = fused(square, apart, (mixed + mixed) * b);
    (a - moved, fused(mixed, apart, (T::one() - (square + square)) * b), c + moved)
}

impl<T: Real> Link<T> {
    /// The momentum of `body` when the joint moves by one unit, all expressed in the link's frame about its origin.
    #[inline(always)]
    fn own_momentum(&self, body: &Body<T>) -> Wrench<T> {
        let (h, i, zero) = (&body.moment, &body.inertia, T::zero());
        match self.kind {
            JointKind::Revolute => Wrench { moment: Vec3::new(i.xz, i.yz, i.zz), force: Vec3::new(-h.y, h.x, zero) },
            JointKind::Prismatic => {
                Wrench { moment: Vec3::new(h.y, -h.x, zero), force: Vec3::new(zero, zero, body.mass) }
            }
        }
    }

    /// The part of a momentum or load that is along the joint.
    #[inline(always)]
    pub(super) fn along(&self, load: &Wrench<T>) -> T {
        match self.kind {
            JointKind::Revolute => load.moment.z,
            JointKind::Prismatic => load.force.z,
        }
    }

    /// A body given in the link's frame, expressed in the parent's.
    #[inline(always)]
    fn body_on_parent(&self, body: &Body<T>, q: T, sine: T, cosine: T) -> Body<T> {
        let body = match self.kind {
            JointKind::Revolute => body.about_z(sine, cosine),
            JointKind::Prismatic => *body,
        };
        match &self.turn {
            Turn::None => body,
            Turn::Quarter => body.quarter_about_x(T::one()),
            Turn::QuarterBack => body.quarter_about_x(-T::one()),
            Turn::AboutX { cosine, sine } => body.about_x(*sine, *cosine),
            Turn::Full(r) => body.turned(r),
        }
        .shifted(&self.origin_at(q))
    }

    /// The joint's unit motion, expressed along the axes of the base about the base's origin.
    #[inline(always)]
    pub(super) fn screw(&self, frame: &Frame<T>) -> (Vec3<T>, Vec3<T>) {
        match self.kind {
            JointKind::Revolute => (frame.z, cross(&frame.origin, &frame.z)),
            JointKind::Prismatic => (Vec3::zeros(), frame.z),
        }
    }
}

#[inline(always)]
fn own_bodies<T: Real, const N: usize>(tree: &Tree<T, N>) -> [Body<T>; N] {
    let mut bodies = [Body::none(); N];
    bodies.iter_mut().zip(&tree.links).for_each(|(body, link)| *body = link.body);
    bodies
}

/// Every link with all that it carries as one rigid body, expressed in the link's frame; and all links together, given in the
/// base's.
///
/// A body is carried to the next frame by two rotations about coordinate axes and one shift: no product of matrices.
#[inline(always)]
pub(super) fn composites<T: Real, const N: usize>(
    tree: &Tree<T, N>,
    q: &[T; N],
    turns: &Turns<T, N>,
) -> ([Body<T>; N], Body<T>) {
    let mut bodies = own_bodies(tree);
    let mut composite = Body::none();
    for (index, link) in tree.links.iter().enumerate().rev() {
        if let (Some(body), Some(q), Some((sine, cosine))) =
            (bodies.get(index).copied(), q.get(index), turns.get(index))
        {
            let carrier = bodies.get_mut(usize::from(link.parent)).unwrap_or(&mut composite);
            *carrier = carrier.joined(&link.body_on_parent(&body, *q, *sine, *cosine));
        }
    }
    (bodies, composite)
}

/// The momentum of what each joint carries when it moves by one unit, expressed along the axes of the base about its
/// origin.
pub(super) fn momenta<T: Real, const N: usize>(
    tree: &Tree<T, N>,
    frames: &Frames<T, N>,
    bodies: &[Body<T>; N],
) -> [(Vec3<T>, Vec3<T>); N] {
    let mut momenta = [(Vec3::zeros(), Vec3::zeros()); N];
    for (((momentum, link), frame), body) in momenta.iter_mut().zip(&tree.links).zip(frames.links()).zip(bodies) {
        let own = link.own_momentum(body);
        let along = frame.turn(&own.force);
        *momentum = (add_cross(&frame.turn(&own.moment), &frame.origin, &along), along);
    }
    momenta
}

/// M(q), N × N, kg·m², kg·m or kg: M_ij = Sᵢᵀ I_j S_j, the momentum along joint i of all that joint j carries when
/// joint j moves by one unit; zero when neither carries the other.
///
/// The composite-rigid-body algorithm in the frames of the links: it needs no [`Frames`].
#[inline]
pub fn mass_matrix<T: Real, const N: usize>(tree: &Tree<T, N>, q: &[T; N]) -> SMatrix<T, N, N> {
    let mut matrix = SMatrix::zeros();
    mass_matrix_into(tree, q, &mut matrix);
    matrix
}

/// [`mass_matrix`] into a matrix of the caller's.
pub fn mass_matrix_into<T: Real, const N: usize>(tree: &Tree<T, N>, q: &[T; N], matrix: &mut SMatrix<T, N, N>) {
    mass_of_joints(tree, q, &tree.turns(q), matrix);
}

/// Every column is walked from its joint inwards as soon as all that the joint carries is known: the machine overlaps
/// the walk with carrying that body on.
#[inline(always)]
pub(super) fn mass_of_joints<T: Real, const N: usize>(
    tree: &Tree<T, N>,
    q: &[T; N],
    turns: &Turns<T, N>,
    matrix: &mut SMatrix<T, N, N>,
) {
    let columns = &mut matrix.data.0;
    let mut bodies = own_bodies(tree);
    for j in (0..N).rev() {
        let (Some(first), Some(body)) = (tree.links.get(j), bodies.get(j).copied()) else { continue };
        let (mut i, mut link, mut momentum) = (j, first, first.own_momentum(&body));
        let mut column = [T::zero(); N];
        for _ in 0..N {
            if let Some(entry) = column.get_mut(i) {
                *entry = link.along(&momentum);
            }
            let parent = usize::from(link.parent);
            let (Some(next), Some(q), Some((sine, cosine))) = (tree.links.get(parent), q.get(i), turns.get(i)) else {
                break;
            };
            momentum = link.load_on_parent(&momentum, *q, *sine, *cosine);
            (i, link) = (parent, next);
        }
        if let Some(place) = columns.get_mut(j) {
            *place = column;
        }
        let parent = usize::from(first.parent);
        if let (Some(carrier), Some(q), Some((sine, cosine))) = (bodies.get_mut(parent), q.get(j), turns.get(j)) {
            *carrier = carrier.joined(&first.body_on_parent(&body, *q, *sine, *cosine));
        }
    }
    matrix.fill_lower_triangle_with_upper_triangle();
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
