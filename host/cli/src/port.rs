//! Choice of the port: the named one, or the only one.

use std::os::unix::fs::FileTypeExt as _;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::time::{Duration, Instant};

use darm_device::client::Client;
use darm_device::client::sharing::{attach, is_shared};
use darm_device::client::stop::{Confirmation, StopHandle, hold, holder_process, is_in_use, stop_at};
use darm_device::link::{self, Link, LinkError};

use crate::guests::{CommandRights, Role};
use crate::state_folder;

/// Time for a process that ends to let go of its port.
const HANDOVER: Duration = Duration::from_secs(1);

/// Characters of another process's command that are shown.
const MAX_COMMAND: usize = 120;

/// Port option.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct PortArgs {
    /// Port of the board: /dev/ttyACM0, unix:PATH or tcp:HOST:PORT; default: the only one found
    #[arg(long, short, env = "DARM_PORT", value_name = "PORT")]
    pub(crate) port: Option<String>,
}

/// Why no port could be chosen.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub(crate) enum PortError {
    /// No port was found.
    #[error("no board found; plug one in, simulate one with `darm sim`, or name its port with --port")]
    None,
    /// Another process holds the port.
    #[error("{port} is in use by {holder}; end it first. `darm stop` stops the arm past it")]
    InUse {
        /// The port.
        port: String,
        /// What has it open.
        holder: String,
    },
    /// Several ports were found.
    #[error("several boards found ({}); choose one with --port or DARM_PORT", .0.join(", "))]
    Several(Vec<String>),
}

impl PortArgs {
    /// The name of the port.
    pub(crate) fn name(&self) -> Result<String, PortError> {
        match self.port.as_deref() {
            Some(port) if !port.is_empty() => Ok(port.to_owned()),
            _ => only(candidates()),
        }
    }

    /// The same; `None` where no port is named and none is found.
    pub(crate) fn name_or_none(&self) -> Result<Option<String>, PortError> {
        match self.name() {
            Err(PortError::None) => Ok(None),
            name => name.map(Some),
        }
    }

    /// Connects to the board at the port, for a moment: who comes meanwhile waits until it is free, as a guest would lose it.
    pub(crate) fn connect(&self) -> anyhow::Result<Client> {
        Ok(Client::connect(open_free(&self.name()?)?.0)?)
    }
}

/// Connects to the board at a port; commands that come later are guests of this one.
pub(crate) fn connect(name: &str, role: Role) -> anyhow::Result<(Client, StopHandle)> {
    let (link, handle) = open_free(name)?;
    let client = Client::connect(link)?;
    share(&client, &handle, role);
    Ok((client, handle))
}

/// Lets commands that come later use the port of this client.
pub(crate) fn share(client: &Client, handle: &StopHandle, role: Role) {
    client.share(handle, Arc::new(CommandRights::new(role, own_name())));
}

/// Opens a port, or attaches to the process that has it and shares it; other processes can send a stop through this one.
pub(crate) fn open(name: &str) -> Result<(Box<dyn Link>, StopHandle), LinkError> {
    let socket = state_folder::stop_socket(name);
    let attached = socket.as_deref().map_or(Ok(None), |socket| attach(name, socket, &own_name()))?;
    match attached {
        Some(attached) => Ok(attached),
        None => Ok(hold(link::open(name)?, socket.as_deref())),
    }
}

/// The same of a port that no other process has for itself: a second program that waited for the first would move the arm when nobody
/// expects it.
pub(crate) fn open_free(name: &str) -> anyhow::Result<(Box<dyn Link>, StopHandle)> {
    let since = Instant::now();
    while let Some(holder) = holder(name) {
        if since.elapsed() > HANDOVER {
            return Err(PortError::InUse { port: name.to_owned(), holder }.into());
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    Ok(open(name)?)
}

/// The same, now or not at all.
pub(crate) fn open_at_once(name: &str) -> Result<(Box<dyn Link>, StopHandle), LinkError> {
    match holder(name) {
        Some(holder) => Err(LinkError::InUse { port: name.to_owned(), holder }),
        None => open(name),
    }
}

/// Stops the board at a port, through the process that holds it where there is one.
pub(crate) fn stop(name: &str) -> Result<Confirmation, LinkError> {
    stop_at(name, state_folder::stop_socket(name))
}

/// What has a port for itself, for people: the command of another `darm`; `None` where no other `darm` does, or it shares the port.
pub(crate) fn holder(name: &str) -> Option<String> {
    let socket = state_folder::stop_socket(name).filter(|socket| is_in_use(socket) && !is_shared(socket))?;
    Some(holder_process(&socket).map_or_else(|| "another `darm`".to_owned(), name_of))
}

/// What this command is called where others see it.
fn own_name() -> String {
    name_of(std::process::id())
}

/// What a process is called, for people.
fn name_of(process: u32) -> String {
    command_of(process)
        .map_or_else(|| format!("`darm` (process {process})"), |command| format!("`{command}` (process {process})"))
}

/// The command that a process was started with, without the folder of its program and what follows a secret.
fn command_of(process: u32) -> Option<String> {
    let line = std::fs::read(format!("/proc/{process}/cmdline")).ok()?;
    let words: Vec<_> = line.split(|&byte| byte == 0).map(String::from_utf8_lossy).collect();
    let is_shown = |word: &&str| !word.starts_with("--token");
    let words: Vec<&str> =
        words.iter().map(AsRef::as_ref).filter(|word| !word.is_empty()).take_while(is_shown).collect();
    let (program, arguments) = words.split_first()?;
    let program = program.rsplit('/').next().unwrap_or(program);
    let text = std::iter::once(program).chain(arguments.iter().copied()).collect::<Vec<_>>().join(" ");
    Some(text.chars().filter(|c| !c.is_control()).take(MAX_COMMAND).collect())
}

/// Whether nothing is at the name of a port: no device, a link to a terminal that was closed, a socket of a program that ended.
pub(crate) fn has_vanished(name: &str) -> bool {
    match name.strip_prefix("unix:") {
        Some(path) => UnixStream::connect(path).is_err(),
        None => !name.starts_with("tcp:") && !std::path::Path::new(name).exists(),
    }
}

/// Every possible port of a board: USB serial ports, and that of a running simulator.
fn candidates() -> Vec<String> {
    let mut ports = board_ports();
    ports.extend(emulated_port());
    ports
}

/// The port of `darm sim`; `None` if it is not running.
pub(crate) fn emulated_port() -> Option<String> {
    let folder = state_folder::board().ok()?;
    UnixStream::connect(state_folder::camera(&folder)).ok()?;
    let port = state_folder::port(&folder);
    let is_socket = port.metadata().ok()?.file_type().is_socket();
    Some(format!("{}{}", if is_socket { "unix:" } else { "" }, port.display()))
}

/// The camera of `darm sim`; `None` if it is not running.
pub(crate) fn emulated_camera() -> Option<String> {
    let camera = state_folder::camera(&state_folder::board().ok()?);
    UnixStream::connect(&camera).ok()?;
    Some(format!("unix:{}", camera.display()))
}

/// USB serial ports; the PC's own ports are excluded.
pub(crate) fn board_ports() -> Vec<String> {
    let is_usb = |name: &String| ["ACM", "USB", "usb", "COM"].iter().any(|part| name.contains(part));
    link::serial::ports().into_iter().filter(is_usb).collect()
}

fn only(mut ports: Vec<String>) -> Result<String, PortError> {
    match (ports.pop(), ports.is_empty()) {
        (None, _) => Err(PortError::None),
        (Some(port), true) => Ok(port),
        (Some(port), false) => {
            ports.push(port);
            Err(PortError::Several(ports))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{PortError, only};

    #[test]
    fn a_single_port_is_the_default() {
        assert_eq!(only(vec![]), Err(PortError::None));
        assert_eq!(only(vec!["a".into()]), Ok("a".into()));
        assert_eq!(only(vec!["a".into(), "b".into()]), Err(PortError::Several(vec!["a".into(), "b".into()])));
    }
}
