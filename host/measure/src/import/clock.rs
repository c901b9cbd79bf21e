//! Columns of time that count from long ago, or that are parted in two: exact, from their texts.

use crate::import::proposal;
use crate::import::recording::{Part, is_missing};
use crate::unit::Unit;

/// A time stamp of the years 2001 to 2286, ns; smaller numbers count from the beginning of a recording.
const LONG_AGO_NS: std::ops::Range<i128> = 1_000_000_000_000_000_000..9_000_000_000_000_000_000;

/// Lets a column of time since 1970 count from its first row, by nanoseconds that its numbers do
/// not have; a column of the parts of its unit (µs beside s) is added and taken away. What it counts from, ns since 1970.
pub(crate) fn from_first(part: &mut Part, k: usize, unit: Unit, notes: &mut Vec<String>) -> Option<i64> {
    let place = places(unit)?;
    let mut stamps = exact(part, k, place)?;
    let parts = parts_of(part, k, place);
    let is_one_column = parts.is_none();
    if let Some((other, fine)) = parts {
        let [one, two] = [k, other].map(|column| &part.columns[column].name);
        notes.push(format!("{one} and {two} are one time: {two} has the parts of a unit of {one}"));
        stamps
            .iter_mut()
            .zip(fine)
            .for_each(|(stamp, fine)| *stamp = stamp.zip(fine).map(|(stamp, fine)| stamp + fine));
        part.columns.remove(other);
    }
    let first = stamps.iter().flatten().next().copied()?;
    let zero = if LONG_AGO_NS.contains(&first) { first } else { 0 };
    if zero == 0 && is_one_column {
        return None;
    }
    let ns_per_unit = 10f64.powi(place as i32);
    let k = part.columns.iter().position(|column| proposal::time_unit(column).is_some())?;
    let column = &mut part.columns[k];
    column.numbers = stamps.iter().map(|ns| ns.map_or(f64::NAN, |ns| (ns - zero) as f64 / ns_per_unit)).collect();
    column.texts.clear();
    if column.unit.is_none() {
        column.unit = Some(unit.name.to_owned());
    }
    (zero > 0).then(|| i64::try_from(zero).ok())?
}

/// Decimal places of a unit in ns.
fn places(unit: Unit) -> Option<u32> {
    [("s", 9), ("ms", 6), ("us", 3), ("ns", 0)]
        .into_iter()
        .find(|(name, _)| *name == unit.name)
        .map(|(_, places)| places)
}

/// The numbers of a column in ns, by their digits; `None` of a column that has others.
fn exact(part: &Part, k: usize, places: u32) -> Option<Vec<Option<i128>>> {
    let cell = |text: &String| if is_missing(text) { Some(None) } else { decimal_ns(text, places).map(Some) };
    part.columns[k].texts.iter().map(cell).collect::<Option<Vec<_>>>().filter(|all| !all.is_empty())
}

/// A decimal number times 10^places, cut behind the point.
fn decimal_ns(text: &str, places: u32) -> Option<i128> {
    let text = text.trim();
    let (sign, digits) = text.strip_prefix('-').map_or((1, text.trim_start_matches('+')), |digits| (-1, digits));
    let (integer, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    let fraction: String = fraction.chars().chain("0".repeat(places as usize).chars()).collect();
    let fraction = fraction.get(..places as usize)?;
    let all = format!("{integer}{fraction}");
    let is_plain = !integer.is_empty() && all.len() < 30 && all.bytes().all(|byte| byte.is_ascii_digit());
    is_plain.then(|| all.parse::<i128>().ok().map(|ns| sign * ns))?
}

/// Another column of time in a smaller unit whose numbers stay below one of the first, which has integers alone: its number
/// and its values, ns.
fn parts_of(part: &Part, k: usize, place: u32) -> Option<(usize, Vec<Option<i128>>)> {
    let unit_ns = 10i128.pow(place);
    let own = &part.columns[k];
    if own.numbers.iter().any(|number| number.fract() != 0.0) {
        return None;
    }
    (0..part.columns.len()).filter(|other| *other != k).find_map(|other| {
        let column = &part.columns[other];
        let finer = places(proposal::time_unit(column).filter(|_| !proposal::is_guessed(column))?)?;
        let values = exact(part, other, finer).filter(|_| finer < place)?;
        let is_part = values.iter().flatten().all(|ns| (0..unit_ns).contains(ns));
        // It varies, or the two columns are two clocks.
        let varies = values.windows(2).any(|pair| pair[0] != pair[1]);
        (is_part && varies).then_some((other, values))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimal_numbers_keep_their_nanoseconds() {
        assert_eq!(decimal_ns("1403636580838555648", 0), Some(1_403_636_580_838_555_648));
        assert_eq!(decimal_ns("1305031102.175304", 9), Some(1_305_031_102_175_304_000));
        assert_eq!((decimal_ns("-0.5", 9), decimal_ns("1e3", 9), decimal_ns("", 9)), (Some(-500_000_000), None, None));
    }
}
