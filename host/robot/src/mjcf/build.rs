//! From the bodies of an MJCF to a [`Robot`] that has been checked.

use std::collections::HashSet;

use darm_core::actuator::{Axis, JointKind};
use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_core::tree::{Inertia, Joint};

use super::attributes::unknown;
use super::bodies::{Body, Item, Trees, bodies, is_on};
use super::classes::{Classes, Settled};
use super::equality::{References, coupled};
use super::fault::{MjcfFault, Wrong};
use super::files::{Files, Part};
use super::frame::pose;
use super::inertial::inertias;
use super::mesh::Meshes;
use super::settings::Settings;
use crate::assembly::{Assembly, LinkPose, Locks, Selection};
use crate::robot::{Robot, RobotJoint};

pub(super) fn robot(files: &Files, selection: &Selection) -> Result<Robot, Wrong> {
    let root = files.root();
    if root.tag() != "mujoco" {
        return Err(root.wrong(MjcfFault::Root { tag: root.tag().into() }));
    }
    let (classes, settings) = (Classes::of(root)?, Settings::of(root)?);
    no_rotors(root, &classes)?;
    let trees = Trees::of(root, bodies(root, &classes, &settings)?, selection.root.as_deref())?;
    let bodies = &trees.bodies;
    if trees.is_on_root.contains(&false) && settings.total_mass_kg.is_some() {
        let cure = "remove it and give masses, or read all bodies";
        return Err(root.unsupported("settotalmass where one tree is read", cure));
    }
    let hinges = hinges(bodies, &settings)?;
    let inertias = inertias(bodies, &settings, &mut Meshes::of(files, &classes)?)?;
    let floating = floating(&trees)?;
    let references: References = hinges.iter().flatten().map(|hinge| (hinge.name.as_str(), hinge.reference)).collect();
    let coupled = coupled(root, &classes, &references, &trees.outside)?;
    let locks: Locks = coupled.constant.iter().chain(&selection.locks).map(|(name, at)| (name.clone(), *at)).collect();
    let name = root.value("model").unwrap_or("MuJoCo Model");
    let follows = |joint| root.wrong(MjcfFault::Follows { joint });
    let mut assembly = Assembly::new(name, settings.gravity, &locks, &coupled.followings).map_err(follows)?;
    let (mut places, mut sites) = (vec![LinkPose::on_base(); bodies.len()], Vec::new());
    for (number, body) in bodies.iter().enumerate() {
        let mut place = places[body.parent.unwrap_or(0)].then(&body.pose);
        match floating {
            Some((base, armature)) if number == base => {
                place = assembly.float();
                assembly.robot.base_armature = armature;
            }
            Some((base, _)) if !is_on(bodies, number, base) => continue,
            _ => {}
        }
        for hinge in &hinges[number] {
            let carried = assembly.joint(&place, hinge.joint(&body.name));
            place = carried.then(&Pose::at(-hinge.anchor));
        }
        places[number] = place;
        // What holds the root keeps its place, and is no part of the robot.
        let inertia = if trees.is_on_root[number] { inertias[number] } else { Inertia::none() };
        assembly.link(&body.name, &place, &inertia, body.is_end && number > 0);
        sites.extend(body.sites.iter().map(|site| (site, place)));
    }
    for (site, place) in sites {
        if let Some(name) = site.element.part.value("name") {
            let at = site.frame * pose(site.element, &settings)?;
            let is_taken = bodies.iter().any(|body| body.name == name);
            let name = if is_taken { format!("{SITE}{name}") } else { name.to_owned() };
            assembly.frame(&name, &place.then(&at), false);
        }
    }
    if let Some(joint) = assembly.unknown_lock() {
        let known = assembly.robot.joints.iter().map(|joint| joint.name.clone()).collect();
        return Err(root.wrong(MjcfFault::UnknownLock { joint: joint.clone(), known }));
    }
    let mut robot = assembly.finish();
    robot.warnings.extend(coupled.warnings);
    robot.warnings.extend(warnings(bodies));
    robot.ignored = unknown(root);
    Ok(robot)
}

/// What the name of a frame begins with that is a site with the name of a body.
pub const SITE: &str = "site:";

/// A joint of one axis, in the frame of its body.
struct Hinge {
    name: String,
    axis: Axis<f64>,
    anchor: Vec3<f64>,
    /// Position of the joint where the body has the pose of the file.
    reference: f64,
    limits: Option<[f64; 2]>,
    effort: Option<f64>,
    damping: f64,
    friction: f64,
    armature: f64,
    is_last: bool,
}

impl Hinge {
    fn joint(&self, body: &str) -> RobotJoint {
        let placement = Pose::at(self.anchor) * self.axis.pose(-self.reference);
        let link = if self.is_last { body.to_owned() } else { format!("{body}, beyond {}", self.name) };
        let joint = Joint { parent: None, axis: self.axis, placement, inertia: Inertia::none() };
        RobotJoint {
            limits: self.limits,
            effort: self.effort,
            damping: self.damping,
            friction: self.friction,
            armature: self.armature,
            ..RobotJoint::new(self.name.clone(), link, joint)
        }
    }
}

/// The joints of each body, which have names that differ; a body that floats has none.
fn hinges(bodies: &[Body<'_>], settings: &Settings) -> Result<Vec<Vec<Hinge>>, Wrong> {
    if let Some(item) = bodies[0].joints.first() {
        return Err(item.element.part.unsupported("a joint of the world", "give it to a body"));
    }
    let mut names = HashSet::new();
    let mut all = Vec::with_capacity(bodies.len());
    for body in bodies {
        let mut found = Vec::new();
        for (index, item) in body.joints.iter().filter(|item| !is_free(item)).enumerate() {
            let part = item.element.part;
            let unnamed = || format!("{}.joint{}", body.name, index + 1);
            let name = part.value("name").map_or_else(unnamed, str::to_owned);
            if !names.insert(name.clone()) {
                return Err(part.wrong(MjcfFault::Duplicate { what: "joint", name }));
            }
            found.push(hinge(name, item, settings)?);
        }
        if let Some(last) = found.last_mut() {
            last.is_last = true;
        }
        all.push(found);
    }
    Ok(all)
}

fn hinge(name: String, item: &Item<'_>, settings: &Settings) -> Result<Hinge, Wrong> {
    let element = item.element;
    let kind = match element.value("type").unwrap_or("hinge") {
        "hinge" => JointKind::Revolute,
        "slide" => JointKind::Prismatic,
        "ball" => return Err(element.part.unsupported("a joint of type ball", "write three hinges in its place")),
        _ => return Err(element.wrong_value("type", "hinge, slide or free")),
    };
    let unit = if kind == JointKind::Revolute { settings.angle_rad } else { 1.0 };
    let along = Vec3::from(element.numbers("axis")?.unwrap_or([0.0, 0.0, 1.0]));
    let along =
        along.try_normalize(1e-14).ok_or_else(|| element.wrong_value("axis", "a direction other than 0 0 0"))?;
    let anchor = if kind == JointKind::Revolute { element.numbers("pos")?.unwrap_or([0.0; 3]) } else { [0.0; 3] };
    let of = |attribute: &str| Ok::<f64, Wrong>(element.list(attribute)?.first().copied().unwrap_or(0.0));
    Ok(Hinge {
        name,
        axis: Axis { kind, direction: item.frame.rotation * along },
        anchor: item.frame * Vec3::from(anchor),
        reference: unit * of("ref")?,
        limits: limits(element, unit, settings)?,
        effort: element
            .numbers::<2>("actuatorfrcrange")?
            .map(|[low, high]| high.max(-low))
            .filter(|effort| *effort > 0.0),
        damping: of("damping")?,
        friction: of("frictionloss")?,
        armature: of("armature")?,
        is_last: false,
    })
}

fn limits(element: Settled<'_>, unit: f64, settings: &Settings) -> Result<Option<[f64; 2]>, Wrong> {
    let range = element.numbers("range")?;
    let is_limited = match element.value("limited").unwrap_or("auto") {
        "true" => true,
        "false" => false,
        _ => settings.autolimits,
    };
    match range.map(|range: [f64; 2]| range.map(|limit| limit * unit)) {
        Some([low, high]) if is_limited && low < high => Ok(Some([low, high])),
        Some([low, high]) if is_limited && low > high => Err(element.wrong_value("range", "the lower limit first")),
        _ => Ok(None),
    }
}

fn is_free(item: &Item<'_>) -> bool {
    item.element.part.tag() == "freejoint" || item.element.value("type") == Some("free")
}

/// The number of the body that floats, on the world, with all other joints, and the armature of its joint.
fn floating(trees: &Trees<'_>) -> Result<Option<(usize, f64)>, Wrong> {
    let bodies = &trees.bodies;
    let mut found = None;
    for (number, body) in bodies.iter().enumerate() {
        let Some(free) = body.joints.iter().find(|item| is_free(item)) else { continue };
        let part = free.element.part;
        let is_misplaced = body.parent != Some(0) || body.joints.len() > 1;
        if is_misplaced {
            let what = "a free joint with others, or of a body that is not on the world";
            return Err(part.unsupported(what, "give it alone to a body on the world"));
        }
        let others = bodies.iter().enumerate().filter(|(other, _)| !is_on(bodies, *other, number));
        if let Some(item) = others.flat_map(|(_, other)| &other.joints).next() {
            let moving: Vec<String> = trees.moving().into_iter().map(|name| format!("--root '{name}'")).collect();
            let cure = format!("read one tree with {}", moving.join(" or "));
            return Err(item.element.part.unsupported("a joint beside a body that floats", cure));
        }
        // A <freejoint> takes nothing from the defaults of joints.
        let armature = if part.tag() == "joint" { free.element.number("armature")?.unwrap_or(0.0) } else { 0.0 };
        if part.value("align") == Some("true") {
            return Err(part.unsupported("align=\"true\"", "remove it and give the pose of the body"));
        }
        found = Some((number, armature));
    }
    Ok(found)
}

/// Refuses rotors that tendons or actuators add to the mass matrix.
fn no_rotors(root: Part<'_>, classes: &Classes<'_>) -> Result<(), Wrong> {
    let lists = root.children().into_iter().filter(|part| matches!(part.tag(), "actuator" | "tendon"));
    for part in lists.flat_map(Part::children).chain(classes.elements().filter(|part| part.tag() != "joint")) {
        let Some(armature) = part.attribute("armature") else { continue };
        if armature.numbers().is_none_or(|numbers| numbers.iter().any(|number| *number != 0.0)) {
            return Err(part.unsupported("the armature of an actuator or tendon", "give it to the joint"));
        }
    }
    Ok(())
}

/// What the elements of bodies ask and is not computed.
fn warnings(bodies: &[Body<'_>]) -> Vec<String> {
    let parts = bodies.iter().filter_map(|body| body.part);
    let said = parts.flat_map(|part| {
        let compensated = part.attribute("gravcomp").filter(|attribute| attribute.value.trim() != "0");
        let moved = part.attribute("mocap").filter(|attribute| attribute.value == "true");
        let compensated = compensated.map(|_| "gravcomp is not computed: gravity acts on the body");
        let moved = moved.map(|_| "the body keeps the pose of the file; no mocap moves it");
        compensated.into_iter().chain(moved).map(move |what| format!("{}: {what}", part.place()))
    });
    said.collect()
}
