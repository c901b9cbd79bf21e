//! Files of board profiles: what is wired to a board, and the limits that no table can exceed.
//!
//! ```toml
//! format = 1
//! name = "bench arm"
//! ambient_c = 45.0                 # hottest surroundings, 25 where left out
//! rated_c = 40.0                   # up to which the duty is rated, 40 where left out
//! derate_percent_per_k = 2.0       # by which every duty is reduced above it; needed where `ambient_c` is above `rated_c`
//!
//! [supply]
//! new_outputs = 6                  # so many may go on
//! window_ms = 10                   # within so long
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
//! peak_ms = 50                     # so long the full current lasts; the next peak begins no sooner
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
//! max_torque = 0.8                 # share of its own
//! timeout_ms = 100
//! fallback = "hold"                # or "release"
//! ```
//!
//! An output has the keys of its drive and no other: `line` of `hold`; `pull`, `hold` and `peak_ms` of `peak-hold`; `set`,
//! `reset` and `pulse_ms` of `latch`.

mod first;

use std::fmt::Write as _;
use std::path::Path;

use darm_core::output::{CoilLimit, Drive, ServoWiring, SwitchLimit, Wiring};
use darm_core::profile::{BUILT_IN, EmergencyStop, Fallback, Output, Profile, ProfileError, ProfileRecord, Servo};
use darm_core::table::Board;
use darm_core::units::{DeviceId, ModelHash};
use darm_core::wire::message::ImageKind;
use serde::Deserialize;
use toml::Spanned;

use crate::arm::ZERO_CELSIUS;
use crate::image::UploadImage;
use darm_robot::source::FileError;
use darm_robot::source::Source;

/// The version of the file format.
pub const FORMAT: u32 = 1;

/// Hottest surroundings, °C, where a file does not say.
const AMBIENT_C: f64 = 25.0;
/// Temperature up to which the duty is rated, °C, where a file does not say.
const RATED_C: f64 = 40.0;

/// A profile, its name and the image that is uploaded.
#[derive(Clone, Debug, PartialEq)]
pub struct BoardProfile {
    /// What it is called in its file.
    pub name: String,
    /// What the board holds, with its digest.
    pub profile: Profile,
}

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
    /// The board could not run it safely.
    #[error("{0}")]
    Profile(ProfileError),
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
    pub fn read(path: &Path) -> Result<Self, FileError<ProfileFault>> {
        Self::of_source(&Source::read(path)?)
    }

    /// The profile that `text` describes; `path` only serves messages.
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
        let _ = self.write(&mut text);
        text
    }

    fn write(&self, w: &mut String) -> std::fmt::Result {
        let Profile { supply, emergency_stop, .. } = &self.profile;
        writeln!(w, "# Board profile: what is wired, and the limits that no table can exceed.")?;
        writeln!(w, "# Stored on the board by `darm profile write`, while its user button is held.\n")?;
        writeln!(w, "format = {FORMAT}\nname = {:?}\n", self.name)?;
        writeln!(w, "[supply]\nnew_outputs = {}\nwindow_ms = {}", supply.new_coils, supply.window_ms)?;
        if let Some(EmergencyStop { input, opens }) = emergency_stop {
            writeln!(w, "\n[emergency_stop]\ninput = {input}\nopens = {opens}")?;
        }
        for (number, output) in self.profile.outputs.iter().enumerate() {
            if let Some(output) = output {
                write_output(w, number, output)?;
            }
        }
        self.profile.servos.iter().try_for_each(|servo| write_servo(w, servo))
    }
}

/// The longest time in seconds that an output under this limit can be on: by the limit itself, or by duty and window.
pub fn longest_on_s(limit: &CoilLimit) -> f64 {
    let CoilLimit { max_on_ms, duty_percent, window_ms } = *limit;
    let by_duty_ms = 0.01 * f64::from(duty_percent) * f64::from(window_ms);
    1e-3 * by_duty_ms.min(f64::from(max_on_ms))
}

fn write_output(w: &mut String, number: usize, output: &Output) -> std::fmt::Result {
    writeln!(w, "\n[[output]]\nnumber = {number}")?;
    match output.drive {
        Drive::Hold { line } => writeln!(w, "drive = \"hold\"\nline = {line}")?,
        Drive::PeakHold { pull, hold, peak_ms } => {
            writeln!(w, "drive = \"peak-hold\"\npull = {pull}\nhold = {hold}\npeak_ms = {peak_ms}")?;
        }
        Drive::Latch { set, reset, pulse_ms } => {
            writeln!(w, "drive = \"latch\"\nset = {set}\nreset = {reset}\npulse_ms = {pulse_ms}")?;
        }
    }
    let CoilLimit { max_on_ms, duty_percent, window_ms } = output.limit;
    writeln!(w, "max_on_ms = {max_on_ms}\nduty_percent = {duty_percent}\nwindow_ms = {window_ms}")?;
    output.input.map_or(Ok(()), |input| writeln!(w, "input = {input}"))
}

fn write_servo(w: &mut String, servo: &Servo) -> std::fmt::Result {
    let ServoWiring { id, min_rad, max_rad, max_speed_rad_s, max_torque, timeout_ms } = servo.limit;
    // Coarser than the steps of an f32, so that 90 degrees read are 90 degrees written.
    let degrees = |angle_rad: f32| (f64::from(angle_rad).to_degrees() * 1e4).round() / 1e4;
    writeln!(w, "\n[[servo]]\nid = {id}")?;
    writeln!(w, "min_deg = {:?}\nmax_deg = {:?}", degrees(min_rad), degrees(max_rad))?;
    writeln!(w, "max_speed_deg_s = {:?}\nmax_torque = {max_torque:?}", degrees(max_speed_rad_s))?;
    let fallback = match servo.fallback {
        Fallback::Hold => "hold",
        Fallback::Release => "release",
    };
    writeln!(w, "timeout_ms = {timeout_ms}\nfallback = {fallback:?}")
}

fn image(profile: &Profile) -> UploadImage {
    let records: Vec<ProfileRecord> = profile.records().collect();
    UploadImage::of(ImageKind::Profile, ModelHash(0), &records)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawProfile {
    format: Spanned<u32>,
    name: String,
    ambient_c: Option<Spanned<f64>>,
    rated_c: Option<Spanned<f64>>,
    derate_percent_per_k: Option<Spanned<f64>>,
    supply: Spanned<RawSupply>,
    emergency_stop: Option<Spanned<RawEmergencyStop>>,
    #[serde(default)]
    output: Vec<Spanned<RawOutput>>,
    #[serde(default)]
    servo: Vec<Spanned<RawServo>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawSupply {
    new_outputs: u8,
    window_ms: u16,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawEmergencyStop {
    input: u8,
    opens: bool,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum RawDrive {
    Hold,
    PeakHold,
    Latch,
}

impl RawDrive {
    fn name(self) -> &'static str {
        match self {
            Self::Hold => "hold",
            Self::PeakHold => "peak-hold",
            Self::Latch => "latch",
        }
    }

    fn keys(self) -> &'static [&'static str] {
        match self {
            Self::Hold => &["line"],
            Self::PeakHold => &["pull", "hold", "peak_ms"],
            Self::Latch => &["set", "reset", "pulse_ms"],
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawOutput {
    number: u8,
    drive: RawDrive,
    line: Option<Spanned<u8>>,
    pull: Option<Spanned<u8>>,
    hold: Option<Spanned<u8>>,
    peak_ms: Option<Spanned<u16>>,
    set: Option<Spanned<u8>>,
    reset: Option<Spanned<u8>>,
    pulse_ms: Option<Spanned<u16>>,
    max_on_ms: u32,
    duty_percent: u8,
    window_ms: u32,
    input: Option<u8>,
}

#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
enum RawFallback {
    Hold,
    Release,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawServo {
    id: u8,
    min_deg: f64,
    max_deg: f64,
    max_speed_deg_s: f64,
    max_torque: f32,
    timeout_ms: u16,
    fallback: RawFallback,
}

/// What is wrong, and where in the file.
type At = (std::ops::Range<usize>, ProfileFault);

fn build(raw: &RawProfile) -> Result<BoardProfile, At> {
    let found = *raw.format.get_ref();
    if found != FORMAT {
        return Err((raw.format.span(), ProfileFault::Format { found }));
    }
    let RawSupply { new_outputs, window_ms } = *raw.supply.get_ref();
    let derated = derated(raw)?;
    let mut profile = Profile { supply: SwitchLimit { new_coils: new_outputs, window_ms }, ..Profile::empty() };
    profile.emergency_stop = raw.emergency_stop.as_ref().map(|stop| {
        let RawEmergencyStop { input, opens } = *stop.get_ref();
        EmergencyStop { input, opens }
    });
    check(&profile, raw.emergency_stop.as_ref().map_or(raw.supply.span(), Spanned::span))?;
    for spanned in &raw.output {
        let number = spanned.get_ref().number;
        match profile.outputs.get_mut(usize::from(number)) {
            Some(place @ None) => {
                check_drive_keys(spanned.get_ref())?;
                *place = Some(output(spanned.get_ref(), derated).map_err(|fault| (spanned.span(), fault))?);
            }
            Some(Some(_)) | None => return Err((spanned.span(), ProfileFault::Number { number })),
        }
        check(&profile, spanned.span())?;
    }
    for spanned in &raw.servo {
        let too_many = ProfileFault::Profile(ProfileError::Wiring(darm_core::output::WiringError::TooMany));
        profile.servos.push(servo(spanned.get_ref())).map_err(|_| (spanned.span(), too_many))?;
        check(&profile, spanned.span())?;
    }
    Ok(BoardProfile::new(raw.name.clone(), profile))
}

/// The check of all that has been read so far: what it refuses is in the part that came last.
fn check(profile: &Profile, last: std::ops::Range<usize>) -> Result<(), At> {
    profile.check().map_err(|error| (last, ProfileFault::Profile(error)))
}

/// The share of its duty that an output keeps in the hottest surroundings.
fn derated(raw: &RawProfile) -> Result<f64, At> {
    let ambient_c = temperature("ambient_c", raw.ambient_c.as_ref(), AMBIENT_C)?;
    let rated_c = temperature("rated_c", raw.rated_c.as_ref(), RATED_C)?;
    let per_k = match &raw.derate_percent_per_k {
        Some(percent) if (0.0..=100.0).contains(percent.get_ref()) => *percent.get_ref(),
        Some(percent) => return Err((percent.span(), ProfileFault::Derating { found: *percent.get_ref() })),
        None if ambient_c > rated_c => {
            let span = raw.ambient_c.as_ref().or(raw.rated_c.as_ref()).map_or(raw.format.span(), Spanned::span);
            return Err((span, ProfileFault::NoDerating { ambient_c, rated_c }));
        }
        None => 0.0,
    };
    Ok((1.0 - 0.01 * per_k * (ambient_c - rated_c).max(0.0)).max(0.0))
}

fn temperature(key: &'static str, given: Option<&Spanned<f64>>, default_c: f64) -> Result<f64, At> {
    match given.map(|given| (given.span(), *given.get_ref())) {
        None => Ok(default_c),
        Some((_, found)) if found.is_finite() && found > -ZERO_CELSIUS => Ok(found),
        Some((span, found)) => Err((span, ProfileFault::Temperature { key, found })),
    }
}

/// Refuses the keys of another drive, which would be read by a person and by nobody else.
fn check_drive_keys(raw: &RawOutput) -> Result<(), At> {
    let bytes =
        [("line", &raw.line), ("pull", &raw.pull), ("hold", &raw.hold), ("set", &raw.set), ("reset", &raw.reset)];
    let times = [("peak_ms", &raw.peak_ms), ("pulse_ms", &raw.pulse_ms)];
    let bytes = bytes.into_iter().filter_map(|(key, value)| Some((key, value.as_ref()?.span())));
    let times = times.into_iter().filter_map(|(key, value)| Some((key, value.as_ref()?.span())));
    match bytes.chain(times).find(|(key, _)| !raw.drive.keys().contains(key)) {
        Some((key, span)) => {
            let (drive, own) = (raw.drive.name(), raw.drive.keys().join(", "));
            Err((span, ProfileFault::OtherDrive { key, drive, own }))
        }
        None => Ok(()),
    }
}

fn output(raw: &RawOutput, derated: f64) -> Result<Output, ProfileFault> {
    fn need<T: Copy>(value: &Option<Spanned<T>>, key: &'static str, of: &'static str) -> Result<T, ProfileFault> {
        value.as_ref().map(|value| *value.get_ref()).ok_or(ProfileFault::Missing { key, of })
    }
    let drive = match raw.drive {
        RawDrive::Hold => Drive::Hold { line: need(&raw.line, "line", "a hold drive")? },
        RawDrive::PeakHold => Drive::PeakHold {
            pull: need(&raw.pull, "pull", "a peak-hold drive")?,
            hold: need(&raw.hold, "hold", "a peak-hold drive")?,
            peak_ms: need(&raw.peak_ms, "peak_ms", "a peak-hold drive")?,
        },
        RawDrive::Latch => Drive::Latch {
            set: need(&raw.set, "set", "a latch drive")?,
            reset: need(&raw.reset, "reset", "a latch drive")?,
            pulse_ms: need(&raw.pulse_ms, "pulse_ms", "a latch drive")?,
        },
    };
    let duty_percent = (f64::from(raw.duty_percent) * derated).floor() as u8;
    let limit = CoilLimit { max_on_ms: raw.max_on_ms, duty_percent, window_ms: raw.window_ms };
    Ok(Output { drive, limit, input: raw.input })
}

fn servo(raw: &RawServo) -> Servo {
    let radians = |degrees: f64| degrees.to_radians() as f32;
    let limit = ServoWiring {
        id: raw.id,
        min_rad: radians(raw.min_deg),
        max_rad: radians(raw.max_deg),
        max_speed_rad_s: radians(raw.max_speed_deg_s),
        max_torque: raw.max_torque,
        timeout_ms: raw.timeout_ms,
    };
    let fallback = match raw.fallback {
        RawFallback::Hold => Fallback::Hold,
        RawFallback::Release => Fallback::Release,
    };
    Servo { limit, fallback }
}

#[cfg(test)]
mod tests {
    use super::*;
    use darm_robot::source::Fault;

    fn read(text: &str) -> Result<BoardProfile, FileError<ProfileFault>> {
        BoardProfile::parse(Path::new("profile.toml"), text)
    }

    #[test]
    fn the_profile_of_every_example_is_written_as_it_is_read() {
        for name in ["planar4", "planar4-hybrid", "spatial6"] {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../examples/{name}.profile.toml"));
            let profile = BoardProfile::read(&path).unwrap();
            assert_eq!(profile.profile.check(), Ok(()), "{name}");
            assert_eq!(read(&profile.to_toml()).unwrap(), profile, "{name}");
        }
    }

    const HEAD: &str = "format = 1\nname = \"x\"\nsupply = { new_outputs = 1, window_ms = 10 }\n";

    fn with_output(keys: &str) -> String {
        let output = "number = 0\ndrive = \"hold\"\nline = 0\nmax_on_ms = 1000\nduty_percent = 80\nwindow_ms = 10000";
        format!("{HEAD}{keys}\n[[output]]\n{output}\n")
    }

    #[test]
    fn what_is_wrong_is_told_by_its_line() {
        let second =
            "[[output]]\nnumber = 1\ndrive = \"hold\"\nline = 0\nmax_on_ms = 1\nduty_percent = 1\nwindow_ms = 16\n";
        let error = read(&format!("{}{second}", with_output(""))).unwrap_err();
        assert_eq!(error.place.map(|place| place.line), Some(12), "{error}");
        assert!(error.to_string().contains("line 0"), "{error}");
        let error = read(&with_output("").replace("window_ms = 10000", "window_ms = 0")).unwrap_err();
        assert!(matches!(error.fault, Fault::Content(_)), "{error}");
    }

    #[test]
    fn hot_surroundings_take_from_the_duty() {
        let duty = |keys: &str| read(&with_output(keys)).unwrap().profile.outputs[0].unwrap().limit.duty_percent;
        assert_eq!(duty(""), 80);
        assert_eq!(duty("ambient_c = 50.0\nderate_percent_per_k = 2.0"), 64, "10 K above 40 °C");
        assert_eq!(duty("ambient_c = 30.0\nderate_percent_per_k = 2.0"), 80);
        assert!(read(&with_output("ambient_c = 100.0\nderate_percent_per_k = 2.0")).is_err(), "nothing is left");
    }

    #[test]
    fn keys_and_temperatures_without_effect_are_refused_at_their_place() {
        let refused = |text: &str| read(text).unwrap_err().to_string();
        let cases = [
            (with_output("") + "peak_ms = 20\n", "12:11: an output with drive = \"hold\" has no key `peak_ms`"),
            (with_output("") + "pull = 3\n", "12:8: an output with drive = \"hold\" has no key `pull`"),
            (
                with_output("").replace("drive = \"hold\"\n", "drive = \"latch\"\nset = 1\nreset = 2\npulse_ms = 9\n"),
                "11:8: an output with drive = \"latch\" has no key `line`, its keys are set, reset, pulse_ms",
            ),
            (
                with_output("ambient_c = 60.0"),
                "4:13: ambient_c is 60 °C, above rated_c of 40 °C, and derate_percent_per_k",
            ),
            (with_output("rated_c = 20.0"), "4:11: ambient_c is 25 °C, above rated_c of 20 °C"),
            (with_output("ambient_c = -300.0"), "4:13: ambient_c is -300 °C"),
            (with_output("rated_c = nan"), "4:11: rated_c is NaN °C"),
            (with_output("derate_percent_per_k = 101.0"), "4:24: derate_percent_per_k is 101; give 0 to 100"),
        ];
        for (text, expected) in cases {
            let error = refused(&text);
            assert!(error.starts_with(&format!("profile.toml:{expected}")), "{error}\n{text}");
        }
        assert!(read(&with_output("ambient_c = 60.0\nderate_percent_per_k = 0.0")).is_ok());
    }
}
