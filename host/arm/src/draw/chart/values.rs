//! Values of the points of a chart: a `<title>` under the pointer of a mouse and for a screen reader, on transparent marks.

use std::fmt::Write as _;

use super::rounded::rounded;
use super::{Axis, Chart, Plane, Scale, Series, Shape};

/// Points of one series whose values can be seen; of more, every other one, every third one, and so on.
const MAX_OF_SERIES: usize = 400;
/// Boxes of a chart whose values can be seen; a chart of more boxes has none.
const MAX_BOXES: usize = 4000;
/// Radius of a transparent mark, pixels.
const RADIUS: u32 = 5;

/// The transparent marks of all series, as a group of an SVG.
pub(super) fn marks(chart: &Chart, plane: &Plane<'_>) -> String {
    let n_boxes = chart.series.iter().filter(|series| matches!(series.shape, Shape::Box(_))).count();
    let mut svg = String::from("<g class=\"values\" fill=\"transparent\">");
    for series in &chart.series {
        match &series.shape {
            Shape::Line(points) | Shape::Dashed(points) | Shape::Discs(_, points) | Shape::Circles(_, points) => {
                svg += &of_points(chart, series, points, plane);
            }
            Shape::Box(corners) if n_boxes <= MAX_BOXES => svg += &of_box(series, corners, plane),
            Shape::Box(_) | Shape::Band(_) => {}
        }
    }
    svg + "</g>"
}

fn of_points(chart: &Chart, series: &Series, points: &[[f64; 2]], plane: &Plane<'_>) -> String {
    let is_seen = |point: &[f64; 2]| {
        [(&chart.x, point[0]), (&chart.y, point[1])].iter().all(|(axis, at)| {
            let margin = 1e-9 * (axis.range.end - axis.range.start);
            (axis.range.start - margin..=axis.range.end + margin).contains(at)
        })
    };
    let step = points.len().div_ceil(MAX_OF_SERIES).max(1);
    let mut svg = String::new();
    for (index, point) in points.iter().enumerate().step_by(step).filter(|(_, point)| is_seen(point)) {
        let (x, y) = plane.backend_coord(&(point[0], point[1]));
        let note = series.notes.get(index).or(series.name.as_ref()).map_or(String::new(), |note| format!("{note}: "));
        let values: Vec<String> = [(&chart.x, point[0]), (&chart.y, point[1])].iter().filter_map(value).collect();
        let title = escaped(&format!("{note}{}", values.join(", ")));
        // Writing into a string does not fail.
        let _ = write!(svg, "<circle cx=\"{x}\" cy=\"{y}\" r=\"{RADIUS}\"><title>{title}</title></circle>");
    }
    svg
}

fn of_box(series: &Series, corners: &[[f64; 2]; 2], plane: &Plane<'_>) -> String {
    let Some(note) = series.notes.first() else { return String::new() };
    let [(left, bottom), (right, top)] = corners.map(|[x, y]| plane.backend_coord(&(x, y)));
    let (width, height) = ((right - left).abs(), (bottom - top).abs());
    let (left, top, title) = (left.min(right), top.min(bottom), escaped(note));
    format!("<rect x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\"><title>{title}</title></rect>")
}

/// A value with the quantity and the unit of its axis: `time 12.3 s`.
fn value((axis, at): &(&Axis, f64)) -> Option<String> {
    let number = match axis.scale {
        Scale::Unnumbered => return None,
        Scale::Linear => rounded(*at, 0.1 * (axis.range.end - axis.range.start)),
        Scale::Logarithmic if (1e-3..1e5).contains(at) => rounded(*at, *at),
        Scale::Logarithmic => format!("{at:.2e}"),
    };
    Some(match axis.label.rsplit_once(", ") {
        Some((name, unit)) => format!("{name} {number} {unit}"),
        None => format!("{} {number}", axis.label).trim().to_owned(),
    })
}

/// A text in XML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::super::{Axis, Chart, Scale, Series, Shape};
    use crate::draw::palette::BLUE;

    fn titles(svg: &str) -> Vec<&str> {
        svg.split("<title>").skip(1).map(|rest| rest.split("</title>").next().unwrap()).collect()
    }

    #[test]
    fn points_show_their_values_with_units_and_notes() {
        let points = vec![[1.0, 0.5], [f64::NAN, 0.1], [2.5, 0.01], [99.0, 0.1]];
        let notes = ["0101 & held out", "", "1100", ""].map(str::to_owned).to_vec();
        let discs = Series::unnamed(BLUE, Shape::Discs(3, points.clone())).with_notes(notes);
        let line = Series::named("dls", BLUE, Shape::Line(points[..1].to_vec()));
        let (x, y) = (Axis::linear("time, s", 0.0..10.0), Axis::logarithmic("error d, mm", 1e-3..1.0));
        let svg = Chart { x, y, series: vec![discs, line], ..Chart::default() }.svg();
        let expected = ["0101 &amp; held out: time 1 s, error d 0.5 mm", "1100: time 2.5 s, error d 0.01 mm"];
        assert_eq!(titles(&svg), [expected[0], expected[1], "dls: time 1 s, error d 0.5 mm"]);
    }

    #[test]
    fn boxes_show_their_notes_and_an_order_shows_no_number() {
        let squares = Series::unnamed(BLUE, Shape::Box([[0.0, 0.0], [0.5, 0.5]])).with_notes(vec!["12 words".into()]);
        let words = Series::unnamed(BLUE, Shape::Circles(3, vec![[0.2, 0.3]]));
        let x = Axis { label: "words".into(), range: 0.0..1.0, scale: Scale::Unnumbered };
        let svg =
            Chart { x, y: Axis::linear("share", 0.0..1.0), series: vec![squares, words], ..Chart::default() }.svg();
        assert_eq!(titles(&svg), ["12 words", "share 0.3"]);
    }

    #[test]
    fn a_long_series_shows_some_of_its_values() {
        let points: Vec<[f64; 2]> = (0..10_000).map(|k| [f64::from(k) * 1e-4, 0.5]).collect();
        let svg = Chart { series: vec![Series::unnamed(BLUE, Shape::Line(points))], ..Chart::default() }.svg();
        assert_eq!(titles(&svg).len(), super::MAX_OF_SERIES);
    }
}
