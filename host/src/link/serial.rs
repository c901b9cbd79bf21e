//! A serial port as a link: the board's USB cable, or a pseudo terminal.

use std::io::{self, ErrorKind, Read, Write};
use std::time::Duration;

use serialport::{ClearBuffer, SerialPort};

use super::{Link, LinkError, SEND_TIMEOUT};
use crate::clock::host_now_s;

/// Speed of the board's console.
pub const BAUD: u32 = 115_200;

/// An open serial port, held exclusively.
pub struct Serial {
    port: Box<dyn SerialPort>,
    name: String,
}

impl Serial {
    /// Opens a port at [`BAUD`], 8 data bits, no parity; what waited in its buffers is dropped.
    pub fn open(path: &str) -> Result<Self, LinkError> {
        let port = serialport::new(path, BAUD).timeout(SEND_TIMEOUT).open().map_err(|e| open_error(path, e))?;
        port.clear(ClearBuffer::All).map_err(|e| open_error(path, e))?;
        Ok(Self { port, name: path.to_owned() })
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.port.set_timeout(timeout)?;
        self.port.read(buffer)
    }
}

/// The names of the serial ports of this machine, boards first.
pub fn ports() -> Vec<String> {
    let mut ports: Vec<String> =
        serialport::available_ports().unwrap_or_default().into_iter().map(|p| p.port_name).collect();
    ports.sort_by_key(|name| !(name.contains("ACM") || name.contains("USB")));
    ports
}

/// `serialport` says "no device" for a busy port and for a missing one alike: the text and the file tell them apart.
fn open_error(path: &str, error: serialport::Error) -> LinkError {
    let port = path.to_owned();
    let text = error.to_string().to_ascii_lowercase();
    match error.kind {
        _ if text.contains("busy") || text.contains("lock") => LinkError::Busy { port },
        _ if text.contains("permission") => LinkError::Permission { port },
        serialport::ErrorKind::NoDevice | serialport::ErrorKind::Io(ErrorKind::NotFound)
            if !std::path::Path::new(path).exists() =>
        {
            LinkError::Missing { port }
        }
        _ => LinkError::of(path, io::Error::from(error)),
    }
}

impl Link for Serial {
    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        let sent =
            self.port.set_timeout(SEND_TIMEOUT).map_err(io::Error::from).and_then(|()| self.port.write_all(bytes));
        sent.map_err(|e| match e.kind() {
            ErrorKind::TimedOut | ErrorKind::WouldBlock => {
                LinkError::Stalled { port: self.name.clone(), timeout_s: SEND_TIMEOUT.as_secs_f64() }
            }
            _ => LinkError::of(&self.name, e),
        })
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, LinkError> {
        match self.read(buffer, timeout) {
            Ok(0) if !buffer.is_empty() => Err(LinkError::Closed { port: self.name.clone() }),
            Ok(count) => Ok(count),
            Err(e) if matches!(e.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted) => Ok(0),
            Err(e) => Err(LinkError::of(&self.name, e)),
        }
    }

    fn now_s(&self) -> f64 {
        host_now_s()
    }

    fn name(&self) -> &str {
        &self.name
    }
}
