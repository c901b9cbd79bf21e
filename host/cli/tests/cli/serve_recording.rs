//! A page of `darm serve` records with `darm record`.

use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::serve_kills::Serving;
use super::{Board, Home, example};

const ARM: &str = "planar4.toml";

/// A server whose page has uploaded a table of these many visits and begun to record it as `run`; the measurement.
fn recording(home: &Home, board: &Board, visits: usize) -> (Serving, PathBuf) {
    let folder = home.path("runs");
    let options = format!("--poses sim --data {} {}", folder.display(), board.port);
    let server = Serving::start(home, &options, ARM, &home.path("history.sqlite3"));
    server.wait(|live| live["link"]["state"] == "live");
    let visit = |k: usize| json!({"word": format!("{:012b}", 0b1_0000_0001 << (k % 4)), "dwell_s": 0.5});
    let visits: Vec<Value> = (0..visits).map(visit).collect();
    let ask = |path: &str, key: &str, body: &Value| {
        let answer = server.ask("POST", path, key, body.to_string().as_bytes()).unwrap();
        assert!(answer["refused"].is_null(), "{path}: {answer}");
        answer
    };
    let made = ask("/api/plan", "", &json!({"of": "visits", "visits": visits, "may_rest": false}));
    let key = server.take_control();
    ask("/api/upload", &key, &json!({"table": made["digest"]}));
    ask("/api/record", &key, &json!({"table": made["digest"], "name": "run"}));
    (server, folder.join("run.csv"))
}

/// Rows of visits in a measurement; 0 before it is there.
fn rows(file: &Path) -> usize {
    let text = std::fs::read_to_string(file).unwrap_or_default();
    text.lines().filter(|line| !line.starts_with('#')).count().saturating_sub(1)
}

#[test]
fn a_page_records_into_the_folder_of_its_server() {
    let home = Home::new();
    let board = Board::start(&home, &example(ARM));
    let (server, file) = recording(&home, &board, 3);
    // Another command reads meanwhile.
    home.succeeds(&format!("status {}", board.port));
    let live = server.wait(|live| live["recordings"]["last"]["is_running"] == false);
    let last = &live["recordings"]["last"];
    let said = last["text"].as_str().unwrap();
    assert!(
        last["is_complete"] == true && said.starts_with(&format!("{} of 3 visits measured", rows(&file))),
        "{last}"
    );
    assert_eq!(server.ask("GET", "/api/data", "", b"").unwrap()[0]["name"], "run.csv");
}

#[test]
fn a_recording_outlives_its_server_with_every_row() {
    let home = Home::new();
    let board = Board::start(&home, &example(ARM));
    let (mut server, file) = recording(&home, &board, 8);
    let since = Instant::now();
    while rows(&file) == 0 {
        assert!(since.elapsed() < Duration::from_secs(60), "no visit was measured");
        thread::sleep(Duration::from_millis(20));
    }
    server.kill();
    let before = std::fs::read_to_string(&file).unwrap();
    // It has the port itself then, and shares it until it ends.
    while home.json(&format!("status {}", board.port))["phase"] != "idle" {
        assert!(since.elapsed() < Duration::from_secs(120), "the program did not end");
        thread::sleep(Duration::from_millis(100));
    }
    let is_complete = || std::fs::read_to_string(&file).unwrap().trim_end().lines().last().unwrap().starts_with('#');
    while !is_complete() {
        assert!(since.elapsed() < Duration::from_secs(120), "the recording did not end");
        thread::sleep(Duration::from_millis(100));
    }
    let after = std::fs::read_to_string(&file).unwrap();
    let all: Vec<&str> = before.lines().filter(|line| !line.starts_with('#')).collect();
    assert!(all.iter().all(|row| after.contains(row)) && rows(&file) >= all.len() - 1, "{before}\n{after}");
}
