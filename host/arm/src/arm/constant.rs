//! An arm as a constant in Rust: its model, effects and all, in a chip's flash.

use darm_core::actuator::{Axis, Leg, Platform, Stage};
use darm_core::effect::fitted_term::{FittedTerm, Variable};
use darm_core::effect::{Effect, Place};
use darm_core::model::Mass;

use super::Arm;
use darm_robot::literal::{number, numbers, pose, vector};

/// What a stage is made of.
const STAGES: [&str; 7] = ["Axis", "DiscreteJoint", "JointKind", "Leg", "Platform", "ServoJoint", "Stage"];

impl Arm {
    /// A module of Rust with the constant `MODEL` of this arm in `f32`, for `rustfmt`: `MODEL.predict` gives the pose
    /// of the tool.
    pub fn constant(&self) -> String {
        let (model, n) = (&self.model, self.model.chain.stages.len());
        let effects: Vec<String> = model.effects.iter().map(effect_text).collect();
        let body = format!(
            "/// Geometry, masses and effects.\n\
             pub(crate) const MODEL: Model<f32, {n}> = Model {{\n\
             number: {}, chain: Chain {{ mount: {}, stages: Vec::from_array([{}]), tool: {} }}, masses: [{}], \
             payload: {}, gravity: {}, nominal_supply: {}, reference_temperature_k: {}, working_supply: {}, \
             working_temperature_k: {}, effects: Vec::from_array([{}]) }};\n",
            model.number,
            pose(&model.chain.mount),
            list(model.chain.stages.iter().map(stage)),
            pose(&model.chain.tool),
            list(model.masses.iter().take(n).map(mass)),
            mass(&model.payload),
            vector(&model.gravity),
            number(model.nominal_supply),
            number(model.reference_temperature_k),
            number(model.working_supply),
            number(model.working_temperature_k),
            effects.join(", "),
        );
        format!(
            "//! {}, model {}: made by `darm model --rust` from its file.\n\n{}\
             use darm_core::chain::Chain;\n{}\
             use darm_core::model::{{Mass, Model}};\n\
             use darm_core::real::{{Mat3, Vec3}};\n\
             use darm_core::se::Pose;\n\
             use heapless::Vec;\n\n{body}",
            self.name,
            model.number,
            imports("actuator", &STAGES, &body),
            imports("effect", &["Effect", "Frame", "Place", "Plate"], &body)
                + &imports("effect::fitted_term", &["FittedTerm", "Variable"], &body),
        )
    }
}

/// The line that brings in those names of a module of `darm-core` that `body` has.
fn imports(module: &str, names: &[&str], body: &str) -> String {
    let used: Vec<&str> = names.iter().copied().filter(|name| body.contains(name)).collect();
    if used.is_empty() { String::new() } else { format!("use darm_core::{module}::{{{}}};\n", used.join(", ")) }
}

fn list(of: impl Iterator<Item = String>) -> String {
    of.collect::<Vec<_>>().join(", ")
}

fn stage(stage: &Stage<f64>) -> String {
    match stage {
        Stage::Link(link) => format!("Stage::Link({})", pose(link)),
        Stage::Planar(of) => format!("Stage::Planar({})", platform(of)),
        Stage::Spatial(of) => format!("Stage::Spatial({})", platform(of)),
        Stage::Discrete(joint) => format!(
            "Stage::Discrete(DiscreteJoint {{ axis: {}, values: {}, states: {} }})",
            axis(&joint.axis),
            numbers(&joint.values),
            joint.states
        ),
        Stage::Servo(joint) => {
            format!("Stage::Servo(ServoJoint {{ axis: {}, offset: {} }})", axis(&joint.axis), number(joint.offset))
        }
    }
}

fn platform<const LEGS: usize>(platform: &Platform<f64, LEGS>) -> String {
    format!("Platform {{ legs: [{}], home: {} }}", list(platform.legs.iter().map(leg)), pose(&platform.home))
}

fn leg(leg: &Leg<f64>) -> String {
    let (base, top, lengths) = (vector(&leg.base), vector(&leg.top), numbers(&leg.length_m));
    format!("Leg {{ base: {base}, top: {top}, length_m: {lengths}, states: {} }}", leg.states)
}

fn axis(axis: &Axis<f64>) -> String {
    format!("Axis {{ kind: JointKind::{:?}, direction: {} }}", axis.kind, vector(&axis.direction))
}

fn mass(mass: &Mass<f64>) -> String {
    format!("Mass {{ mass_kg: {}, center: {} }}", number(mass.mass_kg), vector(&mass.center))
}

/// An effect as Rust source.
fn effect_text(effect: &Effect<f64>) -> String {
    let at = |part: Place| ("at", format!("Place::{part:?}"));
    let actuator = |index: u8| ("actuator", index.to_string());
    let values = |values: &[f64]| ("values", numbers(values));
    let (law, fields) = match *effect {
        Effect::GravitySag { at: place, compliance_m_per_n } => {
            ("GravitySag", vec![at(place), ("compliance_m_per_n", number(compliance_m_per_n))])
        }
        Effect::Play { at: place, width_m } => ("Play", vec![at(place), ("width_m", number(width_m))]),
        Effect::SupplyStroke { at: place, gain } => ("SupplyStroke", vec![at(place), ("gain", number(gain))]),
        Effect::ThermalGrowth { at: place, expansion_per_k } => {
            ("ThermalGrowth", vec![at(place), ("expansion_per_k", number(expansion_per_k))])
        }
        Effect::Drift { at: place, until_s, values: of } => {
            ("Drift", vec![at(place), ("until_s", number(until_s)), values(&of)])
        }
        Effect::Creep { at: place, dwell_s, values: of } => {
            ("Creep", vec![at(place), ("dwell_s", number(dwell_s)), values(&of)])
        }
        Effect::Crowding { at: place, values: of } => ("Crowding", vec![at(place), values(&of)]),
        Effect::FrameOffset { frame, values: of } => {
            ("FrameOffset", vec![("frame", format!("Frame::{frame:?}")), values(&of)])
        }
        Effect::BaseDrift { until_s, values: of } => ("BaseDrift", vec![("until_s", number(until_s)), values(&of)]),
        Effect::BaseStep { since_s, values: of } => ("BaseStep", vec![("since_s", number(since_s)), values(&of)]),
        Effect::Scale { stretch } => ("Scale", vec![("stretch", number(stretch))]),
        Effect::JointOffset { servo, offset_rad } => {
            ("JointOffset", vec![("servo", servo.to_string()), ("offset_rad", number(offset_rad))])
        }
        Effect::StrokeLoss { actuator: of, state, loss_m } => {
            ("StrokeLoss", vec![actuator(of), ("state", state.to_string()), ("loss_m", number(loss_m))])
        }
        Effect::Wear { actuator: of, until_switches, per_switch_m } => {
            let until = ("until_switches", number(until_switches));
            ("Wear", vec![actuator(of), until, ("per_switch_m", number(per_switch_m))])
        }
        Effect::Step { actuator: of, since_s, shift_m } => {
            ("Step", vec![actuator(of), ("since_s", number(since_s)), ("shift_m", number(shift_m))])
        }
        Effect::LengthOffset { actuator: of, offset_m } => {
            ("LengthOffset", vec![actuator(of), ("offset_m", number(offset_m))])
        }
        Effect::Interaction { actuator: of, other, shift_m } => {
            ("Interaction", vec![actuator(of), ("other", other.to_string()), ("shift_m", number(shift_m))])
        }
        Effect::AnchorOffset { actuator: of, plate, offset } => {
            ("AnchorOffset", vec![actuator(of), ("plate", format!("Plate::{plate:?}")), ("offset", numbers(&offset))])
        }
        Effect::FittedTerm(term) => {
            return format!("Effect::FittedTerm(FittedTerm {{ {} }})", fields_text(&term_fields(&term)));
        }
    };
    format!("Effect::{law} {{ {} }}", fields_text(&fields))
}

fn fields_text(fields: &[(&str, String)]) -> String {
    list(fields.iter().map(|(name, value)| format!("{name}: {value}")))
}

fn term_fields(term: &FittedTerm<f64>) -> Vec<(&'static str, String)> {
    let centered = |center: f64, span: f64| vec![("center", number(center)), ("span", number(span))];
    let (variant, fields) = match term.of {
        Variable::Supply { center, span } => ("Supply", centered(center, span)),
        Variable::Temperature { center, span } => ("Temperature", centered(center, span)),
        Variable::Servo { servo, center, span } => {
            ("Servo", [&[("servo", servo.to_string())], &centered(center, span)[..]].concat())
        }
        Variable::Digits { first, second } => {
            ("Digits", vec![("first", format!("{first:?}")), ("second", format!("{second:?}"))])
        }
        Variable::Stayed { actuator, share } => {
            ("Stayed", vec![("actuator", actuator.to_string()), ("share", number(share))])
        }
    };
    vec![
        ("of", format!("Variable::{variant} {{ {} }}", fields_text(&fields))),
        ("square", term.square.to_string()),
        ("frame", format!("Frame::{:?}", term.frame)),
        ("values", numbers(&term.values)),
    ]
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use darm_core::effect::fitted_term::{FittedTerm, Variable};
    use darm_core::effect::{Detail, Effect, Frame, Place, Plate};

    use super::effect_text;

    #[test]
    fn every_law_has_all_its_fields() {
        let details = [Detail::All, Detail::State(1), Detail::Anchor(Plate::Top), Detail::With(1)];
        let places = [Place::Actuator(2), Place::Servo(0), Place::Base, Place::Tool, Place::Camera, Place::Arm];
        let all = places.iter().flat_map(|place| details.iter().map(move |detail| (*place, *detail)));
        let at = |(place, detail)| {
            Effect::<f64>::LAWS.into_iter().filter_map(move |law| Effect::<f64>::at(law, place, detail))
        };
        let fields = |text: &str| text.matches(": ").count();
        let mut laws = BTreeSet::new();
        for effect in all.flat_map(at) {
            assert_eq!(fields(&effect_text(&effect)), fields(&format!("{effect:?}")), "{effect:?}");
            laws.insert(effect.name());
        }
        assert_eq!(laws.len(), Effect::<f64>::LAWS.len());
    }

    #[test]
    fn an_effect_has_its_paths() {
        let of = Variable::Digits { first: (3, 1), second: Some((7, 0)) };
        let effects: [(Effect<f64>, &str); 5] = [
            (
                Effect::StrokeLoss { actuator: 4, state: 1, loss_m: 2e-3 },
                "Effect::StrokeLoss { actuator: 4, state: 1, loss_m: 0.002 }",
            ),
            (
                Effect::AnchorOffset { actuator: 4, plate: Plate::Top, offset: [1e-3, -2e-3, 0.0] },
                "Effect::AnchorOffset { actuator: 4, plate: Plate::Top, offset: [0.001, -0.002, 0.0] }",
            ),
            (
                Effect::FrameOffset { frame: Frame::Base, values: [0.5; 6] },
                "Effect::FrameOffset { frame: Frame::Base, values: [0.5, 0.5, 0.5, 0.5, 0.5, 0.5] }",
            ),
            (
                Effect::FittedTerm(FittedTerm { of, square: false, frame: Frame::Tool, values: [0.5; 6] }),
                "Effect::FittedTerm(FittedTerm { of: Variable::Digits { first: (3, 1), second: Some((7, 0)) }, square: false, \
                 frame: Frame::Tool, values: [0.5, 0.5, 0.5, 0.5, 0.5, 0.5] })",
            ),
            (
                Effect::GravitySag { at: Place::Module(1), compliance_m_per_n: 2e-5 },
                "Effect::GravitySag { at: Place::Module(1), compliance_m_per_n: 2e-5 }",
            ),
        ];
        for (effect, text) in effects {
            assert_eq!(effect_text(&effect), text);
        }
    }
}
