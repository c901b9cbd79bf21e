//! Where pictures come from: a socket that is listened to while the program runs, or a file that is read afterwards.

use std::fs::File;
use std::io::{BufRead as _, BufReader, ErrorKind, Read};
use std::net::TcpStream;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use crate::commands::camera::{Columns, LineError, Picture};

/// How often a silent camera is asked whether it is to end.
const LOOK: Duration = Duration::from_millis(100);

/// Why there are no pictures.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CameraError {
    /// The socket or file cannot be opened.
    #[error("no camera at {camera}: {source}; is it running?")]
    Open {
        /// As the user named it.
        camera: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// It broke off.
    #[error("the camera at {camera} broke off: {source}")]
    Read {
        /// As the user named it.
        camera: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// It sends something else.
    #[error("{camera}: line {line}: {error}")]
    Line {
        /// As the user named it.
        camera: String,
        /// The line, the header being 1.
        line: usize,
        /// What is wrong.
        error: LineError,
    },
    /// It said nothing at all.
    #[error("the camera at {camera} sent nothing, not even its header")]
    Silent {
        /// As the user named it.
        camera: String,
    },
}

/// A camera that is being listened to.
pub(crate) struct Camera {
    name: String,
    kind: Kind,
}

enum Kind {
    File(PathBuf),
    Socket { end: Arc<AtomicBool>, thread: JoinHandle<std::io::Result<Vec<String>>> },
}

impl Camera {
    /// Opens `unix:PATH`, `tcp:HOST:PORT` or a file.
    pub(crate) fn open(name: &str) -> Result<Self, CameraError> {
        let kind = if let Some(path) = name.strip_prefix("unix:") {
            let socket = UnixStream::connect(path);
            socket.and_then(|socket| socket.set_read_timeout(Some(LOOK)).map(|()| listen(socket)))
        } else if let Some(address) = name.strip_prefix("tcp:") {
            let socket = TcpStream::connect(address);
            socket.and_then(|socket| socket.set_read_timeout(Some(LOOK)).map(|()| listen(socket)))
        } else {
            File::open(name).map(|_| Kind::File(name.into()))
        };
        let kind = kind.map_err(|source| CameraError::Open { camera: name.to_owned(), source })?;
        Ok(Self { name: name.to_owned(), kind })
    }

    /// Stops listening; all pictures so far.
    pub(crate) fn stop(self) -> Result<Vec<Picture>, CameraError> {
        let lines = match self.kind {
            Kind::File(path) => File::open(path).and_then(|file| BufReader::new(file).lines().collect()),
            Kind::Socket { end, thread } => {
                end.store(true, Ordering::Relaxed);
                thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            }
        };
        let lines = lines.map_err(|source| CameraError::Read { camera: self.name.clone(), source })?;
        pictures(&self.name, &lines)
    }
}

fn listen(socket: impl Read + Send + 'static) -> Kind {
    let end = Arc::new(AtomicBool::new(false));
    let seen = Arc::clone(&end);
    Kind::Socket { end, thread: thread::spawn(move || lines(socket, &seen)) }
}

/// Whole lines until the other end closes or nobody wants more.
fn lines(mut socket: impl Read, end: &AtomicBool) -> std::io::Result<Vec<String>> {
    let (mut text, mut bytes) = (Vec::new(), [0; 4096]);
    while !end.load(Ordering::Relaxed) {
        match socket.read(&mut bytes) {
            Ok(0) => break,
            Ok(count) => text.extend_from_slice(&bytes[..count]),
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
            Err(error) => return Err(error),
        }
    }
    let whole = text.iter().rposition(|&byte| byte == b'\n').map_or(0, |at| at + 1);
    Ok(String::from_utf8_lossy(&text[..whole]).lines().map(str::to_owned).collect())
}

fn pictures(camera: &str, lines: &[String]) -> Result<Vec<Picture>, CameraError> {
    let mut numbered = (1..).zip(lines).filter(|(_, line)| !line.starts_with('#') && !line.trim().is_empty());
    let wrong = |line, error| CameraError::Line { camera: camera.to_owned(), line, error };
    let (line, header) = numbered.next().ok_or_else(|| CameraError::Silent { camera: camera.to_owned() })?;
    let columns = Columns::parse(header).map_err(|error| wrong(line, error))?;
    let mut pictures = Vec::new();
    for (line, text) in numbered {
        pictures.extend(columns.picture(text).map_err(|error| wrong(line, error))?);
    }
    Ok(pictures)
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use super::{lines, pictures};

    #[test]
    fn a_line_that_is_cut_off_is_left_out() {
        let read = lines(&b"time_s,x_m,y_m,angle_deg\n1,2,3,4\n5,6"[..], &AtomicBool::new(false)).unwrap();
        assert_eq!(pictures("cam", &read).unwrap().len(), 1);
    }

    #[test]
    fn a_bad_line_is_told_by_number() {
        let lines: Vec<String> = ["# by hand", "time_s,x_m,y_m,angle_deg", "1,2,x,4"].map(str::to_owned).to_vec();
        let error = pictures("cam", &lines).unwrap_err().to_string();
        assert_eq!(error, "cam: line 3: the camera's column y_m holds \"x\", no number");
    }
}
