//! Result of `darm synth`.

use std::path::{Path, PathBuf};

use darm_arm::arm::Arm;
use darm_arm::synthesis::{
    Accuracy, Bought, Case, Cost, Expected, Infeasibility, Method, Reached, Status, Synthesis, assembled_share, digits,
    nearest_singular, without_pose,
};
use darm_core::actuator::MIN_DETERMINANT;
use serde::Serialize;

use crate::ui::{Answer, columns, number};

/// Result of a synthesis.
#[derive(Serialize)]
pub(super) struct Synthesised {
    output: PathBuf,
    model: String,
    reached: bool,
    case: String,
    ranks: Case,
    /// Why not all frames are reached.
    #[serde(skip_serializing_if = "Option::is_none")]
    obstacle: Option<Infeasibility>,
    iterations: u32,
    starts: u32,
    took_s: f64,
    alteration_m: f64,
    anchors_moved_m: f64,
    assembly: AssemblyReport,
    frames: Vec<FrameReport>,
    #[serde(flatten)]
    extras: Extras,
}

/// What a task reports in addition to the geometry.
#[derive(Default, Serialize)]
pub(super) struct Extras {
    /// The part of each leg.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) parts: Vec<Bought>,
    /// Price of all parts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) price: Option<f64>,
    /// Cost of a repair.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) repair: Option<Cost>,
    /// Change of the stops (RSS) of the geometry with the smallest change, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) alteration_before_m: Option<f64>,
    /// Expected errors of the geometry with the smallest change.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) expected_before: Vec<Expected>,
    /// Expected errors of the least sensitive geometry.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) expected: Vec<Expected>,
}

/// In which words the arm can be assembled, and how near it comes to a singular posture.
#[derive(Serialize)]
struct AssemblyReport {
    /// Share of all words that can be assembled, percent.
    words_percent: f64,
    /// Settings of modules that no other word may contain.
    without_pose: Vec<ModuleSettings>,
    /// Absent where the arm has no platform.
    #[serde(skip_serializing_if = "Option::is_none")]
    nearest_singular: Option<SingularReport>,
}

#[derive(Serialize)]
struct ModuleSettings {
    module: String,
    settings: Vec<String>,
}

/// The module and the setting with the least determinant, scaled, without a unit.
#[derive(Serialize)]
struct SingularReport {
    module: String,
    setting: String,
    determinant: f64,
    min_determinant: f64,
}

impl AssemblyReport {
    fn of(arm: &Arm) -> Self {
        let without_pose = without_pose(arm).into_iter().map(|module| ModuleSettings {
            module: arm.stage_name(module.stage),
            settings: module.settings.iter().map(|setting| digits(setting)).collect(),
        });
        let nearest_singular = nearest_singular(arm).map(|nearest| SingularReport {
            module: arm.stage_name(nearest.stage),
            setting: digits(&nearest.setting),
            determinant: nearest.determinant,
            min_determinant: MIN_DETERMINANT,
        });
        Self { words_percent: 100.0 * assembled_share(arm), without_pose: without_pose.collect(), nearest_singular }
    }

    /// Lines, each with its end.
    fn text(&self) -> String {
        let mut text = match &self.without_pose[..] {
            [] => "every word can be assembled\n".to_owned(),
            lost => {
                let of = |module: &ModuleSettings| format!("{} at {}", module.module, module.settings.join(", "));
                format!(
                    "{} % of the words can be assembled, but none with {}: no table can use them\n",
                    number(self.words_percent, 1),
                    lost.iter().map(of).collect::<Vec<_>>().join("; ")
                )
            }
        };
        if let Some(SingularReport { module, setting, determinant, min_determinant }) = &self.nearest_singular {
            text += &format!(
                "nearest to a singular posture: {module} at {setting}, determinant {} (singular below {min_determinant})\n",
                number(*determinant, 3)
            );
        }
        text
    }
}

#[derive(Serialize)]
struct FrameReport {
    name: String,
    word: String,
    servos_rad: Vec<f64>,
    before_m: f64,
    before_rad: f64,
    error_m: f64,
    error_rad: f64,
}

/// Frames that are not reached.
#[derive(Debug, thiserror::Error)]
#[error(
    "frames not reached: {frames} (errors up to {} mm, {} deg, met are {:.0e} mm and {:.0e} deg); {case}; {why}; remove frames or move \
     them closer, let anchors move with --anchors, or accept the closest geometry with --closest",
    number(*worst_mm, 3),
    number(*worst_deg, 3),
    1e3 * accuracy.position_m,
    accuracy.orientation_rad.to_degrees()
)]
pub(super) struct NotMet {
    frames: String,
    worst_mm: f64,
    worst_deg: f64,
    accuracy: Accuracy,
    case: String,
    why: String,
}

pub(super) fn not_met(found: &Synthesis, method: Method) -> NotMet {
    let worst = |error: fn(&Reached) -> f64| found.frames.iter().map(error).fold(0.0, f64::max);
    let missed = found.frames.iter().filter(|reached| !reached.is_met());
    let names: Vec<_> = missed.map(|reached| reached.frame.name.as_str()).collect();
    NotMet {
        frames: names.join(", "),
        worst_mm: 1e3 * worst(|reached| reached.error_m),
        worst_deg: worst(|reached| reached.error_rad).to_degrees(),
        accuracy: Accuracy::of(method),
        case: found.case.to_string(),
        why: found.obstacle.as_ref().map_or_else(String::new, Infeasibility::to_string),
    }
}

impl Synthesised {
    pub(super) fn of(found: &Synthesis, output: &Path, extras: Extras) -> Self {
        Self {
            output: output.into(),
            model: found.arm.hash().to_string(),
            reached: found.status == Status::Reached,
            case: found.case.to_string(),
            ranks: found.case.clone(),
            obstacle: found.obstacle.clone(),
            iterations: found.iterations,
            starts: found.starts,
            took_s: found.time.as_secs_f64(),
            alteration_m: found.alteration_m,
            anchors_moved_m: found.anchors_moved_m,
            assembly: AssemblyReport::of(&found.arm),
            frames: found.frames.iter().map(frame_report).collect(),
            extras,
        }
    }
}

fn frame_report(reached: &Reached) -> FrameReport {
    FrameReport {
        name: reached.frame.name.clone(),
        word: reached.frame.word.to_string(),
        servos_rad: reached.frame.servos_rad.clone(),
        before_m: reached.error_before_m,
        before_rad: reached.error_before_rad,
        error_m: reached.error_m,
        error_rad: reached.error_rad,
    }
}

impl Answer for Synthesised {
    fn text(&self) -> String {
        let mut rows =
            vec![["frame", "word", "before, mm", "before, deg", "after, mm", "after, deg"].map(str::to_owned).to_vec()];
        rows.extend(self.frames.iter().map(|frame| {
            vec![
                frame.name.clone(),
                frame.word.clone(),
                format!("{:.1}", 1e3 * frame.before_m),
                format!("{:.2}", frame.before_rad.to_degrees()),
                number(1e3 * frame.error_m, 2),
                number(frame.error_rad.to_degrees(), 2),
            ]
        }));
        format!(
            "{}\n\n{}{}\n{} in {:.3} s: {} iterations, {} start{}; stops changed by {:.1} mm (RSS){}\n\
             {}model {} in {}",
            columns(&rows),
            self.extras.text(&self.frames, self.alteration_m),
            self.case,
            match &self.obstacle {
                None => "every frame is reached".to_owned(),
                Some(obstacle) => format!("closest geometry: {obstacle};"),
            },
            self.took_s,
            self.iterations,
            self.starts,
            if self.starts == 1 { "" } else { "s" },
            1e3 * self.alteration_m,
            match self.anchors_moved_m {
                0.0 => String::new(),
                moved_m => format!(", anchors moved by up to {:.1} mm; `darm adjust` lists them", 1e3 * moved_m),
            },
            self.assembly.text(),
            self.model,
            self.output.display()
        )
    }
}

impl Extras {
    /// Paragraphs, each followed by an empty line.
    fn text(&self, frames: &[FrameReport], alteration_m: f64) -> String {
        let mut text = String::new();
        if !self.parts.is_empty() {
            let mut rows = vec![["leg", "part", "price", "stops, mm", "load, N"].map(str::to_owned).to_vec()];
            rows.extend(self.parts.iter().map(|part| {
                let (short, long) = part.stops_m;
                vec![
                    part.actuator.clone(),
                    part.part.clone(),
                    format!("{:.2}", part.price),
                    format!("{:.1} to {:.1}", 1e3 * short, 1e3 * long),
                    format!("{:.1}", part.load_n),
                ]
            }));
            text += &format!("{}\ntotal price: {:.2}\n\n", columns(&rows), self.price.unwrap_or(0.0));
        }
        if let Some(cost) = &self.repair {
            text += &format!(
                "repair: {} of {} frames reached, {} with another word; {} stops to adjust, by {:.1} mm (RSS); {:.0} % of the \
                 words remain\n{}\n",
                cost.frames_met,
                cost.frames,
                cost.words_changed,
                cost.stops_turned,
                1e3 * cost.alteration_m,
                100.0 * cost.words_left,
                match 1e3 * cost.dead_turned_m {
                    mm if mm < 1e-3 => String::new(),
                    mm => format!("a stop of the stuck actuator is to be turned by {mm:.1} mm; --keep-stop keeps it\n"),
                }
            );
        }
        if !self.expected.is_empty() {
            text += &self.expected_text(frames, alteration_m);
        }
        text
    }

    /// Expected errors before and after, frame by frame.
    fn expected_text(&self, frames: &[FrameReport], alteration_m: f64) -> String {
        let head =
            ["frame", "expected before, mm", "expected, mm", "expected, deg", "sampled arms, mm", "sampled arms, deg"];
        let mut rows = vec![head.map(str::to_owned).to_vec()];
        for ((frame, before), now) in frames.iter().zip(&self.expected_before).zip(&self.expected) {
            rows.push(vec![
                frame.name.clone(),
                format!("{:.3}", 1e3 * before.linear_m),
                format!("{:.3}", 1e3 * now.linear_m),
                format!("{:.4}", now.linear_rad.to_degrees()),
                format!("{:.3}", 1e3 * now.sampled_m),
                format!("{:.4}", now.sampled_rad.to_degrees()),
            ]);
        }
        let root = |of: &[Expected]| 1e3 * of.iter().map(|frame| frame.linear_m.powi(2)).sum::<f64>().sqrt();
        format!(
            "{}\nall frames together (RSS): {:.3} mm, before {:.3} mm, for stops changed by {:.1} mm instead of {:.1} mm; a \
             larger --adjustment-per-halving changes more\n\n",
            columns(&rows),
            root(&self.expected),
            root(&self.expected_before),
            1e3 * alteration_m,
            1e3 * self.alteration_before_m.unwrap_or(alteration_m)
        )
    }
}
