//! `darm serve`: the live page of a board and its arm, until Ctrl-C.

mod poses;

use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4, TcpListener};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use anyhow::Context as _;
use darm_arm::wired_arm::WiredArm;
use darm_device::link::LinkError;
use darm_robot::source::{ModelKind, Source};
use darm_serve::access::Token;
use darm_serve::board_port::BoardPort;
use darm_serve::history::History;
use darm_serve::recording::{RecordFiles, RecordSetup};
use darm_serve::server::{Config, ServedArm, Server};
use serde::Serialize;

use crate::failure::Usage;
use crate::port::{self, PortArgs};
use crate::state_folder;
use crate::ui::{Answer, Ui};

const EXAMPLES: &str = "\
Examples:
  darm serve arm.toml                          # the only board there is, with this arm on it
  darm serve arm.toml --poses sim              # with the poses that the simulated camera sees
  darm serve arm.toml --poses sim --data runs  # pages record into the folder runs
  darm serve arm.toml --listen 127.0.0.1:0     # at a free port
  darm serve                                   # without a picture

Open the printed address in a browser. Ctrl-C ends the server and stops what a page has switched by hand; a program on the board \
continues, `darm stop` stops it. Stop and the space bar stop the arm on every page; a page moves the arm only after \
\"Take control\", one page at a time.

Only this computer can open the pages. --listen 0.0.0.0:8420 opens them to the network, over plain HTTP, and needs a \
token: a secret of at least 16 letters and digits in DARM_TOKEN. A tunnel (ssh -L 8420:127.0.0.1:8420) is safer.";

/// Default address.
const LISTEN: SocketAddr = SocketAddr::V4(SocketAddrV4::new(Ipv4Addr::LOCALHOST, 8420));
/// Interval between two checks that the server still runs.
const POLL: Duration = Duration::from_millis(200);

/// Serve a live page of the board and its arm
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Serve {
    /// Arm on the board; default: outputs without a picture
    #[arg(value_name = "ARM.toml")]
    arm: Option<PathBuf>,
    /// Profile of the board; default: the one that the arm names
    #[arg(long, value_name = "PROFILE.toml", requires = "arm")]
    profile: Option<PathBuf>,
    /// Source of measured poses, shown with their residual: sim, tcp:HOST:PORT, unix:PATH, a CSV file or an MCAP log that is
    /// being written
    #[arg(long, value_name = "SOURCE", requires = "arm")]
    poses: Option<String>,
    /// Address to listen on; one that is not loopback needs a token; default: 127.0.0.1:8420, or a free port where that is
    /// taken
    #[arg(long, value_name = "ADDRESS:PORT")]
    listen: Option<SocketAddr>,
    /// Name of this computer in the address of the pages; can be given several times
    #[arg(long, value_name = "NAME")]
    name: Vec<String>,
    /// Secret that pages must know
    #[arg(long, value_name = "TOKEN", env = "DARM_TOKEN", hide_env_values = true)]
    token: Option<String>,
    /// Database of runs, diagnoses, models and tables, or none; default: history.sqlite3 in the state folder
    #[arg(long, value_name = "FILE|none")]
    history: Option<PathBuf>,
    /// Folder into which pages record measurements, and the only one in which they write files; it is made if it is not there
    #[arg(long, value_name = "FOLDER", requires = "arm")]
    data: Option<PathBuf>,
    #[command(flatten)]
    port: PortArgs,
}

/// The running server.
#[derive(Serialize)]
struct Serving {
    port: String,
    arm: Option<ServedFile>,
    history: Option<PathBuf>,
    url: String,
}

/// The file of the arm.
#[derive(Serialize)]
struct ServedFile {
    file: String,
    number: u32,
    digest: String,
}

impl ServedFile {
    fn of(ServedArm { wired, file }: &ServedArm) -> Self {
        Self { file: file.clone(), number: wired.arm.model.number, digest: wired.arm.hash().to_string() }
    }

    fn text(&self) -> String {
        format!("{}, model {}, {}", self.file, self.number, self.digest)
    }
}

impl Answer for Serving {
    fn text(&self) -> String {
        let arm = self.arm.as_ref().map_or_else(|| "none given: no picture".to_owned(), ServedFile::text);
        let history = self.history.as_ref().map_or("none".to_owned(), |path| path.display().to_string());
        format!(
            "port     {}\narm      {arm}\nhistory  {history}\npage     {}\n\nCtrl-C ends the server",
            self.port, self.url
        )
    }
}

/// The named port, or the only one that is there whenever the board is reached.
fn board_port(port: &PortArgs) -> BoardPort {
    let (to_open, to_stop) = (port.clone(), port.clone());
    let name = |port: &PortArgs| port.name().map_err(|error| LinkError::Unnamed(error.to_string()));
    BoardPort {
        open: Box::new(move || port::open_at_once(&name(&to_open)?)),
        stop: Box::new(move || port::stop(&name(&to_stop)?)),
    }
}

impl Serve {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let arm = self.arm.as_deref().map(|arm| self.read(arm)).transpose()?;
        let name = self.port.name_or_none()?;
        let token = self.token.as_deref().filter(|token| !token.is_empty()).map(Token::new).transpose();
        let token = token.map_err(|error| Usage(error.to_string()))?;
        let served = arm.as_ref().map(ServedFile::of);
        let board = board_port(&self.port);
        let history = self.history_file().map(|path| History::open(&path)).transpose()?;
        let history_file = history.as_ref().map(|history| history.path().to_owned());
        let (listen, names) = (self.listen(), self.name.clone());
        let poses = self.poses.as_deref().map(poses::source);
        let record = self.data.as_deref().map(|folder| self.record_setup(folder)).transpose()?;
        let server = Server::start(Config { listen, names, token, board, arm, poses, history, record })?;
        let (interrupted, interrupt) = channel();
        let handler = move || {
            // The receiver is gone once the server has ended.
            let _ = interrupted.send(());
        };
        ctrlc::set_handler(handler).context("cannot wait for Ctrl-C")?;
        let port = name.unwrap_or_else(|| "none found; the board is looked for".to_owned());
        ui.print(&Serving { port, arm: served, history: history_file, url: self.url(server.address()) })?;
        while let Err(RecvTimeoutError::Timeout) = interrupt.recv_timeout(POLL) {
            anyhow::ensure!(server.is_running(), "the server ended; its reason is above");
        }
        Ok(())
    }

    /// The arm with its board.
    fn read(&self, path: &Path) -> anyhow::Result<ServedArm> {
        let is_robot = Source::read::<String>(path).is_ok_and(|source| source.kind() == ModelKind::Robot);
        if is_robot {
            return Err(Usage(format!(
                "{}: a robot file, with joints in place of actuators that a board switches; give an arm file. The page Diagnosis takes \
                 robot files, and `darm draw` draws them",
                path.display()
            ))
            .into());
        }
        let wired = WiredArm::read(path, self.profile.as_deref())?;
        Ok(ServedArm { wired, file: path.display().to_string() })
    }

    /// Where pages record, and how: by this program, with the camera of `--poses`.
    fn record_setup(&self, folder: &Path) -> anyhow::Result<RecordSetup> {
        let no_folder = || format!("the folder {} cannot be made", folder.display());
        std::fs::create_dir_all(folder).with_context(no_folder)?;
        let folder = folder.canonicalize().with_context(no_folder)?;
        let program = std::env::current_exe().context("the file of this program is not known")?;
        let (port, camera) = (self.port.clone(), self.poses.clone().filter(|source| source != "sim"));
        let command = move |files: &RecordFiles| {
            let mut command = Command::new(&program);
            command.args(["--json", "record"]).arg(&files.table).arg("-o").arg(&files.output);
            command.args(camera.iter().flat_map(|camera| ["--camera", camera]));
            if let Ok(port) = port.name() {
                command.args(["--port", &port]);
            }
            command
        };
        Ok(RecordSetup { folder, command: Box::new(command) })
    }

    /// The file of the history; none where it is not wanted, or no home folder is known.
    fn history_file(&self) -> Option<PathBuf> {
        let is_none = |path: &&PathBuf| path.as_os_str() == "none";
        match &self.history {
            Some(path) => Some(path).filter(|path| !is_none(path)).cloned(),
            None => state_folder::path().map(|folder| folder.join("history.sqlite3")),
        }
    }

    /// The address that is given; else the default one, or a free port where another program has that.
    fn listen(&self) -> SocketAddr {
        let any = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
        self.listen.unwrap_or_else(|| if TcpListener::bind(LISTEN).is_ok() { LISTEN } else { any })
    }

    /// The address of the page, with the token behind `#`, where a browser keeps it to itself.
    fn url(&self, address: SocketAddr) -> String {
        let named = self.name.first().filter(|_| !address.ip().is_loopback());
        let host = named.map_or_else(|| address.to_string(), |name| format!("{name}:{}", address.port()));
        let token = self.token.as_deref().filter(|token| !token.is_empty());
        token.map_or_else(|| format!("http://{host}/"), |token| format!("http://{host}/#token={token}"))
    }
}
