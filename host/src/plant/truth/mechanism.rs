//! What is really the matter with the true arm, by equations of its own.
//!
//! | kind | what happens | equation |
//! | --- | --- | --- |
//! | stroke loss | a chip lies on one stop of one leg | the leg ends where the chip begins |
//! | anchor offset | a hole is drilled beside its mark | the leg is anchored there |
//! | gravity sag | legs are springs | least energy: Σ (l − l₀)²/2c + V(l), found by iterating l = l₀ − c·∂V/∂l |
//! | play | a pawl with clearance; a blow seats it, a hold lets it creep back | s = w·(1 − e^−6) after one hold |
//! | supply | a pad that the piston presses into, F ∝ x² | Δl = 2·k·(√(p/p₀) − 1)·stroke |
//! | thermal growth | legs of warm metal | dl = α·l·dϑ, so l = l₀·exp(α·Δϑ) |

use std::fmt;
use std::str::FromStr;

use darm_core::actuator::{JointKind, Setting, Stage};
use darm_core::chain::{Chain, ChainError};
use darm_core::real::Vec3;
use darm_core::se::Pose;
use rand::{Rng, RngExt};

use super::surroundings::Moment;
use super::{Body, TrueState};
use crate::arm::{ArmScratch, MAX_STAGES};

/// How far the pawl has crept back when the next word comes.
const CREPT: f64 = 0.997_521_247_823_333_6; // 1 − e^−6
/// Half the difference of lengths that energies are compared at, m.
const VIRTUAL_M: f64 = 1e-5;
/// Legs have come to rest when none moves by more than this, m.
const AT_REST_M: f64 = 1e-9;

/// A kind of effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// The arm is as its drawing.
    Nothing,
    /// One leg does not reach one of its stops.
    StrokeLoss,
    /// One anchor of one leg sits elsewhere.
    AnchorOffset,
    /// Legs give way under the weight of the arm.
    GravitySag,
    /// A leg that is not moved comes off its stop.
    Play,
    /// The stroke depends on the supply.
    SupplyStroke,
    /// Legs grow with the temperature.
    ThermalGrowth,
}

/// Some of the arm's actuators.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Part {
    Actuator(usize),
    Module(usize),
    Arm,
}

/// An effect with its size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Mechanism {
    Nothing,
    Chip { actuator: usize, state: u8, thickness_m: f64 },
    Hole { actuator: usize, top: bool, aside: Vec3<f64> },
    Springs { part: Part, compliance_m_per_n: f64 },
    Pawl { part: Part, clearance_m: f64 },
    Pad { part: Part, softness: f64 },
    Metal { part: Part, expansion_per_k: f64 },
}

impl Kind {
    /// All kinds but nothing.
    pub const EFFECTS: [Self; 6] =
        [Self::StrokeLoss, Self::AnchorOffset, Self::GravitySag, Self::Play, Self::SupplyStroke, Self::ThermalGrowth];

    /// Name of the law that is right for it.
    pub fn law(self) -> &'static str {
        match self {
            Self::Nothing => "none",
            Self::StrokeLoss => "stroke-loss",
            Self::AnchorOffset => "anchor-offset",
            Self::GravitySag => "gravity-sag",
            Self::Play => "play",
            Self::SupplyStroke => "supply-stroke",
            Self::ThermalGrowth => "thermal-growth",
        }
    }

    /// Unit of its size.
    pub(super) fn unit(self) -> &'static str {
        match self {
            Self::Nothing | Self::SupplyStroke => "1",
            Self::StrokeLoss | Self::AnchorOffset | Self::Play => "m",
            Self::GravitySag => "m/N",
            Self::ThermalGrowth => "1/K",
        }
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.law())
    }
}

/// A name that is no [`Kind`]'s.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no effect: use none, stroke-loss, anchor-offset, gravity-sag, play, supply-stroke or thermal-growth")]
pub struct NoSuchKind(String);

impl FromStr for Kind {
    type Err = NoSuchKind;

    fn from_str(name: &str) -> Result<Self, NoSuchKind> {
        let all = Self::EFFECTS.into_iter().chain([Self::Nothing]);
        all.into_iter().find(|kind| kind.law() == name).ok_or_else(|| NoSuchKind(name.into()))
    }
}

impl Mechanism {
    /// An effect of size one at a place drawn; `None` where the arm has no place for it.
    pub(super) fn draw(kind: Kind, chain: &Chain<f64, MAX_STAGES>, rng: &mut impl Rng) -> Option<Self> {
        let part = Part::draw(chain, rng)?;
        let of_one = rng.random_bool(0.5);
        let actuator = rng.random_range(0..chain.n_actuators());
        let one_or_all = if of_one { Part::Actuator(actuator) } else { Part::Arm };
        Some(match kind {
            Kind::Nothing => Self::Nothing,
            Kind::StrokeLoss => {
                let state = if rng.random_bool(0.25) { 0 } else { rng.random_range(1..chain.n_states(actuator) as u8) };
                Self::Chip { actuator, state, thickness_m: 1.0 }
            }
            Kind::AnchorOffset => {
                let anchored =
                    |k: &usize| chain.actuator(*k).is_some_and(|(s, leg)| chain.stages[s].leg(leg).is_some());
                let legs: Vec<usize> = (0..chain.n_actuators()).filter(anchored).collect();
                let &actuator = legs.get(rng.random_range(0..legs.len().max(1)))?;
                Self::Hole { actuator, top: rng.random_bool(0.5), aside: aside(chain.is_planar(), rng) }
            }
            Kind::GravitySag => Self::Springs { part, compliance_m_per_n: 1.0 },
            Kind::Play => Self::Pawl { part: one_or_all, clearance_m: 1.0 },
            Kind::SupplyStroke => Self::Pad { part: one_or_all, softness: 1.0 },
            Kind::ThermalGrowth => Self::Metal { part, expansion_per_k: 1.0 },
        })
    }

    /// The same effect of another size.
    pub(super) fn scaled(&self, size: f64) -> Self {
        let mut scaled = *self;
        match &mut scaled {
            Self::Nothing => {}
            Self::Chip { thickness_m, .. } => *thickness_m *= size,
            Self::Hole { aside, .. } => *aside *= size,
            Self::Springs { compliance_m_per_n, .. } => *compliance_m_per_n *= size,
            Self::Pawl { clearance_m, .. } => *clearance_m *= size,
            Self::Pad { softness, .. } => *softness *= size,
            Self::Metal { expansion_per_k, .. } => *expansion_per_k *= size,
        }
        scaled
    }

    /// The largest size that still is what it is called.
    pub(super) fn largest(&self) -> f64 {
        match self {
            Self::Nothing => 0.0,
            Self::Chip { .. } | Self::Hole { .. } => 0.03,
            Self::Springs { .. } => 1e-3,
            Self::Pawl { .. } => 0.02,
            Self::Pad { .. } => 2.0,
            Self::Metal { .. } => 2e-3,
        }
    }

    /// Where it is, exactly.
    pub(super) fn place(&self) -> String {
        match *self {
            Self::Nothing => String::new(),
            Self::Chip { actuator, state, .. } => format!("actuator {actuator}, state {state}"),
            Self::Hole { actuator, top, .. } => {
                format!("actuator {actuator}, {} anchor", if top { "top" } else { "base" })
            }
            Self::Springs { part, .. }
            | Self::Pawl { part, .. }
            | Self::Pad { part, .. }
            | Self::Metal { part, .. } => part.to_string(),
        }
    }

    /// The true pose of the tool.
    pub(super) fn pose(
        &self,
        body: &Body,
        state: &TrueState,
        moment: Moment,
        scratch: &mut ArmScratch,
    ) -> Result<Pose<f64>, ChainError> {
        body.chain.configure(&state.word, state.servos_rad, scratch)?;
        for (actuator, (stage, leg)) in body.chain.actuators().enumerate() {
            let kind = &body.chain.stages[stage];
            let contracted = kind.setting(leg, 0).map_or(0.0, |setting| setting.value);
            let setting = &mut scratch.settings[stage][leg];
            self.alter(actuator, stage, state, moment, setting.value - contracted, setting);
        }
        match self {
            Self::Springs { part, compliance_m_per_n } => {
                let legs: Vec<(usize, usize)> = sliding(&body.chain)
                    .filter(|&(actuator, stage, _)| part.holds(actuator, stage))
                    .map(|(_, stage, leg)| (stage, leg))
                    .collect();
                at_rest(body, &legs, *compliance_m_per_n, scratch)
            }
            _ => body.chain.assemble(scratch),
        }
    }

    /// What the effect does to one actuator, all but weight.
    fn alter(
        &self,
        actuator: usize,
        stage: usize,
        state: &TrueState,
        moment: Moment,
        stroke: f64,
        setting: &mut Setting<f64>,
    ) {
        let digit = state.word.digit(actuator);
        match *self {
            Self::Chip { actuator: of, state, thickness_m } if of == actuator && state == digit => {
                // A chip on the stop of the contraction keeps the leg long, one on any other stop keeps it short.
                setting.value += if digit == 0 { thickness_m } else { -thickness_m };
            }
            Self::Hole { actuator: of, top, aside } if of == actuator => {
                if top {
                    setting.top += aside;
                } else {
                    setting.base += aside;
                }
            }
            Self::Pawl { part, clearance_m } if part.holds(actuator, stage) => {
                let held = state.previous.is_some_and(|previous| previous.digit(actuator) == digit);
                let crept = if held { clearance_m * CREPT } else { 0.0 };
                setting.value += if digit == 0 { crept } else { -crept };
            }
            Self::Pad { part, softness } if part.holds(actuator, stage) => {
                setting.value += 2.0 * softness * (moment.supply_ratio.sqrt() - 1.0) * stroke;
            }
            Self::Metal { part, expansion_per_k } if part.holds(actuator, stage) => {
                setting.value *= (expansion_per_k * moment.rise_k).exp();
            }
            _ => {}
        }
    }
}

impl Part {
    /// A module or the whole arm.
    fn draw(chain: &Chain<f64, MAX_STAGES>, rng: &mut impl Rng) -> Option<Self> {
        let stages = chain.stages.iter().enumerate();
        let modules: Vec<usize> = stages.filter(|(_, stage)| stage.n_actuators() > 1).map(|(index, _)| index).collect();
        if chain.n_actuators() == 0 {
            return None;
        }
        let whole = modules.len() < 2 || rng.random_bool(0.5);
        Some(if whole { Self::Arm } else { Self::Module(modules[rng.random_range(0..modules.len())]) })
    }

    fn holds(&self, actuator: usize, stage: usize) -> bool {
        match *self {
            Self::Actuator(of) => of == actuator,
            Self::Module(of) => of == stage,
            Self::Arm => true,
        }
    }
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Actuator(actuator) => write!(f, "actuator {actuator}"),
            Self::Module(module) => write!(f, "module {module}"),
            Self::Arm => f.write_str("arm"),
        }
    }
}

/// A direction drawn, of length one.
fn aside(planar: bool, rng: &mut impl Rng) -> Vec3<f64> {
    loop {
        let mut v = Vec3::from_fn(|_, _| rng.random_range(-1.0..1.0));
        if planar {
            v.z = 0.0;
        }
        let length: f64 = v.norm();
        if (0.1..1.0).contains(&length) {
            return v / length;
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
    body: &Body,
    legs: &[(usize, usize)],
    compliance_m_per_n: f64,
    scratch: &mut ArmScratch,
) -> Result<Pose<f64>, ChainError> {
    let unloaded: Vec<f64> = legs.iter().map(|&(stage, leg)| scratch.settings[stage][leg].value).collect();
    for _ in 0..60 {
        let forces = legs.iter().map(|&leg| force_n(body, leg, scratch)).collect::<Result<Vec<f64>, _>>()?;
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
    body.chain.assemble(scratch)
}

/// ∂V/∂l of one leg, N: what it presses with.
fn force_n(body: &Body, (stage, leg): (usize, usize), scratch: &mut ArmScratch) -> Result<f64, ChainError> {
    let value = scratch.settings[stage][leg].value;
    let mut energy = |length: f64| {
        scratch.settings[stage][leg].value = length;
        body.chain.assemble(scratch).map(|_| body.potential_j(scratch))
    };
    let (longer, shorter) = (energy(value + VIRTUAL_M), energy(value - VIRTUAL_M));
    scratch.settings[stage][leg].value = value;
    Ok((longer? - shorter?) / (2.0 * VIRTUAL_M))
}
