//! The stop: all coils off, whatever else holds the port, within a bounded time.
//!
//! The frame is that of the frozen bootstrap set, so it needs no handshake and no common protocol version. It is sent at
//! once and repeated every 150 ms until the board confirms it or the time is up. Two ways lead to the board:
//!
//! - The process that holds the port sends it past whatever it is doing: [`hold`] makes a port that can do so, through a
//!   [`StopHandle`] within the process and through a Unix socket (`socket`) for other processes.
//! - Where no such process answers, [`stop_at`] opens the port without holding it exclusively and sends the frame itself. A socket
//!   serves one connection: a holder that is suspended there is continued first (`suspended`).

mod shared;
pub(super) mod socket;
mod suspended;

use std::path::{Path, PathBuf};
use std::sync::mpsc::channel;
use std::thread;
use std::time::{Duration, Instant};

use darm_core::wire::bootstrap::{Request, Servos, Stopped};
use darm_core::wire::frame::{Header, MAX_FRAME, encode};

use crate::link::{self, LinkError};
pub(super) use shared::lock;
pub use shared::{StopHandle, hold};
use suspended::Suspended;

/// Every stop ends within this time, confirmed or not.
pub const STOP_BOUND: Duration = Duration::from_millis(900);
/// Part of it that a process which holds the port is given.
const HOLDER_BOUND: Duration = Duration::from_millis(400);
/// The frame is sent again after this time without a confirmation. The board gives up half a frame after 100 ms.
const REPEAT: Duration = Duration::from_millis(150);

/// What is known of a stop that was sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Confirmation {
    /// The board has answered: all coils are off, and the servos have their orders where it has servos.
    Confirmed,
    /// The board has answered: all coils are off. It is held after crashes and does not control its servos.
    OutputsAlone,
    /// The frame was sent; no answer came in time.
    Missing,
}

impl Confirmation {
    /// What a confirmation of the board covers. Earlier firmware does not say what its servos do.
    pub fn of(stopped: Stopped) -> Self {
        match stopped.servos {
            Some(Servos::Uncontrolled) => Self::OutputsAlone,
            Some(Servos::Absent | Servos::Ordered) | None => Self::Confirmed,
        }
    }

    /// What is known of the outputs and the servos, and what to do where that is not enough.
    pub fn text(self) -> &'static str {
        match self {
            Self::Confirmed => "all coils are off",
            Self::OutputsAlone => {
                "all coils are off, but the servos are not controlled by this board now, which is held after crashes or has lost its \
                 profile: cut their supply"
            }
            Self::Missing => {
                "the stop was sent, but the board did not confirm it within 1 s; switch off the arm's supply"
            }
        }
    }
}

/// Stops the board at this port, within [`STOP_BOUND`]; `holder` is the socket of a process that may hold the port.
///
/// # Errors
///
/// The frame could not be sent: there is no such port, another program holds it exclusively, or it takes no bytes.
pub fn stop_at(port: &str, holder: Option<PathBuf>) -> Result<Confirmation, LinkError> {
    let until = Instant::now() + STOP_BOUND;
    let (answer, answered) = channel();
    let name = port.to_owned();
    // Opening a port, looking up a host or closing a port may take longer than any bound.
    thread::spawn(move || answer.send(stop_before(&name, holder.as_deref(), until)));
    let margin = REPEAT / 2;
    answered
        .recv_timeout(STOP_BOUND + margin)
        .unwrap_or_else(|_| Err(LinkError::Stalled { port: port.to_owned(), timeout_s: STOP_BOUND.as_secs_f64() }))
}

fn stop_before(port: &str, holder: Option<&Path>, until: Instant) -> Result<Confirmation, LinkError> {
    let suspended = holder.and_then(Suspended::holder_of);
    let asked = match (holder, &suspended) {
        (Some(socket), None) => socket::ask(socket, HOLDER_BOUND),
        // A serial port takes the frame of a second program; a socket serves the suspended one alone.
        (Some(socket), Some(suspended)) if is_socket(port) => suspended.ask(socket, HOLDER_BOUND),
        (Some(_), Some(_)) | (None, _) => None,
    };
    if let Some(confirmed @ (Confirmation::Confirmed | Confirmation::OutputsAlone)) = asked {
        return Ok(confirmed);
    }
    let sent = link::open_shared(port).and_then(|link| {
        let (_link, handle) = hold(link, None);
        handle.stop(until.saturating_duration_since(Instant::now()))
    });
    // It may have been suspended while it was asked.
    let suspended = suspended.or_else(|| holder.and_then(Suspended::holder_of));
    match (sent, asked, suspended) {
        (Ok(confirmed @ (Confirmation::Confirmed | Confirmation::OutputsAlone)), ..) => Ok(confirmed),
        // What the holder has sent was sent, even if a second frame could not be.
        (_, Some(asked), _) => Ok(asked),
        // Whether a socket has a listener for what waits in it is not known.
        (_, None, Some(suspended)) => Err(suspended.error(port)),
        (sent, None, None) => sent,
    }
}

fn is_socket(port: &str) -> bool {
    ["unix:", "tcp:"].iter().any(|kind| port.starts_with(kind))
}

/// Whether another process holds the port whose socket this is.
pub fn is_in_use(holder: &Path) -> bool {
    socket::is_served(holder)
}

/// Number of the process that holds the port whose socket this is; `None` if there is none, or the system does not say.
pub fn holder_process(holder: &Path) -> Option<u32> {
    socket::served_by(holder)
}

/// The stop's frame with this number.
fn stop_frame(number: u16) -> Vec<u8> {
    let header = Header { tag: Request::Stop.tag(), link: 0, number };
    let mut frame = [0; MAX_FRAME];
    match encode(header, Request::Stop.payload(), &mut frame) {
        Ok(len) => frame[..len].to_vec(),
        Err(error) => unreachable!("a frame without payload fits: {error}"),
    }
}
