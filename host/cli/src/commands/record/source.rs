//! Sources of camera measurements: a socket that is read while the program runs, or a file that may grow.

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::net::TcpStream;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use darm_measure::log::{self, LogError};
use darm_measure::mcap::McapError;

use crate::commands::camera_lines::{Columns, LineError, Picture, unix_now_s};

/// Timeout of one read from the camera's socket.
const POLL: Duration = Duration::from_millis(100);
/// Largest delay of a camera measurement.
pub(crate) const CAMERA_DELAY_S: f64 = 2.0;
/// A camera that has sent nothing for this time has ended.
const SILENT_S: f64 = 5.0;
/// Time until a camera has to send a measurement that was made just now.
const FIRST_WITHIN: Duration = Duration::from_secs(5);

/// Why no camera measurement can be read.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CameraError {
    /// The socket or file cannot be opened.
    #[error("cannot open the camera {camera}: {source}; check its address and that it is running")]
    Open {
        /// As the user named it.
        camera: String,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The connection broke.
    #[error("the connection to the camera {camera} broke: {source}; check it, then record again with --resume")]
    Read {
        /// As the user named it.
        camera: String,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// A line is invalid.
    #[error("{camera}:{line}: {error}")]
    Line {
        /// As the user named it.
        camera: String,
        /// The line; the first is 1.
        line: usize,
        /// What is wrong.
        error: LineError,
    },
    /// It sends nothing new.
    #[error(
        "the newest measurement of the camera {camera} has time_s {newest_s:.3} s, and it is {now_s:.3} s Unix time; at most {CAMERA_DELAY_S} s may lie between: start the camera's program, or correct its clock"
    )]
    Old {
        /// As the user named it.
        camera: String,
        /// When the newest one was made, Unix time.
        newest_s: f64,
        /// Now, Unix time.
        now_s: f64,
    },
    /// Nothing was received.
    #[error("the camera {camera} sent nothing, not even its header; check the camera program")]
    Silent {
        /// As the user named it.
        camera: String,
    },
}

/// An open camera.
pub(crate) struct Camera {
    name: String,
    kind: Kind,
    /// Bytes of an incomplete line.
    rest: Vec<u8>,
    columns: Option<Columns>,
    line: usize,
    /// Measurements that were not dropped, in the order of the camera.
    pictures: Vec<Picture>,
    /// Number of received measurements.
    count: usize,
    /// Time of the last one, Unix time.
    newest_s: Option<f64>,
}

enum Kind {
    File(File),
    /// An MCAP log that may grow, how many of its rows were taken, and its length then.
    Log(PathBuf, usize, u64),
    Socket {
        end: Arc<AtomicBool>,
        received: Arc<Mutex<Vec<u8>>>,
        thread: Option<JoinHandle<std::io::Result<()>>>,
    },
}

impl Camera {
    /// Opens `unix:PATH`, `tcp:HOST:PORT`, an MCAP log or a file of lines.
    pub(crate) fn open(name: &str) -> Result<Self, CameraError> {
        let kind = if let Some(path) = name.strip_prefix("unix:") {
            let socket = UnixStream::connect(path);
            socket.and_then(|socket| socket.set_read_timeout(Some(POLL)).map(|()| listen(socket)))
        } else if let Some(address) = name.strip_prefix("tcp:") {
            let socket = TcpStream::connect(address);
            socket.and_then(|socket| socket.set_read_timeout(Some(POLL)).map(|()| listen(socket)))
        } else if name.ends_with(".mcap") {
            File::open(name).map(|_| Kind::Log(name.into(), 0, 0))
        } else {
            File::open(name).map(Kind::File)
        };
        let kind = kind.map_err(|source| CameraError::Open { camera: name.to_owned(), source })?;
        Ok(Self::of_kind(name, kind))
    }

    fn of_kind(name: &str, kind: Kind) -> Self {
        let name = name.to_owned();
        Self { name, kind, rest: Vec::new(), columns: None, line: 0, pictures: Vec::new(), count: 0, newest_s: None }
    }

    /// Waits for a measurement that was made just now: a source that has ended would move the arm for nothing.
    pub(crate) fn wait_for_new(&mut self) -> Result<(), CameraError> {
        let begin = Instant::now();
        loop {
            self.poll()?;
            let now_s = unix_now_s();
            match self.newest_s {
                Some(newest_s) if (now_s - newest_s).abs() < CAMERA_DELAY_S => return Ok(()),
                _ if begin.elapsed() < FIRST_WITHIN => thread::sleep(POLL),
                Some(newest_s) => return Err(CameraError::Old { camera: self.name.clone(), newest_s, now_s }),
                None => return Err(CameraError::Silent { camera: self.name.clone() }),
            }
        }
    }

    /// Whether it has ended: the other end of a socket has closed it, or nothing new comes since Unix time `from_s`.
    pub(crate) fn has_ended(&self, from_s: f64) -> bool {
        self.is_closed() || unix_now_s() - self.newest_s.unwrap_or(from_s).max(from_s) > SILENT_S
    }

    /// Whether the source is a file, which keeps its measurements.
    pub(crate) fn is_file(&self) -> bool {
        matches!(self.kind, Kind::File(_) | Kind::Log(..))
    }

    /// As the user named it.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Whether the other end of a socket has closed it.
    pub(crate) fn is_closed(&self) -> bool {
        matches!(&self.kind, Kind::Socket { thread, .. } if thread.as_ref().is_none_or(JoinHandle::is_finished))
    }

    /// The received measurements, without those that were dropped.
    pub(crate) fn pictures(&self) -> &[Picture] {
        &self.pictures
    }

    /// Number of received measurements.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// Whether the measurements are planar; `None` before the header.
    pub(crate) fn is_planar(&self) -> Option<bool> {
        self.columns.as_ref().map(Columns::is_planar)
    }

    /// Drops the measurements before this time.
    pub(crate) fn forget_before(&mut self, time_s: f64) {
        let old = self.pictures.partition_point(|picture| picture.time_s < time_s);
        self.pictures.drain(..old);
    }

    /// Reads the lines that have arrived since the last poll.
    pub(crate) fn poll(&mut self) -> Result<(), CameraError> {
        let fresh = match &mut self.kind {
            Kind::File(file) => {
                let mut bytes = Vec::new();
                file.read_to_end(&mut bytes).map(|_| bytes)
            }
            Kind::Log(path, taken, length) => new_rows(path, taken, length),
            Kind::Socket { received, .. } => {
                Ok(std::mem::take(&mut *received.lock().unwrap_or_else(PoisonError::into_inner)))
            }
        };
        self.rest.extend(fresh.map_err(|source| CameraError::Read { camera: self.name.clone(), source })?);
        let complete = self.rest.iter().rposition(|&byte| byte == b'\n').map_or(0, |at| at + 1);
        let lines: Vec<u8> = self.rest.drain(..complete).collect();
        String::from_utf8_lossy(&lines).lines().try_for_each(|line| self.take(line))
    }

    /// Stops reading and parses the last lines; a file's last line may end without a line feed.
    pub(crate) fn finish(&mut self) -> Result<(), CameraError> {
        if let Kind::Socket { end, thread, .. } = &mut self.kind {
            end.store(true, Ordering::Relaxed);
            let ended = thread.take().map(JoinHandle::join);
            let ended = ended.map(|ended| ended.unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
            let ended = ended.unwrap_or(Ok(()));
            self.poll()?;
            ended.map_err(|source| CameraError::Read { camera: self.name.clone(), source })?;
        } else {
            self.poll()?;
            let rest = std::mem::take(&mut self.rest);
            String::from_utf8_lossy(&rest).lines().try_for_each(|line| self.take(line))?;
        }
        self.columns.as_ref().map(drop).ok_or_else(|| CameraError::Silent { camera: self.name.clone() })
    }

    fn take(&mut self, text: &str) -> Result<(), CameraError> {
        self.line += 1;
        if text.starts_with('#') || text.trim().is_empty() {
            return Ok(());
        }
        let (camera, line) = (&self.name, self.line);
        let wrong = |error| CameraError::Line { camera: camera.clone(), line, error };
        match &self.columns {
            None => self.columns = Some(Columns::parse(text).map_err(wrong)?),
            Some(columns) => {
                let picture = columns.picture(text).map_err(wrong)?;
                self.count += usize::from(picture.is_some());
                self.newest_s = picture.as_ref().map(|picture| picture.time_s).or(self.newest_s);
                self.pictures.extend(picture);
            }
        }
        Ok(())
    }
}

/// The rows of a log that were not taken yet, before the first of them the header. A log that is being written may end early.
fn new_rows(path: &Path, taken: &mut usize, length: &mut u64) -> std::io::Result<Vec<u8>> {
    if std::fs::metadata(path)?.len() == *length {
        return Ok(Vec::new());
    }
    let bytes = std::fs::read(path)?;
    *length = bytes.len() as u64;
    let text = match log::to_text_of_complete_rows(&bytes) {
        Ok((text, _)) => text,
        Err(LogError::Mcap(McapError::Cut(_))) => return Ok(Vec::new()),
        Err(error) => return Err(std::io::Error::other(error)),
    };
    let lines: Vec<&[u8]> =
        text.split_inclusive(|&byte| byte == b'\n').filter(|line| !line.starts_with(b"#")).collect();
    let new = lines.get(*taken..).unwrap_or_default().concat();
    *taken = lines.len();
    Ok(new)
}

fn listen(socket: impl Read + Send + 'static) -> Kind {
    let (end, received) = (Arc::new(AtomicBool::new(false)), Arc::new(Mutex::new(Vec::new())));
    let (seen, buffer) = (Arc::clone(&end), Arc::clone(&received));
    Kind::Socket { end, received, thread: Some(thread::spawn(move || read_socket(socket, &seen, &buffer))) }
}

/// Reads until the other end closes or the end is requested.
fn read_socket(mut socket: impl Read, end: &AtomicBool, received: &Mutex<Vec<u8>>) -> std::io::Result<()> {
    let mut bytes = [0; 4096];
    // Bytes that have arrived are read even if the end was requested meanwhile.
    let mut ended = false;
    while !ended {
        ended = end.load(Ordering::Relaxed);
        match socket.read(&mut bytes) {
            Ok(0) => break,
            Ok(count) => received.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(&bytes[..count]),
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::{Camera, listen, log};

    const HEADER: &str = "time_s,x_m,y_m,angle_deg\n";

    /// A camera behind a socket that sends this text and closes.
    fn received(text: &str) -> Camera {
        Camera::of_kind("cam", listen(std::io::Cursor::new(text.to_owned())))
    }

    #[test]
    fn a_line_that_is_cut_off_is_left_out() {
        let mut camera = received(&format!("{HEADER}1,2,3,4\n5,6"));
        camera.finish().unwrap();
        assert_eq!((camera.pictures().len(), camera.count(), camera.is_planar()), (1, 1, Some(true)));
    }

    #[test]
    fn an_invalid_line_is_reported_by_number() {
        let error = received("# by hand\ntime_s,x_m,y_m,angle_deg\n1,2,x,4\n").finish().unwrap_err().to_string();
        assert_eq!(error, "cam:3: column y_m: \"x\" is not a number; correct the camera's output");
        assert_eq!(
            received("").finish().unwrap_err().to_string(),
            "the camera cam sent nothing, not even its header; check the camera program"
        );
    }

    #[test]
    fn a_log_that_grows_is_read_on() {
        let log = |rows: &str| log::from_text(&format!("{HEADER}{rows}")).unwrap();
        let (one, two) = (log("1,2,3,4\n"), log("1,2,3,4\n2,2,3,4\n"));
        let file = tempfile::Builder::new().suffix(".mcap").tempfile().unwrap();
        std::fs::write(file.path(), &one[..8]).unwrap();
        let mut camera = Camera::open(file.path().to_str().unwrap()).unwrap();
        let mut rows = |bytes: &[u8]| {
            std::fs::write(file.path(), bytes).unwrap();
            camera.poll().unwrap();
            camera.pictures().len()
        };
        // Its header alone, a log, and a longer one whose end is not written yet.
        assert_eq!([rows(&one[..8]), rows(&one), rows(&two[..two.len() - 40])], [0, 1, 2]);
        camera.finish().unwrap();
        assert_eq!((camera.count(), camera.is_planar()), (2, Some(true)));
    }

    #[test]
    fn a_file_that_grows_is_read_on() {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        write!(file, "{HEADER}1,2,3,4\n2,2").unwrap();
        let mut camera = Camera::open(file.path().to_str().unwrap()).unwrap();
        camera.poll().unwrap();
        assert_eq!(camera.pictures().len(), 1);
        write!(file, ",3,4\n3,2,3,4").unwrap();
        camera.poll().unwrap();
        assert_eq!(camera.pictures().len(), 2);
        camera.forget_before(1.5);
        camera.finish().unwrap();
        assert_eq!((camera.pictures().len(), camera.count()), (2, 3));
    }
}
