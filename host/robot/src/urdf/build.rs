//! From the elements of a URDF to a [`Robot`] that has been checked.

use std::collections::HashMap;
use std::ops::Range;

use darm_core::actuator::{Axis, JointKind};
use darm_core::real::{Mat3, Vec3};
use darm_core::se::{Pose, rotation_exp};
use darm_core::tree::{Inertia, Joint};
use urdf_rs::JointType;

use super::{Locks, UrdfFault};
use crate::robot::{Robot, RobotFrame, RobotJoint};

const GRAVITY_M_S2: f64 = 9.81;

/// An element of the file, by which a fault can be found.
#[derive(Clone, Debug)]
pub(super) struct Element {
    tag: &'static str,
    name: String,
}

/// What is wrong, and with which element.
type Wrong = (Option<Element>, UrdfFault);

impl Element {
    fn joint(joint: &urdf_rs::Joint) -> Option<Self> {
        Some(Self { tag: "joint", name: joint.name.clone() })
    }

    fn link(link: &urdf_rs::Link) -> Option<Self> {
        Some(Self { tag: "link", name: link.name.clone() })
    }

    /// Where the element starts in the text.
    pub(super) fn span(&self, text: &str) -> Option<Range<usize>> {
        let tag = format!("<{}", self.tag);
        let names = ['"', '\''].map(|quote| format!("name={quote}{}{quote}", self.name));
        text.match_indices(&tag).find_map(|(start, _)| {
            let end = start + text[start..].find('>')?;
            names.iter().any(|name| text[start..end].contains(name)).then_some(start..end)
        })
    }
}

pub(super) fn robot(file: &urdf_rs::Robot, locks: &Locks) -> Result<Robot, Wrong> {
    let hierarchy = Hierarchy::of(file)?;
    let mut walk = Walk::new(file, locks, hierarchy.root);
    let mut ahead = vec![(None, LinkPose::on_base())];
    let mut visited = vec![false; file.links.len()];
    while let Some((joint, place)) = ahead.pop() {
        let (link, place) = match joint {
            Some(joint) => (hierarchy.child(joint), walk.joint(joint, &place, &hierarchy)?),
            None => (hierarchy.root, place),
        };
        visited[link] = true;
        walk.link(link, &place, hierarchy.children[link].is_empty())?;
        ahead.extend(hierarchy.children[link].iter().rev().map(|&joint| (Some(joint), place)));
    }
    if let Some(link) = visited.iter().position(|visited| !visited).and_then(|link| file.links.get(link)) {
        return Err((Element::link(link), UrdfFault::Loop { link: link.name.clone() }));
    }
    walk.finish()
}

/// Which joints stand on each link, and which link each joint moves, by their numbers in the file.
struct Hierarchy {
    root: usize,
    children: Vec<Vec<usize>>,
    child_of: Vec<usize>,
}

impl Hierarchy {
    fn of(file: &urdf_rs::Robot) -> Result<Self, Wrong> {
        let mut links = HashMap::new();
        for (index, link) in file.links.iter().enumerate() {
            if links.insert(link.name.as_str(), index).is_some() {
                return Err((Element::link(link), UrdfFault::Duplicate { element: "link", name: link.name.clone() }));
            }
        }
        let mut children = vec![Vec::new(); file.links.len()];
        let mut child_of = Vec::with_capacity(file.joints.len());
        let mut moved_by: Vec<Option<&str>> = vec![None; file.links.len()];
        let mut names = HashMap::new();
        for (index, joint) in file.joints.iter().enumerate() {
            let wrong = |fault| (Element::joint(joint), fault);
            if names.insert(joint.name.as_str(), index).is_some() {
                return Err(wrong(UrdfFault::Duplicate { element: "joint", name: joint.name.clone() }));
            }
            let link = |link: &str| {
                let unknown = || UrdfFault::UnknownLink { joint: joint.name.clone(), link: link.into() };
                links.get(link).copied().ok_or_else(|| wrong(unknown()))
            };
            let (parent, child) = (link(&joint.parent.link)?, link(&joint.child.link)?);
            if let Some(first) = moved_by[child].replace(&joint.name) {
                let (first, second) = (first.to_owned(), joint.name.clone());
                return Err(wrong(UrdfFault::TwoParents { link: joint.child.link.clone(), first, second }));
            }
            children[parent].push(index);
            child_of.push(child);
        }
        let roots: Vec<_> = (0..file.links.len()).filter(|&link| moved_by[link].is_none()).collect();
        match roots[..] {
            _ if file.links.is_empty() => Err((None, UrdfFault::Empty)),
            [root] => Ok(Self { root, children, child_of }),
            _ => {
                let roots = roots.iter().map(|&root| file.links[root].name.clone()).collect();
                Err((None, UrdfFault::Roots { roots }))
            }
        }
    }

    fn child(&self, joint: usize) -> usize {
        self.child_of[joint]
    }
}

/// The place of a link: in the link of which moving joint, and with which pose.
#[derive(Clone, Copy)]
struct LinkPose {
    joint: Option<usize>,
    pose: Pose<f64>,
}

impl LinkPose {
    fn on_base() -> Self {
        Self { joint: None, pose: Pose::identity() }
    }
}

/// The robot as far as the walk from the root has come.
struct Walk<'a> {
    file: &'a urdf_rs::Robot,
    locks: &'a Locks,
    robot: Robot,
    unlimited: Vec<String>,
    impossible: Vec<String>,
}

impl<'a> Walk<'a> {
    fn new(file: &'a urdf_rs::Robot, locks: &'a Locks, root: usize) -> Self {
        let robot = Robot {
            name: if file.name.is_empty() { file.links[root].name.clone() } else { file.name.clone() },
            joints: Vec::new(),
            base: Inertia::none(),
            floating: false,
            frames: Vec::new(),
            gravity: Vec3::new(0.0, 0.0, -GRAVITY_M_S2),
            warnings: Vec::new(),
        };
        Self { file, locks, robot, unlimited: Vec::new(), impossible: Vec::new() }
    }

    /// Takes a joint in, and gives the place of the link that it carries.
    fn joint(&mut self, index: usize, on: &LinkPose, hierarchy: &Hierarchy) -> Result<LinkPose, Wrong> {
        let joint = &self.file.joints[index];
        let wrong = |fault| (Element::joint(joint), fault);
        let kind = |kind, advice| wrong(UrdfFault::Kind { joint: joint.name.clone(), kind, advice });
        let origin = on.pose * pose(&joint.origin).ok_or_else(|| wrong(not_finite("joint", &joint.name)))?;
        let axis_kind = match joint.joint_type {
            JointType::Fixed => return Ok(LinkPose { pose: origin, ..*on }),
            JointType::Floating if hierarchy.children[hierarchy.root] == [index] => {
                self.robot.floating = true;
                self.robot.base = Inertia::none();
                self.robot.frames.clear();
                return Ok(LinkPose::on_base());
            }
            JointType::Floating => return Err(kind("floating", "the only joint of the root link")),
            JointType::Planar => return Err(kind("planar", "two prismatic joints and a revolute one")),
            JointType::Spherical => return Err(kind("spherical", "three revolute joints")),
            JointType::Revolute | JointType::Continuous => JointKind::Revolute,
            JointType::Prismatic => JointKind::Prismatic,
        };
        let axis = Axis { kind: axis_kind, direction: direction(joint).map_err(wrong)? };
        if let Some(at) = self.locks.get(&joint.name) {
            return Ok(LinkPose { pose: origin * axis.pose(*at), ..*on });
        }
        if let Some(mimic) = &joint.mimic {
            self.robot.warnings.push(format!(
                "joint `{}` mimics `{}`: it moves on its own here; lock it, or give it its position",
                joint.name, mimic.joint
            ));
        }
        let limits = self.limits(joint).map_err(wrong)?;
        let dynamics = joint.dynamics.as_ref();
        self.robot.joints.push(RobotJoint {
            name: joint.name.clone(),
            link: joint.child.link.clone(),
            joint: Joint { parent: on.joint, axis, placement: origin, inertia: Inertia::none() },
            limits,
            effort: Some(joint.limit.effort).filter(|effort| *effort > 0.0),
            velocity: Some(joint.limit.velocity).filter(|velocity| *velocity > 0.0),
            damping: dynamics.map_or(0.0, |dynamics| dynamics.damping),
            friction: dynamics.map_or(0.0, |dynamics| dynamics.friction),
        });
        Ok(LinkPose { joint: Some(self.robot.joints.len() - 1), pose: Pose::identity() })
    }

    fn limits(&mut self, joint: &urdf_rs::Joint) -> Result<Option<[f64; 2]>, UrdfFault> {
        let (lower, upper) = (joint.limit.lower, joint.limit.upper);
        if joint.joint_type == JointType::Continuous {
            return Ok(None);
        }
        if !(lower.is_finite() && upper.is_finite()) {
            return Err(not_finite("joint", &joint.name));
        }
        if lower > upper {
            return Err(UrdfFault::Limits { joint: joint.name.clone(), lower, upper });
        }
        if lower == upper {
            self.unlimited.push(joint.name.clone());
            return Ok(None);
        }
        Ok(Some([lower, upper]))
    }

    /// Takes a link in: its frame, and its inertia into the body that it is fixed to.
    fn link(&mut self, index: usize, place: &LinkPose, is_end: bool) -> Result<(), Wrong> {
        let link = &self.file.links[index];
        let wrong = |fault| (Element::link(link), fault);
        let inertia = inertia(link).map_err(wrong)?;
        if !is_possible(&inertia.about_com) {
            self.impossible.push(link.name.clone());
        }
        let placed = inertia.placed(&place.pose.rotation, &place.pose.position);
        let joint = place.joint.and_then(|joint| self.robot.joints.get_mut(joint));
        let body = joint.map_or(&mut self.robot.base, |joint| &mut joint.joint.inertia);
        *body = if *body == Inertia::none() { placed } else { body.joined(&placed) };
        let name = link.name.clone();
        self.robot.frames.push(RobotFrame { name, joint: place.joint, pose: place.pose, is_end });
        Ok(())
    }

    fn finish(mut self) -> Result<Robot, Wrong> {
        let is_moving = |name: &String| {
            self.file.joints.iter().any(|joint| joint.name == *name && joint.joint_type != JointType::Fixed)
        };
        if let Some(joint) = self.locks.keys().find(|name| !is_moving(name)) {
            let known = self.robot.joints.iter().map(|joint| joint.name.clone()).collect();
            return Err((None, UrdfFault::UnknownLock { joint: joint.clone(), known }));
        }
        let moves_nothing = |joint: &&RobotJoint| joint.joint.inertia.mass == 0.0;
        let massless = self.robot.joints.iter().filter(moves_nothing).map(|joint| joint.link.clone()).collect();
        let warnings = [
            ("without limits, or with limits 0 to 0, which are not taken", self.unlimited),
            ("without mass, which dynamics takes as none", massless),
            ("with moments of inertia that no body has", self.impossible),
        ];
        for (what, names) in warnings.into_iter().filter(|(_, names)| !names.is_empty()) {
            self.robot.warnings.push(format!("{what}: {}", names.join(", ")));
        }
        Ok(self.robot)
    }
}

fn not_finite(element: &'static str, name: &str) -> UrdfFault {
    UrdfFault::NotFinite { element, name: name.into() }
}

fn direction(joint: &urdf_rs::Joint) -> Result<Vec3<f64>, UrdfFault> {
    let axis = Vec3::from(joint.axis.xyz.0);
    let length = axis.norm();
    if !length.is_finite() {
        return Err(not_finite("joint", &joint.name));
    }
    if length < f64::MIN_POSITIVE.sqrt() {
        return Err(UrdfFault::Axis { joint: joint.name.clone() });
    }
    // An axis that is a unit vector already keeps its digits.
    Ok(if length == 1.0 { axis } else { axis / length })
}

/// A pose of the file; `None` when a number of it is not finite.
fn pose(origin: &urdf_rs::Pose) -> Option<Pose<f64>> {
    let ([roll, pitch, yaw], position) = (origin.rpy.0, Vec3::from(origin.xyz.0));
    if ![roll, pitch, yaw].iter().chain(position.iter()).all(|number| number.is_finite()) {
        return None;
    }
    let about = |axis: Vec3<f64>, angle: f64| rotation_exp(&(axis * angle));
    let rotation = about(Vec3::z(), yaw) * about(Vec3::y(), pitch) * about(Vec3::x(), roll);
    Some(Pose { rotation, position })
}

fn inertia(link: &urdf_rs::Link) -> Result<Inertia<f64>, UrdfFault> {
    let (mass, i) = (link.inertial.mass.value, &link.inertial.inertia);
    let numbers = [mass, i.ixx, i.ixy, i.ixz, i.iyy, i.iyz, i.izz];
    let origin = pose(&link.inertial.origin).filter(|_| numbers.iter().all(|number| number.is_finite()));
    let origin = origin.ok_or_else(|| not_finite("link", &link.name))?;
    if mass < 0.0 {
        return Err(UrdfFault::Mass { link: link.name.clone(), mass });
    }
    let about_com = Mat3::new(i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz);
    let at_com = Inertia { mass, com: Vec3::zeros(), about_com };
    Ok(at_com.placed(&origin.rotation, &origin.position))
}

/// Whether a body can have these moments of inertia: none below zero, none above the sum of the others.
fn is_possible(about_com: &Mat3<f64>) -> bool {
    let moments = about_com.symmetric_eigenvalues();
    let slack = 1e-9 * moments.amax();
    let sum = moments.sum();
    moments.iter().all(|moment| *moment >= -slack && 2.0 * moment <= sum + slack)
}
