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

pub mod faulty;
pub mod serial;
pub mod socket;

use std::io;
use std::time::Duration;

/// Bytes to and from a board, in order, without meaning.
pub trait Link: Send {
    /// Sends all bytes or fails.
    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError>;

    /// Waits for bytes, at most `timeout`; 0 means that none came.
    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, LinkError>;

    /// The host's time in seconds from an arbitrary start; virtual when the board lives in this process.
    fn now_s(&self) -> f64;

    /// The port as the user named it.
    fn name(&self) -> &str;
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
}

/// Why bytes did not travel. Every text names the port and what to do.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The port does not exist.
    #[error("no port {port}; is the board plugged in? `darm doctor` lists the ports")]
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
    /// Nobody listens on the socket.
    #[error("nobody listens on {port}; start the emulator or the serial server first")]
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

    /// Whether the port itself is lost, so that only opening it again helps.
    pub fn is_closed(&self) -> bool {
        matches!(self, LinkError::Closed { .. } | LinkError::Io { .. })
    }
}

/// Longest wait for the other end to take bytes.
pub(crate) const SEND_TIMEOUT: Duration = Duration::from_secs(2);

/// Opens a port by its name; the table of names stands in the module's documentation.
pub fn open(port: &str) -> Result<Box<dyn Link>, LinkError> {
    if let Some(path) = port.strip_prefix("unix:") {
        Ok(Box::new(socket::Socket::unix(path.as_ref())?))
    } else if let Some(address) = port.strip_prefix("tcp:") {
        Ok(Box::new(socket::Socket::tcp(address)?))
    } else if port.starts_with('/') || port.to_ascii_uppercase().starts_with("COM") {
        Ok(Box::new(serial::Serial::open(port)?))
    } else {
        Err(LinkError::Name { port: port.to_owned() })
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
