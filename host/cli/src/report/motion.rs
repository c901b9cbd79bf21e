//! The report of a mapped motion: centre of mass and of pressure along time, and the centre of mass in the sagittal plane.

use anyhow::Result;
use darm_core::real::Vec3;
use maud::{Markup, PreEscaped, html};

use super::skeleton::skeleton;
use darm_papers::motion::execution::Executed;
use darm_papers::motion::mapping::Mapped;
use darm_papers::motion::person::{Person, com};
use darm_papers::motion::plot::{Curve, Figure};
use darm_robot::robot::Robot;

const PERSON: [u8; 3] = [0x2a, 0x7f, 0x4f];
const PLANNED: [u8; 3] = [0x1f, 0x6f, 0x8b];
const EXECUTED: [u8; 3] = [0xb2, 0x3a, 0x2e];

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
pub fn along_time(report: &MotionReport<'_>) -> Result<Figure> {
    let mapped = report.mapped;
    let over = |x: &dyn Fn(usize) -> f64| -> Vec<[f64; 2]> {
        mapped.time_s.iter().enumerate().map(|(k, time)| [*time, x(k)]).collect()
    };
    let curve = |name: &str, color, dashed, points| Curve { name: name.into(), color, dashed, points, dot: None };
    let mut curves = vec![
        curve("person, scaled", PERSON, true, over(&|k| mapped.person[k].x)),
        curve("planned", PLANNED, false, over(&|k| mapped.com[k].x)),
        curve("planned, zero-moment point", PLANNED, true, over(&|k| mapped.balance.zmp_m[k][0])),
    ];
    if let Some(executed) = report.executed {
        let own = com(report.robot, &executed.postures, &mapped.time_s[..executed.postures.len()])?;
        let x = |k: usize| own.get(k).map_or(f64::NAN, |com| com.x);
        let cop = |k: usize| executed.cop.get(k).map_or(f64::NAN, |cop| cop[0]);
        curves.push(curve("executed, centre of mass", EXECUTED, false, over(&x)));
        curves.push(curve("executed, centre of pressure of the feet", EXECUTED, true, over(&cop)));
    }
    let mark = mapped.time_s.get(mapped.lift_off).copied();
    let along = || mapped.sole.iter().map(|corner| corner[0]);
    let band = Some(("the soles", [along().fold(f64::INFINITY, f64::min), along().fold(f64::NEG_INFINITY, f64::max)]));
    Ok(Figure { x: "time, s", y: "forward, m", mark, band, curves })
}

/// Force on the chair over time, of an executed motion.
pub fn chair_along_time(report: &MotionReport<'_>) -> Option<Figure> {
    let (mapped, executed) = (report.mapped, report.executed?);
    let points = mapped.time_s.iter().zip(&executed.chair_n).map(|(time, force)| [*time, *force]).collect();
    let curve = Curve { name: "on the chair".into(), color: EXECUTED, dashed: false, points, dot: None };
    let mark = mapped.time_s.get(mapped.lift_off).copied();
    Some(Figure { x: "time, s", y: "force, N", mark, band: None, curves: vec![curve] })
}

/// A path of the centre of mass in the sagittal plane, with a dot at lift-off: a curve of the paper's figure 7.
pub fn sagittal(name: &str, color: [u8; 3], com: &[Vec3<f64>], lift_off: usize) -> Curve {
    let at = |com: &Vec3<f64>| [com.x, com.z];
    Curve {
        name: name.into(),
        color,
        dashed: false,
        points: com.iter().map(at).collect(),
        dot: com.get(lift_off).map(at),
    }
}

/// The page.
pub fn motion_page(robot: &str, report: &MotionReport<'_>) -> Result<String> {
    let mapped = report.mapped;
    let plane = Figure {
        x: "forward, m",
        y: "up, m",
        mark: None,
        band: None,
        curves: vec![sagittal("planned centre of mass", PLANNED, &mapped.com, mapped.lift_off)],
    };
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

/// A page of preformatted text.
pub fn plain_page(title: &str, text: &str) -> String {
    page(title, &html! { section { pre { (text) } } })
}

/// A page with these sections.
pub fn page(title: &str, body: &Markup) -> String {
    let body = html! { header { h1 { (title) } } (body) footer { "darm " (env!("CARGO_PKG_VERSION")) } };
    skeleton(title, &body).into_string()
}
