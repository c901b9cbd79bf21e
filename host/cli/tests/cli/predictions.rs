//! What commands predict: at the model's working conditions.

use darm_arm::arm::{Arm, ArmScratch};
use darm_core::model::Condition;

use super::{Home, example};

/// An arm whose stroke follows the supply, at a working supply in bar.
fn arm_at(home: &Home, name: &str, bar: &str) {
    let arm = std::fs::read_to_string(example("planar4.toml")).unwrap();
    let arm = arm.replace("supply_bar = 6.0\n", &format!("supply_bar = 6.0\nworking_supply_bar = {bar}\n"));
    home.write(name, &format!("{arm}\n[[effect]]\nlaw = \"supply-stroke\"\nvalues = {{ gain = 0.3 }}\n"));
}

#[test]
fn every_command_predicts_at_the_working_conditions() {
    let home = Home::new();
    arm_at(&home, "nominal.toml", "6.0");
    arm_at(&home, "low.toml", "5.0");
    let word = "111111111111";
    let arm = Arm::read(&home.path("low.toml")).unwrap();
    let reached = word.parse().unwrap();
    let condition = Condition { supply: 5e5, ..arm.model.nominal(reached, &[]) };
    let predicted = arm.model.predict(&condition, &mut ArmScratch::default()).unwrap();
    let shown = &home.json(&format!("fk low.toml --word {word}"))["poses"][0]["position_m"];
    assert!((0..3).all(|k| (shown[k].as_f64().unwrap() - predicted.position[k]).abs() < 1e-12), "{shown}");
    let com = |arm: &str| home.json(&format!("com {arm} --word {word}"))["postures"][0]["com_m"][1].as_f64().unwrap();
    assert!(com("nominal.toml") > com("low.toml") + 1e-3);
    for command in ["jacobian", "dynamics"] {
        let answer = |arm: &str| home.succeeds(&format!("{command} {arm} --word 010110011101"));
        assert_ne!(answer("nominal.toml"), answer("low.toml"), "{command}");
    }
    let drawn = |arm: &str| {
        home.succeeds(&format!("draw {arm} --word {word} -o arm.svg"));
        std::fs::read_to_string(home.path("arm.svg")).unwrap()
    };
    assert_ne!(drawn("nominal.toml"), drawn("low.toml"));
}
