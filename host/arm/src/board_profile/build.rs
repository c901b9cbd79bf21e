//! From the keys of a file to a profile that has been checked.

use darm_core::output::{CoilLimit, Drive, ServoWiring, SwitchLimit, WiringError};
use darm_core::profile::{EmergencyStop, Fallback, Output, Profile, ProfileError, Servo};
use toml::Spanned;

use super::fault::At;
use super::raw::{RawDrive, RawEmergencyStop, RawFallback, RawOutput, RawProfile, RawServo, RawSupply};
use super::wired_board::{board_wiring, min_supply};
use super::{BoardProfile, FORMAT, ProfileFault};
use crate::arm::ZERO_CELSIUS;

/// Hottest surroundings, °C, where a file does not say.
const AMBIENT_C: f64 = 25.0;
/// Temperature up to which the duty is rated, °C, where a file does not say.
const RATED_C: f64 = 40.0;

/// The profile that the keys describe, checked part by part.
pub(super) fn build(raw: &RawProfile) -> Result<BoardProfile, At> {
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
    profile.board = board_wiring(raw)?;
    profile.sync = raw.pins.contains_key("sync");
    check(&profile, raw.chain.as_ref().map_or(raw.supply.span(), |chain| chain.chips.span()))?;
    profile.min_supply_mv = min_supply(raw)?;
    check(&profile, raw.min_board_supply_mv.as_ref().map_or(raw.supply.span(), Spanned::span))?;
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
        let too_many = ProfileFault::Profile(ProfileError::Wiring(WiringError::TooMany));
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
