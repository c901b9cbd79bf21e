//! The stop: first on the wire, through whatever process holds the port, within a second.

use std::fs::File;
use std::io::{Read as _, Write as _};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::process::{Child, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use darm_core::wire::frame::{self, MAX_FRAME};
use rustix::process::{Pid, Signal, kill_process};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

use super::{Board, Home, example, text};

/// The promise is 1 s; the rest is for a computer that is busy with other tests.
const BOUND: Duration = Duration::from_millis(2500);

/// Tags and connections of the frames in these bytes.
fn frames(bytes: &[u8]) -> Vec<(u8, u32)> {
    let parts = bytes.split(|&byte| byte == 0).filter(|part| !part.is_empty());
    parts
        .filter_map(|part| frame::decode(&mut part.to_vec()).ok().map(|(header, _)| (header.tag, header.link)))
        .collect()
}

/// All bytes that come until nobody sends any more.
fn everything(mut from: impl std::io::Read) -> Vec<u8> {
    let (mut all, mut bytes) = (Vec::new(), [0; 256]);
    while let Ok(count @ 1..) = from.read(&mut bytes) {
        all.extend(&bytes[..count]);
    }
    all
}

fn timed(home: &Home, line: &str) -> (Output, Duration) {
    let start = Instant::now();
    (home.darm(line), start.elapsed())
}

/// A program of one visit after the other, long enough to be interrupted, on a board of its own.
fn long_program(home: &Home) -> Board {
    let arm = example("planar4.toml");
    home.succeeds(&format!("table {arm} --words 000010000000 000001000000 --dwell 20 -o long.darm"));
    let board = Board::start(home, &arm);
    home.succeeds(&format!("upload long.darm {}", board.port));
    board
}

/// A command that runs in the background, once it holds the board and the program runs.
fn playing(home: &Home, line: &str) -> Child {
    let mut command = home.command(line);
    let child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    thread::sleep(Duration::from_millis(1500));
    child
}

pub(crate) fn interrupt(child: &Child) {
    kill_process(Pid::from_child(child), Signal::INT).unwrap();
}

/// A pseudo terminal: the end of the board, and the name of the port.
fn terminal() -> (File, String) {
    let board = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&board).unwrap();
    unlockpt(&board).unwrap();
    let name = ptsname(&board, Vec::new()).unwrap().into_string().unwrap();
    (File::from(board), name)
}

#[test]
fn the_stop_frame_leaves_before_any_handshake_and_silence_ends_within_a_second() {
    let home = Home::new();
    let listener = UnixListener::bind(home.path("board")).unwrap();
    let heard = thread::spawn(move || everything(listener.accept().unwrap().0));
    let (stopped, took) = timed(&home, &format!("stop --port unix:{}", home.path("board").display()));
    assert_eq!(frames(&heard.join().unwrap()).first(), Some(&(3, 0)));
    assert!(took < BOUND, "{took:?}");
    assert_eq!(stopped.status.code(), Some(5), "{}", text(&stopped.stderr));
    assert!(text(&stopped.stderr).contains("did not confirm"), "{}", text(&stopped.stderr));
}

/// Bytes for a socket that serves another connection wait in the backlog, so "sent" would be untrue.
#[test]
fn a_stop_at_a_socket_that_another_program_holds_does_not_claim_to_be_sent() {
    let home = Home::new();
    let listener = UnixListener::bind(home.path("board")).unwrap();
    let _holder = UnixStream::connect(home.path("board")).unwrap();
    let _served = listener.accept().unwrap();
    let (stopped, took) = timed(&home, &format!("stop --port unix:{}", home.path("board").display()));
    assert!(took < BOUND, "{took:?}");
    let said = text(&stopped.stderr);
    assert_eq!(stopped.status.code(), Some(5), "{said}");
    assert!(
        !said.contains("was sent") && said.contains("a program other than `darm` that holds it blocks the stop"),
        "{said}"
    );
}

#[test]
fn a_stop_reaches_a_board_whose_port_another_command_holds() {
    let home = Home::new();
    let board = long_program(&home);
    let play = playing(&home, &format!("--json play {}", board.port));
    let (stopped, took) = timed(&home, &format!("stop {}", board.port));
    assert_eq!(stopped.status.code(), Some(0), "{}", text(&stopped.stderr));
    assert!(took < BOUND, "{took:?}");
    let played = play.wait_with_output().unwrap();
    assert!(text(&played.stdout).contains("\"end\":\"stopped\""), "{}", text(&played.stdout));
}

/// Ctrl-Z, or SIGSTOP: the board's socket serves this process alone.
#[test]
fn a_stop_reaches_a_board_whose_socket_a_suspended_command_holds() {
    let home = Home::new();
    let board = long_program(&home);
    let play = playing(&home, &format!("--json play {}", board.port));
    kill_process(Pid::from_child(&play), Signal::STOP).unwrap();
    let (stopped, took) = timed(&home, &format!("stop {}", board.port));
    assert_eq!(stopped.status.code(), Some(0), "{}", text(&stopped.stderr));
    assert!(took < BOUND, "{took:?}");
    // It was continued, and sees that its program has ended.
    let played = play.wait_with_output().unwrap();
    assert!(text(&played.stdout).contains("\"end\":\"stopped\""), "{}", text(&played.stdout));
}

#[test]
fn a_stop_through_a_port_that_another_program_reads_is_sent_and_reported_as_unconfirmed() {
    let home = Home::new();
    let (mut board, port) = terminal();
    let thief =
        rustix::fs::open(&*port, rustix::fs::OFlags::RDWR | rustix::fs::OFlags::NOCTTY, rustix::fs::Mode::empty());
    let mut thief = File::from(thief.unwrap());
    thread::spawn(move || everything(&mut thief));
    let (stopped, took) = timed(&home, &format!("stop --port {port}"));
    let mut bytes = [0; MAX_FRAME];
    let count = board.read(&mut bytes).unwrap();
    assert_eq!(frames(&bytes[..count]).first(), Some(&(3, 0)));
    assert_eq!(stopped.status.code(), Some(5), "{}", text(&stopped.stderr));
    assert!(took < BOUND, "{took:?}");
}

#[test]
fn a_stop_through_a_port_that_accepts_no_bytes_ends_within_a_second() {
    let home = Home::new();
    let (_board, port) = terminal();
    let flags = rustix::fs::OFlags::RDWR | rustix::fs::OFlags::NOCTTY | rustix::fs::OFlags::NONBLOCK;
    let mut other = File::from(rustix::fs::open(&*port, flags, rustix::fs::Mode::empty()).unwrap());
    let mut settings = tcgetattr(&other).unwrap();
    settings.make_raw();
    tcsetattr(&other, OptionalActions::Now, &settings).unwrap();
    // The system moves bytes on behind the writer's back until all buffers are full.
    let mut quiet = 0;
    while quiet < 20 {
        let bulk = std::iter::from_fn(|| other.write(&[b'x'; 4096]).ok()).count();
        let single = std::iter::from_fn(|| other.write(b"x").ok()).count();
        quiet = if bulk + single == 0 { quiet + 1 } else { 0 };
        thread::sleep(Duration::from_millis(10));
    }
    let (stopped, took) = timed(&home, &format!("stop --port {port}"));
    assert_eq!(stopped.status.code(), Some(4), "{}", text(&stopped.stderr));
    assert!(took < BOUND, "{took:?}");
}

#[test]
fn ctrl_c_stops_the_arm_and_reports_it() {
    let home = Home::new();
    let board = long_program(&home);
    for line in ["play", "record long.darm -o run.csv --camera camera.csv"] {
        home.write("camera.csv", "time_s,x_m,y_m,angle_deg\n");
        let child = playing(&home, &format!("{line} {}", board.port));
        interrupt(&child);
        let ended = child.wait_with_output().unwrap();
        assert_eq!(ended.status.code(), Some(6), "{line}: {}", text(&ended.stderr));
        assert!(text(&ended.stderr).contains("the board confirmed that all coils are off"), "{}", text(&ended.stderr));
        assert_eq!(home.json(&format!("status {}", board.port))["phase"], "idle", "{line}");
    }
    assert_eq!(home.json(&format!("play --detach {}", board.port))["end"], "started");
    assert_eq!(home.json(&format!("status {}", board.port))["phase"], "playing");
}

#[test]
fn ctrl_c_in_a_calibration_reports_that_the_command_continues() {
    let home = Home::new();
    let [arm, frames] = ["planar4.toml", "planar4-frames.toml"].map(example);
    let board = Board::start(&home, &arm);
    let child = playing(&home, &format!("calibrate {arm} {frames} --poses sim {}", board.port));
    let measuring = home.path("calibration/measuring.csv");
    for _ in 0..400 {
        if measuring.exists() {
            break;
        }
        thread::sleep(Duration::from_millis(25));
    }
    interrupt(&child);
    let ended = child.wait_with_output().unwrap();
    let said = text(&ended.stderr);
    assert_eq!(ended.status.code(), Some(6), "{said}");
    let expected = "darm: interrupted; the board confirmed that all coils are off; repeat the command to continue\n";
    assert!(said.ends_with(expected), "{said}");
}

#[test]
fn a_program_that_a_killed_command_leaves_is_ended_by_a_stop() {
    let home = Home::new();
    let board = long_program(&home);
    let mut killed = playing(&home, &format!("play {}", board.port));
    killed.kill().unwrap();
    killed.wait().unwrap();
    home.fails(&format!("play {}", board.port), 3, "darm: the board refused: a program runs; `darm stop` ends it");
    home.succeeds(&format!("stop {}", board.port));
    assert_eq!(home.json(&format!("play --detach {}", board.port))["end"], "started");
}

#[test]
fn a_second_command_reads_beside_the_first_and_does_not_wait_to_move_the_arm() {
    let home = Home::new();
    let board = long_program(&home);
    let first = playing(&home, &format!("play {}", board.port));
    for line in ["play", "upload long.darm", "record long.darm -o run.csv"] {
        let (refused, took) = timed(&home, &format!("{line} {}", board.port));
        let said = text(&refused.stderr);
        assert_eq!(refused.status.code(), Some(3), "{line}: {said}");
        let named = format!(
            "nothing was sent: `darm play {}` (process {}) controls the arm; end it first",
            board.port,
            first.id()
        );
        assert!(said.contains(&named), "{said}");
        assert!(took < 2 * BOUND, "{line}: {took:?}");
        assert_eq!(home.json(&format!("status {}", board.port))["phase"], "playing", "{line} has not stopped it");
    }
    home.succeeds(&format!("doctor {}", board.port));
    home.succeeds(&format!("stop {}", board.port));
    first.wait_with_output().unwrap();
    assert_eq!(home.json(&format!("status {}", board.port))["phase"], "idle");
}

/// A process that does not answer holds the port, as far as can be seen: the frame goes to the port itself.
#[test]
fn a_process_that_hangs_and_holds_the_port_does_not_block_the_stop() {
    let home = Home::new();
    let board = Board::start(&home, &example("planar4.toml"));
    let holders = home.path(".local/state/darm/ports");
    let status = home.command(&format!("console {}", board.port)).stdin(Stdio::piped()).stdout(Stdio::null()).spawn();
    let mut console = status.unwrap();
    let mut sockets = Vec::new();
    for _ in 0..200 {
        sockets = std::fs::read_dir(&holders).into_iter().flatten().map(|entry| entry.unwrap().path()).collect();
        if !sockets.is_empty() {
            break;
        }
        thread::sleep(Duration::from_millis(20));
    }
    let [socket] = &sockets[..] else { panic!("{sockets:?}") };
    drop(console.stdin.take());
    console.wait().unwrap();
    let _silent = silent(socket);
    let (stopped, took) = timed(&home, &format!("stop {}", board.port));
    assert_eq!(stopped.status.code(), Some(0), "{}", text(&stopped.stderr));
    assert!(took < BOUND, "{took:?}");
}

/// Listens and never answers.
fn silent(socket: &Path) -> UnixListener {
    assert!(UnixStream::connect(socket).is_err(), "the console has ended and nobody listens");
    let _ = std::fs::remove_file(socket);
    UnixListener::bind(socket).unwrap()
}
