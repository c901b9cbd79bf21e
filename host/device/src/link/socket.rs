//! A Unix or TCP socket as a link: the emulator's serial port, or a serial server.

use std::net::TcpStream;
use std::os::fd::{AsFd as _, BorrowedFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::{Duration, Instant};

use super::{Link, LinkError, SEND_TIMEOUT, descriptor};
use crate::clock::host_now_s;

enum Stream {
    Unix(UnixStream),
    Tcp(TcpStream),
}

impl Stream {
    fn descriptor(&self) -> BorrowedFd<'_> {
        match self {
            Self::Unix(stream) => stream.as_fd(),
            Self::Tcp(stream) => stream.as_fd(),
        }
    }
}

/// A connected socket.
pub struct Socket {
    stream: Stream,
    name: String,
}

impl Socket {
    /// Connects to a Unix socket that somebody listens on.
    ///
    /// # Errors
    ///
    /// The socket does not exist, may not be used by this user, or nobody listens on it.
    pub fn unix(path: &Path) -> Result<Self, LinkError> {
        let name = format!("unix:{}", path.display());
        let stream = UnixStream::connect(path).map_err(|e| LinkError::of(&name, e))?;
        Ok(Self { stream: Stream::Unix(stream), name })
    }

    /// A socket of the process that has this port, which answers as the board does.
    pub(crate) fn of_holder(stream: UnixStream, port: &str) -> Self {
        Self { stream: Stream::Unix(stream), name: port.to_owned() }
    }

    /// Connects to `HOST:PORT`.
    ///
    /// # Errors
    ///
    /// The address cannot be resolved or reached, or nobody listens on it.
    pub fn tcp(address: &str) -> Result<Self, LinkError> {
        let name = format!("tcp:{address}");
        let connect = || {
            let stream = TcpStream::connect(address)?;
            stream.set_nodelay(true)?;
            Ok(stream)
        };
        let stream = connect().map_err(|e| LinkError::of(&name, e))?;
        Ok(Self { stream: Stream::Tcp(stream), name })
    }
}

impl Link for Socket {
    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        let sent = descriptor::send(self.stream.descriptor(), bytes, Instant::now() + SEND_TIMEOUT);
        sent.map_err(|error| LinkError::of_sending(&self.name, SEND_TIMEOUT, error))
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, LinkError> {
        let received = descriptor::receive(self.stream.descriptor(), buffer, timeout);
        LinkError::of_receiving(&self.name, buffer, received)
    }

    fn now_s(&self) -> f64 {
        host_now_s()
    }

    fn name(&self) -> &str {
        &self.name
    }

    fn duplicate(&self) -> Option<OwnedFd> {
        self.stream.descriptor().try_clone_to_owned().ok()
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
