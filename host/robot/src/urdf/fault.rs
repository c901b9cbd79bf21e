//! What can be wrong with what a URDF says.

/// What is wrong with a URDF, and what to do about it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum UrdfFault {
    /// There is no link.
    #[error("the robot has no <link>")]
    Empty,
    /// Two elements have one name.
    #[error("two <{element}> elements are named `{name}`")]
    Duplicate {
        /// `link` or `joint`.
        element: &'static str,
        /// The name.
        name: String,
    },
    /// A joint names a link that there is not.
    #[error("joint `{joint}` names the link `{link}`, which is not in the file")]
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
    #[error("the robot has {} root links ({}), there must be one", roots.len(), roots.join(", "))]
    Roots {
        /// The links.
        roots: Vec<String>,
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
    #[error("joint `{joint}` has the axis 0 0 0")]
    Axis {
        /// The joint.
        joint: String,
    },
    /// A number is infinite or none.
    #[error("{element} `{name}` has a number that is not finite")]
    NotFinite {
        /// `link` or `joint`.
        element: &'static str,
        /// The name.
        name: String,
    },
    /// A mass below zero.
    #[error("link `{link}` has the mass {mass} kg")]
    Mass {
        /// The link.
        link: String,
        /// Its mass.
        mass: f64,
    },
    /// Limits the wrong way round.
    #[error("joint `{joint}` has the limits {lower} to {upper}: the lower one is above")]
    Limits {
        /// The joint.
        joint: String,
        /// The lower limit.
        lower: f64,
        /// The upper limit.
        upper: f64,
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
