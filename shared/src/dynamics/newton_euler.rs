//! Inverse dynamics by Newton's and Euler's equations: outwards the motion of every link, inwards the loads on it.

use super::Vec3;
use crate::actuator::JointKind;
use crate::real::{Real, real};
use crate::se::Wrench;
use crate::tree::{Body, Link, Tree, add_cross, add_scaled, dot, fused, rotated};

/// How a link moves, expressed in its own frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion<T: Real> {
    /// ω, rad/s.
    pub(crate) angular: Vec3<T>,
    /// dω/dt, rad/s².
    pub(crate) angular_rate: Vec3<T>,
    /// Acceleration of the origin less that of free fall, m/s².
    pub(crate) linear_rate: Vec3<T>,
    /// \[ω̇\] + \[ω\]², by rows: times r, how the acceleration of the point at r differs from the origin's.
    pub(crate) spin: [Vec3<T>; 3],
}

/// Sine and cosine of the angles of all joints.
pub(crate) type Turns<T, const N: usize> = [(T, T); N];

impl<T: Real> Motion<T> {
    #[inline(always)]
    pub(crate) fn new(angular: Vec3<T>, angular_rate: Vec3<T>, linear_rate: Vec3<T>) -> Self {
        let (w, r) = (&angular, &angular_rate);
        let (xx, yy) = (-(w.x * w.x), w.y * w.y);
        let spin = [
            Vec3::new(fused(-w.z, w.z, -yy), fused(w.x, w.y, -r.z), fused(w.x, w.z, r.y)),
            Vec3::new(fused(w.x, w.y, r.z), fused(-w.z, w.z, xx), fused(w.y, w.z, -r.x)),
            Vec3::new(fused(w.x, w.z, -r.y), fused(w.y, w.z, r.x), xx - yy),
        ];
        Self { angular, angular_rate, linear_rate, spin }
    }

    /// \[ω̇\]·r + \[ω\]²·r.
    #[inline(always)]
    pub(crate) fn spin(&self, r: &Vec3<T>) -> Vec3<T> {
        let [x, y, z] = &self.spin;
        Vec3::new(dot(x, r), dot(y, r), dot(z, r))
    }

    /// The load that makes `body` move so, about the frame's origin: F = m·v̇_C, N = I·ω̇ + ω × I·ω.
    #[inline(always)]
    pub(super) fn load(&self, body: &Body<T>) -> Wrench<T> {
        let force = add_scaled(&self.spin(&body.moment), &self.linear_rate, body.mass);
        let moment = body.inertia.times(&self.angular_rate);
        let moment = add_cross(&moment, &self.angular, &body.inertia.times(&self.angular));
        let moment = add_cross(&moment, &body.moment, &self.linear_rate);
        Wrench { moment, force }
    }
}

impl<T: Real> Link<T> {
    /// Directions of the link's frame, expressed in the parent's.
    #[inline(always)]
    fn outward(&self, vectors: [Vec3<T>; 2], sine: T, cosine: T) -> [Vec3<T>; 2] {
        let turned = match self.kind {
            JointKind::Revolute => vectors.map(|v| {
                let (x, y) = rotated(v.x, v.y, sine, cosine);
                Vec3::new(x, y, v.z)
            }),
            JointKind::Prismatic => vectors,
        };
        self.turn.outward(&turned)
    }

    /// Where the link's origin is, expressed in the parent's frame.
    #[inline(always)]
    pub(super) fn origin_at(&self, q: T) -> Vec3<T> {
        match self.kind {
            JointKind::Revolute => self.origin,
            JointKind::Prismatic => {
                let [slid] = self.turn.outward(&[Vec3::new(T::zero(), T::zero(), q)]);
                self.origin + slid
            }
        }
    }

    /// The motion of the link on a parent that moves with `parent`: the outward equations of the lecture.
    #[inline(always)]
    fn moving(&self, parent: &Motion<T>, state: [T; 3], sine: T, cosine: T) -> Motion<T> {
        let [x, y, z] = &parent.spin;
        let (p, a) = (&self.origin, &parent.linear_rate);
        let linear = Vec3::new(
            fused(x.z, p.z, fused(x.y, p.y, fused(x.x, p.x, a.x))),
            fused(y.z, p.z, fused(y.y, p.y, fused(y.x, p.x, a.y))),
            fused(z.z, p.z, fused(z.y, p.y, fused(z.x, p.x, a.z))),
        );
        self.driven(self.turn.inward(&[parent.angular, parent.angular_rate, linear]), state, sine, cosine)
    }

    /// As [`moving`](Self::moving), on a base that does not turn.
    #[inline(always)]
    fn moving_on_still(&self, linear_rate: &Vec3<T>, [q, qd, qdd]: [T; 3], sine: T, cosine: T) -> Motion<T> {
        let [linear] = self.turn.inward(&[*linear_rate]);
        let zero = T::zero();
        match self.kind {
            JointKind::Revolute => {
                let (x, y) = rotated(linear.x, linear.y, -sine, cosine);
                let along = |value| Vec3::new(zero, zero, value);
                Motion::new(along(qd), along(qdd), Vec3::new(x, y, linear.z))
            }
            JointKind::Prismatic => self.driven([Vec3::zeros(), Vec3::zeros(), linear], [q, qd, qdd], sine, cosine),
        }
    }

    /// The motion of the link when its joint's own frame moves with (ω, ω̇, v̇).
    #[inline(always)]
    fn driven(&self, still: [Vec3<T>; 3], [q, qd, qdd]: [T; 3], sine: T, cosine: T) -> Motion<T> {
        let [w, r, a] = match self.kind {
            JointKind::Revolute => {
                let [w, r, a] = still.map(|v| {
                    let (x, y) = rotated(v.x, v.y, -sine, cosine);
                    Vec3::new(x, y, v.z)
                });
                let rate = Vec3::new(fused(w.y, qd, r.x), fused(-w.x, qd, r.y), r.z + qdd);
                [Vec3::new(w.x, w.y, w.z + qd), rate, a]
            }
            JointKind::Prismatic => still,
        };
        let mut motion = Motion::new(w, r, a);
        if self.kind == JointKind::Prismatic {
            let twice = qd * real(2.0);
            let [x, y, z] = &motion.spin;
            motion.linear_rate += Vec3::new(x.z * q + w.y * twice, y.z * q - w.x * twice, z.z * q + qdd);
        }
        motion
    }

    /// A load on the link about its origin, expressed in the parent's frame about the parent's.
    #[inline(always)]
    pub(super) fn load_on_parent(&self, load: &Wrench<T>, q: T, sine: T, cosine: T) -> Wrench<T> {
        let [moment, force] = self.outward([load.moment, load.force], sine, cosine);
        Wrench { moment: add_cross(&moment, &self.origin_at(q), &force), force }
    }
}

/// τ, N·m or N: the joint torques and forces of the motion q̈ (`qdd`) at positions `q` and velocities `qd`.
///
/// `loads`: what the environment exerts on each link, expressed in the frame that its joint was given with, about its
/// origin; the lecture's f is what the arm exerts, hence the other sign.
///
/// The lecture's iterations, outwards ω, ω̇, v̇, F, N and inwards f, n, τ; the base accelerates against gravity.
pub fn inverse_dynamics<T: Real, const N: usize>(
    tree: &Tree<T, N>,
    q: &[T; N],
    qd: &[T; N],
    qdd: &[T; N],
    loads: Option<&[Wrench<T>; N]>,
) -> [T; N] {
    let turns = tree.turns(q);
    let base = Motion::new(Vec3::zeros(), Vec3::zeros(), -tree.gravity);
    let loads_of_motion = outward_loads::<T, N, true>(tree, &base, [q, qd, qdd], &turns);
    inward(tree, loads_of_motion, loads, q, &turns).0
}

/// V(q, q̇), N·m or N: the centrifugal and Coriolis torques, inverse dynamics without gravity and acceleration.
pub fn velocity_torque<T: Real, const N: usize>(tree: &Tree<T, N>, q: &[T; N], qd: &[T; N]) -> [T; N] {
    let turns = tree.turns(q);
    let base = Motion::new(Vec3::zeros(), Vec3::zeros(), Vec3::zeros());
    let loads_of_motion = outward_loads::<T, N, true>(tree, &base, [q, qd, &[T::zero(); N]], &turns);
    inward(tree, loads_of_motion, None, q, &turns).0
}

/// The motion of every link on a base that moves with `base`, and that does not turn when it is `STILL`; each is shown to
/// `visit` while it is at hand.
#[inline(always)]
pub(super) fn outward<T: Real, const N: usize, const STILL: bool>(
    tree: &Tree<T, N>,
    base: &Motion<T>,
    [q, qd, qdd]: [&[T; N]; 3],
    turns: &Turns<T, N>,
    mut visit: impl FnMut(usize, &Link<T>, &Motion<T>),
) -> [Motion<T>; N] {
    let mut motions = [*base; N];
    for (index, link) in tree.links.iter().enumerate() {
        let (Some(q), Some(qd), Some(qdd), Some((sine, cosine))) =
            (q.get(index), qd.get(index), qdd.get(index), turns.get(index))
        else {
            continue;
        };
        let state = [*q, *qd, *qdd];
        let motion = match motions.get(usize::from(link.parent)) {
            None if STILL => link.moving_on_still(&base.linear_rate, state, *sine, *cosine),
            parent => link.moving(parent.unwrap_or(base), state, *sine, *cosine),
        };
        visit(index, link, &motion);
        if let Some(slot) = motions.get_mut(index) {
            *slot = motion;
        }
    }
    motions
}

/// The motion of every link, and the load that makes it move so.
#[inline(always)]
pub(super) fn outward_loads<T: Real, const N: usize, const STILL: bool>(
    tree: &Tree<T, N>,
    base: &Motion<T>,
    state: [&[T; N]; 3],
    turns: &Turns<T, N>,
) -> [Wrench<T>; N] {
    let mut loads = [Wrench::zero(); N];
    outward::<T, N, STILL>(tree, base, state, turns, |index, link, motion| {
        if let Some(load) = loads.get_mut(index) {
            *load = motion.load(&link.body);
        }
    });
    loads
}

/// The joint torques of these loads, less `external` ones, and the load that they put on the base.
#[inline(always)]
pub(super) fn inward<T: Real, const N: usize>(
    tree: &Tree<T, N>,
    mut loads: [Wrench<T>; N],
    external: Option<&[Wrench<T>; N]>,
    q: &[T; N],
    turns: &Turns<T, N>,
) -> ([T; N], Wrench<T>) {
    if let Some(external) = external {
        for ((load, given), link) in loads.iter_mut().zip(external).zip(&tree.links) {
            let (moment, force) = (link.turned.tr_mul(&given.moment), link.turned.tr_mul(&given.force));
            *load = *load - Wrench { moment, force };
        }
    }
    let mut torques = [T::zero(); N];
    let mut on_base = Wrench::zero();
    for (index, link) in tree.links.iter().enumerate().rev() {
        let (Some(load), Some(torque)) = (loads.get(index).copied(), torques.get_mut(index)) else { continue };
        *torque = link.along(&load);
        if let (Some(q), Some((sine, cosine))) = (q.get(index), turns.get(index)) {
            let carried = loads.get_mut(usize::from(link.parent)).unwrap_or(&mut on_base);
            *carried = *carried + link.load_on_parent(&load, *q, *sine, *cosine);
        }
    }
    (torques, on_base)
}
