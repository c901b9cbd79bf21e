//! The shapes of geoms that collide: spheres, capsules, cylinders, boxes, and meshes as their hulls.

use darm_core::real::Vec3;

use super::bodies::{Item, Trees, bodies};
use super::classes::{Classes, Settled};
use super::fault::Wrong;
use super::files::Files;
use super::geom::placed;
use super::mesh::Meshes;
use super::settings::Settings;
use crate::shape::{Geometry, LinkShape};

pub(super) fn shapes(files: &Files) -> Result<Vec<LinkShape>, Wrong> {
    let root = files.root();
    let (classes, settings) = (Classes::of(root)?, Settings::of(root)?);
    let meshes = Meshes::of(files, &classes)?;
    let mut shapes = Vec::new();
    for body in Trees::of(root, bodies(root, &classes, &settings)?, None)?.bodies {
        for Item { element, frame } in &body.geoms {
            if collides(*element)? {
                let (at, size) = placed(*element, &settings)?;
                let geometry = geometry(*element, &size, &settings, &meshes)?;
                shapes.push(LinkShape { link: body.name.clone(), pose: *frame * at, geometry });
            }
        }
    }
    Ok(shapes)
}

/// Planes and height fields are of the world, not of a robot.
fn collides(geom: Settled<'_>) -> Result<bool, Wrong> {
    let is_set = |bits: &str| Ok::<bool, Wrong>(geom.number(bits)?.unwrap_or(1.0) != 0.0);
    let is_surface = matches!(geom.value("type"), Some("plane" | "hfield"));
    Ok(!is_surface && (is_set("contype")? || is_set("conaffinity")?))
}

fn geometry<'a>(geom: Settled<'a>, size: &[f64], settings: &Settings, meshes: &Meshes<'a>) -> Result<Geometry, Wrong> {
    let side = |k: usize| {
        let above_zero = size.get(k).copied().filter(|size| *size > 0.0);
        above_zero.ok_or_else(|| geom.wrong_value("size", "as many sizes above 0 as the type has"))
    };
    match geom.value("type").unwrap_or("sphere") {
        "mesh" => Ok(Geometry::Hull(meshes.corners(geom, settings)?)),
        _ if geom.has("mesh") => Err(geom.part.unsupported("a shape that is fitted to a mesh", "give it a size")),
        "sphere" => Ok(Geometry::Sphere { radius_m: side(0)? }),
        "box" => Ok(Geometry::Cuboid { half_m: Vec3::new(side(0)?, side(1)?, side(2)?) }),
        "cylinder" => Ok(Geometry::Cylinder { radius_m: side(0)?, half_m: side(1)? }),
        "capsule" => Ok(Geometry::Capsule { radius_m: side(0)?, half_m: side(1)? }),
        shape => Err(geom.part.unsupported(format!("the collision of a geom of type {shape}"), "give it another type")),
    }
}
