//! Mass distribution of a rigid body: mass, centre of mass, moments of inertia, and how they change with the frame.

use super::Body;
use super::kernel::dot;
use crate::real::{Mat3, Real, Vec3};

/// A body's mass distribution as data sheets and CAD give it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertia<T: Real> {
    /// m, kg.
    pub mass: T,
    /// c, in the link's frame, m.
    pub com: Vec3<T>,
    /// Moments of inertia about the centre of mass, axes as the link's, kg·m²: symmetric, I_xy = −∫ x y dm.
    pub about_com: Mat3<T>,
}

/// A symmetric matrix of three by three, in the order of its lower triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Symmetric<T: Real> {
    /// Row 1, column 1.
    pub xx: T,
    /// Row 2, column 1.
    pub xy: T,
    /// Row 2, column 2.
    pub yy: T,
    /// Row 3, column 1.
    pub xz: T,
    /// Row 3, column 2.
    pub yz: T,
    /// Row 3, column 3.
    pub zz: T,
}

impl<T: Real> Inertia<T> {
    /// A link whose mass does not count.
    pub fn none() -> Self {
        Self { mass: T::zero(), com: Vec3::zeros(), about_com: Mat3::zeros() }
    }

    /// Moments of inertia about the frame's origin, kg·m²: the parallel axis theorem,
    /// I_O = I_C + m·(cᵀc·1 − c·cᵀ).
    pub fn about_origin(&self) -> Symmetric<T> {
        let (x, y, z) = (self.com.x, self.com.y, self.com.z);
        let (i, m) = (&self.about_com, self.mass);
        Symmetric {
            xx: i.m11 + m * (y * y + z * z),
            xy: i.m21 - m * x * y,
            yy: i.m22 + m * (x * x + z * z),
            xz: i.m31 - m * x * z,
            yz: i.m32 - m * y * z,
            zz: i.m33 + m * (x * x + y * y),
        }
    }

    /// The same body in the frame in which this frame's axes and origin are `rotation` and `position`.
    pub fn placed(&self, rotation: &Mat3<T>, position: &Vec3<T>) -> Self {
        Self {
            mass: self.mass,
            com: rotation * self.com + position,
            about_com: rotation * self.about_com * rotation.transpose(),
        }
    }

    /// Two bodies fixed to each other, expressed in one frame.
    pub fn joined(&self, other: &Self) -> Self {
        let mass = self.mass + other.mass;
        if mass <= T::zero() {
            return Self { mass, com: Vec3::zeros(), about_com: self.about_com + other.about_com };
        }
        let com = (self.com * self.mass + other.com * other.mass) / mass;
        let about = |part: &Self| {
            let away = Self { com: part.com - com, ..*part };
            away.about_origin().to_matrix()
        };
        Self { mass, com, about_com: about(self) + about(other) }
    }
}

impl<T: Real> From<&Inertia<T>> for Body<T> {
    fn from(inertia: &Inertia<T>) -> Self {
        Self { mass: inertia.mass, moment: inertia.com * inertia.mass, inertia: inertia.about_origin() }
    }
}

impl<T: Real> Body<T> {
    /// No mass.
    pub fn none() -> Self {
        Self::from_parameters(&[T::zero(); 10])
    }

    /// (m, m·c_x, m·c_y, m·c_z, I_xx, I_xy, I_yy, I_xz, I_yz, I_zz), moments of inertia about the origin.
    pub fn parameters(&self) -> [T; 10] {
        let (h, i) = (&self.moment, &self.inertia);
        [self.mass, h.x, h.y, h.z, i.xx, i.xy, i.yy, i.xz, i.yz, i.zz]
    }

    /// The body of ten [`parameters`](Self::parameters).
    pub fn from_parameters(ten: &[T; 10]) -> Self {
        let [mass, x, y, z, xx, xy, yy, xz, yz, zz] = *ten;
        Self { mass, moment: Vec3::new(x, y, z), inertia: Symmetric { xx, xy, yy, xz, yz, zz } }
    }

    /// The same body in a frame with the same origin, in which this frame's axes are the columns of `rotation`.
    pub fn turned(&self, rotation: &Mat3<T>) -> Self {
        Self {
            mass: self.mass,
            moment: rotation * self.moment,
            inertia: Symmetric::of(&(rotation * self.inertia.to_matrix() * rotation.transpose())),
        }
    }
}

impl<T: Real> Symmetric<T> {
    /// The lower triangle of a matrix.
    pub fn of(matrix: &Mat3<T>) -> Self {
        let m = matrix;
        Self { xx: m.m11, xy: m.m21, yy: m.m22, xz: m.m31, yz: m.m32, zz: m.m33 }
    }

    /// The complete matrix.
    #[inline(always)]
    pub fn to_matrix(&self) -> Mat3<T> {
        Mat3::new(self.xx, self.xy, self.xz, self.xy, self.yy, self.yz, self.xz, self.yz, self.zz)
    }

    /// The product with a column.
    #[inline(always)]
    pub fn times(&self, v: &Vec3<T>) -> Vec3<T> {
        Vec3::new(
            dot(&Vec3::new(self.xx, self.xy, self.xz), v),
            dot(&Vec3::new(self.xy, self.yy, self.yz), v),
            dot(&Vec3::new(self.xz, self.yz, self.zz), v),
        )
    }
}
