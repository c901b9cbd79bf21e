//! Mass distribution of geoms: solids of constant density, by their shape and size.

use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_core::tree::Inertia;

use super::classes::Settled;
use super::fault::{MjcfFault, Wrong};
use super::frame::{along, pose};
use super::mesh::Meshes;
use super::settings::Settings;
use crate::rigid_body::solid::Solid;

const DENSITY_KG_M3: f64 = 1000.0;
/// A segment shorter than this has no direction, m.
const SHORT_M: f64 = 1e-14;

/// The mass distribution of a geom in the frame that its pose is given in; `None` where its mass does not count.
pub(super) fn inertia<'a>(
    geom: Settled<'a>,
    settings: &Settings,
    meshes: &mut Meshes<'a>,
) -> Result<Option<Inertia<f64>>, Wrong> {
    let [first, last] = settings.inertia_groups;
    let (group, mass) = (geom.number("group")?.unwrap_or(0.0), geom.number("mass")?);
    let density = geom.number("density")?.unwrap_or(DENSITY_KG_M3);
    let shape = geom.value("type").unwrap_or("sphere");
    if group < first || group > last || mass.unwrap_or(density) == 0.0 || matches!(shape, "plane" | "hfield") {
        return Ok(None);
    }
    for (attribute, what) in [("mass", "mass"), ("density", "density")] {
        if let Some(value) = geom.number(attribute)?.filter(|value| *value < 0.0) {
            return Err(geom.part.wrong(MjcfFault::Negative { what, value }));
        }
    }
    if geom.value("shellinertia") == Some("true") {
        return Err(geom.part.unsupported("shellinertia", "give the body an <inertial>"));
    }
    let (placed, size) = placed(geom, settings)?;
    let solid = match shape {
        "mesh" => meshes.solid(geom, settings)?,
        _ if geom.has("mesh") => {
            return Err(geom.part.unsupported("a shape that is fitted to a mesh", "give the body an <inertial>"));
        }
        _ => primitive(geom, shape, &size)?,
    };
    let inertia = mass.map_or_else(|| solid.with_density(density), |mass| solid.with_mass(mass));
    Ok(Some(inertia.placed(&placed.rotation, &placed.position)))
}

/// The pose of a geom and its sizes, from its ends where it has `fromto`.
pub(super) fn placed(geom: Settled<'_>, settings: &Settings) -> Result<(Pose<f64>, Vec<f64>), Wrong> {
    let mut size = geom.list("size")?;
    let Some([a, b, c, d, e, f]) = geom.numbers("fromto")? else { return Ok((pose(geom, settings)?, size)) };
    let (from, to) = (Vec3::new(a, b, c), Vec3::new(d, e, f));
    let z = from - to;
    let direction = z.try_normalize(SHORT_M).ok_or_else(|| geom.wrong_value("fromto", "two points that differ"))?;
    let half = 0.5 * z.norm();
    match (geom.value("type"), &size[..]) {
        (Some("capsule" | "cylinder"), [radius, ..]) => size = vec![*radius, half],
        (Some("box" | "ellipsoid"), [width, ..]) => size = vec![*width, *width, half],
        _ => return Err(geom.wrong_value("fromto", "a capsule, cylinder, box or ellipsoid with a size")),
    }
    Ok((Pose { rotation: along(&direction), position: (from + to) * 0.5 }, size))
}

fn primitive(geom: Settled<'_>, shape: &str, size: &[f64]) -> Result<Solid, Wrong> {
    let side = |k: usize| {
        let above_zero = size.get(k).copied().filter(|size| *size > 0.0);
        above_zero.ok_or_else(|| geom.wrong_value("size", "as many sizes above 0 as the type has"))
    };
    match shape {
        "sphere" => Ok(Solid::sphere(side(0)?)),
        "box" => Ok(Solid::cuboid([side(0)?, side(1)?, side(2)?].map(|half| 2.0 * half))),
        "ellipsoid" => Ok(Solid::ellipsoid([side(0)?, side(1)?, side(2)?])),
        "cylinder" => Ok(Solid::cylinder(side(0)?, 2.0 * side(1)?)),
        "capsule" => Ok(Solid::capsule(side(0)?, 2.0 * side(1)?)),
        _ => Err(geom.part.unsupported(format!("the mass of a geom of type {shape}"), "give the body an <inertial>")),
    }
}
