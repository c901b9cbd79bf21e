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
    let mut rows: Vec<(f64, f64, bool)> =
        words.values().map(|(of, held_out)| (rms(of, |v| v.before_m), rms(of, |v| v.after_m), *held_out)).collect();
    rows.sort_by(|a, b| b.0.total_cmp(&a.0));
    let marks = |of: fn(&(f64, f64, bool)) -> f64| -> Vec<Mark> {
        rows.iter().enumerate().map(|(k, row)| Mark { at: [k as f64 + 0.5, of(row)], held_out: row.2 }).collect()
    };
    let x = Axis {
        label: "words, largest error first".into(),
        range: 0.0..rows.len().max(1) as f64,
        scale: Scale::Unnumbered,
    };
    errors(diagnosis, WIDE, x, [marks(|row| row.0), marks(|row| row.1)])
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
            Some(Mark { at: [of(point, visit)?, 1e3 * error(visit)], held_out: point.held_out })
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

/// A value before or after the correction.
struct Mark {
    at: [f64; 2],
    held_out: bool,
}

/// Marks as series: discs of held-out rows, circles of the others.
fn series([before, after]: [Vec<Mark>; 2]) -> Vec<Series> {
    let of = |(marks, color): (Vec<Mark>, Color)| {
        let (held_out, train): (Vec<_>, Vec<_>) = marks.into_iter().partition(|mark| mark.held_out);
        let places = |marks: Vec<Mark>| marks.into_iter().map(|mark| mark.at).collect();
        [Shape::Circles(RADIUS, places(train)), Shape::Discs(RADIUS, places(held_out))]
            .map(|shape| Series::unnamed(color, shape))
    };
    [(before, BEFORE), (after, AFTER)].into_iter().flat_map(of).collect()
}

/// Errors in mm before and after, on a logarithmic scale, with the repeatability as a line.
fn errors(diagnosis: &Diagnosis, size: (u32, u32), x: Axis, mut marks: [Vec<Mark>; 2]) -> Markup {
    marks.iter_mut().flatten().for_each(|mark| mark.at[1] = mark.at[1].max(MIN_MM));
    let noise_mm = diagnosis.repeatability.as_ref().map(|repeatability| repeatability.norm.value * 1e3);
    let all = || marks.iter().flatten().map(|mark| mark.at[1]).chain(noise_mm);
    let low = all().fold(f64::INFINITY, f64::min).max(1e-2);
    let high = all().fold(0.0, f64::max).max(2.0 * low);
    let y = Axis::logarithmic("error d, mm", 0.7 * low..1.4 * high);
    let line = |noise| Series::unnamed(NOISE, Shape::Line(vec![[x.range.start, noise], [x.range.end, noise]]));
    let series = noise_mm.map(line).into_iter().chain(series(marks)).collect();
    PreEscaped(Chart { size, x, y, series, ..Chart::default() }.svg())
}

/// Residuals of one axis of the signals over the order of the rows.
pub(super) fn along_rows(points: &[Point], axis: usize, label: &str) -> Markup {
    let step = points.len().div_ceil(MAX_POINTS).max(1);
    let marks = |of: fn(&Point) -> &Vec<f64>| -> Vec<Mark> {
        let mark = |(row, point): (usize, &Point)| Mark {
            at: [row as f64, of(point).get(axis).copied().unwrap_or(0.0)],
            held_out: point.held_out,
        };
        points.iter().enumerate().step_by(step).map(mark).collect()
    };
    let marks = [marks(|point| &point.before), marks(|point| &point.after)];
    let largest = marks.iter().flatten().map(|mark| mark.at[1].abs()).fold(f64::MIN_POSITIVE, f64::max);
    let (x, y) = (Axis::linear("row", 0.0..points.len().max(1) as f64), Axis::around(label, [-largest, largest]));
    let zero = Series::unnamed(NOISE, Shape::Line(vec![[x.range.start, 0.0], [x.range.end, 0.0]]));
    let series = [zero].into_iter().chain(series(marks)).collect();
    PreEscaped(Chart { size: FLAT, x, y, series, ..Chart::default() }.svg())
}

/// The residual of an axis along a signal.
pub(super) fn along_signal(one: &Dependence) -> Markup {
    let [x, y] = [(0, one.to_string()), (1, "residual".into())]
        .map(|(k, label)| Axis::around(&label, one.curve.iter().map(|point| point[k])));
    let series = vec![Series::unnamed(AFTER, Shape::Line(one.curve.clone()))];
    PreEscaped(Chart { size: FLAT, x, y, series, ..Chart::default() }.svg())
}
