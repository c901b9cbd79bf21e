//! What may be the matter: every effect law of `darm-core` at every place where it can act.

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
use darm_core::effect::{Effect, Place as Part};
use darm_core::real::Vec3;

use crate::effect::{Place, Site};
use darm_arm::arm::{Arm, ArmModel};

/// Laws that act on an actuator, on a module or on the whole arm.
const ANYWHERE: [fn(Part) -> Effect<f64>; 5] = [
    |at| GravitySag { at, compliance_m_per_n: 0.0 }.into(),
    |at| Play { at, width_m: 0.0 }.into(),
    |at| SupplyStroke { at, gain: 0.0 }.into(),
    |at| ThermalGrowth { at, expansion_per_k: 0.0 }.into(),
    |at| Drift { at, until_s: 0.0, values: [0.0; 2] }.into(),
];

/// All effects that may be there, with their values at zero: each law at each place. A step is one that was there from
/// the start: when it came is for a fit to say.
pub fn all(model: &ArmModel) -> Vec<Effect<f64>> {
    let everywhere = places(model);
    let mut effects: Vec<Effect<f64>> =
        ANYWHERE.iter().flat_map(|law| everywhere.iter().map(|&place| law(place))).collect();
    let together = everywhere.iter().filter(|place| !matches!(place, Part::Actuator(_)));
    effects.extend(together.map(|&at| Effect::from(Crowding { at, values: [0.0; 2] })));
    effects.extend([Frame::Base, Frame::Tool].map(|frame| Effect::from(FrameOffset { frame, values: [0.0; 6] })));
    effects.push(Scale { stretch: 0.0 }.into());
    let servos = 0..model.chain.n_servos() as u8;
    effects.extend(servos.map(|servo| Effect::from(JointOffset { servo, offset_rad: 0.0 })));
    for (index, (stage, leg)) in model.chain.actuators().enumerate() {
        let actuator = index as u8;
        let states = 0..model.chain.n_states(index) as u8;
        effects.extend(states.map(|state| Effect::from(StrokeLoss { actuator, state, loss_m: 0.0 })));
        effects.push(Wear { actuator, until_switches: 0.0, per_switch_m: 0.0 }.into());
        effects.push(Step { actuator, since_s: 0.0, shift_m: 0.0 }.into());
        if model.chain.stages[stage].leg(leg).is_some() {
            let offset = |plate| AnchorOffset { actuator, plate, offset: Vec3::zeros() };
            effects.extend([Plate::Base, Plate::Top].map(|plate| Effect::from(offset(plate))));
        }
    }
    effects
}

/// The arm, its modules and its actuators; what has one actuator only is named once.
fn places(model: &ArmModel) -> Vec<Part> {
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

/// Whether two effects are the same law at the same place, whatever their values and moments.
pub fn same(a: &Effect<f64>, b: &Effect<f64>) -> bool {
    a.law().name() == b.law().name() && Place::of_arm(a) == Place::of_arm(b)
}

/// Where an effect acts, as a short unambiguous code: `actuator 4, state 1`.
pub fn place_code(effect: &Effect<f64>) -> String {
    let part = match effect {
        Effect::StrokeLoss(law) => format!(", state {}", law.state),
        Effect::AnchorOffset(law) => match law.plate {
            Plate::Base => ", base anchor".into(),
            Plate::Top => ", top anchor".into(),
        },
        Effect::FittedTerm(term) => {
            format!(", along {}", along(term, &|of| format!("actuator {of}"), &|of| format!("servo {of}")))
        }
        _ => String::new(),
    };
    match effect.law().place() {
        Part::Actuator(actuator) => format!("actuator {actuator}{part}"),
        Part::Module(module) => format!("module {module}"),
        Part::Arm => "arm".into(),
        Part::Servo(servo) => format!("servo {servo}"),
        Part::Base => "base".into(),
        Part::Tool => format!("tool{part}"),
        Part::Camera => "camera".into(),
    }
}

/// The variable of a fitted term, as a person would call it: `the square of temperature`.
pub fn term_name(arm: &Arm, term: &FittedTerm<f64>) -> String {
    along(term, &|actuator| arm.actuator_name(actuator.into()), &|servo| format!("servo {}", servo + 1))
}

fn along(term: &FittedTerm<f64>, actuator: &dyn Fn(u8) -> String, servo: &dyn Fn(u8) -> String) -> String {
    let digit = |(of, state): (u8, u8)| format!("{} in state {state}", actuator(of));
    let variable = match term.of {
        Variable::Supply { .. } => "supply".into(),
        Variable::Temperature { .. } => "temperature".into(),
        Variable::Servo { servo: of, .. } => servo(of),
        Variable::Digits { first, second: None } => digit(first),
        Variable::Digits { first, second: Some(second) } => format!("{} with {}", digit(first), digit(second)),
        Variable::Stayed { actuator: of, .. } => format!("the state before of {}", actuator(of)),
    };
    if term.square { format!("the square of {variable}") } else { variable }
}

/// Where an effect acts, as a person would call it.
pub fn place_name(arm: &Arm, effect: &Effect<f64>) -> String {
    match effect.law().place() {
        Part::Actuator(actuator) => arm.actuator_name(actuator.into()),
        Part::Module(module) => arm.stage_name(module.into()),
        Part::Arm => "the whole arm".into(),
        Part::Servo(servo) => format!("servo {}", servo + 1),
        Part::Base => "the base".into(),
        Part::Tool => "the tool".into(),
        Part::Camera => "the camera".into(),
    }
}

/// Where an effect acts, with its names.
pub fn site(arm: &Arm, effect: &Effect<f64>) -> Site {
    Site { place: Place::of_arm(effect), code: place_code(effect), name: place_name(arm, effect) }
}
