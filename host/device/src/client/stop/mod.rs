//! The stop: all coils off, whatever else holds the port, within a bounded time.
//!
//! The frame is that of the frozen bootstrap set, so it needs no handshake and no common protocol version. It is sent at
//! once and repeated every 150 ms until the board confirms it or the time is up. Two ways lead to the board:
//!
//! - The process that holds the port sends it past whatever it is doing: [`hold`] makes a port that can do so, through a
//!   [`StopHandle`] within the process and through a Unix socket (`socket`) for other processes.
//! - Where no such process answers, [`stop_at`] opens the port without holding it exclusively and sends the frame itself.

mod shared;
mod socket;

use std::path::{Path, PathBuf};
use std::sync::mpsc::channel;
use std::thread;
use std::time::{Duration, Instant};

use darm_core::wire::bootstrap::Request;
use darm_core::wire::frame::{Header, MAX_FRAME, encode};

use crate::link::{self, LinkError};
pub use shared::{StopHandle, hold};

/// Every stop ends within this time, confirmed or not.
pub const STOP_BOUND: Duration = Duration::from_millis(900);
/// Part of it that a process which holds the port is given.
const HOLDER_BOUND: Duration = Duration::from_millis(400);
/// The frame is sent again after this time without a confirmation. The board gives up half a frame after 100 ms.
const REPEAT: Duration = Duration::from_millis(150);

/// What is known of a stop that was sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Confirmation {
    /// The board has answered: all coils are off.
    Confirmed,
    /// The frame was sent; no answer came in time.
    Missing,
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
    let asked = holder.and_then(|socket| socket::ask(socket, HOLDER_BOUND));
    if asked == Some(Confirmation::Confirmed) {
        return Ok(Confirmation::Confirmed);
    }
    let sent = link::open_shared(port).and_then(|link| {
        let (_link, handle) = hold(link, None);
        handle.stop(until.saturating_duration_since(Instant::now()))
    });
    // What the holder has sent was sent, even if a second frame could not be.
    sent.or_else(|error| asked.ok_or(error))
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
