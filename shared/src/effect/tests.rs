//! Each law by its hooks: what it does, what it says of itself, and that zero does nothing.

extern crate std;

use super::*;
use crate::actuator::Setting;
use crate::real::Vec3;

fn one_of_each() -> [Effect<f64>; 20] {
    let at = Place::Module(1);
    [
        Effect::StrokeLoss { actuator: 4, state: 1, loss_m: 1e-3 },
        Effect::AnchorOffset { actuator: 4, plate: Plate::Top, offset: [1e-3, 2e-3, 3e-3] },
        Effect::GravitySag { at, compliance_m_per_n: 1e-5 },
        Effect::Play { at, width_m: 1e-3 },
        Effect::SupplyStroke { at, gain: 0.1 },
        Effect::ThermalGrowth { at, expansion_per_k: 1e-5 },
        Effect::Step { actuator: 4, since_s: 40.0, shift_m: 1e-3 },
        Effect::LengthOffset { actuator: 4, offset_m: 1e-3 },
        Effect::Interaction { actuator: 4, other: 5, shift_m: 1e-3 },
        Effect::Creep { at, dwell_s: 1.0, values: [1e-3, 1e-3] },
        Effect::Drift { at, until_s: 100.0, values: [1e-5, 1e-7] },
        Effect::Wear { actuator: 4, until_switches: 100.0, per_switch_m: 1e-5 },
        Effect::Crowding { at, values: [1e-3, 1e-3] },
        Effect::FrameOffset { frame: Frame::Base, values: [1e-3; 6] },
        Effect::FrameOffset { frame: Frame::Tool, values: [1e-3; 6] },
        Effect::BaseStep { since_s: 40.0, values: [1e-3; 6] },
        Effect::BaseDrift { until_s: 100.0, values: [1e-5; 6] },
        Effect::FittedTerm(FittedTerm {
            of: fitted_term::Variable::Supply { center: 1.0, span: 0.5 },
            square: true,
            frame: Frame::Base,
            values: [1e-3; 6],
        }),
        Effect::Scale { stretch: 1e-3 },
        Effect::JointOffset { servo: 0, offset_rad: 1e-3 },
    ]
}

#[test]
fn there_is_one_of_each() {
    let names: std::collections::BTreeSet<_> = one_of_each().iter().map(Effect::name).collect();
    assert!(Effect::<f64>::LAWS.iter().all(|law| names.contains(law)));
    assert_eq!(names.len(), Effect::<f64>::LAWS.len() + 1, "and a fitted term");
}

#[test]
fn each_law_is_made_from_its_name_and_place() {
    for mut effect in one_of_each() {
        effect.values_mut().fill(0.0);
        if let Some(constant) = effect.constant_mut() {
            *constant = 0.0;
        }
        let made = Effect::at(effect.name(), effect.place(), effect.detail());
        assert_eq!(made.is_none(), matches!(effect, Effect::FittedTerm(_)));
        assert!(made.is_none_or(|made| made == effect), "{made:?}");
    }
}

/// The value of an actuator of 1.25 m after an effect at a site.
fn disturbed(effect: Effect<f64>, site: Site<f64>) -> f64 {
    let mut leg = Setting::of_joint(1.25);
    effect.disturb(&site, &mut leg);
    leg.value
}

#[test]
fn each_law_of_an_actuator_has_the_value_of_its_equation() {
    let at = Place::Arm;
    let extended = Site { digit: 1, ..Site::default() };
    let held = |digit| Site { digit, previous: Some(digit), ..Site::default() };
    let switched = Site { digit: 1, previous: Some(0), together: 2, ..Site::default() };
    let timed = |time_s| Site { time_s, ..Site::default() };
    let of_word = |word: &str| Site { digit: 1, word: word.parse().ok(), ..Site::default() };
    let dwelt = |digit, dwell_s| Site { digit, dwell_s, ..Site::default() };
    let loss = Effect::StrokeLoss { actuator: 0, state: 1, loss_m: 0.002 };
    let play = Effect::Play { at, width_m: 0.001 };
    let supply = Effect::SupplyStroke { at, gain: 0.04 };
    let warmth = Effect::ThermalGrowth { at, expansion_per_k: 23e-6 };
    let step = Effect::Step { actuator: 0, since_s: 40.0, shift_m: 0.002 };
    let interaction = Effect::Interaction { actuator: 0, other: 1, shift_m: -0.002 };
    let drift = Effect::Drift { at, until_s: 200.0, values: [2e-5, -1e-7] };
    let wear = Effect::Wear { actuator: 0, until_switches: 200.0, per_switch_m: 1e-5 };
    let crowding = Effect::Crowding { at, values: [0.001, -0.004] };
    let creep = Effect::Creep { at, dwell_s: 0.0, values: [0.0, 0.001] };
    let cases = [
        (loss, extended, 1.248),
        (loss, Site::default(), 1.25),
        (play, held(1), 1.249),
        (play, held(0), 1.251),
        (play, switched, 1.25),
        (play, extended, 1.25),
        // 1.25 m − 0.04 · 0.1 · 0.25 m
        (supply, Site { stroke: 0.25, supply_deviation: -0.1, ..extended }, 1.249),
        // 1.25 m · (1 + 23e-6/K · 20 K)
        (warmth, Site { temperature_rise_k: 20.0, ..extended }, 1.250_575),
        (warmth, Site { temperature_rise_k: 20.0, kind: JointKind::Revolute, ..extended }, 1.25),
        (step, timed(Some(39.0)), 1.25),
        (step, timed(Some(40.0)), 1.252),
        (step, timed(None), 1.252),
        (Effect::LengthOffset { actuator: 0, offset_m: 0.002 }, Site::default(), 1.252),
        (interaction, of_word("10"), 1.25),
        (interaction, of_word("11"), 1.248),
        // 1.25 m + 20 µm/s · 100 s − 0.1 µm/s² · (100 s)²/2, and at 200 s, when it has come to rest
        (drift, timed(Some(100.0)), 1.2515),
        (drift, timed(None), 1.252),
        (wear, Site { switches: Some(100.0), ..extended }, 1.251),
        (wear, Site::default(), 1.248),
        // 1.25 m − 2 · 1 mm, and − 2 · (1 mm + 4 mm · 0.25)
        (crowding, switched, 1.248),
        (crowding, Site { supply_deviation: -0.25, ..switched }, 1.246),
        (crowding, held(1), 1.25),
        (creep, dwelt(1, Some(0.0)), 1.25),
        // 1 mm · (1 − 1/e)
        (creep, dwelt(1, Some(10.0)), 1.250_632_120_559),
        (creep, dwelt(0, Some(10.0)), 1.249_367_879_441),
    ];
    for (effect, site, value) in cases {
        assert!((disturbed(effect, site) - value).abs() < 1e-12, "{effect:?} at {site:?}");
    }
}

#[test]
fn anchors_joints_and_loaded_legs_have_the_value_of_their_equations() {
    let seat = Vec3::new(-0.5, 0.0, 0.0);
    let mut leg = Setting { base: seat, top: seat, value: 1.0 };
    Effect::AnchorOffset { actuator: 0, plate: Plate::Base, offset: [0.003, -0.001, 0.0] }
        .disturb(&Site::default(), &mut leg);
    assert_eq!((leg.base, leg.top), (Vec3::new(-0.497, -0.001, 0.0), seat));
    let mut joint = Setting::of_joint(0.5);
    Effect::JointOffset { servo: 0, offset_rad: 0.01 }.turn(&mut joint);
    assert_eq!(joint.value, 0.51);
    // A leg that carries 50 N gets shorter by 2e-5 m/N · 50 N = 1 mm; a joint does not.
    let sag = Effect::GravitySag { at: Place::Arm, compliance_m_per_n: 2e-5 };
    assert!((sag.deflection(&Site::default(), 50.0) + 1e-3f64).abs() < 1e-15);
    assert_eq!(sag.deflection(&Site { kind: JointKind::Revolute, ..Site::default() }, 50.0), 0.0);
}

#[test]
fn each_law_that_moves_the_tool_has_the_value_of_its_equation() {
    let turned = Pose::new(&Vec3::new(0.0, 0.0, core::f64::consts::FRAC_PI_2), Vec3::new(1.0, 2.0, 0.0));
    let seen = |effect: Effect<f64>, time_s| {
        effect.displace(turned, &Condition { time_s, ..Condition::of_word("01".parse().unwrap()) }).position
    };
    let along_x = [0.0, 0.0, 0.0, 0.002, 0.0, 0.0];
    let step = Effect::BaseStep { since_s: 40.0, values: along_x };
    let drift = Effect::BaseDrift { until_s: 200.0, values: along_x.map(|way| way / 200.0) };
    let cases = [
        // Along the tool's x, which points along y.
        (Effect::FrameOffset { frame: Frame::Tool, values: along_x }, None, [1.0, 2.002]),
        (Effect::FrameOffset { frame: Frame::Base, values: along_x }, None, [1.002, 2.0]),
        (step, Some(39.0), [1.0, 2.0]),
        (step, Some(40.0), [1.002, 2.0]),
        (step, None, [1.002, 2.0]),
        (drift, Some(100.0), [1.001, 2.0]),
        (drift, None, [1.002, 2.0]),
        // 2 m are measured as 2.002 m.
        (Effect::Scale { stretch: 0.001 }, None, [1.001, 2.002]),
    ];
    for (effect, time_s, [x, y]) in cases {
        assert!((seen(effect, time_s) - Vec3::new(x, y, 0.0)).norm() < 1e-15, "{effect:?} at {time_s:?}");
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
    let joint = Setting::of_joint(1.25);
    let disturbs = sites().iter().any(|site| {
        let mut leg = joint;
        effect.disturb(site, &mut leg);
        leg != joint
    });
    let mut turned = joint;
    effect.turn(&mut turned);
    [
        disturbs,
        turned != joint,
        effect.deflection(&site(), 100.0) != 0.0,
        effect.displace(ideal(), &condition()) != ideal(),
    ]
}

#[test]
fn values_of_zero_do_nothing() {
    for mut effect in one_of_each() {
        effect.values_mut().fill(0.0);
        assert_eq!(hooks(&effect), [false; 4], "{}", effect.name());
    }
}

#[test]
fn every_law_does_something_by_one_of_its_hooks() {
    for effect in one_of_each() {
        let hooks = hooks(&effect);
        assert_eq!(hooks.iter().filter(|acts| **acts).count(), 1, "{}", effect.name());
        assert_eq!(effect.bears_load(), hooks[2]);
    }
}

#[test]
fn every_value_has_a_name_and_a_unit() {
    for effect in one_of_each() {
        assert_eq!(effect.values().len(), effect.quantities().len());
        let of_actuators = hooks(&effect)[0] || effect.bears_load();
        assert_eq!(effect.place().holds(&site()), of_actuators);
        assert!(!effect.place().holds(&Site::<f64>::default()));
    }
}
