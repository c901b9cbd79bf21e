//! A robot as a constant in Rust: what is in a chip's flash and is not built at the start.

use darm_core::tree::{BASE, Body, Link, TreeError, Turn};

use crate::literal::{matrix, number, numbers, pose, vector};

use super::{Mimic, Robot, RobotFrame, RobotJoint};

/// Joints that the numbers of a constant's links can count.
const MAX_JOINTS: usize = BASE as usize;

impl Robot {
    /// A module of Rust with the constants `TREE`, `TOOL` and `LIMITS` of this robot in `f32`, as `rustfmt` has it.
    ///
    /// # Errors
    ///
    /// The robot has more joints than links can be numbered; or as [`link_tree`](Self::link_tree).
    pub fn constant(&self, tool: &RobotFrame) -> Result<String, TreeError> {
        let (n, tree) = (self.joints.len(), self.tree::<MAX_JOINTS>()?);
        let at = tool.in_tree(&tree);
        let free = [f64::NEG_INFINITY, f64::INFINITY];
        let limits = self.joints.iter().map(|joint| numbers(&joint.limits.unwrap_or(free)));
        Ok(format!(
            "//! {}: made by `darm model --rust` from its file.\n{}\n\
             use darm_core::actuator::JointKind;\n\
             use darm_core::real::{{Mat3, Vec3}};\n\
             use darm_core::se::Pose;\n\
             use darm_core::tree::{{BASE, Body, Link, LinkFrame, Symmetric, Tree, Turn}};\n\n\
             /// Joints and links.\n\
             pub(crate) const TREE: Tree<f32, {n}> = Tree {{\n    links: [\n{}    ],\n    base: {},\n    gravity: {},\n}};\n\n\
             /// The tool: {}.\n\
             pub(crate) const TOOL: LinkFrame<f32> = LinkFrame {{ link: {}, pose: {} }};\n\n\
             /// Least and greatest position of each joint, rad or m.\n\
             pub(crate) const LIMITS: [[f32; 2]; {n}] = [{}];\n",
            self.name,
            self.followers(),
            tree.links.iter().take(n).map(link).collect::<String>(),
            body(&tree.base),
            vector(&tree.gravity),
            tool.name,
            parent(at.link),
            pose(&at.pose),
            limits.collect::<Vec<_>>().join(", "),
        ))
    }

    /// A line for each joint that follows another, which the constant does not enforce.
    fn followers(&self) -> String {
        let line = |(index, joint): (usize, &RobotJoint)| {
            let Mimic { joint: other, factor, offset } = joint.mimic?;
            Some(format!(
                "//! Give joint {index} the position {factor:?} times that of joint {other} plus {offset:?}.\n"
            ))
        };
        self.joints.iter().enumerate().filter_map(line).collect()
    }
}

fn link(link: &Link<f64>) -> String {
    format!(
        "        Link {{\n            parent: {},\n            kind: JointKind::{:?},\n            turn: {},\n            \
         origin: {},\n            offset: {},\n            body: {},\n            turned: {},\n        }},\n",
        parent(link.parent),
        link.kind,
        turn(&link.turn),
        vector(&link.origin),
        number(link.offset),
        body(&link.body),
        matrix(&link.turned),
    )
}

fn parent(link: u8) -> String {
    if link == BASE { "BASE".into() } else { link.to_string() }
}

fn turn(turn: &Turn<f64>) -> String {
    match turn {
        Turn::None => "Turn::None".into(),
        Turn::Quarter => "Turn::Quarter".into(),
        Turn::QuarterBack => "Turn::QuarterBack".into(),
        Turn::AboutX { cosine, sine } => {
            format!("Turn::AboutX {{ cosine: {}, sine: {} }}", number(*cosine), number(*sine))
        }
        Turn::Full(rotation) => format!("Turn::Full({})", matrix(rotation)),
    }
}

fn body(body: &Body<f64>) -> String {
    let i = &body.inertia;
    let [xx, xy, yy, xz, yz, zz] = [i.xx, i.xy, i.yy, i.xz, i.yz, i.zz].map(number);
    let inertia = format!("Symmetric {{ xx: {xx}, xy: {xy}, yy: {yy}, xz: {xz}, yz: {yz}, zz: {zz} }}");
    format!("Body {{ mass: {}, moment: {}, inertia: {inertia} }}", number(body.mass), vector(&body.moment))
}
