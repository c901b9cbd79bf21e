//! Postures of a person and of the robot beside each other, from the side: Figures 1, 3, 4 and 5 of the paper.

use anyhow::Result;
use darm_arm::draw::palette::{BLUE, INK, ORANGE, PAPER};
use darm_core::real::Vec3;
use darm_core::se::Pose;
use darm_papers::motion::Posture;
use darm_robot::robot::Robot;
use maud::{PreEscaped, html};

/// Frames of a sequence, evenly in time.
const FRAMES: usize = 6;
/// Width of a frame, height of a row, and the ground in it, pixels.
const WIDTH: f64 = 150.0;
const HEIGHT: f64 = 300.0;
const GROUND: f64 = 270.0;
/// Pixels per metre.
const SCALE: f64 = 130.0;

/// A posture and what is written below it.
pub(super) struct Frame {
    lines: Vec<[Vec3<f64>; 2]>,
    caption: String,
}

/// Frames of a motion, evenly in time.
pub(super) fn frames(robot: &Robot, postures: &[Posture], time_s: &[f64]) -> Result<Vec<Frame>> {
    let last = postures.len().min(time_s.len()).saturating_sub(1);
    let shown = (0..FRAMES).map(|k| k * last / (FRAMES - 1));
    shown.map(|k| frame(robot, &postures[k], format!("{:.2} s", time_s[k]))).collect()
}

/// One posture: lines from joint to joint, and to the centre of mass of a link that carries no joint.
pub(super) fn frame(robot: &Robot, posture: &Posture, caption: String) -> Result<Frame> {
    let links = robot.link_tree()?.place(&posture.base, &posture.q);
    let at = |joint: Option<usize>, point: Vec3<f64>| links.pose(joint, &Pose::at(point)).position;
    let origin = |joint: Option<usize>| at(joint, Vec3::zeros());
    let is_end = |joint: usize| robot.joints.iter().all(|other| other.joint.parent != Some(joint));
    let between = robot.joints.iter().enumerate().map(|(k, joint)| [origin(joint.joint.parent), origin(Some(k))]);
    let ends = robot.joints.iter().enumerate().filter(|(k, _)| is_end(*k));
    let ends = ends.map(|(k, joint)| [origin(Some(k)), at(Some(k), joint.joint.inertia.com)]);
    Ok(Frame { lines: between.chain(ends).collect(), caption })
}

/// Rows of frames, each with its name.
pub(super) fn svg(rows: &[(&str, Vec<Frame>)]) -> String {
    let columns = rows.iter().map(|(_, frames)| frames.len()).max().unwrap_or(0);
    let (width, height) = (WIDTH * columns as f64, HEIGHT * rows.len() as f64);
    let picture = html! {
        svg xmlns="http://www.w3.org/2000/svg" viewBox={ "0 0 " (width) " " (height) } width=(width) height=(height) role="img" {
            style { (PreEscaped(format!("text{{font:12px sans-serif;fill:{INK}}}"))) }
            rect width="100%" height="100%" fill=(PAPER) {}
            @for (row, (name, frames)) in rows.iter().enumerate() {
                @let ground = HEIGHT * row as f64 + GROUND;
                @let color = if row == 0 { BLUE } else { ORANGE };
                text x="8" y=(ground - GROUND + 16.0) { (name) }
                line x1="0" y1=(ground) x2=(width) y2=(ground) stroke=(INK) {}
                @for (column, frame) in frames.iter().enumerate() {
                    @let middle = WIDTH * (column as f64 + 0.5);
                    @for [a, b] in &frame.lines {
                        @let [[ax, ay], [bx, by]] = [a, b].map(|p| [middle + SCALE * p.x, ground - SCALE * p.z]);
                        line x1=(n(ax)) y1=(n(ay)) x2=(n(bx)) y2=(n(by)) stroke=(color) stroke-width="5" stroke-linecap="round" {}
                    }
                    text x=(middle - 16.0) y=(ground + 18.0) { (frame.caption) }
                }
            }
        }
    };
    picture.into_string()
}

/// A coordinate in an SVG.
fn n(value: f64) -> String {
    format!("{value:.1}")
}
