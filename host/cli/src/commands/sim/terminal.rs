//! A pseudo terminal as the port of a simulated board.

use std::fs::File;
use std::io::{ErrorKind, Read as _, Write as _};
use std::os::unix::ffi::OsStringExt as _;
use std::path::PathBuf;

use rustix::fs::{Mode, OFlags, fcntl_getfl, fcntl_setfl, open};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

/// The board's end of a pseudo terminal.
pub(crate) struct Terminal {
    board_end: File,
    /// A program has the other end open.
    is_open: bool,
}

impl Terminal {
    /// A new one, and the path of its other end.
    pub(crate) fn new() -> std::io::Result<(Self, PathBuf)> {
        let board_end = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY)?;
        grantpt(&board_end)?;
        unlockpt(&board_end)?;
        let name = ptsname(&board_end, Vec::new())?.into_bytes();
        let path = PathBuf::from(std::ffi::OsString::from_vec(name));
        // Bytes pass as they are, without echo, also for a program that does not say so. The terminal keeps this when it is closed.
        let host_end = open(&path, OFlags::RDWR | OFlags::NOCTTY, Mode::empty())?;
        let mut settings = tcgetattr(&host_end)?;
        settings.make_raw();
        tcsetattr(&host_end, OptionalActions::Now, &settings)?;
        fcntl_setfl(&board_end, fcntl_getfl(&board_end)? | OFlags::NONBLOCK)?;
        Ok((Self { board_end: board_end.into(), is_open: false }, path))
    }

    /// What the program at the other end has sent; [`ErrorKind::WouldBlock`] where there is nothing or no program.
    pub(crate) fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        let received = self.board_end.read(bytes);
        // While no program has the other end open, Linux answers EIO.
        self.is_open = match &received {
            Ok(count) => *count > 0,
            Err(error) => error.kind() == ErrorKind::WouldBlock,
        };
        received.and_then(|count| if count > 0 { Ok(count) } else { Err(ErrorKind::WouldBlock.into()) }).map_err(
            |error| {
                if error.kind() == ErrorKind::Interrupted { error } else { ErrorKind::WouldBlock.into() }
            },
        )
    }

    /// Sends to the program at the other end. What nobody reads is lost, as on a cable.
    pub(crate) fn write(&mut self, bytes: &[u8]) {
        if self.is_open {
            let _ = self.board_end.write_all(bytes);
        }
    }
}
