//! Arms without an effect: whether the loop says so.

use anyhow::{Context as _, Result};
use darm_diagnose::calibrate::{CalibrateOptions, Task};
use darm_diagnose::outcome::Verdict;
use darm_diagnose::truth::Blind;
use darm_figures::figure::Figure;
use darm_figures::items::Job;
use darm_figures::shard::Shard;
use serde::{Deserialize, Serialize};

use super::demo::median_or_nan;
use super::{Simulated, calibrate};
use crate::blind::{Subject, rate, subjects};

/// Arms from a first seed on, in turn the planar, the spatial and the hybrid one.
#[derive(Serialize, Deserialize)]
pub(crate) struct Clean {
    pub(super) arms: u64,
    pub(super) first_seed: u64,
}

/// What came of one arm.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Answer {
    pub(super) verdict: String,
    pub(super) is_alarm: bool,
    is_open: bool,
    visits: usize,
}

impl Job for Clean {
    const COMMAND: &'static str = "calibrate --clean";
    type Bench = [Subject; 3];
    type Outcome = Answer;

    fn items(&self) -> Result<Vec<String>> {
        Ok((0..self.arms).map(|arm| format!("clean arm {}", self.first_seed + arm)).collect())
    }

    fn bench(&self, _: Shard) -> Result<[Subject; 3]> {
        subjects()
    }

    fn run(&self, subjects: &[Subject; 3], item: usize) -> Result<Answer> {
        let seed = self.first_seed + item as u64;
        let subject = &subjects[item % subjects.len()];
        let options = CalibrateOptions { seed, ..CalibrateOptions::default() };
        let truth = Blind::draw(&subject.arm, subject.steps(seed), &[], seed)?;
        let frames = subject.frames(seed);
        let task = Task { arm: &subject.arm, frames: &frames, options: &options };
        let mut last = None;
        calibrate(&task, &mut Simulated::new(&subject.arm, &truth, seed), |look, visits| {
            last = Some((look.outcome.diagnosis.verdict, visits));
            true
        })?;
        let (verdict, visits) = last.context("a loop has a look")?;
        let is_open = verdict == Verdict::TooLittleData;
        Ok(Answer { verdict: verdict.to_string(), is_alarm: verdict != Verdict::NoEffect && !is_open, is_open, visits })
    }

    fn figures(&self, answers: &[Answer]) -> Result<Vec<Figure>> {
        for (arm, answer) in answers.iter().enumerate().filter(|(_, answer)| answer.is_alarm || answer.is_open) {
            println!("clean arm {}: {}", self.first_seed + arm as u64, answer.verdict);
        }
        let n = answers.len();
        let rate_of = |name: &str, is: fn(&Answer) -> bool| {
            rate(&format!("calibrate: {name}"), answers.iter().filter(|answer| is(answer)).count(), n)
        };
        Ok(vec![
            rate_of("false alarms of the complete loop on clean arms", |answer| answer.is_alarm)?,
            rate_of("clean arms without a verdict", |answer| answer.is_open)?,
            Figure::new(
                "calibrate: visits of a clean arm, median",
                median_or_nan(answers.iter().map(|answer| answer.visits as f64)),
                "visits",
            )?,
        ])
    }

    fn seed(&self) -> u64 {
        self.first_seed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sample; `calibrate --clean` has all of them.
    #[test]
    fn a_clean_arm_gets_no_name() {
        let job = Clean { arms: 1, first_seed: 1 };
        let answer = job.run(&job.bench(Shard::ALL).unwrap(), 0).unwrap();
        assert_eq!(answer.verdict, "no-effect");
    }
}
