//! How methods converge, as SVG: the error over the steps, of one search or of many.

use darm_core::tree::TreeError;
use plotters::prelude::{
    ChartBuilder, DashedLineSeries, IntoDrawingArea, IntoLogRange, LineSeries, Polygon, RGBColor, Rectangle,
    SVGBackend, SeriesLabelPosition, WHITE,
};
use plotters::style::{Color, IntoFont, TextStyle};

use darm_arm::draw::{self, Scene};
use darm_robot::ik::configurations::Configurations;
use darm_robot::ik::trials::Trials;
use darm_robot::ik::{Method, Residual};
use darm_robot::robot::{Robot, RobotFrame};

const SIZE: (u32, u32) = (760, 420);
const INK: RGBColor = RGBColor(0x33, 0x3d, 0x45);
const GRID: RGBColor = RGBColor(0xe7, 0xeb, 0xee);
const COLORS: [RGBColor; 6] = [
    RGBColor(0xd1, 0x5b, 0x2c),
    RGBColor(0x1f, 0x6f, 0x8b),
    RGBColor(0x2e, 0x8b, 0x57),
    RGBColor(0x8e, 0x44, 0xad),
    RGBColor(0x7a, 0x86, 0x8f),
    RGBColor(0xb8, 0x86, 0x0b),
];

/// Below this an error is rounding.
const MIN_ERROR: f64 = 1e-13;
const MAX_ERROR: f64 = 1e6;
/// Most points of a curve: no paper shows more.
const POINTS: usize = 250;

/// Many runs of one search in a plot.
#[derive(Clone, Copy, Debug)]
pub struct Runs<'a> {
    /// What the search is called.
    pub name: &'a str,
    /// The runs.
    pub trials: &'a Trials,
    /// A value to compare with, drawn as a dashed line.
    pub beside: Option<f64>,
}

/// A line with what belongs to it.
#[derive(Default)]
struct Curve {
    name: String,
    points: Vec<(f64, f64)>,
    /// Where it begins and ends at each abscissa: (x, low, high).
    band: Vec<(f64, f64, f64)>,
    beside: Option<f64>,
}

/// Error of each method over its steps, √(|Δp|² + ℓ²θ²) in m with ℓ = `length_scale_m`; 0 where the orientation does
/// not count. Of a search with restarts the last start is shown.
pub fn convergence(histories: &[(Method, &[Residual])], length_scale_m: f64) -> String {
    let curve = |(method, history): &(Method, &[Residual])| {
        let errors = history.iter().map(|residual| residual.distance_m(length_scale_m).clamp(MIN_ERROR, MAX_ERROR));
        let points = errors.enumerate().map(|(step, error)| (step as f64, error)).collect();
        Curve { name: method.name().to_owned(), points, ..Curve::default() }
    };
    svg("step", "error, m", &histories.iter().map(curve).collect::<Vec<_>>())
}

/// The mean of the best values of many runs over the iterations, and the band that eight tenths of them lie in; times
/// `factor`, which takes them to the unit of `label`.
pub fn bands(label: &str, factor: f64, all: &[Runs<'_>]) -> String {
    let curve = |runs: &Runs<'_>| {
        let histories = || runs.trials.runs.iter().map(|run| &run.history);
        let length = histories().map(Vec::len).max().unwrap_or(0);
        let mut curve = Curve { name: runs.name.to_owned(), beside: runs.beside, ..Curve::default() };
        for step in (0..length).step_by((length / POINTS).max(1)) {
            let at = |history: &Vec<darm_robot::ik::search::Mark>| {
                history.get(step).or(history.last()).map(|mark| mark.value)
            };
            let mut values: Vec<_> =
                histories().filter_map(at).map(|value| (factor * value).clamp(MIN_ERROR, MAX_ERROR)).collect();
            values.sort_by(f64::total_cmp);
            let share = |tenths: usize| values[tenths * (values.len() - 1) / 10];
            curve.points.push((step as f64, values.iter().sum::<f64>() / values.len() as f64));
            curve.band.push((step as f64, share(1), share(9)));
        }
        curve
    };
    svg("iteration", label, &all.iter().map(curve).collect::<Vec<_>>())
}

/// All postures that were found in one picture.
pub fn postures(robot: &Robot, tool: &RobotFrame, found: &Configurations) -> Result<String, TreeError> {
    let mut scene = Scene { title: robot.name.clone(), is_planar: true, ..Scene::default() };
    for posture in &found.postures {
        let one = Scene::of_robot(robot, tool, &posture.q)?;
        scene.is_planar &= one.is_planar;
        scene.lines.extend(one.lines);
    }
    Ok(draw::svg(&scene, false))
}

fn svg(x: &str, y: &str, curves: &[Curve]) -> String {
    let mut svg = String::new();
    // Drawing into a string does not fail; a plot that cannot be drawn is left empty.
    let _ = plot(&mut svg, x, y, curves);
    svg
}

fn plot(svg: &mut String, x: &str, y: &str, curves: &[Curve]) -> Result<(), Box<dyn std::error::Error>> {
    let bands = || curves.iter().flat_map(|curve| curve.band.iter().flat_map(|(_, low, high)| [*low, *high]));
    let lines = || curves.iter().flat_map(|curve| curve.points.iter().map(|point| point.1).chain(curve.beside));
    let low = lines().chain(bands()).fold(f64::INFINITY, f64::min).max(MIN_ERROR);
    let high = lines().chain(bands()).fold(2.0 * low, f64::max);
    let last = curves.iter().filter_map(|curve| curve.points.last()).map(|point| point.0).fold(1.0, f64::max);
    let area = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let font = || TextStyle::from(("sans-serif", 14).into_font()).color(&INK);
    let mut chart = ChartBuilder::on(&area)
        .margin(10)
        .margin_right(26)
        .x_label_area_size(40)
        .y_label_area_size(66)
        .build_cartesian_2d(0.0..last, (0.5 * low..2.0 * high).log_scale())?;
    chart
        .configure_mesh()
        .label_style(font())
        .axis_desc_style(font())
        .bold_line_style(GRID)
        .light_line_style(WHITE)
        .x_desc(x)
        .y_desc(y)
        .y_label_formatter(&|y| format!("{y:.0e}"))
        .x_label_formatter(&|x| format!("{x:.0}"))
        .draw()?;
    for (curve, color) in curves.iter().zip(COLORS.iter().cycle()) {
        if !curve.band.is_empty() {
            let there = curve.band.iter().map(|(x, low, _)| (*x, *low));
            let back = curve.band.iter().rev().map(|(x, _, high)| (*x, *high));
            chart.draw_series([Polygon::new(there.chain(back).collect::<Vec<_>>(), color.mix(0.15).filled())])?;
        }
        if let Some(level) = curve.beside {
            let ends = [(0.0, level), (last, level)];
            chart.draw_series(DashedLineSeries::new(ends, 6, 5, color.stroke_width(1)))?;
        }
        chart
            .draw_series(LineSeries::new(curve.points.iter().copied(), color.stroke_width(2)))?
            .label(&curve.name)
            .legend(move |(x, y)| Rectangle::new([(x, y - 2), (x + 18, y + 2)], color.filled()));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .label_font(font())
        .background_style(WHITE)
        .border_style(GRID)
        .draw()?;
    area.present()?;
    Ok(())
}
