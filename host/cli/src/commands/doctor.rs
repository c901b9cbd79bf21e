//! `darm doctor`: looks at everything between this computer and a board, and says how to mend what is wrong.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use darm_core::sequencer::Phase;
use darm_device::client::Client;
use darm_device::{link, qemu};
use serde::Serialize;

use super::{flash, status};
use crate::firmware_image;
use crate::port::{PortArgs, board_ports, emulated_port};
use crate::voice::{Answer, Voice};

const EXAMPLES: &str = "\
Examples:
  darm doctor                   ports, permissions, board, emulator, flash tool, toolchain
  darm doctor -p /dev/ttyACM1   the same, and asks the board at this port";

/// Target of the firmware's build.
const TARGET: &str = "thumbv7em-none-eabihf";

/// Look at ports, permissions, versions, emulator and tools, and say how to mend what is wrong
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Doctor {
    #[command(flatten)]
    port: PortArgs,
}

/// How one thing is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum State {
    /// As it should be.
    Good,
    /// Not there; some commands do without it.
    Missing,
    /// There and does not work.
    Wrong,
}

#[derive(Clone, Serialize)]
struct Check {
    name: &'static str,
    state: State,
    found: String,
    fix: Option<String>,
}

impl Check {
    fn good(name: &'static str, found: impl Into<String>) -> Self {
        Self { name, state: State::Good, found: found.into(), fix: None }
    }

    fn missing(name: &'static str, found: impl Into<String>, fix: impl Into<String>) -> Self {
        Self { name, state: State::Missing, found: found.into(), fix: Some(fix.into()) }
    }

    fn wrong(name: &'static str, found: impl Into<String>, fix: impl Into<String>) -> Self {
        Self { name, state: State::Wrong, found: found.into(), fix: Some(fix.into()) }
    }

    /// The words of an error: before the semicolon what is wrong, behind it what to do.
    fn wrong_as_said(name: &'static str, error: &impl std::error::Error) -> Self {
        let text = error.to_string();
        let (found, fix) = text.split_once("; ").unwrap_or((&text, "see `darm COMMAND --help`"));
        Self::wrong(name, found, fix)
    }
}

#[derive(Serialize)]
struct Report {
    version: &'static str,
    checks: Vec<Check>,
}

/// Something is there and does not work.
#[derive(Debug, thiserror::Error)]
#[error("{0} of the checks found something wrong; the fixes stand beside them")]
struct Wrong(usize);

impl Doctor {
    pub(crate) fn run(&self, voice: Voice) -> anyhow::Result<()> {
        let wheel = voice.wheel("looking");
        let mut checks = ports();
        checks.extend(self.board());
        checks.extend([emulator(), image(), probe_rs(), toolchain()]);
        wheel.finish_and_clear();
        let wrong = checks.iter().filter(|check| check.state == State::Wrong).count();
        voice.tell(&Report { version: env!("CARGO_PKG_VERSION"), checks })?;
        if wrong > 0 && !voice.json { Err(Wrong(wrong).into()) } else { Ok(()) }
    }

    /// Asks the board, if there is a port to ask at.
    fn board(&self) -> Vec<Check> {
        let Ok(port) = self.port.name() else { return Vec::new() };
        let client = match link::open(&port) {
            Ok(link) => Client::connect(link),
            Err(error) => return vec![Check::wrong_as_said("board", &error)],
        };
        match client {
            Ok(mut client) => [vec![board(&client)], holdings(&mut client)].concat(),
            Err(error) => vec![Check::wrong_as_said("board", &error)],
        }
    }
}

fn board(client: &Client) -> Check {
    let (identity, version) = (client.identity(), client.version());
    let [major, minor, patch] = version.firmware;
    let found = format!(
        "{} {} at {}, firmware {major}.{minor}.{patch}, protocol {}",
        identity.board,
        identity.device,
        client.port(),
        version.protocol
    );
    if client.hello().is_some() {
        Check::good("board", found)
    } else {
        Check::wrong(
            "board",
            found,
            "this tool speaks another protocol; bring the firmware up to date with `darm flash`",
        )
    }
}

/// What a board holds that speaks this version: table, profile, and whether its outputs recover.
fn holdings(client: &mut Client) -> Vec<Check> {
    let Some(hello) = client.hello() else { return Vec::new() };
    let table = match hello.table {
        Some(table) => Check::good("table", table.short().to_string()),
        None => Check::missing("table", "the board holds no table", "`darm table` makes one, `darm upload` brings it"),
    };
    let profile = match status::profile(client) {
        Some(profile) => Check::good("profile", profile.short().to_string()),
        None => Check::missing("profile", "built in: 16 outputs, no servos", "`darm profile write --arm arm.toml`"),
    };
    let outputs = match client.outputs() {
        Ok(outputs) => Check::good("outputs", status::recovery(&status::recovering(&outputs))),
        Err(error) => Check::wrong_as_said("outputs", &error),
    };
    vec![phase(client), table, profile, outputs]
}

/// Whether the board has latched its safe state.
fn phase(client: &mut Client) -> Check {
    match client.status().map(|status| status.phase) {
        Ok(Phase::Safe(fault)) => Check::wrong(
            "state",
            format!("safe state: {fault}"),
            "correct the cause, then `darm stop --clear`; `darm status` shows more",
        ),
        Ok(_) => Check::good("state", "no fault is latched"),
        Err(error) => Check::wrong_as_said("state", &error),
    }
}

fn ports() -> Vec<Check> {
    let ports = board_ports();
    if let (true, Some(port)) = (ports.is_empty(), emulated_port()) {
        return vec![Check::good("port", format!("no USB serial port; `darm plant` runs a board at {port}"))];
    }
    if ports.is_empty() {
        let fix =
            "plug the board's ST-LINK connector (CN7) in; without a board `darm plant` starts one in the emulator";
        return vec![Check::missing("port", "no USB serial port", fix)];
    }
    ports.iter().map(|port| permission(port)).collect()
}

fn permission(port: &str) -> Check {
    use rustix::fs::{Access, access};
    match access(Path::new(port), Access::READ_OK | Access::WRITE_OK) {
        Ok(()) => Check::good("port", format!("{port} may be read and written")),
        Err(_) => Check::wrong(
            "port",
            format!("{port} may not be opened by this user"),
            "`sudo usermod -aG dialout $USER`, then log in again",
        ),
    }
}

fn emulator() -> Check {
    match qemu::find() {
        Ok(version) => Check::good("emulator", format!("{} {version}", qemu::PROGRAM)),
        Err(qemu::VersionError::Missing) => Check::missing(
            "emulator",
            format!("{} is not installed", qemu::PROGRAM),
            "`cargo xtask demo` installs it, or `sudo apt install qemu-system-arm` where that is 9.1 or newer",
        ),
        Err(error) => Check::wrong_as_said("emulator", &error),
    }
}

fn image() -> Check {
    let named = std::env::var_os(firmware_image::VARIABLE).map(PathBuf::from);
    match firmware_image::find(named.as_deref()) {
        Ok(path) => Check::good("firmware", path.display().to_string()),
        Err(_) => Check::missing("firmware", "no image is built here", "`cargo xtask image`"),
    }
}

fn probe_rs() -> Check {
    match first_line("probe-rs", &["--version"]) {
        Some(version) => Check::good("flash tool", version),
        None => Check::missing("flash tool", "probe-rs is not installed", flash::INSTALL),
    }
}

fn toolchain() -> Check {
    let Some(version) = first_line("rustc", &["--version"]) else {
        return Check::missing("toolchain", "no rustc", "only needed to build the firmware: see https://rustup.rs");
    };
    let has_target = Command::new("rustc")
        .args(["--print", "target-libdir", "--target", TARGET])
        .stdin(Stdio::null())
        .output()
        .is_ok_and(|output| Path::new(String::from_utf8_lossy(&output.stdout).trim()).is_dir());
    match has_target {
        true => Check::good("toolchain", format!("{version}, target {TARGET}")),
        false => Check::missing(
            "toolchain",
            format!("{version} without the target {TARGET}"),
            format!("`rustup target add {TARGET}`"),
        ),
    }
}

/// First line of what a program says; nothing if it cannot be started.
fn first_line(program: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new(program).args(arguments).stdin(Stdio::null()).output().ok()?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    text.lines().next().map(str::to_owned)
}

impl Answer for Report {
    fn text(&self) -> String {
        let mut lines = vec![format!("darm {}", self.version)];
        for check in &self.checks {
            let mark = match check.state {
                State::Good => "good   ",
                State::Missing => "missing",
                State::Wrong => "WRONG  ",
            };
            lines.push(format!("{mark}  {:<10}  {}", check.name, check.found));
            lines.extend(check.fix.iter().map(|fix| format!("                     to mend: {fix}")));
        }
        lines.join("\n")
    }
}
