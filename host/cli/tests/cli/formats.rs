//! Robots as URDF and MJCF on the command line: formats, joints that follow, many joints, numbers that are not finite.

use serde_json::Value;

use super::{Home, example, robot};

fn count(value: &Value) -> usize {
    value.as_array().unwrap().len()
}

#[test]
fn every_command_of_robots_reads_mjcf() {
    let (home, finger) = (Home::new(), example("finger.xml"));
    let model = home.json(&format!("model {finger}"));
    assert_eq!(model["parts"][2]["follows"]["joint"], "knuckle", "{model}");
    assert_eq!((count(&model["parts"]), &model["parts"][0]["armature"]), (3, &1e-5.into()));
    assert!(home.succeeds(&format!("model {finger}")).contains("revolute, follows knuckle"));
    let found = home.json(&format!("dynamics {finger} --q 20,30"));
    assert_eq!(count(&found["states"][0]["mass_matrix"]), 2);
    assert_eq!(count(&home.json(&format!("jacobian {finger} --frame pad"))["columns"]), 2);
    assert_eq!(count(&home.json(&format!("com {finger}"))["joints"]), 2);
    let pose = home.json(&format!("fk {finger} --q 20,30 --frame pad"));
    let [x, z] = [0, 2].map(|axis| 1e3 * pose["poses"][0]["position_m"][axis].as_f64().unwrap());
    let found = home.json(&format!("ik {finger} --frame pad --to {x},0,{z}"));
    assert_eq!(found["answers"][0]["status"], "reached", "{found}");
    home.succeeds(&format!("draw {finger} --q 20,30 -o finger.svg"));
    let locked = home.json(&format!("dynamics {finger} --q 20 --lock knuckle=30"));
    assert_eq!(count(&locked["states"][0]["mass_matrix"]), 1);
    home.write("odd.xml", "<mujoco><worldbody><body><joint type=\"ball\"/></body></worldbody></mujoco>");
    home.fails(
        "fk odd.xml",
        1,
        "darm: odd.xml:1:26: a joint of type ball is not supported; write three hinges in its place",
    );
    home.write("arm.xml", "<robot name=\"r\"><link name=\"l\"/></robot>");
    assert_eq!(home.json("model arm.xml")["name"], "r", "the root element decides");
}

#[test]
fn coordinates_are_the_joints_that_follow_no_other() {
    let (home, panda) = (Home::new(), robot("panda.urdf"));
    let grip = |finger: &str| {
        let found = home.json(&format!("fk {panda} --q 0,0,0,0,0,0,0,20 --frame panda_{finger}finger"));
        found["poses"][0]["position_m"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect::<Vec<_>>()
    };
    let apart: f64 = grip("left").iter().zip(grip("right")).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    assert!((apart - 0.04).abs() < 1e-9, "both fingers move by 20 mm: {apart}");
    let said = home.darm(&format!("fk {panda} --q 0,0,0,0,0,0,0,20,20"));
    assert_eq!(said.status.code(), Some(2));
}

/// Links 10 mm apart, every joint about y.
fn snake(joints: usize, mass: &str) -> String {
    let one = |k: usize| {
        format!(
            "<link name=\"l{k}\"><inertial><mass value=\"{mass}\"/></inertial></link><joint name=\"j{k}\" type=\"continuous\">\
             <origin xyz=\"0.01 0 0\"/><parent link=\"l{}\"/><child link=\"l{k}\"/><axis xyz=\"0 1 0\"/></joint>",
            k - 1
        )
    };
    format!("<robot name=\"snake\"><link name=\"l0\"/>{}</robot>", (1..=joints).map(one).collect::<String>())
}

#[test]
fn joints_are_as_many_as_the_file_has() {
    let home = Home::new();
    home.write("snake.urdf", &snake(150, "0.1"));
    assert_eq!(count(&home.json("dynamics snake.urdf")["states"][0]["mass_matrix"]), 150);
    assert_eq!(count(&home.json("jacobian snake.urdf")["columns"]), 150);
    let found = home.json("ik snake.urdf --to 900,0,-300");
    assert_eq!((&found["answers"][0]["status"], count(&found["answers"][0]["q"])), (&"reached".into(), 150));
    assert_eq!(home.json("ik snake.urdf --to 900,0,-300 --all --starts 3 --count 2")["freedom"], 148);
    for method in ["pseudo-inverse", "transpose", "dls", "de"] {
        home.json(&format!("ik snake.urdf --to 900,0,-300 --method {method} --steps 3"));
    }
    home.succeeds("draw snake.urdf -o snake.svg");
    assert_eq!(home.json("com snake.urdf")["mass_kg"].as_f64().map(|mass| (mass * 10.0).round()), Some(150.0));
}

#[test]
fn numbers_that_are_not_finite_fail() {
    let home = Home::new();
    home.write("heavy.urdf", &snake(3, "1e308"));
    for command in ["dynamics heavy.urdf", "com heavy.urdf", "model heavy.urdf", "model heavy.urdf --rust"] {
        assert_eq!(home.darm(command).status.code(), Some(1), "{command}");
    }
    home.write("wide.urdf", &snake(3, "1").replace("0.01 0 0", "1e308 0 0"));
    for command in ["fk", "jacobian", "dynamics", "com", "ik --to 1,2,3", "draw -o wide.svg"] {
        let (name, rest) = command.split_once(' ').unwrap_or((command, ""));
        assert_eq!(home.darm(&format!("{name} wide.urdf {rest}")).status.code(), Some(1), "{command}");
    }
}

/// Beyond the reach of two links of 0.5 m and 0.3 m the nearest posture is the arm that points to the target.
#[test]
fn the_nearest_posture_to_what_is_out_of_reach_is_a_minimum() {
    let home = Home::new();
    home.write(
        "arm.toml",
        "format = 1\nname = \"arm\"\nnotation = \"standard\"\n[[row]]\na_m = 0.5\n[[row]]\na_m = 0.3\n",
    );
    let found = home.json("ik arm.toml --to 900,700,0");
    let answer = &found["answers"][0];
    assert_eq!((&answer["status"], &answer["is_minimum"]), (&"out-of-reach".into(), &true.into()));
    let shortest = 0.9f64.hypot(0.7) - 0.8;
    assert!((answer["error_m"].as_f64().unwrap() - shortest).abs() < 1e-9, "{answer}");
    let said = home.succeeds("ik arm.toml --to 900,700,0");
    assert!(said.contains("out-of-reach, nearest of "), "{said}");
}
