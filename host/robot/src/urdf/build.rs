//! From the elements of a URDF to a [`Robot`] that has been checked: a walk over its links from the root.

use darm_core::actuator::Axis;
use darm_core::real::Vec3;
use darm_core::tree::{Inertia, Joint};

use super::elements::{Kind, Wrong};
use super::fault::UrdfFault;
use super::hierarchy::Hierarchy;
use crate::assembly::{Assembly, LinkPose, Selection};
use crate::robot::{Robot, RobotJoint};
use crate::xml::Element;

const GRAVITY_M_S2: f64 = 9.81;

pub(super) fn robot(root: Element<'_>, selection: &Selection) -> Result<Robot, Wrong> {
    if root.tag() != "robot" {
        return Err((root.span(), UrdfFault::Root { tag: root.tag().into() }));
    }
    let hierarchy = Hierarchy::of(root, selection.root.as_deref())?;
    let (mimics, places) = hierarchy.mimics()?;
    let link = hierarchy.links[hierarchy.root].name;
    let name = root.value("name").filter(|name| !name.is_empty()).unwrap_or(link);
    let gravity = Vec3::new(0.0, 0.0, -GRAVITY_M_S2);
    let assembly = Assembly::new(name, gravity, &selection.locks, &mimics).map_err(|joint| {
        let place = places.get(joint.as_str()).cloned().unwrap_or(root.span());
        (place, UrdfFault::MimicCycle { joint })
    })?;
    let mut walk = Walk { hierarchy: &hierarchy, assembly, unlimited: Vec::new() };
    let mut ahead = vec![(None, LinkPose::on_base())];
    let mut visited = vec![false; hierarchy.links.len()];
    while let Some((joint, place)) = ahead.pop() {
        let (link, place) = match joint {
            Some(joint) => (hierarchy.child_of[joint], walk.joint(joint, &place)?),
            None => (hierarchy.root, place),
        };
        if std::mem::replace(&mut visited[link], true) {
            let link = hierarchy.links[link];
            return Err(link.wrong(UrdfFault::Loop { link: link.name.into() }));
        }
        let (element, children) = (hierarchy.links[link], &hierarchy.children[link]);
        walk.assembly.link(element.name, &place, &element.inertia()?, children.is_empty());
        ahead.extend(children.iter().rev().map(|&joint| (Some(joint), place)));
    }
    if let Some(link) = visited.iter().position(|visited| !visited).filter(|_| hierarchy.is_complete) {
        let link = hierarchy.links[link];
        return Err(link.wrong(UrdfFault::Loop { link: link.name.into() }));
    }
    walk.finish(root)
}

/// The robot as far as the walk from the root has come.
struct Walk<'a> {
    hierarchy: &'a Hierarchy<'a>,
    assembly: Assembly<'a>,
    unlimited: Vec<String>,
}

impl Walk<'_> {
    /// Takes a joint in, and gives the place of the link that it carries.
    fn joint(&mut self, index: usize, on: &LinkPose) -> Result<LinkPose, Wrong> {
        let (joint, hierarchy) = (self.hierarchy.joints[index], self.hierarchy);
        let placement = joint.origin()?;
        let (kind, is_continuous) = match joint.kind()? {
            Kind::Fixed => return Ok(on.then(&placement)),
            Kind::Floating if hierarchy.children[hierarchy.root] == [index] => return Ok(self.assembly.float()),
            Kind::Floating => {
                let advice = "the only joint of the root link";
                return Err(joint.wrong(UrdfFault::Kind { joint: joint.name.into(), kind: "floating", advice }));
            }
            Kind::Moving { kind, is_continuous } => (kind, is_continuous),
        };
        let limits = joint.limits()?.filter(|_| !is_continuous);
        let axis = Axis { kind, direction: joint.axis()? };
        let above_zero = |number: f64| Some(number).filter(|number| *number > 0.0);
        let link = hierarchy.links[hierarchy.child_of[index]].name.to_owned();
        let moving = Joint { parent: None, axis, placement, inertia: Inertia::none() };
        let found = RobotJoint {
            limits,
            effort: above_zero(joint.number("limit", "effort")?),
            velocity: above_zero(joint.number("limit", "velocity")?),
            damping: joint.number("dynamics", "damping")?,
            friction: joint.number("dynamics", "friction")?,
            ..RobotJoint::new(joint.name.to_owned(), link, moving)
        };
        let place = self.assembly.joint(on, found);
        if limits.is_none() && !is_continuous && place.joint != on.joint {
            self.unlimited.push(joint.name.to_owned());
        }
        Ok(place)
    }

    fn finish(self, root: Element<'_>) -> Result<Robot, Wrong> {
        if let Some(joint) = self.assembly.unknown_lock() {
            let known = self.assembly.robot.joints.iter().map(|joint| joint.name.clone()).collect();
            return Err((root.span(), UrdfFault::UnknownLock { joint: joint.clone(), known }));
        }
        let mut robot = self.assembly.finish();
        robot.warn_of("without limits, or with limits 0 to 0, which are not taken", self.unlimited);
        Ok(robot)
    }
}
