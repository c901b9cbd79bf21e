//! The training as SVG: Figures 4 and 5 of the paper.

use plotters::prelude::{
    ChartBuilder, Circle, IntoDrawingArea, LineSeries, RGBColor, SVGBackend, SeriesLabelPosition, WHITE,
};
use plotters::style::{Color, IntoFont, TextStyle};

use super::train::{Chosen, PAPER_LAMBDAS, PAPER_SUCCESS};

const SIZE: (u32, u32) = (760, 420);
const INK: RGBColor = RGBColor(0x33, 0x3d, 0x45);
const GRID: RGBColor = RGBColor(0xe7, 0xeb, 0xee);
const COLORS: [RGBColor; 2] = [RGBColor(0x1f, 0x6f, 0x8b), RGBColor(0xd1, 0x5b, 0x2c)];

/// A line with a name, and points that the paper tells.
struct Curve {
    name: &'static str,
    line: Vec<(f64, f64)>,
    paper: Vec<(f64, f64)>,
}

/// Fig. 4: success over λ on all constraints, and on those that the first λ of the sequence leaves; circles: the
/// paper's maxima.
pub fn selection(lambdas: &[f64], sequence: &[Chosen]) -> String {
    let names = ["all constraints, first λ", "those left, second λ"];
    let curves: Vec<_> = (sequence.iter().zip(names).enumerate())
        .map(|(k, (chosen, name))| Curve {
            name,
            line: lambdas.iter().copied().zip(chosen.rates.iter().copied()).collect(),
            paper: vec![(PAPER_LAMBDAS[k], PAPER_SUCCESS[k])],
        })
        .collect();
    svg(&curves, 0.0..1.0, "λ", "solved, %")
}

/// Fig. 5: what share of all constraints the first k values of the sequence solve; circles: what the paper's text tells.
pub fn accumulation(sequence: &[Chosen]) -> String {
    let line = sequence.iter().enumerate().map(|(k, chosen)| ((k + 1) as f64, chosen.accumulated)).collect();
    let [first, second] = PAPER_SUCCESS;
    let paper = vec![(1.0, first), (2.0, first + (100.0 - first) * second / 100.0)];
    svg(
        &[Curve { name: "solved by the first k values of λ", line, paper }],
        1.0..sequence.len().max(2) as f64,
        "k",
        "solved, %",
    )
}

fn svg(curves: &[Curve], range: std::ops::Range<f64>, x: &str, y: &str) -> String {
    let mut svg = String::new();
    // Drawing into a string does not fail; a plot that cannot be drawn is left empty.
    let _ = draw(&mut svg, curves, range, x, y);
    svg
}

fn draw(
    svg: &mut String,
    curves: &[Curve],
    range: std::ops::Range<f64>,
    x: &str,
    y: &str,
) -> Result<(), Box<dyn std::error::Error>> {
    let area = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let font = || TextStyle::from(("sans-serif", 14).into_font()).color(&INK);
    let mut chart = ChartBuilder::on(&area)
        .margin(12)
        .x_label_area_size(40)
        .y_label_area_size(56)
        .build_cartesian_2d(range, 0.0..100.0)?;
    chart
        .configure_mesh()
        .label_style(font())
        .axis_desc_style(font())
        .bold_line_style(GRID)
        .light_line_style(WHITE)
        .x_desc(x)
        .y_desc(y)
        .x_labels(11)
        .y_label_formatter(&|y| format!("{y:.0}"))
        .x_label_formatter(&|x| if x.fract() == 0.0 { format!("{x:.0}") } else { format!("{x:.1}") })
        .draw()?;
    for (curve, color) in curves.iter().zip(COLORS) {
        chart
            .draw_series(LineSeries::new(curve.line.iter().copied(), color.stroke_width(2)))?
            .label(curve.name)
            .legend(move |(x, y)| plotters::prelude::Rectangle::new([(x, y - 2), (x + 18, y + 2)], color.filled()));
        chart.draw_series(curve.paper.iter().map(|point| Circle::new(*point, 6, color.stroke_width(2))))?;
    }
    chart
        .draw_series(std::iter::empty::<Circle<(f64, f64), i32>>())?
        .label("the paper")
        .legend(|(x, y)| Circle::new((x + 9, y), 5, INK.stroke_width(2)));
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerRight)
        .label_font(font())
        .background_style(WHITE)
        .border_style(GRID)
        .draw()?;
    area.present()?;
    Ok(())
}
