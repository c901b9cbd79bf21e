//! Parts of different clocks on one: linear interpolation between time stamps, never across gaps.

use crate::import::error::ImportError;
use crate::import::proposal::time_column;
use crate::import::recording::{Column, Part, Recording};

/// A step of time longer than this many usual ones is a gap, as in the preparation of a diagnosis.
pub const MAX_STEP: f64 = 5.0;

/// The median step between time stamps, ns; `None` of fewer than two.
pub fn usual_step_ns(stamps_ns: &[i64]) -> Option<f64> {
    let mut steps: Vec<i64> =
        stamps_ns.windows(2).map(|pair| pair[1].saturating_sub(pair[0])).filter(|step| *step > 0).collect();
    steps.sort_unstable();
    steps.get(steps.len() / 2).map(|step| *step as f64)
}

/// Number of gaps between time stamps.
pub fn n_gaps(stamps_ns: &[i64]) -> usize {
    let longest = usual_step_ns(stamps_ns).map_or(f64::INFINITY, |step| MAX_STEP * step);
    stamps_ns.windows(2).filter(|pair| pair[1].saturating_sub(pair[0]) as f64 > longest).count()
}

/// Numbers with rising time stamps at other times, on straight lines; NaN before the first, behind the last and in gaps.
pub fn interpolated(stamps_ns: &[i64], numbers: &[f64], at_ns: &[i64]) -> Vec<f64> {
    let longest = usual_step_ns(stamps_ns).map_or(0.0, |step| MAX_STEP * step);
    at_ns.iter().map(|time_ns| value(stamps_ns, numbers, *time_ns, longest)).collect()
}

/// The number at a time, on the straight line between its neighbours; NaN where these are more than `longest_ns` apart.
fn value(stamps_ns: &[i64], numbers: &[f64], time_ns: i64, longest_ns: f64) -> f64 {
    let after = stamps_ns.partition_point(|stamp| *stamp < time_ns);
    match (after.checked_sub(1), stamps_ns.get(after)) {
        (_, Some(stamp)) if *stamp == time_ns => numbers[after],
        (Some(before), Some(stamp)) => {
            let step = stamp.saturating_sub(stamps_ns[before]) as f64;
            let share = time_ns.saturating_sub(stamps_ns[before]) as f64 / step;
            if step > longest_ns { f64::NAN } else { numbers[before] + share * (numbers[after] - numbers[before]) }
        }
        _ => f64::NAN,
    }
}

/// Texts with rising time stamps at other times: that of the last row before, empty where [`interpolated`] has none.
pub(crate) fn latest(stamps_ns: &[i64], texts: &[String], at_ns: &[i64]) -> Vec<String> {
    let known = interpolated(stamps_ns, &vec![0.0; texts.len()], at_ns);
    let text = |(time, known): (&i64, &f64)| {
        let after = stamps_ns.partition_point(|stamp| stamp <= time);
        after.checked_sub(1).filter(|_| !known.is_nan()).map_or(String::new(), |row| texts[row].clone())
    };
    at_ns.iter().zip(&known).map(text).collect()
}

/// Several files that were recorded at the same time, as one: names of their columns begin with the name of the file, and
/// each is joined by its column of time; files of single arrays without one row by row.
///
/// # Errors
///
/// A table without a column of time.
pub fn side_by_side(recordings: Vec<Recording>) -> Result<Recording, ImportError> {
    let mut all =
        Recording { path: recordings.first().map(|one| one.path.clone()).unwrap_or_default(), ..Recording::default() };
    for recording in recordings {
        let stem = recording.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        for mut part in recording.parts {
            if part.is_text_table() {
                part.name.clone_from(&stem);
                part.stamps_ns = stamps_ns(&part).ok_or_else(|| {
                    let text = "no column of time, by which it could be joined: name one time_s, t or timestamp";
                    ImportError::new(&recording.path, "", text)
                })?;
                part.columns.iter_mut().for_each(|column| column.name = format!("{stem}/{}", column.name));
                part = sorted(part);
            }
            all.parts.push(part);
        }
        all.notes.extend(recording.notes.iter().map(|note| format!("{}: {note}", recording.path.display())));
    }
    Ok(all)
}

/// The column of time of a table, ns; `None` without one or with a row that has none.
fn stamps_ns(part: &Part) -> Option<Vec<i64>> {
    let (column, unit) = time_column(part)?;
    let (factor, _) = unit.conversion(crate::unit::Unit::named("ns")?)?;
    let epoch_ns = part.epoch_ns.unwrap_or(0);
    let stamp = |number: &f64| number.is_finite().then(|| epoch_ns.saturating_add((number * factor).round() as i64));
    part.columns[column].numbers.iter().map(stamp).collect()
}

fn sorted(mut part: Part) -> Part {
    let mut rows: Vec<usize> = (0..part.stamps_ns.len()).collect();
    rows.sort_by_key(|row| part.stamps_ns[*row]);
    part.stamps_ns = rows.iter().map(|row| part.stamps_ns[*row]).collect();
    part.lines = rows.iter().filter_map(|row| part.lines.get(*row).copied()).collect();
    for Column { numbers, texts, .. } in &mut part.columns {
        *numbers = rows.iter().map(|row| numbers[*row]).collect();
        *texts = rows.iter().filter_map(|row| texts.get(*row).cloned()).collect();
    }
    part
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn straight_lines_and_no_gaps() {
        let (stamps, numbers) = ([0, 10, 20, 30, 100, 110], [0.0, 1.0, 2.0, 3.0, 10.0, 11.0]);
        let found = interpolated(&stamps, &numbers, &[-1, 0, 5, 30, 65, 105, 110, 111]);
        let shown: Vec<String> = found.iter().map(f64::to_string).collect();
        assert_eq!(shown, ["NaN", "0", "0.5", "3", "NaN", "10.5", "11", "NaN"]);
        assert_eq!((n_gaps(&stamps), n_gaps(&[]), n_gaps(&[1])), (1, 0, 0));
        assert!(interpolated(&[], &[], &[1])[0].is_nan());
        assert_eq!(latest(&stamps, &["a", "b", "c", "d", "e", "f"].map(String::from), &[5, 65, 110]), ["a", "", "f"]);
    }

    #[test]
    fn equal_stamps_divide_by_nothing() {
        let found = interpolated(&[0, 10, 10, 20], &[0.0, 1.0, 5.0, 6.0], &[10, 15, 20]);
        assert!(found.iter().all(|number| number.is_finite()), "{found:?}");
    }
}
