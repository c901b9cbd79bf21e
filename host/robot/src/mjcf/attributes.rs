//! Attributes that the elements of bodies, defaults and settings have: any other one is probably misspelled, and is reported.
//!
//! Source: <https://mujoco.readthedocs.io/en/stable/XMLreference.html>.

use super::files::Part;

/// Where an element is and which way it points.
const POSE: [&str; 6] = ["pos", "quat", "axisangle", "xyaxes", "zaxis", "euler"];
const NAMES: [&str; 2] = ["name", "class"];

/// The attributes of an element beside those of names and poses; `None` of an element that is not read.
fn attributes(tag: &str) -> Option<&'static str> {
    Some(match tag {
        "mujoco" => "model",
        "compiler" => {
            "autolimits boundmass boundinertia settotalmass balanceinertia strippath coordinate angle fitaabb eulerseq meshdir \
             texturedir assetdir discardvisual usethread fusestatic inertiafromgeom inertiagrouprange saveinertial alignfree \
             conflict convexhull exactmeshinertia"
        }
        "option" => {
            "timestep apirate impratio tolerance ls_tolerance noslip_tolerance mpr_tolerance ccd_tolerance sleep_tolerance \
             gravity wind magnetic density viscosity o_margin o_solref o_solimp o_friction integrator collision cone jacobian \
             solver iterations ls_iterations noslip_iterations mpr_iterations ccd_iterations sdf_iterations sdf_initpoints \
             actuatorgroupdisable"
        }
        "worldbody" | "body" | "frame" => "childclass mocap gravcomp sleep simple fuse user",
        "inertial" => "mass diaginertia fullinertia",
        "freejoint" => "group align",
        "joint" => {
            "type group axis springdamper limited actuatorfrclimited solreflimit solimplimit solreffriction solimpfriction \
             stiffness range actuatorfrcrange actuatorgravcomp margin ref springref armature damping frictionloss user"
        }
        "geom" => {
            "type contype conaffinity condim group priority size material friction mass density shellinertia solmix solref \
             solimp margin gap surfacevel adhesion fromto hfield mesh fitscale rgba fluidshape fluidcoef user"
        }
        "site" => "type group material mesh size fromto rgba user",
        "mesh" => {
            "content_type file vertex normal texcoord face refpos refquat scale smoothnormal maxhullvert inertia builtin \
             params material octree_maxdepth"
        }
        _ => return None,
    })
}

/// The places and names of attributes that no element of its kind has.
pub(super) fn unknown(root: Part<'_>) -> Vec<String> {
    let mut ahead = vec![root];
    let mut found = Vec::new();
    while let Some(part) = ahead.pop() {
        let known = attributes(part.tag());
        let is_known = |name: &str| {
            let of_tag = |known: &str| known.split_whitespace().any(|known| known == name);
            known.is_none_or(of_tag) || NAMES.contains(&name) || POSE.contains(&name) || name.contains(':')
        };
        let unknown = part.attributes().iter().filter(|attribute| !is_known(&attribute.name));
        let said = unknown.map(|attribute| {
            let (tag, name) = (part.tag(), &attribute.name);
            format!("{}: unknown attribute `{name}` of <{tag}> is ignored; correct it", part.place_of(attribute))
        });
        found.extend(said);
        // Elements of other lists, such as the <joint> of an equality, have other attributes.
        let is_read =
            |child: &Part<'_>| matches!(child.tag(), "default" | "asset") || attributes(child.tag()).is_some();
        ahead.extend(part.children().into_iter().rev().filter(is_read));
    }
    found
}
