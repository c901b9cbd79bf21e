//! An arm as a constant in Rust: its model, effects and all, in a chip's flash.

use std::collections::BTreeSet;

use darm_core::actuator::{Axis, Leg, Platform, Stage};
use darm_core::effect::Effect;
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
        let (files, effects): (BTreeSet<String>, Vec<String>) = model.effects.iter().map(effect_text).unzip();
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
        let effect = ["Effect", "Place"].into_iter().chain(files.iter().map(String::as_str));
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

/// The file of a law, and the effect. What is derived for [`Debug`] is Rust but for paths and vectors, of any law.
fn effect_text(effect: &Effect<f64>) -> (String, String) {
    let debug = format!("{:?}", effect.cast::<f32>());
    let law = debug.split('(').next().expect("a split has a first part");
    let file = law.chars().enumerate().fold(String::new(), |file, (at, letter)| {
        let joint = if at > 0 && letter.is_uppercase() { "_" } else { "" };
        file + joint + &letter.to_lowercase().to_string()
    });
    let text = debug
        .replace("at: ", "at: Place::")
        .replace("plate: ", &format!("plate: {file}::Plate::"))
        .replace("frame: ", &format!("frame: {file}::Frame::"))
        .replace("of: ", &format!("of: {file}::Variable::"))
        .replace("[[", "Vec3::new(")
        .replace("]]", ")")
        .replacen('(', &format!("({file}::"), 1);
    (file, format!("Effect::{text}"))
}

#[cfg(test)]
mod tests {
    use darm_core::effect::anchor_offset::{AnchorOffset, Plate};
    use darm_core::effect::fitted_term::{FittedTerm, Variable};
    use darm_core::effect::frame_offset::{Frame, FrameOffset};
    use darm_core::effect::gravity_sag::GravitySag;
    use darm_core::effect::stroke_loss::StrokeLoss;
    use darm_core::effect::{Effect, Place};

    use super::effect_text;

    #[test]
    fn an_effect_is_told_with_its_paths() {
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
