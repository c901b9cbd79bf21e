//! Columns of time that count from long ago, or that are parted in two: exact, from their texts.

use crate::import::proposal;
use crate::import::recording::{Column, Part, is_missing};
use crate::unit::Unit;

/// A time stamp of the years 2001 to 2286, ns; smaller numbers count from the beginning of a recording.
const LONG_AGO_NS: std::ops::Range<i128> = 1_000_000_000_000_000_000..9_000_000_000_000_000_000;

/// Lets a column of time since 1970 count from its first row, by nanoseconds that its numbers do
/// not have; a column of the parts of its unit (µs beside s) is added and taken away. What it counts from, ns since 1970.
pub(crate) fn from_first(part: &mut Part, mut k: usize, unit: Unit, notes: &mut Vec<String>) -> Option<i64> {
    let (mut place, mut parts) = (places(unit)?, None);
    for other in (0..part.columns.len()).filter(|other| *other != k) {
        let Some(others) = named_places(&part.columns[other]) else { continue };
        let (coarse, fine) = if others < place { ((k, place), (other, others)) } else { ((other, others), (k, place)) };
        if let Some(values) = parts_of(part, coarse, fine) {
            (k, place, parts) = (coarse.0, coarse.1, Some((fine.0, values)));
            break;
        }
    }
    let mut stamps = exact(part, k, place)?;
    let is_one_column = parts.is_none();
    let ns_per_unit = 10f64.powi(place as i32);
    if let Some((other, fine)) = parts {
        let [one, two] = [k, other].map(|column| &part.columns[column].name);
        notes.push(format!("{one} and {two} are one time: {two} has the parts of a unit of {one}"));
        stamps
            .iter_mut()
            .zip(fine)
            .for_each(|(stamp, fine)| *stamp = stamp.zip(fine).map(|(stamp, fine)| stamp + fine));
        part.columns.remove(other);
        k -= usize::from(other < k);
    }
    let first = stamps.iter().flatten().next().copied()?;
    let zero = if LONG_AGO_NS.contains(&first) { first } else { 0 };
    if zero == 0 && is_one_column {
        return None;
    }
    let column = &mut part.columns[k];
    column.numbers = stamps.iter().map(|ns| ns.map_or(f64::NAN, |ns| (ns - zero) as f64 / ns_per_unit)).collect();
    column.texts.clear();
    if column.unit.is_none() {
        column.unit = UNITS.into_iter().find(|(_, other)| *other == place).map(|(name, _)| name.to_owned());
    }
    (zero > 0).then(|| i64::try_from(zero).ok())?
}

/// Units of time stamps and their decimal places in ns.
const UNITS: [(&str, u32); 4] = [("s", 9), ("ms", 6), ("us", 3), ("ns", 0)];

/// Decimal places of a unit in ns.
fn places(unit: Unit) -> Option<u32> {
    UNITS.into_iter().find(|(name, _)| *name == unit.name).map(|(_, places)| places)
}

/// The same of a column of time whose unit the file names.
fn named_places(column: &Column) -> Option<u32> {
    places(proposal::time_unit(column).filter(|_| !proposal::is_guessed(column))?)
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

/// The values of a column of time, ns, where they are the parts of a unit of another one, which has integers alone.
fn parts_of(part: &Part, coarse: (usize, u32), fine: (usize, u32)) -> Option<Vec<Option<i128>>> {
    let own = &part.columns[coarse.0].numbers;
    let is_finer = fine.1 < coarse.1 && own.iter().all(|number| number.fract() == 0.0 || number.is_nan());
    let values = exact(part, fine.0, fine.1).filter(|_| is_finer)?;
    let is_part = values.iter().flatten().all(|ns| (0..10i128.pow(coarse.1)).contains(ns));
    // It varies, and begins again with a unit of the other and only then, or the two columns are two clocks.
    let steps = || values.windows(2).zip(own.windows(2)).map(|(fine, own)| (fine[0].cmp(&fine[1]), own[1] - own[0]));
    let falls = || steps().filter(|(fine, _)| fine.is_gt());
    let begins_again =
        falls().all(|(_, step)| step > 0.0) && (falls().next().is_some() || steps().all(|(_, step)| step == 0.0));
    let varies = steps().any(|(fine, _)| fine.is_ne());
    (is_part && varies && begins_again).then_some(values)
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
