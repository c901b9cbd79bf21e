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
//! | step | a knock shifts a leg in its clamp, for good | Δl = s once t ≥ t₀ |
//! | drift | a leg creeps out of its clamp | Δl = s·(1 − e^(−t/τ)), τ longer than the run |
//! | wear | blows pound a stop | Δl = ±w·Σ p/p₀ over the blows of the actuator |
//! | crowding | legs that move together take each other's air | Δl = ∓s·n·p₀/p with n others of the module |
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
use std::str::FromStr;

use darm_core::actuator::{JointKind, Setting, Stage};
use darm_core::chain::{Chain, ChainError};
use darm_core::real::Vec3;
use darm_core::se::{Pose, Twist};
use rand::{Rng, RngExt};

use crate::truth::Body;
use crate::truth::TrueState;
use crate::truth::surroundings::Moment;
use darm_arm::arm::{ArmScratch, MAX_STAGES};

/// How far the pawl has crept back when the next word comes.
const CREPT: f64 = 0.997_521_247_823_333_6; // 1 − e^−6
/// When a knock may come: within a run of some hundred steps.
const KNOCKS_S: Range<f64> = 25.0..70.0;
/// Times in which a creeping leg comes to 63 % of its way, longer than a run.
const SLOWNESS_S: Range<f64> = 300.0..900.0;
/// Periods of a stand that sways.
const SWAYS_S: Range<f64> = 15.0..60.0;
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
    /// A leg is knocked out of its place in the middle of the run.
    Step,
    /// A leg creeps.
    Drift,
    /// A stop wears with each blow.
    Wear,
    /// Legs that switch together do not get as far.
    Crowding,
    /// The camera stands elsewhere.
    BaseOffset,
    /// The tool sits elsewhere.
    ToolOffset,
    /// The camera's scale is off.
    Scale,
    /// A servo's zero is off.
    JointOffset,
    /// The stand sways: no law knows it.
    Sway,
    /// The tool bends with the temperature: no law knows it.
    Bimetal,
    /// The tool bends with the supply: no law knows it.
    Hose,
    /// A valve remembers too long: no law knows it.
    Echo,
    /// Two legs together pull the tool aside: no law knows it.
    Cable,
}

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
    Chip { actuator: usize, state: u8, thickness_m: f64 },
    Hole { actuator: usize, top: bool, aside: Vec3<f64> },
    Springs { part: Part, compliance_m_per_n: f64 },
    Pawl { part: Part, clearance_m: f64 },
    Pad { part: Part, softness: f64 },
    Metal { part: Part, expansion_per_k: f64 },
    Knock { actuator: usize, at_s: f64, shift_m: f64 },
    Creep { part: Part, slowness_s: f64, way_m: f64 },
    Pounding { actuator: usize, per_blow_m: f64 },
    Crowd { part: Part, short_m: f64 },
    Frame { cause: Cause, aside: Twist<f64> },
    Lens { stretch: f64 },
    Horn { servo: usize, angle_rad: f64 },
    Echo { actuator: usize, short_m: f64 },
}

/// What puts the tool elsewhere as a whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Cause {
    Camera,
    Tool,
    Sway { period_s: f64, phase: f64 },
    Bimetal,
    Hose,
    Cable { actuators: [usize; 2] },
}

impl Kind {
    /// The kinds that a demo draws from.
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
            Self::Step => "step",
            Self::Drift => "drift",
            Self::Wear => "wear",
            Self::Crowding => "crowding",
            Self::BaseOffset => "base-offset",
            Self::ToolOffset => "tool-offset",
            Self::Scale => "scale",
            Self::JointOffset => "joint-offset",
            Self::Sway | Self::Bimetal | Self::Hose | Self::Echo | Self::Cable => "no law",
        }
    }

    /// Unit of its size.
    pub(crate) fn unit(self) -> &'static str {
        match self {
            Self::Nothing | Self::SupplyStroke | Self::Scale => "1",
            Self::GravitySag => "m/N",
            Self::ThermalGrowth => "1/K",
            Self::JointOffset => "rad",
            _ => "m",
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
            Kind::Scale => Self::Lens { stretch: 1.0 },
            Kind::JointOffset if chain.n_servos() == 0 => return None,
            Kind::JointOffset => Self::Horn { servo: rng.random_range(0..chain.n_servos()), angle_rad: 1.0 },
            Kind::Echo => Self::Echo { actuator, short_m: 1.0 },
            Kind::BaseOffset | Kind::ToolOffset | Kind::Sway | Kind::Bimetal | Kind::Hose | Kind::Cable => {
                Self::Frame { cause: Cause::draw(kind, chain, rng)?, aside: tilt(chain.is_planar(), rng) }
            }
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
            Self::Chip { .. } | Self::Hole { .. } => 0.03,
            Self::Springs { .. } => 1e-3,
            Self::Pawl { .. } => 0.02,
            Self::Pad { .. } => 2.0,
            Self::Metal { .. } => 2e-3,
            Self::Knock { .. } | Self::Creep { .. } | Self::Crowd { .. } | Self::Echo { .. } => 0.03,
            Self::Pounding { .. } => 1e-3,
            Self::Frame { .. } | Self::Lens { .. } | Self::Horn { .. } => 0.05,
        }
    }

    /// Where it is, exactly.
    pub(crate) fn place(&self) -> String {
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
            | Self::Crowd { part, .. }
            | Self::Metal { part, .. } => part.to_string(),
            Self::Knock { actuator, .. } | Self::Pounding { actuator, .. } => format!("actuator {actuator}"),
            Self::Frame { cause: Cause::Camera, .. } => "base".into(),
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

    /// What the effect does to one actuator, all but weight.
    fn alter(
        &self,
        (actuator, stage): (usize, usize),
        state: &TrueState,
        moment: Moment,
        others: usize,
        stroke: f64,
        setting: &mut Setting<f64>,
    ) {
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
                let held = state.previous.is_some_and(|previous| previous.digit(actuator) == digit);
                let crept = if held { clearance_m * CREPT } else { 0.0 };
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
}

/// The true pose of the tool.
pub(crate) fn pose(
    mechanisms: &[Mechanism],
    body: &Body,
    state: &TrueState,
    moment: Moment,
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
        let stroke = setting.value - contracted;
        mechanisms.iter().for_each(|one| one.alter((actuator, stage), state, moment, others, stroke, setting));
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
            at_rest(body, &legs, compliance_m_per_n, scratch)?
        }
        None => body.chain.assemble(scratch)?,
    };
    Ok(mechanisms.iter().fold(pose, |pose, mechanism| mechanism.put_aside(pose, state, moment)))
}

/// Whether an actuator came to its word by a movement of its own.
fn moved(state: &TrueState, actuator: usize) -> bool {
    state.previous.is_some_and(|previous| previous.digit(actuator) != state.word.digit(actuator))
}

impl Mechanism {
    /// What the effect does to the tool as a whole.
    fn put_aside(&self, pose: Pose<f64>, state: &TrueState, moment: Moment) -> Pose<f64> {
        match *self {
            Self::Lens { stretch } => Pose { position: pose.position * (1.0 + stretch), ..pose },
            Self::Frame { cause, aside } => {
                let moved = |share: f64| Pose::exp(&(aside * share));
                match cause {
                    Cause::Camera => moved(1.0) * pose,
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

impl Cause {
    /// `None` where the arm has no two modules for a cable.
    fn draw(kind: Kind, chain: &Chain<f64, MAX_STAGES>, rng: &mut impl Rng) -> Option<Self> {
        Some(match kind {
            Kind::BaseOffset => Self::Camera,
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
    /// A module or the whole arm.
    fn draw(chain: &Chain<f64, MAX_STAGES>, rng: &mut impl Rng) -> Option<Self> {
        let stages = chain.stages.iter().enumerate();
        let modules: Vec<usize> = stages.filter(|(_, stage)| stage.n_actuators() > 1).map(|(index, _)| index).collect();
        if chain.n_actuators() == 0 {
            return None;
        }
        let total = modules.len() < 2 || rng.random_bool(0.5);
        Some(if total { Self::Arm } else { Self::Module(modules[rng.random_range(0..modules.len())]) })
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

/// A shift and a turn of an arm's length, drawn: a unit is 1 m and 1 rad.
pub(crate) fn tilt(planar: bool, rng: &mut impl Rng) -> Twist<f64> {
    let linear = aside(planar, rng);
    let turn = rng.random_range(-1.0..1.0);
    let angular = if planar { Vec3::new(0.0, 0.0, turn) } else { aside(false, rng) * turn };
    Twist { angular, linear }
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
