//! Recordings of other programs: listed, converted, refused; and what their rows are used for.

use std::path::Path;

use super::{Home, example, robot, text};

#[test]
fn a_recording_is_listed_and_converted() {
    let home = Home::new();
    let foreign = example("foreign-robot.csv");
    let listed = home.json(&format!("import {foreign}"));
    let part = &listed["files"][0]["parts"][0];
    assert_eq!((&part["rate_hz"], &part["gaps"], &part["columns"][3]["missing"]), (&40.0.into(), &0.into(), &1.into()));
    assert_eq!(listed["mapping"][1], "q1_deg=Achse 1 [deg]");
    let shown = home.succeeds(&format!("import {foreign}"));
    assert!(shown.contains("40 rows, median rate 40 Hz") && shown.contains("  q1_deg=Achse 1 [deg]"), "{shown}");

    home.succeeds(&format!("import {foreign} -o log.csv"));
    let written = std::fs::read_to_string(home.path("log.csv")).unwrap();
    assert!(written.contains("\ntime_s,q1_deg,q2_deg,tau1_nm,Ventil\n0,0,20,12,aus\n0.025,2.995,"), "{written}");
    home.fails(&format!("import {foreign} -o log.csv"), 1, "darm: log.csv exists; overwrite it with --force");
    home.fails(
        "import log.csv -o log.csv --force",
        1,
        "darm: log.csv and log.csv are the same file; choose two different names",
    );

    // What is written is a recording as well, as text and as a log.
    home.succeeds(&format!("import {foreign} -o log.mcap --write-map map.toml"));
    home.succeeds(&format!("import {foreign} -o again.csv --map map.toml"));
    let body =
        |name: &str| std::fs::read_to_string(home.path(name)).unwrap().split_once("\ntime_s").unwrap().1.to_owned();
    assert_eq!(body("log.csv"), body("again.csv"));
    let back = home.json("import log.mcap");
    assert_eq!(back["files"][0]["parts"][0]["rate_hz"], 40.0);
}

#[test]
fn wrong_options_and_maps_are_reported() {
    let home = Home::new();
    let foreign = example("foreign-robot.csv");
    let usage = "darm: --unit Zeit=parsec: give SOURCE=UNIT with a unit such as deg, rad, mm, N, bar or ms";
    home.fails(&format!("import {foreign} --unit Zeit=parsec"), 2, usage);
    home.fails(
        &format!("import {foreign} --column q1"),
        2,
        "darm: --column `q1`: write TARGET=SOURCE, such as q1_deg=angle",
    );
    home.write("map.toml", "[columns]\ntime_s = 'Zeit'\nq1_m = 'Achse 1'\n");
    let wrong = format!(
        "darm: {foreign}: map.toml:3:8: q1_m: deg (angle) does not convert to m (length); if the file is wrong, write Achse 1 \
         [deg]*UNIT"
    );
    home.fails(&format!("import {foreign} --map map.toml -o a.csv"), 1, &wrong);
    home.write("map.toml", "[column]\n");
    assert!(
        text(&home.darm(&format!("import {foreign} --map map.toml")).stderr)
            .starts_with("darm: map.toml:1:2: unknown field")
    );
    home.fails(
        "import missing.csv",
        1,
        "darm: missing.csv: cannot be read: No such file or directory (os error 2); check the path",
    );
}

#[test]
fn selections_have_or_and_report_the_character_of_a_fault() {
    let home = Home::new();
    let ask = format!("diagnose {} {}", example("cylinder.toml"), example("cylinder-force.csv.gz"));
    let run = |selection: &str| {
        let mut command = home.command(&format!("--json {ask}"));
        let said = text(&command.args(["--where", selection]).output().unwrap().stdout);
        let said: serde_json::Value = serde_json::from_str(&said).unwrap();
        said["rows"]["train"].as_u64().unwrap() + said["rows"]["held_out"].as_u64().unwrap()
    };
    let [either, between] =
        ["(set_bar = 3 or set_bar = 5) and seal != x", "set_bar >= 3, set_bar <= 5, set_bar != 4"].map(run);
    assert!(either > 0 && either == between, "{either} {between}");
    let mut command = home.command(&ask);
    let refused = command.args(["--where", "set_bar = 3 or (seal = NAPN"]).output().unwrap();
    assert!(
        text(&refused.stderr).contains("character 16 opens a bracket that is not closed"),
        "{}",
        text(&refused.stderr)
    );
}

/// A calibrated Panda, whose fingers are not part of the arm.
fn calibrated(home: &Home, effects: &str) {
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/measured/panda.urdf");
    std::fs::copy(urdf, home.path("panda.urdf")).unwrap();
    let head = "kind = 'robot'\nurdf = 'panda.urdf'\nobserved = 'point-contact'\npoint = ['place']\ntool = 'ball_link'\nnumber = 1\n";
    home.write("model.toml", &format!("{head}{effects}"));
}

fn effect(law: &str, place: &str, values: &str) -> String {
    format!("[[effect]]\nlaw = '{law}'\nwhere = '{place}'\nvalues = {{ {values} }}\n")
}

#[test]
fn a_calibrated_robot_is_used_by_the_commands_of_kinematics() {
    let home = Home::new();
    calibrated(&home, &effect("joint-offset", "joint 4 (panda_joint4)", "offset = 0.01"));
    let position = |line: &str| -> Vec<f64> {
        let found = home.json(line);
        let position = &found["poses"][0]["position_m"];
        position.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
    };
    let joints = home.json("fk panda.urdf --frame ball_link").to_string();
    assert!(joints.contains("ball_link"));
    let locks = "--lock panda_finger_joint1=0 --lock panda_finger_joint2=0";
    let ask = |model: &str, fourth: f64| format!("fk {model} --frame ball_link {locks} --q 0,30,0,{fourth},0,90,45");
    let shifted = position(&ask("panda.urdf", -90.0 + 0.01f64.to_degrees()));
    let found = position(&ask("model.toml", -90.0));
    assert!(shifted.iter().zip(&found).all(|(a, b)| (a - b).abs() < 1e-9), "{shifted:?} {found:?}");
    assert_eq!(home.darm(&format!("ik model.toml --frame ball_link {locks} --to 450,0,400")).status.code(), Some(0));
    assert_eq!(home.darm(&format!("model model.toml {locks}")).status.code(), Some(0));

    calibrated(&home, &effect("joint-compliance", "joint 2 (panda_joint2)", "compliance = 1e-5"));
    let refused = text(&home.darm("fk model.toml").stderr);
    assert!(
        refused.starts_with("darm: model.toml: joint-compliance at joint 2 (panda_joint2) depends on the load"),
        "{refused}"
    );
    home.write("one.toml", "kind = 'servo'\n");
    home.fails("fk one.toml", 2, "darm: one.toml: a model of one actuator, this command needs an arm or a robot");
}

#[test]
fn a_joint_that_a_log_does_not_have_is_locked_in_the_model_too() {
    let home = Home::new();
    std::fs::copy(robot("ur10.urdf"), home.path("ur10.urdf")).unwrap();
    let names = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint"];
    let head: Vec<String> = names
        .iter()
        .map(|name| format!("{name}_rad"))
        .chain(names.iter().map(|name| format!("tau_{name}_nm")))
        .collect();
    let row = |k: u32| {
        let wave = |j: u32| 0.4 * (f64::from(k) * (0.03 + 0.007 * f64::from(j)) + f64::from(j)).sin();
        let q = (0..5).map(|j| format!("{:.6}", wave(j)));
        let torque = (0..5).map(|j| format!("{:.6}", 20.0 * wave(j + 3) + 5.0));
        format!("{:.2},{}\n", 0.01 * f64::from(k), q.chain(torque).collect::<Vec<_>>().join(","))
    };
    home.write("log.csv", &format!("time_s,{}\n{}", head.join(","), (0..400).map(row).collect::<String>()));
    let missing = text(&home.darm("diagnose ur10.urdf log.csv").stderr);
    assert!(missing.contains("no column q6"), "{missing}");
    let found = home.json("diagnose ur10.urdf log.csv --lock wrist_3_joint=30 --keep-terms -o model.toml");
    assert_eq!(found["kind"], "joint-torque", "{found}");
    if let Ok(model) = std::fs::read_to_string(home.path("model.toml")) {
        assert!(model.contains("[lock_deg]\nwrist_3_joint = 30"), "{model}");
        assert_eq!(home.darm("diagnose model.toml log.csv").status.code(), Some(0));
    }
    let unknown = text(&home.darm("diagnose ur10.urdf log.csv --lock wrist_9=0").stderr);
    assert!(unknown.contains("there is no moving joint `wrist_9` to lock"), "{unknown}");
    home.fails(
        &format!("diagnose {} log.csv --lock a=0", example("planar4.toml")),
        2,
        "darm: --lock and --root need a robot, not an arm file",
    );
}
