//! The loop on the paper's arm, simulated.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use darm_arm::arm::frames::{self, DesiredFrame};
use darm_core::units::Word;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::effect::LawName;
use crate::truth::{Kind, Truth};
use darm_measure::poses::{self, Which};
use darm_measure::table::Table;
use darm_measure::write_text;

fn arm() -> Arm {
    Arm::parse(Path::new("planar4.toml"), include_str!("../../../../examples/planar4.toml")).unwrap()
}

fn desired(arm: &Arm) -> Vec<DesiredFrame> {
    frames::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/planar4-frames.toml"), arm).unwrap()
}

/// A simulated arm that was visited so far.
struct Simulated {
    truth: Truth,
    visited: Vec<PlanStep>,
}

impl Station for Simulated {
    type Error = darm_core::chain::ChainError;

    fn measure(&mut self, visits: &[PlanStep]) -> Result<Vec<Sample>, Self::Error> {
        let from = self.visited.len();
        self.visited.extend_from_slice(visits);
        Ok(self.truth.measure(&self.visited, 0.0, 7)?.samples.split_off(from))
    }
}

/// What is read again of a state that was written.
fn reread(state: &State) -> State {
    let text = write_text(&state.run);
    let (table, _) = Table::read_text(Path::new("run.csv"), text.as_bytes(), &Default::default()).unwrap();
    let run = poses::of_table(&table, &Which::default()).unwrap().0;
    State { run: Run { lines: Vec::new(), choice: Default::default(), ..run }, looks: state.looks }
}

/// Calibrates; with `stops` every look is made twice, from what was written and read again.
fn calibrate(kind: Kind, goal_m: Option<f64>, stops: bool) -> (Vec<Look>, Vec<PlanStep>) {
    let arm = arm();
    let frames = desired(&arm);
    let options = CalibrateOptions { goal_m, ..CalibrateOptions::default() };
    let task = Task { arm: &arm, frames: &frames, options: &options };
    let truth = Truth::draw(&arm, &frames, 3, Some(kind)).unwrap();
    let mut station = Simulated { truth, visited: Vec::new() };
    let (mut state, mut visits, mut looks) = (State::default(), task.first().unwrap(), Vec::new());
    loop {
        state = reread(&state.with(station.measure(&visits).unwrap()));
        if stops {
            state = reread(&state);
            let first = task.first().unwrap();
            assert_eq!(first, station.visited[..first.len()]);
        }
        looks.push(look(&task, &state, &Progress::default()).unwrap());
        match &looks[looks.len() - 1].next {
            Next::Measure(next) => visits.clone_from(next),
            Next::Stop(_) => return (looks, station.visited),
        }
    }
}

#[test]
fn an_effect_is_confirmed_in_a_third_of_the_visits_of_a_measurement_plan() {
    let (looks, visited) = calibrate(Kind::StrokeLoss, None, false);
    let last = &looks[looks.len() - 1];
    assert_eq!(last.next, Next::Stop(Reason::Reached));
    assert_eq!(last.outcome.diagnosis.verdict, Verdict::EffectFound);
    assert_eq!(last.outcome.diagnosis.effects[0].law, LawName::named("stroke-loss").unwrap());
    assert!(last.uncertainty_m.unwrap() <= last.goal_m);
    assert!(visited.len() <= 124, "{}", visited.len());
}

#[test]
fn a_loop_that_was_stopped_after_each_look_gives_the_same() {
    let goal_m = Some(2e-5);
    let (whole, visited) = calibrate(Kind::Play, goal_m, false);
    let (resumed, again) = calibrate(Kind::Play, goal_m, true);
    assert!(whole.len() > 2, "{} looks", whole.len());
    assert_eq!(whole, resumed);
    assert_eq!(visited, again);
}

#[test]
fn the_words_that_are_held_out_are_so_for_good_and_fixed_before_any_value() {
    let of = |steps: &[PlanStep], held_out: bool| -> BTreeSet<Word> {
        steps.iter().filter(|step| step.held_out == held_out).map(|step| step.word).collect()
    };
    let (_, one) = calibrate(Kind::StrokeLoss, Some(4e-5), false);
    let (_, other) = calibrate(Kind::Play, Some(4e-5), false);
    assert_ne!(one, other);
    for steps in [&one, &other] {
        assert!(of(steps, true).len() >= 12 && !steps.iter().any(|step| step.held_out && step.repeat));
    }
    // Whatever was measured, a word that one loop holds out is training in no other.
    assert!(of(&one, true).is_disjoint(&of(&one, false)));
    assert!(of(&one, true).is_disjoint(&of(&other, false)) && of(&other, true).is_disjoint(&of(&one, false)));
}

#[test]
fn an_arm_without_an_effect_is_left_alone_before_all_looks_are_used() {
    let (looks, _) = calibrate(Kind::Nothing, None, false);
    let last = &looks[looks.len() - 1];
    assert_eq!((last.outcome.diagnosis.verdict, &last.next), (Verdict::NoEffect, &Next::Stop(Reason::Reached)));
    assert!(looks.len() < CalibrateOptions::default().looks, "{}", looks.len());
    // Each look has less to spend than one diagnosis.
    assert!(looks.iter().map(|look| look.share).sum::<f64>() < 1.0);
}

#[test]
fn a_board_that_was_started_again_does_not_turn_time_back() {
    let arm = arm();
    let visits = [PlanStep {
        word: arm.rest(),
        previous: arm.rest(),
        servos_rad: vec![],
        load_kg: None,
        held_out: false,
        repeat: false,
    }];
    let at = |time_s| {
        let mut samples = crate::measurement_plan::as_run(&arm, &visits, 6e5, 293.0).samples;
        samples[0].time_s = time_s;
        samples
    };
    let state = State::default().with(at(50.0)).with(at(60.0)).with(at(2.0));
    let times: Vec<f64> = state.run.samples.iter().map(|sample| sample.time_s).collect();
    assert_eq!((times, state.looks), (vec![50.0, 60.0, 61.0], 3));
}

#[test]
fn an_arm_whose_positions_the_model_does_not_predict_at_all_is_looked_at_once() {
    let arm = arm();
    let frames = desired(&arm);
    let task = Task { arm: &arm, frames: &frames, options: &CalibrateOptions::default() };
    let truth = Truth::draw(&arm, &frames, 3, Some(Kind::Nothing)).unwrap();
    let mut station = Simulated { truth, visited: Vec::new() };
    let mut samples = station.measure(&task.first().unwrap()).unwrap();
    // Another arm: where its tool goes depends on the word in another way.
    let mut other = ChaCha8Rng::seed_from_u64(5);
    let mut places = BTreeMap::new();
    for sample in &mut samples {
        let place = places.entry(sample.word).or_insert_with(|| other.random::<[f64; 2]>());
        sample.pose.position.x = 0.6 * (place[0] - 0.5);
        sample.pose.position.y = 0.6 * (place[1] - 0.5);
    }
    let found = look(&task, &State::default().with(samples), &Progress::default()).unwrap();
    assert_eq!(found.next, Next::Stop(Reason::OtherArm), "{}", found.outcome.diagnosis.verdict);
}
