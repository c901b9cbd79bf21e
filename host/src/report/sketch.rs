//! An arm in one desired frame as an SVG of its own: the xy-plane of a planar arm, three views of one in space.

use darm_core::real::Vec3;
use darm_core::se::Pose;
use maud::{Markup, PreEscaped, html};

use crate::arm::frames::DesiredFrame;
use crate::arm::{Arm, ArmScratch};

/// Pixels of one view's longer side.
const SIZE: f64 = 480.0;
/// Free space around a view, pixels.
const MARGIN: f64 = 24.0;
/// Length of the axes that stand for a frame, as a share of the view.
const AXIS: f64 = 0.08;
/// The views: name, and the coordinates that point right and up.
const VIEWS: [(&str, usize, usize); 3] = [("front: x, z", 0, 2), ("side: y, z", 1, 2), ("top: x, y", 0, 1)];
const STYLE: &str = "line{stroke:#333;stroke-width:1.5}.out{stroke:#c4501b}.plate{stroke:#333;stroke-width:4}\
                     .x{stroke:#c00}.y{stroke:#080}.z{stroke:#00c}text{font:14px sans-serif}";

/// A line in space with its class.
struct Stroke {
    class: &'static str,
    ends: [[f64; 3]; 2],
}

/// The arm in the posture of a frame's word, with the desired frame as axes (x red, y green, z blue); `None` where the
/// word has no pose.
pub fn sketch(arm: &Arm, frame: &DesiredFrame) -> Option<String> {
    let strokes = strokes(arm, frame)?;
    let views = if arm.model.chain.is_planar() { &VIEWS[2..] } else { &VIEWS[..] };
    let width = views.len() as f64 * (SIZE + 2.0 * MARGIN);
    let height = SIZE + 2.0 * MARGIN;
    let title = format!("{}, frame {}, word {}", arm.name, frame.name, frame.word);
    let markup = html! {
        svg xmlns="http://www.w3.org/2000/svg" width=(width) height=(height) viewBox={ "0 0 " (width) " " (height) } {
            style { (PreEscaped(STYLE)) }
            text x="8" y="16" { (title) }
            @for (index, view) in views.iter().enumerate() {
                g transform={ "translate(" (index as f64 * (SIZE + 2.0 * MARGIN) + MARGIN) " " (MARGIN) ")" } {
                    (drawn(&strokes, frame, *view))
                }
            }
        }
    };
    Some(markup.into_string())
}

fn strokes(arm: &Arm, frame: &DesiredFrame) -> Option<Vec<Stroke>> {
    let mut scratch = ArmScratch::default();
    let condition = arm.model.working(frame.word, frame.previous, &frame.servos_rad);
    let tool = arm.model.predict(&condition, &mut scratch).ok()?;
    let mut strokes = Vec::new();
    let point = |pose: &Pose<f64>, at: Vec3<f64>| -> [f64; 3] { (*pose * at).into() };
    let mut below = arm.model.chain.mount;
    let mut actuator = 0;
    for (index, stage) in arm.model.chain.stages.iter().enumerate() {
        let top = scratch.tops[index];
        let legs = (0..stage.n_actuators()).filter_map(|leg| Some((leg, stage.leg(leg)?)));
        for (leg, of) in legs.clone() {
            let class = if frame.word.digit(actuator + leg) > 0 { "out" } else { "leg" };
            strokes.push(Stroke { class, ends: [point(&below, of.base), point(&top, of.top)] });
        }
        let anchors: Vec<_> = legs.map(|(_, leg)| leg).collect();
        for (a, b) in anchors.iter().zip(anchors.iter().cycle().skip(1)) {
            strokes.push(Stroke { class: "plate", ends: [point(&below, a.base), point(&below, b.base)] });
            strokes.push(Stroke { class: "plate", ends: [point(&top, a.top), point(&top, b.top)] });
        }
        if anchors.is_empty() {
            strokes.push(Stroke { class: "plate", ends: [below.position.into(), top.position.into()] });
        }
        actuator += stage.n_actuators();
        below = top;
    }
    strokes.push(Stroke { class: "leg", ends: [below.position.into(), tool.position.into()] });
    Some(strokes)
}

fn drawn(strokes: &[Stroke], frame: &DesiredFrame, (name, right, up): (&str, usize, usize)) -> Markup {
    let goal = &frame.pose_base_tool;
    let points = strokes.iter().flat_map(|stroke| stroke.ends).chain([goal.position.into()]);
    let (mut least, mut most) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for point in points {
        for axis in 0..3 {
            least[axis] = least[axis].min(point[axis]);
            most[axis] = most[axis].max(point[axis]);
        }
    }
    // One scale for all views.
    let span = (0..3).map(|axis| most[axis] - least[axis]).fold(1e-3, f64::max);
    let pixel = SIZE / span;
    let at = |point: [f64; 3]| ((point[right] - least[right]) * pixel, SIZE - (point[up] - least[up]) * pixel);
    let line = |class: &str, from: [f64; 3], to: [f64; 3]| {
        let ((x1, y1), (x2, y2)) = (at(from), at(to));
        let n = |value: f64| format!("{value:.1}");
        html! { line class=(class) x1=(n(x1)) y1=(n(y1)) x2=(n(x2)) y2=(n(y2)) {} }
    };
    let origin: [f64; 3] = goal.position.into();
    let tip = |axis: usize| -> [f64; 3] { (goal.position + goal.rotation.column(axis) * (AXIS * span)).into() };
    html! {
        text y=(SIZE + 0.8 * MARGIN) { (name) " (" (format!("{span:.2}")) " m across)" }
        @for stroke in strokes { (line(stroke.class, stroke.ends[0], stroke.ends[1])) }
        @for (axis, class) in ["x", "y", "z"].into_iter().enumerate() { (line(class, origin, tip(axis))) }
    }
}
