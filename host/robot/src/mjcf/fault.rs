//! What can be wrong with what an MJCF says, and where.

use std::borrow::Cow;
use std::ops::Range;

/// What is wrong with an MJCF, and what to do about it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MjcfFault {
    /// The root element is of another format.
    #[error("the root element is <{tag}>, expected <mujoco>; give an MJCF")]
    Root {
        /// The root element.
        tag: String,
    },
    /// A file that is included cannot be read.
    #[error("{path}: {reason}")]
    File {
        /// The file.
        path: String,
        /// Why.
        reason: String,
    },
    /// Something that changes motion or mass and is not computed.
    #[error("{what} is not supported; {cure}")]
    Unsupported {
        /// What it is.
        what: String,
        /// What to write in its place.
        cure: Cow<'static, str>,
    },
    /// An attribute is not what it should be.
    #[error("{attribute} is `{value}`; give {expected}")]
    Value {
        /// The attribute.
        attribute: String,
        /// Its value.
        value: String,
        /// What it can be.
        expected: &'static str,
    },
    /// An attribute is missing.
    #[error("<{element}> has no {attribute}; add it")]
    Missing {
        /// The element.
        element: String,
        /// The attribute.
        attribute: &'static str,
    },
    /// A name that nothing has.
    #[error("no {what} is named `{name}`; add it or correct the name")]
    Unknown {
        /// What should have the name.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// Two of a kind have one name.
    #[error("two of <{what}> are named `{name}`; rename one")]
    Duplicate {
        /// The element.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// A mass or size below zero.
    #[error("{what} is {value}; give at least 0")]
    Negative {
        /// What it is.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// A joint follows itself or two others.
    #[error("joint `{joint}` follows itself or two others; remove an <equality>")]
    Follows {
        /// The joint.
        joint: String,
    },
    /// The tree that is to be read begins with a body that is not there.
    #[error("no body is named `{root}`; give one of {}", known.join(", "))]
    UnknownRoot {
        /// The name.
        root: String,
        /// The bodies that there are.
        known: Vec<String>,
    },
    /// There is no body.
    #[error("the model has no <worldbody>; add one")]
    Empty,
    /// A joint is to be locked that there is not.
    #[error("there is no moving joint `{joint}` to lock; there are {}", known.join(", "))]
    UnknownLock {
        /// The joint.
        joint: String,
        /// Those that there are.
        known: Vec<String>,
    },
}

/// What is wrong, and in which part of which file of the model.
#[derive(Debug)]
pub(super) struct Wrong {
    pub(super) file: usize,
    pub(super) span: Range<usize>,
    pub(super) fault: MjcfFault,
}
