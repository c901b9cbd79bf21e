//! Commands beside another that has the port.

use std::io::Write as _;
use std::process::{Child, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use super::{Board, Home, example, text};

/// A command that runs until it is killed.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn running(home: &Home, line: &str) -> Running {
    Running(home.command(line).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap())
}

/// What a script of the console prints, and its exit code.
fn typed(home: &Home, board: &Board, lines: &str) -> (String, Option<i32>) {
    let mut console = home.command(&format!("console {}", board.port));
    let mut child = console.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(lines.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    (text(&output.stdout), output.status.code())
}

fn until(wanted: impl Fn() -> bool) {
    let since = Instant::now();
    while !wanted() {
        assert!(since.elapsed() < Duration::from_secs(30));
        thread::sleep(Duration::from_millis(50));
    }
}

/// Whether a process has the port and shares it.
fn is_shared(home: &Home) -> bool {
    let sockets = std::fs::read_dir(home.path(".local/state/darm/ports")).into_iter().flatten();
    sockets.filter_map(Result::ok).any(|socket| darm_device::client::sharing::is_shared(&socket.path()))
}

#[test]
fn a_command_that_reads_leaves_control_to_the_first_that_wants_it() {
    let home = Home::new();
    let board = Board::start(&home, &example("planar4.toml"));
    let visits = format!("{} {}", example("planar4.toml"), example("planar4-frames.toml"));
    home.succeeds(&format!("table {visits} -o visits.darm"));
    let _watching = running(&home, &format!("status --watch 0.1 {}", board.port));
    until(|| is_shared(&home));
    home.succeeds(&format!("upload visits.darm {}", board.port));
    assert_eq!(typed(&home, &board, "word 000010000000\n"), ("ok\n".to_owned(), Some(0)));
    home.succeeds(&format!("stop {}", board.port));
    // The command that watches has seen its connection end, and goes on.
    until(|| is_shared(&home) && home.json(&format!("status {}", board.port))["phase"] == "idle");
    let played = home.json(&format!("play --detach {}", board.port));
    assert_eq!(played["end"], "started", "{played}");
    home.succeeds(&format!("stop {}", board.port));
}

#[test]
fn commands_use_the_port_of_a_live_page() {
    let home = Home::new();
    let board = Board::start(&home, &example("planar4.toml"));
    let arm = example("planar4.toml");
    let _serving = running(&home, &format!("serve {arm} --listen 127.0.0.1:0 {}", board.port));
    until(|| is_shared(&home));
    let frames = example("planar4-frames.toml");
    home.succeeds(&format!("table {arm} {frames} -o visits.darm"));
    home.succeeds(&format!("upload visits.darm {}", board.port));
    let (said, code) = typed(&home, &board, "status\nword 000010000000\nwrd 1\n");
    assert!(said.contains("idle") && said.contains("ok\n") && code == Some(3), "{said} {code:?}");
    // The page's server stops what the console has switched by hand and left.
    until(|| home.json(&format!("status {}", board.port))["phase"] == "idle");
    home.succeeds(&format!("record visits.darm -o run.csv {}", board.port));
    home.succeeds(&format!("doctor {}", board.port));
}

/// A script of the console has the port for itself: its lines and their answers are text, which belongs to nobody.
#[test]
fn a_port_that_is_not_shared_is_named_with_its_user() {
    let home = Home::new();
    let board = Board::start(&home, &example("planar4.toml"));
    let mut script = home.command(&format!("console {}", board.port));
    let script = script.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let script = Running(script);
    until(|| std::fs::read_dir(home.path(".local/state/darm/ports")).is_ok_and(|all| all.count() > 0));
    let said = format!("is in use by `darm console {}` (process {}); end it first", board.port, script.0.id());
    let refused = home.command(&format!("status {}", board.port)).output().unwrap();
    assert_eq!(refused.status.code(), Some(4));
    assert!(text(&refused.stderr).contains(&said), "{}", text(&refused.stderr));
    let doctor = home.json(&format!("doctor {}", board.port));
    let check = doctor["checks"].as_array().unwrap().iter().find(|check| check["name"] == "board").unwrap().clone();
    assert_eq!(check["state"], "in-use", "{check}");
}
