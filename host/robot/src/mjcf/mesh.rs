//! Meshes of a model: their surfaces, and the solids that these enclose.
//!
//! `exact` sums pyramids with their signs, which is right for a closed surface; `legacy`, the default, takes all as positive,
//! which is right for a convex one. Source: MuJoCo, XML reference, asset/mesh/inertia.

use std::collections::HashMap;
use std::path::PathBuf;

use darm_core::real::Vec3;
use nalgebra::{Quaternion, UnitQuaternion};

use super::classes::{Classes, MAIN, Settled};
use super::fault::{MjcfFault, Wrong};
use super::files::{Files, Part};
use super::settings::Settings;
use crate::mesh_file::{Surface, parse};
use crate::rigid_body::solid::{Pyramids, Solid};
use crate::source::unreadable;
use crate::xml::Attribute;

/// The meshes that a model lists, each read when its mass is needed.
pub(super) struct Meshes<'a> {
    files: &'a Files,
    listed: HashMap<String, Settled<'a>>,
    read: HashMap<String, Solid>,
}

impl<'a> Meshes<'a> {
    pub(super) fn of(files: &'a Files, classes: &'a Classes<'a>) -> Result<Self, Wrong> {
        let mut listed = HashMap::new();
        for part in files.root().named("asset").flat_map(|asset| asset.named("mesh").collect::<Vec<Part<'a>>>()) {
            let file = || part.value("file").map(|file| PathBuf::from(file.replace('\\', "/")));
            let stem = || Some(file()?.file_stem()?.to_string_lossy().into_owned());
            if let Some(name) = part.value("name").map(str::to_owned).or_else(stem) {
                listed.insert(name, classes.settle(part, MAIN)?);
            }
        }
        Ok(Self { files, listed, read: HashMap::new() })
    }

    /// The solid of the mesh that a geom names, in the frame of its file.
    pub(super) fn solid(&mut self, geom: Settled<'a>, settings: &Settings) -> Result<Solid, Wrong> {
        let (name, mesh) = self.named(geom)?;
        if let Some(solid) = self.read.get(name) {
            return Ok(*solid);
        }
        let surface = self.surface(mesh, settings)?;
        let triangles: Vec<[Vec3<f64>; 3]> = surface.triangles().collect();
        let found = match mesh.value("inertia").unwrap_or("legacy") {
            "legacy" => Solid::of_triangles(&triangles, Pyramids::Positive),
            "exact" => Solid::of_triangles(&triangles, Pyramids::Signed),
            mode => {
                let what = format!("the inertia `{mode}` of a mesh");
                return Err(mesh.part.unsupported(what, "give the body an <inertial>"));
            }
        };
        let empty = || mesh.part.unsupported("a mesh without volume", "give the body an <inertial>");
        let solid = found.ok_or_else(empty)?;
        self.read.insert(name.to_owned(), solid);
        Ok(solid)
    }

    /// The corners of the mesh that a geom names, in the frame of its file.
    pub(super) fn corners(&self, geom: Settled<'a>, settings: &Settings) -> Result<Vec<Vec3<f64>>, Wrong> {
        Ok(self.surface(self.named(geom)?.1, settings)?.vertices)
    }

    /// The mesh that a geom names.
    fn named(&self, geom: Settled<'a>) -> Result<(&'a str, Settled<'a>), Wrong> {
        let missing = || geom.part.wrong(MjcfFault::Missing { element: "geom".into(), attribute: "mesh" });
        let name = geom.value("mesh").ok_or_else(missing)?;
        let unknown = || geom.part.wrong(MjcfFault::Unknown { what: "mesh", name: name.into() });
        Ok((name, *self.listed.get(name).ok_or_else(unknown)?))
    }

    /// The surface of a mesh, moved and scaled as its element says.
    fn surface(&self, mesh: Settled<'a>, settings: &Settings) -> Result<Surface, Wrong> {
        let mut surface = match (mesh.part.attribute("file"), mesh.part.attribute("vertex")) {
            (Some(file), _) => self.file(mesh.part, file, settings)?,
            (None, Some(vertices)) => inline(mesh.part, vertices)?,
            (None, None) => {
                return Err(mesh.part.unsupported("a mesh without a file or vertices", "give the body an <inertial>"));
            }
        };
        let reference = Vec3::from(mesh.numbers("refpos")?.unwrap_or([0.0; 3]));
        let [w, x, y, z] = mesh.numbers("refquat")?.unwrap_or([1.0, 0.0, 0.0, 0.0]);
        let turn = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 0.0);
        let wrong = || mesh.wrong_value("refquat", "a quaternion other than 0 0 0 0");
        let turn = turn.ok_or_else(wrong)?.inverse();
        let scale = Vec3::from(mesh.numbers("scale")?.unwrap_or([1.0; 3]));
        for vertex in &mut surface.vertices {
            *vertex = (turn * (*vertex - reference)).component_mul(&scale);
        }
        if scale.product() < 0.0 {
            surface.faces.iter_mut().for_each(|face| face.swap(1, 2));
        }
        Ok(surface)
    }

    fn file(&self, mesh: Part<'a>, file: &Attribute, settings: &Settings) -> Result<Surface, Wrong> {
        let named = PathBuf::from(file.value.replace('\\', "/"));
        let named = if settings.strip_path { named.file_name().map_or(PathBuf::new(), PathBuf::from) } else { named };
        let path = self.files.path(&PathBuf::from(&settings.mesh_folder).join(named).to_string_lossy());
        let read = self.files.bytes(&path).map_err(|error| unreadable(&error));
        read.and_then(|bytes| parse(&path, &bytes)).map_err(|reason| {
            let fault = MjcfFault::File { path: path.display().to_string(), reason };
            Wrong { span: file.span.clone(), ..mesh.wrong(fault) }
        })
    }
}

/// A mesh whose vertices and faces are in the model.
fn inline(mesh: Part<'_>, vertices: &Attribute) -> Result<Surface, Wrong> {
    let Some(faces) = mesh.attribute("face") else {
        return Err(mesh.unsupported("a mesh of vertices without faces", "give the body an <inertial>"));
    };
    let of_three = |attribute: &Attribute| {
        let numbers = attribute.numbers().filter(|numbers| numbers.len() % 3 == 0);
        numbers.ok_or_else(|| mesh.wrong_value(attribute, "three numbers for each"))
    };
    let vertices: Vec<_> = of_three(vertices)?.chunks_exact(3).map(|v| Vec3::new(v[0], v[1], v[2])).collect();
    let faces: Vec<[usize; 3]> =
        of_three(faces)?.chunks_exact(3).map(|f| [f[0] as usize, f[1] as usize, f[2] as usize]).collect();
    if faces.iter().flatten().any(|&vertex| vertex >= vertices.len()) {
        return Err(mesh.unsupported("a face of vertices that the mesh does not have", "correct its numbers"));
    }
    Ok(Surface { vertices, faces })
}
