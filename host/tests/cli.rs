//! The tool `darm` as a user meets it: help with examples, messages and exit codes, JSON, and the way from a base-line
//! to a table that a board plays, is watched at and is measured. The board is the firmware's library in a process.

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

const COMMANDS: [&str; 25] = [
    "synth", "stops", "table", "upload", "play", "stop", "status", "record", "diagnose", "console", "plant", "flash",
    "doctor", "fk", "jacobian", "ik", "bench-ik", "dynamics", "com", "model", "draw", "nearest", "map", "path",
    "grasp",
];

/// A user's empty home, and the folder the commands run in.
struct Home(tempfile::TempDir);

impl Home {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    /// `darm` with these words on its command line, and nothing else around it.
    fn command(&self, line: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_darm"));
        command.args(line.split_whitespace()).current_dir(self.0.path()).env_clear().env("HOME", self.0.path());
        command
    }

    fn darm(&self, line: &str) -> Output {
        self.command(line).stdin(Stdio::null()).output().unwrap()
    }

    /// Runs `darm` with this text on its standard input.
    fn types(&self, line: &str, typed: &str) -> String {
        let mut child = self.command(line).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        child.stdin.take().unwrap().write_all(typed.as_bytes()).unwrap();
        text(&child.wait_with_output().unwrap().stdout)
    }

    #[track_caller]
    fn fails(&self, line: &str, code: i32, message: &str) {
        let output = self.darm(line);
        assert_eq!(text(&output.stderr).trim_end(), message, "darm {line}");
        assert_eq!(output.status.code(), Some(code), "darm {line}");
    }

    #[track_caller]
    fn succeeds(&self, line: &str) -> String {
        let output = self.darm(line);
        assert!(output.status.success(), "darm {line}: {}", text(&output.stderr));
        text(&output.stdout)
    }

    #[track_caller]
    fn json(&self, line: &str) -> serde_json::Value {
        let said = text(&self.darm(&format!("--json {line}")).stdout);
        serde_json::from_str(&said).unwrap_or_else(|error| panic!("darm --json {line}: {error}: {said}"))
    }
}

/// A board of `darm plant` in this home; commands reach it by `self.port`.
struct Board {
    child: Child,
    port: String,
}

impl Board {
    /// Starts a board and waits until it has said where it is.
    fn start(home: &Home, line: &str) -> Self {
        let mut command = home.command(&format!("--json plant --in-process {line}"));
        let mut child = command.stdin(Stdio::null()).stdout(Stdio::piped()).spawn().unwrap();
        let mut said = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut said).unwrap();
        let said: serde_json::Value = serde_json::from_str(&said).unwrap();
        Self { port: format!("--port {}", said["port"].as_str().unwrap()), child }
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

fn example(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples").join(name).display().to_string()
}

#[test]
fn every_command_has_help_with_examples() {
    let home = Home::new();
    let overview = home.succeeds("--help");
    for command in COMMANDS {
        assert!(overview.contains(&format!("\n  {command} ")), "{command} is not in the overview");
        let help = home.succeeds(&format!("{command} --help"));
        assert!(help.contains("Examples:\n  darm ") || help.contains("darm flash"), "{command} has no examples");
        let longest = help.lines().map(|line| line.chars().count()).max().unwrap();
        assert!(longest <= 120, "{command}: a line of its help has {longest} characters");
    }
}

#[test]
fn a_hand_makes_contacts_or_says_which_it_cannot() {
    let home = Home::new();
    let (hand, contacts) = (example("allegro_hand.toml"), example("grasp-contacts.toml"));
    let found = home.json(&format!("grasp solve {hand} {contacts} --picture grasp.svg"));
    assert!(found["error_m"].as_f64().unwrap() < 1e-6 && found["fingers"].as_array().unwrap().len() == 4);
    assert!(std::fs::read_to_string(home.path("grasp.svg")).unwrap().contains("front: y, z"));
    let bare = example("allegro_hand.urdf");
    let found = home.json(&format!("grasp solve {bare} {contacts}"));
    assert!(found["error_m"].as_f64().unwrap() < 1e-6);
    let arm = home.darm(&format!("grasp solve {} {contacts}", example("../tests/data/urdf/ur10.urdf")));
    assert!(text(&arm.stderr).contains("name four by --tips INDEX,MEDIUM,RING,THUMB"), "{}", text(&arm.stderr));
    let text = std::fs::read_to_string(&contacts).unwrap();
    home.write("far.toml", &text.replace("[390, 24, 140]", "[-390, 24, 140]"));
    let far = "darm: contacts index and thumb are 838 mm apart, out of reach: stretched, the fingers bridge 373 mm";
    home.fails(&format!("grasp solve {hand} far.toml"), 1, far);
    home.write("three.toml", text.rsplit_once("[[contact]]").unwrap().0);
    let three = "darm: three.toml:2:10: 3 contacts are given, there must be 4, each a [[contact]]";
    home.fails(&format!("grasp solve {hand} three.toml"), 1, three);
    let trained = home.json(&format!("grasp train {hand} --n 5 --lambdas 3 --file training.txt"));
    assert_eq!(trained, home.json(&format!("grasp train {hand} --n 5 --lambdas 3 --file training.txt")));
}

#[test]
fn without_a_board_the_code_is_four() {
    let home = Home::new();
    let missing = "unix:/nonexistent/board";
    for command in ["status", "play", "stop", "console"] {
        let output = home.darm(&format!("{command} --port {missing}"));
        assert_eq!(output.status.code(), Some(4), "{command}");
        assert!(text(&output.stderr).starts_with("darm: no port unix:/nonexistent/board; "), "{command}");
    }
    home.fails(
        "status -p ttyACM0",
        4,
        "darm: \"ttyACM0\" names no port; write /dev/ttyACM0, unix:PATH or tcp:HOST:PORT",
    );
    let refused = home.json(&format!("status --port {missing}"));
    assert_eq!(refused["error"]["exit"], 4);
}

#[test]
fn bad_usage_has_the_code_two() {
    let home = Home::new();
    assert_eq!(home.darm("dance").status.code(), Some(2));
    assert_eq!(home.darm("").status.code(), Some(2));
    let arm = example("planar4.toml");
    assert_eq!(home.darm(&format!("table {arm} -o t.darm")).status.code(), Some(2), "nothing to visit");
    home.fails(
        &format!("table {arm} --words 0104 -o t.darm"),
        2,
        "darm: --words 0104: digit 4 of the word is not one of 0 to 3",
    );
    home.fails(&format!("plant {arm} --line-low 64"), 2, "darm: no line 64; they go from 0 to 63");
}

#[test]
fn files_that_are_no_tables_are_told() {
    let home = Home::new();
    home.fails("upload a.darm", 1, "darm: cannot read a.darm: No such file or directory (os error 2)");
    home.write("a.darm", "no table");
    home.fails("upload a.darm", 1, "darm: a.darm: the bytes from 0 on are no table; tables are made by `darm table`");
    home.fails(
        "record a.darm -o run.csv",
        1,
        "darm: cannot read a.visits.csv: No such file or directory (os error 2); `darm table` writes it beside the table",
    );
}

#[test]
fn an_arm_file_is_blamed_by_line_and_column() {
    let home = Home::new();
    home.write("arm.toml", "format = 1\nname = \"a\"\nstages = 3\n");
    let output = home.darm("stops arm.toml arm.toml");
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).starts_with("darm: arm.toml:3:1: "), "{}", text(&output.stderr));
}

#[test]
fn from_a_base_line_to_a_table() {
    let home = Home::new();
    let (base, frames) = (example("planar4.toml"), example("planar4-frames.toml"));
    let found = home.json(&format!("synth {base} {frames} -o arm.toml"));
    assert_eq!(found["reached"], true);
    for frame in found["frames"].as_array().unwrap() {
        assert!(frame["error_m"].as_f64().unwrap() <= 1e-9 && frame["error_rad"].as_f64().unwrap() <= 1e-9);
    }

    let stops = home.json(&format!("stops {base} arm.toml"));
    assert!(!stops["settings"].as_array().unwrap().is_empty());
    assert!(home.succeeds(&format!("stops {base} {base}")).starts_with("nothing to move"));

    let table = home.json(&format!("table arm.toml {frames} -o visits.darm"));
    assert_eq!(table["visits"], 5);
    assert_eq!(table["model"], found["model"]);
    let visits = std::fs::read_to_string(home.path("visits.visits.csv")).unwrap();
    assert_eq!(visits.lines().count(), 7, "model, header and five visits");

    // A table is read before a board is looked for: only the board is missing.
    assert_eq!(home.darm("upload visits.darm -p unix:none").status.code(), Some(4));
    let bytes = std::fs::read(home.path("visits.darm")).unwrap();
    std::fs::write(home.path("cut.darm"), &bytes[..bytes.len() - 2]).unwrap();
    assert_eq!(home.darm("upload cut.darm -p unix:none").status.code(), Some(1));
}

#[test]
fn the_doctor_speaks_json() {
    let home = Home::new();
    let report = home.json("doctor");
    for check in report["checks"].as_array().unwrap() {
        assert!(check["state"] == "good" || check["fix"].is_string(), "{check}");
    }
}

#[test]
fn a_table_is_uploaded_played_and_measured() {
    let home = Home::new();
    let (arm, frames) = (example("planar4.toml"), example("planar4-frames.toml"));
    home.succeeds(&format!("table {arm} {frames} --dwell 0.3 -o visits.darm"));
    let board = Board::start(&home, &arm);
    let port = &board.port;
    home.fails(&format!("play {port}"), 3, "darm: the board refused: no table is loaded; upload one first");
    assert_eq!(home.json(&format!("upload visits.darm {port}"))["rows"], 5);

    let played = home.json(&format!("play {port}"));
    assert_eq!((&played["end"], &played["rows_played"]), (&"finished".into(), &5.into()));
    let status = home.json(&format!("status {port}"));
    assert_eq!((&status["phase"], &status["rows"]), (&"idle".into(), &5.into()));

    let recorded = home.json(&format!("record visits.darm --arm {arm} -o run.csv {port}"));
    assert_eq!(recorded["rows"], 5);
    // A computer that was busy meanwhile is told of, and that alone.
    let findings = recorded["findings"].as_array().unwrap();
    assert!(findings.iter().all(|finding| finding.as_str().unwrap().contains("clock departed")), "{findings:?}");
    let run = std::fs::read_to_string(home.path("run.csv")).unwrap();
    assert_eq!(run.lines().filter(|line| !line.starts_with('#')).count(), 6);
    assert!(run.contains("# clock_uncertainty_s "), "{run}");
    let few = "darm: run.csv: 5 words are not enough to tell an effect from chance: ";
    let output = home.darm(&format!("diagnose {arm} run.csv"));
    assert!(text(&output.stderr).starts_with(few), "{}", text(&output.stderr));
}

#[test]
fn the_board_answers_which_word_is_nearest() {
    let home = Home::new();
    let arm = example("planar4.toml");
    home.succeeds(&format!("table {arm} --words 000010000000 -o plain.darm"));
    home.succeeds(&format!("table {arm} --words 000010000000 --nearest -o framed.darm"));
    let board = Board::start(&home, &arm);
    let port = &board.port;
    let ask = format!("nearest {arm} 300,4200,10");
    let none = home.darm(&format!("{ask} --board {port}"));
    assert!(text(&none.stderr).contains("the board holds no table"), "{}", text(&none.stderr));
    home.succeeds(&format!("upload plain.darm {port}"));
    home.fails(
        &format!("{ask} --board {port}"),
        3,
        "darm: the board refused: the table has no frames of modules; make it with darm table --nearest, upload it",
    );
    home.succeeds(&format!("upload framed.darm {port}"));
    let (near, exact) = (home.json(&format!("{ask} --board {port}")), home.json(&ask));
    let [distance_mm, least_mm] = [&near, &exact["nearest"][0]].map(|found| found["distance_mm"].as_f64().unwrap());
    assert!(distance_mm > least_mm - 1e-3 && distance_mm < 2.0 * least_mm, "{distance_mm} {least_mm}");
    let said = home.types(&format!("console {port}"), "nearest 300 4200 10\nquit\n");
    assert!(said.contains(near["word"].as_str().unwrap()) && said.contains(" mm and "), "{said}");
    assert!(home.succeeds(&format!("{ask} --seconds 5")).contains("out of 4096 words, none nearer than"));
}

#[test]
fn a_stuck_output_is_an_exit_code_and_a_sentence() {
    let home = Home::new();
    let arm = example("planar4.toml");
    home.succeeds(&format!("table {arm} --words 000010000000 -o one.darm"));
    let board = Board::start(&home, &format!("{arm} --line-low 4"));
    let port = &board.port;
    home.succeeds(&format!("upload one.darm {port}"));
    let played = home.darm(&format!("play {port}"));
    assert_eq!(played.status.code(), Some(3));
    let said = text(&played.stderr);
    let expected = "darm: the board is in its safe state: actuator 4: limit switch expected closed, seen open at ";
    assert!(said.starts_with(expected) && said.contains(", row 0; mend the cause"), "{said}");
    assert_eq!(home.darm(&format!("status {port}")).status.code(), Some(3));
    assert!(home.succeeds(&format!("stop --clear {port}")).contains("cleared: actuator 4"));
    assert_eq!(home.json(&format!("status {port}"))["phase"], "idle");
}

#[test]
fn the_console_speaks_the_words_of_the_board() {
    let home = Home::new();
    let board = Board::start(&home, &example("planar4.toml"));
    let said = home.types(&format!("console {}", board.port), "id\nhelp\ndance\nquit\n");
    assert!(said.starts_with("board "), "{said}");
    assert!(said.contains("? dance: no such command; type help"), "{said}");
    for word in [
        "status",
        "limits",
        "table",
        "play",
        "stop",
        "coil N",
        "word DIGITS",
        "servo N DEG",
        "nearest X Y A",
        "fault",
        "log",
    ] {
        assert!(said.contains(&format!("\n{word}")), "{word} is not in {said}");
    }
}

/// A robot in the tests' data.
fn robot(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/urdf").join(name).display().to_string()
}

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
fn postures_are_found_by_populations_and_all_of_them_are_told() {
    let (home, puma) = (Home::new(), example("puma560.toml"));
    let found = home.json(&format!("ik {puma} --to 400,150,900 --method cma-es --tolerance-mm 1"));
    assert_eq!((&found["answers"][0]["method"], &found["answers"][0]["status"]), (&"cma-es".into(), &"reached".into()));
    let all = home.json(&format!("ik {puma} --to 400,150,900 --angles 180,0,90 --all --picture all.svg"));
    let postures = all["postures"].as_array().unwrap();
    assert!(all["freedom"] == 0 && postures.len() > 1, "{all}");
    assert!(std::fs::read_to_string(home.path("all.svg")).unwrap().starts_with("<svg"));
    let sampled = home.succeeds(&format!("ik {puma} --to 400,150,900 --all --most 3 --starts 50"));
    assert!(
        sampled.starts_with("a sample of 3 postures: the arm can move in 3 ways without moving the frame"),
        "{sampled}"
    );
    assert!(home.succeeds(&format!("ik {puma} --to 4000,0,0 --all --starts 9")).starts_with("no posture: none of 9"));
    let bench = "bench-ik --planar 300,300,300 --to 500,400,0 --runs 3 --iterations 30";
    let compared = home.json(&format!("{bench} --methods lm,memr --plot bench.svg"));
    assert_eq!((&compared["methods"][0]["met"], &compared["methods"][1]["met"]), (&3.into(), &0.into()));
    assert!(std::fs::read_to_string(home.path("bench.svg")).unwrap().contains("memr"));
    home.fails("bench-ik --planar 300,nan --to 1,2,3", 2, "darm: --planar: NaN mm is no length");
    home.fails(
        "bench-ik --to 1,2,3",
        2,
        "darm: name a robot, or the links of an arm in the plane: --planar 300,300,300",
    );
    home.fails("bench-ik --link 0", 2, "darm: --link 0: a length above zero is needed");
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
    let loaded = home.json(&format!("dynamics {puma} --q 0,45,-90,0,0,0 --wrench 0,0,0,0,0,10"));
    let statics = home.json(&format!("jacobian {puma} --q 0,45,-90,0,0,0 --wrench 0,0,0,0,0,10"));
    for joint in 0..6 {
        let of = |report: &serde_json::Value| report["states"][0]["torque"][joint].as_f64().unwrap();
        let by_load = statics["postures"][0]["statics"][joint].as_f64().unwrap();
        assert!((of(&held) - of(&loaded) - by_load).abs() < 1e-12);
    }
    let said = home.succeeds(&format!("dynamics {} --word 010110011101", example("planar4.toml")));
    assert!(said.contains("module 1, right leg     133.871  N"), "{said}");
    let legs = home.json(&format!("jacobian {} --word 010110011101", example("planar4.toml")));
    assert_eq!((legs["columns"].as_array().unwrap().len(), &legs["postures"][0]["whole"]["rank"]), (12, &3.into()));
    let whole = home.json(&format!("com {} --floating", robot("simple_humanoid.urdf")));
    assert!((whole["mass_kg"].as_f64().unwrap() - 130.8).abs() < 1e-9);
}

#[test]
fn torques_are_told_with_what_a_diagnosis_found() {
    let home = Home::new();
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/data/measured");
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
        assert!((of(&with, "of_effects") - more).abs() < 1e-9);
    }
    assert!(without["of_effects"].is_null());
    let said = home.succeeds("dynamics found.toml --postures run.csv");
    assert!(said.contains("of effects"), "{said}");
    home.write("lost.toml", &(robot + &effect("offset", "joint 9", "offset = 1.0")));
    home.fails(
        "dynamics lost.toml",
        1,
        "darm: the model has offset at joint 9, and this measurement has no such place: is this the right model?",
    );
    home.fails(
        "dynamics found.toml --torque 0,0,0,0,0,0",
        2,
        "darm: --torque and --forward: of a model with effects only the torques of a motion",
    );
}

#[test]
fn a_file_is_told_and_drawn() {
    let (home, panda) = (Home::new(), robot("panda.urdf"));
    let said = home.succeeds(&format!("model {panda}"));
    assert!(said.contains("warning: joint `panda_finger_joint2` mimics `panda_finger_joint1`"), "{said}");
    let said = home.succeeds(&format!("model {} --base-parameters", example("planar2.toml")));
    assert!(said.contains("\n  Izz link 1 + 0.25 m link 2\n"), "{said}");
    let corrected = example("../tests/data/corrected/corrected.toml");
    let constants = [
        (example("puma560.toml"), include_str!("../../firmware/src/bin/bench/puma560.rs")),
        (corrected, include_str!("../../firmware/src/bin/bench/corrected.rs")),
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
fn a_posture_that_makes_no_sense_is_told() {
    let (home, puma) = (Home::new(), example("puma560.toml"));
    home.fails(
        &format!("fk {} --q 1,2", example("planar2.toml").replace("planar2", "planar4")),
        2,
        "darm: --q has 2 numbers, there must be 0: none: nothing here is moved by a number",
    );
    home.fails(
        &format!("fk {puma} --q 1,2,3,4,5,6mm"),
        2,
        "darm: `6mm` of flange: `mm` is no unit here, there are deg or rad",
    );
    home.write("run.csv", "q1_deg\n1\n");
    let message = "darm: run.csv: no column shoulder_deg (or q2_deg); the file has q1_deg";
    home.fails(&format!("fk {puma} --postures run.csv"), 2, message);
    home.write("run.csv", "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n1,2,x,4,5,6\n");
    let message = "darm: run.csv: line 2: column q3_deg holds `x`, expected a number";
    home.fails(&format!("fk {puma} --postures run.csv"), 2, message);
    let message = "darm: there is no frame `hand`; there are base, link 1, link 2, link 3, link 4, link 5, link 6";
    home.fails(&format!("fk {puma} --frame hand"), 2, message);
}

/// Damaged measurements: name, model, text, exit code, and what the message or the note must say.
fn damaged() -> Vec<(&'static str, &'static str, String, i32, &'static str)> {
    const HEAD: &str = "t_s,x_mm,p_bar,F_N\n";
    const POSES: &str = "time_s,word,x_m,y_m,angle_deg\n";
    let (force, arm, robot) = ("cylinder.toml", "planar4.toml", "tx40.urdf");
    let rows = |n: u32, row: &dyn Fn(u32) -> String| (0..n).map(|k| row(k) + "\n").collect::<String>();
    let good = |n| rows(n, &|k| format!("{},{},2,{}", f64::from(k) * 0.1, k % 20, 98 + k % 7));
    let wave = |k: u32, size: f64| size * (f64::from(k) / 9.0).sin();
    let joints = (1..7).map(|k| format!(",q{k}")).chain((1..7).map(|k| format!(",tau{k}"))).collect::<String>();
    let angles = rows(200, &|k| f64::from(k).to_string() + &format!(",{}", wave(k, 170.0)).repeat(6) + ",1,2,1,2,1,2");
    let all = |cells: &str| HEAD.to_string() + &rows(60, &|_| cells.into());
    let held = "t_s,x_mm,p_bar,F_N,held_out\n".to_string() + &rows(200, &|k| format!("{k},{k},2,98,1"));
    let runs = "t_s,x_mm,p_bar,F_N,run\n".to_string() + &rows(4, &|k| format!("{k},{k},2,98,{k}"));
    let pose = |word: &str, x: &str| POSES.to_string() + &rows(60, &|k| format!("{k},{word},{x},3.9,1"));
    vec![
        ("empty", force, String::new(), 1, "no rows"),
        ("header-only", force, HEAD.into(), 1, "no rows"),
        ("blank-lines", force, "\n\n".into(), 1, "no rows"),
        ("no-header", force, "1,2,3,4\n5,6,7,8\n".into(), 1, "no column pressure"),
        ("missing-column", force, "t_s,x_mm,p_bar\n1,2,3\n".into(), 1, "--map force=COLUMN"),
        ("short-row", force, format!("{HEAD}1,2,3\n"), 1, "line: 2"),
        ("long-row", force, format!("{HEAD}1,2,3,4,5\n"), 1, "line: 2"),
        ("one-row", force, format!("{HEAD}1,2,3,4\n"), 1, "not enough"),
        ("five-rows", force, HEAD.to_string() + &good(5), 1, "not enough"),
        ("a-run-a-row", force, runs, 1, "not enough"),
        ("all-held-out", force, held, 1, "not enough"),
        ("no-numbers", force, all("nan,nan,nan,nan"), 1, "no number in line 2"),
        ("words", force, all("x,y,z,w"), 1, "no number in line 2"),
        ("overflow", force, all("1,2,1e300,1e300"), 1, "right model"),
        ("control-characters", force, "\u{1}\n\u{2},\u{3}\n".into(), 1, "comma-separated"),
        ("constant", force, all("1,1,1,1"), 0, "never changes"),
        ("zeros", force, all("0,0,0,0"), 0, "repeats the one before"),
        ("some-nan", force, HEAD.to_string() + &good(100) + "10,nan,2,98\n", 0, "line 102"),
        ("two-time-bases", force, HEAD.to_string() + &good(100) + &good(100), 0, "line 102: time runs back"),
        ("repeated-row", force, format!("{HEAD}0,1,2,98\n0,1,2,98\n{}", good(100)), 0, "line 3"),
        ("bar-for-pascal", force, "t_s,x_mm,p,F_N\n".to_string() + &good(100), 0, "are these bar"),
        (
            "millimetres",
            force,
            "t_s,x,p_bar,F_N\n".to_string() + &rows(100, &|k| format!("{k},{},2,98", wave(k, 30.0))),
            0,
            "are these millimetres",
        ),
        ("degrees", robot, format!("t{joints}\n{angles}"), 0, "are these degrees"),
        ("wrong-model", robot, HEAD.to_string() + &good(100), 1, "no column q1"),
        ("other-columns", arm, HEAD.to_string() + &good(100), 1, "no column time_s"),
        ("long-word", arm, pose("0101010101010", "0.1"), 1, "13 digits"),
        ("letters", arm, pose("abc", "0.1"), 1, "digits 0 to 3"),
        ("no-state", arm, pose("000000000003", "0.1"), 1, "no state"),
        ("one-word", arm, pose("000000000000", "0.1"), 1, "not enough"),
        ("poses-of-nan", arm, pose("000000000000", "nan"), 1, "not enough"),
        ("poses-header-only", arm, POSES.into(), 1, "no rows"),
        ("not-a-log.mcap", force, "abc".into(), 1, "does not begin as an MCAP log"),
        ("cut.csv.gz", force, "\u{1f}".into(), 1, "cannot be read"),
    ]
}

#[test]
fn damaged_measurements_are_told_and_none_panics() {
    let home = Home::new();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for model in ["tests/data/measured/cylinder.toml", "tests/data/measured/tx40.urdf", "examples/planar4.toml"] {
        let name = Path::new(model).file_name().unwrap();
        std::fs::copy(examples.join(model), home.0.path().join(name)).unwrap();
    }
    for (name, model, content, code, message) in damaged() {
        let file = if name.contains('.') { name.to_string() } else { format!("{name}.csv") };
        home.write(&file, &content);
        let output = home.darm(&format!("diagnose {model} {file}"));
        let told = text(&output.stdout) + &text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{name}: {told}");
        assert!(told.contains(message) && !told.contains("panicked") && !told.contains("NaN kg"), "{name}: {told}");
    }
}

#[test]
fn a_log_is_diagnosed_as_its_table_is() {
    let home = Home::new();
    let force = "kind = \"cylinder\"\nbore_mm = 25\n";
    home.write("cylinder.toml", force);
    let rows: String =
        (0..200).map(|k| format!("{:.1},{},{},{}\n", f64::from(k) * 0.1, k % 20, 2 + k % 3, 98 + k % 7)).collect();
    let table = format!("t_s,x_mm,p_bar,F_N\n{rows}");
    home.write("run.csv", &table);
    std::fs::write(home.path("run.mcap"), darm::measurement::log::from_text(&table).unwrap()).unwrap();
    let [csv, log] =
        ["run.csv", "run.mcap"].map(|file| text(&home.darm(&format!("--json diagnose cylinder.toml {file}")).stdout));
    assert!(csv.len() > 1000);
    assert_eq!(csv, log);
    let help = text(&home.darm("diagnose --help").stdout);
    assert!(help.contains("--write-model"));
}

/// The 88 golden postures as a table, each row changed by `change`.
fn postures(change: impl Fn(&mut Vec<f64>)) -> String {
    let packed = include_bytes!("../../tests/data/golden/planar5_sit_to_stand.json.gz");
    let golden: serde_json::Value = serde_json::from_reader(flate2::read::GzDecoder::new(&packed[..])).unwrap();
    let numbers = |value: &serde_json::Value| -> Vec<f64> {
        value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
    };
    let joints = ["ankle", "knee", "hip", "torso_pitch"];
    let head = joints.map(|joint| format!("{joint}_rad")).into_iter().chain(joints.map(|j| format!("tau_{j}_nm")));
    let mut text = head.chain(["Fx_n", "Fz_n", "My_nm"].map(str::to_owned)).collect::<Vec<_>>().join(",") + "\n";
    for posture in golden["postures"].as_array().unwrap() {
        let (q, f) = (numbers(&posture["q"]), numbers(&posture["f"]));
        let mut row = [&q[4..], &f[3..], &[f[0], f[1], -f[2]]].concat();
        change(&mut row);
        text += &(row.iter().map(f64::to_string).collect::<Vec<_>>().join(",") + "\n");
    }
    text
}

#[test]
fn masses_are_identified_and_bad_postures_are_told() {
    let (home, planar) = (Home::new(), robot("planar5.urdf"));
    home.write("good.csv", &postures(|_| ()));
    let told = home.json(&format!("com identify {planar} good.csv --splits 5 -o masses.json"));
    assert_eq!((told["rank"].as_u64(), told["possible"].as_bool()), (Some(10), Some(true)));
    assert!(told["held_out"]["identified_m"][0].as_f64().unwrap() < 1e-6, "{told}");
    assert!(told["missing"]["named"].as_array().unwrap().is_empty(), "{told}");
    assert!(std::fs::read_to_string(home.path("masses.json")).unwrap().contains("torso"));
    let refused = |table: String| {
        home.write("bad.csv", &table);
        let output = home.darm(&format!("com identify {planar} bad.csv"));
        assert_eq!(output.status.code(), Some(1));
        text(&output.stderr)
    };
    let one = postures(|_| ()).lines().take(2).collect::<Vec<_>>().join("\n");
    assert!(refused(one).contains("1 posture(s) tell"));
    let reversed = refused(postures(|row| row[8..].iter_mut().for_each(|x| *x = -*x)));
    assert!(reversed.contains("line 2: the contacts pull the robot down"), "{reversed}");
    let human = example("../tests/data/measured/human.urdf");
    let setup = example("../tests/data/stand/stand.toml");
    home.write(
        "capture.csv",
        &(0..12).fold("t_s,LASI_x,LASI_y,LASI_z,Fz_n,Mx_nm,My_nm\n".to_owned(), |text, k| {
            text + &format!("{},0,0,1,700,0,0\n", 0.02 * f64::from(k))
        }),
    );
    let output = home.darm(&format!("com map {human} {planar} {setup} capture.csv"));
    assert!(text(&output.stderr).contains("no marker C7"), "{}", text(&output.stderr));
}
