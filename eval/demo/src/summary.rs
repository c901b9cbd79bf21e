//! A course of the loop as the report wants it.

use anyhow::Result;
use darm_arm::arm::frames::DesiredFrame;
use darm_arm::stops::Setting;
use darm_arm::synthesis::{self, Method, Reached, Scheme, Synthesis, synthesize};

use crate::course::{Course, FrameErrors};
use crate::report::{
    ClosedFrame, Closure, Drawing, FrameFigure, LoopReport, PAPER, PaperFigures, StopFigure, SynthesisFigures,
};
use crate::task::Task;

/// Steps of the paper's own scheme: as many as the paper took.
const PAPER_STEPS: u32 = 1000;

/// The report of a course that ran on `board` and took `time_s`.
pub(super) fn report(task: &Task, course: Course, board: &str, time_s: f64) -> Result<LoopReport> {
    let design = &course.design;
    let drawing = match &design.synthesis {
        Some(synthesis) => Drawing::of(&task.base_line, &synthesis.arm, &design.wanted),
        None => Drawing::default(),
    };
    let by_stops = course.closed.iter().filter_map(|closed| closed.by_stops.as_ref());
    let stops = by_stops.flat_map(|by_stops| &by_stops.settings).map(stop_figure).collect();
    Ok(LoopReport {
        arm: task.base_line.name.clone(),
        seed: task.seed,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        board: board.to_owned(),
        time_s,
        synthesis: design.synthesis.as_ref().map(|synthesis| synthesis_figures(task, synthesis)).transpose()?,
        stops,
        closures: closures(&course),
        plan: course.plan,
        diagnosis: course.diagnosis,
        truth: Some(course.sealed),
        drawing,
    })
}

fn synthesis_figures(task: &Task, synthesis: &Synthesis) -> Result<SynthesisFigures> {
    let options =
        synthesis::Options { method: Method::Paper(Scheme::of(PAPER_STEPS)), ..synthesis::Options::default() };
    let paper = synthesize(&task.base_line, &task.desired, &options)?;
    Ok(SynthesisFigures {
        case: synthesis.case.to_string(),
        iterations: synthesis.iterations,
        time_s: synthesis.time.as_secs_f64(),
        alteration_m: synthesis.alteration_m,
        frames: synthesis.frames.iter().map(frame_figure).collect(),
        paper: PAPER,
        paper_method: Some(PaperFigures {
            error_m: paper.frames.iter().map(|reached| reached.error_m).fold(0.0, f64::max),
            error_rad: paper.frames.iter().map(|reached| reached.error_rad).fold(0.0, f64::max),
            time_s: paper.time.as_secs_f64(),
        }),
    })
}

fn frame_figure(reached: &Reached) -> FrameFigure {
    FrameFigure {
        name: reached.frame.name.clone(),
        word: reached.frame.word.to_string(),
        before_m: reached.error_before_m,
        error_m: reached.error_m,
        error_rad: reached.error_rad,
    }
}

fn stop_figure(setting: &Setting) -> StopFigure {
    let turn = format!("{:.3} {} {}", setting.change().abs(), setting.unit(), setting.direction());
    let name = format!("{}, {}", setting.name, setting.part);
    StopFigure { name, from_m: setting.from, to_m: setting.to, turn }
}

fn closures(course: &Course) -> Vec<Closure> {
    let Some(closed) = &course.closed else { return Vec::new() };
    let wanted = &course.design.wanted;
    let by_stops = closed.by_stops.as_ref().map(|by_stops| {
        let note = "The geometry is synthesised again with the corrected model, and the stops are turned to it.";
        closure(course, "stops", note, wanted, &by_stops.errors)
    });
    let note = match by_stops {
        Some(_) => "The metal stays as it is; the corrected model chooses the nearest words.",
        None => {
            "The metal stays as it is; the corrected model chooses the words that bring the tool nearest to the positions, in \
             any orientation."
        }
    };
    let by_words = closure(course, "table only", note, &closed.words, &closed.table_only);
    by_stops.into_iter().chain([by_words]).collect()
}

/// The loop closed by `words`, with the errors `after` it.
fn closure(course: &Course, name: &str, note: &str, words: &[DesiredFrame], after: &FrameErrors) -> Closure {
    Closure {
        name: name.to_owned(),
        note: note.to_owned(),
        frames: closed_frames(&course.design.wanted, words, &course.before, after),
        before_m: course.before.rms_m(),
        after_m: after.rms_m(),
        goal_m: course.goal_m(),
    }
}

fn closed_frames(
    wanted: &[DesiredFrame],
    words: &[DesiredFrame],
    before: &FrameErrors,
    after: &FrameErrors,
) -> Vec<ClosedFrame> {
    let errors = before.each_m.iter().zip(&after.each_m);
    let frames = wanted.iter().zip(words).zip(errors);
    frames
        .map(|((old, new), (&before_m, &after_m))| ClosedFrame {
            name: old.name.clone(),
            word_before: old.word.to_string(),
            word_after: new.word.to_string(),
            before_m,
            after_m,
        })
        .collect()
}
