//! What a residual may depend on: channels with their powers and waves, digits with their products, memory.
//!
//! | variable | shapes |
//! | --- | --- |
//! | time | straight; waves: a parabola and sin, cos of up to [`WAVES`] periods in the run; step: the best of [`MOMENTS`] |
//! | supply, temperature, load, position of a servo | straight; square: 1st and 2nd power |
//! | position of the tool, as the model has it | straight: x, y, z; square: these and their products |
//! | digit of an actuator | straight: one column for each state but the first |
//! | digits of two actuators | together: the product |
//! | word before, at an actuator; word before the last | straight: whether the actuator stayed, or is where it was then |
//! | word | each word by itself: whatever is not memory and not surroundings |

use std::f64::consts::TAU;

use darm_core::actuator::MAX_STATES;
use darm_core::effect::fitted_term::Variable;
use darm_core::units::Word;

use crate::judge::regression::Term;
use crate::outcome::{Regressor, Shape};
use crate::prepare::observations::{Observations, PoseRow};
use darm_arm::arm::{Arm, ArmScratch};
use darm_measure::Run;

/// Periods in a run.
pub const WAVES: usize = 8;
/// Moments that a step in time is looked for at.
pub const MOMENTS: usize = 15;

/// All terms for the rows of a run.
pub fn dictionary(arm: &Arm, run: &Run, observations: &Observations) -> Vec<Term> {
    let mut terms = surroundings(arm, observations);
    terms.extend(place_of_tool(arm, observations));
    terms.extend(digits(arm, observations));
    terms.extend(memory(arm, run, observations));
    let rows = &observations.rows;
    let word = |group| rows.iter().map(|row| flag(row.group == group)).collect();
    let columns = (1..observations.n_groups).map(word).collect();
    terms.push(Term { regressor: Regressor::Word, shape: Shape::EachWord, columns, kept: Vec::new() });
    terms
}

fn flag(is: bool) -> f64 {
    f64::from(u8::from(is))
}

/// Middle and half the range of some numbers: moved and scaled by these they lie within ±1, so that their powers differ.
fn scale(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    (0.5 * (low + high), (0.5 * (high - low)).max(f64::MIN_POSITIVE))
}

fn surroundings(arm: &Arm, observations: &Observations) -> Vec<Term> {
    let range = |value: &dyn Fn(&PoseRow) -> f64| scale(observations.rows.iter().map(value));
    let (supply, span) = range(&|row| observations.condition(row).supply);
    let (temperature, span_k) = range(&|row| observations.condition(row).temperature_k);
    let mut channels = vec![
        (Regressor::Supply, Variable::Supply { center: supply, span }),
        (Regressor::Temperature, Variable::Temperature { center: temperature, span: span_k }),
    ];
    for k in 0..arm.n_servos() {
        let (center, span) = range(&|row| observations.condition(row).servos[k]);
        channels.push((Regressor::Servo(k), Variable::Servo { servo: k as u8, center, span }));
    }
    let mut terms = Vec::new();
    for (regressor, of) in channels {
        let values = observations.rows.iter().map(|row| of.of(&observations.condition(row))).collect();
        terms.extend(straight_and_square(&regressor, values, Some(of)));
    }
    let load = |row: &PoseRow| observations.condition(row).load_kg;
    let (center, span) = range(&load);
    let loads = observations.rows.iter().map(|row| (load(row) - center) / span).collect();
    terms.extend(straight_and_square(&Regressor::Load, loads, None));
    let (middle_s, half_s) = scale(observations.times_s());
    terms.extend(time(observations.times_s().map(|time_s| (time_s - middle_s) / half_s).collect()));
    terms
}

/// Terms of where the tool is: a camera that sees lengths longer here than there, or one way than the other.
fn place_of_tool(arm: &Arm, observations: &Observations) -> Vec<Term> {
    let mut scratch = ArmScratch::default();
    let mut place = |row| arm.model.predict(&observations.condition(row), &mut scratch).map(|tool| tool.position);
    let Ok(places) = observations.rows.iter().map(&mut place).collect::<Result<Vec<_>, _>>() else { return Vec::new() };
    let along = |axis: usize| {
        let (center, span) = scale(places.iter().map(|place| place[axis]));
        places.iter().map(|place| (place[axis] - center) / span).collect::<Vec<f64>>()
    };
    let straight: Vec<Vec<f64>> =
        observations.axes.iter().filter(|axis| **axis >= 3).map(|axis| along(axis - 3)).collect();
    let product = |(a, b): (usize, usize)| straight[a].iter().zip(&straight[b]).map(|(a, b)| a * b).collect();
    let pairs = (0..straight.len()).flat_map(|a| (a..straight.len()).map(move |b| (a, b)));
    let square = straight.iter().cloned().chain(pairs.map(product)).collect();
    let term = |shape, columns| Term { regressor: Regressor::ToolPosition, shape, columns, kept: Vec::new() };
    vec![term(Shape::Square, square), term(Shape::Straight, straight)]
}

/// The two terms of a variable that is given from −1 to 1; `of` is what a model may keep of it.
fn straight_and_square(regressor: &Regressor, values: Vec<f64>, of: Option<Variable<f64>>) -> [Term; 2] {
    let squares = values.iter().map(|value| value * value).collect();
    let kept = |powers: &[bool]| powers.iter().filter_map(|&square| Some((of?, square))).collect();
    let term = |shape, columns, powers| Term { regressor: regressor.clone(), shape, columns, kept: kept(powers) };
    [term(Shape::Straight, vec![values.clone()], &[false]), term(Shape::Square, vec![values, squares], &[false, true])]
}

/// Terms of the time, given from −1 to 1.
fn time(times: Vec<f64>) -> Vec<Term> {
    let term = |shape, columns| Term { regressor: Regressor::Time, shape, columns, kept: Vec::new() };
    let of_times = |value: &dyn Fn(f64) -> f64| times.iter().map(|&t| value(t)).collect::<Vec<f64>>();
    let mut waves = vec![times.clone(), of_times(&|t| t * t)];
    for k in 1..=WAVES {
        let turn = 0.5 * TAU * k as f64;
        waves.extend([of_times(&|t| (turn * t).sin()), of_times(&|t| (turn * t).cos())]);
    }
    let moment = |k: usize| 2.0 * k as f64 / (MOMENTS + 1) as f64 - 1.0;
    let steps = (1..=MOMENTS).map(|k| term(Shape::Step, vec![of_times(&|t| flag(t >= moment(k)))]));
    let mut terms: Vec<Term> = steps.collect();
    terms.extend([term(Shape::Straight, vec![times.clone()]), term(Shape::Waves, waves)]);
    terms
}

/// Terms of the digits of one and of two actuators.
fn digits(arm: &Arm, observations: &Observations) -> Vec<Term> {
    let n = arm.n_actuators();
    let is = |k: usize, state: u8| -> Vec<f64> {
        observations.rows.iter().map(|row| flag(observations.condition(row).word.digit(k) == state)).collect()
    };
    let states = |k: usize| 1..arm.model.chain.n_states(k) as u8;
    let columns: Vec<Vec<Vec<f64>>> = (0..n).map(|k| states(k).map(|state| is(k, state)).collect()).collect();
    let digits = |first, second| (Variable::Digits { first, second }, false);
    let mut terms = Vec::new();
    for a in 0..n {
        for b in a + 1..n {
            let product = |x: &Vec<f64>, y: &Vec<f64>| x.iter().zip(y).map(|(x, y)| x * y).collect();
            let products = columns[a].iter().flat_map(|x| columns[b].iter().map(move |y| product(x, y))).collect();
            let both = |i| states(b).map(move |j| digits((a as u8, i), Some((b as u8, j))));
            terms.push(Term {
                regressor: Regressor::Digits([a, b]),
                shape: Shape::Together,
                columns: products,
                kept: states(a).flat_map(both).collect(),
            });
        }
        let kept = states(a).map(|state| digits((a as u8, state), None)).collect();
        terms.push(Term { regressor: Regressor::Digit(a), shape: Shape::Straight, columns: columns[a].clone(), kept });
    }
    terms
}

/// Terms of the word before and of the one before that.
fn memory(arm: &Arm, run: &Run, observations: &Observations) -> Vec<Term> {
    let second_last = second_last(run);
    let mut terms = Vec::new();
    for k in 0..arm.n_actuators() {
        let own: Vec<u8> = observations.rows.iter().map(|row| observations.condition(row).word.digit(k)).collect();
        let same = |earlier: &dyn Fn(&PoseRow) -> Option<Word>| -> Vec<f64> {
            let same = |(row, digit): (&PoseRow, &u8)| flag(earlier(row).is_some_and(|word| word.digit(k) == *digit));
            observations.rows.iter().zip(&own).map(same).collect()
        };
        let mut add = |regressor, same: &[f64], kept| {
            let columns = vec![less_mean_of_digit(same, &own)];
            terms.push(Term { regressor, shape: Shape::Straight, columns, kept });
        };
        let stayed = same(&|row| observations.condition(row).previous);
        let share = stayed.iter().sum::<f64>() / stayed.len().max(1) as f64;
        add(Regressor::WordBefore(k), &stayed, vec![(Variable::Stayed { actuator: k as u8, share }, false)]);
        add(Regressor::WordBeforeLast(k), &same(&|row| second_last[row.sample]), Vec::new());
    }
    terms
}

/// For each sample the word that stood before the one that it came from.
fn second_last(run: &Run) -> Vec<Option<Word>> {
    let (mut last, mut before) = (None, None);
    let follow = |sample: &darm_measure::Sample| {
        if let Some(previous) = sample.previous.filter(|previous| *previous != sample.word) {
            before = last.replace(previous);
        }
        before
    };
    run.samples.iter().map(follow).collect()
}

/// A variable less its mean among the rows with the same digit, and of the other sign where the digit is 0: actuators
/// come off their two stops in opposite directions.
fn less_mean_of_digit(values: &[f64], digits: &[u8]) -> Vec<f64> {
    let mean = |digit: u8| {
        let same = || values.iter().zip(digits).filter(|(_, other)| **other == digit);
        same().map(|(value, _)| value).sum::<f64>() / same().count().max(1) as f64
    };
    let means: Vec<f64> = (0..MAX_STATES as u8).map(mean).collect();
    let sign = |digit: u8| if digit == 0 { 1.0 } else { -1.0 };
    values.iter().zip(digits).map(|(value, &digit)| sign(digit) * (value - means[usize::from(digit)])).collect()
}
