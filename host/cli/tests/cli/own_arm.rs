//! An arm of one's own: `darm new`, `darm load`, `darm wiring`, and files that are not overwritten unasked.

use std::fs::File;
use std::io::Write as _;
use std::os::fd::OwnedFd;
use std::process::Stdio;

use rustix::fs::{Mode, OFlags, open};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

use super::{Home, example, text};

#[test]
fn a_new_arm_needs_no_edit_until_its_table() {
    let home = Home::new();
    let choices = [
        ("one", "--topology serial --modules 1", 1),
        ("two", "--topology serial --modules 2 --valve bistable --angle 60 --torque 8", 2),
        ("nine", "--modules 3 --board any", 9),
        ("six", "--topology spatial --modules 1 --board b-l475e-iot01a --no-switches", 6),
    ];
    for (name, options, actuators) in choices {
        let made = home.json(&format!("new {name} {options}"));
        assert_eq!(made["actuators"], actuators, "{name}");
        assert_eq!(home.json(&format!("wiring {name}.toml"))["contradictions"], serde_json::json!([]));
        home.succeeds(&format!("profile check {name}.profile.toml --arm {name}.toml"));
        home.succeeds(&format!("table {name}.toml {name}-frames.toml --dwell 0.2 -o {name}.darm"));
        let load = home.json(&format!("load {name}.toml"));
        // A joint of two positions rests on a stop in each.
        assert_eq!(load["carries_kg"].is_null(), load["is_unlimited"] == true, "{name}");
        assert!(name != "one" || load["is_unlimited"] == true, "{name}");
        home.succeeds(&format!("draw {name}.toml -o {name}.svg"));
    }
    home.fails("new two --stroke 5 --topology serial", 2, "darm: --stroke: joints turn; give --angle");
    home.fails(
        "new two --modules 40",
        1,
        "darm: 40 modules of 3 actuators each; give 1 to 16: a board drives 48 outputs by 64 lines",
    );
}

#[test]
fn an_arm_with_too_few_words_has_no_measurement_plan() {
    let home = Home::new();
    home.succeeds("new two --topology serial --modules 2");
    home.fails(
        "table two.toml --measurement-plan -o plan.darm",
        1,
        "darm: the arm has 4 words, and a diagnosis needs a plan of 27 to distinguish an effect from chance; measure single words \
         by `--words`, and compare them with `darm fk`",
    );
    home.succeeds("table two.toml --words 00 10 11 01 -o words.darm");
}

#[test]
fn load_compares_what_actuators_bear_with_what_they_give() {
    let home = Home::new();
    let arm = example("pneumatic9.toml");
    let report = home.json(&format!("load {arm} --payload 1"));
    let carries_kg = report["carries_kg"].as_f64().unwrap();
    let at_most = home.json(&format!("load {arm} --payload {carries_kg}"));
    let share = at_most["worst"]["share"].as_f64().unwrap();
    assert!((share - 1.0).abs() < 1e-4, "{share}");
    let word = at_most["worst"]["word"].as_str().unwrap();
    let actuator = at_most["worst"]["actuator"].as_u64().unwrap() as usize;
    let in_word = home.json(&format!("load {arm} --payload {carries_kg} --word {word}"));
    assert_eq!(in_word["worst"]["load"], at_most["worst"]["load"]);
    assert_eq!(in_word["actuators"][actuator]["load"], at_most["worst"]["load"]);
    let weaker = home.json(&format!("load {arm} --supply 3"))["carries_kg"].as_f64().unwrap();
    assert!(weaker < carries_kg, "{weaker} {carries_kg}");
    let printed = home.succeeds(&format!("load {arm}"));
    assert!(printed.starts_with(&format!("carries {carries_kg:.2} kg in addition to the tool at 6 bar")), "{printed}");
    let without = home.succeeds(&format!("load {}", example("planar4.toml")));
    assert!(without.contains("the arm file does not say what the actuators give"), "{without}");
    home.fails(&format!("load {arm} --payload -1"), 2, "darm: --payload -1: give a mass of 0 to 1000000 kg");
}

#[test]
fn wiring_names_contradictions_and_fails() {
    let home = Home::new();
    let arm = example("pneumatic9.toml");
    home.succeeds(&format!("wiring {arm} -o wires.csv"));
    let csv = std::fs::read_to_string(home.path("wires.csv")).unwrap();
    assert_eq!(csv.lines().count(), 10);
    assert!(csv.contains("\n8,8,1,QA,15,valve,8,\"module 3, right leg\",1,8,GP14,1\n"), "{csv}");
    let profile = std::fs::read_to_string(example("pneumatic9.profile.toml")).unwrap();
    home.write("other.toml", &profile.replace("input = 4", "").replace("number = 7", "number = 12"));
    let output = home.darm(&format!("wiring {arm} --profile other.toml"));
    let errors = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1));
    assert!(errors.contains("darm: arm file and profile contradict each other:"), "{errors}");
    assert!(errors.contains("output 4 has no limit switch") && errors.contains("has no output 7"), "{errors}");
    assert!(errors.contains("note: output 12 of the profile moves nothing of this arm"), "{errors}");
}

/// Both ends of a terminal: that of the person, and that of the command.
fn terminal() -> (File, OwnedFd) {
    let person = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&person).unwrap();
    unlockpt(&person).unwrap();
    let name = ptsname(&person, Vec::new()).unwrap();
    let command = open(name.as_c_str(), OFlags::RDWR | OFlags::NOCTTY, Mode::empty()).unwrap();
    (person.into(), command)
}

/// Runs `darm` at a terminal where a person answers; whether it succeeds.
fn answered(home: &Home, line: &str, answers: &str) -> bool {
    let (mut person, command) = terminal();
    let errors = command.try_clone().unwrap();
    let mut darm = home.command(line);
    let mut child = darm.stdin(Stdio::from(command)).stderr(Stdio::from(errors)).stdout(Stdio::null()).spawn().unwrap();
    // The terminal keeps what is typed until it is read.
    person.write_all(answers.as_bytes()).unwrap();
    child.wait().unwrap().success()
}

#[test]
fn a_file_is_overwritten_after_a_question_or_with_force() {
    let home = Home::new();
    let arm = example("planar4.toml");
    home.write("arm.svg", "<svg>mine</svg>");
    let is_mine = || std::fs::read_to_string(home.path("arm.svg")).unwrap().contains("mine");
    home.fails(&format!("draw {arm} -o arm.svg"), 1, "darm: arm.svg exists; overwrite it with --force");
    assert!(!answered(&home, &format!("draw {arm} -o arm.svg"), "n\n") && is_mine());
    assert!(answered(&home, &format!("draw {arm} -o arm.svg"), "y\n") && !is_mine());
    home.write("arm.svg", "<svg>mine</svg>");
    assert!(home.command(&format!("draw {arm} -o arm.svg --force")).status().unwrap().success() && !is_mine());
}

#[test]
fn a_new_arm_asks_for_what_is_not_given() {
    let home = Home::new();
    assert!(answered(&home, "new mine --modules 2", "spatial\n300\nbistable\n32\nmany\n12\n\nany\n"));
    let arm = std::fs::read_to_string(home.path("mine.toml")).unwrap();
    assert!(arm.contains("bore_m = 0.032, rod_m = 0.012") && arm.matches("spatial-platform").count() == 2, "{arm}");
    let profile = std::fs::read_to_string(home.path("mine.profile.toml")).unwrap();
    assert!(profile.contains("drive = \"latch\"") && !profile.contains("\nboard ="), "{profile}");
    assert!(!answered(&home, "new mine", "\u{4}"), "the input has ended");
}
