//! The Unix socket on which a process that holds a port takes the stop from others.
//!
//! One connection is one stop: the asker sends `stop` and a line end, the holder answers with one line, `confirmed`, `outputs alone`
//! (the board does not control its servos), `sent` (the board has not confirmed) or `failed` (the port takes no bytes).

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use super::{Confirmation, HOLDER_BOUND, StopHandle};

/// A requested stop takes at most this long, so that the answer arrives in the asker's time.
const HOLDER_WORK: Duration = Duration::from_millis(350);
/// Longest request or answer.
const LONGEST_LINE: u64 = 64;

/// A socket that is served until this is dropped.
pub(super) struct Serving {
    socket: PathBuf,
    end: Arc<AtomicBool>,
}

impl Drop for Serving {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Release);
        // Wakes the thread; if it has ended already nobody needs to be woken.
        let _ = UnixStream::connect(&self.socket);
        // Where it cannot be removed the next holder of the port does it.
        let _ = std::fs::remove_file(&self.socket);
    }
}

/// Serves stops at `socket`; `None` if another process serves there or the socket cannot be made.
pub(super) fn serve(socket: &Path, handle: StopHandle) -> Option<Serving> {
    if is_served(socket) {
        return None;
    }
    // A process that was killed has left its socket behind.
    let _ = std::fs::remove_file(socket);
    std::fs::create_dir_all(socket.parent()?).ok()?;
    let listener = UnixListener::bind(socket).ok()?;
    let serving = Serving { socket: socket.to_owned(), end: Arc::default() };
    let end = Arc::clone(&serving.end);
    thread::spawn(move || {
        for asker in listener.incoming() {
            if end.load(Ordering::Acquire) {
                return;
            }
            // An asker that has gone away does not hear the answer; the stop was sent all the same.
            let _ = asker.and_then(|asker| answer(asker, &handle));
        }
    });
    Some(serving)
}

/// Whether a process serves at `socket`.
pub(super) fn is_served(socket: &Path) -> bool {
    UnixStream::connect(socket).is_ok()
}

/// Number of the process that serves at `socket`; `None` if there is none, or the system does not say.
pub(super) fn served_by(socket: &Path) -> Option<u32> {
    let holder = UnixStream::connect(socket).ok()?;
    let credentials = rustix::net::sockopt::socket_peercred(&holder).ok()?;
    u32::try_from(credentials.pid.as_raw_nonzero().get()).ok()
}

fn answer(mut asker: UnixStream, handle: &StopHandle) -> std::io::Result<()> {
    asker.set_read_timeout(Some(HOLDER_BOUND))?;
    asker.set_write_timeout(Some(HOLDER_BOUND))?;
    if line(&asker)? != "stop" {
        return Ok(());
    }
    let said: &[u8] = match handle.stop(HOLDER_WORK) {
        Ok(Confirmation::Confirmed) => b"confirmed\n",
        Ok(Confirmation::OutputsAlone) => b"outputs alone\n",
        Ok(Confirmation::Missing) => b"sent\n",
        Err(_) => b"failed\n",
    };
    asker.write_all(said)
}

/// Asks the process that serves at `socket`; `None` if there is none, it does not answer in time, or it could not send.
pub(super) fn ask(socket: &Path, within: Duration) -> Option<Confirmation> {
    let mut holder = UnixStream::connect(socket).ok()?;
    holder.set_read_timeout(Some(within)).ok()?;
    holder.set_write_timeout(Some(within)).ok()?;
    holder.write_all(b"stop\n").ok()?;
    match line(&holder).ok()?.as_str() {
        "confirmed" => Some(Confirmation::Confirmed),
        "outputs alone" => Some(Confirmation::OutputsAlone),
        "sent" => Some(Confirmation::Missing),
        _ => None,
    }
}

fn line(stream: &UnixStream) -> std::io::Result<String> {
    let mut text = String::new();
    BufReader::new(stream.take(LONGEST_LINE)).read_line(&mut text)?;
    Ok(text.trim_end().to_owned())
}
