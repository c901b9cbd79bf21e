//! An arm as a constant in Rust: its model, effects and all, in a chip's flash.

use std::collections::BTreeSet;

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
        let (files, effects): (BTreeSet<&str>, Vec<String>) = model.effects.iter().map(effect_text).unzip();
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
        let effect = ["Effect", "Place"].into_iter().chain(files.iter().copied());
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
            imports("effect", &effect.collect::<Vec<_>>(), &body),
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

/// The file of a law in `darm-core`, and the effect as Rust source.
fn effect_text(effect: &Effect<f64>) -> (&'static str, String) {
    let at = |part: Place| ("at", format!("Place::{part:?}"));
    let actuator = |index: u8| ("actuator", index.to_string());
    let values = |values: &[f64]| ("values", numbers(values));
    let (file, law, fields) = match effect {
        Effect::GravitySag(law) => {
            ("gravity_sag", "GravitySag", vec![at(law.at), ("compliance_m_per_n", number(law.compliance_m_per_n))])
        }
        Effect::Play(law) => ("play", "Play", vec![at(law.at), ("width_m", number(law.width_m))]),
        Effect::SupplyStroke(law) => ("supply_stroke", "SupplyStroke", vec![at(law.at), ("gain", number(law.gain))]),
        Effect::ThermalGrowth(law) => {
            ("thermal_growth", "ThermalGrowth", vec![at(law.at), ("expansion_per_k", number(law.expansion_per_k))])
        }
        Effect::Drift(law) => {
            ("drift", "Drift", vec![at(law.at), ("until_s", number(law.until_s)), values(&law.values)])
        }
        Effect::Creep(law) => {
            ("creep", "Creep", vec![at(law.at), ("dwell_s", number(law.dwell_s)), values(&law.values)])
        }
        Effect::Crowding(law) => ("crowding", "Crowding", vec![at(law.at), values(&law.values)]),
        Effect::FrameOffset(law) => {
            let frame = format!("frame_offset::Frame::{:?}", law.frame);
            ("frame_offset", "FrameOffset", vec![("frame", frame), values(&law.values)])
        }
        Effect::BaseDrift(law) => {
            ("base_drift", "BaseDrift", vec![("until_s", number(law.until_s)), values(&law.values)])
        }
        Effect::BaseStep(law) => ("base_step", "BaseStep", vec![("since_s", number(law.since_s)), values(&law.values)]),
        Effect::Scale(law) => ("scale", "Scale", vec![("stretch", number(law.stretch))]),
        Effect::JointOffset(law) => {
            let servo = ("servo", law.servo.to_string());
            ("joint_offset", "JointOffset", vec![servo, ("offset_rad", number(law.offset_rad))])
        }
        Effect::StrokeLoss(law) => {
            let [state, loss] = [("state", law.state.to_string()), ("loss_m", number(law.loss_m))];
            ("stroke_loss", "StrokeLoss", vec![actuator(law.actuator), state, loss])
        }
        Effect::Wear(law) => {
            let until = ("until_switches", number(law.until_switches));
            ("wear", "Wear", vec![actuator(law.actuator), until, ("per_switch_m", number(law.per_switch_m))])
        }
        Effect::Step(law) => {
            let since = ("since_s", number(law.since_s));
            ("step", "Step", vec![actuator(law.actuator), since, ("shift_m", number(law.shift_m))])
        }
        Effect::LengthOffset(law) => {
            ("length_offset", "LengthOffset", vec![actuator(law.actuator), ("offset_m", number(law.offset_m))])
        }
        Effect::Interaction(law) => {
            let [other, shift] = [("other", law.other.to_string()), ("shift_m", number(law.shift_m))];
            ("interaction", "Interaction", vec![actuator(law.actuator), other, shift])
        }
        Effect::AnchorOffset(law) => {
            let plate = ("plate", format!("anchor_offset::Plate::{:?}", law.plate));
            ("anchor_offset", "AnchorOffset", vec![actuator(law.actuator), plate, ("offset", vector(&law.offset))])
        }
        Effect::FittedTerm(law) => ("fitted_term", "FittedTerm", term_fields(law)),
    };
    (file, format!("Effect::{law}({file}::{law} {{ {} }})", fields_text(&fields)))
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
        ("of", format!("fitted_term::Variable::{variant} {{ {} }}", fields_text(&fields))),
        ("square", term.square.to_string()),
        ("frame", format!("fitted_term::Frame::{:?}", term.frame)),
        ("values", numbers(&term.values)),
    ]
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use darm_core::effect::anchor_offset::{AnchorOffset, Plate};
    use darm_core::effect::fitted_term::{FittedTerm, Variable};
    use darm_core::effect::frame_offset::{Frame, FrameOffset};
    use darm_core::effect::gravity_sag::GravitySag;
    use darm_core::effect::stroke_loss::StrokeLoss;
    use darm_core::effect::{Detail, Effect, Place};

    use super::effect_text;

    #[test]
    fn every_law_has_all_its_fields() {
        let details = [Detail::All, Detail::State(1), Detail::Anchor(Plate::Top), Detail::With(1)];
        let places = [Place::Actuator(2), Place::Servo(0), Place::Base, Place::Camera, Place::Arm];
        let all = places.iter().flat_map(|place| details.iter().map(move |detail| (*place, *detail)));
        let effects =
            all.flat_map(|(place, detail)| Effect::<f64>::EACH_AT.iter().filter_map(move |at| at(place, detail)));
        let fields = |text: &str| text.matches(": ").count();
        let mut laws = BTreeSet::new();
        for effect in effects {
            assert_eq!(fields(&effect_text(&effect).1), fields(&format!("{effect:?}")), "{effect:?}");
            laws.insert(effect.law().name());
        }
        // A fitted term is not made at a place.
        assert!(laws.len() + 1 >= Effect::<f64>::EACH_AT.len(), "{laws:?}");
    }

    #[test]
    fn an_effect_has_its_paths() {
        let offset = [1e-3, -2e-3, 0.0].into();
        let of = Variable::Digits { first: (3, 1), second: Some((7, 0)) };
        let effects: [(Effect<f64>, &str); 5] = [
            (
                StrokeLoss { actuator: 4, state: 1, loss_m: 2e-3 }.into(),
                "Effect::StrokeLoss(stroke_loss::StrokeLoss { actuator: 4, state: 1, loss_m: 0.002 })",
            ),
            (
                AnchorOffset { actuator: 4, plate: Plate::Top, offset }.into(),
                "Effect::AnchorOffset(anchor_offset::AnchorOffset { actuator: 4, plate: anchor_offset::Plate::Top, \
                 offset: Vec3::new(0.001, -0.002, 0.0) })",
            ),
            (
                FrameOffset { frame: Frame::Base, values: [0.5; 6] }.into(),
                "Effect::FrameOffset(frame_offset::FrameOffset { frame: frame_offset::Frame::Base, values: [0.5, 0.5, \
                 0.5, 0.5, 0.5, 0.5] })",
            ),
            (
                FittedTerm { of, square: false, frame: Frame::Tool, values: [0.5; 6] }.into(),
                "Effect::FittedTerm(fitted_term::FittedTerm { of: fitted_term::Variable::Digits { first: (3, 1), second: \
                 Some((7, 0)) }, square: false, frame: fitted_term::Frame::Tool, values: [0.5, 0.5, 0.5, 0.5, 0.5, 0.5] })",
            ),
            (
                GravitySag { at: Place::Module(1), compliance_m_per_n: 2e-5 }.into(),
                "Effect::GravitySag(gravity_sag::GravitySag { at: Place::Module(1), compliance_m_per_n: 2e-5 })",
            ),
        ];
        for (effect, text) in effects {
            assert_eq!(effect_text(&effect).1, text);
        }
    }
}
