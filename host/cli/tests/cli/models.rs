//! Models: what a corrected arm contains, and what a person has to adjust.

use super::{Home, example, text};

#[test]
fn a_corrected_arm_shows_number_conditions_and_effects() {
    let home = Home::new();
    let arm = std::fs::read_to_string(example("planar4.toml")).unwrap();
    let arm = arm
        .replace("model = 0", "model = 3")
        .replace("supply_bar = 6.0\n", "supply_bar = 6.0\nworking_supply_bar = 5.2\n");
    home.write(
        "arm3.toml",
        &format!("{arm}\n[[effect]]\nlaw = \"supply-stroke\"\nactuator = 4\nvalues = {{ gain = 0.25 }}\n"),
    );
    let said = home.succeeds("model arm3.toml");
    assert!(said.contains("model number 3; works at 5.20 bar and 20.0 °C, geometry measured at 6.00 bar"), "{said}");
    assert!(said.contains("supply-stroke") && said.contains("actuator 4") && said.contains("gain  0.25"), "{said}");
    let json = home.json("model arm3.toml");
    assert_eq!((&json["model"], &json["effects"][0]["parameters"][0]["value"]), (&3.into(), &0.25.into()));
    assert!(home.succeeds(&format!("model {}", example("planar4.toml"))).contains("no effects"));
}

#[test]
fn adjustments_below_the_resolution_are_counted() {
    let home = Home::new();
    let arm = std::fs::read_to_string(example("planar4.toml")).unwrap();
    let altered = arm.replacen("length_m = [1.0, 1.25]", "length_m = [1.001, 1.25]", 1);
    home.write("new.toml", &altered.replace("length_m = [1.0, 1.25]", "length_m = [1.00001, 1.25]"));
    let adjust = format!("adjust {} new.toml", example("planar4.toml"));
    let report = home.json(&adjust);
    assert_eq!(report["settings"].as_array().unwrap().len(), 1);
    let below = report["below_resolution"].as_u64().unwrap();
    assert!(home.succeeds(&adjust).contains(&format!("the other {below} stay: they differ by less than 0.05 mm")));
    let all = home.json(&format!("{adjust} --resolution 0.001"));
    assert_eq!(all["settings"].as_array().unwrap().len() as u64, below + 1);
}

#[test]
fn a_synthesis_keeps_a_least_stroke_and_names_equal_stops() {
    let home = Home::new();
    let (arm, frames) = (example("planar4.toml"), example("planar4-frames.toml"));
    home.succeeds(&format!("synth {arm} {frames} -o paper.toml --method paper"));
    let few = home.darm(&format!("synth {arm} {frames} -o few.toml --method paper --steps 5"));
    assert!(text(&few.stderr).contains("met are 1e-2 mm and 6e-4 deg"), "{}", text(&few.stderr));
    let text_of = std::fs::read_to_string(&arm).unwrap();
    home.write("dead.toml", &text_of.replacen("length_m = [1.0, 1.25]", "length_m = [1.0, 1.0]", 1));
    home.write(
        "one.toml",
        "format = 1\n[[frame]]\nword = \"000,000,000,000\"\npose = { position_m = [0.0, 4.0], angle_deg = 0.0 }\n",
    );
    let kept = home.darm("synth dead.toml one.toml -o kept.toml");
    assert!(kept.status.success() && !text(&kept.stderr).contains("warning"), "{}", text(&kept.stderr));
    let dead = home.darm("synth dead.toml one.toml -o still.toml --least-stroke 0");
    let warning = "warning: actuator 0 (module 1, left leg) has equal stops: it does not move; increase --least-stroke";
    assert!(text(&dead.stderr).contains(warning), "{}", text(&dead.stderr));
}

#[test]
fn a_stuck_actuator_keeps_its_stops_on_demand() {
    let home = Home::new();
    let (arm, frames) = (example("planar4.toml"), example("planar4-frames.toml"));
    let turned = |options: &str| {
        let cost =
            home.json(&format!("synth {arm} {frames} -o new.toml --stuck 4=0 --write-frames words.toml {options}"));
        let settings = home.json(&format!("adjust {arm} new.toml --resolution 0"))["settings"].clone();
        let own = settings.as_array().unwrap().iter().filter(|line| line["actuator"] == 4).count();
        (cost["repair"]["dead_turned_m"].as_f64().unwrap(), own, cost["repair"]["frames_met"].clone())
    };
    let (by_m, own, met) = turned("");
    assert!(by_m > 1e-3 && own > 0 && met == 5, "{by_m} {own} {met}");
    let said = home.succeeds(&format!("synth {arm} {frames} -o new.toml --stuck 4=0 --write-frames words.toml"));
    assert!(said.contains("a stop of the stuck actuator is to be turned by"), "{said}");
    assert_eq!(turned("--keep-stop"), (0.0, 0, 5.into()));
}

/// Four frames of one module are twelve equations, and it has six stops.
#[test]
fn anchors_move_where_no_stops_reach_the_frames() {
    let home = Home::new();
    let synth = format!("synth {} {} -o moved.toml", example("platform3.toml"), example("platform3-anchors.toml"));
    let fixed = home.darm(&synth);
    let error = text(&fixed.stderr);
    assert!(!fixed.status.success() && error.contains("12 equations of rank 6"), "{error}");
    assert!(error.contains("let anchors move with --anchors"), "{error}");
    assert!(!home.darm(&format!("{synth} --anchors 50")).status.success());
    let moved = home.json(&format!("{synth} --anchors 200"));
    assert_eq!(moved["reached"], true);
    let by_m = moved["anchors_moved_m"].as_f64().unwrap();
    assert!(by_m > 0.05 && by_m < 0.2, "{by_m}");
}
