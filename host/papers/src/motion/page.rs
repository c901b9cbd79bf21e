//! The report of a mapped motion: centre of mass and of pressure along time, and the centre of mass in the sagittal plane.

use darm_arm::draw::chart::{Axis, Chart, Corner, Series, Shape};
use darm_arm::draw::page::page;
use darm_arm::draw::palette::{BLUE, Color, GREEN, GRID, INK, PAPER, RED};
use darm_core::real::Vec3;
use maud::{PreEscaped, html};

use darm_robot::robot::Robot;

use super::execution::Executed;
use super::mapping::Mapped;
use super::person::{Person, com};
use super::trajectory::TrajectoryError;

const PERSON: Color = GREEN;
const PLANNED: Color = BLUE;
const EXECUTED: Color = RED;
/// Width and height of a chart, pixels.
const SIZE: (u32, u32) = (820, 420);

/// Contents of a report of a motion.
#[derive(Clone, Copy)]
pub struct MotionReport<'a> {
    /// The person.
    pub person: &'a Person,
    /// The plan.
    pub mapped: &'a Mapped,
    /// Model of the robot, for the centre of mass of the executed motion.
    pub robot: &'a Robot,
    /// The executed motion.
    pub executed: Option<&'a Executed>,
}

/// Centre of mass and centre of pressure over time: figure 6 of the paper.
///
/// # Errors
///
/// The robot of the report makes no tree of joints.
pub fn along_time(report: &MotionReport<'_>) -> Result<Chart, TrajectoryError> {
    let mapped = report.mapped;
    let over = |x: &dyn Fn(usize) -> f64| -> Vec<[f64; 2]> {
        mapped.time_s.iter().enumerate().map(|(k, time)| [*time, x(k)]).collect()
    };
    let mut curves = vec![
        Series::named("person, scaled", PERSON, Shape::Dashed(over(&|k| mapped.person[k].x))),
        Series::named("planned", PLANNED, Shape::Line(over(&|k| mapped.com[k].x))),
        Series::named("planned, zero-moment point", PLANNED, Shape::Dashed(over(&|k| mapped.balance.zmp_m[k][0]))),
    ];
    if let Some(executed) = report.executed {
        let own = com(report.robot, &executed.postures, &mapped.time_s[..executed.postures.len()])?;
        let x = |k: usize| own.get(k).map_or(f64::NAN, |com| com.x);
        let cop = |k: usize| executed.cop.get(k).map_or(f64::NAN, |cop| cop[0]);
        curves.push(Series::named("executed, centre of mass", EXECUTED, Shape::Line(over(&x))));
        curves.push(Series::named("executed, centre of pressure of the feet", EXECUTED, Shape::Dashed(over(&cop))));
    }
    let along = || mapped.sole.iter().map(|corner| corner[0]);
    let soles = [along().fold(f64::INFINITY, f64::min), along().fold(f64::NEG_INFINITY, f64::max)];
    Ok(over_time(mapped, "forward, m", Some(("the soles", soles)), curves))
}

/// Force on the chair over time, of an executed motion.
pub fn chair_along_time(report: &MotionReport<'_>) -> Option<Chart> {
    let (mapped, executed) = (report.mapped, report.executed?);
    let points = mapped.time_s.iter().zip(&executed.chair_n).map(|(time, force)| [*time, *force]).collect();
    Some(over_time(mapped, "force, N", None, vec![Series::unnamed(EXECUTED, Shape::Line(points))]))
}

/// Curves over time, with a vertical line at lift-off, over a named interval of the ordinate.
fn over_time(mapped: &Mapped, label: &str, interval: Option<(&str, [f64; 2])>, curves: Vec<Series>) -> Chart {
    let edges = interval.iter().flat_map(|(_, edges)| *edges);
    let x = Axis::around("time, s", coordinates(&curves, 0));
    let y = Axis::around(label, coordinates(&curves, 1).chain(edges));
    let area = |(name, [low, high]): (&str, [f64; 2])| {
        Series::named(name, GRID, Shape::Box([[x.range.start, low], [x.range.end, high]]))
    };
    let line =
        |at: &f64| Series::unnamed(PAPER.mix(INK, 0.4), Shape::Line(vec![[*at, y.range.start], [*at, y.range.end]]));
    let lift_off = mapped.time_s.get(mapped.lift_off).map(line);
    let series = interval.map(area).into_iter().chain(lift_off).chain(curves).collect();
    Chart { size: SIZE, x, y, series, legend: Corner::UpperLeft, ..Chart::default() }
}

/// The coordinates of lines along one axis: 0 is x, 1 is y.
fn coordinates(curves: &[Series], axis: usize) -> impl Iterator<Item = f64> + '_ {
    let points = curves.iter().flat_map(|curve| match &curve.shape {
        Shape::Line(points) | Shape::Dashed(points) => points.as_slice(),
        _ => &[],
    });
    points.map(move |point| point[axis])
}

/// A path of the centre of mass in the sagittal plane, with a disc at lift-off: a curve of the paper's figure 7.
pub fn sagittal(name: &str, color: Color, com: &[Vec3<f64>], lift_off: usize) -> [Series; 2] {
    let at = |com: &Vec3<f64>| [com.x, com.z];
    let lift_off = com.get(lift_off).map(at).into_iter().collect();
    [
        Series::named(name, color, Shape::Line(com.iter().map(at).collect())),
        Series::unnamed(color, Shape::Discs(5, lift_off)),
    ]
}

/// Paths in the sagittal plane.
pub fn sagittal_plane(series: Vec<Series>) -> Chart {
    let x = Axis::around("forward, m", coordinates(&series, 0));
    let y = Axis::around("up, m", coordinates(&series, 1));
    Chart { size: SIZE, x, y, series, legend: Corner::UpperLeft, ..Chart::default() }
}

/// The page.
///
/// # Errors
///
/// As [`along_time`].
pub fn motion_page(robot: &str, report: &MotionReport<'_>) -> Result<String, TrajectoryError> {
    let mapped = report.mapped;
    let planned = sagittal("planned centre of mass", PLANNED, &mapped.com, mapped.lift_off);
    let plane = sagittal_plane(planned.into());
    let number = |value: f64, digits: usize| format!("{value:.digits$}");
    let rows = [
        ("scale of the person's motion", number(mapped.scale, 3)),
        (
            "largest error of the person's simulated centre of pressure before scaling, mm",
            number(1e3 * report.person.before.worst_m, 1),
        ),
        ("the same after scaling, mm", number(1e3 * report.person.after.worst_m, 1)),
        ("largest error of the centre of mass, m", format!("{:.1e}", mapped.com_error_m)),
        (
            "largest horizontal deviation of the target from the person's, for balance, mm",
            number(1e3 * mapped.moved_m, 1),
        ),
        (
            "largest vertical deviation of the target from the person's, on the chair, mm",
            number(1e3 * mapped.raised_m, 1),
        ),
        ("markers, RMS, mm", number(1e3 * mapped.trajectory.marker_rms_m, 1)),
        ("smallest margin of the zero-moment point, mm", number(1e3 * mapped.balance.zmp_margin_m, 1)),
        ("smallest margin of the centre of mass, mm", number(1e3 * mapped.balance.com_margin_m, 1)),
    ];
    let body = html! {
        section {
            h2 { "Centre of mass over time" }
            p { "The line marks the lift-off from the chair." }
            (PreEscaped(along_time(report)?.svg()))
        }
        @if let Some(chair) = chair_along_time(report) {
            section { h2 { "Force on the chair" } (PreEscaped(chair.svg())) }
        }
        section {
            h2 { "Centre of mass in the sagittal plane" }
            p { "The dot marks the lift-off from the chair." }
            (PreEscaped(plane.svg()))
        }
        section {
            h2 { "Figures" }
            table { tbody { @for (name, value) in &rows { tr { td { (name) } td.num { (value) } } } } }
            h3 { "Scales of the person" }
            table {
                thead { tr { th { "link" } th.num { "length" } th.num { "mass" } } }
                tbody { @for scale in &report.person.scales { tr { td { (scale.link) } td.num { (number(scale.length, 3)) } td.num { (number(scale.mass, 3)) } } } }
            }
        }
    };
    Ok(page(&format!("A person's motion on {robot}"), &body))
}
