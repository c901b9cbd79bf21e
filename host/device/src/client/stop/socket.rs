//! The Unix socket on which a process that holds a port takes stops and guests from other processes.
//!
//! The asker's first line says what it wants; the holder answers with one line:
//!
//! | line          | answer                                                                                          |
//! |---------------|-------------------------------------------------------------------------------------------------|
//! | `stop`        | `confirmed`, `outputs alone` (the board does not control its servos), `sent` (the board has not confirmed) or `failed` (the port takes no bytes) |
//! | `shared?`     | `shared` or `alone`                                                                             |
//! | `attach NAME` | `attached`, and the connection is the board's from then on (`crate::client::sharing`); `alone`, or `full` |

use std::io::{Read as _, Write as _};
use std::os::unix::fs::MetadataExt as _;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use rustix::fs::FlockOperation;

use super::{Confirmation, HOLDER_BOUND, StopHandle};

/// A requested stop takes at most this long, so that the answer arrives in the asker's time.
pub(in crate::client) const HOLDER_WORK: Duration = Duration::from_millis(350);
/// Longest request or answer.
const LONGEST_LINE: usize = 192;

/// A socket that is served until this is dropped.
pub(super) struct Serving {
    socket: PathBuf,
    /// Which file it is: another process may have put its own there since.
    inode: Option<u64>,
    end: Arc<AtomicBool>,
}

impl Drop for Serving {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Release);
        if inode(&self.socket) != self.inode {
            return;
        }
        // Wakes the thread; if it has ended already nobody needs to be woken.
        let _ = UnixStream::connect(&self.socket);
        // Where it cannot be removed the next holder of the port does it.
        let _ = std::fs::remove_file(&self.socket);
    }
}

fn inode(socket: &Path) -> Option<u64> {
    std::fs::symlink_metadata(socket).ok().map(|file| file.ino())
}

/// Serves stops at `socket`; `None` if another process serves there or the socket cannot be made.
pub(super) fn serve(socket: &Path, handle: StopHandle) -> Option<Serving> {
    let folder = socket.parent()?;
    std::fs::create_dir_all(folder).ok()?;
    // Of two processes that start at the same moment the second is to find the first.
    let lock = std::fs::File::open(folder).ok()?;
    rustix::fs::flock(&lock, FlockOperation::LockExclusive).ok()?;
    if is_served(socket) {
        return None;
    }
    // A process that was killed has left its socket behind.
    let _ = std::fs::remove_file(socket);
    let listener = UnixListener::bind(socket).ok()?;
    let serving = Serving { socket: socket.to_owned(), inode: inode(socket), end: Arc::default() };
    let end = Arc::clone(&serving.end);
    thread::spawn(move || {
        for asker in listener.incoming() {
            if end.load(Ordering::Acquire) {
                return;
            }
            let (Ok(asker), handle) = (asker, handle.clone()) else { continue };
            // A thread for each: one that says nothing keeps no stop out. An asker that has gone away does not hear the answer; the stop
            // was sent all the same.
            thread::spawn(move || drop(answer(asker, &handle)));
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
    process_of(&UnixStream::connect(socket).ok()?)
}

/// Number of the process at the other end; `None` where the system does not say.
pub(in crate::client) fn process_of(other: &UnixStream) -> Option<u32> {
    let credentials = rustix::net::sockopt::socket_peercred(other).ok()?;
    u32::try_from(credentials.pid.as_raw_nonzero().get()).ok()
}

fn answer(mut asker: UnixStream, handle: &StopHandle) -> std::io::Result<()> {
    asker.set_write_timeout(Some(HOLDER_BOUND))?;
    let wanted = line(&mut asker, HOLDER_BOUND)?;
    if let Some(name) = wanted.strip_prefix("attach ") {
        return attach(asker, name, handle);
    }
    if wanted == "shared?" {
        return asker.write_all(if handle.guests().is_some() { b"shared\n" } else { b"alone\n" });
    }
    if wanted != "stop" {
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

/// Makes the asker a guest.
fn attach(mut asker: UnixStream, name: &str, handle: &StopHandle) -> std::io::Result<()> {
    let Some(welcome) = handle.guests().filter(|_| is_of_this_user(&asker)) else {
        return asker.write_all(b"alone\n");
    };
    welcome(asker, name.chars().filter(|c| !c.is_control()).collect())
}

/// The folder of the socket keeps other users out already; where the system does not say whose process it is, nothing more is known.
fn is_of_this_user(asker: &UnixStream) -> bool {
    rustix::net::sockopt::socket_peercred(asker).map_or(true, |peer| peer.uid == rustix::process::geteuid())
}

/// Asks the process that serves at `socket`; `None` if there is none, it does not answer in time, or it could not send.
pub(super) fn ask(socket: &Path, within: Duration) -> Option<Confirmation> {
    let mut holder = UnixStream::connect(socket).ok()?;
    holder.set_write_timeout(Some(within)).ok()?;
    holder.write_all(b"stop\n").ok()?;
    match line(&mut holder, within).ok()?.as_str() {
        "confirmed" => Some(Confirmation::Confirmed),
        "outputs alone" => Some(Confirmation::OutputsAlone),
        "sent" => Some(Confirmation::Missing),
        _ => None,
    }
}

/// Reads a line within this time, and nothing of what follows it.
pub(in crate::client) fn line(stream: &mut UnixStream, within: Duration) -> std::io::Result<String> {
    let (mut text, mut byte, until) = (Vec::new(), [0], Instant::now() + within);
    while text.len() < LONGEST_LINE {
        let left = until.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(std::io::ErrorKind::TimedOut.into());
        }
        stream.set_read_timeout(Some(left))?;
        if stream.read(&mut byte)? == 0 || byte[0] == b'\n' {
            break;
        }
        text.push(byte[0]);
    }
    stream.set_read_timeout(None)?;
    Ok(String::from_utf8_lossy(&text).trim_end().to_owned())
}
