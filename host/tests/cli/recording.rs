//! `darm record`: what is on the disk when something goes wrong on the way.

use std::process::{Child, Stdio};
use std::thread;
use std::time::Duration;

use super::{Board, Home, example, text};

/// A board that has a program of six visits of 1.5 s each.
fn board(home: &Home) -> Board {
    let arm = example("planar4.toml");
    let words = "000010000000 000001000000 000011000000 000000100000 000010100000 000001100000";
    home.succeeds(&format!("table {arm} --words {words} --dwell 1.5 -o six.darm"));
    let board = Board::start(home, &arm);
    home.succeeds(&format!("upload six.darm {}", board.port));
    board
}

fn recording(home: &Home, line: &str) -> Child {
    let mut command = home.command(&format!("record six.darm {line}"));
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

fn rows(home: &Home, file: &str) -> Vec<String> {
    let text = std::fs::read_to_string(home.path(file)).unwrap_or_default();
    text.lines().filter(|line| !line.starts_with('#')).skip(1).map(str::to_owned).collect()
}

/// Waits until the file has a row.
fn first_row(home: &Home, file: &str) {
    for _ in 0..400 {
        if !rows(home, file).is_empty() {
            return;
        }
        thread::sleep(Duration::from_millis(25));
    }
    panic!("no row within 10 s");
}

#[test]
fn an_output_that_cannot_be_written_is_refused_before_anything_moves() {
    let home = Home::new();
    let board = board(&home);
    let refused = home.darm(&format!("record six.darm -o missing/run.csv {}", board.port));
    assert_eq!(refused.status.code(), Some(1));
    let log = home.types(&format!("console {}", board.port), "log\nquit\n");
    assert!(!log.contains("started"), "{log}");
    assert!(text(&refused.stderr).starts_with("darm: cannot write missing/run.csv: "), "{}", text(&refused.stderr));
}

#[test]
fn rows_are_on_the_disk_when_the_recording_is_killed_and_a_second_one_goes_on() {
    let home = Home::new();
    let board = board(&home);
    let mut child = recording(&home, &format!("-o run.csv {}", board.port));
    first_row(&home, "run.csv");
    child.kill().unwrap();
    child.wait().unwrap();
    let before = rows(&home, "run.csv");
    let resumed = home.json(&format!("record six.darm --resume -o run.csv {}", board.port));
    let after = rows(&home, "run.csv");
    assert_eq!(after[..before.len()], before[..]);
    assert_eq!(resumed["end"], "finished");
    let visit = |row: &String| row.split(',').nth(9).unwrap().parse::<usize>().unwrap();
    let visits: Vec<usize> = after.iter().map(visit).collect();
    assert!(visits.is_sorted() && visits.last() == Some(&5), "{visits:?}");
    let lost = resumed["not_recovered"].as_array().unwrap().len();
    assert_eq!(visits.len() + lost, 6, "{visits:?} {resumed}");
}

#[test]
fn compressed_and_logged_recordings_are_readable_at_any_moment() {
    for file in ["run.csv.gz", "run.mcap"] {
        let home = Home::new();
        let board = board(&home);
        let mut child = recording(&home, &format!("-o {file} {}", board.port));
        thread::sleep(Duration::from_millis(6500));
        child.kill().unwrap();
        child.wait().unwrap();
        let arm = example("planar4.toml");
        let said = home.darm(&format!("diagnose {arm} {file}"));
        let told = text(&said.stderr);
        assert!(told.contains("words are not enough") || told.contains("the file ends early"), "{file}: {told}");
    }
}
