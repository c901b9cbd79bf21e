//! Each law in the book and, with its constant, in the arm file.

use std::path::Path;

use darm_arm::arm::Arm;
use darm_core::effect::law_name::LawName;
use darm_core::effect::{Detail, Effect, Place};

#[test]
fn every_law_is_in_the_book() {
    let book = [include_str!("../../../docs/arm-file.md"), include_str!("../../../docs/diagnosis.md")].concat();
    let missing: Vec<_> = LawName::ALL.iter().filter(|law| !book.contains(&format!("`{law}`"))).collect();
    assert!(missing.is_empty(), "neither in docs/arm-file.md nor in docs/diagnosis.md: {missing:?}");
}

#[test]
fn every_constant_of_a_law_has_a_key_in_the_arm_file() {
    let arm =
        Arm::parse(Path::new("planar4.toml"), include_str!("../../../examples/planar4.toml")).expect("an example");
    let mut n_constants = 0;
    for law in Effect::<f64>::LAWS {
        let places = [Place::Actuator(0), Place::Base];
        let Some(mut effect) = places.into_iter().find_map(|place| Effect::at(law, place, Detail::All)) else {
            continue;
        };
        let Some(constant) = effect.constant_mut() else { continue };
        *constant = 12.5;
        n_constants += 1;
        let mut with_effect = arm.clone();
        with_effect.model.effects.push(effect).expect("room for one effect");
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("arm.toml");
        with_effect.write(&path).expect("an arm that can be written");
        let read = Arm::read(&path).expect("an arm that can be read");
        assert_eq!(read.model.effects.as_slice(), [effect], "{}", effect.name());
    }
    assert_eq!(n_constants, 6, "a step, a drift, wear, creep, a base that drifts and one that is moved");
}
