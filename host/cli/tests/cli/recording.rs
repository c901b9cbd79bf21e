//! `darm record`: what is on the disk when something goes wrong on the way.

use std::io::{BufRead as _, BufReader, Write as _};
use std::net::Shutdown;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::PathBuf;
use std::process::{Child, Stdio};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use darm_measure::mcap::Writer;
use serde_json::{Map, Value};

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

/// Every actuator that moves into state 1 closes its switch there, after a quarter of its 150 ms; one that leaves opens it at once.
pub(super) fn check_strokes(csv: &str) {
    let mut lines = csv.lines().filter(|line| !line.starts_with('#')).map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().unwrap();
    let column = |name: &str| header.iter().position(|column| *column == name).unwrap_or_else(|| panic!("{header:?}"));
    let mut count = 0;
    for row in lines.skip(1) {
        let [to, from] = ["word", "previous"].map(|name| row[column(name)].as_bytes());
        for actuator in (0..12).filter(|&actuator| to[actuator] != from[actuator]) {
            let stroke_us: u64 = row[column(&format!("stroke{actuator}_us"))].parse().unwrap();
            let true_us = if to[actuator] == b'1' { 37_500 } else { 0 };
            // The board in this process and its arm take turns, a millisecond each; a busy computer skips some.
            assert!((true_us..true_us + 20_000).contains(&stroke_us), "actuator {actuator}: {stroke_us} us in {row:?}");
            count += 1;
        }
    }
    assert!(count > 5, "{count} strokes in {csv}");
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
fn rows_are_on_the_disk_when_the_recording_is_killed_and_a_second_one_resumes() {
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
    let visit = |row: &String| row.rsplit(',').nth(1).unwrap().parse::<usize>().unwrap();
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
        let reported = text(&said.stderr);
        assert!(
            reported.contains("words are not enough") || reported.contains("the file ends early"),
            "{file}: {reported}"
        );
    }
}

/// The socket of the camera of a simulated board.
fn camera(board: &Board) -> String {
    board.port.trim_start_matches("--port unix:").replace("/port", "/camera")
}

/// Writes what a camera sends to an MCAP log, in chunks as they come, until the camera ends.
fn log_camera(socket: &str, file: PathBuf) {
    let camera = BufReader::new(UnixStream::connect(socket).unwrap());
    let mut writer = Writer::new(&[], "/tool", ("pose", "{}"));
    let mut log = std::fs::File::create(&file).unwrap();
    log.write_all(&writer.take()).unwrap();
    thread::spawn(move || {
        let mut lines = camera.lines().map_while(Result::ok);
        let header = lines.next().unwrap();
        for line in lines {
            let numbers = line.split(',').map(|cell| cell.parse::<f64>().ok().map_or(Value::Null, Value::from));
            let row: Map<String, Value> = header.split(',').map(str::to_owned).zip(numbers).collect();
            writer.message((1e9 * row["time_s"].as_f64().unwrap()) as u64, &Value::from(row).to_string());
            log.write_all(&writer.take()).unwrap();
        }
    });
}

#[test]
fn a_log_that_another_program_writes_meanwhile_is_the_camera() {
    let home = Home::new();
    let arm = example("planar4.toml");
    home.succeeds(&format!("table {arm} --words 000010000000 000001000000 000011000000 --dwell 0.4 -o three.darm"));
    let board = Board::start(&home, &arm);
    home.succeeds(&format!("upload three.darm {}", board.port));
    log_camera(&camera(&board), home.path("poses.mcap"));
    let recorded = home.json(&format!("record three.darm --camera poses.mcap -o run.csv {}", board.port));
    assert_eq!(recorded["end"], "finished", "{recorded}");
    let words: Vec<String> =
        rows(&home, "run.csv").iter().map(|row| row.split(',').nth(1).unwrap().to_owned()).collect();
    assert_eq!(words, ["000010000000", "000001000000", "000011000000"]);
}

/// A cable between a host and a board or its camera that can be pulled.
struct Cable {
    port: PathBuf,
    ends: Arc<Mutex<Vec<UnixStream>>>,
}

impl Cable {
    /// A port in this home behind which the board is.
    fn to(home: &Home, board: &Board) -> Self {
        Self::to_socket(home, board.port.trim_start_matches("--port unix:").to_owned())
    }

    /// The same to the camera of the board.
    fn to_camera(home: &Home, board: &Board) -> Self {
        Self::to_socket(home, camera(board))
    }

    fn to_socket(home: &Home, board: String) -> Self {
        let port = home.path("cable");
        let listener = UnixListener::bind(&port).unwrap();
        let ends = Arc::new(Mutex::new(Vec::new()));
        let kept = Arc::clone(&ends);
        thread::spawn(move || {
            for host in listener.incoming() {
                let (host, board) = (host.unwrap(), UnixStream::connect(&board).unwrap());
                let other = |end: &UnixStream| end.try_clone().unwrap();
                kept.lock().unwrap().extend([other(&host), other(&board)]);
                let (mut from_host, mut to_board) = (other(&host), other(&board));
                thread::spawn(move || std::io::copy(&mut from_host, &mut to_board));
                let (mut from_board, mut to_host) = (board, host);
                thread::spawn(move || std::io::copy(&mut from_board, &mut to_host));
            }
        });
        Self { port, ends }
    }

    /// Both ends see the connection closed; the next one is accepted.
    fn pull(&self) {
        for end in self.ends.lock().unwrap().drain(..) {
            let _ = end.shutdown(Shutdown::Both);
        }
    }
}

#[test]
fn a_recording_survives_an_unplugged_cable_and_reports_it() {
    let home = Home::new();
    let board = board(&home);
    let cable = Cable::to(&home, &board);
    let child = recording(&home, &format!("--json -o run.csv --port unix:{}", cable.port.display()));
    first_row(&home, "run.csv");
    cable.pull();
    let ended = child.wait_with_output().unwrap();
    assert!(ended.status.success(), "{}{}", text(&ended.stdout), text(&ended.stderr));
    let said: serde_json::Value = serde_json::from_slice(&ended.stdout).unwrap();
    let lost = said["lost_connections"].as_array().unwrap();
    assert!(!lost.is_empty() && lost[0]["reason"].is_string() && lost[0]["lasted_s"].is_f64(), "{said}");
    assert_eq!(said["end"], "finished");
    let missing = said["not_recovered"].as_array().unwrap().len();
    assert_eq!(rows(&home, "run.csv").len() + missing, 6, "{said}");
    assert!(missing < 3, "{said}");
}

#[test]
fn a_recording_whose_camera_ends_fails_and_names_the_visits() {
    let home = Home::new();
    let board = board(&home);
    let cable = Cable::to_camera(&home, &board);
    let child = recording(&home, &format!("--camera unix:{} -o run.csv {}", cable.port.display(), board.port));
    first_row(&home, "run.csv");
    cable.pull();
    let ended = child.wait_with_output().unwrap();
    let said = text(&ended.stderr);
    assert_eq!(ended.status.code(), Some(4), "{said}");
    assert!(said.contains("/cable ended or fell silent at visit ") && said.contains("are missing: start it"), "{said}");
    let [noted, _] = said.split("Ctrl-C stops the arm").collect::<Vec<_>>()[..] else { panic!("{said}") };
    assert!(noted.contains("ended or fell silent at visit "), "{said}");
    assert!(text(&ended.stdout).contains(" to 5"), "{}", text(&ended.stdout));
}

/// A look is measured again, and not diagnosed with the rows before the end.
#[test]
fn a_calibration_whose_camera_ends_stops_the_arm_and_keeps_no_look() {
    let home = Home::new();
    let (arm, frames) = (example("planar4.toml"), example("planar4-frames.toml"));
    let board = Board::start(&home, &arm);
    let cable = Cable::to_camera(&home, &board);
    let line =
        |poses: &str| format!("calibrate {arm} {frames} --dwell 0.1 --folder cal --poses {poses} {}", board.port);
    let camera = format!("unix:{}", cable.port.display());
    let mut command = home.command(&line(&camera));
    let child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    first_row(&home, "cal/measuring.csv");
    cable.pull();
    let ended = child.wait_with_output().unwrap();
    let said = text(&ended.stderr);
    assert_eq!(ended.status.code(), Some(4), "{said}");
    assert!(said.contains("the arm is stopped. Start it again"), "{said}");
    assert!(!home.path("cal/look-01.csv").exists());
    let status = home.json(&format!("status {}", board.port));
    assert_eq!(status["phase"], "idle", "{status}");
    // A source that ended before moves nothing.
    home.write("old.csv", "time_s,x_m,y_m,angle_deg\n1000000000,0,4,0\n");
    let said = text(&home.darm(&line("old.csv")).stderr);
    assert!(said.contains("the newest measurement of the camera old.csv has time_s "), "{said}");
}

#[test]
fn a_recording_names_the_table_and_the_profile_of_the_board() {
    let home = Home::new();
    let board = board(&home);
    let table = home.json("table --show six.darm");
    let mut child = recording(&home, &format!("-o run.csv {}", board.port));
    first_row(&home, "run.csv");
    child.kill().unwrap();
    child.wait().unwrap();
    let about = darm_measure::about(&home.path("run.csv")).unwrap();
    assert_eq!(
        [&about["table"], &about["profile"]].map(|value| value.as_str()),
        [table["digest"].as_str().unwrap(), table["profile"].as_str().unwrap()]
    );
    let status = home.json(&format!("status {}", board.port));
    assert_eq!((&status["table"], &status["profile"]), (&table["digest"], &table["profile"]));
    // The same program under the name of another table is not resumed.
    home.succeeds(&format!("table {} --words 000010000000 -o one.darm", example("planar4.toml")));
    home.succeeds(&format!("stop {}", board.port));
    home.succeeds(&format!("upload one.darm {}", board.port));
    let other = home.darm(&format!("record one.darm --resume -o run.csv {}", board.port));
    assert_eq!(other.status.code(), Some(1));
    assert!(text(&other.stderr).contains("run.csv: the recording was made with table "), "{}", text(&other.stderr));
}
