//! Charts as SVG: lines, markers, bands and boxes over two axes, with a legend and with the values of points under the pointer.
//!
//! ```
//! use darm_arm::draw::chart::{Axis, Chart, Series, Shape};
//! use darm_arm::draw::palette::BLUE;
//!
//! let points: Vec<[f64; 2]> = (0..9).map(|k| [f64::from(k), 0.5_f64.powi(k)]).collect();
//! let svg = Chart {
//!     title: "Error of each step".into(),
//!     x: Axis::linear("step", 0.0..8.0),
//!     y: Axis::logarithmic("error, m", 1e-3..1.0),
//!     series: vec![Series::named("dls", BLUE, Shape::Line(points))],
//!     ..Chart::default()
//! }
//! .svg();
//! assert!(svg.starts_with("<svg role=\"img\""));
//! ```

mod rounded;
mod values;

use std::ops::Range;

use plotters::chart::ChartContext;
use plotters::coord::combinators::LogCoord;
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::{
    Cartesian2d, ChartBuilder, Circle, DashedLineSeries, EmptyElement, IntoDrawingArea, IntoLogRange, LineSeries,
    Polygon, Rectangle, SVGBackend, SeriesLabelPosition,
};
use plotters::style::{Color as _, FontStyle, IntoFont, RGBColor, ShapeStyle, TextStyle};

use super::palette::{Color, GRID, INK, MUTED, PAPER};
use rounded::rounded;

/// How values lie along an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Evenly, with numbers.
    Linear,
    /// By their logarithm, with numbers; the range is positive.
    Logarithmic,
    /// Evenly, in an order that has no numbers.
    Unnumbered,
}

/// An axis of a chart.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Its quantity with the unit: `time, s`.
    pub label: String,
    /// What it spans.
    pub range: Range<f64>,
    /// Its scale.
    pub scale: Scale,
}

/// What a series looks like; coordinates are those of the axes.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// Straight lines from point to point.
    Line(Vec<[f64; 2]>),
    /// The same, dashed.
    Dashed(Vec<[f64; 2]>),
    /// Discs of this radius, pixels.
    Discs(u32, Vec<[f64; 2]>),
    /// Circles of this radius, pixels.
    Circles(u32, Vec<[f64; 2]>),
    /// A translucent band: abscissa, lower and upper edge.
    Band(Vec<[f64; 3]>),
    /// A filled box between two corners.
    Box([[f64; 2]; 2]),
}

/// What is drawn in one colour.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Its name in the legend; a series without a name has no entry.
    pub name: Option<String>,
    /// Its colour.
    pub color: Color,
    /// Its shape.
    pub shape: Shape,
    /// What is said of each point before its values, and of a box; the name of the series where there is none.
    pub notes: Vec<String>,
}

/// The corner of the legend.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Corner {
    /// Above, at the left.
    UpperLeft,
    /// Above, at the right.
    UpperRight,
    /// Below, at the left.
    LowerLeft,
    /// Below, at the right.
    LowerRight,
}

/// A chart. Series that come later lie on top of earlier ones.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// Width and height, pixels.
    pub size: (u32, u32),
    /// Its title; empty where a page has a heading for it.
    pub title: String,
    /// The axis to the right.
    pub x: Axis,
    /// The axis upward.
    pub y: Axis,
    /// What is drawn.
    pub series: Vec<Series>,
    /// Where the legend is.
    pub legend: Corner,
}

impl Axis {
    /// An axis with even steps.
    pub fn linear(label: &str, range: Range<f64>) -> Self {
        Self { label: label.into(), range, scale: Scale::Linear }
    }

    /// An axis with even ratios.
    pub fn logarithmic(label: &str, range: Range<f64>) -> Self {
        Self { label: label.into(), range, scale: Scale::Logarithmic }
    }

    /// A linear axis over all finite values, with a margin of a twentieth.
    pub fn around(label: &str, values: impl IntoIterator<Item = f64>) -> Self {
        let finite = values.into_iter().filter(|value| value.is_finite());
        let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), at| (l.min(at), h.max(at)));
        let (low, high) = if low <= high { (low, high) } else { (0.0, 1.0) };
        let margin = if high > low { 0.05 * (high - low) } else { 0.05 * low.abs().max(1e-6) };
        Self::linear(label, low - margin..high + margin)
    }

    /// The number at a tick.
    fn number(&self, value: f64) -> String {
        match self.scale {
            Scale::Linear => rounded(value, self.range.end - self.range.start),
            Scale::Logarithmic if self.range.start >= 1e-3 && self.range.end <= 1e5 => rounded(value, value),
            Scale::Logarithmic => format!("{value:.0e}"),
            Scale::Unnumbered => String::new(),
        }
    }

    fn coordinate(&self) -> Coordinate {
        match self.scale {
            Scale::Logarithmic => Coordinate::Logarithmic(self.range.clone().log_scale().into()),
            Scale::Linear | Scale::Unnumbered => Coordinate::Linear(self.range.clone().into()),
        }
    }
}

impl Series {
    /// A series with an entry in the legend.
    pub fn named(name: &str, color: Color, shape: Shape) -> Self {
        Self { name: Some(name.into()), ..Self::unnamed(color, shape) }
    }

    /// The series with a note of each point.
    #[must_use]
    pub fn with_notes(self, notes: Vec<String>) -> Self {
        Self { notes, ..self }
    }

    /// A series without one.
    pub fn unnamed(color: Color, shape: Shape) -> Self {
        Self { name: None, color, shape, notes: Vec::new() }
    }
}

impl Default for Chart {
    /// No series over axes from 0 to 1, 760 by 420 pixels.
    fn default() -> Self {
        let axis = || Axis::linear("", 0.0..1.0);
        let (size, title) = ((760, 420), String::new());
        Self { size, title, x: axis(), y: axis(), series: Vec::new(), legend: Corner::UpperRight }
    }
}

impl Chart {
    /// The picture; a page may scale it to the width that it has.
    pub fn svg(&self) -> String {
        let mut svg = String::new();
        // Drawing into a string does not fail; a chart that cannot be drawn is left empty.
        let values = self.draw(&mut svg).unwrap_or_default();
        svg.replacen("<svg ", "<svg role=\"img\" ", 1).replacen("</svg>", &format!("{values}</svg>"), 1)
    }

    /// Draws the picture; the marks of its values.
    fn draw(&self, svg: &mut String) -> Drawn<String> {
        let area = SVGBackend::with_string(svg, self.size).into_drawing_area();
        area.fill(&rgb(PAPER))?;
        let mut builder = ChartBuilder::on(&area);
        builder.margin(10).margin_right(24).x_label_area_size(40).y_label_area_size(64);
        if !self.title.is_empty() {
            builder.caption(&self.title, font().into_font().style(FontStyle::Bold).color(&const { rgb(INK) }));
        }
        let mut plane = builder.build_cartesian_2d(self.x.coordinate(), self.y.coordinate())?;
        self.mesh(&mut plane)?;
        for series in &self.series {
            series.draw(&mut plane)?;
        }
        if self.series.iter().any(|series| series.name.is_some()) {
            let corner = match self.legend {
                Corner::UpperLeft => SeriesLabelPosition::UpperLeft,
                Corner::UpperRight => SeriesLabelPosition::UpperRight,
                Corner::LowerLeft => SeriesLabelPosition::LowerLeft,
                Corner::LowerRight => SeriesLabelPosition::LowerRight,
            };
            let mut legend = plane.configure_series_labels();
            legend.position(corner).label_font(text()).background_style(rgb(PAPER).mix(0.85)).border_style(rgb(GRID));
            legend.draw()?;
        }
        area.present()?;
        Ok(values::marks(self, &plane))
    }

    /// Axes with their numbers and the grid.
    fn mesh(&self, plane: &mut Plane<'_>) -> Drawn<()> {
        let [x, y] = [&self.x, &self.y].map(|axis| move |value: &f64| axis.number(*value));
        let mut mesh = plane.configure_mesh();
        mesh.label_style(text()).axis_desc_style(text()).axis_style(rgb(MUTED));
        mesh.bold_line_style(rgb(GRID)).light_line_style(rgb(PAPER)).x_desc(&self.x.label).y_desc(&self.y.label);
        if self.x.scale == Scale::Unnumbered {
            mesh.disable_x_mesh().x_labels(0);
        }
        mesh.x_label_formatter(&x).y_label_formatter(&y).draw()?;
        Ok(())
    }
}

type Drawn<T> = Result<T, Box<dyn std::error::Error>>;
type Plane<'a> = ChartContext<'a, SVGBackend<'a>, Cartesian2d<Coordinate, Coordinate>>;

impl Series {
    fn draw<'a>(&self, plane: &mut Plane<'a>) -> Drawn<()> {
        let color = rgb(self.color);
        let (filled, thin, thick): (ShapeStyle, ShapeStyle, ShapeStyle) =
            (color.filled(), color.stroke_width(1), color.stroke_width(2));
        let entry = match &self.shape {
            Shape::Line(points) => plane.draw_series(LineSeries::new(finite(points), thick))?,
            Shape::Dashed(points) => plane.draw_series(DashedLineSeries::new(finite(points), 7, 5, thick))?,
            Shape::Discs(radius, points) => {
                plane.draw_series(finite(points).map(|at| Circle::new(at, *radius, filled)))?
            }
            Shape::Circles(radius, points) => {
                let outline = if *radius > 3 { thick } else { thin };
                plane.draw_series(finite(points).map(|at| Circle::new(at, *radius, outline)))?
            }
            Shape::Band(edges) => {
                let lower = edges.iter().map(|[x, low, _]| (*x, *low));
                let upper = edges.iter().rev().map(|[x, _, high]| (*x, *high));
                plane.draw_series([Polygon::new(lower.chain(upper).collect::<Vec<_>>(), color.mix(0.15).filled())])?
            }
            Shape::Box(corners) => plane.draw_series([Rectangle::new(corners.map(|[x, y]| (x, y)), filled)])?,
        };
        let Some(name) = &self.name else { return Ok(()) };
        entry.label(name);
        // What the legend shows: strokes from and to these abscissas, or a circle.
        let strokes = |half: i32, spans: [(i32, i32); 2]| {
            move |(x, y): (i32, i32)| {
                let stroke = |(from, to)| Rectangle::new([(x + from, y - half), (x + to, y + half)], color.filled());
                EmptyElement::at((0, 0)) + stroke(spans[0]) + stroke(spans[1])
            }
        };
        match &self.shape {
            Shape::Line(_) => entry.legend(strokes(1, [(0, 18), (0, 18)])),
            Shape::Dashed(_) => entry.legend(strokes(1, [(0, 7), (11, 18)])),
            Shape::Band(_) | Shape::Box(_) => entry.legend(strokes(5, [(0, 18), (0, 18)])),
            Shape::Discs(..) => entry.legend(move |(x, y)| Circle::new((x + 9, y), 5, filled)),
            Shape::Circles(..) => entry.legend(move |(x, y)| Circle::new((x + 9, y), 5, thick)),
        };
        Ok(())
    }
}

fn finite(points: &[[f64; 2]]) -> impl Iterator<Item = (f64, f64)> + Clone + '_ {
    points.iter().filter(|point| point.iter().all(|at| at.is_finite())).map(|[x, y]| (*x, *y))
}

const fn rgb(color: Color) -> RGBColor {
    RGBColor(color.0, color.1, color.2)
}

fn font() -> (&'static str, i32) {
    ("sans-serif", 14)
}

fn text() -> TextStyle<'static> {
    TextStyle::from(font().into_font()).color(&const { rgb(INK) })
}

/// The scale of an axis for `plotters`, whose type differs for linear and logarithmic ones.
enum Coordinate {
    Linear(RangedCoordf64),
    Logarithmic(LogCoord<f64>),
}

impl Ranged for Coordinate {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        match self {
            Self::Linear(coordinate) => coordinate.map(value, limit),
            Self::Logarithmic(coordinate) => coordinate.map(value, limit),
        }
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        match self {
            Self::Linear(coordinate) => coordinate.key_points(hint),
            Self::Logarithmic(coordinate) => coordinate.key_points(hint),
        }
    }

    fn range(&self) -> Range<f64> {
        match self {
            Self::Linear(coordinate) => coordinate.range(),
            Self::Logarithmic(coordinate) => coordinate.range(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_digits_of_their_axis() {
        let linear = Axis::linear("", 0.0..0.5);
        assert_eq!([0.05, 0.1, -1e-9, 0.25].map(|at| linear.number(at)), ["0.05", "0.1", "0", "0.25"]);
        assert_eq!([0.0, 50.0, 100.0].map(|at| Axis::linear("", 0.0..100.0).number(at)), ["0", "50", "100"]);
        let logarithmic = Axis::logarithmic("", 1e-9..1e6);
        assert_eq!([1e-6, 0.02, 1.0, 1e6].map(|at| logarithmic.number(at)), ["1e-6", "2e-2", "1e0", "1e6"]);
        assert_eq!([0.02, 1.0, 50.0].map(|at| Axis::logarithmic("", 0.01..100.0).number(at)), ["0.02", "1", "50"]);
        assert_eq!(Axis::around("", [f64::NAN, 1.0, 3.0]).range, 0.9..3.1);
        assert!(Axis::around("", []).range.end > 0.0);
    }

    #[test]
    fn every_shape_is_drawn_with_its_entry_in_the_legend() {
        let points = || vec![[0.2, 0.1], [0.4, f64::NAN], [0.8, 0.9]];
        let shapes = [
            Shape::Line(points()),
            Shape::Dashed(points()),
            Shape::Discs(3, points()),
            Shape::Circles(6, points()),
            Shape::Band(vec![[0.1, 0.2, 0.3], [0.9, 0.3, 0.5]]),
            Shape::Box([[0.0, 0.1], [1.0, 0.2]]),
        ];
        let series = shapes.into_iter().enumerate().map(|(k, shape)| Series::named(&format!("name {k}"), INK, shape));
        let chart = Chart { y: Axis::logarithmic("error, m", 1e-3..1.0), series: series.collect(), ..Chart::default() };
        let svg = chart.svg();
        assert!((0..6).all(|k| svg.contains(&format!("name {k}"))) && svg.contains("error, m"), "{svg}");
        assert!(!svg.contains("NaN"));
    }
}
