//! `darm doctor`: checks everything between this computer and a board, and says how to fix what is wrong.

mod udev;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use darm_core::sequencer::Phase;
use darm_core::wire::message::Refusal;
use darm_device::client::{Client, ClientError, TransportError};
use darm_device::link::LinkError;
use darm_sim::qemu::{self, VersionError};
use serde::Serialize;

use super::status::ProfileState;
use super::{flash, status};
use crate::failure::FailedChecks;
use crate::firmware_image::{self, NoImage};
use crate::port::{self, PortArgs, board_ports, emulated_port};
use crate::ui::{Answer, Ui};

const EXAMPLES: &str = "\
Examples:
  darm doctor                                              # everything
  darm doctor -p unix:$HOME/.local/state/darm/board/port   # the same with the board at this port
  darm doctor --udev-rule > 60-darm.rules                  # the rule that opens boards to users

The exit code is 1 if a check failed; what is only missing, or in use by another `darm`, is no failure.";

/// How a user who is not logged in at the computer itself gets permission to open serial ports.
const DIALOUT: &str = "`sudo usermod -aG dialout $USER`, then log in again";
/// Target of the firmware's build.
const TARGET: &str = "thumbv7em-none-eabihf";

/// Check ports, permissions, versions, emulator and tools, and say how to fix what is wrong
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Doctor {
    #[command(flatten)]
    port: PortArgs,
    /// Print the udev rule that lets a user open boards and probes, and check nothing
    #[arg(long)]
    udev_rule: bool,
}

/// Result of one check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
enum State {
    /// Works.
    Good,
    /// Not present; some commands work without it.
    Missing,
    /// Present, and not checked since another program uses it.
    InUse,
    /// Present and does not work.
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

    /// A board that another `darm` talks to: it is not asked.
    fn in_use(port: &str, holder: &str) -> Self {
        let found = format!("{port} is in use by {holder}; the board was not asked");
        let fix = Some("nothing is wrong; end that program to check the board".to_owned());
        Self { name: "board", state: State::InUse, found, fix }
    }

    /// A port that does not open, or a connection that broke.
    fn link_failed(name: &'static str, error: &LinkError) -> Self {
        let (found, fix) = link_failure(error);
        Self::wrong(name, found, fix)
    }

    /// A request that the board did not answer, or refused.
    fn request_failed(name: &'static str, error: &ClientError) -> Self {
        match error {
            ClientError::Transport(TransportError::Link(error)) => Self::link_failed(name, error),
            ClientError::Transport(TransportError::Silent { port, attempts, waited_s }) => Self::wrong(
                name,
                format!("{port}: no answer to {attempts} requests in {waited_s:.1} s"),
                "check that this is the board's port, that the board has power and that no other program reads the port",
            ),
            ClientError::Transport(error @ TransportError::OutcomeUnknown { .. }) => {
                Self::wrong(name, error.to_string(), "`darm status`, then `darm doctor` again")
            }
            ClientError::Frame(error) => Self::wrong(
                name,
                error.to_string(),
                "check cable and line speed; update the firmware with `darm flash`",
            ),
            ClientError::Denied(_) | ClientError::NoReboot(_) => {
                Self::wrong(name, error.to_string(), "`darm stop`, then `darm doctor` again")
            }
            ClientError::Refused(refusal) => {
                Self::wrong(name, format!("the board refused: {refusal}"), "`darm status` shows the state of the board")
            }
        }
    }
}

#[derive(Serialize)]
struct Report {
    version: &'static str,
    checks: Vec<Check>,
}

/// How a user gets permission to open a board's port.
fn permission_fix() -> String {
    match udev::check().state {
        State::Good => format!("plug the board in again; over SSH, where the udev rule gives no permission: {DIALOUT}"),
        State::Missing | State::InUse | State::Wrong => format!("{}; over SSH instead: {DIALOUT}", udev::INSTALL),
    }
}

/// What is wrong with a port, and the fix: the two halves of the error, but for what the udev rule of this machine says.
fn link_failure(error: &LinkError) -> (String, String) {
    let text = error.to_string();
    let (what, fix) = text.split_once("; ").unwrap_or((&text, "check the cable and the port's driver"));
    let fix = if matches!(error, LinkError::Permission { .. }) { permission_fix() } else { fix.to_owned() };
    (what.to_owned(), fix)
}

impl Doctor {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        if self.udev_rule {
            return ui.print(&udev::Rule::new());
        }
        let spinner = ui.spinner("checking");
        let mut checks = ports();
        checks.extend(self.board());
        checks.extend([udev::check(), emulator(), image(), probe_rs()]);
        // A release has the images that a toolchain would build.
        checks.extend(firmware_image::embedded().is_empty().then(toolchain));
        spinner.finish_and_clear();
        let failed = checks.iter().filter(|check| check.state == State::Wrong).count();
        ui.print(&Report { version: env!("CARGO_PKG_VERSION"), checks })?;
        if failed > 0 { Err(FailedChecks(failed).into()) } else { Ok(()) }
    }

    /// Queries the board, if there is a port.
    fn board(&self) -> Vec<Check> {
        let Ok(port) = self.port.name() else { return Vec::new() };
        // Who asks past another program gets no answer, or takes that program's.
        if let Some(holder) = port::holder(&port) {
            return vec![Check::in_use(&port, &holder)];
        }
        let client = match port::open(&port) {
            Ok((link, _)) => Client::connect(link),
            Err(error) => return vec![Check::link_failed("board", &error)],
        };
        match client {
            Ok(mut client) => [vec![board(&client)], contents(&mut client)].concat(),
            Err(error) => vec![Check::request_failed("board", &error)],
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
        Check::wrong("board", found, Refusal::Protocol { board: version.protocol }.to_string())
    }
}

/// State, table, profile and output limits of a board of this protocol version.
fn contents(client: &mut Client) -> Vec<Check> {
    let Some(hello) = client.hello() else { return Vec::new() };
    let table = match hello.table {
        Some(table) => Check::good("table", table.short().to_string()),
        None => Check::missing("table", "the board has no table", "make one with `darm table`, then `darm upload` it"),
    };
    let [profile, outputs] = match client.outputs() {
        Ok(outputs) => [
            profile(client, ProfileState::of(client, &outputs)),
            Check::good("outputs", status::recovery(&status::recovering(&outputs))),
        ],
        Err(error) => ["profile", "outputs"].map(|name| Check::request_failed(name, &error)),
    };
    vec![phase(client), table, profile, outputs]
}

/// Which limits are in force.
fn profile(client: &Client, state: ProfileState) -> Check {
    match state {
        ProfileState::Written => {
            Check::good("profile", status::profile(client).unwrap_or_default().short().to_string())
        }
        ProfileState::BuiltIn => Check::missing(
            "profile",
            "none; the built-in one is in force: 16 outputs, no servos",
            "`darm profile write --arm arm.toml`",
        ),
        ProfileState::Lost => Check::wrong(
            "profile",
            "lost or unusable; nothing is driven",
            "write it again with `darm profile write`, holding the button",
        ),
    }
}

/// Whether the board has latched its safe state.
fn phase(client: &mut Client) -> Check {
    match client.status().map(|status| status.phase) {
        Ok(Phase::Safe(fault)) => Check::wrong(
            "state",
            format!("safe state: {fault}"),
            "remove the cause, then `darm stop --clear`; `darm status` shows details",
        ),
        Ok(_) => Check::good("state", "no fault is latched"),
        Err(error) => Check::request_failed("state", &error),
    }
}

fn ports() -> Vec<Check> {
    let ports = board_ports();
    if let (true, Some(port)) = (ports.is_empty(), emulated_port()) {
        return vec![Check::good("port", format!("no USB serial port; `darm sim` runs a board at {port}"))];
    }
    if ports.is_empty() {
        let fix = "plug in the board's ST-LINK connector (CN7); without a board run `darm sim ARM.toml`";
        return vec![Check::missing("port", "no USB serial port", fix)];
    }
    ports.iter().map(|port| permission(port)).collect()
}

fn permission(port: &str) -> Check {
    use rustix::fs::{Access, access};
    match access(Path::new(port), Access::READ_OK | Access::WRITE_OK) {
        Ok(()) => Check::good("port", format!("{port} can be read and written")),
        Err(_) => Check::wrong("port", format!("no permission to open {port}"), permission_fix()),
    }
}

fn emulator() -> Check {
    match qemu::find() {
        Ok(version) => Check::good("emulator", format!("{} {version}", qemu::PROGRAM)),
        Err(VersionError::Missing) => Check::missing(
            "emulator",
            format!("{} is not installed", qemu::PROGRAM),
            format!(
                "`sudo apt install qemu-system-arm` where that is {} or newer, on Debian 12 with `-t bookworm-backports`; \
                 without it `darm sim` runs the firmware's library in its own process",
                qemu::OLDEST
            ),
        ),
        Err(VersionError::TooOld { found }) => Check::wrong(
            "emulator",
            format!("{} is version {found}, {} or newer is needed", qemu::PROGRAM, qemu::OLDEST),
            "Debian 12: install qemu-system-arm from the backports",
        ),
        Err(error @ (VersionError::Unreadable { .. } | VersionError::Io(_))) => {
            Check::wrong("emulator", error.to_string(), "reinstall it: `sudo apt install --reinstall qemu-system-arm`")
        }
    }
}

fn image() -> Check {
    let named = std::env::var_os(firmware_image::VARIABLE).map(PathBuf::from);
    let embedded = firmware_image::embedded();
    if named.is_none() && !embedded.is_empty() {
        return Check::good("firmware", format!("images of {} in this program", embedded.join(", ")));
    }
    match firmware_image::find(named.as_deref()) {
        Ok(path) => Check::good("firmware", path.display().to_string()),
        Err(NoImage::NotBuilt(_)) => Check::missing("firmware", "no image has been built", "`cargo xtask image`"),
        Err(error) => Check::wrong("firmware", error.to_string(), format!("correct {}", firmware_image::VARIABLE)),
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
        return Check::missing(
            "toolchain",
            "no rustc",
            "install it from https://rustup.rs; only needed to build the firmware",
        );
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

/// First line of a program's output; `None` if it cannot be started.
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
                State::InUse => "in use ",
                State::Wrong => "WRONG  ",
            };
            lines.push(format!("{mark}  {:<10}  {}", check.name, check.found));
            lines.extend(check.fix.iter().map(|fix| format!("                     fix: {fix}")));
        }
        lines.join("\n")
    }
}
