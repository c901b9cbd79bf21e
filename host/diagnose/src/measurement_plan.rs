//! The measurement plan: which words an arm visits, in which order, so that any effect missing in its model can be found.
//!
//! - The words are chosen for information about the values of every candidate effect at once (D-optimality over random
//!   words, see [`design`](crate::measurement_plan::optimal_design)); on a small arm all words are taken.
//! - Every word is visited a few times, each time after another word, so that memory of the word before shows; the
//!   order is chosen so that each actuator comes to each word both moved and unmoved where that can be.
//! - Some words are held for a few more visits in a row, with nothing changed: they measure the repeatability.
//! - A share of the words is drawn before anything is measured, each state of each actuator among them, and held out of every
//!   fit.
//! - Servo joints stand elsewhere in each round of visits.

pub mod optimal_design;
pub(crate) mod order;

use std::collections::BTreeMap;

use darm_core::effect::law_name::LawName;
use darm_core::model::Condition;
use darm_core::units::Word;
use nalgebra::DMatrix;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::error::MIN_WORDS;
use crate::linearise::arm_candidates;
use crate::linearise::sensitivity::Sensitivity;
use crate::measurement_plan::optimal_design::informative_first;
use crate::prepare::observations::Observations;
use darm_arm::arm::{Arm, ArmScratch, ZERO_CELSIUS};
use darm_arm::plan::Visit;
use darm_measure::visit_table::PlannedVisit;
use darm_measure::{Run, Sample};

/// Words that compete for a place in a measurement plan.
const COMPETING: usize = 512;
/// Noise that the words are chosen for: 0.02° and 0.2 mm; only the ratio of the two matters.
pub(crate) const NOISE: [f64; 6] = [3.5e-4, 3.5e-4, 3.5e-4, 2e-4, 2e-4, 2e-4];
/// Supply (share of nominal) and temperature rise (K) that the words are chosen at.
pub(crate) const AWAY: (f64, f64) = (0.9, 10.0);
/// Size of an effect that is thought likely, in units of the noise.
pub(crate) const LIKELY: f64 = 20.0;
/// Held-out words that each state of each actuator is in, so that more than one shows an effect in that state.
const SHOWN_IN: usize = 2;
/// Share of a servo's range that it is moved by to either side.
const SERVO_SHARE: f64 = 0.3;

/// How large a measurement plan is.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanOptions {
    /// Different words.
    pub words: usize,
    /// Visits of each, after different words.
    pub visits: usize,
    /// Words that are repeated in a row.
    pub repeated_words: usize,
    /// Further visits of these, in a row.
    pub repeats: usize,
    /// Share of the words that no fit sees.
    pub hold_out: f64,
    /// Of all that is drawn.
    pub seed: u64,
}

impl Default for PlanOptions {
    fn default() -> Self {
        Self { words: 96, visits: 3, repeated_words: 12, repeats: 7, hold_out: 0.25, seed: 1 }
    }
}

/// A measurement plan of so few words that no diagnosis could be made of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", self.sentence())]
pub struct TooFewToPlan {
    /// Words that the arm has; of a large arm, that compete for a place.
    pub of_arm: usize,
    /// Words that the plan was to have.
    pub wanted: usize,
    /// Words that a plan needs at least.
    pub needed: usize,
}

impl TooFewToPlan {
    fn sentence(&self) -> String {
        let Self { of_arm, wanted, needed } = self;
        if of_arm < needed {
            return format!(
                "the arm has {of_arm} words, and a diagnosis needs a plan of {needed} to distinguish an effect from chance; \
                 measure single words by `--words`, and compare them with `darm fk`"
            );
        }
        format!("a plan of {wanted} words is too small to distinguish an effect from chance; give at least {needed}")
    }
}

/// One visit of a word.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanStep {
    /// The word.
    pub word: Word,
    /// The word before it; at first the word at rest.
    pub previous: Word,
    /// Positions of the servo joints.
    pub servos_rad: Vec<f64>,
    /// What the tool carries in addition to the payload of the model, kg; `None`: nothing is known of it.
    pub load_kg: Option<f64>,
    /// Whether no fit may see it.
    pub held_out: bool,
    /// Whether it repeats the step before, so that nothing moves.
    pub repeat: bool,
}

impl PlanStep {
    /// A visit of a word from the same word, without servos.
    fn of_word(word: Word) -> Self {
        Self { word, previous: word, servos_rad: Vec::new(), load_kg: None, held_out: false, repeat: false }
    }
}

/// The steps of a measurement plan for `arm`, in order.
pub fn plan(arm: &Arm, options: &PlanOptions) -> Vec<PlanStep> {
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    let words = informative_words(arm, options);
    let mut drawn: Vec<usize> = (0..words.len()).collect();
    drawn.shuffle(&mut rng);
    let n_held_out = (options.hold_out * words.len() as f64).round() as usize;
    let (held_out, training) = held_out_and_training(&words, drawn, n_held_out.min(words.len()));
    let repeated = &training[..options.repeated_words.min(training.len())];
    let mut steps: Vec<PlanStep> = Vec::new();
    for (round, order) in order::rounds(&words, options.visits, arm.rest(), &mut rng).into_iter().enumerate() {
        let servos_rad = servo_positions(arm, round);
        for index in order {
            let previous = steps.last().map_or(arm.rest(), |step| step.word);
            let held_out = held_out.contains(&index);
            let servos_rad = servos_rad.clone();
            let step = PlanStep { word: words[index], previous, servos_rad, load_kg: None, held_out, repeat: false };
            let in_turn = repeated.iter().position(|&word| word == index);
            let again = in_turn.is_some_and(|position| position % options.visits == round);
            let repeat = PlanStep { previous: words[index], repeat: true, ..step.clone() };
            steps.push(step);
            steps.extend(std::iter::repeat_n(repeat, if again { options.repeats } else { 0 }));
        }
    }
    steps
}

/// The visits of a measurement plan, each for `dwell_s`.
///
/// # Errors
///
/// [`TooFewToPlan`]: no diagnosis could be made of its words.
pub fn measurement_visits(arm: &Arm, options: &PlanOptions, dwell_s: f64) -> Result<Vec<PlannedVisit>, TooFewToPlan> {
    let n_words = candidates(arm, options.seed).len();
    let n_held_out = |n_words: usize| (options.hold_out * n_words as f64).round() as usize;
    let is_enough = |n_words: usize| n_words.saturating_sub(n_held_out(n_words)) >= MIN_WORDS;
    if !is_enough(n_words.min(options.words)) {
        // Where all words are held out, none suffice.
        let needed = (MIN_WORDS..=COMPETING).find(|&n_words| is_enough(n_words)).unwrap_or(COMPETING);
        return Err(TooFewToPlan { of_arm: n_words, wanted: options.words, needed });
    }
    let visit = |(number, step): (usize, PlanStep)| PlannedVisit {
        held_out: step.held_out,
        visit: Visit { word: step.word, servos_rad: step.servos_rad, dwell_s, label: format!("visit {number}") },
    };
    Ok(plan(arm, options).into_iter().enumerate().map(visit).collect())
}

/// Parts the numbers of words, in the order in which they were drawn, into `n` that are held out and the others. Each state
/// of each actuator is in [`SHOWN_IN`] of the former where that can be and leaves one to the latter, since an effect in one
/// state shows in no word without it.
pub(crate) fn held_out_and_training(words: &[Word], drawn: Vec<usize>, n: usize) -> (Vec<usize>, Vec<usize>) {
    let states = |&word: &usize| words[word].iter().enumerate();
    let mut wanted: BTreeMap<(usize, u8), usize> = BTreeMap::new();
    drawn.iter().flat_map(states).for_each(|state| *wanted.entry(state).or_default() += 1);
    wanted.values_mut().for_each(|count| *count = (*count - 1).min(SHOWN_IN));
    let (first, others): (Vec<usize>, Vec<usize>) = drawn.into_iter().partition(|word| {
        let is_wanted = states(word).any(|state| wanted[&state] > 0);
        for state in states(word) {
            wanted.entry(state).and_modify(|count| *count = count.saturating_sub(1));
        }
        is_wanted
    });
    let mut all = [first, others].concat();
    let training = all.split_off(n);
    (all, training)
}

/// Words, each once, that could be visited: all of them where there are few, else as many as are worth weighing.
pub fn candidates(arm: &Arm, seed: u64) -> Vec<PlanStep> {
    drawn(arm, seed, COMPETING)
}

/// Words, each once, that could be visited: all of them, or `n` drawn ones where there are more.
pub(crate) fn drawn(arm: &Arm, seed: u64, n: usize) -> Vec<PlanStep> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let states: Vec<u64> = (0..arm.n_actuators()).map(|k| arm.model.chain.n_states(k) as u64).collect();
    let n_words = states.iter().try_fold(1u64, |n, &states| n.checked_mul(states)).unwrap_or(u64::MAX);
    let mut words: Vec<Word> = if n_words <= n as u64 {
        (0..n_words).map(|number| word(&states, number)).collect()
    } else {
        (0..n).map(|_| word(&states, rng.random_range(0..n_words))).collect()
    };
    words.sort();
    words.dedup();
    let servos_rad = servo_positions(arm, 0);
    let mut scratch = ArmScratch::default();
    words.retain(|word| arm.model.predict(&arm.model.nominal(*word, &servos_rad), &mut scratch).is_ok());
    words.shuffle(&mut rng);
    let previous = words.iter().cycle().skip(1).copied().take(words.len()).collect::<Vec<_>>();
    let step =
        |(word, previous)| PlanStep { word, previous, servos_rad: servos_rad.clone(), ..PlanStep::of_word(word) };
    words.into_iter().zip(previous).map(step).collect()
}

/// The word with this number, written with as many states as each digit has.
fn word(states: &[u64], mut number: u64) -> Word {
    let digits: Vec<u8> = states
        .iter()
        .map(|states| {
            let digit = number % states.max(&1);
            number /= states.max(&1);
            digit as u8
        })
        .collect();
    Word::new(&digits).expect("an arm has no more actuators than a word has digits")
}

/// The words that are most informative about all candidate effects together.
fn informative_words(arm: &Arm, options: &PlanOptions) -> Vec<Word> {
    let steps = candidates(arm, options.seed);
    if steps.len() <= options.words {
        return steps.into_iter().map(|step| step.word).collect();
    }
    let observations = Observations::new(arm, &run_off_nominal(arm, &steps), NOISE, |_| true);
    let columns = candidate_columns(arm, &observations);
    let n_axes = observations.n_axes();
    let measurements: Vec<DMatrix<f64>> = (0..observations.rows.len())
        .map(|row| DMatrix::from_fn(n_axes, columns.len(), |axis, column| columns[column][row * n_axes + axis]))
        .collect();
    let chosen = informative_first(DMatrix::identity(columns.len(), columns.len()), &measurements, options.words);
    chosen.into_iter().map(|row| steps[observations.rows[row].sample].word).collect()
}

/// The derivatives with respect to the values of all candidates, each scaled to the size that is thought likely. Interactions
/// are left out: there are as many as pairs of actuators, and any words have each pair of states about equally often.
fn candidate_columns(arm: &Arm, observations: &Observations) -> Vec<Vec<f64>> {
    let mut scratch = ArmScratch::default();
    let Ok(sensitivity) = Sensitivity::new(&arm.model, observations, &mut scratch) else {
        return Vec::new();
    };
    let mut effects = arm_candidates::all(&arm.model);
    effects.retain(|effect| effect.name() != LawName::Interaction);
    let values = effects.iter().flat_map(|effect| (0..effect.values().len()).map(move |value| (effect, value)));
    values.filter_map(|(effect, value)| sensitivity.column(effect, value)).map(likely).collect()
}

fn likely(column: Vec<f64>) -> Vec<f64> {
    let rms = (column.iter().map(|x| x * x).sum::<f64>() / column.len().max(1) as f64).sqrt();
    column.into_iter().map(|x| x * LIKELY / rms.max(f64::MIN_POSITIVE)).collect()
}

/// The word that the arm has come from in each step: in a repeat nothing moves, and the arm stays as it has come.
pub fn arrivals(steps: &[PlanStep]) -> Vec<Word> {
    let mut arrival = None;
    let from = |step: &PlanStep| *arrival.insert(arrival.filter(|_| step.repeat).unwrap_or(step.previous));
    steps.iter().map(from).collect()
}

/// The steps as an exact measurement of the arm as its model has it, at this supply and temperature.
pub fn as_run(arm: &Arm, steps: &[PlanStep], supply: f64, temperature_k: f64) -> Run {
    let mut scratch = ArmScratch::default();
    let mut samples = Vec::new();
    for (visit, (step, arrival)) in steps.iter().zip(arrivals(steps)).enumerate() {
        let nominal = arm.model.nominal(step.word, &step.servos_rad);
        let load_kg = step.load_kg.unwrap_or(0.0);
        let condition = Condition { previous: Some(arrival), supply, temperature_k, load_kg, ..nominal };
        let Ok(pose) = arm.model.predict(&condition, &mut scratch) else { continue };
        samples.push(Sample {
            time_s: visit as f64,
            word: step.word,
            previous: Some(step.previous),
            servos_rad: step.servos_rad.clone(),
            pose,
            supply: Some(supply),
            temperature_c: Some(temperature_k - ZERO_CELSIUS),
            load_kg: step.load_kg,
            strokes_s: Vec::new(),
            // No step follows the one before it: each has another word before it.
            run: visit as u32,
            visit: visit as u32,
            held_out: step.held_out,
        });
    }
    Run { samples, ..Run::default() }
}

/// The visits as a run away from nominal supply and temperature, so that effects of either show.
fn run_off_nominal(arm: &Arm, steps: &[PlanStep]) -> Run {
    as_run(arm, steps, AWAY.0 * arm.model.nominal_supply, arm.model.reference_temperature_k + AWAY.1)
}

/// Where the servos are in a round: in the middle of their range, then to one side and to the other.
pub(crate) fn servo_positions(arm: &Arm, round: usize) -> Vec<f64> {
    let side = [0.0, -SERVO_SHARE, SERVO_SHARE][round % 3];
    let position = |k: usize| {
        let servo = arm.servos.get(k)?;
        let (low, high) = (f64::from(servo.min_rad), f64::from(servo.max_rad));
        Some(0.5 * (low + high) + 0.5 * (high - low) * side)
    };
    (0..arm.n_servos()).map(|k| position(k).unwrap_or_default()).collect()
}

#[cfg(test)]
mod tests;
