//! Physical effects that move an arm off its ideal geometry, as data: a law with its place and values is an [`Effect`].
//!
//! An effect acts through one of four hooks. Before the arm is assembled, [`Effect::disturb`] changes what an actuator is set to
//! (its anchors and its length) under the conditions at its [`Site`], and [`Effect::turn`] a servo joint. When the arm is
//! assembled, [`Effect::deflection`] gives by how much a loaded actuator gives way; then the arm is assembled again.
//! [`Effect::displace`] moves the tool rigidly, as the camera sees it under a condition. Effects add up in the order of their
//! list.
//!
//! Arm files, the diagnosis and its reports treat all laws alike: by name, place, constant, and values with names and units.
//!
//! A new law is a variant of [`Effect`], a line in each table below it, its equation in a hook, and its name in [`law_name`].
//! Laws of a joint's torque, an actuator's force or a held position are in [`basis`].

pub mod basis;
pub mod fitted_term;
pub mod law_name;
mod place;

use core::slice;

use crate::actuator::{JointKind, Setting};
use crate::real::{Real, Vec3, exp, real};
use crate::se::Pose;
use fitted_term::FittedTerm;
use law_name::LawName;
pub use place::{Condition, Detail, End, Frame, Place, Plate, Quantity, Site};

/// One effect in an arm: a law, its place and its values. All values zero, it does nothing.
///
/// Lengths are scalars along the actuator, l₀ that of [`Setting::value`]; of a revolute joint they are angles in rad. "Onto its
/// stop" is outwards: state 0 stops the contraction, every other state the extension, so farther onto it is shorter in state 0
/// and longer in every other one. T₀ is the pose of the tool in the base without the effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Effect<T: Real> {
    /// Legs give way along their axis under the weight that they carry: l = l₀ − c·F, F what the leg pushes with, N, positive in
    /// compression. F carries all masses further out, by statics in the posture with sag. Valid while the sag is small against
    /// the levers of the weights; a revolute joint does not sag. J.-P. Merlet, Parallel Robots, Springer, 2006, chapter 9
    /// (stiffness).
    GravitySag {
        /// The legs concerned; one compliance serves all.
        at: Place,
        /// c, shortening per force, m/N, ≥ 0.
        compliance_m_per_n: T,
    },
    /// An actuator that stayed where it was has been shaken off its stop; one that has just moved is seated on it: l = l₀ where
    /// the digit is another than in the word before, or that word is not known; l = l₀ + w·(digit = 0 ? +1 : −1) where it is the
    /// same. Valid where a switching actuator strikes its stop, and where the motion of the others shakes one that holds; the
    /// memory reaches back by one word only. The simplest law of (word, word before) that distinguishes arrival from rest.
    Play {
        /// The actuators concerned; one width serves all.
        at: Place,
        /// w, how far the stop lets one come back, m (rad), ≥ 0.
        width_m: T,
    },
    /// The supply presses an extended actuator into its stop, and the stop yields with it: l = l₀ + k·(p/p₀ − 1)·(l₀ − l_c), l_c
    /// the contracted length, ideal geometry. Valid for small deviations; state 0, pulled in by a spring or by its own stop, does
    /// not change. First-order expansion about the nominal supply.
    SupplyStroke {
        /// The actuators concerned; one gain serves all.
        at: Place,
        /// k, relative change of the stroke per relative deviation of the supply.
        gain: T,
    },
    /// Legs are longer when they are warmer: l = l₀·(1 + α·(ϑ − ϑ₀)). Valid for legs and sliding joints of one even temperature;
    /// an angle does not grow, plates and links keep their size. α is 12e-6/K of steel, 23e-6/K of aluminium.
    ThermalGrowth {
        /// The legs concerned; one coefficient serves all.
        at: Place,
        /// α, coefficient of linear expansion, 1/K.
        expansion_per_k: T,
    },
    /// Actuators creep in their clamps, ever more slowly as a rule: l = l₀ + v·t + w·t²/2, with t = t₁ where no time is known.
    /// Valid within one measurement: no creep continues without end, so afterwards the actuator is taken to stay where it was at
    /// its end. Second-order expansion in time.
    Drift {
        /// The actuators concerned; the same values serve all.
        at: Place,
        /// t₁, when the measurement that showed the drift ended, s.
        until_s: T,
        /// v and w: growth in every state when the measurement began, m/s (rad/s), and the change of this rate, m/s² (rad/s²).
        values: [T; 2],
    },
    /// Actuators of one module that switch together take each other's supply, and do not get as far: l = l₀ + (s + g·δ)·n·(digit
    /// = 0 ? +1 : −1) where the actuator has just switched together with n others of its module, δ the supply over the nominal
    /// one, less one; else l = l₀. Valid while the actuators of a module share a line, a fuse or a hose, and each takes the same
    /// part of it. First-order expansion in the number of others and in the supply.
    Crowding {
        /// The actuators concerned; the same values serve all.
        at: Place,
        /// s and g: how far one stays short of its stop for each of the others, m (rad), and how this grows with the supply, as a
        /// rule below zero.
        values: [T; 2],
    },
    /// The base is elsewhere in the camera's frame, T = D·T₀, or the tool sits elsewhere on the last stage, T = T₀·D; D =
    /// (exp(θ), d). θ and d are expressed in the frame where the base, or the tool, should be. Valid for any displacement; of the
    /// base it is that of the sensor as well, since a camera sees the arm in its own frame. On a planar arm θ_x, θ_y and d_z are
    /// not determined. Loads are those of the arm in its ideal place.
    FrameOffset {
        /// Which.
        frame: Frame,
        /// θ, rad, and d, m.
        values: [T; 6],
    },
    /// The arm creeps in the camera's frame, or the camera does: T = D(t)·T₀, D = (exp(ω·t), v·t), with t = t₁ where no time is
    /// known. ω and v are expressed in the frame where the base was at first. Valid for a slow motion of one speed; afterwards
    /// the base stays where it was at the end. On a planar arm ω_x, ω_y and v_z are not determined. Loads are those of the arm in
    /// its first place.
    BaseDrift {
        /// t₁, when the measurement ended, s.
        until_s: T,
        /// ω, rad/s, and v, m/s.
        values: [T; 6],
    },
    /// The camera's metre is not a metre: p = (1 + s)·p₀ of positions in the base; orientations are not touched. Valid for a
    /// focal length, a marker size or a calibration board that is off.
    Scale {
        /// s, by how much too long a length is measured.
        stretch: T,
    },
    /// A servo joint is elsewhere than its servo reports: q = q₀ + δ. Valid for a horn on the wrong tooth, a zero that was set
    /// badly. Of a joint at the base whose axis is fixed it cannot be distinguished from a turn of the base.
    JointOffset {
        /// Index of the servo joint.
        servo: u8,
        /// δ, what is added to the position, rad (m of a sliding joint).
        offset_rad: T,
    },
    /// One actuator does not reach one of its stops, because the stop has moved or something is in the way: l = l₀ − s in the
    /// state named, l = l₀ in all others. Valid for a stop that is met in the same way whatever the load and the word before.
    StrokeLoss {
        /// Index of the actuator.
        actuator: u8,
        /// The state whose stop is missed.
        state: u8,
        /// s, how much shorter it is, m (rad); negative where it is longer, as when something blocks the way to a contracted
        /// state.
        loss_m: T,
    },
    /// The stops of an actuator give way with every blow: l = l₀ + w·n·(digit = 0 ? −1 : +1), n how often it has switched since
    /// the measurement began, n₁ where that was not counted. Valid while both stops wear alike and evenly. J. F. Archard, Journal
    /// of Applied Physics 24 (1953) 981: wear grows with the way times the load, here of blows that are all alike.
    Wear {
        /// Index of the actuator.
        actuator: u8,
        /// n₁, how often it had switched when the measurement ended that showed the wear.
        until_switches: T,
        /// w, how much farther a stop lets it for each switch, m (rad).
        per_switch_m: T,
    },
    /// An actuator is knocked in its clamps at one moment, and stays where it was knocked to: l = l₀ before t₀, l = l₀ + s from
    /// t₀ on and where no time is known. Valid for one knock; a table that is made later lies after it.
    Step {
        /// Index of the actuator.
        actuator: u8,
        /// t₀, s since the measurement began.
        since_s: T,
        /// s, by how much it is longer in every state since then, m (rad).
        shift_m: T,
    },
    /// A rod is screwed in too far, or its zero is elsewhere, so that an actuator is longer in every state: l = l₀ + s. A stop of
    /// one state that is elsewhere is a stroke loss.
    LengthOffset {
        /// Index of the actuator.
        actuator: u8,
        /// s, m (rad).
        offset_m: T,
    },
    /// One actuator changes the length of another while both are out of their first state, as two cylinders on one bracket that
    /// bends do: l = l₀ + s where the digits of both are above 0, else l = l₀. Valid where only the states of both decide, not
    /// the order in which they switched; that is crowding. The simplest term of two digits.
    Interaction {
        /// Index of the actuator whose length changes.
        actuator: u8,
        /// Index of the one that changes it.
        other: u8,
        /// s, by how much it is longer, m (rad).
        shift_m: T,
    },
    /// A seal or a pad yields after the blow, so that an actuator continues to move for some seconds while it stays in its state:
    /// l = l₀ + (a·(1 − e^(−t/1 s)) + b·(1 − e^(−t/10 s)))·(digit = 0 ? −1 : +1), t since the pose of the row that switched it
    /// was taken. Where no times are known, in a table, t is t₁ for an actuator that stays where it was, and 0 for one that
    /// switches. Valid for linear viscoelasticity at times of 0.1 s to 30 s; before an actuator has first switched t counts from
    /// the start of the measurement. Prony series of two terms with time constants a decade apart, W. N. Findley, J. S. Lai, K.
    /// Onaran, Creep and Relaxation of Nonlinear Viscoelastic Materials, North-Holland, 1976, chapter 5.
    Creep {
        /// The actuators concerned; the same values serve all.
        at: Place,
        /// t₁, the median of t in the measurement that showed the creep, s.
        dwell_s: T,
        /// a and b, creep farther onto the stop within a second and within ten, m (rad).
        values: [T; 2],
    },
    /// The arm, or the camera that looks at it, is moved at one moment, and stays where it was moved to: T = T₀ before t₀, T =
    /// (exp(ω), v)·T₀ from t₀ on and where no time is known. ω and v are expressed in the frame where the base was at first.
    /// Valid for one motion; on a planar arm ω_x, ω_y and v_z are not determined. Loads are those of the arm in its first place.
    BaseStep {
        /// t₀, s since the measurement began.
        since_s: T,
        /// ω, rad, and v, m.
        values: [T; 6],
    },
    /// An anchor of one leg does not sit where the drawing has it: a = a₀ + δ, in the frame of the plate of the leg's own
    /// platform that carries it. Valid in every state and under every load; a joint has no anchors. On a planar platform δ_z has
    /// no effect of first order.
    AnchorOffset {
        /// Index of the actuator whose anchor it is.
        actuator: u8,
        /// The plate that carries the anchor.
        plate: Plate,
        /// δ, m.
        offset: [T; 3],
    },
    /// No law, but what a measurement showed to remain along one variable: see [`fitted_term`].
    FittedTerm(FittedTerm<T>),
}

/// Time constants of creep, s.
const CREEP_TIMES_S: [f64; 2] = [1.0, 10.0];

const fn quantity(name: &'static str, unit: &'static str) -> Quantity {
    Quantity { name, unit }
}

const OF_DISPLACEMENT: [Quantity; 6] = [
    quantity("turn_x", "rad"),
    quantity("turn_y", "rad"),
    quantity("turn_z", "rad"),
    quantity("x", "m"),
    quantity("y", "m"),
    quantity("z", "m"),
];
const OF_DRIFT: [Quantity; 6] = [
    quantity("turn_rate_x", "rad/s"),
    quantity("turn_rate_y", "rad/s"),
    quantity("turn_rate_z", "rad/s"),
    quantity("rate_x", "m/s"),
    quantity("rate_y", "m/s"),
    quantity("rate_z", "m/s"),
];

/// What an effect is: its name, place, values and constant.
impl<T: Real> Effect<T> {
    /// All laws that [`at`](Self::at) makes, in the order in which they are tried.
    pub const LAWS: [LawName; 19] = [
        LawName::GravitySag,
        LawName::Play,
        LawName::SupplyStroke,
        LawName::ThermalGrowth,
        LawName::Drift,
        LawName::Crowding,
        LawName::BaseOffset,
        LawName::ToolOffset,
        LawName::BaseDrift,
        LawName::Scale,
        LawName::JointOffset,
        LawName::StrokeLoss,
        LawName::Wear,
        LawName::Step,
        LawName::LengthOffset,
        LawName::Interaction,
        LawName::Creep,
        LawName::BaseStep,
        LawName::AnchorOffset,
    ];

    /// The law of this name at a place, its values and its constant at zero; `None` where it does not act, and of a fitted term,
    /// whose variable is no place but comes from a measurement.
    pub fn at(name: LawName, place: Place, detail: Detail) -> Option<Self> {
        let (at, zero) = (place, T::zero());
        let is_of_actuators = place.is_actuators() && detail == Detail::All;
        Some(match (name, place, detail) {
            (LawName::GravitySag, ..) if is_of_actuators => Self::GravitySag { at, compliance_m_per_n: zero },
            (LawName::Play, ..) if is_of_actuators => Self::Play { at, width_m: zero },
            (LawName::SupplyStroke, ..) if is_of_actuators => Self::SupplyStroke { at, gain: zero },
            (LawName::ThermalGrowth, ..) if is_of_actuators => Self::ThermalGrowth { at, expansion_per_k: zero },
            (LawName::Drift, ..) if is_of_actuators => Self::Drift { at, until_s: zero, values: [zero; 2] },
            (LawName::Crowding, ..) if is_of_actuators => Self::Crowding { at, values: [zero; 2] },
            (LawName::Creep, ..) if is_of_actuators => Self::Creep { at, dwell_s: zero, values: [zero; 2] },
            (LawName::BaseOffset, Place::Base, Detail::All) => {
                Self::FrameOffset { frame: Frame::Base, values: [zero; 6] }
            }
            (LawName::ToolOffset, Place::Tool, Detail::All) => {
                Self::FrameOffset { frame: Frame::Tool, values: [zero; 6] }
            }
            (LawName::BaseDrift, Place::Base, Detail::All) => Self::BaseDrift { until_s: zero, values: [zero; 6] },
            (LawName::BaseStep, Place::Base, Detail::All) => Self::BaseStep { since_s: zero, values: [zero; 6] },
            (LawName::Scale, Place::Camera, Detail::All) => Self::Scale { stretch: zero },
            (LawName::JointOffset, Place::Servo(servo), Detail::All) => Self::JointOffset { servo, offset_rad: zero },
            (LawName::Wear, Place::Actuator(actuator), Detail::All) => {
                Self::Wear { actuator, until_switches: zero, per_switch_m: zero }
            }
            (LawName::Step, Place::Actuator(actuator), Detail::All) => {
                Self::Step { actuator, since_s: zero, shift_m: zero }
            }
            (LawName::LengthOffset, Place::Actuator(actuator), Detail::All) => {
                Self::LengthOffset { actuator, offset_m: zero }
            }
            (LawName::StrokeLoss, Place::Actuator(actuator), Detail::State(state)) => {
                Self::StrokeLoss { actuator, state, loss_m: zero }
            }
            (LawName::AnchorOffset, Place::Actuator(actuator), Detail::Anchor(plate)) => {
                Self::AnchorOffset { actuator, plate, offset: [zero; 3] }
            }
            (LawName::Interaction, Place::Actuator(actuator), Detail::With(other)) if actuator != other => {
                Self::Interaction { actuator, other, shift_m: zero }
            }
            _ => return None,
        })
    }

    /// The law's name.
    pub fn name(&self) -> LawName {
        match self {
            Self::GravitySag { .. } => LawName::GravitySag,
            Self::Play { .. } => LawName::Play,
            Self::SupplyStroke { .. } => LawName::SupplyStroke,
            Self::ThermalGrowth { .. } => LawName::ThermalGrowth,
            Self::Drift { .. } => LawName::Drift,
            Self::Crowding { .. } => LawName::Crowding,
            Self::FrameOffset { frame: Frame::Base, .. } => LawName::BaseOffset,
            Self::FrameOffset { frame: Frame::Tool, .. } => LawName::ToolOffset,
            Self::BaseDrift { .. } => LawName::BaseDrift,
            Self::Scale { .. } => LawName::Scale,
            Self::JointOffset { .. } => LawName::JointOffset,
            Self::StrokeLoss { .. } => LawName::StrokeLoss,
            Self::Wear { .. } => LawName::Wear,
            Self::Step { .. } => LawName::Step,
            Self::LengthOffset { .. } => LawName::LengthOffset,
            Self::Interaction { .. } => LawName::Interaction,
            Self::Creep { .. } => LawName::Creep,
            Self::BaseStep { .. } => LawName::BaseStep,
            Self::AnchorOffset { .. } => LawName::AnchorOffset,
            Self::FittedTerm(_) => LawName::FittedTerm,
        }
    }

    /// What it acts on.
    pub fn place(&self) -> Place {
        match *self {
            Self::GravitySag { at, .. }
            | Self::Play { at, .. }
            | Self::SupplyStroke { at, .. }
            | Self::ThermalGrowth { at, .. }
            | Self::Drift { at, .. }
            | Self::Crowding { at, .. }
            | Self::Creep { at, .. } => at,
            Self::StrokeLoss { actuator, .. }
            | Self::Wear { actuator, .. }
            | Self::Step { actuator, .. }
            | Self::LengthOffset { actuator, .. }
            | Self::Interaction { actuator, .. }
            | Self::AnchorOffset { actuator, .. } => Place::Actuator(actuator),
            Self::JointOffset { servo, .. } => Place::Servo(servo),
            Self::FrameOffset { frame: Frame::Base, .. } | Self::BaseDrift { .. } | Self::BaseStep { .. } => {
                Place::Base
            }
            Self::FrameOffset { frame: Frame::Tool, .. } | Self::FittedTerm(_) => Place::Tool,
            Self::Scale { .. } => Place::Camera,
        }
    }

    /// Which number of the place it changes.
    pub fn detail(&self) -> Detail {
        match *self {
            Self::StrokeLoss { state, .. } => Detail::State(state),
            Self::AnchorOffset { plate, .. } => Detail::Anchor(plate),
            Self::Interaction { other, .. } => Detail::With(other),
            Self::FittedTerm(term) => Detail::Term { of: term.of.name(), square: term.square },
            _ => Detail::All,
        }
    }

    /// What each of the [`values`](Self::values) is.
    pub fn quantities(&self) -> &'static [Quantity] {
        match self {
            Self::GravitySag { .. } => const { &[quantity("compliance", "m/N")] },
            Self::Play { .. } => const { &[quantity("width", "m")] },
            Self::SupplyStroke { .. } => const { &[quantity("gain", "1")] },
            Self::ThermalGrowth { .. } => const { &[quantity("expansion", "1/K")] },
            Self::Drift { .. } => const { &[quantity("rate", "m/s"), quantity("rate_change", "m/s²")] },
            Self::Crowding { .. } => const { &[quantity("short", "m"), quantity("short_by_supply", "m")] },
            Self::Scale { .. } => const { &[quantity("stretch", "1")] },
            Self::JointOffset { .. } => const { &[quantity("offset", "rad")] },
            Self::StrokeLoss { .. } => const { &[quantity("loss", "m")] },
            Self::Wear { .. } => const { &[quantity("per_switch", "m")] },
            Self::Step { .. } | Self::Interaction { .. } => const { &[quantity("shift", "m")] },
            Self::LengthOffset { .. } => const { &[quantity("offset", "m")] },
            Self::Creep { .. } => const { &[quantity("fast", "m"), quantity("slow", "m")] },
            Self::AnchorOffset { .. } => const { &[quantity("x", "m"), quantity("y", "m"), quantity("z", "m")] },
            Self::BaseDrift { .. } => &OF_DRIFT,
            Self::FrameOffset { .. } | Self::BaseStep { .. } | Self::FittedTerm(_) => &OF_DISPLACEMENT,
        }
    }

    /// The numbers that a fit determines; all zero, the effect does nothing.
    pub fn values(&self) -> &[T] {
        match self {
            Self::GravitySag { compliance_m_per_n: value, .. }
            | Self::Play { width_m: value, .. }
            | Self::SupplyStroke { gain: value, .. }
            | Self::ThermalGrowth { expansion_per_k: value, .. }
            | Self::Scale { stretch: value }
            | Self::JointOffset { offset_rad: value, .. }
            | Self::StrokeLoss { loss_m: value, .. }
            | Self::Wear { per_switch_m: value, .. }
            | Self::Step { shift_m: value, .. }
            | Self::LengthOffset { offset_m: value, .. }
            | Self::Interaction { shift_m: value, .. } => slice::from_ref(value),
            Self::Drift { values, .. } | Self::Crowding { values, .. } | Self::Creep { values, .. } => values,
            Self::AnchorOffset { offset, .. } => offset,
            Self::FrameOffset { values, .. }
            | Self::BaseDrift { values, .. }
            | Self::BaseStep { values, .. }
            | Self::FittedTerm(FittedTerm { values, .. }) => values,
        }
    }

    /// The same, to change them.
    pub fn values_mut(&mut self) -> &mut [T] {
        match self {
            Self::GravitySag { compliance_m_per_n: value, .. }
            | Self::Play { width_m: value, .. }
            | Self::SupplyStroke { gain: value, .. }
            | Self::ThermalGrowth { expansion_per_k: value, .. }
            | Self::Scale { stretch: value }
            | Self::JointOffset { offset_rad: value, .. }
            | Self::StrokeLoss { loss_m: value, .. }
            | Self::Wear { per_switch_m: value, .. }
            | Self::Step { shift_m: value, .. }
            | Self::LengthOffset { offset_m: value, .. }
            | Self::Interaction { shift_m: value, .. } => slice::from_mut(value),
            Self::Drift { values, .. } | Self::Crowding { values, .. } | Self::Creep { values, .. } => values,
            Self::AnchorOffset { offset, .. } => offset,
            Self::FrameOffset { values, .. }
            | Self::BaseDrift { values, .. }
            | Self::BaseStep { values, .. }
            | Self::FittedTerm(FittedTerm { values, .. }) => values,
        }
    }

    /// The number in the law that is given and not fitted, as the moment of a step is.
    pub fn constant(&self) -> Option<(Quantity, T)> {
        match *self {
            Self::Drift { until_s, .. } | Self::BaseDrift { until_s, .. } => Some((quantity("until", "s"), until_s)),
            Self::Step { since_s, .. } | Self::BaseStep { since_s, .. } => Some((quantity("since", "s"), since_s)),
            Self::Creep { dwell_s, .. } => Some((quantity("dwell", "s"), dwell_s)),
            Self::Wear { until_switches, .. } => Some((quantity("until_switches", "1"), until_switches)),
            _ => None,
        }
    }

    /// The same, to change it.
    pub fn constant_mut(&mut self) -> Option<&mut T> {
        match self {
            Self::Drift { until_s: constant, .. }
            | Self::BaseDrift { until_s: constant, .. }
            | Self::Step { since_s: constant, .. }
            | Self::BaseStep { since_s: constant, .. }
            | Self::Creep { dwell_s: constant, .. }
            | Self::Wear { until_switches: constant, .. } => Some(constant),
            _ => None,
        }
    }

    /// Keeps what the law had come to where the measurement that it was fitted to ended.
    pub fn settle(&mut self, end: &End<T>) {
        match self {
            Self::Drift { until_s, .. } | Self::BaseDrift { until_s, .. } => *until_s = end.time_s,
            Self::Creep { dwell_s, .. } => *dwell_s = end.dwell_s,
            Self::Wear { actuator, until_switches, .. } => {
                if let Some(counted) = end.switches.get(usize::from(*actuator)) {
                    *until_switches = *counted;
                }
            }
            _ => {}
        }
    }
}

/// What an effect does: its equations.
impl<T: Real> Effect<T> {
    /// Changes what the actuator at `site` is set to. Only called within [`place`](Self::place).
    pub fn disturb(&self, site: &Site<T>, setting: &mut Setting<T>) {
        // Farther onto the stop of this state.
        let onto_stop = |way: T| if site.digit == 0 { -way } else { way };
        match *self {
            Self::Play { width_m, .. } if site.previous == Some(site.digit) => setting.value -= onto_stop(width_m),
            Self::SupplyStroke { gain, .. } => setting.value += gain * site.supply_deviation * site.stroke,
            Self::ThermalGrowth { expansion_per_k, .. } if site.kind == JointKind::Prismatic => {
                setting.value *= T::one() + expansion_per_k * site.temperature_rise_k;
            }
            Self::Drift { until_s, values: [rate, change], .. } => {
                let time_s = site.time_s.unwrap_or(until_s);
                setting.value += (rate + change * real(0.5) * time_s) * time_s;
            }
            Self::Crowding { values: [short, by_supply], .. }
                if site.previous.is_some_and(|previous| previous != site.digit) =>
            {
                let short = (short + by_supply * site.supply_deviation) * real(f64::from(site.together));
                setting.value -= onto_stop(short);
            }
            Self::StrokeLoss { state, loss_m, .. } if site.digit == state => setting.value -= loss_m,
            Self::Wear { until_switches, per_switch_m, .. } => {
                setting.value += onto_stop(per_switch_m * site.switches.unwrap_or(until_switches));
            }
            Self::Step { since_s, shift_m, .. } if site.time_s.is_none_or(|time_s| time_s >= since_s) => {
                setting.value += shift_m;
            }
            Self::LengthOffset { offset_m, .. } => setting.value += offset_m,
            Self::Interaction { other, shift_m, .. }
                if site.digit > 0 && site.word.is_some_and(|word| word.digit(other.into()) > 0) =>
            {
                setting.value += shift_m;
            }
            Self::Creep { dwell_s, values, .. } => {
                let stays = site.previous == Some(site.digit);
                let dwell_s = site.dwell_s.unwrap_or(if stays { dwell_s } else { T::zero() });
                let terms = values.iter().zip(CREEP_TIMES_S);
                let crept = terms
                    .fold(T::zero(), |sum, (size, time_s)| sum + *size * (T::one() - exp(-dwell_s / real(time_s))));
                setting.value += onto_stop(crept);
            }
            Self::AnchorOffset { plate: Plate::Base, offset, .. } => setting.base += Vec3::from(offset),
            Self::AnchorOffset { plate: Plate::Top, offset, .. } => setting.top += Vec3::from(offset),
            _ => {}
        }
    }

    /// By how much the value of the actuator at `site` grows when it pushes with `force`, N, in compression. Only called within
    /// [`place`](Self::place), and where [`bears_load`](Self::bears_load).
    pub fn deflection(&self, site: &Site<T>, force: T) -> T {
        match (self, site.kind) {
            (Self::GravitySag { compliance_m_per_n, .. }, JointKind::Prismatic) => -*compliance_m_per_n * force,
            _ => T::zero(),
        }
    }

    /// Whether it has a [`deflection`](Self::deflection), so that the forces are worth computing.
    pub fn bears_load(&self) -> bool {
        matches!(self, Self::GravitySag { .. })
    }

    /// Changes the position of the servo joint at [`place`](Self::place).
    pub fn turn(&self, setting: &mut Setting<T>) {
        if let Self::JointOffset { offset_rad, .. } = self {
            setting.value += *offset_rad;
        }
    }

    /// The pose of the tool in the base as it is seen, where the arm alone would have it `predicted`.
    pub fn displace(&self, predicted: Pose<T>, condition: &Condition<T>) -> Pose<T> {
        let rigid = |[rx, ry, rz, x, y, z]: [T; 6]| Pose::new(&Vec3::new(rx, ry, rz), Vec3::new(x, y, z));
        match *self {
            Self::FrameOffset { frame: Frame::Base, values } => rigid(values) * predicted,
            Self::FrameOffset { frame: Frame::Tool, values } => predicted * rigid(values),
            Self::BaseDrift { until_s, values } => {
                let time_s = condition.time_s.unwrap_or(until_s);
                rigid(values.map(|rate| rate * time_s)) * predicted
            }
            Self::BaseStep { since_s, values } if condition.time_s.is_none_or(|time_s| time_s >= since_s) => {
                rigid(values) * predicted
            }
            Self::Scale { stretch } => Pose { position: predicted.position * (T::one() + stretch), ..predicted },
            Self::FittedTerm(term) => term.displace(predicted, condition),
            _ => predicted,
        }
    }
}

impl Effect<f64> {
    /// The same effect in numbers of type `U`.
    pub fn cast<U: Real>(&self) -> Effect<U> {
        let n = real::<U>;
        match *self {
            Self::GravitySag { at, compliance_m_per_n: c } => Effect::GravitySag { at, compliance_m_per_n: n(c) },
            Self::Play { at, width_m } => Effect::Play { at, width_m: n(width_m) },
            Self::SupplyStroke { at, gain } => Effect::SupplyStroke { at, gain: n(gain) },
            Self::ThermalGrowth { at, expansion_per_k: k } => Effect::ThermalGrowth { at, expansion_per_k: n(k) },
            Self::Drift { at, until_s, values } => Effect::Drift { at, until_s: n(until_s), values: values.map(n) },
            Self::Crowding { at, values } => Effect::Crowding { at, values: values.map(n) },
            Self::FrameOffset { frame, values } => Effect::FrameOffset { frame, values: values.map(n) },
            Self::BaseDrift { until_s, values } => Effect::BaseDrift { until_s: n(until_s), values: values.map(n) },
            Self::Scale { stretch } => Effect::Scale { stretch: n(stretch) },
            Self::JointOffset { servo, offset_rad } => Effect::JointOffset { servo, offset_rad: n(offset_rad) },
            Self::StrokeLoss { actuator, state, loss_m } => Effect::StrokeLoss { actuator, state, loss_m: n(loss_m) },
            Self::Wear { actuator, until_switches, per_switch_m } => {
                Effect::Wear { actuator, until_switches: n(until_switches), per_switch_m: n(per_switch_m) }
            }
            Self::Step { actuator, since_s, shift_m } => {
                Effect::Step { actuator, since_s: n(since_s), shift_m: n(shift_m) }
            }
            Self::LengthOffset { actuator, offset_m } => Effect::LengthOffset { actuator, offset_m: n(offset_m) },
            Self::Interaction { actuator, other, shift_m } => {
                Effect::Interaction { actuator, other, shift_m: n(shift_m) }
            }
            Self::Creep { at, dwell_s, values } => Effect::Creep { at, dwell_s: n(dwell_s), values: values.map(n) },
            Self::BaseStep { since_s, values } => Effect::BaseStep { since_s: n(since_s), values: values.map(n) },
            Self::AnchorOffset { actuator, plate, offset } => {
                Effect::AnchorOffset { actuator, plate, offset: offset.map(n) }
            }
            Self::FittedTerm(term) => Effect::FittedTerm(term.cast()),
        }
    }
}

#[cfg(test)]
mod tests;
