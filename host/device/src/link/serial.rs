//! A serial port as a link: the board's USB cable, or a pseudo terminal.

use std::io::{self, ErrorKind};
use std::os::fd::{AsFd, OwnedFd};
use std::path::Path;
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

/// The names of the serial ports of this machine, boards first. There are none where `/sys` is not mounted, as in a chroot.
pub fn ports() -> Vec<String> {
    let mut ports =
        if cfg!(target_os = "linux") { ports_of_linux(Path::new("/sys/class/tty")) } else { ports_of_unix() };
    ports.sort_by_key(|name| (!(name.contains("ACM") || name.contains("USB")), name.clone()));
    ports
}

/// The terminals that have a device behind them. The driver of the PC's own ports lists four whether they are there or not: its
/// attribute `type` is 0, `PORT_UNKNOWN`, of those that are not (`include/uapi/linux/serial_core.h`).
fn ports_of_linux(terminals: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(terminals).into_iter().flatten().flatten();
    let is_there = |folder: &Path| {
        let kind = std::fs::read_to_string(folder.join("type"));
        folder.join("device").exists() && kind.map_or(true, |kind| kind.trim() != "0")
    };
    let names = entries.filter(|entry| is_there(&entry.path())).map(|entry| entry.file_name());
    names.map(|name| format!("/dev/{}", name.to_string_lossy())).collect()
}

/// Elsewhere the call-out devices, `cu.*`: they do not wait for a carrier.
fn ports_of_unix() -> Vec<String> {
    let names = std::fs::read_dir("/dev").into_iter().flatten().flatten().map(|entry| entry.file_name());
    let names = names.map(|name| name.to_string_lossy().into_owned());
    names.filter(|name| name.starts_with("cu.")).map(|name| format!("/dev/{name}")).collect()
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

#[cfg(test)]
mod tests {
    use std::fs;

    use super::ports_of_linux;

    /// The layout of `/sys/class/tty` of a PC with one board: links to folders, here folders.
    #[test]
    fn ports_without_a_device_or_a_chip_are_not_listed() {
        let folder = tempfile::tempdir().unwrap();
        let terminal = |name: &str, has_device: bool, kind: Option<&str>| {
            fs::create_dir_all(folder.path().join(name)).unwrap();
            if has_device {
                fs::create_dir(folder.path().join(name).join("device")).unwrap();
            }
            if let Some(kind) = kind {
                fs::write(folder.path().join(name).join("type"), kind).unwrap();
            }
        };
        terminal("ttyACM0", true, None);
        terminal("ttyS0", true, Some("4\n"));
        terminal("ttyS1", true, Some("0\n"));
        terminal("tty1", false, None);
        terminal("ptmx", false, None);
        let mut ports = ports_of_linux(folder.path());
        ports.sort();
        assert_eq!(ports, ["/dev/ttyACM0", "/dev/ttyS0"]);
        assert_eq!(ports_of_linux(&folder.path().join("missing")), [""; 0], "no /sys, as in a chroot");
    }
}
