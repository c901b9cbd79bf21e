//! The geometry least sensitive to errors of manufacturing, and the error of every frame that is to be expected.
//!
//! # Model
//!
//! E|Δp_k|² = Σ_i σ_i²·|v_ki|²,  E θ_k² = Σ_i σ_i²·|ω_ki|²,  (ω_ki, v_ki) = (T_k⁻¹·∂T_k/∂a_i)ᵛ
//!
//! | symbol | meaning |
//! | --- | --- |
//! | a_i | every stop, every coordinate of every anchor, in the plane two of them |
//! | σ_i | standard deviation of its error; the errors are independent |
//!
//! Linear propagation; [`Expected::sampled_m`] checks it by drawing arms. What is made least, along the directions in which
//! the stops may be altered without a frame noticing, weighs the errors against the metal that is moved for them:
//!
//! log₂ √(S/S₀) + (A² − A₀²)/W²,  S = Σ_k E|Δp_k|² + ℓ²·E θ_k²
//!
//! | symbol | meaning |
//! | --- | --- |
//! | S₀, A₀ | of the geometry with the least alteration |
//! | A | root of the sum of squares of what all stops were altered by, m |
//! | W | the alteration that half the error is worth, [`Tolerance::worth_m`] |

use darm_core::chain::Parameter;
use nalgebra::DVector;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::Serialize;

use super::needed_words::Needed;
use super::newton::{EXACT, SOLVED, Search};
use super::problem::Problem;
use super::{Found, Options, Synthesis, SynthesisError, answer};
use crate::arm::frames::DesiredFrame;
use crate::arm::{Arm, ArmScratch};

/// Steps towards the least sensitive geometry.
const STEPS: u32 = 60;
/// Interval of the differences of the sensitivity, m.
const INTERVAL: f64 = 1e-5;
/// Arms that are drawn to check the linear propagation.
const SAMPLES: u32 = 400;

/// Errors of manufacturing, standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Of a leg's or sliding joint's stop, m.
    pub stop_m: f64,
    /// Of a turning joint's stop, rad.
    pub stop_rad: f64,
    /// Of each coordinate of an anchor, m.
    pub anchor_m: f64,
    /// Stops may be altered by so much, as a root of the sum of squares, to halve the errors, m.
    pub worth_m: f64,
}

/// The error of one frame that is to be expected, root mean square.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Expected {
    /// Of the position by linear propagation, m.
    pub linear_m: f64,
    /// Of the orientation by linear propagation, rad.
    pub linear_rad: f64,
    /// Of the position over drawn arms, m.
    pub sampled_m: f64,
    /// Of the orientation over drawn arms, rad.
    pub sampled_rad: f64,
}

/// The errors that are to be expected of `arm` in its frames.
pub fn expected(arm: &Arm, frames: &[DesiredFrame], tolerance: &Tolerance, seed: u64) -> Vec<Expected> {
    let parameters = parameters(arm, tolerance);
    let mut sampled = vec![(0.0, 0.0, 0u32); frames.len()];
    let nominal: Vec<_> = frames.iter().map(|frame| pose(arm, frame)).collect();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    for _ in 0..SAMPLES {
        let mut made = arm.clone();
        for &(parameter, sigma) in &parameters {
            let off: f64 = StandardNormal.sample(&mut rng);
            shift(&mut made, parameter, sigma * off);
        }
        for ((sum, frame), nominal) in sampled.iter_mut().zip(frames).zip(&nominal) {
            if let (Some(made), Some(nominal)) = (pose(&made, frame), nominal) {
                let apart = nominal.to(&made);
                *sum = (sum.0 + apart.position.norm_squared(), sum.1 + apart.angle_rad().powi(2), sum.2 + 1);
            }
        }
    }
    let expected = |(frame, (square_m, square_rad, count)): (&DesiredFrame, (f64, f64, u32))| {
        let (linear_m, linear_rad) = linear(arm, frame, &parameters);
        let mean = |sum: f64| (sum / f64::from(count.max(1))).sqrt();
        Expected { linear_m, linear_rad, sampled_m: mean(square_m), sampled_rad: mean(square_rad) }
    };
    frames.iter().zip(sampled).map(expected).collect()
}

/// Shifts a parameter of the arm's own chain.
fn shift(arm: &mut Arm, parameter: Parameter, by: f64) {
    let chain = &mut arm.model.chain;
    let value = chain.get(parameter).expect("a parameter of this chain") + by;
    chain.set(parameter, value).expect("a parameter of this chain");
}

/// Alters the stops that `found` leaves free, until its frames are as little sensitive to errors of manufacturing as is
/// worth the alteration.
///
/// # Errors
///
/// `base_line` or `found` has no pose for the word of a frame.
pub fn minimize_sensitivity(
    base_line: &Arm,
    found: &Synthesis,
    tolerance: &Tolerance,
    options: &Options,
) -> Result<Synthesis, SynthesisError> {
    let frames: Vec<DesiredFrame> = found.frames.iter().map(|reached| reached.frame.clone()).collect();
    let mut problem = Problem::new(base_line, &frames, &options.bounds, &options.ranges);
    problem.servos_fixed = true;
    let before = problem.poses(&problem.start())?;
    let mut unknowns = problem.unknowns_of(&found.arm);
    problem.needed = Needed::new(base_line, &options.words);
    let keeps_words = problem.missed_m(&unknowns) == 0.0;
    let mut search = Search { problem: &mut problem, iterations: 0, keeps_words };
    let mut lowest = cost(search.problem, &unknowns, &frames, tolerance);
    let mut size = 0.05;
    for _ in 0..STEPS {
        if size < 1e-4 || options.handle.is_ended() {
            break;
        }
        let downhill = downhill(search.problem, &unknowns, &frames, tolerance);
        let wanted = &unknowns + downhill * size;
        let next = search.nearest(&unknowns, &wanted).and_then(|next| search.descend(&next, EXACT));
        let next = next.ok().filter(|(error, _)| *error < SOLVED);
        let next = next.map(|(_, next)| (cost(search.problem, &next, &frames, tolerance), next));
        match next.filter(|(cost, _)| *cost < lowest) {
            Some((lower, next)) => {
                (lowest, unknowns) = (lower, next);
                size *= 1.5;
            }
            None => size *= 0.3,
        }
    }
    let found_now = Found { unknowns, iterations: found.iterations + search.iterations, starts: found.starts };
    let answer = answer(&mut problem, &frames, &before, found.case.clone(), &found_now)?;
    Ok(Synthesis { time: found.time, ..answer })
}

/// The unit direction in which the cost falls.
fn downhill(problem: &mut Problem, unknowns: &DVector<f64>, frames: &[DesiredFrame], of: &Tolerance) -> DVector<f64> {
    let here = cost(problem, unknowns, frames, of);
    let mut direction = DVector::zeros(unknowns.len());
    for stop in 0..problem.n_stops() {
        let mut moved = unknowns.clone();
        moved[stop] += INTERVAL;
        direction[stop] = here - cost(problem, &moved, frames, of);
    }
    let length = direction.norm();
    if length.is_finite() && length > 0.0 { direction / length } else { DVector::zeros(unknowns.len()) }
}

/// What is to be made least, but for what does not change: errors halved, and alterations that are worth that.
fn cost(problem: &mut Problem, unknowns: &DVector<f64>, frames: &[DesiredFrame], of: &Tolerance) -> f64 {
    let altered = problem.alteration(unknowns) / of.worth_m;
    0.5 * sensitivity(problem, unknowns, frames, of).log2() + altered * altered
}

/// The sum over the frames of the mean squares that are to be expected, m².
fn sensitivity(problem: &mut Problem, unknowns: &DVector<f64>, frames: &[DesiredFrame], of: &Tolerance) -> f64 {
    let arm = problem.arm(unknowns);
    let parameters = parameters(&arm, of);
    let each = frames.iter().map(|frame| {
        let (metres, radians) = linear(&arm, frame, &parameters);
        metres * metres + (radians * arm.length_scale_m).powi(2)
    });
    each.sum()
}

/// Root mean squares of one frame by linear propagation; infinite where the word has no pose.
fn linear(arm: &Arm, frame: &DesiredFrame, parameters: &[(Parameter, f64)]) -> (f64, f64) {
    let mut scratch = ArmScratch::default();
    let condition = arm.model.working(frame.word, frame.previous, &frame.servos_rad);
    if arm.model.predict(&condition, &mut scratch).is_err() {
        return (f64::INFINITY, f64::INFINITY);
    }
    let (mut metres, mut radians) = (0.0, 0.0);
    for &(parameter, sigma) in parameters {
        let twist = arm.model.chain.derivative(parameter, &scratch);
        metres += sigma * sigma * twist.linear.norm_squared();
        radians += sigma * sigma * twist.angular.norm_squared();
    }
    (metres.sqrt(), radians.sqrt())
}

fn pose(arm: &Arm, frame: &DesiredFrame) -> Option<darm_core::se::Pose<f64>> {
    let condition = arm.model.working(frame.word, frame.previous, &frame.servos_rad);
    arm.model.predict(&condition, &mut ArmScratch::default()).ok()
}

/// Everything that is made, and how well.
fn parameters(arm: &Arm, tolerance: &Tolerance) -> Vec<(Parameter, f64)> {
    let mut parameters = Vec::new();
    for (index, (stage, leg)) in arm.model.chain.actuators().enumerate() {
        let actuator = index as u8;
        let stop = if arm.turns(index) { tolerance.stop_rad } else { tolerance.stop_m };
        let states = 0..arm.model.chain.n_states(index) as u8;
        parameters.extend(states.map(|state| (Parameter::Stop { actuator, state }, stop)));
        let stage = &arm.model.chain.stages[stage];
        if stage.leg(leg).is_some() {
            let axes = if stage.is_planar() { 0..2 } else { 0..3 };
            parameters.extend(axes.flat_map(|axis| {
                [Parameter::BaseAnchor { actuator, axis }, Parameter::TopAnchor { actuator, axis }]
                    .map(|anchor| (anchor, tolerance.anchor_m))
            }));
        }
    }
    parameters
}
