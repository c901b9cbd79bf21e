//! Result of `darm calibrate`.

use std::path::{Path, PathBuf};

use darm_arm::arm::frames::DesiredFrame;
use darm_arm::arm::{Arm, ArmScratch};
use darm_diagnose::calibrate::{Look, Next, Reason, State};
use darm_diagnose::outcome::{Effect, Verdict};
use serde::Serialize;

use super::folder::REPORT;
use crate::commands::{adjust, diagnose};
use crate::ui::{Answer, columns};

/// What a calibration found, and what to do about it.
#[derive(Serialize)]
pub(super) struct Calibrated {
    reason: Reason,
    verdict: Verdict,
    effects: Vec<Effect>,
    visits: usize,
    looks: Vec<LookReport>,
    /// What is known of the frames by the model with the effects.
    pub(super) frames: Vec<FrameReport>,
    /// The stops that bring the tool to the frames.
    pub(super) adjusted: Option<Adjusted>,
    /// The model with the effects.
    pub(super) model: Option<PathBuf>,
    /// Digest of the table with the nearest words, where it was uploaded.
    pub(super) uploaded: Option<String>,
    folder: PathBuf,
    #[serde(skip)]
    plain: Vec<String>,
}

/// One look in short.
#[derive(Serialize)]
pub(super) struct LookReport {
    visits: usize,
    /// Share of the chance of a false alarm that it may spend.
    share: f64,
    verdict: Verdict,
    uncertainty_m: Option<f64>,
    goal_m: f64,
    /// About how many more visits the goal takes.
    visits_left: Option<usize>,
}

/// A frame with its word before and after.
#[derive(Serialize)]
pub(super) struct FrameReport {
    name: String,
    word: String,
    /// Distance that the model without the effects that were found predicts with that word.
    as_drawn_m: f64,
    predicted_m: f64,
    /// Distance that was measured with that word; `None` where the frame was not measured.
    measured_m: Option<f64>,
    better_word: String,
    better_predicted_m: f64,
    better_measured_m: Option<f64>,
}

/// An arm with other stops.
#[derive(Serialize)]
pub(super) struct Adjusted {
    pub(super) file: PathBuf,
    /// Whether its tool reaches all frames.
    pub(super) reached: bool,
    #[serde(flatten)]
    pub(super) report: adjust::Report,
}

impl Calibrated {
    pub(super) fn new(state: &State, looks: Vec<LookReport>, last: &Look, folder: &Path) -> Self {
        let reason = match last.next {
            Next::Stop(reason) => reason,
            Next::Measure(_) => Reason::NoLookLeft,
        };
        let found = &last.outcome.diagnosis;
        Self {
            reason,
            verdict: found.verdict,
            effects: found.effects.clone(),
            visits: state.run.samples.len(),
            looks,
            frames: Vec::new(),
            adjusted: None,
            model: None,
            uploaded: None,
            folder: folder.into(),
            plain: found.plain.clone(),
        }
    }
}

impl Calibrated {
    /// Adds the distances that were measured: at all frames with the words before, then with the nearest ones.
    pub(super) fn add_measured(&mut self, distances_m: &[Option<f64>]) {
        let (before, after) = distances_m.split_at(distances_m.len() / 2);
        for ((frame, before), after) in self.frames.iter_mut().zip(before).zip(after) {
            (frame.measured_m, frame.better_measured_m) = (*before, *after);
        }
    }

    /// What a person does with the files that were written.
    pub(super) fn next_step(&self) -> String {
        let words = match &self.uploaded {
            Some(_) => "play words.darm, which the board has",
            None if self.has_nearest_words() => "keep the words, which words.darm has: they are the nearest already",
            None => "`darm upload` words.darm, the nearest words for the arm as it is",
        };
        let stops = self.adjusted.as_ref().map_or(String::new(), |adjusted| {
            format!("; or turn the stops, which gives the arm adjusted.toml: {}", adjusted.report.sentence())
        });
        format!("{words}{stops}. model.toml is the corrected model; diagnose the next recording with it.")
    }

    /// Whether the words of the frames are the nearest already.
    pub(super) fn has_nearest_words(&self) -> bool {
        self.frames.iter().all(|frame| frame.word == frame.better_word)
    }

    /// Where the arm as drawn misses the frames as well, in a sentence.
    fn design(&self) -> Option<String> {
        let goal_m = self.looks.last()?.goal_m;
        let max_m = self.frames.iter().map(|frame| frame.as_drawn_m).fold(0.0, f64::max);
        (max_m > goal_m).then(|| {
            format!(
                "the arm as drawn misses the frames by up to {:.3} mm: its stops are not those that `darm synth` finds for them",
                1e3 * max_m
            )
        })
    }

    /// The measured errors before and after, in a sentence.
    fn measured(&self) -> Option<String> {
        let both = self.frames.iter().filter_map(|frame| frame.measured_m.zip(frame.better_measured_m));
        let (before, after): (Vec<f64>, Vec<f64>) = both.unzip();
        let (before, after) = root_mean_square(&before).zip(root_mean_square(&after))?;
        let [before, after] = [before, after].map(|m| format!("{:.3}", 1e3 * m));
        Some(format!("measured at the frames, root mean square: {before} → {after} mm with the nearest words"))
    }
}

impl LookReport {
    pub(super) fn of(look: &Look, visits: usize) -> Self {
        Self {
            visits,
            share: look.share,
            verdict: look.outcome.diagnosis.verdict,
            uncertainty_m: look.uncertainty_m,
            goal_m: look.goal_m,
            visits_left: look.visits_left(visits).filter(|_| matches!(look.next, Next::Measure(_))),
        }
    }

    /// For the progress.
    pub(super) fn line(&self, look: usize, looks: usize) -> String {
        let certain = self.uncertainty_m.map_or(String::new(), |m| {
            format!(
                "; pose at the frames within {:.3} mm of the prediction (95 %), goal {:.3} mm",
                1e3 * m,
                1e3 * self.goal_m
            )
        });
        let left = self.visits_left.map_or(String::new(), |visits| format!("; about {visits} more visits"));
        format!("look {look} of at most {looks}, {} visits: {}{certain}{left}", self.visits, self.verdict)
    }
}

impl FrameReport {
    /// A frame whose present word is that of `old`, and the nearest that of `new`, `after_m` away.
    pub(super) fn new(
        [drawn, corrected]: [&Arm; 2],
        old: &DesiredFrame,
        new: &DesiredFrame,
        after_m: f64,
    ) -> anyhow::Result<Self> {
        Ok(Self {
            name: old.name.clone(),
            word: old.word.to_string(),
            as_drawn_m: predicted_m(drawn, old)?,
            predicted_m: predicted_m(corrected, old)?,
            measured_m: None,
            better_word: new.word.to_string(),
            better_predicted_m: after_m,
            better_measured_m: None,
        })
    }

    fn cells(&self) -> Vec<String> {
        let of = |predicted_m: f64, measured_m: Option<f64>| {
            let measured = measured_m.map_or("–".to_owned(), |m| format!("{:.3} mm", 1e3 * m));
            [format!("{:.3} mm", 1e3 * predicted_m), measured]
        };
        let [predicted, measured] = of(self.predicted_m, self.measured_m);
        let [better_predicted, better_measured] = of(self.better_predicted_m, self.better_measured_m);
        let (name, word, better_word) = (self.name.clone(), self.word.clone(), self.better_word.clone());
        vec![name, word, predicted, measured, better_word, better_predicted, better_measured]
    }
}

/// How far a frame is from where a model predicts the tool with its word, m.
fn predicted_m(arm: &Arm, frame: &DesiredFrame) -> anyhow::Result<f64> {
    let condition = arm.model.working(frame.word, frame.previous, &frame.servos_rad);
    Ok(frame.distance_m(arm, &arm.model.predict(&condition, &mut ArmScratch::default())?))
}

/// Root of the mean square; `None` of no values.
fn root_mean_square(values: &[f64]) -> Option<f64> {
    let squares: f64 = values.iter().map(|value| value * value).sum();
    (!values.is_empty()).then(|| (squares / values.len() as f64).sqrt())
}

impl Answer for Calibrated {
    fn text(&self) -> String {
        let looks = if self.looks.len() == 1 { "1 look".to_owned() } else { format!("{} looks", self.looks.len()) };
        let mut lines = vec![format!(
            "verdict: {} after {} visits in {looks}: {}",
            self.verdict,
            self.visits,
            in_words(self.reason)
        )];
        lines.extend(self.plain.clone());
        lines.extend(self.effects.iter().map(diagnose::effect));
        if !self.frames.is_empty() {
            let head = ["frame", "word", "predicted error", "measured", "nearest word", "predicted error", "measured"];
            let head = head.map(str::to_owned).to_vec();
            let rows: Vec<Vec<String>> =
                std::iter::once(head).chain(self.frames.iter().map(FrameReport::cells)).collect();
            lines.extend([String::new(), columns(&rows)]);
            lines.extend(self.measured());
            lines.extend(self.design());
            let words = shown(&self.folder, "words.darm");
            lines.push(match &self.uploaded {
                Some(digest) => format!("uploaded the nearest words: table {}", digest.get(..16).unwrap_or(digest)),
                None if self.has_nearest_words() => {
                    "the words are the nearest already: only other stops bring the tool nearer".to_owned()
                }
                None => format!("to use the nearest words with the arm as it is: `darm upload {words}`"),
            });
        }
        if let Some(adjusted) = &self.adjusted {
            let reached = if adjusted.reached { "reach the frames" } else { "come as near to the frames as stops can" };
            lines.push(format!("\nto {reached} by adjusting the stops, {}:", adjusted.file.display()));
            lines.push(adjusted.report.text());
        }
        lines.push(format!("\nwrote {} and {}", shown(&self.folder, "run.csv"), shown(&self.folder, REPORT)));
        lines.extend(self.model.as_ref().map(|path| format!("wrote the corrected model to {}", path.display())));
        lines.join("\n")
    }
}

/// The name of a file in a folder, for people.
fn shown(folder: &Path, name: &str) -> String {
    folder.join(name).display().to_string()
}

/// Why the loop ended, for people.
fn in_words(reason: Reason) -> &'static str {
    match reason {
        Reason::Reached => "the verdict is confirmed and certain enough",
        Reason::WrongModelOrLog => "model and measurements do not belong together",
        Reason::OtherArm => {
            "the error is above half of what the measured positions vary by: is this the model of the arm, and are its poses those of the tool in the base?"
        }
        Reason::NoLookLeft => {
            "all looks are used; repeat with a larger --goal, or with more --looks in another --folder"
        }
    }
}
