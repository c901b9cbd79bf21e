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
//!   opens another one, and the others learn that theirs has ended. A guest changes something only on the connection, and with the
//!   stored table, that its own last `Hello` has seen.
//! - A guest that is not allowed to change something is answered by the holder with a sentence ([`ClientError::Denied`](super::ClientError::Denied)).
//!
//! The way to attach is one line each: `attach NAME`, with the command for people; `attached`, `alone` where the holder does not
//! share, or `full` where [`MAX_GUESTS`] are there.

mod guest;
mod line_kind;
mod session;

use std::io::Write as _;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Weak};
use std::thread;

use super::line::Line;
use super::stop::{StopHandle, socket};
pub use guest::{attach, is_shared};
pub use line_kind::{LineKind, NoLine};

/// Most guests at once. Each has two threads and two descriptors of the holder: a process has 1024 descriptors by default, of which a
/// server needs some 500 for its pages, and a stop of another program needs one.
pub const MAX_GUESTS: usize = 32;

/// A program that uses the port of another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Guest {
    /// A random number that no other guest has, and that nobody else learns: who shows it is this guest.
    pub key: u64,
    /// What people call it: its command.
    pub name: String,
    /// Number of its process, where the system says it.
    pub process: Option<u32>,
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

/// What a session of a guest uses.
#[derive(Clone)]
struct Sharing {
    /// Ends with the client.
    line: Weak<Line>,
    rights: Arc<dyn Rights>,
}

/// Gives the line to guests that come to the socket of the port from now on.
pub(super) fn share(line: &Arc<Line>, handle: &StopHandle, rights: Arc<dyn Rights>) {
    let (sharing, counted) = (Sharing { line: Arc::downgrade(line), rights }, handle.clone());
    line.set_handle(handle.clone());
    line.take().count_stops_by(Box::new(move || counted.stops()));
    let taken = Arc::default();
    handle.welcome_guests(Arc::new(move |mut stream, name| {
        let Some(place) = Place::take(&taken) else { return stream.write_all(b"full\n") };
        stream.write_all(b"attached\n")?;
        let guest = Guest { key: rand::random(), name, process: socket::process_of(&stream) };
        let sharing = sharing.clone();
        thread::spawn(move || {
            session::serve(stream, guest, sharing);
            drop(place);
        });
        Ok(())
    }));
}

/// The place of a guest, which is free again when this is dropped.
struct Place(Arc<AtomicUsize>);

impl Place {
    fn take(taken: &Arc<AtomicUsize>) -> Option<Self> {
        let before = taken.fetch_add(1, Ordering::AcqRel);
        let place = Self(Arc::clone(taken));
        (before < MAX_GUESTS).then_some(place)
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::AcqRel);
    }
}

#[cfg(test)]
mod tests;
