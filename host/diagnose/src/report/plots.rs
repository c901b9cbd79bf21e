//! The plots of a report, as SVG.

use std::collections::BTreeMap;

use crate::outcome::{Dependence, Diagnosis, Point, Visit};
use darm_arm::draw::chart::{Axis, Chart, Scale, Series, Shape};
use darm_arm::draw::palette::{BLUE, Color, MUTED, ORANGE};
use maud::{Markup, PreEscaped};

/// Errors before the correction.
const BEFORE: Color = ORANGE;
/// Errors after it.
const AFTER: Color = BLUE;
/// Repeatability.
const NOISE: Color = MUTED;

/// Size of a wide plot.
const WIDE: (u32, u32) = (920, 300);
/// Size of a narrow one.
const NARROW: (u32, u32) = (450, 250);
/// Size of a plot of signals.
const FLAT: (u32, u32) = (920, 230);
/// Radius of a mark, pixels.
const RADIUS: u32 = 3;
/// Points of one plot at most.
const MAX_POINTS: usize = 800;
/// The smallest error in a plot, mm.
const MIN_MM: f64 = 1e-3;

/// Error of each word before and after, the largest first; held-out words are filled.
pub(super) fn by_word(diagnosis: &Diagnosis) -> Markup {
    let mut words: BTreeMap<&str, (Vec<&Visit>, bool)> = BTreeMap::new();
    for (point, visit) in visits(diagnosis) {
        let (of_word, held_out) = words.entry(&visit.word).or_default();
        of_word.push(visit);
        *held_out = point.held_out;
    }
    let rms = |visits: &[&Visit], of: fn(&Visit) -> f64| {
        1e3 * (visits.iter().map(|visit| of(visit).powi(2)).sum::<f64>() / visits.len() as f64).sqrt()
    };
    let row = |(word, (of, held_out)): (&&str, &(Vec<&Visit>, bool))| {
        let [before, after] = [rms(of, |v| v.before_m), rms(of, |v| v.after_m)];
        Row { word: (*word).to_owned(), before, after, held_out: *held_out }
    };
    let mut rows: Vec<Row> = words.iter().map(row).collect();
    rows.sort_by(|a, b| b.before.total_cmp(&a.before));
    let marks = |of: fn(&Row) -> f64| -> Vec<Mark> {
        rows.iter().enumerate().map(|(k, row)| row.mark(k as f64 + 0.5, of(row))).collect()
    };
    let x = Axis {
        label: "words, largest error first".into(),
        range: 0.0..rows.len().max(1) as f64,
        scale: Scale::Unnumbered,
    };
    errors(diagnosis, WIDE, x, [marks(|row| row.before), marks(|row| row.after)])
}

/// Error over one quantity; `None` where it was not measured or is constant.
pub(super) fn over(diagnosis: &Diagnosis, name: &str, of: &dyn Fn(&Point, &Visit) -> Option<f64>) -> Option<Markup> {
    let xs: Vec<f64> = visits(diagnosis).filter_map(|(point, visit)| of(point, visit)).collect();
    let (low, high) = xs.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
    if xs.is_empty() || high - low <= 1e-9 {
        return None;
    }
    let marks = |error: fn(&Visit) -> f64| -> Vec<Mark> {
        let mark = |(point, visit): (&Point, &Visit)| {
            let (at, note) = ([of(point, visit)?, 1e3 * error(visit)], visit.word.clone());
            Some(Mark { at, held_out: point.held_out, note })
        };
        visits(diagnosis).filter_map(mark).collect()
    };
    let marks = [marks(|visit| visit.before_m), marks(|visit| visit.after_m)];
    Some(errors(diagnosis, NARROW, Axis::around(name, xs), marks))
}

/// The points that are visits of an arm.
fn visits(diagnosis: &Diagnosis) -> impl Iterator<Item = (&Point, &Visit)> {
    diagnosis.points.iter().filter_map(|point| Some((point, point.visit.as_ref()?)))
}

/// Errors of a word, root mean square over its visits, mm.
struct Row {
    word: String,
    before: f64,
    after: f64,
    held_out: bool,
}

impl Row {
    fn mark(&self, x: f64, y: f64) -> Mark {
        Mark { at: [x, y], held_out: self.held_out, note: self.word.clone() }
    }
}

/// A value before or after the correction.
struct Mark {
    at: [f64; 2],
    held_out: bool,
    /// What it is the value of; empty where the axes say it.
    note: String,
}

/// Marks as series: discs of held-out rows, circles of the others.
fn series([before, after]: [Vec<Mark>; 2]) -> Vec<Series> {
    let [before, after] = [side(before, BEFORE, "before"), side(after, AFTER, "after")];
    before.into_iter().chain(after).collect()
}

/// The marks of one side, with its name in their notes.
fn side(marks: Vec<Mark>, color: Color, name: &str) -> [Series; 2] {
    let (held_out, train): (Vec<_>, Vec<_>) = marks.into_iter().partition(|mark| mark.held_out);
    let places = |marks: &[Mark]| marks.iter().map(|mark| mark.at).collect();
    let note = |mark: &Mark, rows: &str| format!("{} {name}{rows}", mark.note).trim_start().to_owned();
    let notes = |marks: &[Mark], rows: &str| marks.iter().map(|mark| note(mark, rows)).collect();
    [
        Series::unnamed(color, Shape::Circles(RADIUS, places(&train))).with_notes(notes(&train, "")),
        Series::unnamed(color, Shape::Discs(RADIUS, places(&held_out))).with_notes(notes(&held_out, ", held out")),
    ]
}

/// Errors in mm before and after, on a logarithmic scale, with the repeatability as a line.
fn errors(diagnosis: &Diagnosis, size: (u32, u32), x: Axis, mut marks: [Vec<Mark>; 2]) -> Markup {
    marks.iter_mut().flatten().for_each(|mark| mark.at[1] = mark.at[1].max(MIN_MM));
    let noise_mm = diagnosis.repeatability.as_ref().map(|repeatability| repeatability.norm.value * 1e3);
    let all = || marks.iter().flatten().map(|mark| mark.at[1]).chain(noise_mm);
    let low = all().fold(f64::INFINITY, f64::min).max(1e-2);
    let high = all().fold(0.0, f64::max).max(2.0 * low);
    let y = Axis::logarithmic("error d, mm", 0.7 * low..1.4 * high);
    let line = |noise| {
        let ends = Shape::Line(vec![[x.range.start, noise], [x.range.end, noise]]);
        Series::unnamed(NOISE, ends).with_notes(vec!["repeatability".into(); 2])
    };
    let series = noise_mm.map(line).into_iter().chain(series(marks)).collect();
    PreEscaped(Chart { size, x, y, series, ..Chart::default() }.svg())
}

/// Residuals of one axis of the signals over the order of the rows.
pub(super) fn along_rows(points: &[Point], axis: usize, label: &str) -> Markup {
    let step = points.len().div_ceil(MAX_POINTS).max(1);
    let marks = |of: fn(&Point) -> &Vec<f64>| -> Vec<Mark> {
        let at = |row: usize, point: &Point| [row as f64, of(point).get(axis).copied().unwrap_or(0.0)];
        let rows = points.iter().enumerate().step_by(step);
        rows.map(|(row, point)| Mark { at: at(row, point), held_out: point.held_out, note: String::new() }).collect()
    };
    let marks = [marks(|point| &point.before), marks(|point| &point.after)];
    let largest = marks.iter().flatten().map(|mark| mark.at[1].abs()).fold(f64::MIN_POSITIVE, f64::max);
    let (x, y) = (Axis::linear("row", 0.0..points.len().max(1) as f64), Axis::around(label, [-largest, largest]));
    let zero = Series::unnamed(NOISE, Shape::Line(vec![[x.range.start, 0.0], [x.range.end, 0.0]]));
    let series = [zero].into_iter().chain(series(marks)).collect();
    PreEscaped(Chart { size: FLAT, x, y, series, ..Chart::default() }.svg())
}

/// The residual of an axis along a signal, with the names of both axes.
pub(super) fn along_signal(one: &Dependence, along: &str, residual: &str) -> Markup {
    let [x, y] =
        [(0, along), (1, residual)].map(|(k, label)| Axis::around(label, one.curve.iter().map(|point| point[k])));
    let series = vec![Series::unnamed(AFTER, Shape::Line(one.curve.clone()))];
    PreEscaped(Chart { size: FLAT, x, y, series, ..Chart::default() }.svg())
}
