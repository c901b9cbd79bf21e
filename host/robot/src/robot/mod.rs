//! A robot of joints and links with the names, limits and frames that its file gives them: a [`Tree`] for people.
//!
//! It is read from a URDF ([`urdf`](crate::urdf)), an MJCF ([`mjcf`](crate::mjcf)) or a table of Denavit and Hartenberg
//! ([`dh`](crate::dh)). [`Robot::kinematics`], [`Robot::dynamics`], [`Robot::com`] and [`Robot::inverse`] take and give
//! numbers of its coordinates: the joints that follow no other ([`Coupling`]). [`Robot::link_tree`] and [`Robot::tree`] are
//! trees of all joints; [`Robot::constant`] writes it for firmware.

pub mod base_parameters;
mod constant;
mod coupling;
pub mod euler;
mod inverse;
pub mod planar;
pub mod recursion;
mod state;
mod velocity;

use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_core::tree::{Body, Inertia, Joint, LinkFrame, Tree, TreeError};

use crate::tree::LinkTree;

pub use coupling::{Coupling, Row};
pub use inverse::Inverse;
pub use state::{Accelerations, Com, Dynamics, FloatingBase, Jacobian, Kinematics, Motion, base_at_rest};
pub use velocity::{Rates, Task};

/// A robot on a fixed or floating base.
#[derive(Clone, Debug, PartialEq)]
pub struct Robot {
    /// Its name.
    pub name: String,
    /// Its joints and the links that they move, parents before children.
    pub joints: Vec<RobotJoint>,
    /// Mass distribution of the base with all that is fixed to it, expressed in its frame; it counts when the base floats.
    pub base: Inertia<f64>,
    /// Inertia that adds to each of the six axes of a floating base, kg·m² and kg.
    pub base_armature: f64,
    /// Whether the base floats.
    pub floating: bool,
    /// Every link of the file as a frame, the base first.
    pub frames: Vec<RobotFrame>,
    /// Acceleration of free fall in the base frame, m/s².
    pub gravity: Vec3<f64>,
    /// What a user should know before trusting what is computed.
    pub warnings: Vec<String>,
    /// What the file says and nothing reads, such as a misspelt attribute, with its place.
    pub ignored: Vec<String>,
}

/// A joint, the link that it moves, and its limits.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotJoint {
    /// Name of the joint.
    pub name: String,
    /// Name of the link that it moves.
    pub link: String,
    /// Geometry, and the mass distribution of the link with all that is fixed to it.
    pub joint: Joint<f64>,
    /// Least and greatest position, rad or m; `None` where it turns on and on or the file is silent.
    pub limits: Option<[f64; 2]>,
    /// Greatest torque (N·m) or force (N), where the file gives it.
    pub effort: Option<f64>,
    /// Greatest velocity, rad/s or m/s, where the file gives it.
    pub velocity: Option<f64>,
    /// Viscous friction, N·m·s or N·s/m.
    pub damping: f64,
    /// Coulomb friction, N·m or N.
    pub friction: f64,
    /// Inertia of the rotor at the joint, kg·m² or kg: it adds to the diagonal of the mass matrix.
    pub armature: f64,
    /// The joint that prescribes its position; `None`: it moves independently and is a coordinate.
    pub mimic: Option<Mimic>,
}

/// A joint follows another: q = factor · q of the other + offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mimic {
    /// The other joint, which follows none.
    pub joint: usize,
    /// rad or m per rad or m of the other.
    pub factor: f64,
    /// rad or m where the other is at zero.
    pub offset: f64,
}

/// A named frame fixed to a link.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotFrame {
    /// Its name.
    pub name: String,
    /// The joint that moves its link; `None`: it is fixed to the base.
    pub joint: Option<usize>,
    /// Pose in the frame of that joint's link, or of the base.
    pub pose: Pose<f64>,
    /// Whether nothing is on it.
    pub is_end: bool,
}

impl RobotJoint {
    /// A joint and the name of its link, without limits, friction and rotor.
    pub fn new(name: String, link: String, joint: Joint<f64>) -> Self {
        let (limits, effort, velocity, mimic) = (None, None, None, None);
        Self { name, link, joint, limits, effort, velocity, damping: 0.0, friction: 0.0, armature: 0.0, mimic }
    }
}

impl Robot {
    /// No joint, no frame, no mass, no gravity.
    pub fn empty() -> Self {
        Self {
            name: String::new(),
            joints: Vec::new(),
            base: Inertia::none(),
            base_armature: 0.0,
            floating: false,
            frames: Vec::new(),
            gravity: Vec3::zeros(),
            warnings: Vec::new(),
            ignored: Vec::new(),
        }
    }

    /// Adds the warning that something holds of these names, if there are any.
    pub(crate) fn warn_of(&mut self, what: &str, names: Vec<String>) {
        if !names.is_empty() {
            self.warnings.push(format!("{what}: {}", names.join(", ")));
        }
    }

    /// The tree that computes, for the first joints of N; the others stand on the base and move nothing.
    ///
    /// So a few sizes serve all robots: what is computed for the joints past the last is zero, the mass matrix too.
    ///
    /// # Errors
    ///
    /// [`TreeError::TooMany`]: the robot has more than N joints. [`TreeError::Parent`], [`TreeError::Axis`]: a joint
    /// does not come after its parent, or its axis is not a unit vector.
    pub fn tree<const N: usize>(&self) -> Result<Tree<f64, N>, TreeError> {
        if self.joints.len() > N {
            return Err(TreeError::TooMany { joints: self.joints.len(), max: N });
        }
        let idle = Joint::revolute(None, Vec3::z(), Pose::identity(), Inertia::none());
        let joints = std::array::from_fn(|index| self.joints.get(index).map_or(idle, |joint| joint.joint));
        let mut tree = Tree::new(&joints, self.gravity)?;
        tree.base = Body::from(&self.base);
        Ok(tree)
    }

    /// The tree of all joints.
    ///
    /// # Errors
    ///
    /// As [`LinkTree::new`].
    pub fn link_tree(&self) -> Result<LinkTree, TreeError> {
        let joints = self.joints.iter().map(|joint| joint.joint).collect();
        let mut tree = LinkTree::new(joints, self.gravity)?;
        tree.base = Body::from(&self.base);
        Ok(tree)
    }

    /// The frame of this name.
    pub fn frame(&self, name: &str) -> Option<&RobotFrame> {
        self.frames.iter().find(|frame| frame.name == name)
    }

    /// The frame that a user most likely means by the tool: the end with the most joints before it, the first of several.
    pub fn tool(&self) -> Option<&RobotFrame> {
        let ends = self.frames.iter().filter(|frame| frame.is_end);
        ends.min_by_key(|frame| std::cmp::Reverse(self.path(frame).len()))
    }

    /// The frame of this name, or [`Robot::tool`] without one.
    pub fn frame_or_tool(&self, name: Option<&str>) -> Option<&RobotFrame> {
        name.map_or_else(|| self.tool(), |name| self.frame(name))
    }

    /// The names of all frames, with commas between them.
    pub fn frame_names(&self) -> String {
        self.frames.iter().map(|frame| frame.name.as_str()).collect::<Vec<_>>().join(", ")
    }

    /// The joints between the base and a frame, the innermost first.
    pub fn path(&self, frame: &RobotFrame) -> Vec<usize> {
        let parent = |joint: &usize| self.joints.get(*joint).and_then(|joint| joint.joint.parent);
        let mut path: Vec<_> = std::iter::successors(frame.joint, parent).collect();
        path.reverse();
        path
    }

    /// Total mass, kg, of the links that move; with the base when it floats.
    pub fn mass(&self) -> f64 {
        let base = if self.floating { self.base.mass } else { 0.0 };
        // From a zero: the sum of no numbers is -0.
        self.joints.iter().fold(base, |mass, joint| mass + joint.joint.inertia.mass)
    }
}

impl RobotFrame {
    /// The frame in a [`Robot::tree`].
    pub fn in_tree<const N: usize>(&self, tree: &Tree<f64, N>) -> LinkFrame<f64> {
        tree.frame(self.joint.unwrap_or(usize::MAX), &self.pose)
    }
}

#[cfg(test)]
mod floating_tests;
#[cfg(test)]
mod tests;
