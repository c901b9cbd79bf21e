//! A Unix or TCP socket as a link: the emulator's serial port, or a serial server.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;

use super::{Link, LinkError, SEND_TIMEOUT};
use crate::clock::host_now_s;

enum Stream {
    Unix(UnixStream),
    Tcp(TcpStream),
}

/// A connected socket.
pub struct Socket {
    stream: Stream,
    name: String,
}

impl Socket {
    /// Connects to a Unix socket that somebody listens on.
    pub fn unix(path: &Path) -> Result<Self, LinkError> {
        let name = format!("unix:{}", path.display());
        let connect = || {
            let stream = UnixStream::connect(path)?;
            stream.set_write_timeout(Some(SEND_TIMEOUT))?;
            Ok(stream)
        };
        let stream = connect().map_err(|e| LinkError::of(&name, e))?;
        Ok(Self { stream: Stream::Unix(stream), name })
    }

    /// Connects to `HOST:PORT`.
    pub fn tcp(address: &str) -> Result<Self, LinkError> {
        let name = format!("tcp:{address}");
        let connect = || {
            let stream = TcpStream::connect(address)?;
            stream.set_nodelay(true)?;
            stream.set_write_timeout(Some(SEND_TIMEOUT))?;
            Ok(stream)
        };
        let stream = connect().map_err(|e| LinkError::of(&name, e))?;
        Ok(Self { stream: Stream::Tcp(stream), name })
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> std::io::Result<usize> {
        // A timeout of zero would mean "for ever" to the operating system.
        let timeout = Some(timeout.max(Duration::from_micros(1)));
        match &mut self.stream {
            Stream::Unix(stream) => {
                stream.set_read_timeout(timeout)?;
                stream.read(buffer)
            }
            Stream::Tcp(stream) => {
                stream.set_read_timeout(timeout)?;
                stream.read(buffer)
            }
        }
    }
}

impl Link for Socket {
    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        let sent = match &mut self.stream {
            Stream::Unix(stream) => stream.write_all(bytes),
            Stream::Tcp(stream) => stream.write_all(bytes),
        };
        sent.map_err(|e| match e.kind() {
            ErrorKind::WouldBlock | ErrorKind::TimedOut => {
                LinkError::Stalled { port: self.name.clone(), timeout_s: SEND_TIMEOUT.as_secs_f64() }
            }
            _ => LinkError::of(&self.name, e),
        })
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, LinkError> {
        match self.read(buffer, timeout) {
            Ok(0) if !buffer.is_empty() => Err(LinkError::Closed { port: self.name.clone() }),
            Ok(count) => Ok(count),
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted) => Ok(0),
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

#[cfg(test)]
mod tests {
    use std::io::Write;
    use std::os::unix::net::UnixListener;
    use std::time::Duration;

    use super::Socket;
    use crate::link::{Link, LinkError};

    #[test]
    fn silence_is_zero_bytes_and_an_end_is_an_error() {
        let dir = tempfile::tempdir().unwrap();
        let listener = UnixListener::bind(dir.path().join("s")).unwrap();
        let mut socket = Socket::unix(&dir.path().join("s")).unwrap();
        let (mut peer, _) = listener.accept().unwrap();
        let mut buffer = [0; 8];
        assert_eq!(socket.receive(&mut buffer, Duration::ZERO).unwrap(), 0);
        peer.write_all(b"abc").unwrap();
        assert_eq!(socket.receive(&mut buffer, Duration::from_secs(5)).unwrap(), 3);
        drop(peer);
        assert!(matches!(socket.receive(&mut buffer, Duration::from_secs(5)), Err(LinkError::Closed { .. })));
    }
}
