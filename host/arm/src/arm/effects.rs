//! Effects in an arm file: `law`, where it acts, its constant and its values.

use darm_core::actuator::MAX_STATES;
use darm_core::effect::fitted_term::{FittedTerm, Variable};
use darm_core::effect::law_name::LawName;
use darm_core::effect::{Detail, Effect, Frame, Place, Plate, Quantity};

use super::ArmFault;
use super::ArmModel;
use super::raw::{RawEffect, RawFrame, RawPlate, RawVariable};

/// Keys that say where an effect acts, each with the first place that it can name.
const PLACE_KEYS: [(&str, Place, Detail); 6] = [
    ("actuator", Place::Actuator(0), Detail::All),
    ("module", Place::Module(0), Detail::All),
    ("servo", Place::Servo(0), Detail::All),
    ("state", Place::Actuator(0), Detail::State(0)),
    ("plate", Place::Actuator(0), Detail::Anchor(Plate::Base)),
    ("other", Place::Actuator(0), Detail::With(1)),
];

/// The effect that `raw` describes, in the arm of `model`.
pub(super) fn effect(raw: &RawEffect, model: &ArmModel) -> Result<Effect<f64>, ArmFault> {
    let found = raw.law.get_ref();
    let name = LawName::named(found).filter(|name| arm_laws().contains(name));
    let name = name.ok_or_else(|| ArmFault::UnknownLaw {
        found: found.clone(),
        known: arm_laws().iter().map(|law| law.as_str()).collect(),
    })?;
    let mut effect = match name {
        LawName::FittedTerm => Effect::FittedTerm(fitted_term(raw, model)?),
        name => at_its_place(name, raw, model)?,
    };
    if let Some((quantity, _)) = effect.constant() {
        let constant = raw.constants().into_iter().find(|(key, _)| *key == value_key(&quantity));
        let (key, given) = constant.expect("an effect in a file has a key for each constant of a law");
        let given = given.ok_or(ArmFault::Missing { key, of: name.as_str() })?;
        effect.constant_mut().into_iter().for_each(|constant| *constant = given.0);
    }
    set_values(&mut effect, raw)?;
    Ok(effect)
}

/// The laws that an arm file may name.
fn arm_laws() -> Vec<LawName> {
    let mut laws = Effect::<f64>::LAWS.to_vec();
    laws.push(LawName::FittedTerm);
    laws.sort();
    laws
}

/// The effect with its constant and values at zero.
fn at_its_place(name: LawName, raw: &RawEffect, model: &ArmModel) -> Result<Effect<f64>, ArmFault> {
    let places = match (raw.actuator, raw.module, raw.servo) {
        (Some(actuator), ..) => vec![Place::Actuator(actuator)],
        (None, Some(module), _) => vec![Place::Module(module)],
        (None, None, Some(servo)) => vec![Place::Servo(servo)],
        (None, None, None) => vec![Place::Arm, Place::Base, Place::Tool, Place::Camera],
    };
    let detail = match (raw.state, raw.plate, raw.other) {
        (Some(state), ..) => Detail::State(state),
        (None, Some(RawPlate::Base), _) => Detail::Anchor(Plate::Base),
        (None, Some(RawPlate::Top), _) => Detail::Anchor(Plate::Top),
        (None, None, Some(other)) if raw.actuator == Some(other) => {
            return Err(ArmFault::WithItself { actuator: other });
        }
        (None, None, Some(other)) => Detail::With(other),
        (None, None, None) => Detail::All,
    };
    let effect = places.iter().find_map(|place| Effect::at(name, *place, detail));
    let effect = effect.ok_or_else(|| wrong_place_keys(name, raw))?;
    check_place(&effect, model).map(|()| effect)
}

/// Which key is missing, or which is too much, where a law cannot act at the place that the keys name.
fn wrong_place_keys(name: LawName, raw: &RawEffect) -> ArmFault {
    let given = [
        raw.actuator.is_some(),
        raw.module.is_some(),
        raw.servo.is_some(),
        raw.state.is_some(),
        raw.plate.is_some(),
        raw.other.is_some(),
    ];
    let acts = PLACE_KEYS.map(|(_, place, detail)| Effect::<f64>::at(name, place, detail).is_some());
    // A law of a state, of an anchor or of two actuators acts on an actuator.
    let needed = [acts[0] || acts[3] || acts[4] || acts[5], acts[1], acts[2], acts[3], acts[4], acts[5]];
    let keys = PLACE_KEYS.map(|(key, ..)| key);
    match (0..keys.len()).find(|&k| given[k] && !needed[k]) {
        Some(useless) => ArmFault::Useless { key: keys[useless], of: name.as_str() },
        None => {
            let missing = (0..keys.len()).find(|&k| needed[k] && !given[k]).unwrap_or(0);
            ArmFault::Missing { key: keys[missing], of: name.as_str() }
        }
    }
}

/// Refuses a place that the arm does not have.
fn check_place(effect: &Effect<f64>, model: &ArmModel) -> Result<(), ArmFault> {
    let chain = &model.chain;
    let name = effect.name().as_str();
    match (effect.place(), effect.detail()) {
        (Place::Actuator(actuator), detail) => {
            check_number(name, ("actuator", actuator), chain.n_actuators())?;
            match detail {
                Detail::State(state) => check_state(name, (actuator, state), model),
                Detail::With(other) => check_number(name, ("actuator", other), chain.n_actuators()),
                Detail::All | Detail::Anchor(_) | Detail::Term { .. } => Ok(()),
            }
        }
        (Place::Module(module), _) => check_number(name, ("module", module), chain.stages.len()),
        (Place::Servo(servo), _) => check_number(name, ("servo", servo), chain.n_servos()),
        (Place::Arm | Place::Base | Place::Tool | Place::Camera, _) => Ok(()),
    }
}

fn check_number(law: &'static str, (what, number): (&'static str, u8), count: usize) -> Result<(), ArmFault> {
    let fault = ArmFault::NoSuchPlace { law, what, number, of: None, count };
    if usize::from(number) < count { Ok(()) } else { Err(fault) }
}

fn check_state(law: &'static str, (actuator, state): (u8, u8), model: &ArmModel) -> Result<(), ArmFault> {
    check_number(law, ("actuator", actuator), model.chain.n_actuators())?;
    let count = model.chain.n_states(actuator.into()).min(MAX_STATES);
    let fault = ArmFault::NoSuchPlace { law, what: "state", number: state, of: Some(actuator), count };
    if usize::from(state) < count { Ok(()) } else { Err(fault) }
}

/// Sets the values of a law to those of the file.
fn set_values(effect: &mut Effect<f64>, raw: &RawEffect) -> Result<(), ArmFault> {
    let keys: Vec<String> = effect.quantities().iter().map(value_key).collect();
    let given = raw.values.get_ref();
    if given.len() != keys.len() || !keys.iter().all(|key| given.contains_key(key)) {
        return Err(ArmFault::EffectValues { expected: keys });
    }
    effect.values_mut().iter_mut().zip(&keys).for_each(|(value, key)| *value = given[key].0);
    Ok(())
}

/// A term with its values at zero.
fn fitted_term(raw: &RawEffect, model: &ArmModel) -> Result<FittedTerm<f64>, ArmFault> {
    let along = raw.along.ok_or(ArmFault::Missing { key: "along", of: "a fitted term" })?;
    let frame = match raw.frame.ok_or(ArmFault::Missing { key: "frame", of: "a fitted term" })? {
        RawFrame::Base => Frame::Base,
        RawFrame::Tool => Frame::Tool,
    };
    let of = variable(along);
    let name = LawName::FittedTerm.as_str();
    let mut span = 1.0;
    match of {
        Variable::Supply { span: given, .. } | Variable::Temperature { span: given, .. } => span = given,
        Variable::Servo { servo, span: given, .. } => {
            check_number(name, ("servo", servo), model.chain.n_servos())?;
            span = given;
        }
        Variable::Digits { first, second } => {
            check_state(name, first, model)?;
            second.map_or(Ok(()), |second| check_state(name, second, model))?;
        }
        Variable::Stayed { actuator, .. } => check_number(name, ("actuator", actuator), model.chain.n_actuators())?,
    }
    match span > 0.0 {
        true => Ok(FittedTerm { of, square: raw.square.unwrap_or(false), frame, values: [0.0; 6] }),
        false => Err(ArmFault::NotPositive { key: "the span of a fitted term", value: span }),
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

/// The keys of a fitted term other than its law and values.
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

/// The keys of an effect other than its law and values.
pub(super) fn place_keys(effect: &Effect<f64>) -> String {
    if let Effect::FittedTerm(term) = effect {
        return term_keys(term);
    }
    let place = match effect.place() {
        Place::Actuator(actuator) => format!("actuator = {actuator}\n"),
        Place::Module(module) => format!("module = {module}\n"),
        Place::Servo(servo) => format!("servo = {servo}\n"),
        Place::Arm | Place::Base | Place::Tool | Place::Camera => String::new(),
    };
    let detail = match effect.detail() {
        Detail::State(state) => format!("state = {state}\n"),
        Detail::Anchor(Plate::Base) => "plate = \"base\"\n".into(),
        Detail::Anchor(Plate::Top) => "plate = \"top\"\n".into(),
        Detail::With(other) => format!("other = {other}\n"),
        Detail::All | Detail::Term { .. } => String::new(),
    };
    let constant = effect.constant().map(|(quantity, value)| format!("{} = {value:?}\n", value_key(&quantity)));
    format!("{place}{detail}{}", constant.unwrap_or_default())
}
