//! The views of a scene as SVG: one of a planar arm; isometric, from the front, the side and the top of any other.

use darm_core::real::Vec3;
use maud::{Markup, PreEscaped, html};

use super::palette::{AZURE, BLUE, GREEN, GRID, INK, MUTED, ORANGE, PALE, PAPER, RED};
use super::{Dimension, Leg, Part, Scene};

/// The style sheet of a picture.
fn style() -> String {
    format!(
        "text{{font:12px sans-serif;fill:{INK};paint-order:stroke;stroke:{PAPER};stroke-width:3px}}.name{{font-size:11px;fill:{MUTED}}}\
.view{{fill:none;stroke:{GRID}}}.ground{{stroke:{PALE};stroke-width:1.5;stroke-dasharray:5 4}}\
line{{stroke-linecap:round}}.link,.plate{{stroke:{INK};stroke-width:4}}\
.contracted{{stroke:{MUTED};stroke-width:2.5}}.extended{{stroke:{BLUE};stroke-width:2.5}}\
.revolute{{stroke:{ORANGE};stroke-width:7}}.prismatic{{stroke:{BLUE};stroke-width:7}}\
.x{{stroke:{RED};stroke-width:2.5}}.y{{stroke:{GREEN};stroke-width:2.5}}.z{{stroke:{AZURE};stroke-width:2.5}}\
.values{{stroke:transparent;stroke-width:9}}.leader{{fill:none;stroke:{MUTED};stroke-width:0.7}}.tip{{fill:{INK}}}\
.com{{fill:{PAPER};stroke:{INK};stroke-width:2}}.bar{{stroke:{INK};stroke-width:2}}"
    )
}

/// Room around a view for names and the title, pixels.
const MARGIN: f64 = 34.0;
/// Width of the columns of dimensions left and right of a picture, and height of a line in them, pixels.
const COLUMN: f64 = 190.0;
const LINE: f64 = 15.0;

/// How a view looks at the scene: the directions that point right and up on the paper.
struct View {
    title: &'static str,
    right: Vec3<f64>,
    up: Vec3<f64>,
    /// Left, top, width and height on the paper, pixels.
    area: [f64; 4],
    /// Width of the columns of dimensions within it; 0 without.
    column: f64,
}

/// The scene as one SVG, with the names of joints or stages if requested.
pub fn svg(scene: &Scene, has_names: bool) -> String {
    let (x, y, z) = (Vec3::x(), Vec3::y(), Vec3::z());
    let wider = if scene.dimensions.is_empty() { 0.0 } else { 2.0 * COLUMN };
    let (views, size) = if scene.is_planar {
        let area = [0.0, 30.0, 640.0 + wider, 640.0];
        (vec![View { title: "x, y", right: x, up: y, area, column: wider / 2.0 }], [640.0 + wider, 670.0])
    } else {
        let (a, e) = (-55f64.to_radians(), 24f64.to_radians());
        let (right, up) =
            (Vec3::new(-a.sin(), a.cos(), 0.0), Vec3::new(-a.cos() * e.sin(), -a.sin() * e.sin(), e.cos()));
        let small = |row: f64| [600.0 + wider, 30.0 + 240.0 * row, 320.0, 240.0];
        let views = vec![
            View { title: "isometric", right, up, area: [0.0, 30.0, 600.0 + wider, 720.0], column: wider / 2.0 },
            View { title: "front: x, z", right: x, up: z, area: small(0.0), column: 0.0 },
            View { title: "side: y, z", right: y, up: z, area: small(1.0), column: 0.0 },
            View { title: "top: x, y", right: x, up: y, area: small(2.0), column: 0.0 },
        ];
        (views, [920.0 + wider, 750.0])
    };
    let [width, height] = size;
    let picture = html! {
        svg xmlns="http://www.w3.org/2000/svg" viewBox={ "0 0 " (width) " " (height) } width=(width) height=(height) role="img" aria-label=(scene.title) {
            style { (PreEscaped(style())) }
            rect width="100%" height="100%" fill=(PAPER) {}
            text x="12" y="21" style="font-weight:bold;font-size:14px" { (scene.title) }
            @for (index, view) in views.iter().enumerate() { (view.draw(scene, has_names && index == 0)) }
        }
    };
    picture.into_string()
}

impl View {
    /// A point on the paper of a plane through the base's origin, m.
    fn flat(&self, point: &Vec3<f64>) -> [f64; 2] {
        [self.right.dot(point), self.up.dot(point)]
    }

    /// Nearer lines come later.
    fn depth(&self, point: &Vec3<f64>) -> f64 {
        self.right.cross(&self.up).dot(point)
    }

    fn draw(&self, scene: &Scene, has_names: bool) -> Markup {
        let [left, top, width, height] = self.area;
        let place = self.place(scene);
        let at = |point: &Vec3<f64>| place.at(self.flat(point));
        let mut lines: Vec<_> = scene.lines.iter().collect();
        let depth = |line: &super::Line| self.depth(&((line.from + line.to) * 0.5)) + f64::from(rank(line.part));
        lines.sort_by(|a, b| depth(a).total_cmp(&depth(b)));
        let origin = at(&Vec3::zeros());
        html! {
            rect.view x=(left + 4.0) y=(top + 4.0) width=(width - 8.0) height=(height - 8.0) {}
            text x=(left + 14.0) y=(top + 22.0) { (self.title) }
            @if self.up.z > 0.0 || scene.is_planar {
                line.ground x1=(n(left + 20.0)) x2=(n(left + width - 20.0)) y1=(n(origin[1])) y2=(n(origin[1])) {}
            }
            @for line in lines {
                @let ([ax, ay], [bx, by]) = (at(&line.from), at(&line.to));
                line class=(line.part.name()) x1=(n(ax)) y1=(n(ay)) x2=(n(bx)) y2=(n(by)) {}
            }
            @if let Some([x, y]) = scene.com.as_ref().map(at) {
                circle.com cx=(n(x)) cy=(n(y)) r="5" {}
                line x1=(n(x - 5.0)) x2=(n(x + 5.0)) y1=(n(y)) y2=(n(y)) stroke=(INK) {}
                line x1=(n(x)) x2=(n(x)) y1=(n(y - 5.0)) y2=(n(y + 5.0)) stroke=(INK) {}
            }
            @if self.column > 0.0 { (self.dimensions(&scene.dimensions, &at)) }
            @if has_names {
                (legs(scene, &at))
                // Dimensions bring the names of joints and stages along.
                @if self.column == 0.0 { (names(scene, &at, left + 0.85 * width)) }
            }
            (place.bar(left + 16.0, top + height - 16.0))
        }
    }

    /// Dimensions in two columns, each with a line that leads to its place.
    fn dimensions(&self, dimensions: &[Dimension], at: &impl Fn(&Vec3<f64>) -> [f64; 2]) -> Markup {
        let [left, top, width, height] = self.area;
        let mut placed: Vec<_> = dimensions.iter().map(|dimension| (dimension, at(&dimension.at))).collect();
        placed.sort_by(|(_, [a, _]), (_, [b, _])| a.total_cmp(b));
        let right = placed.split_off(placed.len() / 2);
        let column = |mut side: Vec<(&Dimension, [f64; 2])>, text_x: f64, line_x: f64, anchor: &str| {
            side.sort_by(|(_, [_, a]), (_, [_, b])| a.total_cmp(b));
            let heights = spread(side.iter().map(|(_, [_, y])| *y), top + 44.0, top + height - 34.0);
            html! {
                @for ((dimension, [x, y]), line_y) in side.iter().zip(heights) {
                    line.leader x1=(n(line_x)) y1=(n(line_y)) x2=(n(*x)) y2=(n(*y)) {}
                    circle.tip cx=(n(*x)) cy=(n(*y)) r="2" {}
                    text x=(n(text_x)) y=(n(line_y + 4.0)) text-anchor=(anchor) { (dimension.text) }
                }
            }
        };
        html! {
            (column(placed, left + self.column - 5.0, left + self.column, "end"))
            (column(right, left + width - self.column + 5.0, left + width - self.column, "start"))
        }
    }

    /// The largest scale at which everything fits, in the middle of the area.
    fn place(&self, scene: &Scene) -> Place {
        let ends = scene.lines.iter().flat_map(|line| [line.from, line.to]).chain([Vec3::zeros()]);
        let infinite = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
        let [x0, y0, x1, y1] = ends
            .map(|point| self.flat(&point))
            .fold(infinite, |[x0, y0, x1, y1], [x, y]| [x0.min(x), y0.min(y), x1.max(x), y1.max(y)]);
        let [left, top, width, height] = self.area;
        let fit = |span: f64, room: f64| (room - 2.0 * MARGIN) / span.max(1e-3);
        let scale = fit(x1 - x0, width - 2.0 * self.column).min(fit(y1 - y0, height));
        let middle = [left + width / 2.0, top + height / 2.0 + 4.0];
        Place { scale, shift: [middle[0] - scale * (x0 + x1) / 2.0, middle[1] + scale * (y0 + y1) / 2.0] }
    }
}

/// Evenly spaced heights as near to the wanted ones, which rise, as the room from `top` to `bottom` allows.
fn spread(wanted: impl Iterator<Item = f64>, top: f64, bottom: f64) -> Vec<f64> {
    let mut heights: Vec<f64> = wanted.collect();
    let mut from = top;
    for height in &mut heights {
        *height = height.max(from);
        from = *height + LINE;
    }
    let mut to = bottom;
    for height in heights.iter_mut().rev() {
        *height = height.min(to);
        to = *height - LINE;
    }
    heights
}

/// The name of each leg under the pointer; in a planar arm also the numbers of the actuators, at a third of the leg, where those
/// of crossing legs are apart.
fn legs(scene: &Scene, at: &impl Fn(&Vec3<f64>) -> [f64; 2]) -> Markup {
    html! {
        @for Leg { actuator, label, from, to } in &scene.legs {
            @let ([ax, ay], [bx, by], [x, y]) = (at(from), at(to), at(&(from + (to - from) / 3.0)));
            line.values x1=(n(ax)) y1=(n(ay)) x2=(n(bx)) y2=(n(by)) { title { (label) } }
            @if scene.is_planar {
                text.name x=(n(x)) y=(n(y + 4.0)) text-anchor="middle" { (actuator) title { (label) } }
            }
        }
    }
}

/// Names right of their points, left of those past `turning`; of points that coincide on the paper, one under the other.
fn names(scene: &Scene, at: &impl Fn(&Vec3<f64>) -> [f64; 2], turning: f64) -> Markup {
    let mut taken: Vec<[f64; 2]> = Vec::new();
    let placed: Vec<_> = scene
        .labels
        .iter()
        .map(|(name, point)| {
            let [x, mut y] = at(point);
            while taken.iter().any(|[a, b]| (a - x).abs() < 90.0 && (b - y).abs() < 12.0) {
                y += 13.0;
            }
            taken.push([x, y]);
            let (x, anchor) = if x > turning { (x - 12.0, "end") } else { (x + 12.0, "start") };
            (name, x, y + 4.0, anchor)
        })
        .collect();
    html! { @for (name, x, y, anchor) in placed { text.name x=(n(x)) y=(n(y)) text-anchor=(anchor) { (name) } } }
}

/// Where metres come to lie on the paper.
struct Place {
    scale: f64,
    shift: [f64; 2],
}

impl Place {
    fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.shift[0] + self.scale * x, self.shift[1] - self.scale * y]
    }

    /// A bar of 1, 2 or 5 times a power of ten that is at most 80 pixels long.
    fn bar(&self, x: f64, y: f64) -> Markup {
        let longest = 80.0 / self.scale;
        let power = 10f64.powf(longest.log10().floor());
        let length = [5.0, 2.0, 1.0].map(|factor| factor * power).into_iter().find(|length| *length <= longest);
        let length = length.unwrap_or(power);
        let text = if length >= 1.0 { format!("{length:.0} m") } else { format!("{:.0} mm", 1e3 * length) };
        html! {
            line.bar x1=(n(x)) x2=(n(x + length * self.scale)) y1=(n(y)) y2=(n(y)) {}
            text x=(n(x + length * self.scale + 6.0)) y=(n(y + 4.0)) { (text) }
        }
    }
}

/// Joints lie on links, and the tool's axes on everything.
fn rank(part: Part) -> u16 {
    match part {
        Part::Link | Part::Plate => 0,
        Part::Contracted | Part::Extended => 0,
        Part::Revolute | Part::Prismatic => 100,
        Part::ToolAxis(_) => 200,
    }
}

/// A coordinate in an SVG.
fn n(value: f64) -> String {
    format!("{value:.1}")
}
