//! Files of board profiles: what is wired to a board, and the limits that no table can exceed.
//!
//! ```toml
//! format = 1
//! name = "bench arm"
//! ambient_c = 45.0                 # hottest surroundings, 25 where left out
//! rated_c = 40.0                   # up to which the duty is rated, 40 where left out
//! derate_percent_per_k = 2.0       # by which every duty is reduced above it; needed where `ambient_c` is above `rated_c`
//!
//! board = "Pico"                   # optional: the board, whose pins the wiring relies on
//!
//! [chain]
//! chips = 2                        # optional: 74HC595 in the output chain, 1 to 8
//!
//! [pins]                           # optional: pins that the wiring relies on, compared with those of the board
//! enable = "GP5"
//! inputs = ["GP6", "GP7"]
//!
//! [supply]
//! new_outputs = 6                  # at most this many are switched on
//! window_ms = 10                   # within this time
//!
//! [emergency_stop]
//! input = 12
//! opens = true                     # the contact opens when it is pressed
//!
//! [[output]]
//! number = 0
//! drive = "hold"
//! line = 0
//! max_on_ms = 300000
//! duty_percent = 80
//! window_ms = 600000
//! input = 0                        # limit switch of the actuator that it feeds
//!
//! [[output]]
//! number = 1
//! drive = "peak-hold"
//! pull = 1                         # line of the full current
//! hold = 2                         # line of the holding current
//! peak_ms = 50                     # duration of the full current; the next peak begins no sooner
//!                                  # than ten times as long after this one
//! max_on_ms = 60000
//! duty_percent = 60
//! window_ms = 120000
//!
//! [[servo]]
//! id = 1
//! min_deg = -60.0                  # of the shaft
//! max_deg = 60.0
//! max_speed_deg_s = 60.0
//! max_torque = 0.8                 # share of the servo's own
//! timeout_ms = 100
//! fallback = "hold"                # or "release"
//! ```
//!
//! An output has the keys of its drive and no other: `line` of `hold`; `pull`, `hold` and `peak_ms` of `peak-hold`; `set`,
//! `reset` and `pulse_ms` of `latch`.

mod build;
mod edit;
mod fault;
mod raw;
pub(crate) mod starting_profile;
mod wired_board;
mod write;

use std::path::Path;

use darm_core::output::{CoilLimit, Wiring};
use darm_core::profile::{BUILT_IN, Profile, ProfileRecord};
use darm_core::table::Board;
use darm_core::units::{DeviceId, ModelHash};
use darm_core::wire::message::ImageKind;
use darm_robot::source::{FileError, Source};

use self::build::build;
pub use self::edit::with_wires;
pub use self::fault::ProfileFault;
use self::raw::RawProfile;
use self::write::write_profile;
use crate::image::UploadImage;

/// The version of the file format.
pub const FORMAT: u32 = 1;

/// A profile, its name and the image that is uploaded.
#[derive(Clone, Debug, PartialEq)]
pub struct BoardProfile {
    /// What it is called in its file.
    pub name: String,
    /// What the board holds, with its digest.
    pub profile: Profile,
}

impl BoardProfile {
    /// Gives a profile the digest of its records.
    pub fn new(name: impl Into<String>, profile: Profile) -> Self {
        let digest = image(&profile).image().digest;
        Self { name: name.into(), profile: Profile { digest, ..profile } }
    }

    /// The profile that a board has without one.
    pub fn built_in() -> Self {
        Self { name: "built in".into(), profile: BUILT_IN.clone() }
    }

    /// The profile that allows just this wiring.
    pub fn of(name: impl Into<String>, wiring: &Wiring) -> Self {
        Self::new(name, Profile::of(wiring))
    }

    /// What is uploaded.
    pub fn image(&self) -> UploadImage {
        image(&self.profile)
    }

    /// What tables are checked against, for one device or for any.
    pub fn board(&self, device: Option<DeviceId>) -> Board<'_> {
        Board { device, profile: &self.profile }
    }

    /// Reads and checks a file.
    ///
    /// # Errors
    ///
    /// The file cannot be read; or as [`parse`](Self::parse).
    pub fn read(path: &Path) -> Result<Self, FileError<ProfileFault>> {
        Self::of_source(&Source::read(path)?)
    }

    /// The profile that `text` describes; `path` only serves messages.
    ///
    /// # Errors
    ///
    /// The text is not TOML of this format, a key is missing or unknown, or the board could not run the profile safely.
    /// The error names line and column.
    pub fn parse(path: &Path, text: &str) -> Result<Self, FileError<ProfileFault>> {
        Self::of_source(&Source::of_text(path, text))
    }

    fn of_source(source: &Source) -> Result<Self, FileError<ProfileFault>> {
        let raw: RawProfile = source.parse()?;
        build(&raw).map_err(|(span, fault)| source.wrong(span, fault))
    }

    /// What is not wrong and hardly meant.
    pub fn warnings(&self) -> Vec<String> {
        let outputs = self.profile.outputs.iter().enumerate();
        let never_reached = outputs.filter_map(|(number, output)| {
            let CoilLimit { max_on_ms, duty_percent, window_ms } = output.as_ref()?.limit;
            let longest_ms = 1e3 * longest_on_s(&output.as_ref()?.limit);
            (longest_ms < f64::from(max_on_ms)).then(|| {
                format!(
                    "output {number}: max_on_ms = {max_on_ms} is never reached, {duty_percent} % of {window_ms} ms are \
                     {longest_ms:.0} ms; lower max_on_ms, or raise duty_percent or window_ms"
                )
            })
        });
        never_reached.collect()
    }

    /// The text of its file.
    pub fn to_toml(&self) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = write_profile(&mut text, self);
        text
    }
}

/// The longest time in seconds that an output under this limit can be on: by the limit itself, or by duty and window.
pub fn longest_on_s(limit: &CoilLimit) -> f64 {
    let CoilLimit { max_on_ms, duty_percent, window_ms } = *limit;
    let by_duty_ms = 0.01 * f64::from(duty_percent) * f64::from(window_ms);
    1e-3 * by_duty_ms.min(f64::from(max_on_ms))
}

fn image(profile: &Profile) -> UploadImage {
    let records: Vec<ProfileRecord> = profile.records().collect();
    UploadImage::of(ImageKind::Profile, ModelHash(0), &records)
}

#[cfg(test)]
mod tests;
