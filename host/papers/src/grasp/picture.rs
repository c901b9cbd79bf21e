//! The hand before, during and after a search as SVG: three columns, three views each, all expressed in the last palm.

use darm_arm::draw::palette::{BLUE, Color, GREEN, GRID, INK, OCHRE, PALE, PAPER, PURPLE, RED};
use darm_core::real::Vec3;
use darm_core::se::Pose;
use maud::{Markup, PreEscaped, html};

use super::contact::{Configuration, Contacts};
use super::hand::{FINGERS, Hand, JOINTS, THUMB};

/// The colours of the fingers.
const COLORS: [Color; FINGERS] = [BLUE, GREEN, PURPLE, OCHRE];

/// Edge of a view, its margin, and the head above each column, pixels.
const EDGE: f64 = 290.0;
const MARGIN: f64 = 18.0;
const HEAD: f64 = 48.0;
/// Length of the arrow of a contact, m.
const ARROW_M: f64 = 0.03;

/// The style sheet of the picture.
fn style() -> String {
    format!(
        "text{{font:12px sans-serif;fill:{INK};paint-order:stroke;stroke:{PAPER};stroke-width:3px}}\
.view{{fill:none;stroke:{GRID}}}.shape{{stroke-linecap:round;stroke-opacity:.82}}.edge{{stroke:{PAPER};stroke-linecap:round}}\
.contact{{stroke:{RED};stroke-width:2.5}}.point{{fill:{RED}}}"
    )
}

/// A view's name and the directions of the palm that point right and up on the paper.
type View = (&'static str, Vec3<f64>, Vec3<f64>);

/// A capsule as a stroke on the paper.
struct Stroke {
    ends: [Vec3<f64>; 2],
    radius_m: f64,
    color: Color,
}

/// Before, during and after, with a caption each; the contacts are arrows to the point that is touched.
pub fn svg(hand: &Hand, stages: &[(String, Configuration)], contacts: &Contacts) -> String {
    let views: [View; 3] = [
        ("front: y, z", Vec3::y(), Vec3::z()),
        ("side: x, z", Vec3::x(), Vec3::z()),
        ("top: y, −x", Vec3::y(), -Vec3::x()),
    ];
    let palm = stages.last().map_or(Pose::identity(), |(_, configuration)| configuration.pose_world_palm);
    let strokes: Vec<_> = stages.iter().map(|(_, configuration)| strokes(hand, &palm, configuration)).collect();
    let arrows: Vec<_> = contacts.iter().map(|contact| contact.seen_from(&palm)).collect();
    let arrows: Vec<_> =
        arrows.iter().map(|contact| [contact.point - contact.direction * ARROW_M, contact.point]).collect();
    let (low, high) = bounds(strokes.iter().flatten(), &arrows);
    let scale = (EDGE - 2.0 * MARGIN) / (high - low).amax().max(1e-3);
    let middle = (low + high) * 0.5;
    let (width, height) = (EDGE * stages.len() as f64, HEAD + 3.0 * EDGE);
    let column = |index: usize, strokes: &[Stroke]| {
        html! {
            @for (row, view) in views.iter().enumerate() {
                @let corner = [EDGE * index as f64, HEAD + EDGE * row as f64];
                (draw(&Projection { view, corner, middle, scale }, strokes, &arrows))
            }
        }
    };
    let picture = html! {
        svg xmlns="http://www.w3.org/2000/svg" viewBox={ "0 0 " (width) " " (height) } width=(width) height=(height) role="img" aria-label=(hand.name) {
            style { (PreEscaped(style())) }
            rect width="100%" height="100%" fill=(PAPER) {}
            @for (index, ((caption, _), strokes)) in stages.iter().zip(&strokes).enumerate() {
                text x=(EDGE * index as f64 + 12.0) y="20" style="font-weight:bold;font-size:14px" { (caption) }
                (column(index, strokes))
            }
            (names(hand))
        }
    };
    picture.into_string()
}

/// The names of the fingers in their colours.
fn names(hand: &Hand) -> Markup {
    html! {
        @for (i, finger) in hand.fingers.iter().enumerate() {
            text x=(12.0 + 90.0 * i as f64) y="40" style={ "fill:" (COLORS[i]) } { (finger.name) }
        }
        text x=(12.0 + 90.0 * FINGERS as f64) y="40" style={ "fill:" (RED) } { "contacts" }
    }
}

fn strokes(hand: &Hand, palm: &Pose<f64>, configuration: &Configuration) -> Vec<Stroke> {
    let (placed, pose) = (hand.place(&configuration.angles), palm.to(&configuration.pose_world_palm));
    let of_capsule = |capsule: &super::hand::Capsule| Stroke {
        ends: capsule.ends(&placed.links).map(|end| pose * end),
        radius_m: capsule.radius_m,
        color: capsule.link.map_or(PALE, |link| COLORS[(link / JOINTS).min(THUMB)]),
    };
    let tips = (0..FINGERS).map(|i| {
        let end = pose * placed.tips[i].position;
        Stroke { ends: [end, end], radius_m: hand.fingers[i].tip_radius_m, color: COLORS[i] }
    });
    hand.capsules.iter().map(of_capsule).chain(tips).collect()
}

fn bounds<'a>(strokes: impl Iterator<Item = &'a Stroke>, arrows: &[[Vec3<f64>; 2]]) -> (Vec3<f64>, Vec3<f64>) {
    let around = |end: Vec3<f64>, radius: f64| [end.add_scalar(-radius), end.add_scalar(radius)];
    let points = strokes.flat_map(|stroke| stroke.ends.map(|end| around(end, stroke.radius_m))).flatten();
    let infinite = Vec3::repeat(f64::INFINITY);
    let points = points.chain(arrows.iter().flatten().copied());
    points.fold((infinite, -infinite), |(low, high), point| (low.inf(&point), high.sup(&point)))
}

/// How a view puts points of the palm on the paper.
struct Projection<'a> {
    view: &'a View,
    /// Left and top of the view, pixels.
    corner: [f64; 2],
    /// The point in its middle.
    middle: Vec3<f64>,
    /// Pixels per metre.
    scale: f64,
}

impl Projection<'_> {
    fn at(&self, point: &Vec3<f64>) -> [f64; 2] {
        let (_, right, up) = self.view;
        let from_middle = point - self.middle;
        let [left, top] = self.corner;
        [left + 0.5 * EDGE + self.scale * right.dot(&from_middle), top + 0.5 * EDGE - self.scale * up.dot(&from_middle)]
    }
}

fn draw(on: &Projection<'_>, strokes: &[Stroke], arrows: &[[Vec3<f64>; 2]]) -> Markup {
    let ((name, right, up), [left, top]) = (on.view, on.corner);
    let towards = right.cross(up);
    let mut sorted: Vec<_> = strokes.iter().collect();
    let depth = |stroke: &Stroke| towards.dot(&(stroke.ends[0] + stroke.ends[1]));
    sorted.sort_by(|a, b| depth(a).total_cmp(&depth(b)));
    html! {
        rect.view x=(left + 4.0) y=(top + 4.0) width=(EDGE - 8.0) height=(EDGE - 8.0) {}
        @for stroke in sorted {
            @let width = 2.0 * on.scale * stroke.radius_m;
            (line("edge", stroke.ends.map(|end| on.at(&end)), &format!("stroke-width:{:.1}", width + 1.5)))
            (line("shape", stroke.ends.map(|end| on.at(&end)), &format!("stroke:{};stroke-width:{width:.1}", stroke.color)))
        }
        @for arrow in arrows {
            @let [_, [x, y]] = arrow.map(|end| on.at(&end));
            (line("contact", arrow.map(|end| on.at(&end)), ""))
            circle.point cx=(n(x)) cy=(n(y)) r="4" {}
        }
        text x=(left + 12.0) y=(top + 22.0) { (name) }
    }
}

/// A line; one of no length is a dot, which a round cap draws only where the ends differ.
fn line(class: &str, [[ax, ay], [bx, by]]: [[f64; 2]; 2], style: &str) -> Markup {
    html! { line class=(class) x1=(n(ax)) y1=(n(ay)) x2=(n(bx + 0.1)) y2=(n(by)) style=(style) {} }
}

/// A coordinate in an SVG.
fn n(value: f64) -> String {
    format!("{value:.1}")
}
