//! Mass distribution of geoms: solids of constant density, by their shape and size.

use darm_core::real::{Mat3, Vec3};
use darm_core::se::Pose;
use darm_core::tree::Inertia;

use super::classes::Settled;
use super::fault::{MjcfFault, Wrong};
use super::frame::{along, pose};
use super::mesh::Meshes;
use super::settings::Settings;

const DENSITY_KG_M3: f64 = 1000.0;
/// A segment shorter than this has no direction, m.
const SHORT_M: f64 = 1e-14;

/// A solid of density 1: its volume in m³, and its moments about its centre, m⁵.
struct Solid {
    volume: f64,
    center: Vec3<f64>,
    moments: Mat3<f64>,
}

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
        "mesh" => {
            let (volume, center, moments) = meshes.solid(geom, settings)?;
            Solid { volume, center, moments }
        }
        _ if geom.has("mesh") => {
            return Err(geom.part.unsupported("a shape that is fitted to a mesh", "give the body an <inertial>"));
        }
        _ => primitive(geom, shape, &size)?,
    };
    let scale = mass.map_or(density, |mass| mass / solid.volume);
    let about_com = solid.moments * scale;
    let inertia = Inertia { mass: scale * solid.volume, com: solid.center, about_com };
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
    use std::f64::consts::PI;
    let side = |k: usize| {
        let above_zero = size.get(k).copied().filter(|size| *size > 0.0);
        above_zero.ok_or_else(|| geom.wrong_value("size", "as many sizes above 0 as the type has"))
    };
    let solid = |volume: f64, moments: [f64; 3]| Solid {
        volume,
        center: Vec3::zeros(),
        moments: Mat3::from_diagonal(&Vec3::from(moments)) * volume,
    };
    match shape {
        "sphere" => {
            let r = side(0)?;
            Ok(solid(4.0 / 3.0 * PI * r * r * r, [0.4 * r * r; 3]))
        }
        "box" => {
            let [a, b, c] = [side(0)?, side(1)?, side(2)?];
            let squares = [b * b + c * c, a * a + c * c, a * a + b * b];
            Ok(solid(8.0 * a * b * c, squares.map(|sum| sum / 3.0)))
        }
        "ellipsoid" => {
            let [a, b, c] = [side(0)?, side(1)?, side(2)?];
            let squares = [b * b + c * c, a * a + c * c, a * a + b * b];
            Ok(solid(4.0 / 3.0 * PI * a * b * c, squares.map(|sum| sum / 5.0)))
        }
        "cylinder" => {
            let [r, h] = [side(0)?, 2.0 * side(1)?];
            let across = (3.0 * r * r + h * h) / 12.0;
            Ok(solid(PI * r * r * h, [across, across, 0.5 * r * r]))
        }
        "capsule" => {
            let [r, h] = [side(0)?, 2.0 * side(1)?];
            // Shares of the two half balls and of the cylinder between them.
            let ball = 4.0 * r / (4.0 * r + 3.0 * h);
            let middle = 1.0 - ball;
            let across = middle * (3.0 * r * r + h * h) / 12.0 + ball * (0.4 * r * r + h * (3.0 * r + 2.0 * h) / 8.0);
            let along = middle * 0.5 * r * r + ball * 0.4 * r * r;
            Ok(solid(PI * (r * r * h + 4.0 / 3.0 * r * r * r), [across, across, along]))
        }
        _ => Err(geom.part.unsupported(format!("the mass of a geom of type {shape}"), "give the body an <inertial>")),
    }
}
