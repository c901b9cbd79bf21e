//! A server with a board in this process, and a page that uses it.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use darm_arm::plan::{Visit, plan};
use darm_arm::table_file;
use darm_arm::wired_arm::WiredArm;
use darm_device::client::Client;
use darm_device::client::sharing::attach;
use darm_device::client::stop::{hold, stop_at};
use darm_device::link::LinkError;
use darm_serve::access::Token;
use darm_serve::board_port::BoardPort;
use darm_serve::history::History;
use darm_serve::measured::PoseSource;
use darm_serve::recording::{RecordFiles, RecordSetup};
use darm_serve::server::{Config, ServedArm, Server};
use darm_sim::in_process::{InProcess, MemoryFlash};
use darm_sim::plant::Plant;
use serde_json::{Value, json};

use super::http::{Answer, request};

/// Nothing that a test waits for takes longer, on a machine with other work.
const PATIENCE: Duration = Duration::from_secs(30);

/// Name of the folder with the recordings.
const DATA: &str = "data";

pub(crate) fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name)
}

/// A board with an arm, and its server.
pub(crate) struct Bench {
    pub(crate) board: InProcess,
    pub(crate) wired: WiredArm,
    server: Server,
    is_plugged: Arc<AtomicBool>,
    /// The cable takes no bytes: what the server has to send waits.
    pub(crate) is_held: Arc<AtomicBool>,
    /// Where other programs reach the board through the server.
    pub(crate) socket: PathBuf,
    folder: tempfile::TempDir,
}

impl Bench {
    /// Name of the served file: not the name inside it.
    pub(crate) const FILE: &str = "bench.toml";

    pub(crate) fn start(arm: &str) -> Self {
        Self::start_wired(WiredArm::read(&example(arm), None).unwrap(), None)
    }

    pub(crate) fn start_wired(wired: WiredArm, token: Option<&str>) -> Self {
        Self::start_with(wired, token, None)
    }

    pub(crate) fn start_with(wired: WiredArm, token: Option<&str>, poses: Option<PoseSource>) -> Self {
        let flash = MemoryFlash::with_profile(&wired.profile.image());
        let board = InProcess::boot(Plant::new(&wired.wiring, &[]), flash).unwrap();
        let is_plugged = Arc::new(AtomicBool::new(true));
        let (plug, plugged) = (board.clone(), Arc::clone(&is_plugged));
        let is_held = Arc::new(AtomicBool::new(false));
        let held = Arc::clone(&is_held);
        let folder = tempfile::tempdir().unwrap();
        let socket = folder.path().join("port");
        let shared = socket.clone();
        let open = move || match plugged.load(Ordering::SeqCst) {
            true => Ok(hold(
                Box::new(Cable { link: plug.link(), is_plugged: Arc::clone(&plugged), is_held: Arc::clone(&held) }),
                Some(&shared),
            )),
            false => Err(LinkError::Missing { port: "in-process".into() }),
        };
        let port = BoardPort { open: Box::new(open), stop: Box::new(|| stop_at("in-process", None)) };
        let server = Server::start(Config {
            listen: "127.0.0.1:0".parse().unwrap(),
            names: vec![],
            token: token.map(|token| Token::new(token).unwrap()),
            board: port,
            arm: Some(ServedArm { wired: wired.clone(), file: format!("arms/{}", Self::FILE) }),
            poses,
            history: Some(History::open(&folder.path().join("history.sqlite3")).unwrap()),
            record: Some(record_setup(&folder.path().join(DATA))),
        });
        Self { board, wired, server: server.unwrap(), is_plugged, is_held, socket, folder }
    }

    pub(crate) fn address(&self) -> SocketAddr {
        self.server.address()
    }

    /// The folder with the recordings.
    pub(crate) fn data(&self) -> PathBuf {
        self.folder.path().join(DATA)
    }

    /// Ends the server, as Ctrl-C does; the board.
    pub(crate) fn end(self) -> InProcess {
        drop(self.server);
        self.board
    }

    /// Pulls the cable, or plugs it in again.
    pub(crate) fn plug(&self, is_plugged: bool) {
        self.is_plugged.store(is_plugged, Ordering::SeqCst);
    }

    pub(crate) fn get(&self, path: &str) -> Value {
        request(self.address(), "GET", path, &[], b"").json()
    }

    /// Waits until the state of the board is as wanted.
    #[track_caller]
    pub(crate) fn live(&self, wanted: impl Fn(&Value) -> bool) -> Value {
        let since = Instant::now();
        loop {
            let live = self.get("/api/live");
            if wanted(&live) {
                return live;
            }
            assert!(since.elapsed() < PATIENCE, "{live:#}");
        }
    }

    pub(crate) fn phase(&self, name: &str) -> Value {
        self.live(|live| live["board"]["phase"]["name"] == name && live["link"]["state"] == "live")
    }

    /// The levels of the output lines, and the board's time.
    pub(crate) fn pins(&self) -> (u64, f64) {
        let lines = self.board.with_board(|bench| bench.plant().lines()).unwrap();
        (lines, self.board.now_s())
    }

    /// A table that goes to these words and rests `dwell_s` at each.
    pub(crate) fn table(&self, words: &[&str], dwell_s: f64) -> Vec<u8> {
        let servos_rad = vec![0.0; self.wired.arm.n_servos()];
        let visit = |word: &&str| Visit {
            word: word.parse().unwrap(),
            servos_rad: servos_rad.clone(),
            dwell_s,
            label: (*word).into(),
        };
        let visits: Vec<Visit> = words.iter().map(visit).collect();
        let plan = plan(&self.wired.arm, &visits, &self.wired.profile.board(None), &[]).unwrap();
        table_file::bytes(&plan.image)
    }

    pub(crate) fn open(&self, name: &str, bytes: &[u8]) -> Answer {
        request(self.address(), "POST", &format!("/api/open?name={name}"), &[], bytes)
    }

    pub(crate) fn post(&self, path: &str, headers: &[&str], body: &Value) -> Answer {
        let headers = [headers, &["Content-Type: application/json"]].concat();
        request(self.address(), "POST", path, &headers, body.to_string().as_bytes())
    }

    pub(crate) fn stop(&self) -> Answer {
        self.post("/api/stop", &[], &json!({}))
    }

    /// A page that has taken control, and sees the board.
    #[track_caller]
    pub(crate) fn page_in_control(&self) -> Page<'_> {
        self.live(|live| live["link"]["state"] == "live");
        let granted = self.post("/api/control", &[], &json!({"do": "take"}));
        assert_eq!(granted.status, 200, "{}", granted.json());
        Page::granted(self, &granted.json())
    }

    /// Another program at the board, through the server.
    #[track_caller]
    pub(crate) fn guest(&self, name: &str) -> Client {
        self.live(|live| live["link"]["state"] == "live");
        Client::connect(attach("in-process", &self.socket, name).unwrap().unwrap().0).unwrap()
    }
}

/// How long it takes until the command of a recording whose name begins with `slow` is known.
pub(crate) const SLOW_START: Duration = Duration::from_millis(500);

/// In place of `darm record`: copies the visit file and says that it has measured, unless its name begins with `lost`.
fn record_setup(folder: &Path) -> RecordSetup {
    std::fs::create_dir(folder).unwrap();
    let script = r#"case "$2" in */lost*) echo '{"error":{"exit":4,"message":"no camera found"}}'; exit 4;; esac
        cp "${1%.darm}.visits.csv" "$2" && echo '{"rows":3,"visits":3,"findings":[]}'"#;
    let command = move |files: &RecordFiles| {
        if files.output.file_name().is_some_and(|name| name.to_string_lossy().starts_with("slow")) {
            thread::sleep(SLOW_START);
        }
        let mut command = Command::new("sh");
        command.args(["-c", script, "record"]).args([&files.table, &files.output]);
        command
    };
    RecordSetup { folder: folder.to_owned(), command: Box::new(command) }
}

/// Lets the time of a board pass as that of the computer does, until it is dropped.
pub(crate) struct RealTime(Arc<AtomicBool>);

impl RealTime {
    pub(crate) fn start(board: &InProcess) -> Self {
        let has_ended = Arc::new(AtomicBool::new(false));
        let (board, ended) = (board.clone(), Arc::clone(&has_ended));
        thread::spawn(move || {
            let mut last = Instant::now();
            while !ended.load(Ordering::Relaxed) {
                thread::sleep(Duration::from_millis(5));
                board.pass(last.elapsed().as_secs_f64());
                last = Instant::now();
            }
        });
        Self(has_ended)
    }
}

impl Drop for RealTime {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// A page that has, or had, control. It renews with every order.
pub(crate) struct Page<'a> {
    bench: &'a Bench,
    pub(crate) number: u64,
    header: String,
}

impl<'a> Page<'a> {
    pub(crate) fn granted(bench: &'a Bench, granted: &Value) -> Self {
        let key = granted["key"].as_str().unwrap();
        Self { bench, number: granted["page"].as_u64().unwrap(), header: format!("x-darm-control: {key}") }
    }

    pub(crate) fn key(&self) -> &str {
        self.header.rsplit(' ').next().unwrap()
    }

    pub(crate) fn control(&self, what: &str) -> Answer {
        self.bench.post("/api/control", &[&self.header], &json!({ "do": what }))
    }

    /// The next page of the same tab.
    #[track_caller]
    pub(crate) fn resumed(&self) -> Self {
        let granted = self.control("resume");
        assert_eq!(granted.status, 200, "{}", granted.json());
        Self::granted(self.bench, &granted.json())
    }

    pub(crate) fn order(&self, path: &str, body: &Value) -> Answer {
        self.control("renew");
        self.bench.post(path, &[&self.header], body)
    }

    pub(crate) fn command(&self, body: &Value) -> Answer {
        self.order("/api/command", body)
    }

    /// Opens and uploads a table; its digest.
    #[track_caller]
    pub(crate) fn upload(&self, bytes: &[u8]) -> String {
        assert_eq!(self.bench.open("a.darm", bytes).status, 200);
        let digest = self.bench.get("/api/program")["digest"].as_str().unwrap().to_owned();
        let uploaded = self.order("/api/upload", &json!({ "table": digest }));
        assert_eq!(uploaded.status, 200, "{}", uploaded.json());
        digest
    }

    #[track_caller]
    pub(crate) fn play(&self, digest: &str) {
        let played = self.command(&json!({"do": "play", "table": digest}));
        assert_eq!(played.status, 200, "{}", played.json());
    }
}

/// A cable that can be pulled.
struct Cable {
    link: Box<dyn darm_device::link::Link>,
    is_plugged: Arc<AtomicBool>,
    is_held: Arc<AtomicBool>,
}

impl Cable {
    fn check(&self) -> Result<(), LinkError> {
        match self.is_plugged.load(Ordering::SeqCst) {
            true => Ok(()),
            false => Err(LinkError::Closed { port: "in-process".into() }),
        }
    }
}

impl darm_device::link::Link for Cable {
    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        while self.is_held.load(Ordering::SeqCst) {
            thread::sleep(Duration::from_millis(1));
        }
        self.check()?;
        self.link.send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, LinkError> {
        self.check()?;
        self.link.receive(buffer, timeout)
    }

    fn now_s(&self) -> f64 {
        self.link.now_s()
    }

    fn name(&self) -> &str {
        self.link.name()
    }
}
