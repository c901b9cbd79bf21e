//! Effects by the names of their laws: the only list of laws that the arm file needs.

use darm_core::actuator::MAX_STATES;
use darm_core::effect::anchor_offset::{AnchorOffset, Plate};
use darm_core::effect::crowding::Crowding;
use darm_core::effect::drift::Drift;
use darm_core::effect::fitted_term::{FittedTerm, Variable};
use darm_core::effect::frame_offset::{Frame, FrameOffset};
use darm_core::effect::gravity_sag::GravitySag;
use darm_core::effect::joint_offset::JointOffset;
use darm_core::effect::play::Play;
use darm_core::effect::scale::Scale;
use darm_core::effect::step::Step;
use darm_core::effect::stroke_loss::StrokeLoss;
use darm_core::effect::supply_stroke::SupplyStroke;
use darm_core::effect::thermal_growth::ThermalGrowth;
use darm_core::effect::wear::Wear;
use darm_core::effect::{Effect, Place, Quantity};
use darm_core::real::Vec3;

use super::ArmFault;
use super::ArmModel;
use super::raw::{RawEffect, RawFrame, RawPlate, RawVariable};
use darm_robot::source::Number;

const LAWS: [&str; 15] = [
    "stroke-loss",
    "anchor-offset",
    "gravity-sag",
    "play",
    "supply-stroke",
    "thermal-growth",
    "step",
    "drift",
    "wear",
    "crowding",
    "base-offset",
    "tool-offset",
    "scale",
    "joint-offset",
    "fitted-term",
];

/// The effect that `raw` describes, in the arm of `model`.
pub(super) fn effect(raw: &RawEffect, model: &ArmModel) -> Result<Effect<f64>, ArmFault> {
    let at = place(raw);
    check_place(at, model)?;
    let actuator = || raw.actuator.ok_or(ArmFault::Missing { key: "actuator", of: "an effect on one actuator" });
    let number = |number: Option<Number>, key, of| number.map(|n| n.0).ok_or(ArmFault::Missing { key, of });
    let mut effect: Effect<f64> = match raw.law.get_ref().as_str() {
        "stroke-loss" => {
            let state = raw.state.ok_or(ArmFault::Missing { key: "state", of: "a stroke loss" })?;
            let actuator = actuator()?;
            if usize::from(state) >= model.chain.n_states(actuator.into()).min(MAX_STATES) {
                return Err(ArmFault::NoSuchPlace);
            }
            StrokeLoss { actuator, state, loss_m: 0.0 }.into()
        }
        "anchor-offset" => {
            let plate = match raw.plate.ok_or(ArmFault::Missing { key: "plate", of: "an anchor offset" })? {
                RawPlate::Base => Plate::Base,
                RawPlate::Top => Plate::Top,
            };
            AnchorOffset { actuator: actuator()?, plate, offset: Vec3::zeros() }.into()
        }
        "gravity-sag" => GravitySag { at, compliance_m_per_n: 0.0 }.into(),
        "play" => Play { at, width_m: 0.0 }.into(),
        "supply-stroke" => SupplyStroke { at, gain: 0.0 }.into(),
        "thermal-growth" => ThermalGrowth { at, expansion_per_k: 0.0 }.into(),
        "step" => {
            let since_s = number(raw.since_s, "since_s", "a step")?;
            Step { actuator: actuator()?, since_s, shift_m: 0.0 }.into()
        }
        "drift" => Drift { at, until_s: number(raw.until_s, "until_s", "a drift")?, values: [0.0; 2] }.into(),
        "wear" => {
            let until_switches = number(raw.until_switches, "until_switches", "wear")?;
            Wear { actuator: actuator()?, until_switches, per_switch_m: 0.0 }.into()
        }
        "crowding" => Crowding { at, values: [0.0; 2] }.into(),
        "base-offset" => FrameOffset { frame: Frame::Base, values: [0.0; 6] }.into(),
        "tool-offset" => FrameOffset { frame: Frame::Tool, values: [0.0; 6] }.into(),
        "scale" => Scale { stretch: 0.0 }.into(),
        "joint-offset" => {
            let servo = raw.servo.ok_or(ArmFault::Missing { key: "servo", of: "a joint offset" })?;
            if usize::from(servo) >= model.chain.n_servos() {
                return Err(ArmFault::NoSuchPlace);
            }
            JointOffset { servo, offset_rad: 0.0 }.into()
        }
        "fitted-term" => fitted_term(raw, model)?.into(),
        found => return Err(ArmFault::UnknownLaw { found: found.into(), known: LAWS.to_vec() }),
    };
    let law = effect.law_mut();
    let keys: Vec<String> = law.quantities().iter().map(value_key).collect();
    let given = raw.values.get_ref();
    if given.len() != keys.len() || !keys.iter().all(|key| given.contains_key(key)) {
        return Err(ArmFault::EffectValues { expected: keys });
    }
    law.values_mut().iter_mut().zip(&keys).for_each(|(value, key)| *value = given[key].0);
    Ok(effect)
}

/// A term with its values at zero.
fn fitted_term(raw: &RawEffect, model: &ArmModel) -> Result<FittedTerm<f64>, ArmFault> {
    let along = raw.along.ok_or(ArmFault::Missing { key: "along", of: "a fitted term" })?;
    let frame = match raw.frame.ok_or(ArmFault::Missing { key: "frame", of: "a fitted term" })? {
        RawFrame::Base => Frame::Base,
        RawFrame::Tool => Frame::Tool,
    };
    let of = variable(along);
    let state_exists = |(actuator, state): (u8, u8)| {
        usize::from(actuator) < model.chain.n_actuators() && usize::from(state) < model.chain.n_states(actuator.into())
    };
    let (exists, span) = match of {
        Variable::Supply { span, .. } | Variable::Temperature { span, .. } => (true, span),
        Variable::Servo { servo, span, .. } => (usize::from(servo) < model.chain.n_servos(), span),
        Variable::Digits { first, second } => (state_exists(first) && second.is_none_or(state_exists), 1.0),
        Variable::Stayed { actuator, .. } => (usize::from(actuator) < model.chain.n_actuators(), 1.0),
    };
    match (exists, span > 0.0) {
        (true, true) => Ok(FittedTerm { of, square: raw.square.unwrap_or(false), frame, values: [0.0; 6] }),
        (true, false) => Err(ArmFault::NotPositive { key: "the span of a fitted term", value: span }),
        (false, _) => Err(ArmFault::NoSuchPlace),
    }
}

fn variable(raw: RawVariable) -> Variable<f64> {
    match raw {
        RawVariable::Supply { center_pa, span_pa } => Variable::Supply { center: center_pa.0, span: span_pa.0 },
        RawVariable::Temperature { center_k, span_k } => Variable::Temperature { center: center_k.0, span: span_k.0 },
        RawVariable::Servo { index, center, span } => Variable::Servo { servo: index, center: center.0, span: span.0 },
        RawVariable::Digit(actuator, state) => Variable::Digits { first: (actuator, state), second: None },
        RawVariable::Digits(first, second) => Variable::Digits { first, second: Some(second) },
        RawVariable::Stayed { actuator, share } => Variable::Stayed { actuator, share: share.0 },
    }
}

/// The keys of a fitted term beside its law and values.
fn term_keys(term: &FittedTerm<f64>) -> String {
    let along = match term.of {
        Variable::Supply { center, span } => format!("supply = {{ center_pa = {center:?}, span_pa = {span:?} }}"),
        Variable::Temperature { center, span } => {
            format!("temperature = {{ center_k = {center:?}, span_k = {span:?} }}")
        }
        Variable::Servo { servo, center, span } => {
            format!("servo = {{ index = {servo}, center = {center:?}, span = {span:?} }}")
        }
        Variable::Digits { first: (actuator, state), second: None } => format!("digit = [{actuator}, {state}]"),
        Variable::Digits { first: (a, i), second: Some((b, j)) } => format!("digits = [[{a}, {i}], [{b}, {j}]]"),
        Variable::Stayed { actuator, share } => format!("stayed = {{ actuator = {actuator}, share = {share:?} }}"),
    };
    let frame = if term.frame == Frame::Base { "base" } else { "tool" };
    format!("along = {{ {along} }}\nsquare = {}\nframe = \"{frame}\"\n", term.square)
}

/// The key of a value: its name and its unit, `loss_m`, `compliance_m_per_n`, `rate_change_m_per_s2`, `gain`.
pub(super) fn value_key(quantity: &Quantity) -> String {
    let unit = quantity.unit.to_lowercase().replace('/', "_per_").replace('²', "2");
    match unit.trim_start_matches('1') {
        "" => quantity.name.into(),
        unit => format!("{}_{}", quantity.name, unit.trim_start_matches('_')),
    }
}

/// The keys of an effect beside its law and values.
pub(super) fn place_keys(effect: &Effect<f64>) -> String {
    let place = match effect.law().place() {
        Place::Actuator(actuator) => format!("actuator = {actuator}\n"),
        Place::Module(module) => format!("module = {module}\n"),
        Place::Servo(servo) => format!("servo = {servo}\n"),
        Place::Arm | Place::Base | Place::Tool | Place::Camera => String::new(),
    };
    match effect {
        Effect::StrokeLoss(law) => format!("{place}state = {}\n", law.state),
        Effect::AnchorOffset(law) => match law.plate {
            Plate::Base => format!("{place}plate = \"base\"\n"),
            Plate::Top => format!("{place}plate = \"top\"\n"),
        },
        Effect::Step(law) => format!("{place}since_s = {:?}\n", law.since_s),
        Effect::Drift(law) => format!("{place}until_s = {:?}\n", law.until_s),
        Effect::Wear(law) => format!("{place}until_switches = {:?}\n", law.until_switches),
        Effect::FittedTerm(term) => term_keys(term),
        _ => place,
    }
}

fn place(raw: &RawEffect) -> Place {
    match (raw.actuator, raw.module) {
        (Some(actuator), _) => Place::Actuator(actuator),
        (None, Some(module)) => Place::Module(module),
        (None, None) => Place::Arm,
    }
}

fn check_place(at: Place, model: &ArmModel) -> Result<(), ArmFault> {
    let exists = match at {
        Place::Actuator(actuator) => usize::from(actuator) < model.chain.n_actuators(),
        Place::Module(module) => usize::from(module) < model.chain.stages.len(),
        Place::Servo(_) | Place::Arm | Place::Base | Place::Tool | Place::Camera => true,
    };
    if exists { Ok(()) } else { Err(ArmFault::NoSuchPlace) }
}
