//! Attributes that the elements of links and joints have: any other one changes nothing, and is reported.
//!
//! Source: <https://github.com/ros/urdfdom/blob/master/xsd/urdf.xsd>.

use crate::source::Source;
use crate::xml::Element;

/// The attributes of an element, and the elements in it that are read; `None` of an element that is not read.
fn known(tag: &str) -> Option<(&'static str, &'static str)> {
    Some(match tag {
        "robot" => ("name version", "link joint"),
        "link" => ("name type", "inertial collision"),
        "joint" => ("name type", "origin parent child axis limit dynamics mimic"),
        "inertial" => ("name", "origin mass inertia"),
        "collision" => ("name group", "origin geometry"),
        "geometry" => ("", "box sphere cylinder capsule mesh"),
        "origin" => ("xyz rpy quat_xyzw", ""),
        "parent" | "child" => ("link", ""),
        "axis" => ("xyz", ""),
        "limit" => ("lower upper effort velocity acceleration deceleration jerk", ""),
        "dynamics" => ("damping friction", ""),
        "mimic" => ("joint multiplier offset", ""),
        "mass" => ("value", ""),
        "inertia" => ("ixx ixy ixz iyy iyz izz", ""),
        "box" => ("size", ""),
        "sphere" => ("radius", ""),
        "cylinder" | "capsule" => ("radius length", ""),
        "mesh" => ("filename scale", ""),
        _ => return None,
    })
}

/// The places and names of attributes that no element of its kind has.
pub(super) fn unread(root: Element<'_>, source: &Source) -> Vec<String> {
    let (mut ahead, mut found) = (vec![root], Vec::new());
    while let Some(element) = ahead.pop() {
        let Some((attributes, inside)) = known(element.tag()) else { continue };
        let is_in = |list: &str, name: &str| list.split_whitespace().any(|known| known == name);
        let unknown = element.attributes().iter().filter(|own| {
            // Names with a prefix and declarations of prefixes are of other programs.
            !is_in(attributes, &own.name) && !own.name.contains(':') && own.name != "xmlns"
        });
        found.extend(unknown.map(|own| {
            let place = source.location(own.name_span.clone());
            format!("{place}: unknown attribute `{}` of <{}> is ignored; correct it", own.name, element.tag())
        }));
        ahead.extend(element.children().rev().filter(|child| is_in(inside, child.tag())));
    }
    found
}
