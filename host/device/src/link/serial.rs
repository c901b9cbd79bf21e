//! A serial port as a link: the board's USB cable, or a pseudo terminal.

use std::io::{self, ErrorKind};
use std::os::fd::{AsFd, OwnedFd};
use std::time::{Duration, Instant};

use rustix::fs::{FlockOperation, Mode, OFlags, flock};
use rustix::termios::{ControlModes, OptionalActions, QueueSelector, ioctl_tiocexcl, tcflush, tcgetattr, tcsetattr};

use super::{Link, LinkError, SEND_TIMEOUT, descriptor};
use crate::clock::host_now_s;

/// Speed of the board's console.
pub const BAUD: u32 = 115_200;

/// An open serial port.
pub struct Serial {
    port: OwnedFd,
    name: String,
    /// Closing the port must not wait for bytes that the other end does not take.
    drop_unsent: bool,
}

impl Serial {
    /// Opens a port at [`BAUD`], 8 data bits, no parity, and holds it exclusively: `TIOCEXCL` and `flock`. What waited in
    /// its buffers is dropped.
    ///
    /// # Errors
    ///
    /// The port does not exist, may not be opened by this user, is held by another program, or cannot be set up.
    pub fn open(path: &str) -> Result<Self, LinkError> {
        let port = open_alone(path).map_err(|error| LinkError::of(path, error))?;
        Ok(Self { port, name: path.to_owned(), drop_unsent: false })
    }

    /// Opens a port beside another program that uses it without holding it exclusively, and drops nothing that waits for
    /// that program.
    ///
    /// # Errors
    ///
    /// The port does not exist, may not be opened by this user, or is held exclusively by another program.
    pub fn open_shared(path: &str) -> Result<Self, LinkError> {
        let port = open_raw(path).map_err(|error| LinkError::of(path, error))?;
        // The other program may have set the port up so that no change is accepted; the bytes are what counts.
        let _ = set_up(&port);
        let real = std::fs::canonicalize(path).unwrap_or_else(|_| path.into());
        Ok(Self { port, name: path.to_owned(), drop_unsent: !real.starts_with("/dev/pts") })
    }
}

impl Drop for Serial {
    fn drop(&mut self) {
        if self.drop_unsent {
            // The system waits up to 30 s when a port with unsent bytes is closed.
            let _ = tcflush(&self.port, QueueSelector::OFlush);
        }
    }
}

/// A port that no other program has, set up, its buffers empty.
fn open_alone(path: &str) -> io::Result<OwnedFd> {
    let port = open_raw(path)?;
    ioctl_tiocexcl(&port)?;
    flock(&port, FlockOperation::NonBlockingLockExclusive).map_err(busy)?;
    set_up(&port)?;
    tcflush(&port, QueueSelector::IOFlush)?;
    Ok(port)
}

fn open_raw(path: &str) -> io::Result<OwnedFd> {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    Ok(rustix::fs::open(path, flags, Mode::empty())?)
}

/// Raw bytes at [`BAUD`], 8 data bits, no parity, no flow control, modem lines ignored.
fn set_up(port: &OwnedFd) -> io::Result<()> {
    let mut settings = tcgetattr(port)?;
    settings.make_raw();
    settings.control_modes |= ControlModes::CREAD | ControlModes::CLOCAL;
    settings.control_modes -= ControlModes::CRTSCTS | ControlModes::CSTOPB;
    settings.set_speed(BAUD)?;
    Ok(tcsetattr(port, OptionalActions::Now, &settings)?)
}

/// A lock that another program has is a busy port.
fn busy(error: rustix::io::Errno) -> io::Error {
    match error {
        rustix::io::Errno::WOULDBLOCK => ErrorKind::ResourceBusy.into(),
        error => error.into(),
    }
}

/// Where Linux lists them.
const TERMINALS: &str = "/sys/class/tty";

/// The names of the serial ports of this machine, boards first. There are none where `/sys` is not mounted, as in a chroot;
/// `serialport` panics there.
pub fn ports() -> Vec<String> {
    if cfg!(target_os = "linux") && !std::path::Path::new(TERMINALS).is_dir() {
        return Vec::new();
    }
    let mut ports: Vec<String> =
        serialport::available_ports().unwrap_or_default().into_iter().map(|p| p.port_name).collect();
    ports.sort_by_key(|name| !(name.contains("ACM") || name.contains("USB")));
    ports
}

impl Link for Serial {
    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        let sent = descriptor::send(self.port.as_fd(), bytes, Instant::now() + SEND_TIMEOUT);
        sent.map_err(|error| LinkError::of_sending(&self.name, SEND_TIMEOUT, error))
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, LinkError> {
        let received = descriptor::receive(self.port.as_fd(), buffer, timeout);
        LinkError::of_receiving(&self.name, buffer, received)
    }

    fn now_s(&self) -> f64 {
        host_now_s()
    }

    fn name(&self) -> &str {
        &self.name
    }

    fn duplicate(&self) -> Option<OwnedFd> {
        self.port.try_clone().ok()
    }
}
