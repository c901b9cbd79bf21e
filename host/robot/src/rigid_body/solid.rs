//! Solids of constant density: volume, centre and moments of inertia of simple shapes and of surfaces of triangles.
//!
//! I_xx = ∫ (y² + z²) ρ dv, I_xy = −∫ x y ρ dv, …: products of inertia have the sign of the tensor, as in URDF and MJCF. A
//! textbook that defines I_xy = ∫ x y ρ dv writes the tensor with −I_xy.
//!
//! Shapes are about their centre, a cylinder, a capsule, a cone and a tube along z; the centre of a cone lies a quarter of its
//! height above its base. A surface is the sum of the pyramids over its faces. Source: E. Catto's and J. Blow's covariance of a
//! tetrahedron; `legacy` of the mesh's inertia in MuJoCo's XML reference for [`Pyramids::Positive`].

use std::f64::consts::PI;
use std::path::Path;

use darm_core::real::{Mat3, Vec3};
use darm_core::tree::Inertia;

use crate::files::Files;
use crate::mesh_file;
use crate::source::unreadable;

/// A solid of density 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solid {
    /// Volume, m³.
    pub volume_m3: f64,
    /// Centre of the volume, m.
    pub center_m: Vec3<f64>,
    /// Moments about the centre, m⁵: times the density kg·m².
    pub moments_m5: Mat3<f64>,
}

/// How the pyramids over the faces of a surface count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pyramids {
    /// With their signs: right for a closed surface whose faces are counter-clockwise from outside.
    Signed,
    /// All as positive: right for a convex surface, whatever the order of the corners.
    Positive,
}

/// Why a file is not a solid.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SolidError {
    /// It cannot be read.
    #[error("{path}: {reason}")]
    File {
        /// The file.
        path: String,
        /// Why.
        reason: String,
    },
    /// Its triangles enclose nothing.
    #[error(
        "{path}: its triangles enclose no volume; close the surface, with the corners of each face counter-clockwise \
         from outside"
    )]
    Open {
        /// The file.
        path: String,
    },
}

impl Solid {
    /// A box with these edges, m.
    pub fn cuboid([a, b, c]: [f64; 3]) -> Self {
        let (a2, b2, c2) = (a * a, b * b, c * c);
        Self::centred(a * b * c, [b2 + c2, a2 + c2, a2 + b2].map(|sum| sum / 12.0))
    }

    /// A ball of this radius, m.
    pub fn sphere(radius: f64) -> Self {
        Self::ellipsoid([radius; 3])
    }

    /// An ellipsoid with these half axes, m.
    pub fn ellipsoid([a, b, c]: [f64; 3]) -> Self {
        let (a2, b2, c2) = (a * a, b * b, c * c);
        Self::centred(4.0 / 3.0 * PI * a * b * c, [b2 + c2, a2 + c2, a2 + b2].map(|sum| sum / 5.0))
    }

    /// A cylinder of this radius and length, m.
    pub fn cylinder(radius: f64, length: f64) -> Self {
        Self::tube(radius, 0.0, length)
    }

    /// A cylinder of this outer radius and length with a bore of the inner radius, m.
    pub fn tube(outer: f64, inner: f64, length: f64) -> Self {
        let squares = outer * outer + inner * inner;
        let across = squares / 4.0 + length * length / 12.0;
        Self::centred(PI * (outer * outer - inner * inner) * length, [across, across, squares / 2.0])
    }

    /// A cylinder of this radius and length with a half ball at each end, m.
    pub fn capsule(radius: f64, length: f64) -> Self {
        let (r, h) = (radius, length);
        // Shares of the two half balls and of the cylinder between them.
        let ball = 4.0 * r / (4.0 * r + 3.0 * h);
        let middle = 1.0 - ball;
        let across = middle * (3.0 * r * r + h * h) / 12.0 + ball * (0.4 * r * r + h * (3.0 * r + 2.0 * h) / 8.0);
        let along = middle * 0.5 * r * r + ball * 0.4 * r * r;
        Self::centred(PI * (r * r * h + 4.0 / 3.0 * r * r * r), [across, across, along])
    }

    /// A cone of this radius and height, m, with its base in the plane of x and y and its tip upwards.
    pub fn cone(radius: f64, height: f64) -> Self {
        let (r2, h2) = (radius * radius, height * height);
        let across = 3.0 / 20.0 * r2 + 3.0 / 80.0 * h2;
        let cone = Self::centred(PI * r2 * height / 3.0, [across, across, 0.3 * r2]);
        Self { center_m: Vec3::new(0.0, 0.0, height / 4.0), ..cone }
    }

    /// The solid that these triangles enclose; `None` where they enclose no volume.
    ///
    /// The pyramids have their apex at the centroid of the surface, and then at the centre that this gives.
    pub fn of_triangles(triangles: &[[Vec3<f64>; 3]], count: Pyramids) -> Option<Self> {
        let apex = centroid(triangles)?;
        let (volume, moment, _) = pyramids(triangles, &apex, count);
        let center_m = apex + moment / volume;
        let (volume_m3, _, moments_m5) = pyramids(triangles, &center_m, count);
        let is_solid = volume_m3 > 0.0 && center_m.iter().all(|x| x.is_finite());
        is_solid.then_some(Self { volume_m3, center_m, moments_m5 })
    }

    /// The solid of a mesh file (binary STL, OBJ, MSH), whose lengths are multiplied by `scale` to be m.
    ///
    /// # Errors
    ///
    /// The file cannot be read, is not a mesh of a known type, or its triangles enclose no volume.
    pub fn read(path: &Path, scale: f64) -> Result<Self, SolidError> {
        let shown = || path.display().to_string();
        let read = Files::on_disk().read(path).map_err(|error| unreadable(&error));
        let surface = read.and_then(|bytes| mesh_file::parse(path, &bytes));
        let surface = surface.map_err(|reason| SolidError::File { path: shown(), reason })?;
        let triangles: Vec<_> = surface.triangles().map(|face| face.map(|corner| corner * scale)).collect();
        Self::of_triangles(&triangles, Pyramids::Signed).ok_or_else(|| SolidError::Open { path: shown() })
    }

    /// The mass distribution with this density, kg/m³.
    pub fn with_density(&self, density_kg_m3: f64) -> Inertia<f64> {
        Inertia { mass: density_kg_m3 * self.volume_m3, com: self.center_m, about_com: self.moments_m5 * density_kg_m3 }
    }

    /// The mass distribution with this mass, kg.
    pub fn with_mass(&self, mass_kg: f64) -> Inertia<f64> {
        self.with_density(mass_kg / self.volume_m3)
    }

    /// About the centre, with moments per volume, m².
    fn centred(volume_m3: f64, moments_m2: [f64; 3]) -> Self {
        let moments_m5 = Mat3::from_diagonal(&Vec3::from(moments_m2)) * volume_m3;
        Self { volume_m3, center_m: Vec3::zeros(), moments_m5 }
    }
}

/// Volume, first moment and moments of inertia, about the apex, of the pyramids over the faces.
fn pyramids(triangles: &[[Vec3<f64>; 3]], apex: &Vec3<f64>, count: Pyramids) -> (f64, Vec3<f64>, Mat3<f64>) {
    let (mut volume, mut moment, mut second) = (0.0, Vec3::zeros(), Mat3::zeros());
    for triangle in triangles {
        let [a, b, c] = triangle.map(|corner| corner - apex);
        let signed = a.dot(&b.cross(&c)) / 6.0;
        let part = if count == Pyramids::Positive { signed.abs() } else { signed };
        let sum = a + b + c;
        volume += part;
        moment += sum * (0.25 * part);
        let squares = a * a.transpose() + b * b.transpose() + c * c.transpose() + sum * sum.transpose();
        second += squares * (part / 20.0);
    }
    (volume, moment, Mat3::from_diagonal_element(second.trace()) - second)
}

/// The centroid of the surface.
fn centroid(triangles: &[[Vec3<f64>; 3]]) -> Option<Vec3<f64>> {
    let (mut area, mut moment) = (0.0, Vec3::zeros());
    for [a, b, c] in triangles {
        let part = (b - a).cross(&(c - a)).norm();
        area += part;
        moment += (a + b + c) * (part / 3.0);
    }
    (area > 0.0).then(|| moment / area)
}

#[cfg(test)]
mod tests {
    use nalgebra::Rotation3;

    use super::*;

    const STEPS: usize = 160;

    /// ∫ over a grid of points: volume, centre and moments about it, of what is inside.
    fn integrated(half: [f64; 3], is_inside: impl Fn(&Vec3<f64>) -> bool) -> Solid {
        let at = |k: usize, axis: usize| half[axis] * (2.0 * (k as f64 + 0.5) / STEPS as f64 - 1.0);
        let cell: f64 = half.iter().map(|half| 2.0 * half / STEPS as f64).product();
        let (mut volume, mut first, mut second) = (0.0, Vec3::zeros(), Mat3::zeros());
        for point in
            (0..STEPS.pow(3)).map(|k| Vec3::new(at(k % STEPS, 0), at(k / STEPS % STEPS, 1), at(k / STEPS / STEPS, 2)))
        {
            if is_inside(&point) {
                volume += cell;
                first += point * cell;
                second += point * point.transpose() * cell;
            }
        }
        let center_m = first / volume;
        let about = second - center_m * center_m.transpose() * volume;
        Solid { volume_m3: volume, center_m, moments_m5: Mat3::from_diagonal_element(about.trace()) - about }
    }

    /// A cell at the surface counts as inside or outside: with 160 cells an edge that is below one per cent.
    #[test]
    fn shapes_are_their_integrals() {
        let flat = |p: &Vec3<f64>| p.x.hypot(p.y);
        let cases: [(&str, Solid, Solid); 6] = [
            ("box", Solid::cuboid([0.2, 0.3, 0.4]), integrated([0.1, 0.15, 0.2], |_| true)),
            (
                "ellipsoid",
                Solid::ellipsoid([0.1, 0.15, 0.2]),
                integrated([0.1, 0.15, 0.2], |p| {
                    (p.x / 0.1).powi(2) + (p.y / 0.15).powi(2) + (p.z / 0.2).powi(2) < 1.0
                }),
            ),
            ("cylinder", Solid::cylinder(0.1, 0.3), integrated([0.1, 0.1, 0.15], |p| flat(p) < 0.1)),
            ("tube", Solid::tube(0.1, 0.05, 0.3), integrated([0.1, 0.1, 0.15], |p| (0.05..0.1).contains(&flat(p)))),
            (
                "capsule",
                Solid::capsule(0.1, 0.3),
                integrated([0.1, 0.1, 0.25], |p| flat(p).hypot((p.z.abs() - 0.15).max(0.0)) < 0.1),
            ),
            (
                "cone",
                Solid::cone(0.1, 0.2),
                integrated([0.1, 0.1, 0.2], |p| p.z > 0.0 && flat(p) < 0.1 * (1.0 - p.z / 0.2)),
            ),
        ];
        for (name, ours, sum) in cases {
            assert!((ours.volume_m3 - sum.volume_m3).abs() < 0.01 * sum.volume_m3, "{name}");
            assert!((ours.center_m - sum.center_m).norm() < 1e-3, "{name} {}", sum.center_m);
            let scale = sum.moments_m5.amax();
            assert!((ours.moments_m5 - sum.moments_m5).amax() < 0.01 * scale, "{name} {}", sum.moments_m5);
        }
    }

    /// Two halves of a box, side by side, are the box: the theorem of parallel axes.
    #[test]
    fn two_halves_are_the_box() {
        let half = Solid::cuboid([0.1, 0.3, 0.4]).with_mass(2.0);
        let at = |x: f64| half.placed(&Mat3::identity(), &Vec3::new(x, 0.0, 0.0));
        let both = at(-0.05).joined(&at(0.05));
        let complete = Solid::cuboid([0.2, 0.3, 0.4]).with_mass(4.0);
        assert!((both.about_com - complete.about_com).amax() < 1e-15 && both.com.norm() < 1e-15);
        assert!((Solid::sphere(0.1).with_mass(1.0).about_com.m11 - 0.4 * 0.01).abs() < 1e-15);
    }

    /// R·I·Rᵀ about the moved centre.
    #[test]
    fn a_mesh_of_a_turned_box_has_its_products_of_inertia() {
        let edges = [0.2, 0.3, 0.4];
        let turn = Rotation3::from_euler_angles(0.4, -0.7, 1.1);
        let at = Vec3::new(0.5, -0.3, 0.2);
        let corner = |k: usize| Vec3::from_fn(|axis, _| edges[axis] * ((k >> axis & 1) as f64 - 0.5));
        let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles: Vec<[Vec3<f64>; 3]> = faces
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
            .map(|face| face.map(|k| turn * corner(k) + at))
            .collect();
        let expected = turn.matrix() * Solid::cuboid(edges).moments_m5 * turn.matrix().transpose();
        for count in [Pyramids::Signed, Pyramids::Positive] {
            let mesh = Solid::of_triangles(&triangles, count).unwrap();
            assert!((mesh.center_m - at).norm() < 1e-15);
            assert!((mesh.moments_m5 - expected).amax() < 1e-14 * expected.amax(), "{}", mesh.moments_m5);
        }
    }

    #[test]
    fn a_mesh_of_a_box_is_the_box() {
        let folder = std::env::temp_dir().join(format!("darm-solid-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("box.obj");
        let corners = (0..8).map(|k| format!("v {} {} {}\n", 100 + 200 * (k & 1), 300 * (k >> 1 & 1), 400 * (k >> 2)));
        let faces = "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
        std::fs::write(&path, corners.collect::<String>() + faces).unwrap();
        let mesh = Solid::read(&path, 1e-3).unwrap();
        let expected = Solid::cuboid([0.2, 0.3, 0.4]);
        assert!((mesh.volume_m3 - expected.volume_m3).abs() < 1e-12, "{mesh:?}");
        assert!((mesh.center_m - Vec3::new(0.2, 0.15, 0.2)).norm() < 1e-9);
        assert!((mesh.moments_m5 - expected.moments_m5).amax() < 1e-12);
        std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        let open = Solid::read(&path, 1.0).unwrap_err();
        assert!(matches!(open, SolidError::Open { .. }), "{open}");
        std::fs::remove_dir_all(&folder).unwrap();
        assert!(matches!(Solid::read(&path, 1.0), Err(SolidError::File { .. })));
    }
}
