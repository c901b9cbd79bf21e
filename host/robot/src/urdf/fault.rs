//! What can be wrong with what a URDF says.

/// What is wrong with a URDF, and what to do about it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum UrdfFault {
    /// There is no link.
    #[error("the robot has no <link>; add one")]
    Empty,
    /// Two elements have one name.
    #[error("two <{element}> elements are named `{name}`; rename one")]
    Duplicate {
        /// `link` or `joint`.
        element: &'static str,
        /// The name.
        name: String,
    },
    /// A joint names a link that there is not.
    #[error("joint `{joint}` names the link `{link}`, which is not in the file; add it")]
    UnknownLink {
        /// The joint.
        joint: String,
        /// The link.
        link: String,
    },
    /// Two joints move one link.
    #[error("link `{link}` is the child of two joints, `{first}` and `{second}`: a loop cannot be computed, cut it")]
    TwoParents {
        /// The link.
        link: String,
        /// One joint.
        first: String,
        /// The other.
        second: String,
    },
    /// More than one link, or none, is nobody's child.
    #[error(
        "the robot has {} root links ({}), there must be one; connect them by joints, or read one of them with --root",
        roots.len(), roots.join(", ")
    )]
    Roots {
        /// The links.
        roots: Vec<String>,
    },
    /// The tree that is to be read begins with a link that is not there.
    #[error("no link is named `{root}`; give one of {}", known.join(", "))]
    UnknownRoot {
        /// The name.
        root: String,
        /// The links that there are.
        known: Vec<String>,
    },
    /// An element or value of the macro language of ROS, which is to be expanded before.
    #[error(
        "{what} is xacro, which describes a robot only when it is expanded; run `xacro {file} > expanded.urdf` and give expanded.urdf"
    )]
    Xacro {
        /// The element or the value.
        what: String,
        /// The file.
        file: String,
    },
    /// A rotation that is given twice, or as no quaternion.
    #[error("quat_xyzw {what}")]
    Quaternion {
        /// What is wrong, and what to do.
        what: &'static str,
    },
    /// A link does not hang on the root.
    #[error("link `{link}` is in a loop of joints: cut the loop")]
    Loop {
        /// The link.
        link: String,
    },
    /// A joint of a kind that has no axis.
    #[error("joint `{joint}` is {kind}: write it as {advice}")]
    Kind {
        /// The joint.
        joint: String,
        /// Its kind.
        kind: &'static str,
        /// What to write.
        advice: &'static str,
    },
    /// An axis without direction.
    #[error("joint `{joint}` has an axis without direction; give xyz a length of 1")]
    Axis {
        /// The joint.
        joint: String,
    },
    /// An attribute is not as many finite numbers as it should be.
    #[error("{attribute} is `{value}`; give {expected} finite number{}", if *expected == 1 { "" } else { "s between blanks" })]
    Numbers {
        /// The attribute.
        attribute: &'static str,
        /// Its value.
        value: String,
        /// How many numbers it needs.
        expected: usize,
    },
    /// An attribute is missing.
    #[error("<{element}> has no {attribute}; add {attribute}=\"…\"")]
    NoAttribute {
        /// The element.
        element: String,
        /// The attribute.
        attribute: &'static str,
    },
    /// An element is missing.
    #[error("<{element}> has no <{what}>; add it")]
    Missing {
        /// The element.
        element: &'static str,
        /// What it should hold.
        what: &'static str,
    },
    /// The root element is of another format.
    #[error("the root element is <{tag}>, expected <robot>; give a URDF")]
    Root {
        /// The root element.
        tag: String,
    },
    /// A joint mimics one that is missing, or that does not move.
    #[error("joint `{joint}` mimics `{other}`, which is no moving joint; there are {}", known.join(", "))]
    UnknownMimic {
        /// The joint.
        joint: String,
        /// What it mimics.
        other: String,
        /// The joints that move.
        known: Vec<String>,
    },
    /// A joint mimics itself.
    #[error("joint `{joint}` mimics itself, directly or through others; remove one <mimic>")]
    MimicCycle {
        /// The joint.
        joint: String,
    },
    /// A mass below zero.
    #[error("link `{link}` has the mass {mass} kg; give at least 0")]
    Mass {
        /// The link.
        link: String,
        /// Its mass.
        mass: f64,
    },
    /// Limits the wrong way round.
    #[error("joint `{joint}` has the limits {lower} to {upper}; exchange them")]
    Limits {
        /// The joint.
        joint: String,
        /// The lower limit.
        lower: f64,
        /// The upper limit.
        upper: f64,
    },
    /// A `<collision>` without one of the shapes that are read.
    #[error(
        "<collision> of link `{link}` has no shape; give it a <geometry> with a box, sphere, cylinder, capsule or mesh"
    )]
    Shape {
        /// The link.
        link: String,
    },
    /// A length or scale that is not above zero.
    #[error("{attribute} has a number that is not above 0; give sizes in m")]
    Size {
        /// The attribute.
        attribute: &'static str,
    },
    /// The file of a mesh cannot be read.
    #[error("{path}: {reason}")]
    Mesh {
        /// The file.
        path: String,
        /// Why.
        reason: String,
    },
    /// A joint is to be locked that there is not.
    #[error("there is no moving joint `{joint}` to lock; there are {}", known.join(", "))]
    UnknownLock {
        /// The joint.
        joint: String,
        /// Those that there are.
        known: Vec<String>,
    },
}
