//! Curves as SVG: the two figures of the paper. A curve alone has no legend.

use plotters::chart::ChartContext;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::{
    Cartesian2d, ChartBuilder, Circle, DashedLineSeries, EmptyElement, IntoDrawingArea, LineSeries, RGBColor,
    Rectangle, SVGBackend, WHITE,
};
use plotters::style::{Color, IntoFont, TextStyle};

const SIZE: (u32, u32) = (820, 420);
const INK: RGBColor = RGBColor(0x33, 0x3d, 0x45);
const GRID: RGBColor = RGBColor(0xe7, 0xeb, 0xee);

/// A chart with two axes of numbers.
type Chart<'a> = ChartContext<'a, SVGBackend<'a>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// A curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Its name.
    pub name: String,
    /// Its colour: red, green, blue.
    pub color: [u8; 3],
    /// Whether it is dashed.
    pub dashed: bool,
    /// Its points.
    pub points: Vec<[f64; 2]>,
    /// A point that is marked by a dot.
    pub dot: Option<[f64; 2]>,
}

/// What a picture of curves shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// What is along x, with its unit.
    pub x: &'static str,
    /// What is along y, with its unit.
    pub y: &'static str,
    /// A place along x that is marked by a vertical line.
    pub mark: Option<f64>,
    /// A shaded band along y, with its name.
    pub band: Option<(&'static str, [f64; 2])>,
    /// The curves.
    pub curves: Vec<Curve>,
}

impl Figure {
    /// The picture.
    pub fn svg(&self) -> String {
        let mut svg = String::new();
        // Drawing into a string does not fail; a plot that cannot be drawn is left empty.
        let _ = self.draw(&mut svg);
        svg.replacen(&format!("<svg width=\"{}\" height=\"{}\"", SIZE.0, SIZE.1), "<svg role=\"img\"", 1)
    }

    /// What the picture spans along x (0) or y (1).
    fn range(&self, k: usize) -> std::ops::Range<f64> {
        let points = self.curves.iter().flat_map(|curve| &curve.points).filter(|p| p.iter().all(|x| x.is_finite()));
        let band = self.band.iter().filter(|_| k == 1).flat_map(|(_, edges)| *edges);
        let all = points.map(|point| point[k]).chain(band);
        let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), at| (l.min(at), h.max(at)));
        let margin = 0.05 * (high - low).max(1e-6);
        low - margin..high + margin
    }

    fn draw(&self, svg: &mut String) -> Result<(), Box<dyn std::error::Error>> {
        let area = SVGBackend::with_string(svg, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let font = || TextStyle::from(("sans-serif", 14).into_font()).color(&INK);
        let mut chart = ChartBuilder::on(&area)
            .margin(10)
            .x_label_area_size(40)
            .y_label_area_size(62)
            .build_cartesian_2d(self.range(0), self.range(1))?;
        // Rounded as a sum that has no -0.
        let label = |at: &f64| format!("{}", (at * 1e6).round() / 1e6 + 0.0);
        chart
            .configure_mesh()
            .label_style(font())
            .x_label_formatter(&label)
            .y_label_formatter(&label)
            .axis_desc_style(font())
            .bold_line_style(GRID)
            .light_line_style(WHITE)
            .x_desc(self.x)
            .y_desc(self.y)
            .draw()?;
        if let Some((name, [low, high])) = self.band {
            let x = self.range(0);
            let band = Rectangle::new([(x.start, low), (x.end, high)], GRID.mix(0.6).filled());
            let swatch = |(x, y)| Rectangle::new([(x, y - 5), (x + 18, y + 5)], GRID.filled());
            chart.draw_series([band])?.label(name).legend(swatch);
        }
        if let Some(at) = self.mark {
            let y = self.range(1);
            chart.draw_series(LineSeries::new([(at, y.start), (at, y.end)], INK.mix(0.4)))?;
        }
        for curve in &self.curves {
            drawn(&mut chart, curve)?;
        }
        if self.curves.len() > 1 {
            chart
                .configure_series_labels()
                .position(plotters::prelude::SeriesLabelPosition::UpperLeft)
                .label_font(font())
                .background_style(WHITE.mix(0.85))
                .border_style(GRID)
                .draw()?;
        }
        area.present()?;
        Ok(())
    }
}

/// One curve with its entry in the legend.
fn drawn<'a>(chart: &mut Chart<'a>, curve: &Curve) -> Result<(), Box<dyn std::error::Error>> {
    let color = RGBColor(curve.color[0], curve.color[1], curve.color[2]);
    let points = curve.points.iter().filter(|p| p.iter().all(|x| x.is_finite())).map(|p| (p[0], p[1]));
    let series = if curve.dashed {
        chart.draw_series(DashedLineSeries::new(points, 7, 5, color.stroke_width(2)))?
    } else {
        chart.draw_series(LineSeries::new(points, color.stroke_width(2)))?
    };
    // A dashed line in the legend is two strokes.
    let (end, again) = if curve.dashed { (7, 11) } else { (18, 18) };
    let bar =
        move |x: i32, y: i32, from: i32, to: i32| Rectangle::new([(x + from, y - 1), (x + to, y + 1)], color.filled());
    series
        .label(curve.name.as_str())
        .legend(move |(x, y)| EmptyElement::at((0, 0)) + bar(x, y, 0, end) + bar(x, y, again, 18));
    if let Some(dot) = curve.dot {
        chart.draw_series([Circle::new((dot[0], dot[1]), 5, color.filled())])?;
    }
    Ok(())
}
