//! Recorded functions of arms give the poses that the core predicts, word by word.

use std::path::Path;

use darm_arm::arm::{Arm, ArmScratch};
use darm_core::effect::fitted_term::{FittedTerm, Variable};
use darm_core::effect::{Condition, Detail, Effect, Frame, Place, Plate};
use darm_core::units::Word;
use darm_generate::arm::module;
use darm_generate::graph::Arguments;
use darm_generate::rust;
use darm_generate::{Module, Width};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

fn example(file: &str) -> Arm {
    Arm::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(file).as_path()).unwrap()
}

/// The largest difference of an entry of the pose from the core's prediction on some words and conditions.
fn apart(arm: &Arm, module: &Module) -> f64 {
    let (mut random, mut scratch, mut apart) = (ChaCha8Rng::seed_from_u64(7), ArmScratch::default(), 0.0);
    let chain = &arm.model.chain;
    for _ in 0..50 {
        let mut digits =
            || (0..chain.n_actuators()).map(|k| random.random_range(0..chain.n_states(k) as u8)).collect::<Vec<_>>();
        let (word, previous) = (digits(), digits());
        let servos: Vec<f64> = (0..chain.n_servos()).map(|_| random.random_range(-0.5..0.5)).collect();
        let conditions = [
            arm.model.working_supply * random.random_range(0.9..1.1),
            random.random_range(283.0..303.0),
            random.random_range(0.0..1.0),
        ];
        let condition = Condition {
            supply: conditions[0],
            temperature_k: conditions[1],
            load_kg: conditions[2],
            ..arm.model.working(Word::new(&word).unwrap(), Word::new(&previous).unwrap(), &servos)
        };
        let Ok(pose) = arm.model.predict(&condition, &mut scratch) else { continue };
        let numbers = [servos, conditions.to_vec()].concat();
        let outputs = module.functions[0].evaluate(&Arguments { numbers: &numbers, word: &word, previous: &previous });
        let expected = pose.rotation.transpose().iter().chain(pose.position.iter()).copied().collect::<Vec<_>>();
        for (ours, theirs) in outputs.concat().iter().zip(&expected) {
            apart = if (ours - theirs).abs() <= apart { apart } else { (ours - theirs).abs() };
        }
    }
    apart
}

#[test]
fn the_pose_of_a_word_is_the_cores() {
    // Planar platforms, a servo among them, platforms of six legs, discrete joints.
    for file in ["planar4.toml", "planar4-hybrid.toml", "spatial3.toml", "serial12.toml"] {
        let arm = example(file);
        let module = module(&arm).unwrap();
        // The stated 1e-10 of each platform's iteration, or a hundred roundings.
        assert!(apart(&arm, &module) < 2e-10, "{file}: {}", apart(&arm, &module));
    }
}

#[test]
fn every_effect_acts_as_in_the_core() {
    let mut arm = example("planar4.toml");
    let term = |of| {
        Effect::FittedTerm(FittedTerm {
            of,
            square: false,
            frame: Frame::Tool,
            values: [0.0, 0.0, 1e-3, 2e-3, 0.0, 0.0],
        })
    };
    let sets: [Vec<Effect<f64>>; 3] = [
        vec![
            Effect::Play { at: Place::Actuator(7), width_m: 1e-3 },
            Effect::SupplyStroke { at: Place::Arm, gain: 0.05 },
            Effect::ThermalGrowth { at: Place::Module(1), expansion_per_k: 2e-5 },
            Effect::Crowding { at: Place::Arm, values: [1e-3, -2e-3] },
            Effect::Interaction { actuator: 3, other: 8, shift_m: 1e-3 },
            Effect::StrokeLoss { actuator: 4, state: 1, loss_m: 2e-3 },
            Effect::FrameOffset { frame: Frame::Base, values: [0.0, 0.0, 0.01, 0.002, 0.001, 0.0] },
            Effect::Creep { at: Place::Arm, dwell_s: 3.0, values: [1e-3, 5e-4] },
        ],
        vec![
            term(Variable::Digits { first: (2, 1), second: Some((5, 0)) }),
            term(Variable::Stayed { actuator: 3, share: 0.3 }),
            term(Variable::Supply { center: 6e5, span: 1e5 }),
        ],
        // A diagonal that shares no anchor any more: no closed form.
        vec![
            Effect::AnchorOffset { actuator: 1, plate: Plate::Base, offset: [0.01, 0.0, 0.0] },
            Effect::AnchorOffset { actuator: 1, plate: Plate::Top, offset: [0.0, 0.01, 0.0] },
        ],
    ];
    for effects in sets {
        arm.model.effects = effects.into_iter().collect();
        let module = module(&arm).unwrap();
        assert!(apart(&arm, &module) < 2e-10, "{:?}: {}", arm.model.effects, apart(&arm, &module));
    }
}

/// A law that comes later is here too: what its equation depends on has to be chosen by the word, or it is baked into a constant.
#[test]
fn each_law_at_each_of_its_places_acts_as_in_the_core() {
    let mut arm = example("planar4-hybrid.toml");
    let places =
        [Place::Actuator(3), Place::Module(1), Place::Arm, Place::Base, Place::Tool, Place::Camera, Place::Servo(0)];
    let details = [
        Detail::All,
        Detail::State(0),
        Detail::State(1),
        Detail::Anchor(Plate::Base),
        Detail::Anchor(Plate::Top),
        Detail::With(8),
    ];
    for law in Effect::<f64>::LAWS {
        let made = places.iter().flat_map(|place| details.iter().filter_map(|detail| Effect::at(law, *place, *detail)));
        let effects: Vec<Effect<f64>> = made.collect();
        assert!(!effects.is_empty(), "{law}");
        for mut effect in effects {
            // A compliance of 1e-7 m/N, else millimetres and thousandths.
            let size = if effect.bears_load() { 1e-7 } else { 1e-3 };
            effect.values_mut().iter_mut().zip(1..).for_each(|(value, k)| *value = size * f64::from(k));
            // An anchor stays in the plane of its platform.
            if let Effect::AnchorOffset { offset: [.., z], .. } = &mut effect {
                *z = 0.0;
            }
            if let Some(constant) = effect.constant_mut() {
                *constant = 3.0;
            }
            arm.model.effects = [effect].into_iter().collect();
            let module = module(&arm).unwrap_or_else(|error| panic!("{effect:?}: {error}"));
            let apart = apart(&arm, &module);
            // The core settles under load to 1e-8 m.
            assert!(apart < if effect.bears_load() { 1e-6 } else { 2e-10 }, "{effect:?}: {apart}");
        }
    }
}

#[test]
fn a_sagging_arm_settles() {
    let mut arm = example("planar4.toml");
    arm.model.effects = [Effect::GravitySag { at: Place::Arm, compliance_m_per_n: 1e-7 }].into_iter().collect();
    let module = module(&arm).unwrap();
    // The core settles to 1e-8 m.
    assert!(apart(&arm, &module) < 1e-6, "{}", apart(&arm, &module));
    assert!(rust::file(&module, Width::Single).contains("settlings under load: "));
}
