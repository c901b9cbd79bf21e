//! Programs and recordings that do not come to their end, and those that begin after a phase by hand.

use std::process::{Child, Stdio};
use std::thread;
use std::time::Duration;

use super::{Board, Home, example, text};

const WORDS: &str = "000010000000 000001000000 000011000000 000000100000 000010100000 000001100000";

/// A board that has a program of six visits.
fn board(home: &Home, dwell_s: f64) -> Board {
    let arm = example("planar4.toml");
    home.succeeds(&format!("table {arm} --words {WORDS} --dwell {dwell_s} -o six.darm"));
    let board = Board::start(home, &arm);
    home.succeeds(&format!("upload six.darm {}", board.port));
    board
}

fn start(home: &Home, line: &str) -> Child {
    let mut command = home.command(line);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

/// Runs a command and stops the arm from another one after `after_s`; code and JSON of the first.
fn stopped(home: &Home, board: &Board, line: &str, after_s: f64) -> (Option<i32>, serde_json::Value, String) {
    let child = start(home, &format!("--json {line} {}", board.port));
    thread::sleep(Duration::from_secs_f64(after_s));
    home.succeeds(&format!("stop {}", board.port));
    let ended = child.wait_with_output().unwrap();
    let said = text(&ended.stdout);
    let first = said.lines().next().unwrap_or_default();
    (ended.status.code(), serde_json::from_str(first).unwrap_or_default(), said)
}

#[test]
fn a_program_that_starts_after_manual_control_is_followed_to_its_end() {
    let home = Home::new();
    let board = board(&home, 0.3);
    for line in ["play", "record six.darm -o run.csv"] {
        home.types(&format!("console {}", board.port), "coil 3 on 5000\n");
        let done = home.json(&format!("{line} {}", board.port));
        assert_eq!(done["end"], "finished", "{line}: {done}");
        assert_eq!(home.json(&format!("status {}", board.port))["phase"], "idle", "{line}");
    }
}

#[test]
fn an_upload_under_manual_control_or_beside_a_program_names_the_command_that_ends_it() {
    let home = Home::new();
    let board = board(&home, 5.0);
    let (port, refused) = (&board.port, "darm: the board refused: ");
    home.types(&format!("console {port}"), "coil 3 on 5000\n");
    let manual = format!("{refused}it is under manual control; `darm stop` ends it");
    home.fails(&format!("upload six.darm {port}"), 3, &manual);
    home.succeeds(&format!("stop {port}"));
    home.succeeds(&format!("upload six.darm {port}"));
    home.succeeds(&format!("play --detach {port}"));
    home.fails(&format!("upload six.darm {port}"), 3, &format!("{refused}a program runs; `darm stop` ends it"));
    home.succeeds(&format!("stop {port}"));
}

#[test]
fn a_program_that_another_one_stops_has_the_code_seven() {
    let home = Home::new();
    let board = board(&home, 1.0);
    let (code, played, said) = stopped(&home, &board, "play", 3.0);
    assert_eq!((code, &played["end"]), (Some(7), &"stopped".into()), "{said}");
    assert!(played["rows_played"].as_u64().unwrap() < 6 && said.contains("another program stopped the arm"), "{said}");
    let (code, recorded, said) = stopped(&home, &board, "record six.darm -o run.csv", 4.5);
    assert_eq!((code, &recorded["end"]), (Some(7), &"stopped".into()), "{said}");
    assert!(recorded["rows"].as_u64().unwrap() < 6, "{said}");
    // Before the first visit was measured.
    let (code, _, said) = stopped(&home, &board, "record six.darm -o none.csv", 0.7);
    assert_eq!(code, Some(7), "{said}");
}

#[test]
fn a_recording_that_is_resumed_after_its_program_has_the_code_seven() {
    let home = Home::new();
    let board = board(&home, 1.0);
    let mut child = start(&home, &format!("record six.darm -o run.csv {}", board.port));
    thread::sleep(Duration::from_millis(4500));
    child.kill().unwrap();
    child.wait().unwrap();
    home.succeeds(&format!("stop {}", board.port));
    let resumed = home.darm(&format!("record six.darm --resume -o run.csv {}", board.port));
    assert_eq!(resumed.status.code(), Some(7), "{}{}", text(&resumed.stdout), text(&resumed.stderr));
    assert!(
        text(&resumed.stderr).contains("the program ended before the recording was resumed"),
        "{}",
        text(&resumed.stderr)
    );
}
