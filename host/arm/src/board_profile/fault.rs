//! What can be wrong with a profile's file.

use darm_core::profile::ProfileError;

use super::FORMAT;

/// What is wrong, and where in the file.
pub(super) type At = (std::ops::Range<usize>, ProfileFault);

/// Why a profile file is refused.
#[derive(Debug, thiserror::Error)]
pub enum ProfileFault {
    /// Another version of the format.
    #[error("format {found} is not known; this version reads format {FORMAT}")]
    Format {
        /// The version in the file.
        found: u32,
    },
    /// The number of an output is too large or used twice.
    #[error("output {number} is used twice or is not one of 0 to {}", darm_core::output::MAX_COILS - 1)]
    Number {
        /// The number.
        number: u8,
    },
    /// A key is missing.
    #[error("{of} needs the key {key}")]
    Missing {
        /// The key.
        key: &'static str,
        /// What needs it.
        of: &'static str,
    },
    /// A key that belongs to another drive.
    #[error(
        "an output with drive = {drive:?} has no key `{key}`, its keys are {own}; remove `{key}`, or correct `drive`"
    )]
    OtherDrive {
        /// The key.
        key: &'static str,
        /// The drive of the output.
        drive: &'static str,
        /// The keys of this drive.
        own: String,
    },
    /// The derating is not a number between 0 and 100 % per kelvin.
    #[error("derate_percent_per_k is {found}; give 0 to 100")]
    Derating {
        /// The number in the file.
        found: f64,
    },
    /// A temperature that nothing has.
    #[error("{key} is {found} °C; give a temperature above -273.15 °C")]
    Temperature {
        /// The key.
        key: &'static str,
        /// The number in the file.
        found: f64,
    },
    /// It is hotter than rated, and nothing says what that costs.
    #[error(
        "ambient_c is {ambient_c} °C, above rated_c of {rated_c} °C, and derate_percent_per_k is missing; add it from the data \
         sheet, or correct rated_c"
    )]
    NoDerating {
        /// Hottest surroundings.
        ambient_c: f64,
        /// Temperature up to which the duty is rated.
        rated_c: f64,
    },
    /// A board whose pins are not known.
    #[error("board {found:?} is not known; give one of {known}, or remove `board` and [pins]")]
    Board {
        /// The name in the file.
        found: String,
        /// The names that are known.
        known: String,
    },
    /// Pins of no board.
    #[error("[pins] without `board` cannot be checked; add `board`, or remove [pins]")]
    PinsWithoutBoard,
    /// A function that the board does not have.
    #[error("{board} has no pin for `{key}`; the functions of its pins are {known}")]
    PinFunction {
        /// The key.
        key: String,
        /// The board.
        board: &'static str,
        /// Its functions.
        known: String,
    },
    /// The function is at another pin.
    #[error("`{key}` is at {found}, and the firmware of {board} has it at {fixed}; move the wire, and correct `{key}`")]
    Pin {
        /// The key.
        key: String,
        /// The board.
        board: &'static str,
        /// The pin in the file.
        found: String,
        /// The pin of the board.
        fixed: String,
    },
    /// The board could not run it safely.
    #[error("{0}")]
    Profile(ProfileError),
}
