//! The shapes of `<collision>` elements: boxes, spheres, cylinders, capsules, and meshes as their hulls.

use std::path::PathBuf;

use darm_core::real::Vec3;

use super::elements::{Named, Wrong, number, numbers, required};
use super::fault::UrdfFault;
use super::hierarchy::named;
use crate::mesh_file;
use crate::shape::{Geometry, LinkShape};
use crate::source::{Source, unreadable};
use crate::xml::Element;

pub(super) fn shapes(robot: Element<'_>, source: &Source) -> Result<Vec<LinkShape>, Wrong> {
    let mut shapes = Vec::new();
    for link in named(robot, "link")? {
        for element in link.element.children().filter(|child| child.tag() == "collision") {
            let missing = || (element.span(), UrdfFault::Shape { link: link.name.into() });
            let geometry = element.child("geometry").and_then(|geometry| geometry.children().next());
            let geometry = shape(geometry.ok_or_else(missing)?, source)?.ok_or_else(missing)?;
            let pose = Named { element, name: link.name }.origin()?;
            shapes.push(LinkShape { link: link.name.into(), pose, geometry });
        }
    }
    Ok(shapes)
}

/// `None`: a shape that is not read.
fn shape(element: Element<'_>, source: &Source) -> Result<Option<Geometry>, Wrong> {
    let size = |attribute: &'static str| above_zero(element, attribute, number(element, attribute, 0.0)?);
    Ok(Some(match element.tag() {
        "box" => {
            let [x, y, z] = numbers(element, "size", [0.0; 3])?;
            above_zero(element, "size", x.min(y).min(z))?;
            Geometry::Cuboid { half_m: Vec3::new(x, y, z) * 0.5 }
        }
        "sphere" => Geometry::Sphere { radius_m: size("radius")? },
        "cylinder" => Geometry::Cylinder { radius_m: size("radius")?, half_m: 0.5 * size("length")? },
        "capsule" => Geometry::Capsule { radius_m: size("radius")?, half_m: 0.5 * size("length")? },
        "mesh" => Geometry::Hull(corners(element, source)?),
        _ => return Ok(None),
    }))
}

fn above_zero(element: Element<'_>, attribute: &'static str, value: f64) -> Result<f64, Wrong> {
    let span = || element.attribute(attribute).map_or_else(|| element.span(), |attribute| attribute.span.clone());
    if value > 0.0 { Ok(value) } else { Err((span(), UrdfFault::Size { attribute })) }
}

/// The corners of a mesh.
fn corners(element: Element<'_>, source: &Source) -> Result<Vec<Vec3<f64>>, Wrong> {
    let path = path(required(element, "filename")?, source);
    let scale = Vec3::from(numbers(element, "scale", [1.0; 3])?);
    let read = source.files().read(&path).map_err(|error| unreadable(&error));
    let surface = read.and_then(|bytes| mesh_file::parse(&path, &bytes)).map_err(|reason| {
        let span = element.attribute("filename").map_or_else(|| element.span(), |attribute| attribute.span.clone());
        (span, UrdfFault::Mesh { path: path.display().to_string(), reason })
    })?;
    Ok(surface.vertices.iter().map(|corner| corner.component_mul(&scale)).collect())
}

/// A path relative to the URDF; `package://NAME/PATH` is looked for in its folder and in those above.
fn path(named: &str, source: &Source) -> PathBuf {
    let Some(in_package) = named.strip_prefix("package://") else {
        return source.companion(named.strip_prefix("file://").unwrap_or(named));
    };
    let companion = source.companion(in_package);
    let inside = in_package.split_once('/').map_or(in_package, |(_, path)| path);
    let above = match source.files().is_disk() {
        true => source.companion(".").canonicalize().unwrap_or_default(),
        false => source.companion(""),
    };
    let found = above.ancestors().flat_map(|folder| [folder.join(in_package), folder.join(inside)]);
    found.into_iter().find(|path| source.files().has(path)).unwrap_or(companion)
}
