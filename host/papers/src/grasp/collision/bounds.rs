//! Bounds of shapes: spheres, which are compared first, and boxes, which leave few of the others.

use parry3d_f64::math::{Matrix, Pose as Placed, Vector};

/// A sphere around a shape.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sphere {
    /// Its centre, m.
    pub(super) center: Vector,
    /// Its radius, m.
    pub(super) radius: f64,
}

impl Sphere {
    /// Around spheres; it is the least one only where there is one.
    pub(super) fn around(spheres: &[Self]) -> Self {
        let center = spheres.iter().map(|sphere| sphere.center).sum::<Vector>() / spheres.len().max(1) as f64;
        let reach = spheres.iter().map(|sphere| (sphere.center - center).length() + sphere.radius);
        Self { center, radius: reach.fold(0.0, f64::max) }
    }

    /// The sphere of a shape that has been moved.
    pub(super) fn at(&self, pose: &Placed) -> Self {
        Self { center: pose * self.center, radius: self.radius }
    }

    /// Whether the other one may be closer than the margin.
    pub(super) fn is_near(&self, other: &Self, margin_m: f64) -> bool {
        let reach = self.radius + other.radius + margin_m;
        (self.center - other.center).length_squared() <= reach * reach
    }
}

/// A box around a shape, in the frame of the shape.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    /// Its centre, m.
    pub(super) center: Vector,
    /// Half of its edges, m.
    pub(super) half: Vector,
}

impl Bounds {
    /// Whether another box may be closer than the margin: `false` where one of the six faces' normals separates them.
    ///
    /// Boxes that only a normal of two edges separates are taken for near ones.
    pub(super) fn is_near(&self, pose: &Placed, other: &Self, other_pose: &Placed, margin_m: f64) -> bool {
        let relative = pose.inv_mul(other_pose);
        let turned = Matrix::from_quat(relative.rotation);
        let between = relative * other.center - self.center;
        let size = turned.abs();
        let reach = self.half + size * other.half + Vector::splat(margin_m);
        if between.abs().cmpgt(reach).any() {
            return false;
        }
        let reach = other.half + size.transpose() * self.half + Vector::splat(margin_m);
        !(turned.transpose() * between).abs().cmpgt(reach).any()
    }
}
