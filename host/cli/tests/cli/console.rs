//! The console as a script: what it prints, and its exit codes.

use std::io::Write as _;
use std::process::Stdio;

use super::{Board, Home, example, text};

#[test]
fn the_console_runs_the_commands_of_the_board() {
    let home = Home::new();
    let board = Board::start(&home, &example("planar4.toml"));
    let said = home.types(&format!("console {}", board.port), "id\nhelp\nhelp word\ndance\nquit\n");
    assert!(said.lines().all(|line| line.chars().count() <= 80), "{said}");
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

#[test]
fn a_script_of_the_console_has_an_exit_code() {
    let home = Home::new();
    let board = Board::start(&home, &example("planar4.toml"));
    for (lines, code, said) in [
        ("id\nhelp coil\n", 0, "coil N on MS | N off"),
        ("dance\nid\n", 3, "board "),
        ("upload missing.darm\nid\n", 1, "board "),
        ("help dance\nid\n", 2, "board "),
    ] {
        let mut script = home.command(&format!("console {}", board.port));
        let mut child = script.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        child.stdin.take().unwrap().write_all(lines.as_bytes()).unwrap();
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(code), "{lines}");
        assert!(text(&output.stdout).contains(said), "{lines}: {}", text(&output.stdout));
    }
}
