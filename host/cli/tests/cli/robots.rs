//! Robots, arms and tables: kinematics, dynamics, inverse kinematics, pictures.

use super::{Home, example, robot, text};

/// A robot in the tests' data.
#[test]
fn poses_of_a_table_lead_back_to_postures() {
    let (home, puma) = (Home::new(), example("puma560.toml"));
    home.write(
        "run.csv",
        "q1_deg,q2_deg,elbow_rad,q4_deg,q5_deg,flange_deg\n10,20,-1.2,40,50,60\n-30,80,-0.5,10,-40,0\n",
    );
    let poses = home.succeeds(&format!("fk {puma} --postures run.csv --csv"));
    home.write("poses.csv", &poses);
    let found = home.json(&format!("ik {puma} --targets poses.csv"));
    for (answer, row) in found["answers"].as_array().unwrap().iter().zip(poses.lines().skip(1)) {
        assert_eq!(answer["status"], "reached");
        let x: f64 = row.split(',').nth(2).unwrap().parse().unwrap();
        assert!((answer["pose"]["position_m"][0].as_f64().unwrap() - x).abs() < 1e-5);
    }
    assert!(
        home.succeeds(&format!("ik {puma} --to 400,150,900 --compare --plot plot.svg"))
            .contains("pseudo-inverse  reached")
    );
    assert!(std::fs::read_to_string(home.path("plot.svg")).unwrap().contains("transpose"));
    let far = home.json(&format!("ik {puma} --to 4000,0,0"));
    assert_eq!(far["answers"][0]["status"], "out-of-reach");
}

#[test]
fn postures_are_found_by_populations_and_all_of_them_are_listed() {
    let (home, puma) = (Home::new(), example("puma560.toml"));
    let found = home.json(&format!("ik {puma} --to 400,150,900 --method cma-es --tolerance 1"));
    assert_eq!((&found["answers"][0]["method"], &found["answers"][0]["status"]), (&"cma-es".into(), &"reached".into()));
    let all = home.json(&format!(
        "ik {puma} --to 400,150,900 --rotation 0,127.279220613578,127.279220613578 --all --plot all.svg"
    ));
    let postures = all["postures"].as_array().unwrap();
    assert!(all["freedom"] == 0 && postures.len() > 1, "{all}");
    assert!(std::fs::read_to_string(home.path("all.svg")).unwrap().starts_with("<svg"));
    let sampled = home.succeeds(&format!("ik {puma} --to 400,150,900 --all --count 3 --starts 50"));
    assert!(
        sampled.starts_with("a sample of 3 postures: the arm has 3 degrees of freedom of self-motion"),
        "{sampled}"
    );
    assert!(
        home.succeeds(&format!("ik {puma} --to 4000,0,0 --all --starts 9")).starts_with("no posture found: none of 9")
    );
    let bench = "bench-ik --planar 300,300,300 --to 500,400,0 --runs 3 --iterations 30";
    let compared = home.json(&format!("{bench} --methods lm,memr --plot bench.svg"));
    assert_eq!((&compared["methods"][0]["reached"], &compared["methods"][1]["reached"]), (&3.into(), &0.into()));
    assert!(std::fs::read_to_string(home.path("bench.svg")).unwrap().contains("memr"));
    home.fails(
        "bench-ik --planar 300,nan --to 1,2,3",
        2,
        "darm: --planar: NaN is not a length in mm; give numbers of at least 0",
    );
    home.fails(
        "bench-ik --to 1,2,3",
        2,
        "darm: no robot; name one, or give the links of a planar arm: --planar 300,300,300",
    );
    home.fails("bench-ik --link 0", 2, "darm: --link 0: give a length above 0 mm");
    assert_eq!(home.darm(&format!("{bench} --population 1000000000000")).status.code(), Some(2));
}

#[test]
fn kinematics_and_dynamics_agree_on_the_command_line() {
    let (home, puma) = (Home::new(), example("puma560.toml"));
    let held = home.json(&format!("dynamics {puma} --q 0,45,-90,0,0,0"));
    let torque = held["states"][0]["torque"].as_array().unwrap();
    let listed: Vec<_> = torque.iter().map(|torque| torque.to_string()).collect();
    let still = home.json(&format!("dynamics {puma} --q 0,45,-90,0,0,0 --torque {}", listed.join(",")));
    assert!(still["states"][0]["acceleration"].as_array().unwrap().iter().all(|x| x.as_f64().unwrap().abs() < 1e-9));
    let loaded = home.json(&format!("dynamics {puma} --q 0,45,-90,0,0,0 --external-wrench 0,0,0,0,0,10"));
    let statics = home.json(&format!("jacobian {puma} --q 0,45,-90,0,0,0 --external-wrench 0,0,0,0,0,10"));
    for joint in 0..6 {
        let of = |report: &serde_json::Value| report["states"][0]["torque"][joint].as_f64().unwrap();
        let by_load = statics["postures"][0]["statics"][joint].as_f64().unwrap();
        assert!((of(&loaded) - of(&held) - by_load).abs() < 1e-12);
    }
    let said = home.succeeds(&format!("dynamics {} --word 010110011101", example("planar4.toml")));
    assert!(said.contains("module 1, right leg     133.871  N"), "{said}");
    let legs = home.json(&format!("jacobian {} --word 010110011101", example("planar4.toml")));
    assert_eq!((legs["columns"].as_array().unwrap().len(), &legs["postures"][0]["full"]["rank"]), (12, &3.into()));
    let whole = home.json(&format!("com {} --floating", robot("simple_humanoid.urdf")));
    assert!((whole["mass_kg"].as_f64().unwrap() - 130.8).abs() < 1e-9);
}

#[test]
fn torques_include_the_effects_of_a_model() {
    let home = Home::new();
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/measured");
    let effect = |law: &str, place: &str, values: &str| {
        format!("[[effect]]\nlaw = \"{law}\"\nwhere = \"{place}\"\nvalues = {{ {values} }}\n")
    };
    let robot = format!("kind = \"robot\"\nurdf = \"{folder}/tx40.urdf\"\nobserved = \"torque\"\n");
    let found = effect("viscous-friction", "joint 3 (joint_3)", "coefficient = 2.0")
        + &effect("mass-distribution", "link_1", "m = 5.0, Izz = 0.25");
    home.write("found.toml", &format!("{robot}number = 1\n{found}"));
    home.write("run.csv", "t_s,q1_rad,q2_rad,q3_rad,q4_rad,q5_rad,q6_rad,q3_rad_s,q1_rad_s2\n0,0,1,0,0,0,0,0.5,2\n");
    let torque = |file: &str| home.json(&format!("dynamics {file} --postures run.csv"))["states"][0].clone();
    let (with, without) = (torque("found.toml"), torque(&format!("{folder}/tx40.urdf")));
    for (joint, more) in [0.5, 0.0, 1.0, 0.0, 0.0, 0.0].into_iter().enumerate() {
        let of = |state: &serde_json::Value, key: &str| state[key][joint].as_f64().unwrap();
        assert!((of(&with, "torque") - of(&without, "torque") - more).abs() < 1e-9, "joint {joint}: {with}");
        assert!((of(&with, "effects_torque") - more).abs() < 1e-9);
    }
    assert!(without["effects_torque"].is_null());
    let said = home.succeeds("dynamics found.toml --postures run.csv");
    assert!(said.contains("  effects"), "{said}");
    home.write("lost.toml", &(robot + &effect("offset", "joint 9", "offset = 1.0")));
    home.fails(
        "dynamics lost.toml",
        1,
        "darm: the model has offset at joint 9, and this measurement has no such place: is this the right model?",
    );
    home.fails(
        "dynamics found.toml --torque 0,0,0,0,0,0",
        2,
        "darm: --torque and --forward: a model with effects supports inverse dynamics only; give --qd and --qdd",
    );
}

/// A laser tracker measured the tool of a real robot in 1 020 postures; goal and split are those of `tests/goals.toml`.
#[test]
fn a_measured_tool_calibrates_its_robot() {
    let home = Home::new();
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/measured");
    let found = home.json(&format!(
        "diagnose {folder}/ur5_tracker.toml {folder}/ur5_tracker.csv.gz --hold-out set=random -o found.toml"
    ));
    assert_eq!((&found["kind"], &found["verdict"]), (&"tool-position".into(), &"partly-explained".into()));
    let held_out_m = |when: &str| found["error"][when]["held_out"]["norm"]["value"].as_f64().unwrap();
    assert!((held_out_m("before") - 2.577e-3).abs() < 1e-6 && held_out_m("after") < 0.105e-3, "{}", found["error"]);
    // Its posture-dependent effects are no rigid links.
    let refused = text(&home.darm("fk found.toml --q 0,0,0,0,0,0").stderr);
    assert!(
        refused.starts_with("darm: found.toml: encoder-periodic at joint 1 (base) depends on the posture"),
        "{refused}"
    );
    let model = std::fs::read_to_string(home.path("found.toml")).unwrap();
    let rigid: Vec<&str> = model
        .split("[[effect]]")
        .filter(|effect| !["encoder", "compliance"].iter().any(|law| effect.contains(law)))
        .collect();
    home.write("rigid.toml", &rigid.join("[[effect]]"));
    home.succeeds("fk rigid.toml --q 0,0,0,0,0,0");
}

#[test]
fn a_model_is_shown_and_drawn() {
    let (home, panda) = (Home::new(), robot("panda.urdf"));
    let said = home.succeeds(&format!("model {panda}"));
    assert!(said.contains("warning: joint `panda_finger_joint2` mimics `panda_finger_joint1`"), "{said}");
    let said = home.succeeds(&format!("model {} --base-parameters", example("planar2.toml")));
    assert!(said.contains("\n  Izz link 1 + 0.25 m link 2\n"), "{said}");
    let corrected = example("../tests/data/corrected/corrected.toml");
    let constants = [
        (
            example("puma560.toml"),
            include_str!("../../../../firmware/boards/b-l475e-iot01a/src/bin/kinematics/puma560.rs"),
        ),
        (corrected, include_str!("../../../../firmware/boards/b-l475e-iot01a/src/bin/kinematics/corrected.rs")),
    ];
    for (file, constant) in constants {
        let rust = home.succeeds(&format!("model {file} --rust"));
        let bare = |text: &str| text.chars().filter(|c| !c.is_whitespace() && *c != ',').collect::<String>();
        assert_eq!(bare(&rust), bare(constant));
    }
    for (file, posture, views) in [(panda.as_str(), "", 4), (&example("planar4.toml"), "--word 010110011101", 1)] {
        assert_eq!(home.json(&format!("draw {file} {posture} -o arm.svg"))["views"], views);
        assert!(std::fs::read_to_string(home.path("arm.svg")).unwrap().starts_with("<svg"));
    }
}

#[test]
fn an_invalid_posture_is_reported() {
    let (home, puma) = (Home::new(), example("puma560.toml"));
    home.fails(
        &format!("fk {} --q 1,2", example("planar2.toml").replace("planar2", "planar4")),
        2,
        "darm: --q has 2 numbers, expected 0: it has no joints or servos",
    );
    home.fails(
        &format!("fk {puma} --q 1,2,3,4,5,6mm"),
        2,
        "darm: flange: unit `mm` in `6mm` is invalid; use deg or rad",
    );
    home.write("run.csv", "q1_deg\n1\n");
    let message = "darm: run.csv: no column shoulder_deg (or q2_deg); the file has q1_deg; add or rename a column";
    home.fails(&format!("fk {puma} --postures run.csv"), 1, message);
    home.write("run.csv", "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n1,2,x,4,5,6\n");
    let message = "darm: run.csv:2:5: column q3_deg holds `x`, expected a number; correct the cell";
    home.fails(&format!("fk {puma} --postures run.csv"), 1, message);
    let message = "darm: no frame `hand`; the frames are base, link 1, link 2, link 3, link 4, link 5, link 6";
    home.fails(&format!("fk {puma} --frame hand"), 2, message);
}

#[test]
fn a_robot_beside_free_objects_is_read_by_its_root_in_every_command() {
    let home = Home::new();
    home.write(
        "scene.xml",
        "<mujoco><worldbody><body name=\"arm\" pos=\"0 0 1\"><joint name=\"q\" axis=\"0 1 0\"/><geom size=\"0.1\" pos=\"0.5 0 0\"/>\
         <body name=\"tool\" pos=\"1 0 0\"><site name=\"tool\" pos=\"0.5 0 0\"/></body></body><body name=\"cube\"><freejoint/>\
         <geom size=\"0.1\" mass=\"2\"/></body></worldbody></mujoco>",
    );
    let refused = text(&home.darm("fk scene.xml").stderr);
    assert!(refused.ends_with("read one tree with --root 'arm' or --root 'cube'\n"), "{refused}");
    let x = |line: &str| home.json(line)["poses"][0]["position_m"][0].as_f64().unwrap();
    assert_eq!((x("fk scene.xml --root arm --frame tool"), x("fk scene.xml --root arm --frame site:tool")), (1.0, 1.5));
    for command in ["model", "com", "jacobian", "dynamics", "draw"] {
        let more = if command == "draw" { " -o arm.svg" } else { "" };
        assert!(home.darm(&format!("{command} scene.xml --root arm{more}")).status.success(), "{command}");
    }
    let cube = home.succeeds("dynamics scene.xml --root cube");
    assert!(cube.contains("mass matrix of the base, angular axes first") && cube.contains("2.000"), "{cube}");
}
