//! Each mechanism alone: whether its own law explains it in one of a few draws, and whether one outside the list gets a name.

use anyhow::{Context as _, Result};
use darm_diagnose::diagnosis;
use darm_diagnose::diagnosis::diagnose;
use darm_diagnose::truth::{Blind, Kind};
use darm_figures::figure::Figure;
use darm_figures::items::Job;
use darm_figures::shard::Shard;
use serde::{Deserialize, Serialize};

use super::arms::{self, Subject};
use super::case::Class;
use super::judge::{self, Mark};

/// Of this many seeds one must be a case that the law alone explains: sizes and conditions are drawn.
const CASES: u64 = 4;

/// All mechanisms, from a first seed on.
#[derive(Serialize, Deserialize)]
pub(crate) struct Mechanisms {
    pub(super) first_seed: u64,
}

/// What came of one mechanism.
#[derive(Serialize, Deserialize)]
pub(crate) struct Answer {
    mechanism: String,
    is_right: bool,
    answers: Vec<String>,
}

/// Mechanisms inside the list, then those outside.
fn kinds() -> Vec<Kind> {
    Blind::INSIDE.iter().chain(&Blind::OUTSIDE).copied().collect()
}

fn is_inside(kind: Kind) -> bool {
    Blind::INSIDE.contains(&kind)
}

/// A mechanism in the planar arm; on a servo where it needs one.
pub(super) fn mark(subjects: &[Subject; 3], kind: Kind, seed: u64) -> Result<Mark> {
    let subject = if kind == Kind::JointOffset { &subjects[2] } else { &subjects[0] };
    let blind = Blind::draw(&subject.arm, subject.steps(seed), &[kind], seed)?;
    let diagnosis = diagnose(&subject.arm, blind.measured(), &diagnosis::PoseOptions::default())?;
    let class = if is_inside(kind) { Class::One } else { Class::Outside };
    judge::mark(&subject.arm, class, &blind, &diagnosis)
}

impl Job for Mechanisms {
    const COMMAND: &'static str = "blind --mechanisms";
    type Bench = [Subject; 3];
    type Outcome = Answer;

    fn items(&self) -> Result<Vec<String>> {
        Ok(kinds().iter().map(|kind| format!("{kind:?}")).collect())
    }

    fn bench(&self, _: Shard) -> Result<[Subject; 3]> {
        arms::subjects()
    }

    fn run(&self, subjects: &[Subject; 3], item: usize) -> Result<Answer> {
        let kind = *kinds().get(item).context("no such mechanism")?;
        let (mut answers, mut is_right) = (Vec::new(), false);
        let seeds = self.first_seed..self.first_seed + if is_inside(kind) { CASES } else { 1 };
        for seed in seeds {
            let mark = mark(subjects, kind, seed)?;
            is_right = if is_inside(kind) { mark.placed } else { mark.named };
            answers.push(mark.answer);
            if is_right {
                break;
            }
        }
        Ok(Answer { mechanism: format!("{kind:?}"), is_right, answers })
    }

    fn figures(&self, answers: &[Answer]) -> Result<Vec<Figure>> {
        for answer in answers.iter().filter(|answer| !answer.is_right) {
            println!("{}: {}", answer.mechanism, answer.answers.join("; "));
        }
        let wrong = |inside: bool| {
            let own = kinds().into_iter().zip(answers).filter(|(kind, _)| is_inside(*kind) == inside);
            own.filter(|(_, answer)| !answer.is_right).count() as f64
        };
        Ok(vec![
            Figure::new("blind: mechanisms without a case that their own law alone explains", wrong(true), "")?,
            Figure::new("blind: mechanisms outside the list that are given a name", wrong(false), "")?,
        ])
    }

    fn seed(&self) -> u64 {
        self.first_seed
    }
}
