//! Trees of revolute and prismatic joints on a fixed or floating base: the pose of every link and how it moves.
//!
//! A serial arm is the tree in which each joint's parent is the one before it. [`Tree`] is constant; [`Frames`] is
//! scratch that the caller owns: [`Tree::place`] fills it for one posture, and everything that depends on the posture
//! alone (Jacobians here, the mass matrix, gravity and centre of mass in [`dynamics`](crate::dynamics)) reads it.
//!
//! # Frames
//!
//! | frame  | where it is                                                                                  |
//! |--------|----------------------------------------------------------------------------------------------|
//! | base   | that of a fixed base; for a floating base the world, in which the base's pose is given        |
//! | link k | moves with joint k; at position zero it is the joint's `placement` in the link of its parent |
//! | tool   | any frame fixed to a link: [`Tree::frame`]                                                   |
//!
//! `T_parent_link(q) = placement · exp(axis · q)`: positions in rad or m, the axis through the link's origin.
//! Twists, wrenches and the rows of Jacobians have the angular part first.
//!
//! Inside, the link frames are turned, never moved: each joint's axis becomes z, and of two successive joints the
//! constant rotation becomes one about x (as in Denavit's and Hartenberg's notation, without their shift along the
//! common normal, which is ill-conditioned for axes nearly parallel). A step along the tree is then two rotations of two
//! columns each, and no product of matrices. Only [`Link`] shows these frames.
//!
//! # Example
//!
//! ```
//! use darm_core::tree::{Frames, Inertia, Joint, Tree};
//! use darm_core::{real::Vec3, se::Pose};
//! // The lecture's planar robot: 0.5 m and 0.3 m, turning about z.
//! let upper = Joint::revolute(None, Vec3::z(), Pose::identity(), Inertia::none());
//! let lower = Joint::revolute(Some(0), Vec3::z(), Pose::at(Vec3::new(0.5, 0.0, 0.0)), Inertia::none());
//! let arm = Tree::new(&[upper, lower], Vec3::zeros()).unwrap();
//! let tool = arm.frame(1, &Pose::at(Vec3::new(0.3, 0.0, 0.0)));
//! let mut frames = Frames::default();
//! arm.place(&[0.0, core::f64::consts::FRAC_PI_2], &mut frames);
//! assert!((frames.pose(&tool).position - Vec3::new(0.5, 0.3, 0.0)).norm() < 1e-15);
//! // v_x = −l₁s₁ − l₂s₁₂, v_y = l₁c₁ + l₂c₁₂ in the first column, under the three angular rows.
//! let jacobian = arm.jacobian_base(&tool, &frames);
//! assert!((jacobian[(3, 0)] + 0.3).abs() < 1e-15 && (jacobian[(4, 0)] - 0.5).abs() < 1e-15);
//! ```
#![allow(non_snake_case)]

mod build;
pub mod dh;
pub mod euler;
mod frame;
mod inertia;
pub mod jacobian;
mod kernel;
pub mod puma560;
pub mod singular;

use crate::actuator::{Axis, JointKind};
use crate::real::{Mat3, Real, Vec3, cast, real};
use crate::se::Pose;
use crate::trig;

pub use build::TreeError;
pub(crate) use frame::Frame;
pub use inertia::{Inertia, Symmetric};
pub(crate) use kernel::{add_cross, add_scaled, cross, dot, fused, rotated};

/// No link is its parent: the joint is on the base.
pub const BASE: u8 = u8::MAX;

/// A joint and the link that it moves, as an engineer gives them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint<T: Real> {
    /// The link that the joint is on, one before it in the list; `None`: the base.
    pub parent: Option<usize>,
    /// What the link moves along, expressed in its own frame.
    pub axis: Axis<T>,
    /// Pose of the link in the link of its parent at position zero.
    pub placement: Pose<T>,
    /// Mass distribution of the link, expressed in its frame.
    pub inertia: Inertia<T>,
}

/// A constant rotation from one link to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Turn<T: Real> {
    /// None.
    None,
    /// About x by +π/2: exact, and nothing to multiply.
    Quarter,
    /// About x by −π/2.
    QuarterBack,
    /// About x by an angle with this cosine and sine.
    AboutX {
        /// cos α
        cosine: T,
        /// sin α
        sine: T,
    },
    /// Any rotation.
    Full(Mat3<T>),
}

/// A link and its joint in the turned frame that computes fast: constants that can stand in a chip's flash.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link<T: Real> {
    /// The link that the joint is on; [`BASE`]: none.
    pub parent: u8,
    /// Whether the joint turns about the link's z or slides along it.
    pub kind: JointKind,
    /// Constant rotation from the parent, before that of the joint.
    pub turn: Turn<T>,
    /// The joint's place in the frame of its parent, m.
    pub origin: Vec3<T>,
    /// The angle of a revolute joint at position zero, rad.
    pub offset: T,
    /// Mass distribution, expressed in the turned frame about its origin.
    pub body: Body<T>,
    /// The turned frame in the frame that the joint was given with.
    pub turned: Mat3<T>,
}

/// The ten inertial parameters of a body in the frame that it moves with: what the dynamics is linear in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body<T: Real> {
    /// m, kg.
    pub mass: T,
    /// m·c: mass times centre of mass, kg·m.
    pub moment: Vec3<T>,
    /// Moments of inertia about the frame's origin, kg·m².
    pub inertia: Symmetric<T>,
}

/// N joints with their links, on a base that is fixed or floats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tree<T: Real, const N: usize> {
    /// Joints and links, parents before children.
    pub links: [Link<T>; N],
    /// Mass distribution of the base, which counts when it floats.
    pub base: Body<T>,
    /// Acceleration of free fall in the base frame, m/s²: (0, 0, −9.81) when z points up.
    pub gravity: Vec3<T>,
}

/// A frame fixed to a link, such as that of the tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkFrame<T: Real> {
    /// The link; [`BASE`]: the base.
    pub link: u8,
    /// In the turned frame of the link.
    pub pose: Pose<T>,
}

/// Where every link of a tree is in one posture.
#[derive(Clone, Copy, Debug)]
pub struct Frames<T: Real, const N: usize> {
    base: Frame<T>,
    links: [Frame<T>; N],
}

impl<T: Real> Joint<T> {
    /// A joint that turns about `axis`, a unit vector.
    pub fn revolute(parent: Option<usize>, axis: Vec3<T>, placement: Pose<T>, inertia: Inertia<T>) -> Self {
        Self { parent, axis: Axis { kind: JointKind::Revolute, direction: axis }, placement, inertia }
    }

    /// A joint that slides along `axis`, a unit vector.
    pub fn prismatic(parent: Option<usize>, axis: Vec3<T>, placement: Pose<T>, inertia: Inertia<T>) -> Self {
        Self { parent, axis: Axis { kind: JointKind::Prismatic, direction: axis }, placement, inertia }
    }
}

impl Joint<f64> {
    /// The same joint in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> Joint<U> {
        let Inertia { mass, com, about_com } = &self.inertia;
        Joint {
            parent: self.parent,
            axis: Axis { kind: self.axis.kind, direction: cast(&self.axis.direction) },
            placement: self.placement.cast(),
            inertia: Inertia { mass: real(*mass), com: cast(com), about_com: about_com.map(real) },
        }
    }
}

impl<T: Real, const N: usize> Default for Frames<T, N> {
    fn default() -> Self {
        Self { base: Frame::identity(), links: [Frame::identity(); N] }
    }
}

impl<T: Real, const N: usize> Tree<T, N> {
    /// The frame with this `pose` in the frame of a link, as the joint was given; past the last link: in the base.
    pub fn frame(&self, link: usize, pose: &Pose<T>) -> LinkFrame<T> {
        match self.links.get(link) {
            Some(turned) => LinkFrame {
                link: link as u8,
                pose: Pose {
                    rotation: turned.turned.tr_mul(&pose.rotation),
                    position: turned.turned.tr_mul(&pose.position),
                },
            },
            None => LinkFrame { link: BASE, pose: *pose },
        }
    }

    /// Places every link for the joints' positions `q` (rad or m), on a fixed base.
    ///
    /// `T_base_i = T_base_parent(i) · placement_i · exp(axis_i q_i)`: the product of exponentials of the lecture.
    #[inline]
    pub fn place(&self, q: &[T; N], frames: &mut Frames<T, N>) {
        frames.base = Frame::identity();
        let turns = self.turns(q);
        let mut before = Frame::identity();
        for (i, link) in self.links.iter().enumerate() {
            let at_rest =
                if link.parent == BASE { link.at_rest() } else { link.at_rest_on(&frames.parent(link, i, before)) };
            if let (Some(frame), Some(q), Some((s, c))) = (frames.links.get_mut(i), q.get(i), turns.get(i)) {
                before = link.moved(at_rest, *q, *s, *c);
                *frame = before;
            }
        }
    }

    /// Pose of `frame` in a fixed base at the joints' positions `q` (rad or m), when nothing else of the posture is
    /// needed.
    ///
    /// Carried from the frame inwards, link by link, which needs no [`Frames`] and fewer products than [`place`](Self::place).
    #[inline(always)]
    pub fn pose(&self, frame: &LinkFrame<T>, q: &[T; N]) -> Pose<T> {
        let turns = self.turns(q);
        let mut at = Frame::of(&frame.pose);
        let mut next = usize::from(frame.link);
        for _ in 0..N {
            let (Some(link), Some(q), Some((s, c))) = (self.links.get(next), q.get(next), turns.get(next)) else {
                break;
            };
            at = link.inward(at, *q, *s, *c);
            next = usize::from(link.parent);
        }
        Pose { rotation: at.rotation(), position: at.origin }
    }

    /// Places every link for the joints' positions `q` (rad or m) and the pose of a floating base in the world.
    pub fn place_floating(&self, base: &Pose<T>, q: &[T; N], frames: &mut Frames<T, N>) {
        frames.base = Frame::of(base);
        let turns = self.turns(q);
        let mut before = frames.base;
        for (i, link) in self.links.iter().enumerate() {
            let at_rest = link.at_rest_on(&frames.parent(link, i, before));
            if let (Some(frame), Some(q), Some((s, c))) = (frames.links.get_mut(i), q.get(i), turns.get(i)) {
                before = link.moved(at_rest, *q, *s, *c);
                *frame = before;
            }
        }
    }

    /// Sine and cosine of the angle of every joint; of a prismatic joint's position too, which nobody asks for.
    #[inline(always)]
    pub(crate) fn turns(&self, q: &[T; N]) -> [(T, T); N] {
        trig::sin_cos_all(|k| match (q.get(k), self.links.get(k)) {
            (Some(q), Some(link)) => *q + link.offset,
            _ => T::zero(),
        })
    }
}

impl<T: Real, const N: usize> Frames<T, N> {
    /// Pose of `frame` in the base.
    #[inline]
    pub fn pose(&self, frame: &LinkFrame<T>) -> Pose<T> {
        let link = self.link(frame.link);
        let columns = frame.pose.rotation.data.0.map(|column| link.turn(&Vec3::from(column)));
        Pose { rotation: Mat3::from_columns(&columns), position: link.point(&frame.pose.position) }
    }

    /// The frame of a link, or of the base.
    #[inline(always)]
    pub(crate) fn link(&self, link: u8) -> &Frame<T> {
        self.links.get(usize::from(link)).unwrap_or(&self.base)
    }

    /// The frames of all links.
    #[inline(always)]
    pub(crate) fn links(&self) -> &[Frame<T>; N] {
        &self.links
    }

    /// The frame of the parent of link `i`, which is most often the one `before` it, still in registers.
    #[inline(always)]
    fn parent(&self, link: &Link<T>, i: usize, before: Frame<T>) -> Frame<T> {
        if usize::from(link.parent) + 1 == i { before } else { *self.link(link.parent) }
    }

    /// The frame of the base.
    #[inline(always)]
    pub(crate) fn base(&self) -> &Frame<T> {
        &self.base
    }
}

impl<T: Real> Link<T> {
    /// The joint's own frame on a fixed base, before it moves.
    #[inline(always)]
    fn at_rest(&self) -> Frame<T> {
        Frame { origin: self.origin, ..Frame::turned_once(&self.turn) }
    }

    /// The joint's own frame on its parent, before it moves.
    #[inline(always)]
    fn at_rest_on(&self, parent: &Frame<T>) -> Frame<T> {
        Frame { origin: parent.point(&self.origin), ..parent.turned(&self.turn) }
    }

    /// A frame given in the link's, expressed in the parent's once the joint has moved to `q`, or by the angle of this sine and cosine.
    #[inline(always)]
    fn inward(&self, at: Frame<T>, q: T, sine: T, cosine: T) -> Frame<T> {
        let [x, y, z, origin] = match self.kind {
            JointKind::Revolute => [at.x, at.y, at.z, at.origin].map(|v| {
                let (x, y) = rotated(v.x, v.y, sine, cosine);
                Vec3::new(x, y, v.z)
            }),
            JointKind::Prismatic => [at.x, at.y, at.z, Vec3::new(at.origin.x, at.origin.y, at.origin.z + q)],
        };
        let [x, y, z, origin] = self.turn.outward(&[x, y, z, origin]);
        Frame { x, y, z, origin: origin + self.origin }
    }

    /// The link's frame once the joint has moved to `q`, or by the angle of this sine and cosine.
    #[inline(always)]
    fn moved(&self, at_rest: Frame<T>, q: T, sine: T, cosine: T) -> Frame<T> {
        match self.kind {
            JointKind::Revolute => at_rest.about_z(sine, cosine),
            JointKind::Prismatic => Frame { origin: add_scaled(&at_rest.origin, &at_rest.z, q), ..at_rest },
        }
    }
}

#[cfg(test)]
mod tests;
