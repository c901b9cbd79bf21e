//! Bring-up of an arm on a simulated board that is wired with a mistake.

use std::process::Stdio;
use std::thread;
use std::time::Duration;

use super::stop::interrupt;
use super::{Board, Home, example, text};

/// The arm and its profile, and a profile in which two lines are exchanged: that is how the simulated arm is wired.
fn miswired(home: &Home) -> Board {
    for name in ["planar4.toml", "planar4.profile.toml"] {
        std::fs::copy(example(name), home.path(name)).unwrap();
    }
    let profile = std::fs::read_to_string(home.path("planar4.profile.toml")).unwrap();
    let wired = profile.replace("line = 0\n", "line = x\n").replace("line = 1\n", "line = 0\n");
    home.write("wired.toml", &wired.replace("line = x\n", "line = 1\n"));
    Board::start(home, "planar4.toml --wired-as wired.toml")
}

/// Answers for outputs 0 and 1: each is switched on, and moves the other's actuator.
const ANSWERS: &str = "\n1\n\n0\n";

#[test]
fn exchanged_outputs_are_found_by_a_person_and_corrected() {
    let home = Home::new();
    let board = miswired(&home);
    let line = format!("bringup planar4.toml --actuator 0 --actuator 1 {}", board.port);
    let files = "-o board.toml --new-arm checked.toml";
    let found: serde_json::Value =
        serde_json::from_str(&home.types(&format!("--json {line} {files}"), ANSWERS)).unwrap();
    assert_eq!(found["findings"].as_array().unwrap().len(), 1, "{found}");
    assert_eq!(found["findings"][0]["kind"], "outputs-swapped");
    assert_eq!(found["findings"][0]["wire"], "output 0 (line 0) and output 1 (line 1)");
    assert_eq!((&found["complete"], &found["watched"]), (&true.into(), &true.into()));
    let wired = std::fs::read_to_string(home.path("wired.toml")).unwrap();
    assert_eq!(std::fs::read_to_string(home.path("board.toml")).unwrap(), wired, "the corrected profile is the wiring");
    assert!(std::fs::read_to_string(home.path("checked.toml")).unwrap().contains("profile = \"board.toml\""));
    home.fails(&format!("{line} --yes {files}"), 1, "darm: board.toml exists; overwrite it with --force");
    home.fails(
        &format!("bringup planar4.toml --actuator 12 --yes {}", board.port),
        2,
        "darm: --actuator 12: planar4.toml has actuators 0 to 11",
    );
    let unwatched = home.darm(&format!("{line} --yes"));
    assert_eq!(unwatched.status.code(), Some(1));
    let said = text(&unwatched.stdout);
    assert!(said.contains("output-or-switch: output 0 (line 0), or input 1 (switch of actuator 1"), "{said}");
    assert!(said.ends_with("2 outputs checked, 2 findings\n"), "{said}");
    assert_eq!(home.json(&format!("status {}", board.port))["phase"], "idle");
}

#[test]
fn an_early_end_reports_what_was_checked() {
    let home = Home::new();
    let board = miswired(&home);
    let mut command = home.command(&format!("bringup planar4.toml {}", board.port));
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    std::io::Write::write_all(&mut child.stdin.take().unwrap(), b"s\n\nr\n\n0\nq\n").unwrap();
    let ended = child.wait_with_output().unwrap();
    assert_eq!(ended.status.code(), Some(7), "{}", text(&ended.stderr));
    let said = text(&ended.stdout);
    assert!(said.contains("moves-other: output 1 (line 1)") && said.contains("not checked: outputs 0\n"), "{said}");
    let end = "the bring-up was ended after 1 of 12 outputs; run it again, for single actuators with --actuator N\n";
    assert!(text(&ended.stderr).ends_with(end), "{}", text(&ended.stderr));
}

#[test]
fn a_right_arm_gets_its_times_of_travel_and_no_finding() {
    let home = Home::new();
    let arm = example("planar4.toml");
    let board = Board::start(&home, &arm);
    let checked = home.json(&format!("bringup {arm} --yes --actuator 3 --new-arm checked.toml {}", board.port));
    assert_eq!((&checked["findings"], &checked["outputs"]), (&serde_json::json!([]), &serde_json::json!([3])));
    // A quarter of the 150 ms in the file.
    let stroke = &checked["strokes"][0];
    let [min_s, max_s] = ["min_s", "max_s"].map(|key| stroke[key].as_f64().unwrap());
    assert!(min_s <= 0.0375 + 1e-3 && max_s >= 0.0375 - 1e-3 && stroke["on"] == true, "{stroke}");
    let travel_ms = 1e3 * checked["actuators"][0]["new_travel_s"].as_f64().unwrap();
    let written = std::fs::read_to_string(home.path("checked.toml")).unwrap();
    assert_eq!(written.matches(&format!("travel_ms = {travel_ms:.0}\n")).count(), 1, "{travel_ms}");
    let other = "darm: the board has the profile ";
    home.succeeds(&format!("profile make {arm} -o first.toml"));
    let refused = home.darm(&format!("bringup {arm} --yes --profile first.toml {}", board.port));
    assert_eq!(refused.status.code(), Some(1));
    assert!(text(&refused.stderr).starts_with(other), "{}", text(&refused.stderr));
}

#[test]
fn an_interrupt_stops_the_arm_between_two_outputs_or_within_one() {
    let home = Home::new();
    let arm = example("planar4.toml");
    let board = Board::start(&home, &arm);
    let mut command = home.command(&format!("bringup {arm} --yes {}", board.port));
    let mut child = command.stdin(Stdio::null()).stdout(Stdio::null()).spawn().unwrap();
    thread::sleep(Duration::from_secs(2));
    interrupt(&child);
    assert_eq!(child.wait().unwrap().code(), Some(6));
    let status = home.json(&format!("status {}", board.port));
    assert_eq!((&status["phase"], &status["word"]), (&"idle".into(), &"000000000000".into()));
}
