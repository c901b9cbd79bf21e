//! Pictures of the synthesis paper: its arms, and charts of error and time over the number of steps, as SVG.

use darm_arm::arm::frames::DesiredFrame;
use darm_arm::arm::{Arm, ArmScratch};
use darm_arm::draw::chart::{Axis, Chart, Corner, Series, Shape};
use darm_arm::draw::palette::SERIES;
use darm_arm::draw::{Scene, svg};
use darm_core::chain::ChainError;
use darm_core::units::Word;

use super::Runs;

/// Below this an error is rounding.
const MIN_ERROR: f64 = 1e-16;

/// A file name and its SVG.
pub type Picture = (String, String);

/// Every configuration of a small arm: Figures 1 and 2.
///
/// # Errors
///
/// The arm has no pose for a word.
pub fn configurations(figure: u32, arm: &Arm) -> Result<Vec<Picture>, ChainError> {
    words(arm).into_iter().map(|word| configuration(figure, arm, &word)).collect()
}

/// An arm with one word: Figure 3.
///
/// # Errors
///
/// The arm has no pose for the word.
pub fn configuration(figure: u32, arm: &Arm, word: &Word) -> Result<Picture, ChainError> {
    let mut scratch = ArmScratch::default();
    arm.model.chain.pose_base_tool(word, &[], &mut scratch)?;
    let scene = Scene { title: format!("{}, word {word}", arm.name), ..Scene::of_arm(arm, &scratch, word.iter()) };
    Ok((format!("figure-{figure:02}-{word}.svg"), svg(&scene, true)))
}

/// An arm in each of its desired frames: Figures 5 to 9.
///
/// # Errors
///
/// The arm has no pose for the word of a frame.
pub fn in_frames(figure: u32, arm: &Arm, frames: &[DesiredFrame]) -> Result<Vec<Picture>, ChainError> {
    let picture = |(index, frame): (usize, &DesiredFrame)| {
        let name = format!("figure-{figure:02}-frame-{}-{}.svg", index + 1, frame.word);
        Ok((name, svg(&Scene::of_frame(arm, frame)?, true)))
    };
    frames.iter().enumerate().map(picture).collect()
}

/// Every word of an arm whose actuators have as many states each.
fn words(arm: &Arm) -> Vec<Word> {
    (0..arm.n_actuators()).fold(vec![arm.rest()], |words, actuator| {
        let digits = 0..arm.model.chain.n_states(actuator) as u8;
        words.iter().flat_map(|word| digits.clone().map(|digit| word.with_digit(actuator, digit))).collect()
    })
}

/// Errors of positions and of orientations, and time, over the steps of the paper's scheme.
pub fn charts(all: &[Runs]) -> Vec<Picture> {
    let position = chart(all, "position error, m", |run| Some(run.position_m));
    let orientation = chart(all, "orientation error, deg", |run| run.orientation_rad.map(f64::to_degrees));
    let time = Chart { legend: Corner::LowerRight, ..chart(all, "time, s", |run| Some(run.time_s)) };
    let charts = [("position", position), ("orientation", orientation), ("time", time)];
    charts.map(|(what, chart)| (format!("{what}-over-steps.svg"), chart.svg())).to_vec()
}

/// Error and alteration over the regularisation parameter: the trade-off beside Figure 7.
pub fn trade_off(points: &[[f64; 3]]) -> Picture {
    let series = |name, color, column: usize| {
        Series::named(name, color, Shape::Line(points.iter().map(|point| [point[0], point[column]]).collect()))
    };
    let series =
        vec![series("error of the frames, RSS", SERIES[0], 1), series("alteration of the stops", SERIES[1], 2)];
    let values = || points.iter().flat_map(|point| [point[1], point[2]]);
    let x = Axis::logarithmic("regularisation, share of the Jacobian", spread(points.iter().map(|point| point[0])));
    let y = Axis::logarithmic("m", spread(values()));
    let chart = Chart { x, y, series, legend: Corner::LowerLeft, ..Chart::default() };
    ("figure-07-regularisation.svg".to_owned(), chart.svg())
}

fn chart(all: &[Runs], label: &str, value: impl Fn(&super::Run) -> Option<f64>) -> Chart {
    let mut series = Vec::new();
    let mut drawn = Vec::new();
    for (runs, color) in all.iter().zip(SERIES.into_iter().cycle()) {
        for is_interpolated in [false, true] {
            let own = runs.paper.iter().filter(|run| run.is_interpolated == is_interpolated);
            let points: Vec<[f64; 2]> =
                own.filter_map(|run| Some([f64::from(run.steps), value(run)?.max(MIN_ERROR)])).collect();
            drawn.extend(points.iter().copied());
            series.push(match is_interpolated {
                false if points.is_empty() => continue,
                false => Series::named(runs.example.name, color, Shape::Line(points)),
                true => Series::unnamed(color, Shape::Dashed(points)),
            });
        }
    }
    Chart {
        x: Axis::logarithmic("steps", spread(drawn.iter().map(|point| point[0]))),
        y: Axis::logarithmic(label, spread(drawn.iter().map(|point| point[1]))),
        series,
        legend: Corner::LowerLeft,
        ..Chart::default()
    }
}

/// The range of positive values, with room on both sides.
fn spread(values: impl Iterator<Item = f64>) -> std::ops::Range<f64> {
    let (low, high) =
        values.fold((f64::INFINITY, 0.0), |(low, high): (f64, f64), value| (low.min(value), high.max(value)));
    if low <= high { 0.7 * low..1.5 * high } else { 0.1..1.0 }
}
