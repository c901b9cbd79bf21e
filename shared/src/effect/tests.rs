//! Each law by its hooks: what it does, what it says of itself, and that zero does nothing.

extern crate std;

use super::*;
use crate::actuator::Setting;
use crate::real::Vec3;

fn one_of_each() -> [Effect<f64>; 20] {
    let at = Place::Module(1);
    [
        stroke_loss::StrokeLoss { actuator: 4, state: 1, loss_m: 1e-3 }.into(),
        anchor_offset::AnchorOffset {
            actuator: 4,
            plate: anchor_offset::Plate::Top,
            offset: Vec3::new(1e-3, 2e-3, 3e-3),
        }
        .into(),
        gravity_sag::GravitySag { at, compliance_m_per_n: 1e-5 }.into(),
        play::Play { at, width_m: 1e-3 }.into(),
        supply_stroke::SupplyStroke { at, gain: 0.1 }.into(),
        thermal_growth::ThermalGrowth { at, expansion_per_k: 1e-5 }.into(),
        step::Step { actuator: 4, since_s: 40.0, shift_m: 1e-3 }.into(),
        length_offset::LengthOffset { actuator: 4, offset_m: 1e-3 }.into(),
        interaction::Interaction { actuator: 4, other: 5, shift_m: 1e-3 }.into(),
        creep::Creep { at, dwell_s: 1.0, values: [1e-3, 1e-3] }.into(),
        drift::Drift { at, until_s: 100.0, values: [1e-5, 1e-7] }.into(),
        wear::Wear { actuator: 4, until_switches: 100.0, per_switch_m: 1e-5 }.into(),
        crowding::Crowding { at, values: [1e-3, 1e-3] }.into(),
        frame_offset::FrameOffset { frame: frame_offset::Frame::Base, values: [1e-3; 6] }.into(),
        frame_offset::FrameOffset { frame: frame_offset::Frame::Tool, values: [1e-3; 6] }.into(),
        base_step::BaseStep { since_s: 40.0, values: [1e-3; 6] }.into(),
        base_drift::BaseDrift { until_s: 100.0, values: [1e-5; 6] }.into(),
        fitted_term::FittedTerm {
            of: fitted_term::Variable::Supply { center: 1.0, span: 0.5 },
            square: true,
            frame: frame_offset::Frame::Base,
            values: [1e-3; 6],
        }
        .into(),
        scale::Scale { stretch: 1e-3 }.into(),
        joint_offset::JointOffset { servo: 0, offset_rad: 1e-3 }.into(),
    ]
}

#[test]
fn there_is_one_of_each() {
    let mut laws: std::vec::Vec<_> = one_of_each().iter().map(core::mem::discriminant).collect();
    laws.dedup();
    // The offset of a frame has two names.
    assert_eq!(laws.len(), Effect::<f64>::EACH_AT.len());
}

#[test]
fn each_law_is_made_from_its_name_and_place() {
    for mut effect in one_of_each() {
        let law = effect.law_mut();
        law.values_mut().fill(0.0);
        if let Some(constant) = law.constant_mut() {
            *constant = 0.0;
        }
        let made = Effect::at(effect.law().name(), effect.law().place(), effect.law().detail());
        assert_eq!(made.is_none(), matches!(effect, Effect::FittedTerm(_)));
        assert!(made.is_none_or(|made| made == effect), "{made:?}");
    }
}

/// A place where the law of play acts and one where crowding does: the same actuator held, and switched with others.
fn sites() -> [Site<f64>; 2] {
    [site(), Site { previous: Some(0), together: 2, ..site() }]
}

fn ideal() -> Pose<f64> {
    Pose::at(Vec3::new(0.1, 2.0, 0.0))
}

fn condition() -> Condition<'static, f64> {
    Condition { supply: 2.0, ..Condition::of_word("00001".parse().unwrap()) }
}

fn site() -> Site<f64> {
    Site {
        stage: 1,
        actuator: 4,
        digit: 1,
        previous: Some(1),
        stroke: 0.25,
        supply_deviation: -0.1,
        temperature_rise_k: 10.0,
        time_s: Some(50.0),
        switches: Some(30.0),
        dwell_s: Some(2.0),
        word: "000011".parse().ok(),
        ..Site::default()
    }
}

/// Which of the hooks of an effect do something: disturb, turn, deflection, displace.
fn hooks(effect: &Effect<f64>) -> [bool; 4] {
    let law = effect.law();
    let joint = Setting::of_joint(1.25);
    let disturbs = sites().iter().any(|site| {
        let mut leg = joint;
        law.disturb(site, &mut leg);
        leg != joint
    });
    let mut turned = joint;
    law.turn(&mut turned);
    [disturbs, turned != joint, law.deflection(&site(), 100.0) != 0.0, law.displace(ideal(), &condition()) != ideal()]
}

#[test]
fn values_of_zero_do_nothing() {
    for mut effect in one_of_each() {
        effect.law_mut().values_mut().fill(0.0);
        assert_eq!(hooks(&effect), [false; 4], "{}", effect.law().name());
    }
}

#[test]
fn every_law_does_something_by_one_of_its_hooks() {
    for effect in one_of_each() {
        let hooks = hooks(&effect);
        assert_eq!(hooks.iter().filter(|acts| **acts).count(), 1, "{}", effect.law().name());
        assert_eq!(effect.law().bears_load(), hooks[2]);
    }
}

#[test]
fn every_value_has_a_name_and_a_unit() {
    for effect in one_of_each() {
        let law = effect.law();
        assert_eq!(law.values().len(), law.quantities().len());
        let of_actuators = hooks(&effect)[0] || law.bears_load();
        assert_eq!(law.place().holds(&site()), of_actuators);
        assert!(!law.place().holds(&Site::<f64>::default()));
    }
}
