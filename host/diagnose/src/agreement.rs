//! Whether a log agrees with its model at all, or with another reading of either: before any effect is named.
//!
//! A log whose rows are shifted, whose columns are exchanged or in another unit, or that is of another robot, is explained by
//! many effects to some degree. A reading here has no value that is fitted, so that it costs nothing to explain much with it.

mod column_readings;
mod comparison;
pub(crate) mod poses;
pub(crate) mod signals;
pub(crate) mod training;

use crate::outcome::OtherReading;
pub(crate) use darm_measure::trimmed_root_mean_square;

/// Share of the variance of what was measured that a model explains which belongs to its log.
const MIN_EXPLAINED: f64 = 0.5;
/// Effects that may be added to a model which explains less, named or not: more of them build another model.
const FEW: usize = 3;

/// How a log and its model agree before any effect is added.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Agreement {
    /// As they are, or nearly.
    AsRead,
    /// Hardly: the model explains less than one that belongs to its log; no more effects than this may be added.
    Hardly(usize),
    /// Read in another way, with this error.
    Otherwise(OtherReading),
}

impl Agreement {
    /// The reading under which they agree.
    pub(crate) fn other_reading(&self) -> Option<OtherReading> {
        match self {
            Self::Otherwise(reading) => Some(reading.clone()),
            Self::AsRead | Self::Hardly(_) => None,
        }
    }

    /// Whether a model with `n_effects` added, which explains this share of the variance of rows that no fit has seen, belongs
    /// to the log.
    pub(crate) fn allows(&self, n_effects: usize, explained: f64) -> bool {
        match self {
            Self::AsRead => explained >= MIN_EXPLAINED,
            Self::Hardly(max_effects) => explained >= MIN_EXPLAINED && n_effects <= *max_effects,
            Self::Otherwise(_) => false,
        }
    }
}
