//! `darm serve` killed at any moment while tables are played: the history opens, and every run that ended is in it, once.
//!
//! The board and its simulator live on, as hardware does. `DARM_SERVE_KILLS` sets how often, `DARM_SEED` the moments.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use darm_serve::history::{History, Kind};
use rand::{RngExt as _, SeedableRng as _};
use serde_json::{Value, json};

use super::{Board, Home, example};

/// Kills of one test; the evaluation has many more.
const KILLS: u64 = 4;
/// A server is killed at the latest so long after it began to play.
const LONGEST: Duration = Duration::from_millis(700);
/// Nothing that is waited for takes longer, on a machine with other work.
const PATIENCE: Duration = Duration::from_secs(30);

/// A running `darm serve`. It is killed when it is dropped.
pub(super) struct Serving {
    pub(super) process: Child,
    address: String,
}

impl Serving {
    pub(super) fn start(home: &Home, port: &str, arm: &str, history: &Path) -> Self {
        let line = format!("serve {} --listen 127.0.0.1:0 {port}", example(arm));
        let mut command: Command = home.command(&line);
        command.arg("--history").arg(history).stdin(Stdio::null()).stdout(Stdio::piped());
        let mut process = command.spawn().unwrap();
        let lines = BufReader::new(process.stdout.take().unwrap()).lines();
        let url = lines.map_while(Result::ok).find_map(|line| Some(line.split_once("http://")?.1.to_owned()));
        let address = url.expect("`darm serve` prints its address").trim_end_matches('/').to_owned();
        Self { process, address }
    }

    /// The answer to a request; `None` where none came.
    pub(super) fn ask(&self, method: &str, path: &str, headers: &str, body: &[u8]) -> Option<Value> {
        let mut stream = TcpStream::connect(&self.address).ok()?;
        stream.set_read_timeout(Some(PATIENCE)).ok()?;
        let (host, length) = (&self.address, body.len());
        let head = format!(
            "{method} {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\nContent-Type: application/json\r\nContent-Length: {length}\r\n{headers}\r\n"
        );
        stream.write_all(&[head.as_bytes(), body].concat()).ok()?;
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).ok()?;
        let start = answer.windows(4).position(|window| window == b"\r\n\r\n")? + 4;
        serde_json::from_slice(&answer[start..]).ok()
    }

    #[track_caller]
    pub(super) fn wait(&self, wanted: impl Fn(&Value) -> bool) -> Value {
        let since = Instant::now();
        loop {
            let live = self.ask("GET", "/api/live", "", b"").unwrap_or_default();
            if wanted(&live) {
                return live;
            }
            assert!(since.elapsed() < PATIENCE, "{live:#}");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Takes control; the header that shows it.
    pub(super) fn take_control(&self) -> String {
        let granted = self.ask("POST", "/api/control", "", br#"{"do":"take"}"#).unwrap();
        format!("x-darm-control: {}\r\n", granted["key"].as_str().unwrap())
    }

    pub(super) fn kill(&mut self) {
        // SIGKILL: nothing is tidied up.
        self.process.kill().unwrap();
        self.process.wait().unwrap();
    }
}

impl Drop for Serving {
    fn drop(&mut self) {
        // After a failed test it still runs.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Plays again and again until the time is over: how many plays the board took, and the events that a page has seen.
fn play_for(server: &Serving, table: &str, time: Duration) -> (u64, Vec<Value>) {
    let (began, key) = (Instant::now(), server.take_control());
    let play = json!({"do": "play", "table": table}).to_string();
    let (mut played, mut seen) = (0, Vec::new());
    while began.elapsed() < time {
        // The board refuses while it plays.
        let answer = server.ask("POST", "/api/command", &key, play.as_bytes());
        played += u64::from(answer == Some(Value::Null));
        let live = server.ask("GET", "/api/live", "", b"").unwrap_or_default();
        seen = live["events"].as_array().cloned().unwrap_or(seen);
    }
    (played, seen)
}

/// Ends of runs among the events of a page.
fn ends(seen: &[Value]) -> usize {
    let is_played = |event: &&Value| event["kind"] == "finished";
    seen.iter().filter(is_played).count()
}

/// Runs in the history that ended, by the number of the event that began them.
fn ended_runs(history: &Path) -> Vec<Value> {
    let runs = History::open(history).unwrap().entries(Kind::Runs, None).unwrap();
    runs.into_iter().filter(|run| run["outcome"] == "finished").collect()
}

#[test]
fn a_killed_server_has_lost_no_run_that_ended() {
    let number = |name: &str| std::env::var(name).ok().and_then(|text| text.parse::<u64>().ok());
    let kills = number("DARM_SERVE_KILLS").unwrap_or(KILLS);
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(number("DARM_SEED").unwrap_or(0));
    let home = Home::new();
    let board = Board::start(&home, &example("planar4.toml"));
    let history = home.path("history.sqlite3");
    home.succeeds(&format!(
        "table {} --words 000010000000 101000000000 --dwell 0.02 -o a.darm",
        example("planar4.toml")
    ));
    home.succeeds(&format!("upload a.darm {}", board.port));
    let (mut played, mut shown, mut cut) = (0, 0, 0);
    for _ in 0..kills {
        let mut server = Serving::start(&home, &board.port, "planar4.toml", &history);
        let live = server.wait(|live| live["link"]["state"] == "live");
        let table = live["board"]["table"].as_str().unwrap().to_owned();
        let time = random.random_range(Duration::ZERO..LONGEST);
        let (taken, seen) = play_for(&server, &table, time);
        server.kill();
        played += taken;
        let ended = ended_runs(&history);
        // All that the page has seen to end is there. What the board did before the connection is among its events too.
        assert!(ended.len() >= ends(&seen), "{} of {}: {seen:#?}", ended.len(), ends(&seen));
        shown += ends(&seen);
        cut += u64::from(seen.last().is_some_and(|event| event["kind"] != "finished"));
    }
    // The board has gone on alone: the next server reads how the last run ended.
    let mut server = Serving::start(&home, &board.port, "planar4.toml", &history);
    server.wait(|live| live["board"]["phase"]["name"] == "idle" && live["link"]["state"] == "live");
    std::thread::sleep(Duration::from_millis(200));
    server.kill();
    let ended = ended_runs(&history);
    assert_eq!(ended.len() as u64, played, "each play that the board took ended once");
    assert!(shown > 0 || kills < 3, "no kill came after an end");
    println!("FIGURE serve: kills = {kills} kills");
    println!("FIGURE serve: kills amid a run = {cut} kills");
    println!("FIGURE serve: runs that ended = {played} runs");
    println!("FIGURE serve: ended runs that are missing = {} runs", played - ended.len() as u64);
}
