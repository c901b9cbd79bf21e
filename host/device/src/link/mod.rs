//! The byte pipe to a board: serial port, socket, fault injector or a board in this process, behind one trait.
//!
//! A port is named by a string, the same everywhere a user types one:
//!
//! | name            | what                                                |
//! |-----------------|-----------------------------------------------------|
//! | `/dev/ttyACM0`  | a serial port, real or a pseudo terminal; 115200 8N1 |
//! | `COM3`          | the same on Windows                                 |
//! | `unix:PATH`     | a Unix socket, as the emulator offers               |
//! | `tcp:HOST:PORT` | a TCP socket, as a serial server offers             |

mod descriptor;
pub mod faulty;
pub mod paced;
pub mod serial;
pub mod socket;

use std::io;
use std::os::fd::{AsFd as _, OwnedFd};
use std::path::Path;
use std::time::{Duration, Instant};

/// Bytes to and from a board, in order, without meaning.
pub trait Link: Send {
    /// Sends all bytes or fails.
    ///
    /// # Errors
    ///
    /// The port is closed or fails, or does not take the bytes in time.
    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError>;

    /// Waits for bytes, at most `timeout`; 0 means that none came.
    ///
    /// # Errors
    ///
    /// The port is closed or fails. That no bytes came is not an error.
    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, LinkError>;

    /// The host's time in seconds from an arbitrary start; virtual when the board lives in this process.
    fn now_s(&self) -> f64;

    /// The port as the user named it.
    fn name(&self) -> &str;

    /// The same port a second time, for [`Urgent`]; `None` where the board is in this process.
    fn duplicate(&self) -> Option<OwnedFd> {
        None
    }
}

impl Link for Box<dyn Link> {
    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        (**self).send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, LinkError> {
        (**self).receive(buffer, timeout)
    }

    fn now_s(&self) -> f64 {
        (**self).now_s()
    }

    fn name(&self) -> &str {
        (**self).name()
    }

    fn duplicate(&self) -> Option<OwnedFd> {
        (**self).duplicate()
    }
}

/// A second way to send on a port that a [`Link`] holds: past whatever the link is waiting for.
pub struct Urgent {
    port: OwnedFd,
    name: String,
}

impl Urgent {
    /// A second way to send on this link's port; `None` where the board is in this process.
    pub fn of(link: &dyn Link) -> Option<Self> {
        Some(Self { port: link.duplicate()?, name: link.name().to_owned() })
    }

    /// Sends all bytes before `until`, or fails.
    ///
    /// # Errors
    ///
    /// The port is closed or fails, or does not take the bytes before `until`.
    pub fn send(&self, bytes: &[u8], until: Instant) -> Result<(), LinkError> {
        let timeout = until.saturating_duration_since(Instant::now());
        let sent = descriptor::send(self.port.as_fd(), bytes, until);
        sent.map_err(|error| LinkError::of_sending(&self.name, timeout, error))
    }
}

/// Why bytes did not travel. Every text names the port and, behind `; `, what to do.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The port does not exist.
    #[error("no port {port}; plug the board in, or name another port: `darm doctor` lists them")]
    Missing {
        /// The port as named by the user.
        port: String,
    },
    /// The port exists and this user may not open it.
    #[error(
        "no permission to open {port}; add yourself to its group (`sudo usermod -aG dialout $USER`) and log in again"
    )]
    Permission {
        /// The port as named by the user.
        port: String,
    },
    /// Another program holds the port.
    #[error("{port} is in use; close the other program (`fuser {port}` names it) and try again")]
    Busy {
        /// The port as named by the user.
        port: String,
    },
    /// Another `darm` holds the port.
    #[error("{port} is in use by {holder}; end it first")]
    InUse {
        /// The port as named by the user.
        port: String,
        /// The program that has it open.
        holder: String,
    },
    /// The `darm` that shares the port has no place for another program.
    #[error("{port} is used by {programs} other programs, the most there may be; end one of them and try again")]
    Full {
        /// The port as named by the user.
        port: String,
        /// How many programs use it.
        programs: usize,
    },
    /// A `darm` that is suspended holds the port.
    #[error(
        "{port} is held by the suspended process {process}; continue it with `kill -CONT {process}`, then repeat the stop, or use \
         the emergency stop"
    )]
    Suspended {
        /// The port as named by the user.
        port: String,
        /// Number of the process.
        process: u32,
    },
    /// Nobody listens on the socket.
    #[error("no program listens on {port}; start the simulator (`darm sim ARM.toml`) or the serial server first")]
    Refused {
        /// The port as named by the user.
        port: String,
    },
    /// The name of the port is in none of the known forms.
    #[error("{port:?} names no port; write /dev/ttyACM0, unix:PATH or tcp:HOST:PORT")]
    Name {
        /// The port as named by the user.
        port: String,
    },
    /// No port was named, and which one is meant is not known.
    #[error("{0}")]
    Unnamed(String),
    /// The name is that of a file or device that is no serial port.
    #[error("{port} is not a serial port; name one: /dev/ttyACM0, unix:PATH or tcp:HOST:PORT")]
    NoSerialPort {
        /// The port as named by the user.
        port: String,
    },
    /// The other end is gone: cable pulled, emulator ended.
    #[error("{port} was closed by the other end; check the cable and connect again")]
    Closed {
        /// The port as named by the user.
        port: String,
    },
    /// The other end takes no bytes.
    #[error("{port} took no bytes for {timeout_s} s; the board may be halted: reset it and connect again")]
    Stalled {
        /// The port as named by the user.
        port: String,
        /// How long the link waited.
        timeout_s: f64,
    },
    /// Anything else the operating system said.
    #[error("{port}: {source}")]
    Io {
        /// The port as named by the user.
        port: String,
        /// What the operating system said.
        source: io::Error,
    },
}

impl LinkError {
    /// Sorts an error of opening or using `port`.
    pub(crate) fn of(port: &str, source: io::Error) -> Self {
        let port = port.to_owned();
        if source.raw_os_error() == Some(rustix::io::Errno::NOTTY.raw_os_error()) {
            return LinkError::NoSerialPort { port };
        }
        match source.kind() {
            io::ErrorKind::NotFound => LinkError::Missing { port },
            io::ErrorKind::PermissionDenied => LinkError::Permission { port },
            io::ErrorKind::ResourceBusy => LinkError::Busy { port },
            io::ErrorKind::ConnectionRefused => LinkError::Refused { port },
            io::ErrorKind::BrokenPipe
            | io::ErrorKind::ConnectionReset
            | io::ErrorKind::ConnectionAborted
            | io::ErrorKind::NotConnected
            | io::ErrorKind::UnexpectedEof => LinkError::Closed { port },
            _ => LinkError::Io { port, source },
        }
    }

    /// Sorts an error of sending, for which `timeout` was allowed.
    fn of_sending(port: &str, timeout: Duration, error: io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock => {
                LinkError::Stalled { port: port.to_owned(), timeout_s: timeout.as_secs_f64() }
            }
            _ => LinkError::of(port, error),
        }
    }

    /// The number of bytes received, 0 when none came; a port that the other end has closed is an error.
    fn of_receiving(port: &str, buffer: &[u8], received: io::Result<Option<usize>>) -> Result<usize, Self> {
        match received {
            Ok(Some(0)) if !buffer.is_empty() => Err(LinkError::Closed { port: port.to_owned() }),
            Ok(count) => Ok(count.unwrap_or(0)),
            Err(error) => Err(LinkError::of(port, error)),
        }
    }

    /// Whether the port itself is lost, so that only opening it again helps.
    pub fn is_closed(&self) -> bool {
        matches!(self, LinkError::Closed { .. } | LinkError::Io { .. })
    }
}

/// Longest wait for the other end to take bytes.
pub(crate) const SEND_TIMEOUT: Duration = Duration::from_secs(2);

/// A port's name, in one of the forms of the module's table.
enum Address<'a> {
    Unix(&'a Path),
    Tcp(&'a str),
    Serial(&'a str),
}

impl<'a> Address<'a> {
    fn parse(port: &'a str) -> Result<Self, LinkError> {
        if let Some(path) = port.strip_prefix("unix:") {
            Ok(Self::Unix(path.as_ref()))
        } else if let Some(address) = port.strip_prefix("tcp:") {
            Ok(Self::Tcp(address))
        } else if port.starts_with('/') || port.to_ascii_uppercase().starts_with("COM") {
            Ok(Self::Serial(port))
        } else {
            Err(LinkError::Name { port: port.to_owned() })
        }
    }
}

/// Opens a port by its name and holds it; the table of names is in the module's documentation.
///
/// # Errors
///
/// The name is in none of the known forms; the port does not exist, may not be opened by this user or is held by
/// another program; or nobody listens on the socket.
pub fn open(port: &str) -> Result<Box<dyn Link>, LinkError> {
    Ok(match Address::parse(port)? {
        Address::Unix(path) => Box::new(socket::Socket::unix(path)?),
        Address::Tcp(address) => Box::new(socket::Socket::tcp(address)?),
        Address::Serial(path) => Box::new(serial::Serial::open(path)?),
    })
}

/// Opens a port by its name even if another program uses it, unless that program holds it exclusively.
///
/// # Errors
///
/// As [`open`], but for a port that another program uses without holding it exclusively.
pub fn open_shared(port: &str) -> Result<Box<dyn Link>, LinkError> {
    match Address::parse(port)? {
        Address::Serial(path) => Ok(Box::new(serial::Serial::open_shared(path)?)),
        Address::Unix(_) | Address::Tcp(_) => open(port),
    }
}

#[cfg(test)]
mod tests {
    use super::{LinkError, open};

    #[test]
    fn a_name_without_a_form_is_refused() {
        assert!(matches!(open("ttyACM0"), Err(LinkError::Name { .. })));
    }

    #[test]
    fn a_missing_port_is_named() {
        for port in ["/dev/ttyNONE", "unix:/nonexistent/socket"] {
            assert!(matches!(open(port), Err(LinkError::Missing { port: named }) if named == port));
        }
    }

    #[test]
    fn a_socket_without_listener_is_told_apart() {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let port = format!("tcp:{}", listener.local_addr().unwrap());
        drop(listener);
        assert!(matches!(open(&port), Err(LinkError::Refused { .. })));
    }
}
