//! The arm as lines in the xy-plane, and as SVG.

use darm_core::actuator::Stage;
use darm_core::real::Vec3;
use darm_core::se::Pose;
use maud::{Markup, html};
use serde::Serialize;

use super::{Drawing, DrawnFrame, LoopReport};
use darm_arm::arm::frames::DesiredFrame;
use darm_arm::arm::{Arm, ArmScratch};

/// Pixels per metre.
const SCALE: f64 = 62.0;

/// A line from (x, y) to (x, y), m.
pub(crate) type Line = [[f64; 2]; 2];

/// An arm's parts as lines, in the base frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Posture {
    /// Legs in state 0.
    pub(crate) contracted: Vec<Line>,
    /// Legs in any other state.
    pub(crate) extended: Vec<Line>,
    /// The number of the actuator of each contracted leg.
    pub(crate) contracted_actuators: Vec<usize>,
    /// The same of the extended ones.
    pub(crate) extended_actuators: Vec<usize>,
    /// Plates between stages, from the leftmost anchor to the rightmost; links.
    pub(crate) plates: Vec<Line>,
    /// Where the servo joints are: x, y in m.
    pub(crate) servos: Vec<[f64; 2]>,
    /// The tool: x, y in m, angle in rad.
    pub(crate) tool: [f64; 3],
}

/// The posture of an arm's ideal geometry for the word of a frame; `None` where it has none.
pub(crate) fn posture(arm: &Arm, frame: &DesiredFrame, scratch: &mut ArmScratch) -> Option<Posture> {
    let chain = &arm.model.chain;
    let tool = chain.pose_base_tool(&frame.word, &frame.servos_rad, scratch).ok()?;
    let mut posture = Posture {
        contracted: Vec::new(),
        extended: Vec::new(),
        contracted_actuators: Vec::new(),
        extended_actuators: Vec::new(),
        plates: Vec::new(),
        servos: Vec::new(),
        tool: [tool.position.x, tool.position.y, tool.rotation.m21.atan2(tool.rotation.m11)],
    };
    let mut actuator = 0;
    let mut below = chain.mount;
    for (index, stage) in chain.stages.iter().enumerate() {
        let top = scratch.tops[index];
        let legs = (0..stage.n_actuators()).filter(|&leg| stage.leg(leg).is_some());
        let settings = || legs.clone().map(|leg| scratch.settings[index][leg]);
        for (leg, setting) in settings().enumerate() {
            let line = line(&below, &setting.base, &top, &setting.top);
            posture.add_leg(actuator + leg, frame.word.digit(actuator + leg), line);
        }
        posture.plates.extend(plate(&below, settings().map(|setting| setting.base)));
        posture.plates.extend(plate(&top, settings().map(|setting| setting.top)));
        if matches!(stage, Stage::Servo(_)) {
            posture.servos.push([top.position.x, top.position.y]);
        }
        if stage.leg(0).is_none() {
            posture.plates.push(line(&below, &Vec3::zeros(), &top, &Vec3::zeros()));
        }
        actuator += stage.n_actuators();
        below = top;
    }
    posture.plates.push(line(&below, &Vec3::zeros(), &tool, &Vec3::zeros()));
    Some(posture)
}

impl Posture {
    fn add_leg(&mut self, actuator: usize, digit: u8, line: Line) {
        let (lines, actuators) = match digit {
            0 => (&mut self.contracted, &mut self.contracted_actuators),
            _ => (&mut self.extended, &mut self.extended_actuators),
        };
        lines.push(line);
        actuators.push(actuator);
    }
}

fn line(a: &Pose<f64>, from: &Vec3<f64>, b: &Pose<f64>, to: &Vec3<f64>) -> Line {
    let (from, to) = (*a * *from, *b * *to);
    [[from.x, from.y], [to.x, to.y]]
}

/// The line through the anchors of one plate.
fn plate(frame: &Pose<f64>, anchors: impl Iterator<Item = Vec3<f64>> + Clone) -> Option<Line> {
    let left = anchors.clone().min_by(|a, b| a.x.total_cmp(&b.x))?;
    let right = anchors.max_by(|a, b| a.x.total_cmp(&b.x))?;
    Some(line(frame, &left, frame, &right))
}

/// All frames side by side, in one scale.
pub(super) fn figure(report: &LoopReport) -> Markup {
    let frames = &report.drawing.frames;
    let bounds = bounds(frames);
    html! {
        div.arms {
            @for frame in frames {
                figure {
                    (one(frame, &report.drawing, bounds))
                    figcaption { b { (frame.name) } " " code { (frame.word) } }
                }
            }
        }
    }
}

/// Smallest and largest x and y of all lines.
fn bounds(frames: &[DrawnFrame]) -> [f64; 4] {
    let postures = frames.iter().flat_map(|frame| [&frame.base_line, &frame.synthesised]);
    let points = postures.flat_map(|p| p.plates.iter().chain(&p.contracted).chain(&p.extended)).flatten();
    let start = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    let [x0, y0, x1, y1] =
        points.fold(start, |[x0, y0, x1, y1], [x, y]| [x0.min(*x), y0.min(*y), x1.max(*x), y1.max(*y)]);
    [x0 - 0.25, y0 - 0.15, x1 + 0.25, y1 + 0.35]
}

fn one(frame: &DrawnFrame, drawing: &Drawing, [x0, y0, x1, y1]: [f64; 4]) -> Markup {
    let (width, height) = ((x1 - x0) * SCALE, (y1 - y0) * SCALE);
    let at = |[x, y]: [f64; 2]| ((x - x0) * SCALE, (y1 - y) * SCALE);
    let lines = |class, drawn| lines(class, drawn, at);
    let (ground_left, ground_right) = (at([x0 + 0.1, 0.0]), at([x1 - 0.1, 0.0]));
    html! {
        svg viewBox={ "0 0 " (n(width)) " " (n(height)) } role="img" aria-label={ "arm in frame " (frame.name) } {
            line.ground x1=(n(ground_left.0)) y1=(n(ground_left.1)) x2=(n(ground_right.0)) y2=(n(ground_right.1)) {}
            (lines("ghost", &frame.base_line.contracted))
            (lines("ghost", &frame.base_line.extended))
            (lines("ghost", &frame.base_line.plates))
            (lines("leg", &frame.synthesised.contracted))
            (lines("leg out", &frame.synthesised.extended))
            (lines("plate", &frame.synthesised.plates))
            (numbers(&frame.synthesised.contracted, &frame.synthesised.contracted_actuators, drawing, at))
            (numbers(&frame.synthesised.extended, &frame.synthesised.extended_actuators, drawing, at))
            @for (servo, place) in frame.synthesised.servos.iter().enumerate() {
                @let (x, y) = at(*place);
                text.number x=(n(x + 8.0)) y=(n(y)) style="text-anchor:start" { "servo " (servo) (title_of(&drawing.servos, servo)) }
            }
            (axes(frame.desired, at))
        }
    }
}

/// Lines of this class; `at` gives where a point (m) is on the page.
fn lines(class: &str, lines: &[Line], at: impl Fn([f64; 2]) -> (f64, f64)) -> Markup {
    html! {
        @for [a, b] in lines {
            @let ((ax, ay), (bx, by)) = (at(*a), at(*b));
            line class=(class) x1=(n(ax)) y1=(n(ay)) x2=(n(bx)) y2=(n(by)) {}
        }
    }
}

/// The number of each leg's actuator at a third of the leg, where those of crossing legs are apart.
fn numbers(legs: &[Line], actuators: &[usize], drawing: &Drawing, at: impl Fn([f64; 2]) -> (f64, f64)) -> Markup {
    let third = |[a, b]: &Line| at([a[0] + (b[0] - a[0]) / 3.0, a[1] + (b[1] - a[1]) / 3.0]);
    html! {
        @for (leg, actuator) in legs.iter().zip(actuators) {
            @let (x, y) = third(leg);
            text.number x=(n(x)) y=(n(y)) { (actuator) (title_of(&drawing.actuators, *actuator)) }
        }
    }
}

/// What is shown under the pointer.
fn title_of(labels: &[String], index: usize) -> Markup {
    html! { @if let Some(label) = labels.get(index) { title { (label) } } }
}

/// The desired frame: its two axes and its origin.
fn axes([x, y, angle]: [f64; 3], at: impl Fn([f64; 2]) -> (f64, f64)) -> Markup {
    let arm = 0.28;
    let (origin, along_x) = (at([x, y]), at([x + arm * angle.cos(), y + arm * angle.sin()]));
    let along_y = at([x - arm * angle.sin(), y + arm * angle.cos()]);
    html! {
        line.axis-x x1=(n(origin.0)) y1=(n(origin.1)) x2=(n(along_x.0)) y2=(n(along_x.1)) {}
        line.axis-y x1=(n(origin.0)) y1=(n(origin.1)) x2=(n(along_y.0)) y2=(n(along_y.1)) {}
        circle.origin cx=(n(origin.0)) cy=(n(origin.1)) r="3" {}
    }
}

/// A coordinate in an SVG.
fn n(value: f64) -> String {
    format!("{value:.1}")
}
