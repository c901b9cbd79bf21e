//! What a typed line asks for.

use core::fmt;

use darm_core::nearest::Coordinates;
use darm_core::sequencer::Command;
use darm_core::units::{Word, WordError};
use darm_core::wire::bootstrap::RebootTarget;

/// What a line asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum TextCommand {
    Help,
    Id,
    Status,
    Limits,
    Profile,
    Table,
    Fault,
    Log,
    Reboot(RebootTarget),
    Nearest(Coordinates),
    Stop,
    Run(Command),
}

/// Why a line is no command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ParseError {
    Unknown,
    Usage(&'static str),
    Word(WordError),
}

impl fmt::Display for ParseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unknown => f.write_str("no such command; type help"),
            Self::Usage(usage) => write!(f, "usage: {usage}"),
            Self::Word(error) => write!(f, "{error}; usage: word DIGITS, as in word 010,110"),
        }
    }
}

pub(super) fn parse(line: &str) -> Result<TextCommand, ParseError> {
    let mut parts = line.split_ascii_whitespace();
    let name = parts.next().unwrap_or_default();
    let is = |word: &str| name.eq_ignore_ascii_case(word);
    if is("word") {
        let digits = line.get(name.len()..).unwrap_or_default();
        let word: Word = digits.parse().map_err(ParseError::Word)?;
        return if word.is_empty() {
            Err(ParseError::Usage("word DIGITS, as in word 010,110"))
        } else {
            Ok(TextCommand::Run(Command::Word(word)))
        };
    }
    if is("nearest") {
        return nearest(parts).map(TextCommand::Nearest);
    }
    let (first, second, third) = (parts.next(), parts.next(), parts.next());
    if is("coil") && parts.next().is_none() {
        return coil(first, second, third);
    }
    if is("servo") && third.is_none() {
        return servo(first, second);
    }
    match first {
        None if is("help") => Ok(TextCommand::Help),
        None if is("id") => Ok(TextCommand::Id),
        None if is("status") => Ok(TextCommand::Status),
        None if is("limits") => Ok(TextCommand::Limits),
        None if is("profile") => Ok(TextCommand::Profile),
        None if is("table") => Ok(TextCommand::Table),
        None if is("play") => Ok(TextCommand::Run(Command::Play)),
        None if is("stop") => Ok(TextCommand::Stop),
        None if is("clear") => Ok(TextCommand::Run(Command::Clear)),
        None if is("fault") => Ok(TextCommand::Fault),
        None if is("log") => Ok(TextCommand::Log),
        None if is("reboot") => Ok(TextCommand::Reboot(RebootTarget::Application)),
        Some(into) if is("reboot") && into.eq_ignore_ascii_case("loader") => {
            Ok(TextCommand::Reboot(RebootTarget::Loader))
        }
        _ => Err(ParseError::Unknown),
    }
}

fn coil(number: Option<&str>, on: Option<&str>, millis: Option<&str>) -> Result<TextCommand, ParseError> {
    let usage = ParseError::Usage("coil N on MS, as in coil 3 on 200, or coil N off");
    let coil = number.and_then(|text| text.parse().ok()).ok_or(usage)?;
    let on_ms = match (on, millis) {
        (Some(on), Some(millis)) if on.eq_ignore_ascii_case("on") => millis.parse().map_err(|_| usage)?,
        (Some(off), None) if off.eq_ignore_ascii_case("off") => 0,
        _ => return Err(usage),
    };
    Ok(TextCommand::Run(Command::Coil { coil, on_ms }))
}

fn servo(number: Option<&str>, angle: Option<&str>) -> Result<TextCommand, ParseError> {
    let usage = ParseError::Usage("servo N DEG, as in servo 0 -12.5");
    let servo = number.and_then(|text| text.parse().ok()).ok_or(usage)?;
    let angle_deg: f32 = angle.and_then(|text| text.parse().ok()).ok_or(usage)?;
    Ok(TextCommand::Run(Command::Servo { servo, angle_rad: angle_deg.to_radians() }))
}

/// A pose in mm and degrees: x, y and the angle about z, or x, y, z and a rotation vector.
fn nearest<'l>(parts: impl Iterator<Item = &'l str>) -> Result<Coordinates, ParseError> {
    let usage = ParseError::Usage("nearest X Y ANGLE, as in nearest 300 4200 10, or nearest X Y Z RX RY RZ; mm, deg");
    let (mut numbers, mut count) = ([0f32; 6], 0usize);
    for part in parts {
        *numbers.get_mut(count).ok_or(usage)? = part.parse().map_err(|_| usage)?;
        count = count.saturating_add(1);
    }
    let (position_mm, turn_deg) = match (count, numbers) {
        (3, [x, y, angle, ..]) => ([x, y, 0.0], [0.0, 0.0, angle]),
        (6, [x, y, z, rx, ry, rz]) => ([x, y, z], [rx, ry, rz]),
        _ => return Err(usage),
    };
    Ok(Coordinates { turn_rad: turn_deg.map(f32::to_radians), position_m: position_mm.map(|mm| mm / 1e3) })
}

#[cfg(test)]
mod tests {
    use super::{ParseError, TextCommand, parse};
    use darm_core::nearest::Coordinates;
    use darm_core::sequencer::Command;
    use darm_core::wire::bootstrap::RebootTarget;

    #[test]
    fn lines_are_commands() {
        assert_eq!(parse("coil 3 on 200"), Ok(TextCommand::Run(Command::Coil { coil: 3, on_ms: 200 })));
        assert_eq!(parse("Coil 3 OFF"), Ok(TextCommand::Run(Command::Coil { coil: 3, on_ms: 0 })));
        assert_eq!(parse("word 010,1 1"), Ok(TextCommand::Run(Command::Word("01011".parse().unwrap()))));
        assert_eq!(
            parse("servo 1 -90"),
            Ok(TextCommand::Run(Command::Servo { servo: 1, angle_rad: -90f32.to_radians() }))
        );
        assert_eq!(parse("REBOOT loader"), Ok(TextCommand::Reboot(RebootTarget::Loader)));
        assert_eq!(parse("play"), Ok(TextCommand::Run(Command::Play)));
        let plane = Coordinates { turn_rad: [0.0, 0.0, 90f32.to_radians()], position_m: [-0.3, 4.2, 0.0] };
        assert_eq!(parse("nearest -300 4200 90"), Ok(TextCommand::Nearest(plane)));
        let space = Coordinates { turn_rad: [0.0, 90f32.to_radians(), 0.0], position_m: [0.1, 0.2, 0.3] };
        assert_eq!(parse("nearest 100 200 300 0 90 0"), Ok(TextCommand::Nearest(space)));
    }

    #[test]
    fn what_is_wrong_is_said() {
        assert_eq!(parse("dance"), Err(ParseError::Unknown));
        assert_eq!(parse("play now"), Err(ParseError::Unknown));
        for line in [
            "coil",
            "coil 3",
            "coil 3 on",
            "coil 300 on 5",
            "coil 1 on -5",
            "coil 1 on 5 6",
            "servo 1",
            "servo x 3",
            "word",
            "nearest",
            "nearest 1 2 3 4",
            "nearest 1 2 x",
            "nearest 1 2 3 4 5 6 7",
        ] {
            assert!(matches!(parse(line), Err(ParseError::Usage(_) | ParseError::Unknown)), "{line}");
        }
        assert!(matches!(parse("word 0140"), Err(ParseError::Word(_))));
    }
}
