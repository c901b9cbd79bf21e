//! Bodies of a model in the order of its file, each with its elements, out of the frames that hold them.

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
        Self { name, part, parent, pose, joints, geoms, sites, inertial: None, is_end: true }
    }
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
                return Err(part.unsupported(format!("<{tag}> in a body"), "save the compiled model, or write it out"));
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
