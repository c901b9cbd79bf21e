//! Where the tool of a true arm is: what each mechanism does to the actuators, to the servos and to the tool.

use std::f64::consts::TAU;

use darm_arm::arm::{ArmScratch, MAX_STAGES};
use darm_core::actuator::{JointKind, Setting, Stage};
use darm_core::chain::{Chain, ChainError};
use darm_core::se::Pose;

use super::mechanism::{Cause, Mechanism};
use super::surroundings::Conditions;
use super::{Body, TrueState};

/// How far the pawl has crept back when the next word comes.
const CREPT: f64 = 0.997_521_247_823_333_6; // 1 − e^−6
/// Half the difference of lengths that energies are compared at, m.
const VIRTUAL_M: f64 = 1e-5;
/// Legs have come to rest when none moves by more than this, m.
const AT_REST_M: f64 = 1e-9;

/// An actuator in one row.
struct Leg {
    actuator: usize,
    stage: usize,
    /// How many others of its stage have just moved.
    others: usize,
    /// Its value less that in state 0, m or rad.
    stroke: f64,
}

/// An arm with what its tool carries.
struct Loaded<'a> {
    body: &'a Body,
    load_kg: f64,
}

/// The true pose of the tool.
pub(crate) fn pose(
    mechanisms: &[Mechanism],
    body: &Body,
    state: &TrueState,
    moment: Conditions,
    scratch: &mut ArmScratch,
) -> Result<Pose<f64>, ChainError> {
    let mut servos_rad = state.servos_rad.to_vec();
    for mechanism in mechanisms {
        if let Mechanism::Horn { servo, angle_rad } = mechanism {
            servos_rad.iter_mut().skip(*servo).take(1).for_each(|servo| *servo += angle_rad);
        }
    }
    body.chain.configure(&state.word, &servos_rad, scratch)?;
    for (actuator, (stage, leg)) in body.chain.actuators().enumerate() {
        let kind = &body.chain.stages[stage];
        let contracted = kind.setting(leg, 0).map_or(0.0, |setting| setting.value);
        let of_stage = body.chain.actuators().enumerate().filter(|(_, (of, _))| *of == stage);
        let others = of_stage.filter(|&(other, _)| other != actuator && moved(state, other)).count();
        let setting = &mut scratch.settings[stage][leg];
        let leg = Leg { actuator, stage, others, stroke: setting.value - contracted };
        mechanisms.iter().for_each(|one| one.alter(&leg, state, moment, setting));
    }
    let springs = mechanisms.iter().find_map(|mechanism| match mechanism {
        Mechanism::Springs { part, compliance_m_per_n } => Some((part, *compliance_m_per_n)),
        _ => None,
    });
    let pose = match springs {
        Some((part, compliance_m_per_n)) => {
            let legs: Vec<(usize, usize)> = sliding(&body.chain)
                .filter(|&(actuator, stage, _)| part.holds(actuator, stage))
                .map(|(_, stage, leg)| (stage, leg))
                .collect();
            at_rest(&Loaded { body, load_kg: state.load_kg }, &legs, compliance_m_per_n, scratch)?
        }
        None => body.chain.assemble(scratch)?,
    };
    Ok(mechanisms.iter().fold(pose, |pose, mechanism| mechanism.put_aside(pose, state, moment)))
}

/// Time since an actuator has switched.
fn dwell_s(state: &TrueState, actuator: usize) -> f64 {
    let switched_s = state.history.and_then(|history| history.switched_s.get(actuator));
    switched_s.map_or(0.0, |switched_s| state.time_s - switched_s)
}

/// Whether an actuator came to its word by a separate movement.
fn moved(state: &TrueState, actuator: usize) -> bool {
    state.previous.is_some_and(|previous| previous.digit(actuator) != state.word.digit(actuator))
}

impl Mechanism {
    /// What the effect does to one actuator, all but weight.
    fn alter(&self, leg: &Leg, state: &TrueState, moment: Conditions, setting: &mut Setting<f64>) {
        let Leg { actuator, stage, others, stroke } = *leg;
        let digit = state.word.digit(actuator);
        // Away from the stop that the digit names, as long as the leg has one.
        let back = if digit == 0 { 1.0 } else { -1.0 };
        match *self {
            Self::Chip { actuator: of, state, thickness_m } if of == actuator && state == digit => {
                // A chip on the stop of the contraction keeps the leg long, one on any other stop keeps it short.
                setting.value += back * thickness_m;
            }
            Self::Hole { actuator: of, top, aside } if of == actuator => {
                if top {
                    setting.top += aside;
                } else {
                    setting.base += aside;
                }
            }
            Self::Pawl { part, clearance_m } if part.holds(actuator, stage) => {
                let stayed = state.previous.is_some_and(|previous| previous.digit(actuator) == digit);
                let crept = if stayed { clearance_m * CREPT } else { 0.0 };
                setting.value += back * crept;
            }
            Self::Pad { part, softness } if part.holds(actuator, stage) => {
                setting.value += 2.0 * softness * (moment.supply_ratio.sqrt() - 1.0) * stroke;
            }
            Self::Metal { part, expansion_per_k } if part.holds(actuator, stage) => {
                setting.value *= (expansion_per_k * moment.rise_k).exp();
            }
            Self::Knock { actuator: of, at_s, shift_m } if of == actuator && state.time_s >= at_s => {
                setting.value += shift_m;
            }
            Self::Creep { part, slowness_s, way_m } if part.holds(actuator, stage) => {
                setting.value += way_m * (1.0 - (-state.time_s / slowness_s).exp());
            }
            Self::Pounding { actuator: of, per_blow_m } if of == actuator => {
                let blows = state.history.and_then(|history| history.blows.get(actuator)).copied();
                setting.value -= back * per_blow_m * blows.unwrap_or_default();
            }
            Self::Rod { actuator: of, longer_m } if of == actuator => setting.value += longer_m,
            Self::Bracket { actuators: [of, other], shift_m }
                if of == actuator && digit > 0 && state.word.digit(other) > 0 =>
            {
                setting.value += shift_m;
            }
            Self::Seal { part, slowness_s, way_m } if part.holds(actuator, stage) => {
                setting.value -= back * way_m * (1.0 - (-dwell_s(state, actuator) / slowness_s).exp());
            }
            Self::Crowd { part, short_m } if part.holds(actuator, stage) && moved(state, actuator) => {
                setting.value += back * short_m * others as f64 / moment.supply_ratio;
            }
            Self::Echo { actuator: of, short_m } if of == actuator => {
                let second_last = state.history.and_then(|history| history.second_last);
                if second_last.is_some_and(|word| word.digit(actuator) == digit) {
                    setting.value += back * short_m;
                }
            }
            _ => {}
        }
    }

    /// The rigid displacement of the tool by the effect.
    fn put_aside(&self, pose: Pose<f64>, state: &TrueState, moment: Conditions) -> Pose<f64> {
        match *self {
            Self::Lens { stretch } => Pose { position: pose.position * (1.0 + stretch), ..pose },
            Self::Frame { cause, aside } => {
                let moved = |share: f64| Pose::exp(&(aside * share));
                match cause {
                    Cause::Camera => moved(1.0) * pose,
                    Cause::Tripod { at_s } if state.time_s >= at_s => moved(1.0) * pose,
                    Cause::Tripod { .. } => pose,
                    Cause::Tool => pose * moved(1.0),
                    Cause::Sway { period_s, phase } => moved((TAU * state.time_s / period_s + phase).sin()) * pose,
                    Cause::Bimetal => pose * moved((moment.rise_k / 10.0).powi(2)),
                    Cause::Hose => pose * moved(((1.0 - moment.supply_ratio) / 0.1).powi(2)),
                    Cause::Cable { actuators } => {
                        let taut = actuators.iter().all(|&actuator| state.word.digit(actuator) > 0);
                        if taut { pose * moved(1.0) } else { pose }
                    }
                }
            }
            _ => pose,
        }
    }
}

/// Actuators that slide: number, stage, number in the stage.
fn sliding(chain: &Chain<f64, MAX_STAGES>) -> impl Iterator<Item = (usize, usize, usize)> {
    chain.actuators().enumerate().map(|(actuator, (stage, leg))| (actuator, stage, leg)).filter(|&(_, stage, _)| {
        !matches!(&chain.stages[stage], Stage::Discrete(joint) if joint.axis.kind == JointKind::Revolute)
    })
}

/// The posture of least energy when these legs are springs: each is shortened by what the weights press on it with, in
/// that very posture.
fn at_rest(
    arm: &Loaded,
    legs: &[(usize, usize)],
    compliance_m_per_n: f64,
    scratch: &mut ArmScratch,
) -> Result<Pose<f64>, ChainError> {
    let unloaded: Vec<f64> = legs.iter().map(|&(stage, leg)| scratch.settings[stage][leg].value).collect();
    for _ in 0..60 {
        let forces = legs.iter().map(|&leg| force_n(arm, leg, scratch)).collect::<Result<Vec<f64>, _>>()?;
        let mut moved_m: f64 = 0.0;
        for ((&(stage, leg), force), unloaded) in legs.iter().zip(forces).zip(&unloaded) {
            let value = &mut scratch.settings[stage][leg].value;
            let next = unloaded - compliance_m_per_n * force;
            moved_m = moved_m.max((next - *value).abs());
            *value = next;
        }
        if moved_m < AT_REST_M {
            break;
        }
    }
    arm.body.chain.assemble(scratch)
}

/// ∂V/∂l of one leg, N: what it presses with.
fn force_n(arm: &Loaded, (stage, leg): (usize, usize), scratch: &mut ArmScratch) -> Result<f64, ChainError> {
    let value = scratch.settings[stage][leg].value;
    let mut energy = |length: f64| {
        scratch.settings[stage][leg].value = length;
        arm.body.chain.assemble(scratch).map(|_| arm.body.potential_j(arm.load_kg, scratch))
    };
    let (longer, shorter) = (energy(value + VIRTUAL_M), energy(value - VIRTUAL_M));
    scratch.settings[stage][leg].value = value;
    Ok((longer? - shorter?) / (2.0 * VIRTUAL_M))
}
