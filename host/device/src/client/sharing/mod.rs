//! One port, many programs: the process that has a port speaks to the board for all that come later.
//!
//! ```text
//!  darm record ──┐                            ┌──────────── holder of the port ────────────┐
//!  (a guest)     │  socket of the port        │  session of each guest                     │
//!  darm console ─┼──────────────────────────► │  frame ─ rights? ─┐                        │
//!  (a guest)     │  frames and lines of text  │  line ── rights? ─┼─► line, one exchange ──┼──► board
//!  darm stop ────┘                            │  own client ──────┘   at a time            │
//!                                             │  stop ─────────────────── past the line ───┼──► board
//!                                             └────────────────────────────────────────────┘
//! ```
//!
//! A guest's [`Client`](super::Client) has the socket as its link and speaks to it as to a board ([`attach`]). The holder takes its
//! frames apart, asks the board under its own numbers, and gives the answers back under the guest's.
//!
//! - **Reading** is free for everybody. What changes something needs control, which one program or page has: [`Rights`] decides. A list
//!   names the requests and the typed lines that read; whatever else comes is taken for a change.
//! - **A stop** of anybody needs no control and waits for nothing. It ends the connection of everybody: whoever says `Hello` first
//!   opens another one, and the others are told that theirs has ended. A guest changes something only on the connection, and with the
//!   stored table, that its own last `Hello` has seen.
//! - A guest that is not allowed to change something is answered by the holder with [`DENIED`] and a sentence.
//!
//! The way to attach is one line each: `attach NAME`, with the command for people; `attached`, or `alone` where the holder does not
//! share.

mod guest;
mod session;

use std::sync::{Arc, Weak};

use darm_core::wire::message::Request;

use super::line::Line;
pub use guest::{attach, is_shared};
pub(super) use session::serve;

/// Tag of the holder's answer to a request that the guest has no right to; its payload is a sentence. No board sends it.
pub(super) const DENIED: u8 = 0xF0;

/// A program that uses the port of another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Guest {
    /// A random number that no other guest has, and that nobody else learns: who shows it is this guest.
    pub key: u64,
    /// What people call it: its command.
    pub name: String,
}

/// Who may do what at a shared port. The functions are called by a thread of each guest.
pub trait Rights: Send + Sync {
    /// The guest is there.
    fn arrive(&self, guest: &Guest);

    /// The guest is there still; called once a second at least.
    fn stay(&self, guest: &Guest);

    /// Gives control to a guest that is about to change something, or says who has it.
    ///
    /// # Errors
    ///
    /// Who has control, and what to do, as a sentence.
    fn take_control(&self, guest: &Guest) -> Result<(), String>;

    /// The guest has gone, with its control where it had it.
    fn leave(&self, guest: &Guest);
}

/// What the port of a process gives to guests.
#[derive(Clone)]
pub(super) struct Sharing {
    /// Ends with the client.
    pub(super) line: Weak<Line>,
    pub(super) rights: Arc<dyn Rights>,
}

/// Whether a request changes something on the board, or may.
pub(super) fn is_change(request: &Request<'_>) -> bool {
    match request {
        Request::Hello { .. }
        | Request::Status
        | Request::Events { .. }
        | Request::Calibration
        | Request::Nearest(_)
        | Request::Outputs { .. }
        | Request::Health
        | Request::PastEvents { .. }
        | Request::PastCrash { .. }
        | Request::Inputs { .. } => false,
        Request::Begin(_)
        | Request::Chunk { .. }
        | Request::Commit(_)
        | Request::Command(_)
        | Request::Calibrate(_) => true,
    }
}

/// The sentence of a [`DENIED`] answer.
pub(super) fn reason(payload: &[u8]) -> String {
    String::from_utf8_lossy(payload).into_owned()
}

#[cfg(test)]
mod tests;
