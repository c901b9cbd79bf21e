//! Ground-truth mechanisms of the true arm, by separate equations.
//!
//! | kind | what happens | equation |
//! | --- | --- | --- |
//! | stroke loss | a chip lies on one stop of one leg | the leg ends where the chip begins |
//! | anchor offset | a hole is drilled beside its mark | the leg is anchored there |
//! | gravity sag | legs are springs | least energy: Σ (l − l₀)²/2c + V(l), found by iterating l = l₀ − c·∂V/∂l |
//! | play | a pawl with clearance; a blow seats it, a hold lets it creep back | s = w·(1 − e^−6) after one hold |
//! | supply | a pad that the piston presses into, F ∝ x² | Δl = 2·k·(√(p/p₀) − 1)·stroke |
//! | thermal growth | legs of warm metal | dl = α·l·dϑ, so l = l₀·exp(α·Δϑ) |
//! | step | a knock shifts a leg in its clamp, for good | Δl = s once t ≥ t₀ |
//! | drift | a leg creeps out of its clamp | Δl = s·(1 − e^(−t/τ)), τ longer than the run |
//! | wear | blows pound a stop | Δl = ±w·Σ p/p₀ over the blows of the actuator |
//! | crowding | legs that move together take each other's air | Δl = ∓s·n·p₀/p with n others of the module |
//! | length offset | a rod end is screwed in too far | l = l₀ + s |
//! | interaction | two legs share a bracket that bends | l = l₀ + s where both are long |
//! | creep | a seal yields under its load | Δl = ±s·(1 − e^(−h/τ)), h since the leg was moved |
//! | base step | somebody knocks the tripod of the camera | T = M·T₀ once t ≥ t₀ |
//! | base offset | the camera was moved | T = M·T₀ |
//! | tool offset | the tool was bent | T = T₀·B |
//! | scale | a lens of another focal length | p = (1 + s)·p₀ |
//! | joint offset | a servo horn one tooth off | q = q₀ + δ |
//!
//! and what no law knows:
//!
//! | kind | what happens | equation |
//! | --- | --- | --- |
//! | sway | the stand sways | T = exp(ξ·sin(2πt/P + φ))·T₀ |
//! | bimetal | a bracket of two metals bends | T = T₀·exp(ξ·(Δϑ/10 K)²) |
//! | hose | a hose stiffens | T = T₀·exp(ξ·((1 − p/p₀)/0.1)²) |
//! | echo | a valve remembers the word before the last | Δl = ±s where the digit is that of the word before the last |
//! | cable | two legs pull on it when both are long | T = T₀·exp(ξ) |

use std::f64::consts::TAU;
use std::fmt;
use std::ops::Range;

use darm_core::chain::Chain;
use darm_core::effect::{self, Detail, Plate};
use darm_core::real::Vec3;
use darm_core::se::Twist;
use rand::{Rng, RngExt};

use super::displacement::{aside, tilt};
use super::kind::Kind;
use crate::effect::Place;
use crate::outcome::Regressor;
use darm_arm::arm::MAX_STAGES;

/// When a knock may come: within a run of some hundred steps.
const KNOCKS_S: Range<f64> = 25.0..70.0;
/// Times in which a creeping leg comes to 63 % of its way, longer than a run.
const SLOWNESS_S: Range<f64> = 300.0..900.0;
/// Times in which a seal has yielded by 63 % of its way.
const YIELDS_S: Range<f64> = 1.0..6.0;
/// Periods of a stand that sways.
const SWAYS_S: Range<f64> = 15.0..60.0;

/// Some of the arm's actuators.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Part {
    Actuator(usize),
    Module(usize),
    Arm,
}

/// An effect with its size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Mechanism {
    Nothing,
    Chip {
        actuator: usize,
        state: u8,
        thickness_m: f64,
    },
    Hole {
        actuator: usize,
        top: bool,
        aside: Vec3<f64>,
    },
    Springs {
        part: Part,
        compliance_m_per_n: f64,
    },
    Pawl {
        part: Part,
        clearance_m: f64,
    },
    Pad {
        part: Part,
        softness: f64,
    },
    Metal {
        part: Part,
        expansion_per_k: f64,
    },
    Knock {
        actuator: usize,
        at_s: f64,
        shift_m: f64,
    },
    Creep {
        part: Part,
        slowness_s: f64,
        way_m: f64,
    },
    Pounding {
        actuator: usize,
        per_blow_m: f64,
    },
    Crowd {
        part: Part,
        short_m: f64,
    },
    Rod {
        actuator: usize,
        longer_m: f64,
    },
    /// The first of these legs is changed by the second.
    Bracket {
        actuators: [usize; 2],
        shift_m: f64,
    },
    Seal {
        part: Part,
        slowness_s: f64,
        way_m: f64,
    },
    Frame {
        cause: Cause,
        aside: Twist<f64>,
    },
    Lens {
        stretch: f64,
    },
    Horn {
        servo: usize,
        angle_rad: f64,
    },
    Echo {
        actuator: usize,
        short_m: f64,
    },
}

/// What displaces the tool rigidly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Cause {
    Camera,
    Tripod { at_s: f64 },
    Tool,
    Sway { period_s: f64, phase: f64 },
    Bimetal,
    Hose,
    Cable { actuators: [usize; 2] },
}

impl Mechanism {
    /// An effect of size one at a place drawn; `None` where the arm has no place for it.
    pub(crate) fn draw(kind: Kind, chain: &Chain<f64, MAX_STAGES>, rng: &mut impl Rng) -> Option<Self> {
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
            Kind::Step => Self::Knock { actuator, at_s: rng.random_range(KNOCKS_S), shift_m: 1.0 },
            Kind::Drift => Self::Creep { part: one_or_all, slowness_s: rng.random_range(SLOWNESS_S), way_m: 1.0 },
            Kind::Wear => Self::Pounding { actuator, per_blow_m: 1.0 },
            Kind::Crowding => Self::Crowd { part, short_m: 1.0 },
            Kind::LengthOffset => Self::Rod { actuator, longer_m: 1.0 },
            Kind::Interaction if chain.n_actuators() < 2 => return None,
            Kind::Interaction => {
                let other = (actuator + rng.random_range(1..chain.n_actuators())) % chain.n_actuators();
                Self::Bracket { actuators: [actuator, other], shift_m: 1.0 }
            }
            Kind::Creep => Self::Seal { part: one_or_all, slowness_s: rng.random_range(YIELDS_S), way_m: 1.0 },
            Kind::Scale => Self::Lens { stretch: 1.0 },
            Kind::JointOffset if chain.n_servos() == 0 => return None,
            Kind::JointOffset => Self::Horn { servo: rng.random_range(0..chain.n_servos()), angle_rad: 1.0 },
            Kind::Echo => Self::Echo { actuator, short_m: 1.0 },
            Kind::BaseOffset
            | Kind::BaseStep
            | Kind::ToolOffset
            | Kind::Sway
            | Kind::Bimetal
            | Kind::Hose
            | Kind::Cable => Self::Frame { cause: Cause::draw(kind, chain, rng)?, aside: tilt(chain.is_planar(), rng) },
        })
    }

    /// The same effect of another size.
    pub(crate) fn scaled(&self, size: f64) -> Self {
        let mut scaled = *self;
        match &mut scaled {
            Self::Nothing => {}
            Self::Chip { thickness_m, .. } => *thickness_m *= size,
            Self::Hole { aside, .. } => *aside *= size,
            Self::Springs { compliance_m_per_n, .. } => *compliance_m_per_n *= size,
            Self::Pawl { clearance_m, .. } => *clearance_m *= size,
            Self::Pad { softness, .. } => *softness *= size,
            Self::Metal { expansion_per_k, .. } => *expansion_per_k *= size,
            Self::Knock { shift_m: m, .. }
            | Self::Creep { way_m: m, .. }
            | Self::Pounding { per_blow_m: m, .. }
            | Self::Crowd { short_m: m, .. }
            | Self::Rod { longer_m: m, .. }
            | Self::Bracket { shift_m: m, .. }
            | Self::Seal { way_m: m, .. }
            | Self::Echo { short_m: m, .. } => *m *= size,
            Self::Frame { aside, .. } => *aside = *aside * size,
            Self::Lens { stretch } => *stretch *= size,
            Self::Horn { angle_rad, .. } => *angle_rad *= size,
        }
        scaled
    }

    /// The largest size that still is what it is called.
    pub(crate) fn largest(&self) -> f64 {
        match self {
            Self::Nothing => 0.0,
            Self::Chip { .. } | Self::Hole { .. } | Self::Rod { .. } | Self::Bracket { .. } | Self::Seal { .. } => 0.03,
            Self::Springs { .. } => 1e-3,
            Self::Pawl { .. } => 0.02,
            Self::Pad { .. } => 2.0,
            Self::Metal { .. } => 2e-3,
            Self::Knock { .. } | Self::Creep { .. } | Self::Crowd { .. } | Self::Echo { .. } => 0.03,
            Self::Pounding { .. } => 1e-3,
            Self::Frame { .. } | Self::Lens { .. } | Self::Horn { .. } => 0.05,
        }
    }

    /// Where the law acts that is right for it; `None` where none is.
    pub(crate) fn place(&self) -> Option<Place> {
        let all = |part| Some(Place::Arm(part, Detail::All));
        match *self {
            Self::Chip { actuator, state, .. } => {
                Some(Place::Arm(effect::Place::Actuator(actuator as u8), Detail::State(state)))
            }
            Self::Hole { actuator, top, .. } => {
                let plate = if top { Plate::Top } else { Plate::Base };
                Some(Place::Arm(effect::Place::Actuator(actuator as u8), Detail::Anchor(plate)))
            }
            Self::Springs { part, .. }
            | Self::Pawl { part, .. }
            | Self::Pad { part, .. }
            | Self::Creep { part, .. }
            | Self::Seal { part, .. }
            | Self::Crowd { part, .. }
            | Self::Metal { part, .. } => all(part.of_arm()),
            Self::Bracket { actuators: [of, other], .. } => {
                Some(Place::Arm(effect::Place::Actuator(of as u8), Detail::With(other as u8)))
            }
            Self::Knock { actuator, .. } | Self::Pounding { actuator, .. } | Self::Rod { actuator, .. } => {
                all(effect::Place::Actuator(actuator as u8))
            }
            Self::Frame { cause: Cause::Camera | Cause::Tripod { .. }, .. } => all(effect::Place::Base),
            Self::Frame { cause: Cause::Tool, .. } => all(effect::Place::Tool),
            Self::Lens { .. } => all(effect::Place::Camera),
            Self::Horn { servo, .. } => all(effect::Place::Servo(servo as u8)),
            Self::Nothing | Self::Frame { .. } | Self::Echo { .. } => None,
        }
    }

    /// What it depends on, where no law is right.
    pub(crate) fn regressor(&self) -> Option<Regressor> {
        match *self {
            Self::Frame { cause: Cause::Sway { .. }, .. } => Some(Regressor::Time),
            Self::Frame { cause: Cause::Bimetal, .. } => Some(Regressor::Temperature),
            Self::Frame { cause: Cause::Hose, .. } => Some(Regressor::Supply),
            Self::Frame { cause: Cause::Cable { actuators }, .. } => Some(Regressor::Digits(actuators)),
            Self::Echo { actuator, .. } => Some(Regressor::WordBeforeLast(actuator)),
            _ => None,
        }
    }

    /// Where it is, exactly, in words; where no law is right, what it depends on.
    pub(crate) fn place_in_words(&self) -> String {
        match *self {
            Self::Nothing => String::new(),
            Self::Chip { actuator, state, .. } => format!("actuator {actuator}, state {state}"),
            Self::Hole { actuator, top, .. } => {
                format!("actuator {actuator}, {} anchor", if top { "top" } else { "base" })
            }
            Self::Springs { part, .. }
            | Self::Pawl { part, .. }
            | Self::Pad { part, .. }
            | Self::Creep { part, .. }
            | Self::Seal { part, .. }
            | Self::Crowd { part, .. }
            | Self::Metal { part, .. } => part.to_string(),
            Self::Bracket { actuators: [of, other], .. } => format!("actuator {of}, with actuator {other}"),
            Self::Knock { actuator, .. } | Self::Pounding { actuator, .. } | Self::Rod { actuator, .. } => {
                format!("actuator {actuator}")
            }
            Self::Frame { cause: Cause::Camera | Cause::Tripod { .. }, .. } => "base".into(),
            Self::Frame { cause: Cause::Tool, .. } => "tool".into(),
            Self::Frame { cause: Cause::Sway { .. }, .. } => "time".into(),
            Self::Frame { cause: Cause::Bimetal, .. } => "temperature".into(),
            Self::Frame { cause: Cause::Hose, .. } => "supply".into(),
            Self::Frame { cause: Cause::Cable { actuators: [a, b] }, .. } => format!("actuators {a} and {b}"),
            Self::Lens { .. } => "camera".into(),
            Self::Horn { servo, .. } => format!("servo {servo}"),
            Self::Echo { actuator, .. } => format!("word before the last, at actuator {actuator}"),
        }
    }
}

impl Cause {
    /// `None` where the arm has no two modules for a cable.
    fn draw(kind: Kind, chain: &Chain<f64, MAX_STAGES>, rng: &mut impl Rng) -> Option<Self> {
        Some(match kind {
            Kind::BaseOffset => Self::Camera,
            Kind::BaseStep => Self::Tripod { at_s: rng.random_range(KNOCKS_S) },
            Kind::ToolOffset => Self::Tool,
            Kind::Sway => Self::Sway { period_s: rng.random_range(SWAYS_S), phase: rng.random_range(0.0..TAU) },
            Kind::Bimetal => Self::Bimetal,
            Kind::Hose => Self::Hose,
            _ => {
                let actuators: Vec<(usize, usize)> = chain.actuators().map(|(stage, _)| stage).enumerate().collect();
                let (a, stage) = actuators[rng.random_range(0..actuators.len())];
                let elsewhere: Vec<usize> =
                    actuators.into_iter().filter(|(_, other)| *other != stage).map(|(b, _)| b).collect();
                let b = *elsewhere.get(rng.random_range(0..elsewhere.len().max(1)))?;
                Self::Cable { actuators: [a.min(b), a.max(b)] }
            }
        })
    }
}

impl Part {
    /// A module or the complete arm.
    fn draw(chain: &Chain<f64, MAX_STAGES>, rng: &mut impl Rng) -> Option<Self> {
        let stages = chain.stages.iter().enumerate();
        let modules: Vec<usize> = stages.filter(|(_, stage)| stage.n_actuators() > 1).map(|(index, _)| index).collect();
        if chain.n_actuators() == 0 {
            return None;
        }
        let total = modules.len() < 2 || rng.random_bool(0.5);
        Some(if total { Self::Arm } else { Self::Module(modules[rng.random_range(0..modules.len())]) })
    }

    fn of_arm(self) -> effect::Place {
        match self {
            Self::Actuator(actuator) => effect::Place::Actuator(actuator as u8),
            Self::Module(module) => effect::Place::Module(module as u8),
            Self::Arm => effect::Place::Arm,
        }
    }

    pub(super) fn holds(&self, actuator: usize, stage: usize) -> bool {
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
