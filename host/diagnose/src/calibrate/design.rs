//! Which words are visited next: the most informative about what the rows so far leave open.
//!
//! - The words that compete are parted before anything is measured, by seed and number alone: some are held out for good, the
//!   others are for training. A word stays what it is in every look.
//! - Before anything is found they are chosen for the values of every candidate effect, given the rows so far.
//! - Once the training rows have chosen effects, most words are chosen for the values of these and of what would explain the
//!   rows as well, the others as before, so that a second effect can show. Held-out rows choose nothing.
//! - The most informative training words are repeated in a row, for the repeatability.

use darm_arm::arm::{Arm, ArmModel};
use darm_core::effect::Effect;
use darm_core::effect::law_name::LawName;
use darm_core::units::Word;
use nalgebra::DMatrix;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use super::rows::{PlannedRows, Rows, Slopes};
use super::{Found, Task};
use crate::linearise::arm_candidates;
use crate::measurement_plan::optimal_design::informative_first;
use crate::measurement_plan::order::rounds;
use crate::measurement_plan::{AWAY, LIKELY, PlanStep, drawn, held_out_and_training, servo_positions};
use crate::prepare::observations::NoPose;
use darm_measure::Run;

/// Words that compete for the effects found, and of these for any effect: the latter has many more values.
const COMPETING: usize = 4096;
const COMPETING_FOR_ANY: usize = 512;
/// Share of the words that are held out: of those that compete and of the first look, which has to confirm by itself; of
/// each look after it.
const HOLD_OUT: f64 = 0.25;
const HOLD_OUT_LATER: f64 = 0.125;
/// Training words that are repeated in a row: in the first look, in each after it, and how often.
const REPEATED: usize = 4;
const REPEATED_LATER: usize = 2;
const REPEATS: usize = 4;
/// Share of the words that are chosen for the effects found.
const FOR_FOUND: f64 = 0.9;
/// Weight of the prior on the values found: next to none, the rows so far give their information.
const FLOOR: f64 = 1e-8;

/// The words that compete, parted for good.
pub(super) struct Design {
    steps: Vec<PlanStep>,
    is_held_out: Vec<bool>,
}

impl Design {
    /// The words of an arm, drawn and parted by `seed`.
    pub(super) fn new(arm: &Arm, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let steps = drawn(arm, seed, COMPETING);
        let words: Vec<Word> = steps.iter().map(|step| step.word).collect();
        let mut drawn: Vec<usize> = (0..words.len()).collect();
        drawn.shuffle(&mut rng);
        let n_held_out = (HOLD_OUT * words.len() as f64).round() as usize;
        let (held_out, _) = held_out_and_training(&words, drawn, n_held_out);
        let mut is_held_out = vec![false; words.len()];
        held_out.into_iter().for_each(|word| is_held_out[word] = true);
        Self { steps, is_held_out }
    }

    /// Words that compete for any effect.
    pub(super) fn steps(mut self) -> Vec<PlanStep> {
        self.steps.truncate(COMPETING_FOR_ANY);
        self.steps
    }

    /// The visits of look number `look`, counted from 0, after what was measured and `found` in it.
    pub(super) fn next(
        &self,
        task: &Task,
        run: &Run,
        found: Option<&Found>,
        look: usize,
    ) -> Result<Vec<PlanStep>, NoPose> {
        let (visits, n_repeated, share) = match look {
            0 => (task.options.first_visits, REPEATED, HOLD_OUT),
            _ => (task.options.visits, REPEATED_LATER, HOLD_OUT_LATER),
        };
        let n_words = visits.saturating_sub(n_repeated * REPEATS).max(1);
        let n_held_out = (share * n_words as f64) as usize;
        let held_out = self.chosen(task, run, found, (true, n_held_out))?;
        let training = self.chosen(task, run, found, (false, n_words - n_held_out))?;
        let repeated: Vec<Word> = training.iter().take(n_repeated).map(|&step| self.steps[step].word).collect();
        let steps: Vec<&PlanStep> = training.iter().chain(&held_out).map(|&step| &self.steps[step]).collect();
        let words: Vec<Word> = steps.iter().map(|step| step.word).collect();
        // An arm of few words visits them more than once.
        let n_rounds = (n_words / words.len().max(1)).max(1);
        let mut rng = ChaCha8Rng::seed_from_u64(task.options.seed ^ ((look as u64 + 1) << 32));
        let servos_rad = servo_positions(task.arm, look);
        let mut visits: Vec<PlanStep> = Vec::new();
        for (round, order) in rounds(&words, n_rounds, task.arm.rest(), &mut rng).into_iter().enumerate() {
            for index in order {
                let word = words[index];
                let previous = visits.last().map_or(task.arm.rest(), |step| step.word);
                let held_out = index >= training.len();
                let step = PlanStep { previous, held_out, servos_rad: servos_rad.clone(), ..steps[index].clone() };
                let repeat = PlanStep { previous: word, repeat: true, ..step.clone() };
                visits.push(step);
                let is_repeated = round == 0 && !held_out && repeated.contains(&word);
                visits.extend(std::iter::repeat_n(repeat, if is_repeated { REPEATS } else { 0 }));
            }
        }
        Ok(visits)
    }

    /// The numbers of `n` words that are held out, or of others, the most informative first.
    fn chosen(
        &self,
        task: &Task,
        run: &Run,
        found: Option<&Found>,
        (held_out, n): (bool, usize),
    ) -> Result<Vec<usize>, NoPose> {
        let of_sort = |step: &usize| self.is_held_out[*step] == held_out;
        let mut open: Vec<usize> = (0..self.steps.len()).filter(of_sort).collect();
        let mut chosen = Vec::new();
        if let Some(found) = found {
            let steps: Vec<PlanStep> = open.iter().map(|&step| self.steps[step].clone()).collect();
            let (conditions, sigma) = (run.settled_or_nominal(task.arm), found.sigma());
            let rows = Rows::new(task.arm, run, &PlannedRows { frames: &[], next: &steps, conditions, sigma });
            let slopes = rows.slopes(&rows.sensitivity(found.model())?, &found.values());
            let information = slopes.information();
            let floor = DMatrix::from_diagonal(&information.diagonal().map(|d| FLOOR * d.max(f64::MIN_POSITIVE)));
            let n_found = (FOR_FOUND * n as f64).ceil() as usize;
            chosen.extend(informative(&rows, &slopes, information + floor, n_found).into_iter().map(|k| open[k]));
            open.retain(|step| !chosen.contains(step));
        }
        open.truncate(COMPETING_FOR_ANY);
        let steps: Vec<PlanStep> = open.iter().map(|&step| self.steps[step].clone()).collect();
        let (conditions, sigma) = (away(task.arm), task.sigma(run));
        let rows = Rows::new(task.arm, run, &PlannedRows { frames: &[], next: &steps, conditions, sigma });
        let values: Vec<_> = any(&task.arm.model).flat_map(values_of).collect();
        let slopes = rows.slopes(&rows.sensitivity(&task.arm.model)?, &values).scaled(LIKELY);
        let information = slopes.information() + DMatrix::identity(slopes.n_values(), slopes.n_values());
        let n_other = n.saturating_sub(chosen.len());
        chosen.extend(informative(&rows, &slopes, information, n_other).into_iter().map(|k| open[k]));
        Ok(chosen)
    }
}

/// The numbers of the steps that add most to this information, the most informative first.
fn informative(rows: &Rows, slopes: &Slopes, information: DMatrix<f64>, n: usize) -> Vec<usize> {
    let Some(covariance) = information.clone().try_inverse() else { return Vec::new() };
    let (steps, measurements): (Vec<usize>, Vec<DMatrix<f64>>) =
        rows.next().map(|(row, step)| (step, slopes.row(row))).unzip();
    informative_first(covariance, &measurements, n).into_iter().map(|k| steps[k]).collect()
}

/// Away from nominal supply and temperature, so that effects of either show.
fn away(arm: &Arm) -> (f64, f64) {
    (AWAY.0 * arm.model.nominal_supply, arm.model.reference_temperature_k + AWAY.1)
}

/// Every candidate. Interactions are left out, as in a measurement plan.
pub(super) fn any(model: &ArmModel) -> impl Iterator<Item = Effect<f64>> {
    arm_candidates::all(model).into_iter().filter(|effect| effect.name() != LawName::Interaction)
}

/// All values of an effect.
pub(super) fn values_of(effect: Effect<f64>) -> impl Iterator<Item = (Effect<f64>, usize)> {
    (0..effect.values().len()).map(move |value| (effect, value))
}
