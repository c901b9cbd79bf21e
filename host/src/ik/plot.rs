//! How methods converge, as SVG: the error over the steps.

use plotters::prelude::{ChartBuilder, IntoDrawingArea, IntoLogRange, LineSeries, RGBColor, SVGBackend, WHITE};
use plotters::style::{Color, IntoFont, TextStyle};

use super::{Method, Residual};

const SIZE: (u32, u32) = (760, 420);
const INK: RGBColor = RGBColor(0x33, 0x3d, 0x45);
const GRID: RGBColor = RGBColor(0xe7, 0xeb, 0xee);
const COLORS: [RGBColor; 5] = [
    RGBColor(0xd1, 0x5b, 0x2c),
    RGBColor(0x1f, 0x6f, 0x8b),
    RGBColor(0x2e, 0x8b, 0x57),
    RGBColor(0x8e, 0x44, 0xad),
    RGBColor(0x7a, 0x86, 0x8f),
];

/// Below this an error is rounding, m.
const LEAST_M: f64 = 1e-13;

/// Error of each method over its steps, √(|Δp|² + ℓ²θ²) in m with ℓ = `length_scale_m`; 0 where the orientation does
/// not count. Of a search with restarts the last start is shown.
pub fn convergence(histories: &[(Method, &[Residual])], length_scale_m: f64) -> String {
    let mut svg = String::new();
    // Drawing into a string does not fail; a plot that cannot be drawn is left empty.
    let _ = draw(&mut svg, histories, length_scale_m);
    svg
}

fn draw(
    svg: &mut String,
    histories: &[(Method, &[Residual])],
    length_scale_m: f64,
) -> Result<(), Box<dyn std::error::Error>> {
    let size = |r: &Residual| r.error_m.hypot(length_scale_m * r.error_rad).clamp(LEAST_M, 1e6);
    let all = || histories.iter().flat_map(|(_, history)| history.iter().map(size));
    let (low, high) = (all().fold(1e-6, f64::min), all().fold(1e-6, f64::max));
    let steps = histories.iter().map(|(_, history)| history.len()).max().unwrap_or(1).max(2) - 1;
    let area = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let font = || TextStyle::from(("sans-serif", 14).into_font()).color(&INK);
    let mut chart = ChartBuilder::on(&area)
        .margin(10)
        .x_label_area_size(40)
        .y_label_area_size(66)
        .build_cartesian_2d(0.0..steps as f64, (0.5 * low..2.0 * high).log_scale())?;
    chart
        .configure_mesh()
        .label_style(font())
        .axis_desc_style(font())
        .bold_line_style(GRID)
        .light_line_style(WHITE)
        .x_desc("step")
        .y_desc("error, m")
        .y_label_formatter(&|y| format!("{y:.0e}"))
        .x_label_formatter(&|x| format!("{x:.0}"))
        .draw()?;
    for ((method, history), color) in histories.iter().zip(COLORS.iter().cycle()) {
        let points = history.iter().enumerate().map(|(step, residual)| (step as f64, size(residual)));
        chart
            .draw_series(LineSeries::new(points, color.stroke_width(2)))?
            .label(method.name())
            .legend(move |(x, y)| plotters::prelude::Rectangle::new([(x, y - 2), (x + 18, y + 2)], color.filled()));
    }
    chart
        .configure_series_labels()
        .position(plotters::prelude::SeriesLabelPosition::UpperRight)
        .label_font(font())
        .background_style(WHITE)
        .border_style(GRID)
        .draw()?;
    area.present()?;
    Ok(())
}
