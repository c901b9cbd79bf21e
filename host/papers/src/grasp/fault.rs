//! What can be wrong with the file of a hand or of contacts.

use darm_robot::source::FileError;

/// Why a file gives no hand.
pub type HandError = FileError<HandFault>;
/// Why a file gives no contacts.
pub type ContactsError = FileError<ContactFault>;

/// What is wrong with a hand, and what to do about it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum HandFault {
    /// The file has another format than this program reads.
    #[error("format {found} is not known, this program reads 1")]
    Format {
        /// The number in the file.
        found: u32,
    },
    /// Its robot cannot be read.
    #[error("{0}")]
    Robot(String),
    /// Not four fingers.
    #[error("the hand has {found} fingers, there must be 4: index, medium, ring and thumb, each a [[finger]]")]
    Fingers {
        /// How many there are.
        found: usize,
    },
    /// A robot on which four fingers cannot be found.
    #[error(
        "a hand needs four leaf links on four joints of the base, {} are found{}; its leaf links are {}: name four by --tips INDEX,MEDIUM,RING,THUMB, or write a hand's file as examples/allegro_hand.toml",
        found.len(), if found.is_empty() { String::new() } else { format!(" ({})", found.join(", ")) }, ends.join(", ")
    )]
    Leaves {
        /// Leaf links on four joints.
        found: Vec<String>,
        /// All leaf links, with their joints.
        ends: Vec<String>,
    },
    /// A leaf link that is no fingertip.
    #[error(
        "link `{link}` is no fingertip: its origin is on its last joint or on that joint's axis; name by --tips a link that is fixed at the fingertip's middle"
    )]
    NoTip {
        /// The link.
        link: String,
    },
    /// A finger has not four joints.
    #[error("finger `{finger}` has {found} joints between the palm and its tip, there must be 4")]
    Joints {
        /// The finger.
        finger: String,
        /// How many there are.
        found: usize,
    },
    /// A joint slides, or has no limits.
    #[error("joint `{joint}` must turn and have limits: the search starts between them")]
    Unlimited {
        /// The joint.
        joint: String,
    },
    /// Two fingers hang on one joint.
    #[error("fingers `{finger}` and `{other}` share a joint: each must stand on the palm")]
    Shared {
        /// The one.
        finger: String,
        /// The other.
        other: String,
    },
    /// A link that the robot does not have.
    #[error("the robot has no link `{link}`; it has {}", known.join(", "))]
    UnknownLink {
        /// The name.
        link: String,
        /// Those that there are.
        known: Vec<String>,
    },
    /// A shape on a link that belongs to no finger.
    #[error("link `{link}` has a shape that collides, and belongs neither to the palm nor to a finger; fix its joints")]
    NoFinger {
        /// The link.
        link: String,
    },
    /// No link has a shape that collides.
    #[error("no link of the robot has a shape that collides; give each link a <collision> (URDF) or a geom (MJCF)")]
    NoShapes,
    /// A mesh whose corners are in a plane.
    #[error("a shape of link `{0}` has no volume; correct its mesh")]
    Flat(String),
    /// A length that has to be above zero.
    #[error("{value} mm; give a length above zero")]
    NotPositive {
        /// The number, mm.
        value: f64,
    },
    /// A range the wrong way round, or beyond half a turn.
    #[error("the range {low} to {high} deg; give the lower one first, within -180 and 180")]
    Range {
        /// The lower limit, degrees.
        low: f64,
        /// The upper limit, degrees.
        high: f64,
    },
    /// The sequence of λ is empty or leaves 0..1.
    #[error("the lambdas must be at least one number, each within 0 and 1")]
    Lambdas,
}

/// What is wrong with contacts, and what to do about it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ContactFault {
    /// The file has another format than this program reads.
    #[error("format {found} is not known, this program reads 1")]
    Format {
        /// The number in the file.
        found: u32,
    },
    /// Not four contacts.
    #[error("{found} contacts are given, there must be 4, each a [[contact]]")]
    Count {
        /// How many there are.
        found: usize,
    },
    /// A direction of length zero.
    #[error("the direction is 0, 0, 0; give the normal into the object")]
    NoDirection,
    /// Some contacts name their finger, this one does not.
    #[error("the contact names no finger, others do; name that of each, or of none")]
    Unnamed,
    /// A finger that the hand does not have.
    #[error("the hand has no finger `{finger}`; it has {}", known.join(", "))]
    UnknownFinger {
        /// The name.
        finger: String,
        /// Those that there are.
        known: Vec<String>,
    },
    /// One finger for two contacts.
    #[error("finger `{finger}` has a contact already")]
    Twice {
        /// The finger.
        finger: String,
    },
}
