//! The host's end of the console, in the thread of the world.

use std::cell::RefCell;
use std::time::Duration;

use darm_device::link::{Link, LinkError};

use super::{Party, World};

thread_local! {
    static WORLD: RefCell<Option<World>> = const { RefCell::new(None) };
}

/// Puts a world beside this thread's client.
pub fn enter(world: World) {
    WORLD.with_borrow_mut(|slot| *slot = Some(world));
}

/// Takes the world away again.
pub fn leave() -> Option<World> {
    WORLD.with_borrow_mut(Option::take)
}

/// Does something with the world of this thread.
///
/// # Panics
///
/// This thread has no world: none was [entered](enter).
pub fn with<T>(act: impl FnOnce(&mut World) -> T) -> T {
    WORLD.with_borrow_mut(|world| act(world.as_mut().expect("a client runs only beside a world")))
}

/// Lets so much time pass.
pub fn pass(span_ms: u64) {
    with(|world| {
        let end_ns = world.now_ns() + span_ms * 1_000_000;
        while world.now_ns() < end_ns {
            world.step();
        }
    });
}

/// The host's end of the console.
pub struct Plug(u32);

impl Plug {
    /// A new host's.
    pub fn new() -> Self {
        Self(with(World::plug_in))
    }

    fn closed(&self) -> LinkError {
        LinkError::Closed { port: self.name().to_owned() }
    }
}

impl Default for Plug {
    fn default() -> Self {
        Self::new()
    }
}

impl Link for Plug {
    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        let sent = with(|world| (!world.is_closed(self.0)).then(|| world.on_sent(Party::First, bytes)));
        sent.ok_or_else(|| self.closed())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, LinkError> {
        let received = with(|world| {
            let end_ns = world.now_ns() + timeout.as_nanos() as u64;
            while world.inbox.is_empty() && world.now_ns() < end_ns && !world.is_closed(self.0) {
                world.step();
            }
            (!world.is_closed(self.0)).then(|| {
                let count = buffer.len().min(world.inbox.len());
                buffer.iter_mut().zip(world.inbox.drain(..count)).for_each(|(slot, byte)| *slot = byte);
                count
            })
        });
        received.ok_or_else(|| self.closed())
    }

    fn now_s(&self) -> f64 {
        with(|world| world.bench.now_s())
    }

    fn name(&self) -> &str {
        "simulation"
    }
}
