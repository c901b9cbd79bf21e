//! Attributes and elements that those of links and joints have: any other one changes nothing, and is reported.
//!
//! Source: <https://github.com/ros/urdfdom/blob/master/xsd/urdf.xsd>.

use crate::source::Source;
use crate::xml::Element;

/// The attributes of an element, the elements in it that are read, and those that are not read and change nothing here; `None`
/// of an element that is not read.
fn known(tag: &str) -> Option<[&'static str; 3]> {
    Some(match tag {
        "robot" => ["name version", "link joint", ""],
        "link" => ["name type", "inertial collision", "visual"],
        "joint" => ["name type", "origin parent child axis limit dynamics mimic", "calibration safety_controller"],
        "inertial" => ["name", "origin mass inertia", ""],
        "collision" => ["name group", "origin geometry", "verbose"],
        "geometry" => ["", "box sphere cylinder capsule mesh", ""],
        "origin" => ["xyz rpy quat_xyzw", "", ""],
        "parent" | "child" => ["link", "", ""],
        "axis" => ["xyz", "", ""],
        "limit" => ["lower upper effort velocity acceleration deceleration jerk", "", ""],
        "dynamics" => ["damping friction", "", ""],
        "mimic" => ["joint multiplier offset", "", ""],
        "mass" => ["value", "", ""],
        "inertia" => ["ixx ixy ixz iyy iyz izz", "", ""],
        "box" => ["size", "", ""],
        "sphere" => ["radius", "", ""],
        "cylinder" | "capsule" => ["radius length", "", ""],
        "mesh" => ["filename scale", "", ""],
        _ => return None,
    })
}

/// The elements of which another one may have several.
const REPEATED: [&str; 4] = ["link", "joint", "collision", "visual"];

/// The places and names of attributes and elements that no element of its kind has, and of elements after the first of a kind that
/// there is one of.
pub(super) fn unread(root: Element<'_>, source: &Source) -> Vec<String> {
    let (mut ahead, mut found) = (vec![root], Vec::new());
    while let Some(element) = ahead.pop() {
        let Some([attributes, inside, silent]) = known(element.tag()) else { continue };
        let is_in = |list: &str, name: &str| list.split_whitespace().any(|known| known == name);
        let unknown = element.attributes().iter().filter(|own| {
            // Names with a prefix and declarations of prefixes are of other programs.
            !is_in(attributes, &own.name) && !own.name.contains(':') && own.name != "xmlns"
        });
        found.extend(unknown.map(|own| {
            let place = source.location(own.name_span.clone());
            format!("{place}: unknown attribute `{}` of <{}> is ignored; correct it", own.name, element.tag())
        }));
        let mut read: Vec<Element<'_>> = Vec::new();
        for child in element.children() {
            let (tag, is_known) = (child.tag(), is_in(inside, child.tag()));
            let is_again = is_known && !REPEATED.contains(&tag) && read.iter().any(|other| other.tag() == tag);
            // On the top level are elements of many programs.
            let is_unknown = !is_known && !is_in(silent, tag) && element.tag() != "robot" && !tag.contains(':');
            if is_again || is_unknown {
                let which = if is_again { "second" } else { "unknown" };
                let place = source.location(child.span());
                found.push(format!("{place}: {which} element <{tag}> of <{}> is ignored; correct it", element.tag()));
            } else if is_known {
                read.push(child);
            }
        }
        ahead.extend(read.into_iter().rev());
    }
    found
}
