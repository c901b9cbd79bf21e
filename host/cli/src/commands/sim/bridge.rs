//! A board in virtual time as one at a socket or a pseudo terminal, in real time: the firmware's library, or an image in an emulator that is stepped.

use std::io::{ErrorKind, Read as _, Write as _};
use std::os::unix::net::{UnixListener, UnixStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use darm_device::clock::host_now_s;
use darm_device::link::Link;
use darm_sim::plant::camera::{Film, Frame};

use super::terminal::Terminal;

/// Interval at which the board's time is advanced to the host's.
const STEP: Duration = Duration::from_millis(1);
/// A host that reads nothing for this long is disconnected.
const SLOW: Duration = Duration::from_millis(500);

/// A board that is further behind skips the difference: its clock may be late against the host's, never ahead.
const BEHIND_S: f64 = 0.01;

/// The board and the thread that runs it.
pub(crate) struct Bridge {
    end: Arc<AtomicBool>,
    thread: JoinHandle<()>,
}

/// What a host connects to.
pub(crate) enum Port {
    /// A socket, for one host at a time.
    Socket(UnixListener),
    /// A pseudo terminal, for any terminal program.
    Terminal(Terminal),
}

impl Bridge {
    /// Runs the board at `link` behind `port`; frames of its camera carry the host's time.
    pub(crate) fn start(port: Port, link: Box<dyn Link>, film: Film) -> std::io::Result<(Self, Receiver<Frame>)> {
        let (port, host) = match port {
            Port::Socket(listener) => {
                listener.set_nonblocking(true)?;
                (Some(listener), None)
            }
            Port::Terminal(terminal) => (None, Some(Host::Terminal(terminal))),
        };
        let end = Arc::new(AtomicBool::new(false));
        let seen = Arc::clone(&end);
        let (frames, taken) = channel();
        let thread = thread::Builder::new().name("bridge".into()).spawn(move || {
            let started_s = host_now_s() - link.now_s();
            let mut cable = Cable { port, host, link, film, frames, started_s };
            while !seen.load(Ordering::Relaxed) && cable.step() {
                thread::sleep(STEP);
            }
        })?;
        Ok((Self { end, thread }, taken))
    }

    /// Whether the board still runs.
    pub(crate) fn is_running(&self) -> bool {
        !self.thread.is_finished()
    }

    /// Ends the board.
    pub(crate) fn stop(self) {
        self.end.store(true, Ordering::Relaxed);
        // A panic of the thread has been printed already.
        let _ = self.thread.join();
    }
}

/// Connection between the board and the one host on the port.
struct Cable {
    /// Where the next host comes from; a terminal is always there.
    port: Option<UnixListener>,
    host: Option<Host>,
    link: Box<dyn Link>,
    film: Film,
    frames: Sender<Frame>,
    /// Host time of the board's time 0; later where the board has skipped time.
    started_s: f64,
}

impl Cable {
    /// Advances the board's time to the host's and moves bytes both ways; false once the board has ended.
    fn step(&mut self) -> bool {
        if self.host.is_none() {
            let host = self.port.as_ref().and_then(|port| port.accept().ok());
            self.host = host.and_then(|(host, _)| plugged(host)).map(Host::Stream);
        }
        let mut bytes = [0; 1024];
        if let Some(received) = self.host.as_mut().map(|host| host.read(&mut bytes)) {
            match received {
                Ok(0) => self.host = None,
                Ok(count) if self.link.send(&bytes[..count]).is_err() => return false,
                Err(error) if !matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {
                    self.host = None;
                }
                Ok(_) | Err(_) => {}
            }
        }
        let lost_s = host_now_s() - self.started_s - self.link.now_s() - BEHIND_S;
        self.started_s += lost_s.max(0.0);
        let running = self.catch_up(&mut bytes);
        for frame in self.film.take() {
            // The receiver is gone while the board ends.
            let _ = self.frames.send(Frame { at_s: frame.at_s + self.started_s, ..frame });
        }
        running
    }

    fn catch_up(&mut self, bytes: &mut [u8]) -> bool {
        loop {
            let behind_s = host_now_s() - self.started_s - self.link.now_s();
            let Ok(wait) = Duration::try_from_secs_f64(behind_s) else { return true };
            let Ok(count) = self.link.receive(bytes, wait) else { return false };
            if count == 0 {
                return true;
            }
            if self.host.as_mut().is_some_and(|host| host.write(&bytes[..count]).is_err()) {
                self.host = None;
            }
        }
    }
}

/// The end of the host.
enum Host {
    Stream(UnixStream),
    Terminal(Terminal),
}

impl Host {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        match self {
            Self::Stream(stream) => stream.read(bytes),
            Self::Terminal(terminal) => terminal.read(bytes),
        }
    }

    fn write(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        match self {
            Self::Stream(stream) => write(stream, bytes),
            Self::Terminal(terminal) => {
                terminal.write(bytes);
                Ok(())
            }
        }
    }
}

fn plugged(host: UnixStream) -> Option<UnixStream> {
    host.set_write_timeout(Some(SLOW)).and_then(|()| host.set_nonblocking(true)).ok()?;
    Some(host)
}

fn write(host: &mut UnixStream, bytes: &[u8]) -> std::io::Result<()> {
    host.set_nonblocking(false)?;
    host.write_all(bytes)?;
    host.set_nonblocking(true)
}
