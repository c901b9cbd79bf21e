//! A pose held as three axes and an origin: what the recursions along a tree turn and shift.

use super::Turn;
use super::kernel::{add_scaled, dot, rotated};
use crate::real::{Mat3, Real, Vec3};
use crate::se::Pose;

/// The axes of a frame and its origin, expressed in the base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Frame<T: Real> {
    pub(crate) x: Vec3<T>,
    pub(crate) y: Vec3<T>,
    pub(crate) z: Vec3<T>,
    pub(crate) origin: Vec3<T>,
}

impl<T: Real> Frame<T> {
    #[inline(always)]
    pub(crate) fn identity() -> Self {
        Self { x: Vec3::x(), y: Vec3::y(), z: Vec3::z(), origin: Vec3::zeros() }
    }

    #[inline(always)]
    pub(crate) fn of(pose: &Pose<T>) -> Self {
        let [x, y, z] = pose.rotation.data.0.map(Vec3::from);
        Self { x, y, z, origin: pose.position }
    }

    /// The axes as the columns of a matrix.
    #[inline(always)]
    pub(crate) fn rotation(&self) -> Mat3<T> {
        Mat3::from_columns(&[self.x, self.y, self.z])
    }

    /// A direction of this frame, expressed in the base.
    #[inline(always)]
    pub(crate) fn turn(&self, v: &Vec3<T>) -> Vec3<T> {
        add_scaled(&add_scaled(&(self.x * v.x), &self.y, v.y), &self.z, v.z)
    }

    /// A direction of the base, expressed in this frame.
    #[inline(always)]
    pub(crate) fn turn_back(&self, v: &Vec3<T>) -> Vec3<T> {
        Vec3::new(dot(&self.x, v), dot(&self.y, v), dot(&self.z, v))
    }

    /// A point of this frame, expressed in the base.
    #[inline(always)]
    pub(crate) fn point(&self, p: &Vec3<T>) -> Vec3<T> {
        add_scaled(&add_scaled(&add_scaled(&self.origin, &self.x, p.x), &self.y, p.y), &self.z, p.z)
    }

    /// Turned about its own z.
    #[inline(always)]
    pub(crate) fn about_z(self, sine: T, cosine: T) -> Self {
        Self {
            x: add_scaled(&(self.x * cosine), &self.y, sine),
            y: add_scaled(&(self.y * cosine), &self.x, -sine),
            ..self
        }
    }

    /// The base turned by a constant rotation: nothing is multiplied by the base's ones and zeros.
    #[inline(always)]
    pub(crate) fn turned_once(turn: &Turn<T>) -> Self {
        let zero = T::zero();
        match turn {
            Turn::None => Self::identity(),
            Turn::Quarter => Self { y: Vec3::z(), z: -Vec3::y(), ..Self::identity() },
            Turn::QuarterBack => Self { y: -Vec3::z(), z: Vec3::y(), ..Self::identity() },
            Turn::AboutX { cosine, sine } => {
                Self { y: Vec3::new(zero, *cosine, *sine), z: Vec3::new(zero, -*sine, *cosine), ..Self::identity() }
            }
            Turn::Full(r) => Self {
                x: Vec3::new(r.m11, r.m21, r.m31),
                y: Vec3::new(r.m12, r.m22, r.m32),
                z: Vec3::new(r.m13, r.m23, r.m33),
                origin: Vec3::zeros(),
            },
        }
    }

    /// Turned by a constant rotation expressed in itself.
    #[inline(always)]
    pub(crate) fn turned(&self, turn: &Turn<T>) -> Self {
        match turn {
            Turn::None => *self,
            Turn::Quarter => Self { y: self.z, z: -self.y, ..*self },
            Turn::QuarterBack => Self { y: -self.z, z: self.y, ..*self },
            Turn::AboutX { cosine, sine } => Self {
                y: add_scaled(&(self.y * *cosine), &self.z, *sine),
                z: add_scaled(&(self.z * *cosine), &self.y, -*sine),
                ..*self
            },
            Turn::Full(r) => Self {
                x: self.turn(&Vec3::new(r.m11, r.m21, r.m31)),
                y: self.turn(&Vec3::new(r.m12, r.m22, r.m32)),
                z: self.turn(&Vec3::new(r.m13, r.m23, r.m33)),
                ..*self
            },
        }
    }
}

impl<T: Real> Turn<T> {
    /// Directions after the turn, expressed before it.
    #[inline(always)]
    pub(crate) fn outward<const K: usize>(&self, vectors: &[Vec3<T>; K]) -> [Vec3<T>; K] {
        match self {
            Self::None => *vectors,
            Self::Quarter => vectors.map(|v| Vec3::new(v.x, -v.z, v.y)),
            Self::QuarterBack => vectors.map(|v| Vec3::new(v.x, v.z, -v.y)),
            Self::AboutX { cosine, sine } => vectors.map(|v| {
                let (y, z) = rotated(v.y, v.z, *sine, *cosine);
                Vec3::new(v.x, y, z)
            }),
            Self::Full(r) => {
                let rows =
                    [Vec3::new(r.m11, r.m12, r.m13), Vec3::new(r.m21, r.m22, r.m23), Vec3::new(r.m31, r.m32, r.m33)];
                vectors.map(|v| Vec3::from(rows.map(|row| dot(&row, &v))))
            }
        }
    }

    /// Directions before the turn, expressed after it.
    #[inline(always)]
    pub(crate) fn inward<const K: usize>(&self, vectors: &[Vec3<T>; K]) -> [Vec3<T>; K] {
        match self {
            Self::None => *vectors,
            Self::Quarter => vectors.map(|v| Vec3::new(v.x, v.z, -v.y)),
            Self::QuarterBack => vectors.map(|v| Vec3::new(v.x, -v.z, v.y)),
            Self::AboutX { cosine, sine } => vectors.map(|v| {
                let (y, z) = rotated(v.y, v.z, -*sine, *cosine);
                Vec3::new(v.x, y, z)
            }),
            Self::Full(r) => {
                let columns =
                    [Vec3::new(r.m11, r.m21, r.m31), Vec3::new(r.m12, r.m22, r.m32), Vec3::new(r.m13, r.m23, r.m33)];
                vectors.map(|v| Vec3::from(columns.map(|column| dot(&column, &v))))
            }
        }
    }
}
