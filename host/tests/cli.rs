//! The tool `darm` as a user meets it: help with examples, messages and exit codes, JSON, and the way from a base-line
//! to a table.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

const COMMANDS: [&str; 13] = [
    "synth", "stops", "table", "upload", "play", "stop", "status", "record", "diagnose", "console", "plant", "flash",
    "doctor",
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

    /// Runs `darm` with these words on its command line, and nothing else around it.
    fn darm(&self, line: &str) -> Output {
        Command::new(env!("CARGO_BIN_EXE_darm"))
            .args(line.split_whitespace())
            .current_dir(self.0.path())
            .env_clear()
            .env("HOME", self.0.path())
            .stdin(Stdio::null())
            .output()
            .unwrap()
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
