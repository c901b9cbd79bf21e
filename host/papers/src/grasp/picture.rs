//! The hand before, during and after a search as SVG: three columns, three views each, all expressed in the last palm.

use darm_arm::draw::palette::{BLUE, Color, GREEN, GRID, INK, OCHRE, PALE, PAPER, PURPLE, RED};
use darm_core::real::Vec3;
use darm_core::se::Pose;
use maud::{Markup, PreEscaped, html};

use super::contact::{Configuration, Contacts};
use super::hand::Hand;
use super::layout::{FINGERS, joints_of};
use crate::convex_hull::convex_hull;
use darm_robot::shape::{Geometry, LinkShape};

/// The colours of the fingers.
const COLORS: [Color; FINGERS] = [BLUE, GREEN, PURPLE, OCHRE];

/// Edge of a view, its margin, and the head above each column, pixels.
const EDGE: f64 = 290.0;
const MARGIN: f64 = 18.0;
const HEAD: f64 = 48.0;
/// Points of a circle.
const ROUND: usize = 16;
/// Length of the arrow of a contact, m.
const ARROW_M: f64 = 0.03;

/// The style sheet of the picture.
fn style() -> String {
    format!(
        "text{{font:12px sans-serif;fill:{INK};paint-order:stroke;stroke:{PAPER};stroke-width:3px}}\
.view{{fill:none;stroke:{GRID}}}.shape{{fill-opacity:.82;stroke:{PAPER}}}\
.contact{{stroke:{RED};stroke-width:2.5}}.point{{fill:{RED}}}"
    )
}

/// A view's name and the directions of the palm that point right and up on the paper.
type View = (&'static str, Vec3<f64>, Vec3<f64>);

/// Points whose hull is a shape.
struct Solid {
    points: Vec<Vec3<f64>>,
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
    let solids: Vec<_> = stages.iter().map(|(_, configuration)| solids(hand, &palm, configuration)).collect();
    let arrows: Vec<_> = contacts.iter().map(|contact| contact.seen_from(&palm)).collect();
    let arrows: Vec<_> =
        arrows.iter().map(|contact| [contact.point - contact.direction * ARROW_M, contact.point]).collect();
    let (low, high) = bounds(solids.iter().flatten(), &arrows);
    let scale = (EDGE - 2.0 * MARGIN) / (high - low).amax().max(1e-3);
    let middle = (low + high) * 0.5;
    let (width, height) = (EDGE * stages.len() as f64, HEAD + 3.0 * EDGE);
    let picture = html! {
        svg xmlns="http://www.w3.org/2000/svg" viewBox={ "0 0 " (width) " " (height) } width=(width) height=(height) role="img" aria-label=(hand.name) {
            style { (PreEscaped(style())) }
            rect width="100%" height="100%" fill=(PAPER) {}
            @for (index, ((caption, _), solids)) in stages.iter().zip(&solids).enumerate() {
                text x=(EDGE * index as f64 + 12.0) y="20" style="font-weight:bold;font-size:14px" { (caption) }
                @for (row, view) in views.iter().enumerate() {
                    @let corner = [EDGE * index as f64, HEAD + EDGE * row as f64];
                    (draw(&Projection { view, corner, middle, scale }, solids, &arrows))
                }
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

fn solids(hand: &Hand, palm: &Pose<f64>, configuration: &Configuration) -> Vec<Solid> {
    let (placed, pose) = (hand.place(&configuration.angles), palm.to(&configuration.pose_world_palm));
    let shapes = hand.bodies.iter().enumerate().flat_map(|(body, of)| of.shapes.iter().map(move |shape| (body, shape)));
    let of_shape = |(body, shape): (usize, &LinkShape)| {
        let at = pose * placed.links.get(body).copied().unwrap_or(Pose::identity()) * shape.pose;
        let color = joints_of(body).map_or(PALE, |(finger, _)| COLORS[finger]);
        Solid { points: outline(&shape.geometry).iter().map(|point| at * *point).collect(), color }
    };
    let tips = (0..FINGERS).map(|i| {
        let center = pose * placed.tips[i].position;
        let points = ball(hand.fingers[i].tip_radius_m).map(|point| center + point).collect();
        Solid { points, color: COLORS[i] }
    });
    shapes.map(of_shape).chain(tips).collect()
}

/// Points on a shape whose hull looks like it.
fn outline(geometry: &Geometry) -> Vec<Vec3<f64>> {
    let both = |half: f64| [Vec3::z() * half, Vec3::z() * -half];
    match geometry {
        Geometry::Sphere { radius_m } => ball(*radius_m).collect(),
        Geometry::Capsule { radius_m, half_m } => {
            both(*half_m).iter().flat_map(|end| ball(*radius_m).map(move |point| end + point)).collect()
        }
        Geometry::Cylinder { radius_m, half_m } => {
            both(*half_m).iter().flat_map(|end| circle(*radius_m).map(move |point| end + point)).collect()
        }
        Geometry::Cuboid { half_m } => {
            let sign = |corner: usize, axis: usize| if corner >> axis & 1 == 0 { 1.0 } else { -1.0 };
            (0..8).map(|corner| Vec3::from_fn(|axis, _| half_m[axis] * sign(corner, axis))).collect()
        }
        Geometry::Hull(points) => points.clone(),
    }
}

/// Points of a circle about z.
fn circle(radius_m: f64) -> impl Iterator<Item = Vec3<f64>> {
    let angle = |k: usize| std::f64::consts::TAU * k as f64 / ROUND as f64;
    (0..ROUND).map(move |k| Vec3::new(radius_m * angle(k).cos(), radius_m * angle(k).sin(), 0.0))
}

/// Points of a sphere: circles of latitude.
fn ball(radius_m: f64) -> impl Iterator<Item = Vec3<f64>> {
    let latitude = |k: usize| std::f64::consts::PI * (k as f64 / ROUND as f64 - 0.5);
    (0..=ROUND).flat_map(move |k| {
        circle(radius_m * latitude(k).cos()).map(move |point| point + Vec3::z() * (radius_m * latitude(k).sin()))
    })
}

fn bounds<'a>(solids: impl Iterator<Item = &'a Solid>, arrows: &[[Vec3<f64>; 2]]) -> (Vec3<f64>, Vec3<f64>) {
    let points = solids.flat_map(|solid| &solid.points).chain(arrows.iter().flatten());
    let infinite = Vec3::repeat(f64::INFINITY);
    points.fold((infinite, -infinite), |(low, high), point| (low.inf(point), high.sup(point)))
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

fn draw(on: &Projection<'_>, solids: &[Solid], arrows: &[[Vec3<f64>; 2]]) -> Markup {
    let ((name, right, up), [left, top]) = (on.view, on.corner);
    let towards = right.cross(up);
    let mut sorted: Vec<_> = solids.iter().collect();
    let depth =
        |solid: &Solid| solid.points.iter().map(|point| towards.dot(point)).sum::<f64>() / solid.points.len() as f64;
    sorted.sort_by(|a, b| depth(a).total_cmp(&depth(b)));
    html! {
        rect.view x=(left + 4.0) y=(top + 4.0) width=(EDGE - 8.0) height=(EDGE - 8.0) {}
        @for solid in sorted {
            @let corners = convex_hull(solid.points.iter().map(|point| on.at(point)).collect());
            @let corners = corners.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect::<Vec<_>>();
            polygon.shape points=(corners.join(" ")) fill=(solid.color) {}
        }
        @for arrow in arrows {
            @let [[ax, ay], [x, y]] = arrow.map(|end| on.at(&end));
            line.contact x1=(n(ax)) y1=(n(ay)) x2=(n(x)) y2=(n(y)) {}
            circle.point cx=(n(x)) cy=(n(y)) r="4" {}
        }
        text x=(left + 12.0) y=(top + 22.0) { (name) }
    }
}

/// A coordinate in an SVG.
fn n(value: f64) -> String {
    format!("{value:.1}")
}
