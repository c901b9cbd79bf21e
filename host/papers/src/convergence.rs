//! How methods converge, as SVG: the error over the steps, of one search or of many.

use darm_arm::draw::chart::{Axis, Chart, Series, Shape};
use darm_arm::draw::palette::SERIES;
use darm_arm::draw::{self, Scene};
use darm_core::tree::TreeError;
use darm_robot::ik::configurations::Configurations;
use darm_robot::ik::search::Mark;
use darm_robot::ik::trials::Trials;
use darm_robot::ik::{Method, Residual};
use darm_robot::robot::{Robot, RobotFrame};

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
    pub compared: Option<f64>,
}

/// A line with what belongs to it.
#[derive(Default)]
struct Curve {
    name: String,
    points: Vec<[f64; 2]>,
    /// The band around it: abscissa, lower and upper edge.
    band: Vec<[f64; 3]>,
    /// A level to compare with.
    compared: Option<f64>,
}

/// Error of each method over its steps, √(|Δp|² + ℓ²θ²) in m with ℓ = `length_scale_m`; 0 where the orientation does
/// not count. Of a search with restarts the last start is shown.
pub fn convergence(histories: &[(Method, &[Residual])], length_scale_m: f64) -> String {
    let curve = |(method, history): &(Method, &[Residual])| {
        let errors = history.iter().map(|residual| residual.distance_m(length_scale_m).clamp(MIN_ERROR, MAX_ERROR));
        let points = errors.enumerate().map(|(step, error)| [step as f64, error]).collect();
        Curve { name: method.name().to_owned(), points, ..Curve::default() }
    };
    svg("step", "error, m", &histories.iter().map(curve).collect::<Vec<_>>())
}

/// The mean of the best values of many runs over the iterations, and the band that eight tenths of them lie in; times
/// `factor`, which takes them to the unit of `label`.
pub fn bands(label: &str, factor: f64, all: &[Runs<'_>]) -> String {
    svg("iteration", label, &all.iter().map(|runs| curve(runs, factor)).collect::<Vec<_>>())
}

/// The mean and the band of the best values of some runs, each times `factor`.
fn curve(runs: &Runs<'_>, factor: f64) -> Curve {
    let histories = || runs.trials.runs.iter().map(|run| &run.history);
    let length = histories().map(Vec::len).max().unwrap_or(0);
    let mut curve = Curve { name: runs.name.to_owned(), compared: runs.compared, ..Curve::default() };
    for step in (0..length).step_by((length / POINTS).max(1)) {
        let at = |history: &Vec<Mark>| history.get(step).or(history.last()).map(|mark| mark.value);
        let mut values: Vec<_> =
            histories().filter_map(at).map(|value| (factor * value).clamp(MIN_ERROR, MAX_ERROR)).collect();
        values.sort_by(f64::total_cmp);
        let share = |tenths: usize| values[tenths * (values.len() - 1) / 10];
        curve.points.push([step as f64, values.iter().sum::<f64>() / values.len() as f64]);
        curve.band.push([step as f64, share(1), share(9)]);
    }
    curve
}

/// All postures that were found in one picture.
///
/// # Errors
///
/// The joints of `robot` make no tree.
pub fn postures(robot: &Robot, tool: &RobotFrame, found: &Configurations) -> Result<String, TreeError> {
    let mut scene = Scene { title: robot.name.clone(), is_planar: true, ..Scene::default() };
    for posture in &found.postures {
        let one = Scene::of_robot(robot, tool, &posture.q)?;
        scene.is_planar &= one.is_planar;
        scene.lines.extend(one.lines);
    }
    Ok(draw::svg(&scene, false))
}

/// Errors over steps from 0 on, one colour for each curve.
fn svg(x: &str, y: &str, curves: &[Curve]) -> String {
    let bands = curves.iter().flat_map(|curve| curve.band.iter().flat_map(|[_, low, high]| [*low, *high]));
    let lines = curves.iter().flat_map(|curve| curve.points.iter().map(|point| point[1]).chain(curve.compared));
    let values: Vec<f64> = bands.chain(lines).collect();
    let low = values.iter().copied().fold(f64::INFINITY, f64::min).max(MIN_ERROR);
    let high = values.into_iter().fold(2.0 * low, f64::max);
    let last = curves.iter().filter_map(|curve| curve.points.last()).map(|point| point[0]).fold(1.0, f64::max);
    let mut series = Vec::new();
    for (curve, color) in curves.iter().zip(SERIES.into_iter().cycle()) {
        series.extend((!curve.band.is_empty()).then(|| Series::unnamed(color, Shape::Band(curve.band.clone()))));
        let level = |level| Series::unnamed(color, Shape::Dashed(vec![[0.0, level], [last, level]]));
        series.extend(curve.compared.map(level));
        series.push(Series::named(&curve.name, color, Shape::Line(curve.points.clone())));
    }
    let (x, y) = (Axis::linear(x, 0.0..last), Axis::logarithmic(y, 0.5 * low..2.0 * high));
    Chart { x, y, series, ..Chart::default() }.svg()
}
