//! A finding with its words.

use serde::Serialize;

use super::kind::Kind;
use super::subject::Subject;
use super::wording::words;

/// What is wrong, at which wire, and what to do.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// What is wrong.
    #[serde(serialize_with = "kind_name")]
    pub kind: Kind,
    /// The wires.
    pub wire: String,
    /// What the files say.
    pub expected: String,
    /// What was seen.
    pub seen: String,
    /// What to do.
    pub cure: String,
}

impl Finding {
    /// A finding in words.
    pub fn new(kind: Kind, subject: &Subject) -> Self {
        let [wire, expected, seen, cure] = words(&kind, subject);
        Self { kind, wire, expected, seen, cure }
    }
}

fn kind_name<S: serde::Serializer>(kind: &Kind, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(kind.name())
}
