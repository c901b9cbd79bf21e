//! How a frame moves with the joints: its twist, the Jacobian expressed in the base or in the frame, and the Jacobian's rate.

use nalgebra::SMatrix;

use super::kernel::cross;
use super::{Frame, Frames, Link, LinkFrame, Tree};
use crate::actuator::JointKind;
use crate::real::{Real, Vec3};
use crate::se::{Twist, Wrench};

impl<T: Real> Link<T> {
    /// How a point moves, expressed in the base, per unit of this joint, whose link is at `frame`:
    /// (z, z × (p − o)) when the joint turns, (0, z) when it slides.
    #[inline(always)]
    pub(crate) fn column(&self, frame: &Frame<T>, point: &Vec3<T>) -> (Vec3<T>, Vec3<T>) {
        match self.kind {
            JointKind::Revolute => (frame.z, cross(&frame.z, &(point - frame.origin))),
            JointKind::Prismatic => (Vec3::zeros(), frame.z),
        }
    }
}

/// Six numbers of a twist, angular part first.
#[inline(always)]
fn six<T: Real>(angular: &Vec3<T>, linear: &Vec3<T>) -> [T; 6] {
    [angular.x, angular.y, angular.z, linear.x, linear.y, linear.z]
}

impl<T: Real, const N: usize> Tree<T, N> {
    /// Calls `visit` with each joint between the base and `frame`, the outermost first.
    #[inline(always)]
    fn along(&self, frame: &LinkFrame<T>, mut visit: impl FnMut(usize, &Link<T>)) {
        let mut next = usize::from(frame.link);
        for _ in 0..N {
            let Some(link) = self.links.get(next) else { break };
            visit(next, link);
            next = usize::from(link.parent);
        }
    }

    /// Position of the first joint below `frame` (m, base), and a length (m) from there that the frame's origin never
    /// exceeds while sliding joints keep these limits: that of all links together.
    pub fn reach(&self, frame: &LinkFrame<T>, limits: &[[T; 2]; N]) -> (Vec3<T>, T) {
        let (mut first, mut length) = (frame.pose.position, T::zero());
        self.along(frame, |index, link| {
            length += first.norm();
            if let (JointKind::Prismatic, Some([low, high])) = (link.kind, limits.get(index)) {
                length += low.abs().max(high.abs());
            }
            first = link.origin;
        });
        (first, length)
    }

    /// ⁰J, 6 × N: the twist of `frame`, expressed along the axes of the base at the frame's origin, per unit of each
    /// joint.
    ///
    /// Column i is what the lecture's recursion ωᵢ₊₁ = ωᵢ + θ̇ẑ, vᵢ₊₁ = vᵢ + ωᵢ × pᵢ₊₁ carries from joint i to the
    /// frame: (ẑᵢ, ẑᵢ × (p − pᵢ)) for a revolute joint, (0, ẑᵢ) for a prismatic one; zero for a joint that is not
    /// between the base and the frame.
    #[inline]
    pub fn jacobian_base(&self, frame: &LinkFrame<T>, frames: &Frames<T, N>) -> SMatrix<T, 6, N> {
        let mut jacobian = SMatrix::zeros();
        self.jacobian_base_into(frame, frames, &mut jacobian);
        jacobian
    }

    /// As [`jacobian_base`](Self::jacobian_base), into a matrix that the caller owns: nothing is cleared or copied.
    #[inline]
    pub fn jacobian_base_into(&self, frame: &LinkFrame<T>, frames: &Frames<T, N>, jacobian: &mut SMatrix<T, 6, N>) {
        let point = frames.link(frame.link).point(&frame.pose.position);
        let mut next = usize::from(frame.link);
        for (index, (column, (link, at))) in
            jacobian.data.0.iter_mut().zip(self.links.iter().zip(frames.links())).enumerate().rev()
        {
            if index == next {
                let (angular, linear) = link.column(at, &point);
                *column = six(&angular, &linear);
                next = usize::from(link.parent);
            } else {
                *column = [T::zero(); 6];
            }
        }
    }

    /// ᵉJ, 6 × N: as [`jacobian_base`](Self::jacobian_base), expressed along the axes of the frame itself.
    #[inline]
    pub fn jacobian_tool(&self, frame: &LinkFrame<T>, frames: &Frames<T, N>) -> SMatrix<T, 6, N> {
        let pose = frames.pose(frame);
        let axes = Frame::of(&pose);
        let mut jacobian = SMatrix::zeros();
        self.along(frame, |index, link| {
            if let (Some(column), Some(at)) = (jacobian.data.0.get_mut(index), frames.links().get(index)) {
                let (angular, linear) = link.column(at, &pose.position);
                *column = six(&axes.turn_back(&angular), &axes.turn_back(&linear));
            }
        });
        jacobian
    }

    /// dJ/dt, 6 × N: the rate of [`jacobian_base`](Self::jacobian_base) for joint velocities `qd` (rad/s or m/s), so
    /// that the frame's acceleration is J q̈ + J̇ q̇.
    pub fn jacobian_rate(&self, frame: &LinkFrame<T>, qd: &[T; N], frames: &Frames<T, N>) -> SMatrix<T, 6, N> {
        let twists = self.twists(&Twist::zero(), qd, frames);
        let point = frames.link(frame.link).point(&frame.pose.position);
        let moving = |link: usize, at: &Vec3<T>| match (twists.get(link), frames.links().get(link)) {
            (Some(twist), Some(frame)) => twist.linear + twist.angular.cross(&(at - frame.origin)),
            _ => Vec3::zeros(),
        };
        let velocity = moving(usize::from(frame.link), &point);
        let mut rate = SMatrix::zeros();
        self.along(frame, |index, link| {
            let (Some(column), Some(at), Some(twist)) =
                (rate.data.0.get_mut(index), frames.links().get(index), twists.get(index))
            else {
                return;
            };
            let axis_rate = twist.angular.cross(&at.z);
            *column = match link.kind {
                JointKind::Revolute => {
                    six(&axis_rate, &(axis_rate.cross(&(point - at.origin)) + at.z.cross(&(velocity - twist.linear))))
                }
                JointKind::Prismatic => six(&Vec3::zeros(), &axis_rate),
            };
        });
        rate
    }

    /// The twist of every link, expressed along the axes of the base at the link's origin, when the base moves with
    /// `base`
    /// (at its own origin) and the joints with `qd`: the outward recursion of the lecture.
    pub(crate) fn twists(&self, base: &Twist<T>, qd: &[T; N], frames: &Frames<T, N>) -> [Twist<T>; N] {
        let mut twists = [*base; N];
        for (index, link) in self.links.iter().enumerate() {
            let (parent, at) = (frames.link(link.parent), frames.links().get(index));
            let behind = *twists.get(usize::from(link.parent)).unwrap_or(base);
            if let (Some(at), Some(rate), Some(twist)) = (at, qd.get(index), twists.get_mut(index)) {
                let linear = behind.linear + behind.angular.cross(&(at.origin - parent.origin));
                *twist = match link.kind {
                    JointKind::Revolute => Twist { angular: behind.angular + at.z * *rate, linear },
                    JointKind::Prismatic => Twist { angular: behind.angular, linear: linear + at.z * *rate },
                };
            }
        }
        twists
    }
}

/// V = J q̇: the twist of a frame whose Jacobian is `jacobian`.
pub fn twist<T: Real, const N: usize>(jacobian: &SMatrix<T, 6, N>, qd: &[T; N]) -> Twist<T> {
    let mut sum = [T::zero(); 6];
    for (column, rate) in jacobian.data.0.iter().zip(qd) {
        for (sum, entry) in sum.iter_mut().zip(column) {
            *sum += *entry * *rate;
        }
    }
    let [a, b, c, x, y, z] = sum;
    Twist { angular: Vec3::new(a, b, c), linear: Vec3::new(x, y, z) }
}

/// τ = Jᵀ F: the joint torques (N·m) and forces (N) that hold a frame which pushes on its environment with `load`,
/// expressed as the Jacobian is: from the equality of virtual work, Fᵀ δχ = τᵀ δθ.
pub fn statics<T: Real, const N: usize>(jacobian: &SMatrix<T, 6, N>, load: &Wrench<T>) -> [T; N] {
    let (m, f) = (&load.moment, &load.force);
    let mut torques = [T::zero(); N];
    for (torque, [a, b, c, x, y, z]) in torques.iter_mut().zip(&jacobian.data.0) {
        *torque = *a * m.x + *b * m.y + *c * m.z + *x * f.x + *y * f.y + *z * f.z;
    }
    torques
}
