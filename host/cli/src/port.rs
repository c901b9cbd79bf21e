//! Which port a command uses: the one that was named, or the only one that there is.

use std::os::unix::fs::FileTypeExt as _;
use std::os::unix::net::UnixStream;

use darm_device::client::Client;
use darm_device::client::stop::{StopHandle, hold};
use darm_device::link::{self, Link, LinkError};

use crate::state_folder;

/// Where the board is.
#[derive(clap::Args, Debug)]
pub(crate) struct PortArgs {
    /// Port of the board: /dev/ttyACM0, unix:PATH or tcp:HOST:PORT; may be left out when there is only one
    #[arg(long, short, env = "DARM_PORT", value_name = "PORT")]
    pub(crate) port: Option<String>,
}

/// Why no port could be chosen.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub(crate) enum PortError {
    /// There is none.
    #[error("no board found; plug one in, start one in the emulator with `darm plant`, or name its port with --port")]
    None,
    /// There are several.
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

    /// Connects to the board at the port.
    pub(crate) fn connect(&self) -> anyhow::Result<Client> {
        Ok(Client::connect(open(&self.name()?)?.0)?)
    }
}

/// Opens a port and holds it; other processes can send the stop through this one.
pub(crate) fn open(name: &str) -> Result<(Box<dyn Link>, StopHandle), LinkError> {
    Ok(hold(link::open(name)?, state_folder::stop_socket(name).as_deref()))
}

/// Every port that a board may be at: those of cables, and that of the emulated board if it runs.
fn candidates() -> Vec<String> {
    let mut ports = board_ports();
    ports.extend(emulated_port());
    ports
}

/// The port of the board that `darm plant` has started; `None` when it does not run.
pub(crate) fn emulated_port() -> Option<String> {
    let folder = state_folder::board().ok()?;
    UnixStream::connect(state_folder::camera(&folder)).ok()?;
    let port = state_folder::port(&folder);
    let is_socket = port.metadata().ok()?.file_type().is_socket();
    Some(format!("{}{}", if is_socket { "unix:" } else { "" }, port.display()))
}

/// The camera of the board that `darm plant` has started; `None` when it does not run.
pub(crate) fn emulated_camera() -> Option<String> {
    let camera = state_folder::camera(&state_folder::board().ok()?);
    UnixStream::connect(&camera).ok()?;
    Some(format!("unix:{}", camera.display()))
}

/// Serial ports that a board's cable makes; a PC's own ports are not among them.
pub(crate) fn board_ports() -> Vec<String> {
    let makes_one = |name: &String| ["ACM", "USB", "usb", "COM"].iter().any(|part| name.contains(part));
    link::serial::ports().into_iter().filter(makes_one).collect()
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
    fn only_a_single_port_is_taken_unasked() {
        assert_eq!(only(vec![]), Err(PortError::None));
        assert_eq!(only(vec!["a".into()]), Ok("a".into()));
        assert_eq!(only(vec!["a".into(), "b".into()]), Err(PortError::Several(vec!["a".into(), "b".into()])));
    }
}
