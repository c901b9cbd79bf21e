//! The command line as a user sees it: help, messages, exit codes, JSON, and the steps from a synthesis to a recording. The
//! board is the firmware's library in a process.

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

mod bringup;
mod bundle;
mod calibrate;
mod console;
mod differential;
mod digests;
mod examples;
mod file_errors;
mod files;
mod formats;
mod guests;
mod hostile;
mod import;
mod limits;
mod logs;
mod measurements;
mod models;
mod own_arm;
mod predictions;
mod profile;
mod recording;
mod robots;
mod serve_kills;
mod serve_load;
mod serve_recording;
mod serve_without_board;
mod sim;
mod stop;
mod unfinished;

const COMMANDS: [&str; 39] = [
    "synth",
    "generate",
    "adjust",
    "bringup",
    "table",
    "upload",
    "play",
    "stop",
    "status",
    "record",
    "import",
    "diagnose",
    "calibrate",
    "bundle",
    "console",
    "sim",
    "flash",
    "doctor",
    "profile",
    "fk",
    "jacobian",
    "ik",
    "bench-ik",
    "dynamics",
    "com",
    "model",
    "draw",
    "new",
    "load",
    "wiring",
    "nearest",
    "map",
    "path",
    "grasp",
    "inertia",
    "odometry",
    "serve",
    "completions",
    "man",
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

    /// Runs `darm`, which overwrites files, as for a person who agrees.
    fn darm(&self, line: &str) -> Output {
        self.command(line).env("DARM_FORCE", "1").stdin(Stdio::null()).output().unwrap()
    }

    /// Runs `darm` with this text on its standard input.
    fn types(&self, line: &str, typed: &str) -> String {
        let mut child = self.command(line).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        child.stdin.take().unwrap().write_all(typed.as_bytes()).unwrap();
        text(&child.wait_with_output().unwrap().stdout)
    }

    #[track_caller]
    fn fails(&self, line: &str, code: i32, message: &str) {
        let output = self.command(line).stdin(Stdio::null()).output().unwrap();
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

/// A board of `darm sim` in this home; commands reach it by `self.port`.
struct Board {
    child: Child,
    port: String,
}

impl Board {
    /// Starts a board and waits until it has said where it is.
    fn start(home: &Home, line: &str) -> Self {
        let mut command = home.command(&format!("--json sim --in-process {line}"));
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
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name).display().to_string()
}

fn robot(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/urdf").join(name).display().to_string()
}

#[test]
fn every_command_has_help_with_examples() {
    let home = Home::new();
    for command in COMMANDS {
        let help = home.succeeds(&format!("{command} --help"));
        assert!(help.contains("Examples:\n  darm ") || help.contains("darm flash"), "{command} has no examples");
        let longest = help.lines().map(|line| line.chars().count()).max().unwrap();
        assert!(longest <= 120, "{command}: a line of its help has {longest} characters");
    }
}

/// The commands that the overview lists behind the names of their groups.
fn commands_of_groups(overview: &str) -> Vec<(&str, Vec<&str>)> {
    let lines = overview.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    lines
        .filter_map(|line| line.trim().split_once(' '))
        .map(|(group, names)| (group, names.trim().split(", ").collect()))
        .collect()
}

#[test]
fn the_overview_fits_on_a_screen_and_names_each_command_in_one_group() {
    let home = Home::new();
    let overview = home.succeeds("--help");
    assert!(overview.lines().count() <= 45, "{} lines:\n{overview}", overview.lines().count());
    assert_eq!(home.succeeds("help"), overview);
    let groups = commands_of_groups(&overview);
    let mut listed: Vec<&str> = groups.iter().flat_map(|(_, names)| names.clone()).collect();
    listed.sort_unstable();
    let mut all = COMMANDS;
    all.sort_unstable();
    assert_eq!(listed, all, "{overview}");
    for (group, names) in groups {
        let help = home.succeeds(&format!("help {group}"));
        for name in names {
            let text = home.succeeds(&format!("{name} --help"));
            let about = text.lines().take_while(|line| !line.is_empty()).collect::<Vec<_>>().join(" ");
            assert!(help.contains(&format!("\n  {name:12}{about}\n")), "{group}, {name}: {help}");
        }
    }
}

#[test]
fn help_of_a_command_is_the_same_by_both_ways() {
    let home = Home::new();
    for command in ["synth", "profile", "profile write"] {
        assert_eq!(home.succeeds(&format!("help {command}")), home.succeeds(&format!("{command} --help")), "{command}");
    }
    assert!(home.succeeds("help conventions").contains("numbered from 0"));
    let unknown = "darm: help dance: no such command or group; the groups are loop, build, boards, diagnosis, robots, papers, \
                   set-up, and conventions";
    home.fails("help dance", 2, unknown);
}

#[test]
fn a_hand_makes_contacts_or_reports_which_it_cannot() {
    let home = Home::new();
    let (hand, contacts) = (example("allegro_hand.toml"), example("grasp-contacts.toml"));
    let found = home.json(&format!("grasp solve {hand} {contacts} --plot grasp.svg"));
    assert!(found["error_m"].as_f64().unwrap() < 1e-6 && found["fingers"].as_array().unwrap().len() == 4);
    assert!(std::fs::read_to_string(home.path("grasp.svg")).unwrap().contains("front: y, z"));
    let bare = example("allegro_hand.urdf");
    let found = home.json(&format!("grasp solve {bare} {contacts}"));
    assert!(found["error_m"].as_f64().unwrap() < 1e-6);
    let arm = home.darm(&format!("grasp solve {} {contacts}", example("../tests/data/urdf/ur10.urdf")));
    assert!(text(&arm.stderr).contains("name four by --tips INDEX,MEDIUM,RING,THUMB"), "{}", text(&arm.stderr));
    let text = std::fs::read_to_string(&contacts).unwrap();
    home.write("far.toml", &text.replace("[390, 24, 140]", "[-390, 24, 140]"));
    let far = "darm: contacts index and thumb are 838 mm apart, the fingers can span 373 mm; move the contacts closer";
    home.fails(&format!("grasp solve {hand} far.toml"), 1, far);
    home.write("three.toml", text.rsplit_once("[[contact]]").unwrap().0);
    let three = "darm: three.toml:2:10: 3 contacts are given, there must be 4, each a [[contact]]";
    home.fails(&format!("grasp solve {hand} three.toml"), 1, three);
    let trained = home.json(&format!("grasp train {hand} --constraints 5 --lambdas 3 -o training.txt"));
    assert_eq!(trained, home.json(&format!("grasp train {hand} --constraints 5 --lambdas 3 -o training.txt")));
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
    home.fails(&format!("sim {arm} --line-low 64"), 2, "darm: line 64 does not exist; give 0 to 63");
}

#[test]
fn files_that_are_not_tables_are_reported() {
    let home = Home::new();
    home.fails(
        "upload a.darm",
        1,
        "darm: a.darm: cannot be read: No such file or directory (os error 2); check the path",
    );
    home.write("a.darm", "no table");
    home.fails("upload a.darm", 1, "darm: a.darm is not a table of this version; remake it with `darm table`");
    home.fails(
        "record a.darm -o run.csv",
        1,
        "darm: a.visits.csv: cannot be read: No such file or directory (os error 2); `darm table` writes it together with the table",
    );
}

#[test]
fn an_error_in_an_arm_file_has_line_and_column() {
    let home = Home::new();
    home.write("arm.toml", "format = 2\nname = \"a\"\nstages = 3\n");
    let output = home.darm("adjust arm.toml arm.toml");
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).starts_with("darm: arm.toml:3:1: "), "{}", text(&output.stderr));
}

#[test]
fn a_synthesised_arm_gets_adjustments_and_a_table() {
    let home = Home::new();
    let (base, frames) = (example("planar4.toml"), example("planar4-frames.toml"));
    let found = home.json(&format!("synth {base} {frames} -o arm.toml"));
    assert_eq!(found["reached"], true);
    for frame in found["frames"].as_array().unwrap() {
        assert!(frame["error_m"].as_f64().unwrap() <= 1e-9 && frame["error_rad"].as_f64().unwrap() <= 1e-9);
    }

    let adjustments = home.json(&format!("adjust {base} arm.toml"));
    let first = &adjustments["settings"][0];
    let [from_m, to_m, change_m] = ["from_m", "to_m", "change_m"].map(|key| first[key].as_f64().unwrap());
    assert!((to_m - from_m - change_m).abs() < 1e-12 && from_m > 0.1 && from_m < 3.0, "{first}");
    assert!(home.succeeds(&format!("adjust {base} {base}")).starts_with("no adjustment"));

    let table = home.json(&format!("table arm.toml {frames} -o visits.darm"));
    assert_eq!(table["visits"], 5);
    assert_eq!(table["model"], found["model"]);
    let visits = std::fs::read_to_string(home.path("visits.visits.csv")).unwrap();
    assert_eq!(visits.lines().count(), 9, "three comments, header and five visits");

    // A table is read before a board is looked for: only the board is missing.
    assert_eq!(home.darm("upload visits.darm -p unix:none").status.code(), Some(4));
    let bytes = std::fs::read(home.path("visits.darm")).unwrap();
    std::fs::write(home.path("cut.darm"), &bytes[..bytes.len() - 2]).unwrap();
    assert_eq!(home.darm("upload cut.darm -p unix:none").status.code(), Some(1));
}

#[test]
fn the_doctor_reports_json_and_fails_with_a_check() {
    let home = Home::new();
    let board = Board::start(&home, &example("planar4.toml"));
    for line in ["doctor", &format!("doctor {}", board.port)] {
        let report = home.json(line);
        for check in report["checks"].as_array().unwrap() {
            assert!(check["state"] == "good" || check["fix"].is_string(), "{check}");
        }
    }
    let report = home.json(&format!("doctor {}", board.port));
    let state = |name: &str| {
        let check = report["checks"].as_array().unwrap().iter().find(|check| check["name"] == name);
        check.unwrap_or_else(|| panic!("{name}: {report}"))["state"].clone()
    };
    assert_eq!(["board", "table", "profile", "outputs"].map(state), ["good", "missing", "good", "good"]);
    assert_eq!(
        home.darm(&format!("--json doctor {}", board.port)).status.code(),
        Some(0),
        "a missing table is no failure"
    );
    for json in ["", "--json "] {
        let failed = home.darm(&format!("{json}doctor --port unix:none"));
        assert_eq!(failed.status.code(), Some(1), "{json}");
        assert!(text(&failed.stderr).contains("1 of the checks failed"), "{}", text(&failed.stderr));
        assert!(text(&failed.stdout).contains("no port unix:none"), "{}", text(&failed.stdout));
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
    recording::check_strokes(&std::fs::read_to_string(home.path("run.csv")).unwrap());
    // The only note allowed is about a busy computer.
    let findings = recorded["findings"].as_array().unwrap();
    assert!(findings.iter().all(|finding| finding.as_str().unwrap().contains("clock lost")), "{findings:?}");
    let run = std::fs::read_to_string(home.path("run.csv")).unwrap();
    assert_eq!(run.lines().filter(|line| !line.starts_with('#')).count(), 6);
    assert!(run.contains("# clock_uncertainty_s "), "{run}");
    let few = "darm: run.csv: 5 words are not enough to distinguish an effect from chance: ";
    let output = home.darm(&format!("diagnose {arm} run.csv"));
    assert!(text(&output.stderr).starts_with(few), "{}", text(&output.stderr));
}

#[test]
fn the_board_searches_the_nearest_word() {
    let home = Home::new();
    let arm = example("planar4.toml");
    home.succeeds(&format!("table {arm} --words 000010000000 -o plain.darm"));
    home.succeeds(&format!("table {arm} --words 000010000000 --nearest -o framed.darm"));
    let board = Board::start(&home, &arm);
    let port = &board.port;
    let ask = format!("nearest {arm} 300,4200,10");
    let none = home.darm(&format!("{ask} --on-board {port}"));
    assert!(text(&none.stderr).contains("the board has no table"), "{}", text(&none.stderr));
    home.succeeds(&format!("upload plain.darm {port}"));
    home.fails(
        &format!("{ask} --on-board {port}"),
        3,
        "darm: the board refused: the table has no frames of modules; make it with darm table --nearest, upload it",
    );
    home.succeeds(&format!("upload framed.darm {port}"));
    let (near, exact) = (home.json(&format!("{ask} --on-board {port}")), home.json(&ask));
    let [distance_m, smallest_m] = [&near, &exact["nearest"][0]].map(|found| found["distance_m"].as_f64().unwrap());
    assert!(distance_m > smallest_m - 1e-6 && distance_m < 2.0 * smallest_m, "{distance_m} {smallest_m}");
    let said = home.types(&format!("console {port}"), "nearest 300 4200 10\nquit\n");
    assert!(said.contains(near["word"].as_str().unwrap()) && said.contains(" mm and "), "{said}");
    assert!(home.succeeds(&format!("{ask} --seconds 5")).contains("4096 words, lower bound "));
}

#[test]
fn a_stuck_output_gives_an_exit_code_and_a_message() {
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
    assert!(said.starts_with(expected) && said.contains(", row 0; remove the cause"), "{said}");
    assert_eq!(home.darm(&format!("status {port}")).status.code(), Some(3));
    assert!(home.succeeds(&format!("stop --clear {port}")).contains("cleared: actuator 4"));
    assert_eq!(home.json(&format!("status {port}"))["phase"], "idle");
}
