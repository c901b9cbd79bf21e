//! Inverse dynamics by Newton's and Euler's equations: outwards the motion of every link, inwards the loads on it.

use super::Vec3;
use crate::actuator::JointKind;
use crate::real::{Real, real};
use crate::se::Wrench;
use crate::tree::{Body, Link, Tree};

/// How a link moves, told in its own frame.
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
pub(crate) type Turns<T, const N: usize> = ([T; N], [T; N]);

impl<T: Real> Motion<T> {
    #[inline(always)]
    pub(crate) fn new(angular: Vec3<T>, angular_rate: Vec3<T>, linear_rate: Vec3<T>) -> Self {
        let (w, r) = (&angular, &angular_rate);
        let (xx, yy, zz) = (w.x * w.x, w.y * w.y, w.z * w.z);
        let (xy, xz, yz) = (w.x * w.y, w.x * w.z, w.y * w.z);
        let spin = [
            Vec3::new(-(yy + zz), xy - r.z, xz + r.y),
            Vec3::new(xy + r.z, -(xx + zz), yz - r.x),
            Vec3::new(xz - r.y, yz + r.x, -(xx + yy)),
        ];
        Self { angular, angular_rate, linear_rate, spin }
    }

    /// \[ω̇\]·r + \[ω\]²·r.
    #[inline(always)]
    pub(crate) fn spin(&self, r: &Vec3<T>) -> Vec3<T> {
        let [x, y, z] = &self.spin;
        Vec3::new(x.dot(r), y.dot(r), z.dot(r))
    }

    /// The load that makes `body` move so, about the frame's origin: F = m·v̇_C, N = I·ω̇ + ω × I·ω.
    #[inline(always)]
    pub(super) fn load(&self, body: &Body<T>) -> Wrench<T> {
        let force = self.linear_rate * body.mass + self.spin(&body.moment);
        let moment = body.inertia.times(&self.angular_rate)
            + self.angular.cross(&body.inertia.times(&self.angular))
            + body.moment.cross(&self.linear_rate);
        Wrench { moment, force }
    }
}

impl<T: Real> Link<T> {
    /// A direction of the parent's frame, told in the link's.
    #[inline(always)]
    fn inward(&self, v: &Vec3<T>, sine: T, cosine: T) -> Vec3<T> {
        let v = self.turn.inward(v);
        match self.kind {
            JointKind::Revolute => Vec3::new(v.x * cosine + v.y * sine, v.y * cosine - v.x * sine, v.z),
            JointKind::Prismatic => v,
        }
    }

    /// A direction of the link's frame, told in the parent's.
    #[inline(always)]
    fn outward(&self, v: &Vec3<T>, sine: T, cosine: T) -> Vec3<T> {
        match self.kind {
            JointKind::Revolute => {
                self.turn.outward(&Vec3::new(v.x * cosine - v.y * sine, v.x * sine + v.y * cosine, v.z))
            }
            JointKind::Prismatic => self.turn.outward(v),
        }
    }

    /// The motion of the link on a parent that moves with `parent`: the outward equations of the lecture.
    #[inline(always)]
    fn moving(&self, parent: &Motion<T>, [q, qd, qdd]: [T; 3], sine: T, cosine: T) -> Motion<T> {
        let angular = self.inward(&parent.angular, sine, cosine);
        let rate = self.inward(&parent.angular_rate, sine, cosine);
        let linear = self.inward(&(parent.linear_rate + parent.spin(&self.origin)), sine, cosine);
        match self.kind {
            JointKind::Revolute => Motion::new(
                Vec3::new(angular.x, angular.y, angular.z + qd),
                Vec3::new(rate.x + angular.y * qd, rate.y - angular.x * qd, rate.z + qdd),
                linear,
            ),
            JointKind::Prismatic => {
                let motion = Motion::new(angular, rate, linear);
                let twice = qd * real(2.0);
                let [x, y, z] = &motion.spin;
                let along = Vec3::new(x.z * q + angular.y * twice, y.z * q - angular.x * twice, z.z * q + qdd);
                Motion { linear_rate: linear + along, ..motion }
            }
        }
    }

    /// A load on the link about its origin, told in the parent's frame about the parent's.
    #[inline(always)]
    pub(super) fn load_on_parent(&self, load: &Wrench<T>, q: T, sine: T, cosine: T) -> Wrench<T> {
        let force = self.outward(&load.force, sine, cosine);
        let at = match self.kind {
            JointKind::Revolute => self.origin,
            JointKind::Prismatic => self.origin + self.turn.outward(&Vec3::new(T::zero(), T::zero(), q)),
        };
        Wrench { moment: self.outward(&load.moment, sine, cosine) + at.cross(&force), force }
    }
}

/// τ, N·m or N: the joint torques and forces of the motion q̈ (`qdd`) at positions `q` and velocities `qd`.
///
/// `loads`: what the environment exerts on each link, told in the frame that its joint was given with, about its
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
    let motions = outward(tree, &base, [q, qd, qdd], &turns);
    inward(tree, &motions, loads, q, &turns).0
}

/// V(q, q̇), N·m or N: the centrifugal and Coriolis torques, inverse dynamics without gravity and acceleration.
pub fn velocity_torque<T: Real, const N: usize>(tree: &Tree<T, N>, q: &[T; N], qd: &[T; N]) -> [T; N] {
    let turns = tree.turns(q);
    let base = Motion::new(Vec3::zeros(), Vec3::zeros(), Vec3::zeros());
    let motions = outward(tree, &base, [q, qd, &[T::zero(); N]], &turns);
    inward(tree, &motions, None, q, &turns).0
}

/// The motion of every link on a base that moves with `base`.
#[inline(always)]
pub(super) fn outward<T: Real, const N: usize>(
    tree: &Tree<T, N>,
    base: &Motion<T>,
    [q, qd, qdd]: [&[T; N]; 3],
    (sines, cosines): &Turns<T, N>,
) -> [Motion<T>; N] {
    let mut motions = [*base; N];
    for (index, link) in tree.links.iter().enumerate() {
        let parent = motions.get(usize::from(link.parent)).unwrap_or(base);
        if let (Some(q), Some(qd), Some(qdd), Some(sine), Some(cosine)) =
            (q.get(index), qd.get(index), qdd.get(index), sines.get(index), cosines.get(index))
        {
            let motion = link.moving(parent, [*q, *qd, *qdd], *sine, *cosine);
            if let Some(slot) = motions.get_mut(index) {
                *slot = motion;
            }
        }
    }
    motions
}

/// The joint torques of these motions, and the load that they put on the base.
#[inline(always)]
pub(super) fn inward<T: Real, const N: usize>(
    tree: &Tree<T, N>,
    motions: &[Motion<T>; N],
    external: Option<&[Wrench<T>; N]>,
    q: &[T; N],
    (sines, cosines): &Turns<T, N>,
) -> ([T; N], Wrench<T>) {
    let mut loads = [Wrench::zero(); N];
    for ((load, motion), link) in loads.iter_mut().zip(motions).zip(&tree.links) {
        *load = motion.load(&link.body);
    }
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
        *torque = match link.kind {
            JointKind::Revolute => load.moment.z,
            JointKind::Prismatic => load.force.z,
        };
        if let (Some(q), Some(sine), Some(cosine)) = (q.get(index), sines.get(index), cosines.get(index)) {
            let carried = loads.get_mut(usize::from(link.parent)).unwrap_or(&mut on_base);
            *carried = *carried + link.load_on_parent(&load, *q, *sine, *cosine);
        }
    }
    (torques, on_base)
}
