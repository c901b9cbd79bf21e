//! A sort of damage to a log, or to the model next to it.

use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// What is wrong with a model or a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(super) enum Wrong {
    /// The log is of something else, or is read in another way than it was written.
    ModelOrLog,
    /// The log holds nothing that could be diagnosed.
    Unusable,
}

/// One sort of damage to a log and its model.
pub(super) struct Sort<L: 'static> {
    pub(super) name: &'static str,
    pub(super) wrong: Wrong,
    pub(super) change: fn(&mut L, &mut ChaCha8Rng),
}

impl<L> Sort<L> {
    pub(super) const fn wrong(name: &'static str, change: fn(&mut L, &mut ChaCha8Rng)) -> Self {
        Self { name, wrong: Wrong::ModelOrLog, change }
    }

    pub(super) const fn unusable(name: &'static str, change: fn(&mut L, &mut ChaCha8Rng)) -> Self {
        Self { name, wrong: Wrong::Unusable, change }
    }
}
