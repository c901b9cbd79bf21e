//! Candidate effects: every effect law of `darm-core` at every place where it can act.

use darm_core::effect::fitted_term::{FittedTerm, VariableName};
use darm_core::effect::law_name::LawName;
use darm_core::effect::{Detail, Effect, Place as Part, Plate};

use crate::effect::{Place, Site};
use darm_arm::arm::{Arm, ArmModel};

/// All effects that may be there, with their values at zero: each law at each place. A step is one that was there from
/// the start: when it came is for a fit to say.
pub fn all(model: &ArmModel) -> Vec<Effect<f64>> {
    let places = places(model);
    let effects = Effect::<f64>::LAWS
        .into_iter()
        .flat_map(|law| places.iter().filter_map(move |&(place, detail)| Effect::at(law, place, detail)));
    effects.filter(is_tried).collect()
}

/// One actuator alone has no other to switch with.
fn is_tried(effect: &Effect<f64>) -> bool {
    effect.name() != LawName::Crowding || !matches!(effect.place(), Part::Actuator(_))
}

/// All places of an arm.
fn places(model: &ArmModel) -> Vec<(Part, Detail)> {
    let mut places: Vec<_> = groups(model).into_iter().map(|group| (group, Detail::All)).collect();
    places.extend([Part::Base, Part::Tool, Part::Camera].map(|part| (part, Detail::All)));
    places.extend((0..model.chain.n_servos() as u8).map(|servo| (Part::Servo(servo), Detail::All)));
    for (index, (stage, leg)) in model.chain.actuators().enumerate() {
        let actuator = Part::Actuator(index as u8);
        let states = 0..model.chain.n_states(index) as u8;
        places.extend(states.map(|state| (actuator, Detail::State(state))));
        if model.chain.stages[stage].leg(leg).is_some() {
            places.extend([Plate::Base, Plate::Top].map(|plate| (actuator, Detail::Anchor(plate))));
        }
        let others = (0..model.chain.n_actuators()).filter(|other| *other != index);
        places.extend(others.map(|other| (actuator, Detail::With(other as u8))));
    }
    places
}

/// The arm, its modules and its actuators; what has one actuator only is named once.
fn groups(model: &ArmModel) -> Vec<Part> {
    let stages = model.chain.stages.iter().enumerate();
    let modules: Vec<u8> = stages.filter(|(_, stage)| stage.n_actuators() > 1).map(|(k, _)| k as u8).collect();
    let n_actuators = model.chain.n_actuators();
    let mut places: Vec<Part> = (0..n_actuators as u8).map(Part::Actuator).collect();
    if modules.len() > 1
        || modules.len() == 1 && model.chain.n_actuators() > model.chain.stages[modules[0] as usize].n_actuators()
    {
        places.extend(modules.into_iter().map(Part::Module));
    }
    if n_actuators > 1 {
        places.push(Part::Arm);
    }
    places
}

/// An effect that begins at a moment, from another moment on, s; `None` of one that does not.
pub fn beginning(effect: &Effect<f64>, since_s: f64) -> Option<Effect<f64>> {
    match *effect {
        Effect::Step { actuator, shift_m, .. } => Some(Effect::Step { actuator, since_s, shift_m }),
        Effect::BaseStep { values, .. } => Some(Effect::BaseStep { since_s, values }),
        _ => None,
    }
}

/// Whether two effects are the same law at the same place, whatever their values and moments.
pub fn same(a: &Effect<f64>, b: &Effect<f64>) -> bool {
    a.name() == b.name() && Place::of_arm(a) == Place::of_arm(b)
}

/// Where an effect acts, as a short unambiguous code: `actuator 4, state 1`.
pub fn place_code(effect: &Effect<f64>) -> String {
    let detail = match effect.detail() {
        Detail::All => String::new(),
        Detail::State(state) => format!(", state {state}"),
        Detail::Anchor(Plate::Base) => ", base anchor".into(),
        Detail::Anchor(Plate::Top) => ", top anchor".into(),
        Detail::With(other) => format!(", with actuator {other}"),
        Detail::Term { of, square } => {
            format!(", along {}", variable(of, square, &|of| format!("actuator {of}"), &|of| format!("servo {of}")))
        }
    };
    let part = match effect.place() {
        Part::Actuator(actuator) => format!("actuator {actuator}"),
        Part::Module(module) => format!("module {module}"),
        Part::Arm => "arm".into(),
        Part::Servo(servo) => format!("servo {servo}"),
        Part::Base => "base".into(),
        Part::Tool => "tool".into(),
        Part::Camera => "camera".into(),
    };
    part + &detail
}

/// The variable of a fitted term, as a person would call it: `the square of temperature`.
pub fn term_name(arm: &Arm, term: &FittedTerm<f64>) -> String {
    let actuator = |actuator: u8| arm.actuator_name(actuator.into());
    variable(term.of.name(), term.square, &actuator, &|servo| format!("servo {servo}"))
}

fn variable(of: VariableName, square: bool, actuator: &dyn Fn(u8) -> String, servo: &dyn Fn(u8) -> String) -> String {
    let digit = |(of, state): (u8, u8)| format!("{} in state {state}", actuator(of));
    let variable = match of {
        VariableName::Supply => "supply".into(),
        VariableName::Temperature => "temperature".into(),
        VariableName::Servo(of) => servo(of),
        VariableName::Digits(first, None) => digit(first),
        VariableName::Digits(first, Some(second)) => format!("{} with {}", digit(first), digit(second)),
        VariableName::Stayed(of) => format!("the state before of {}", actuator(of)),
    };
    if square { format!("the square of {variable}") } else { variable }
}

/// Where an effect acts, as a person would call it.
pub fn place_name(arm: &Arm, effect: &Effect<f64>) -> String {
    match effect.place() {
        Part::Actuator(actuator) => arm.actuator_name(actuator.into()),
        Part::Module(module) => arm.stage_name(module.into()),
        Part::Arm => "all actuators".into(),
        Part::Servo(servo) => format!("servo {servo}"),
        Part::Base => "the base".into(),
        Part::Tool => "the tool".into(),
        Part::Camera => "the camera".into(),
    }
}

/// Where an effect acts, with its names.
pub fn site(arm: &Arm, effect: &Effect<f64>) -> Site {
    Site { place: Place::of_arm(effect), code: place_code(effect), name: place_name(arm, effect) }
}
