//! Calendar time as text (ISO 8601), in seconds since 1970.

/// `2024-05-01 12:30:00.25`, with `T` for the blank, `/` for `-`, and `Z` or `+02:00` behind; without these it is UTC.
pub fn parse(text: &str) -> Option<f64> {
    let text = text.trim();
    let (date, clock) = text.split_at_checked(10)?;
    let mut numbers = date.split(['-', '/']).map(|part| part.parse::<i64>().ok());
    let (year, month, day) = (numbers.next()??, numbers.next()??, numbers.next()??);
    let clock = clock.strip_prefix([' ', 'T'])?;
    let (clock, ahead_s) = match clock.find(['+', '-', 'Z']) {
        Some(at) => (&clock[..at], zone_s(&clock[at..])?),
        None => (clock, 0.0),
    };
    let mut parts = clock.split(':');
    let (hours, minutes): (u32, u32) = (parts.next()?.parse().ok()?, parts.next()?.parse().ok()?);
    let seconds: f64 = parts.next().map_or(Some(0.0), |text| text.replace(',', ".").parse().ok())?;
    let is_date = (1900..3000).contains(&year) && (1..=12).contains(&month) && (1..=31).contains(&day);
    let is_clock = hours < 24 && minutes < 60 && (0.0..61.0).contains(&seconds) && parts.next().is_none();
    let day_s = f64::from(hours * 3600 + minutes * 60) + seconds;
    (is_date && is_clock).then(|| days(year, month, day) as f64 * 86400.0 + day_s - ahead_s)
}

fn zone_s(text: &str) -> Option<f64> {
    if text == "Z" {
        return Some(0.0);
    }
    let sign = if text.starts_with('-') { -1.0 } else { 1.0 };
    let digits: String = text[1..].chars().filter(|c| *c != ':').collect();
    let (hours, minutes) = digits.split_at_checked(2)?;
    let minutes = if minutes.is_empty() { 0 } else { minutes.parse::<u16>().ok()? };
    Some(sign * (f64::from(hours.parse::<u16>().ok()?) * 3600.0 + f64::from(minutes) * 60.0))
}

/// Days since 1970 in the Gregorian calendar, years beginning in March.
fn days(year: i64, month: i64, day: i64) -> i64 {
    let (year, month) = if month < 3 { (year - 1, month + 9) } else { (year, month - 3) };
    365 * year + year / 4 - year / 100 + year / 400 + (153 * month + 2) / 5 + day - 1 - 719_468
}

#[cfg(test)]
mod tests {
    use super::parse;

    #[test]
    fn calendar_time_is_seconds_since_1970() {
        assert_eq!(parse("1970-01-01 00:00:00"), Some(0.0));
        assert_eq!(parse("2024-02-29T12:00:00.5Z"), Some(1_709_208_000.5));
        assert_eq!(parse("2024/02/29 14:00:00.5+02:00"), Some(1_709_208_000.5));
        for wrong in
            ["", "2024-13-01 00:00:00", "12.5", "2024-01-01", "2024-01-01 25:00:00", "abcdefghij klm", "ääääääääää"]
        {
            assert_eq!(parse(wrong), None, "{wrong}");
        }
    }
}
