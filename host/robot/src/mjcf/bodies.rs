//! Bodies of a model in the order of its file, each with its elements, out of the frames that hold them.

use std::collections::HashSet;

use darm_core::se::Pose;

use super::classes::{Classes, MAIN, Settled};
use super::fault::{MjcfFault, Wrong};
use super::files::Part;
use super::frame::pose;
use super::settings::Settings;

/// Elements in bodies that neither move nor weigh.
const IGNORED: [&str; 5] = ["camera", "light", "plugin", "skin", "config"];

/// An element in a body.
#[derive(Clone, Copy)]
pub(super) struct Item<'a> {
    pub(super) element: Settled<'a>,
    /// The frame that its pose is given in, in the body.
    pub(super) frame: Pose<f64>,
}

/// A body; the first is the world.
pub(super) struct Body<'a> {
    pub(super) name: String,
    /// `None`: the world.
    pub(super) part: Option<Part<'a>>,
    pub(super) parent: Option<usize>,
    /// In the parent.
    pub(super) pose: Pose<f64>,
    pub(super) joints: Vec<Item<'a>>,
    pub(super) geoms: Vec<Item<'a>>,
    pub(super) sites: Vec<Item<'a>>,
    pub(super) inertial: Option<Item<'a>>,
    pub(super) is_end: bool,
    /// Elements that are not supported; no fault of a body that is not read.
    unsupported: Vec<Wrong>,
}

/// The bodies that are read, and what is left out.
pub(super) struct Trees<'a> {
    /// The world, the bodies between it and the root, and those on the root.
    pub(super) bodies: Vec<Body<'a>>,
    /// Which of them are the root or on it; all where no root is named.
    pub(super) is_on_root: Vec<bool>,
    /// Names of the joints that are left out.
    pub(super) outside: HashSet<&'a str>,
}

/// An element that is still to be visited, in a body or in a frame of one.
struct Ahead<'a> {
    part: Part<'a>,
    body: usize,
    frame: Pose<f64>,
    class: &'a str,
}

/// All bodies of a model, parents before children, depth first as MuJoCo numbers them.
pub(super) fn bodies<'a>(
    root: Part<'a>,
    classes: &'a Classes<'a>,
    settings: &Settings,
) -> Result<Vec<Body<'a>>, Wrong> {
    let worlds: Vec<_> = root.named("worldbody").collect();
    if worlds.is_empty() {
        return Err(root.wrong(MjcfFault::Empty));
    }
    let mut walk = Walk { classes, settings, bodies: vec![Body::new("world".into(), None, None, Pose::identity())] };
    let mut ahead = Vec::new();
    for world in worlds.into_iter().rev() {
        let class = classes.class(world, "childclass", MAIN)?;
        ahead.extend(inside(world, 0, Pose::identity(), class));
    }
    while let Some(next) = ahead.pop() {
        let inner = walk.visit(&next)?;
        ahead.extend(inner);
    }
    Ok(walk.bodies)
}

/// The children of an element, the last first.
fn inside<'a>(part: Part<'a>, body: usize, frame: Pose<f64>, class: &'a str) -> impl Iterator<Item = Ahead<'a>> {
    part.children().into_iter().rev().map(move |part| Ahead { part, body, frame, class })
}

impl<'a> Body<'a> {
    fn new(name: String, part: Option<Part<'a>>, parent: Option<usize>, pose: Pose<f64>) -> Self {
        let (joints, geoms, sites) = (Vec::new(), Vec::new(), Vec::new());
        Self { name, part, parent, pose, joints, geoms, sites, inertial: None, is_end: true, unsupported: Vec::new() }
    }
}

impl<'a> Trees<'a> {
    /// The tree on the body of a name, with the bodies that lead to it, which keep the pose of the file; all without a name.
    pub(super) fn of(world: Part<'a>, mut bodies: Vec<Body<'a>>, root: Option<&str>) -> Result<Self, Wrong> {
        let number = match root {
            None => 0,
            Some(root) => bodies.iter().position(|body| body.name == root).ok_or_else(|| {
                let known = bodies.iter().skip(1).map(|body| body.name.clone()).collect();
                world.wrong(MjcfFault::UnknownRoot { root: root.into(), known })
            })?,
        };
        // Parents come before children, so that one pass is enough for a chain of any length.
        let mut is_on_root = vec![false; bodies.len()];
        for (body, one) in bodies.iter().enumerate() {
            is_on_root[body] = body == number || one.parent.is_some_and(|parent| is_on_root[parent]);
        }
        let is_before: HashSet<usize> =
            std::iter::successors(bodies[number].parent, |&body| bodies[body].parent).collect();
        if let Some(one) =
            bodies.iter_mut().zip(&is_on_root).find(|(one, is_on)| **is_on && !one.unsupported.is_empty())
        {
            return Err(one.0.unsupported.swap_remove(0));
        }
        let mut trees = Self { bodies: Vec::new(), is_on_root: Vec::new(), outside: HashSet::new() };
        let mut place = vec![0; bodies.len()];
        for (body, mut one) in bodies.into_iter().enumerate() {
            let is_on_root = is_on_root[body];
            if !is_on_root {
                trees.outside.extend(one.joints.iter().filter_map(|item| item.element.part.value("name")));
                (one.joints, one.geoms, one.inertial) = (Vec::new(), Vec::new(), None);
            }
            if is_on_root || is_before.contains(&body) {
                place[body] = trees.bodies.len();
                one.parent = one.parent.map(|parent| place[parent]);
                trees.bodies.push(one);
                trees.is_on_root.push(is_on_root);
            }
        }
        Ok(trees)
    }

    /// Names of the bodies on the world that move, or on which one moves.
    pub(super) fn moving(&self) -> Vec<&str> {
        let moves = |on: usize| {
            (on..self.bodies.len()).any(|k| !self.bodies[k].joints.is_empty() && is_on(&self.bodies, k, on))
        };
        let on_world = (0..self.bodies.len()).filter(|body| self.bodies[*body].parent == Some(0) && moves(*body));
        on_world.map(|body| self.bodies[body].name.as_str()).collect()
    }
}

/// Whether a body is this one or on it.
pub(super) fn is_on(bodies: &[Body<'_>], number: usize, base: usize) -> bool {
    std::iter::successors(Some(number), |&number| bodies[number].parent).any(|number| number == base)
}

struct Walk<'a, 's> {
    classes: &'a Classes<'a>,
    settings: &'s Settings,
    bodies: Vec<Body<'a>>,
}

impl<'a> Walk<'a, '_> {
    /// Takes an element in, and gives what is inside of it.
    fn visit(&mut self, ahead: &Ahead<'a>) -> Result<Vec<Ahead<'a>>, Wrong> {
        let Ahead { part, body, frame, class } = *ahead;
        let item = |class| Ok(Item { element: self.classes.settle(part, class)?, frame });
        match part.tag() {
            "body" | "frame" => return self.enter(ahead),
            "joint" | "freejoint" => {
                let item = item(class)?;
                self.bodies[body].joints.push(item);
            }
            "geom" => {
                let item = item(class)?;
                self.bodies[body].geoms.push(item);
            }
            "site" => {
                let item = item(class)?;
                self.bodies[body].sites.push(item);
            }
            "inertial" => {
                let item = item(MAIN)?;
                self.bodies[body].inertial = Some(item);
            }
            tag if IGNORED.contains(&tag) => {}
            tag => {
                let cure = "save the compiled model, or write it out";
                self.bodies[body].unsupported.push(part.unsupported(format!("<{tag}> in a body"), cure));
            }
        }
        Ok(Vec::new())
    }

    /// A body or frame: its children with its pose.
    fn enter(&mut self, ahead: &Ahead<'a>) -> Result<Vec<Ahead<'a>>, Wrong> {
        let Ahead { part, body, frame, class } = *ahead;
        let element = self.classes.settle(part, MAIN)?;
        let at = frame * pose(element, self.settings)?;
        let class = self.classes.class(part, "childclass", class)?;
        if part.tag() == "frame" {
            return Ok(inside(part, body, at, class).collect());
        }
        self.bodies[body].is_end = false;
        let number = self.bodies.len();
        let name = part.value("name").map_or_else(|| format!("body {number}"), str::to_owned);
        self.bodies.push(Body::new(name, Some(part), Some(body), at));
        Ok(inside(part, number, Pose::identity(), class).collect())
    }
}
