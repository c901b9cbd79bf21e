//! Bytes through a file descriptor, never waiting longer than allowed.
//!
//! A readiness from `poll` does not promise bytes: another program may read them first. So the descriptor itself never
//! blocks either: sockets are asked not to wait call by call, anything else must be open with `O_NONBLOCK`.

use std::io;
use std::os::fd::BorrowedFd;
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use rustix::net::{RecvFlags, SendFlags};

/// Sends all bytes, or fails with [`io::ErrorKind::TimedOut`] at `until`.
pub(crate) fn send(fd: BorrowedFd<'_>, mut bytes: &[u8], until: Instant) -> io::Result<()> {
    while !bytes.is_empty() {
        match write(fd, bytes) {
            Ok(count) => bytes = &bytes[count..],
            Err(Errno::INTR) => {}
            Err(Errno::AGAIN) => {
                let left = until.saturating_duration_since(Instant::now());
                if left.is_zero() {
                    return Err(io::ErrorKind::TimedOut.into());
                }
                wait(fd, PollFlags::OUT, left)?;
            }
            Err(error) => return Err(error.into()),
        }
    }
    Ok(())
}

/// Waits for bytes, at most `timeout`: `None` when none came, 0 when the other end has closed.
pub(crate) fn receive(fd: BorrowedFd<'_>, buffer: &mut [u8], timeout: Duration) -> io::Result<Option<usize>> {
    wait(fd, PollFlags::IN, timeout)?;
    match read(fd, buffer) {
        Ok(count) => Ok(Some(count)),
        Err(Errno::AGAIN | Errno::INTR) => Ok(None),
        // A terminal whose other end is gone says that instead of an end of file.
        Err(Errno::IO) => Ok(Some(0)),
        Err(error) => Err(error.into()),
    }
}

fn wait(fd: BorrowedFd<'_>, events: PollFlags, timeout: Duration) -> io::Result<()> {
    let timeout = Timespec::try_from(timeout).map_err(io::Error::other)?;
    match poll(&mut [PollFd::from_borrowed_fd(fd, events)], Some(&timeout)) {
        Ok(_) | Err(Errno::INTR) => Ok(()),
        Err(error) => Err(error.into()),
    }
}

fn write(fd: BorrowedFd<'_>, bytes: &[u8]) -> rustix::io::Result<usize> {
    match rustix::net::send(fd, bytes, SendFlags::DONTWAIT | SendFlags::NOSIGNAL) {
        Err(Errno::NOTSOCK) => rustix::io::write(fd, bytes),
        sent => sent,
    }
}

fn read(fd: BorrowedFd<'_>, buffer: &mut [u8]) -> rustix::io::Result<usize> {
    match rustix::net::recv(fd, &mut *buffer, RecvFlags::DONTWAIT) {
        Err(Errno::NOTSOCK) => rustix::io::read(fd, buffer),
        received => received.map(|(count, _)| count),
    }
}
