//! Shapes of links that collide, as the file of a robot gives them.

use darm_core::real::Vec3;
use darm_core::se::Pose;

/// A convex shape about its origin.
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// A box along the axes.
    Cuboid {
        /// Half of its edges, m.
        half_m: Vec3<f64>,
    },
    /// A sphere.
    Sphere {
        /// Its radius, m.
        radius_m: f64,
    },
    /// A cylinder along z.
    Cylinder {
        /// Its radius, m.
        radius_m: f64,
        /// Half of its length, m.
        half_m: f64,
    },
    /// A cylinder along z with a half sphere at each end.
    Capsule {
        /// Its radius, m.
        radius_m: f64,
        /// Half of the length of the cylinder, m.
        half_m: f64,
    },
    /// The hull of these points, such as the corners of a mesh, m.
    Hull(Vec<Vec3<f64>>),
}

/// A shape on a link.
#[derive(Clone, Debug, PartialEq)]
pub struct LinkShape {
    /// Name of the link.
    pub link: String,
    /// Pose of the shape in the frame of the link.
    pub pose: Pose<f64>,
    /// The shape.
    pub geometry: Geometry,
}
