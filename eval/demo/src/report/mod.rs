//! The report of one calibration loop: an HTML page, JSON with the same numbers, a table for the terminal.
//!
//! All three are rendered from one value, [`LoopReport`].

mod drawing;
mod html;
mod terminal;

use std::io;
use std::path::Path;
use std::time::SystemTime;

use darm_core::se::Pose;
use serde::Serialize;

use darm_arm::arm::frames::DesiredFrame;
use darm_arm::arm::{Arm, ArmScratch};
use darm_arm::draw::page::SourceFile;
use darm_diagnose::outcome::Diagnosis;
use darm_diagnose::truth::Sealed;
use drawing::{Posture, posture};
use html::page;
pub(crate) use terminal::table;

/// Files of a loop besides its report: what each is, and its name.
const FILES: [(&str, &str); 3] = [
    ("measurements", "run.csv"),
    ("corrected model", "arm-corrected.toml"),
    ("arm with other stops", "arm-stops.toml"),
];

/// Errors and time of the synthesis in the paper: errors of 1e-7 m and 1e-9 degrees after 10² s.
pub(crate) const PAPER: PaperFigures = PaperFigures { error_m: 1e-7, error_rad: 1.745_329_25e-11, time_s: 1e2 };

/// Figures of one calibration loop.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct LoopReport {
    /// Name of the arm.
    pub(crate) arm: String,
    /// Seed of everything that was drawn.
    pub(crate) seed: u64,
    /// Version of this program.
    pub(crate) version: String,
    /// Board that ran the firmware.
    pub(crate) board: String,
    /// Total time, s.
    pub(crate) time_s: f64,
    /// Synthesis from the desired frames; `None` of an arm that stays as it is.
    pub(crate) synthesis: Option<SynthesisFigures>,
    /// The measurement plan.
    #[serde(rename = "measurement_plan")]
    pub(crate) plan: PlanFigures,
    /// Result of the diagnosis.
    pub(crate) diagnosis: Diagnosis,
    /// Injected effect, revealed after the verdict; `None` for a real arm.
    pub(crate) truth: Option<Sealed>,
    /// Adjustments of the stops.
    #[serde(rename = "adjustments")]
    pub(crate) stops: Vec<StopFigure>,
    /// Closures of the loop and their results.
    pub(crate) closures: Vec<Closure>,
    /// The initial and the synthesised arm in each desired frame.
    pub(crate) drawing: Drawing,
}

/// Figures of a synthesis.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct SynthesisFigures {
    /// Sufficient, insufficient or redundant.
    pub(crate) case: String,
    /// Steps.
    pub(crate) iterations: u32,
    /// Time, s.
    pub(crate) time_s: f64,
    /// Change of the stops (RSS), m.
    pub(crate) alteration_m: f64,
    /// Each desired frame.
    pub(crate) frames: Vec<FrameFigure>,
    /// Figures printed in the paper.
    pub(crate) paper: PaperFigures,
    /// The paper's method run here on the same frames; `None` where it was not run.
    pub(crate) paper_method: Option<PaperFigures>,
}

/// Largest errors and time of a synthesis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct PaperFigures {
    /// Largest distance, m.
    pub(crate) error_m: f64,
    /// Largest angle, rad.
    pub(crate) error_rad: f64,
    /// Time, s.
    pub(crate) time_s: f64,
}

/// Error of the synthesis at a desired frame.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct FrameFigure {
    /// Its name.
    pub(crate) name: String,
    /// Its word.
    pub(crate) word: String,
    /// Distance before, m.
    pub(crate) before_m: f64,
    /// Distance, m.
    pub(crate) error_m: f64,
    /// Angle, rad.
    pub(crate) error_rad: f64,
}

/// Figures of a measurement plan.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct PlanFigures {
    /// Different words.
    pub(crate) words: usize,
    /// Of these held out.
    pub(crate) held_out: usize,
    /// Visits of each word.
    pub(crate) visits: usize,
    /// Exact repeats among the rows.
    pub(crate) repeats: usize,
    /// Rows that were measured.
    pub(crate) rows: usize,
    /// Rows of the board's table.
    pub(crate) table_rows: usize,
    /// Duration on the board, s.
    pub(crate) time_s: f64,
}

/// Adjustment of one stop or anchor.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct StopFigure {
    /// Which.
    pub(crate) name: String,
    /// From, m.
    pub(crate) from_m: f64,
    /// To, m.
    pub(crate) to_m: f64,
    /// Amount and direction.
    #[serde(rename = "adjustment")]
    pub(crate) turn: String,
}

/// One way to close the loop.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Closure {
    /// What was done.
    pub(crate) name: String,
    /// Explanation.
    pub(crate) note: String,
    /// Each desired frame.
    pub(crate) frames: Vec<ClosedFrame>,
    /// Measured error before, RMS over the frames, m: distance d, or that of the positions where the orientation is free.
    pub(crate) before_m: f64,
    /// The same after.
    pub(crate) after_m: f64,
    /// Goal, m.
    pub(crate) goal_m: f64,
}

/// One desired frame, measured before and after.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct ClosedFrame {
    /// Its name.
    pub(crate) name: String,
    /// Word before.
    pub(crate) word_before: String,
    /// Word after.
    pub(crate) word_after: String,
    /// Measured distance d from the desired frame before, m.
    pub(crate) before_m: f64,
    /// The same after.
    pub(crate) after_m: f64,
}

/// Lines of an arm in several frames.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct Drawing {
    /// Of each actuator: number, name and outputs.
    pub(crate) actuators: Vec<String>,
    /// Of each servo joint: number and name.
    pub(crate) servos: Vec<String>,
    /// In each desired frame.
    pub(crate) frames: Vec<DrawnFrame>,
}

/// The arm in one desired frame.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct DrawnFrame {
    /// Name of the frame.
    pub(crate) name: String,
    /// The word.
    pub(crate) word: String,
    /// The initial arm.
    pub(crate) base_line: Posture,
    /// The synthesised arm.
    pub(crate) synthesised: Posture,
    /// The desired frame: x, y in m, and the angle in rad.
    pub(crate) desired: [f64; 3],
}

impl LoopReport {
    /// Whether the diagnosis named the injected effect; `None` for a real arm.
    pub(crate) fn named_rightly(&self) -> Option<bool> {
        let truth = self.truth.as_ref()?;
        Some(match &self.diagnosis.effects[..] {
            [] => truth.is_nothing(),
            [one] => truth.is_at_part(one.law, &one.site.place),
            _ => false,
        })
    }

    /// Writes `report.html` and `report.json` into a folder; the page has the digests of the loop's files that are there.
    ///
    /// # Errors
    ///
    /// The folder cannot be made, or a file in it cannot be written.
    pub(crate) fn write(&self, folder: &Path) -> io::Result<()> {
        std::fs::create_dir_all(folder)?;
        let read = |(kind, name): (&'static str, &str)| SourceFile::read(kind, &folder.join(name)).ok();
        let files: Vec<SourceFile> = FILES.into_iter().filter_map(read).collect();
        std::fs::write(folder.join("report.html"), page(self, &files, SystemTime::now()).into_string())?;
        std::fs::write(folder.join("report.json"), serde_json::to_string_pretty(self)?)
    }
}

impl Drawing {
    /// The two arms in each of the desired frames; frames without a pose are left out.
    pub(crate) fn of(base_line: &Arm, synthesised: &Arm, desired: &[DesiredFrame]) -> Self {
        let mut scratch = ArmScratch::default();
        let drawn = |frame| DrawnFrame::of(base_line, synthesised, frame, &mut scratch);
        let servo = |servo| format!("servo {servo}: {}", base_line.servo_name(servo));
        Self {
            actuators: (0..base_line.n_actuators()).map(|actuator| base_line.actuator_label(actuator)).collect(),
            servos: (0..base_line.n_servos()).map(servo).collect(),
            frames: desired.iter().filter_map(drawn).collect(),
        }
    }
}

impl DrawnFrame {
    /// The two arms in a desired frame; `None` where one of them has no pose.
    fn of(base_line: &Arm, synthesised: &Arm, frame: &DesiredFrame, scratch: &mut ArmScratch) -> Option<Self> {
        let Pose { rotation, position } = frame.pose_base_tool;
        Some(Self {
            name: frame.name.clone(),
            word: frame.word.to_string(),
            base_line: posture(base_line, frame, scratch)?,
            synthesised: posture(synthesised, frame, scratch)?,
            desired: [position.x, position.y, rotation.m21.atan2(rotation.m11)],
        })
    }
}

#[cfg(test)]
mod tests;
