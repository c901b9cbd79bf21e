//! What commands predict: at the model's working conditions, in finite numbers.

use darm_arm::arm::{Arm, ArmScratch};
use darm_core::model::Condition;

use super::{Home, example, text};

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

#[test]
fn numbers_that_overflow_are_refused() {
    let (home, planar, puma) = (Home::new(), example("planar4.toml"), example("puma560.toml"));
    let range = "is out of range; give a number from -1e12 to 1e12";
    home.fails(&format!("nearest {planar} 1e308,0,0"), 2, &format!("darm: pose: `1e308` {range}"));
    home.fails(&format!("dynamics {puma} --qd 1e200,0,0,0,0,0"), 2, &format!("darm: waist: `1e200` {range}"));
    home.fails(&format!("ik {puma} --to 1,1e300,0"), 2, &format!("darm: --to: `1e300` {range}"));
    let hot = home.darm(&format!("nearest {planar} 300,4200,10 --q nan"));
    assert!(!hot.status.success() && !text(&hot.stdout).contains("NaN"), "{}", text(&hot.stdout));
}

#[test]
fn a_search_for_few_switches_proves_no_bound_and_forbidden_words_are_not_counted() {
    let (home, arm) = (Home::new(), example("planar4.toml"));
    let near = home.json(&format!("nearest {arm} 300,4200,10"));
    let few = home.json(&format!("nearest {arm} 300,4200,10 --from 000000000000 --within 500"));
    assert_eq!(few["lower_bound_m"], 0.0);
    assert!(few["nearest"][0]["distance_m"].as_f64() > near["nearest"][0]["distance_m"].as_f64());
    let said = home.succeeds(&format!("nearest {arm} 300,4200,10 --from 000000000000 --within 500"));
    assert!(!said.contains("lower bound"), "{said}");
    let some = home.json(&format!("nearest {arm} 300,4200,10 --stuck 4=0 --forbid 111,***,***,*** 1**,***,***,***"));
    assert_eq!((&near["words"], &some["words"]), (&4096.0.into(), &1024.0.into()));
}
