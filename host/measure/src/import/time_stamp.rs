//! Calendar time and time of day as text, in nanoseconds.
//!
//! | date | read as |
//! | --- | --- |
//! | `2024-05-31`, `2024/05/31`, `20240531` | year, month, day (ISO 8601) |
//! | `31.05.2024`, `31.05.24` | day, month, year |
//! | `31-May-2024`, `31-May-24`, `May 31, 2024`, `Fri May 31 … 2024` | the month by its name in English |
//! | `5/31/2024`, `5/31/24`, `31-05-2024` | by [`Dates`]: which of day and month is first is not in the text |
//! | none | time of day, which a next day continues |
//!
//! The time is `12:30`, `12:30:00.25`, `12:30:00,25`, `12:30:00:250` or, after a date, `12.30.00.25`; `AM` or `PM` may follow, or
//! `Z`, `UTC` or `+02:00`. Without a zone it is UTC.

const NS: i64 = 1_000_000_000;
const DAY_NS: i64 = 86_400 * NS;

/// Which of day and month is first in dates that do not say it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dates {
    /// `31/05/2024`.
    DayFirst,
    /// `05/31/2024`.
    MonthFirst,
}

/// Time stamps of a column.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Stamps {
    /// Since 1970, or since midnight; `None` of an empty cell.
    pub(crate) ns: Vec<Option<i64>>,
    /// Whether they have a date, and one that is known.
    pub(crate) has_date: bool,
    pub(crate) is_since_1970: bool,
    /// What was assumed.
    pub(crate) note: Option<String>,
}

/// Whether a text is a time stamp in some order of day and month.
pub(crate) fn is_stamp(text: &str) -> bool {
    [Dates::DayFirst, Dates::MonthFirst].into_iter().any(|dates| parse(text, dates).is_some())
}

/// The time stamps of a column; `None` where a cell with a value is none, `Some(Err)` where they can be read in two ways.
pub(crate) fn column<'a>(
    cells: impl Iterator<Item = Option<&'a str>> + Clone,
    given: Option<Dates>,
) -> Option<Result<Stamps, String>> {
    let read = |dates: Dates| -> Option<Vec<Option<Stamp>>> {
        cells.clone().map(|cell| cell.map_or(Some(None), |cell| parse(cell, dates).map(Some))).collect()
    };
    let (first_day, first_month) = (read(Dates::DayFirst), read(Dates::MonthFirst));
    let (stamps, is_known, note) = match (given, first_day, first_month) {
        (Some(Dates::DayFirst), found, _) | (Some(Dates::MonthFirst), _, found) => (found?, true, None),
        (None, Some(one), Some(other)) if one == other => (one, true, None),
        (None, Some(one), None) => (one, true, Some("its dates are read as day, month, year".to_owned())),
        (None, None, Some(one)) => (one, true, Some("its dates are read as month, day, year".to_owned())),
        (None, Some(one), Some(other)) => {
            let since_first = |stamps: &[Option<Stamp>]| -> Vec<Option<i64>> {
                let first = stamps.iter().flatten().next().map_or(0, |stamp| stamp.ns);
                stamps.iter().map(|stamp| stamp.map(|stamp| stamp.ns - first)).collect()
            };
            if since_first(&one) != since_first(&other) {
                return Some(Err(
                    "its dates may begin with the day or with the month: say it with --dates day-first or \
                                 --dates month-first"
                        .to_owned(),
                ));
            }
            (one, false, Some("its date may begin with the day or with the month; only the time is used".to_owned()))
        }
        (None, None, None) => return None,
    };
    if stamps.iter().all(Option::is_none) {
        return None;
    }
    let has_date = stamps.iter().flatten().all(|stamp| stamp.has_date);
    let (mut days_ns, mut before) = (0, None);
    let ns = stamps.iter().map(|stamp| {
        let Stamp { ns, has_date } = (*stamp)?;
        // A time of day that falls by more than half a day is of the next one.
        if !has_date && before.is_some_and(|before| before - ns > DAY_NS / 2) {
            days_ns += DAY_NS;
        }
        before = Some(ns);
        Some(if has_date { ns } else { ns + days_ns })
    });
    let ns = ns.collect();
    Some(Ok(Stamps { ns, has_date, is_since_1970: has_date && is_known, note }))
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Stamp {
    ns: i64,
    has_date: bool,
}

fn parse(text: &str, dates: Dates) -> Option<Stamp> {
    let text = without_zone_name(text.trim());
    let (text, half) = half_of_day(text);
    // The clock begins with the digits before its first colon; without one it is after a date.
    let at = match text.find(':') {
        Some(colon) => text[..colon].rfind(|c: char| !c.is_ascii_digit()).map_or(0, |before| before + 1),
        None => text.find([' ', 'T'])? + 1,
    };
    let (date, clock) = (text.get(..at)?.trim_end_matches([' ', 'T', '/', '_', ',']), text.get(at..)?.trim_start());
    if let Some(stamp) = compact(date, clock) {
        return Some(stamp);
    }
    let (clock, year) = match clock.split_once(' ') {
        // `Fri May 31 12:30:00 2024`
        Some((clock, year)) if year.len() == 4 && year.bytes().all(|byte| byte.is_ascii_digit()) => (clock, year),
        _ => (clock, ""),
    };
    let (clock, ahead_s) = match clock.find(['+', '-', 'Z']) {
        Some(at) => (clock[..at].trim_end(), zone_s(&clock[at..])?),
        None => (clock, 0),
    };
    // A number of days, as of a duration of pandas.
    let n_days = date.strip_suffix("days").or_else(|| date.strip_suffix("day")).and_then(|n| n.trim().parse().ok());
    if date.is_empty() || n_days.is_some() {
        let of_day = clock_ns(clock, false, half)?.checked_add(DAY_NS.checked_mul(n_days.unwrap_or(0))?)?;
        return Some(Stamp { ns: of_day - ahead_s * NS, has_date: false });
    }
    let of_day = clock_ns(clock, true, half)? - ahead_s * NS;
    let ns = days(date_of(&format!("{date} {year}"), dates)?).checked_mul(DAY_NS)?.checked_add(of_day)?;
    Some(Stamp { ns, has_date: true })
}

/// The text without the name of UTC or of a place at its end; other names of zones have no one meaning.
fn without_zone_name(text: &str) -> &str {
    let place = text.strip_suffix(']').and_then(|rest| rest.rsplit_once('['));
    let text = place.map_or(text, |(text, _)| text);
    text.strip_suffix("UTC").or_else(|| text.strip_suffix("GMT")).map_or(text, str::trim_end)
}

/// The text without AM or PM, and the hours that they add.
fn half_of_day(text: &str) -> (&str, Option<i64>) {
    let end = text.char_indices().rev().find(|(_, c)| c.is_ascii_digit()).map_or(0, |(at, _)| at + 1);
    let letters: String = text[end..].chars().filter(char::is_ascii_alphabetic).collect();
    match letters.to_ascii_uppercase().as_str() {
        "AM" => (&text[..end], Some(0)),
        "PM" => (&text[..end], Some(12)),
        _ => (text, None),
    }
}

/// `20240531T123000.25Z`, the basic form of ISO 8601.
fn compact(date: &str, clock: &str) -> Option<Stamp> {
    let is_digits = |text: &str, n: usize| text.len() == n && text.bytes().all(|byte| byte.is_ascii_digit());
    let digits = clock.trim_end_matches('Z');
    let (time, fraction) = digits.split_once(['.', ',']).unwrap_or((digits, "0"));
    if !is_digits(date, 8) || !is_digits(time, 6) {
        return None;
    }
    let date = format!("{}-{}-{}", &date[..4], &date[4..6], &date[6..]);
    let clock = format!("{}:{}:{}.{fraction}", &time[..2], &time[2..4], &time[4..]);
    let ns = days(date_of(&date, Dates::DayFirst)?).checked_mul(DAY_NS)?.checked_add(clock_ns(&clock, true, None)?)?;
    Some(Stamp { ns, has_date: true })
}

/// The first three letters of the months in English, as programs write them in every country.
const MONTHS: &str = "janfebmaraprmayjunjulaugsepoctnovdec";

/// The month that a word names.
fn month(word: &str) -> Option<i64> {
    let start = word.get(..3)?.to_ascii_lowercase();
    let at = MONTHS.find(&start).filter(|at| at % 3 == 0)?;
    Some(at as i64 / 3 + 1)
}

/// Year, month and day.
pub(crate) fn date_of(text: &str, dates: Dates) -> Option<[i64; 3]> {
    let mark = text.trim().chars().find(|c| matches!(c, '-' | '/' | '.' | ' '))?;
    let words: Vec<&str> = text.split([mark, ' ', ',']).filter(|word| !word.is_empty()).collect();
    // A day of the week before a month that has a name.
    let is_weekday = |word: &&str| ["mon", "tue", "wed", "thu", "fri", "sat", "sun"].contains(word);
    let first = words.first()?.to_ascii_lowercase();
    let words = if words.len() == 4 && is_weekday(&first.get(..3)?) { &words[1..] } else { &words[..] };
    let [a, b, c] = words[..] else { return None };
    let number = |part: &str| part.bytes().all(|byte| byte.is_ascii_digit()).then(|| part.parse::<i64>().ok())?;
    // Two digits are of 1969 to 2068, as for `%y` of POSIX.
    let year = |part: &str| {
        let year = number(part)?;
        match part.len() {
            4 => Some(year),
            2 => Some(if year < 69 { 2000 + year } else { 1900 + year }),
            _ => None,
        }
    };
    let date = match (month(a), month(b)) {
        (Some(month), _) => [year(c)?, month, number(b)?],
        (_, Some(month)) if a.len() == 4 => [number(a)?, month, number(c)?],
        (_, Some(month)) => [year(c)?, month, number(a)?],
        _ => {
            let [first, second, third] = [number(a)?, number(b)?, number(c)?];
            match (a.len(), c.len(), mark) {
                (4, ..) => [first, second, third],
                (1 | 2, 2 | 4, '.') => [year(c)?, second, first],
                // Two digits between dashes may be the year first.
                (1 | 2, 4, '-') | (1 | 2, 2 | 4, '/') if dates == Dates::DayFirst => [year(c)?, second, first],
                (1 | 2, 4, '-') | (1 | 2, 2 | 4, '/') => [year(c)?, first, second],
                _ => return None,
            }
        }
    };
    let [year, month, day] = date;
    let is_date = (1900..2200).contains(&year) && (1..=12).contains(&month);
    (is_date && (1..=31).contains(&day)).then_some(date)
}

/// Time of day, ns. Without a date it needs seconds, and colons: `12.5` is a number; and it may be a duration of more than a day.
fn clock_ns(text: &str, has_date: bool, half: Option<i64>) -> Option<i64> {
    let mark = if text.contains(':') { ':' } else { '.' };
    if mark == '.' && !has_date {
        return None;
    }
    let mut parts = text.splitn(3, mark);
    let digits_of = |part: &str| -> Option<i64> {
        ((1..=2).contains(&part.len()) && part.bytes().all(|byte| byte.is_ascii_digit())).then(|| part.parse().ok())?
    };
    let (hours, minutes) = (digits_of(parts.next()?)?, digits_of(parts.next()?)?);
    let seconds = parts.next();
    if seconds.is_none() && !has_date {
        return None;
    }
    // `12:30:00:250` has milliseconds; two digits there are frames of a camera.
    let seconds = seconds.unwrap_or("0");
    let (seconds, fraction) = match seconds.split_once(':') {
        Some((_, digits)) if digits.len() < 3 => return None,
        Some(pair) => pair,
        None => seconds.split_once(['.', ',']).unwrap_or((seconds, "")),
    };
    let seconds = digits_of(seconds)?;
    let digits: String = fraction.chars().chain("000000000".chars()).take(9).collect();
    let fraction: i64 =
        if fraction.bytes().all(|byte| byte.is_ascii_digit()) { digits.parse().ok()? } else { return None };
    let hours = match half {
        Some(half) if (1..=12).contains(&hours) => hours % 12 + half,
        Some(_) => return None,
        None => hours,
    };
    let is_clock = (hours < 24 || !has_date) && minutes < 60 && seconds < 61;
    is_clock.then_some(((hours * 60 + minutes) * 60 + seconds) * NS + fraction)
}

fn zone_s(text: &str) -> Option<i64> {
    let text = text.trim();
    if text == "Z" {
        return Some(0);
    }
    let sign = if text.starts_with('-') { -1 } else { 1 };
    let digits: String = text[1..].chars().filter(|c| *c != ':').collect();
    let (hours, minutes) = digits.split_at_checked(2)?;
    let minutes = if minutes.is_empty() { 0 } else { minutes.parse::<u16>().ok()? };
    Some(sign * (i64::from(hours.parse::<u16>().ok()?) * 3600 + i64::from(minutes) * 60))
}

/// Days since 1970 in the Gregorian calendar, years beginning in March.
fn days([year, month, day]: [i64; 3]) -> i64 {
    let (year, month) = if month < 3 { (year - 1, month + 9) } else { (year, month - 3) };
    365 * year + year / 4 - year / 100 + year / 400 + (153 * month + 2) / 5 + day - 1 - 719_468
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ns(text: &str, dates: Dates) -> Option<i64> {
        parse(text, dates).map(|stamp| stamp.ns)
    }

    #[test]
    fn calendar_time_is_nanoseconds_since_1970() {
        let noon = 1_709_208_000_500_000_000;
        for text in [
            "2024-02-29T12:00:00.5Z",
            "2024/02/29 14:00:00.5+02:00",
            "29.02.2024 12:00:00,5",
            "2024-02-29 12.00.00.5 PM",
            "29/2/2024 12:00:00.5",
            "29-02-2024 12:00:00.500 pm",
            "29.02.24 12:00:00,5",
            "29/2/24 12:00:00.5",
            "29-Feb-24 12:00:00.5",
        ] {
            assert_eq!(ns(text, Dates::DayFirst), Some(noon), "{text}");
        }
        assert_eq!(ns("2/29/2024 12:00:00.5 PM", Dates::MonthFirst), Some(noon));
        assert_eq!(ns("1970-01-01 00:00:00", Dates::DayFirst), Some(0));
        assert_eq!(ns("1.1.70 00:00:00", Dates::DayFirst), Some(0));
        assert_eq!(ns("05-06-07 00:00:00", Dates::DayFirst), None, "the year may be first");
        assert_eq!(ns("1970-01-01 12:00:01 AM", Dates::DayFirst), Some(NS));
        for wrong in [
            "",
            "2024-13-01 00:00:00",
            "12.5",
            "2024-01-01",
            "2024-01-01 25:00:00",
            "abcdefghij klm",
            "ääääääääää",
            "12:30",
            "13:00:00 PM",
            "1.2.3",
            "0:1:2:3",
            "PM",
            "é",
            "2024-01-01 1:2:3.x",
        ] {
            assert!(!is_stamp(wrong), "{wrong}");
        }
    }

    #[test]
    fn day_and_month_are_found_by_the_column_or_asked() {
        let read = |cells: &[&str]| column(cells.iter().map(|cell| Some(*cell)), None);
        let known = read(&["1/5/2024 10:00:00", "1/13/2024 10:00:00"]).unwrap().unwrap();
        assert_eq!((known.ns[1].unwrap() - known.ns[0].unwrap(), known.is_since_1970), (8 * DAY_NS, true));
        let of_one_day = read(&["1/5/2024 10:00:00", "1/5/2024 10:00:01"]).unwrap().unwrap();
        assert_eq!((of_one_day.ns[1].unwrap() - of_one_day.ns[0].unwrap(), of_one_day.is_since_1970), (NS, false));
        let asked = read(&["1/5/2024 10:00:00", "1/6/2024 10:00:00"]).unwrap().unwrap_err();
        assert!(asked.ends_with("--dates month-first"), "{asked}");
        assert_eq!(read(&["1/5/2024 10:00:00", "on"]), None);
    }

    #[test]
    fn a_time_of_day_continues_after_midnight() {
        let cells = [Some("23:59:59.5"), None, Some("00:00:00.25")];
        let Stamps { ns, is_since_1970, .. } = column(cells.into_iter(), None).unwrap().unwrap();
        assert_eq!((ns[2].unwrap() - ns[0].unwrap(), ns[1], is_since_1970), (750_000_000, None, false));
    }
}
