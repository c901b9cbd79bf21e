//! Curves as SVG: the two figures of the paper.

use plotters::prelude::{
    ChartBuilder, Circle, DashedLineSeries, IntoDrawingArea, LineSeries, RGBColor, SVGBackend, WHITE,
};
use plotters::style::{Color, IntoFont, TextStyle};

const SIZE: (u32, u32) = (820, 420);
const INK: RGBColor = RGBColor(0x33, 0x3d, 0x45);
const GRID: RGBColor = RGBColor(0xe7, 0xeb, 0xee);

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

    fn draw(&self, svg: &mut String) -> Result<(), Box<dyn std::error::Error>> {
        let all = || self.curves.iter().flat_map(|curve| &curve.points).filter(|p| p.iter().all(|x| x.is_finite()));
        let range = |k: usize| {
            let (low, high) = all().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p[k]), h.max(p[k])));
            let margin = 0.05 * (high - low).max(1e-6);
            low - margin..high + margin
        };
        let area = SVGBackend::with_string(svg, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let font = || TextStyle::from(("sans-serif", 14).into_font()).color(&INK);
        let mut chart = ChartBuilder::on(&area)
            .margin(10)
            .x_label_area_size(40)
            .y_label_area_size(62)
            .build_cartesian_2d(range(0), range(1))?;
        chart
            .configure_mesh()
            .label_style(font())
            .axis_desc_style(font())
            .bold_line_style(GRID)
            .light_line_style(WHITE)
            .x_desc(self.x)
            .y_desc(self.y)
            .draw()?;
        if let Some(at) = self.mark {
            let y = range(1);
            chart.draw_series(LineSeries::new([(at, y.start), (at, y.end)], INK.mix(0.4)))?;
        }
        for curve in &self.curves {
            let color = RGBColor(curve.color[0], curve.color[1], curve.color[2]);
            let points = curve.points.iter().filter(|p| p.iter().all(|x| x.is_finite())).map(|p| (p[0], p[1]));
            let series = if curve.dashed {
                chart.draw_series(DashedLineSeries::new(points, 7, 5, color.stroke_width(2)))?
            } else {
                chart.draw_series(LineSeries::new(points, color.stroke_width(2)))?
            };
            series
                .label(curve.name.as_str())
                .legend(move |(x, y)| plotters::prelude::Rectangle::new([(x, y - 2), (x + 18, y + 2)], color.filled()));
            if let Some(dot) = curve.dot {
                chart.draw_series([Circle::new((dot[0], dot[1]), 5, color.filled())])?;
            }
        }
        chart
            .configure_series_labels()
            .position(plotters::prelude::SeriesLabelPosition::UpperLeft)
            .label_font(font())
            .background_style(WHITE.mix(0.85))
            .border_style(GRID)
            .draw()?;
        area.present()?;
        Ok(())
    }
}
