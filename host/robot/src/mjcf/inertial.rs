//! Mass distribution of bodies: as they say, or of their geoms; bounds, balance and total mass as `<compiler>` sets them.

use darm_core::real::{Mat3, Vec3};
use darm_core::tree::Inertia;

use super::bodies::{Body, Item};
use super::classes::Settled;
use super::fault::{MjcfFault, Wrong};
use super::frame::pose;
use super::geom;
use super::mesh::Meshes;
use super::settings::{FromGeom, Settings};

/// The inertia of each body in its frame; that of the world does not count.
pub(super) fn inertias<'a>(
    bodies: &[Body<'a>],
    settings: &Settings,
    meshes: &mut Meshes<'a>,
) -> Result<Vec<Inertia<f64>>, Wrong> {
    let mut inertias = vec![Inertia::none()];
    for body in bodies.iter().skip(1) {
        inertias.push(bounded(&of_body(body, settings, meshes)?, settings));
    }
    let total: f64 = inertias.iter().map(|inertia| inertia.mass).sum();
    if let Some(wanted) = settings.total_mass_kg.filter(|_| total > 0.0) {
        for inertia in &mut inertias {
            inertia.mass *= wanted / total;
            inertia.about_com *= wanted / total;
        }
    }
    Ok(inertias)
}

fn of_body<'a>(body: &Body<'a>, settings: &Settings, meshes: &mut Meshes<'a>) -> Result<Inertia<f64>, Wrong> {
    let given = body.inertial.map(|item| given(item, settings)).transpose()?;
    let from_geoms = match settings.inertia_from_geom {
        FromGeom::Always => true,
        FromGeom::Never => false,
        FromGeom::WhereNotGiven => given.is_none(),
    };
    let mut sum = None;
    for item in body.geoms.iter().filter(|_| from_geoms) {
        if let Some(inertia) = geom::inertia(item.element, settings, meshes)? {
            let placed = inertia.placed(&item.frame.rotation, &item.frame.position);
            sum = Some(sum.map_or(placed, |sum: Inertia<f64>| sum.joined(&placed)));
        }
    }
    Ok(sum.or(given).unwrap_or(Inertia::none()))
}

/// What `<inertial>` says.
fn given(item: Item<'_>, settings: &Settings) -> Result<Inertia<f64>, Wrong> {
    let element: Settled<'_> = item.element;
    let missing = |attribute| element.part.wrong(MjcfFault::Missing { element: "inertial".into(), attribute });
    let mass = element.number("mass")?.ok_or_else(|| missing("mass"))?;
    if mass < 0.0 {
        return Err(element.part.wrong(MjcfFault::Negative { what: "mass", value: mass }));
    }
    let about_com = match element.numbers::<6>("fullinertia")? {
        Some([xx, yy, zz, xy, xz, yz]) => Mat3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
        None => Mat3::from_diagonal(&Vec3::from(element.numbers("diaginertia")?.unwrap_or([0.0; 3]))),
    };
    let at = item.frame * pose(element, settings)?;
    Ok(Inertia { mass, com: Vec3::zeros(), about_com }.placed(&at.rotation, &at.position))
}

/// Mass and principal moments that are not below their bounds, and possible where the compiler balances them.
fn bounded(inertia: &Inertia<f64>, settings: &Settings) -> Inertia<f64> {
    let mass = inertia.mass.max(settings.bound_mass_kg);
    let is_bounded = settings.bound_inertia_kg_m2 > 0.0;
    if !is_bounded && !settings.balance_inertia {
        return Inertia { mass, ..*inertia };
    }
    let mut eigen = inertia.about_com.symmetric_eigen();
    let moments = &mut eigen.eigenvalues;
    moments.apply(|moment| *moment = moment.max(settings.bound_inertia_kg_m2));
    if settings.balance_inertia && 2.0 * moments.max() > moments.sum() {
        *moments = Vec3::repeat(moments.mean());
    }
    Inertia { mass, about_com: eigen.recompose(), ..*inertia }
}
