//! The console task: bytes in, answers out, events kept. The same code is used on the chip and in a process on the PC.
//!
//! ```text
//!   port ──bytes──► scan ──bytes──► inbox ──► work ──► answers
//!                    │ a stop: counted at once, and what waits before it is dropped
//!                    └──► control tick
//! ```
//!
//! Two futures share the console. [`scan`] only receives: it knows every form of a stop (typed, the frame of the bootstrap set,
//! the message) whatever [`work`] is doing, and the control tick obeys within a millisecond. `work` does one thing after the other; while
//! one lasts a stop is answered at once, and what a typed command still has to print is dropped. Where a piece of work
//! takes long, `scan` runs at a higher priority; elsewhere [`serve`] runs both.
//!
//! A board in a process is built from the same parts as the image: a [`Shared`], a
//! [`Control`](crate::control::Control) that is ticked once a millisecond, [`serve`] on two byte pipes, and
//! [`crate::servo::Bus`] on two more. All futures are polled by hand while a [`Clock`] is moved.
use core::cell::Cell;
use core::future::{Future, poll_fn};
use core::pin::pin;
use core::task::Poll;

use darm_core::wire::bootstrap;
use darm_core::wire::scan::{Scanner, Stop};
use embassy_futures::select::{Either, Either4, select, select4};
use embassy_futures::yield_now;
use embassy_sync::blocking_mutex;
use embassy_sync::blocking_mutex::raw::{CriticalSectionRawMutex, NoopRawMutex};
use embassy_sync::mutex::Mutex;
use embassy_sync::signal::Signal;
use embedded_io_async::{ErrorType, Read, Write};
use embedded_storage_async::nor_flash::NorFlash;

use crate::clock::Clock;
use crate::control::Shared;
use crate::dispatch::Dispatcher;
use crate::pipe::Pipe;
use crate::port::{Item, Port};
use crate::scan;

/// Bytes that wait for `work`: three chunks of an upload.
const INBOX: usize = 1152;
/// No text has this byte, and a frame with one more is damaged.
const SPOILS: u8 = 0x15;
/// Bytes that `work` takes at once.
const PIECE: usize = 8;

/// What has been received and not yet looked at. [`scan`] fills it, at the priority of [`work`] or a higher one.
pub struct Inbox {
    bytes: Pipe<INBOX>,
    stop: Signal<CriticalSectionRawMutex, Stop>,
    /// While `work` takes bytes no stop comes in between.
    taking: blocking_mutex::Mutex<CriticalSectionRawMutex, ()>,
}

impl Inbox {
    /// Nothing received.
    pub const fn new() -> Self {
        Self { bytes: Pipe::new(), stop: Signal::new(), taking: blocking_mutex::Mutex::new(()) }
    }

    /// Waits for bytes that came after every stop: where one is not yet answered, for its answer.
    async fn read(&self, bytes: &mut [u8; PIECE], shared: &Shared<'_>) -> usize {
        let mut read = pin!(self.bytes.read(bytes));
        poll_fn(|context| {
            self.taking.lock(|()| if self.is_stopped(shared) { Poll::Pending } else { read.as_mut().poll(context) })
        })
        .await
    }

    /// Whether a stop has come, or the emergency stop was pressed, and nobody has dropped what was received before.
    fn is_stopped(&self, shared: &Shared<'_>) -> bool {
        self.stop.signaled() || shared.pressed.signaled()
    }

    /// Waits for a stop, which is to be answered, or for the emergency stop, which nobody has sent. What was received before it is gone
    /// then.
    async fn stopped(&self, shared: &Shared<'_>) -> Option<Stop> {
        match select(self.stop.wait(), shared.pressed.wait()).await {
            Either::First(stop) => Some(stop),
            Either::Second(()) => {
                // Byte by byte: no interrupt waits for all of them.
                while self.taking.lock(|()| self.bytes.pop()).is_some() {}
                None
            }
        }
    }
}

impl Default for Inbox {
    fn default() -> Self {
        Self::new()
    }
}

/// Serves the console until somebody asks for a restart; what the board is to start into.
pub async fn serve<F: NorFlash, C: Clock + Copy>(
    dispatcher: &mut Dispatcher<'_, '_, F, C>,
    reader: &mut impl Read,
    writer: &mut impl Write,
) -> bootstrap::RebootTarget {
    let inbox = Inbox::new();
    let shared = dispatcher.shared;
    match select(scan(&inbox, shared, reader), work(&inbox, dispatcher, writer)).await {
        Either::First(never) => never,
        Either::Second(into) => into,
    }
}

/// Receives. What does not fit the inbox is lost with its line or frame, and its sender asks again; a stop never is.
pub async fn scan(inbox: &Inbox, shared: &Shared<'_>, reader: &mut impl Read) -> ! {
    let mut scanner = Scanner::default();
    let mut bytes = [0; 64];
    let mut is_lossy = false;
    loop {
        let n = reader.read(&mut bytes).await.unwrap_or_else(|_| {
            is_lossy = true;
            0
        });
        for &byte in bytes.iter().take(n) {
            match scanner.push(byte) {
                Some(stop) => {
                    shared.stop();
                    while inbox.bytes.pop().is_some() {}
                    inbox.stop.signal(stop);
                }
                None => {
                    // The line in which bytes were lost is none, nor the one that they would join to it.
                    is_lossy = is_lossy && inbox.bytes.push_slice(&[SPOILS]) == 0;
                    is_lossy |= inbox.bytes.push_slice(&[byte]) == 0;
                }
            }
        }
        if n == 0 {
            yield_now().await;
        }
    }
}

/// Does what comes, one thing after the other, until somebody asks for a restart; into what.
pub async fn work<F: NorFlash, C: Clock + Copy>(
    inbox: &Inbox,
    dispatcher: &mut Dispatcher<'_, '_, F, C>,
    writer: &mut impl Write,
) -> bootstrap::RebootTarget {
    let clock = dispatcher.clock;
    let out = Out { writer: Mutex::new(writer), clock, is_cut: Cell::new(false), cut: Signal::new() };
    let mut port: Port = Port::default();
    let mut bytes = [0; PIECE];
    loop {
        // All futures may be dropped half-way: none takes anything before it is ready.
        let shared = dispatcher.shared;
        match select4(inbox.stopped(shared), inbox.read(&mut bytes, shared), shared.events.next(), dispatcher.seek())
            .await
        {
            Either4::First(stop) => {
                port = Port::default();
                if let Some(stop) = stop {
                    out.confirm(stop, shared).await;
                }
            }
            Either4::Second(n) => {
                for &byte in bytes.iter().take(n) {
                    // What was received before a stop is not done after it: one that comes from here on refuses it.
                    dispatcher.begin_item();
                    if inbox.is_stopped(shared) {
                        break;
                    }
                    let Some(item) = port.push(byte, dispatcher.clock.now()) else { continue };
                    let mut stopped = take(inbox, dispatcher, item, &out).await;
                    if dispatcher.has_restart() {
                        // Whether the answer leaves or not, the board restarts; a stop that comes until then drops that too.
                        let _ = out.writer.lock().await.flush().await;
                        stopped |= inbox.is_stopped(shared);
                    }
                    if let Some(into) = dispatcher.restart_due(stopped) {
                        return into;
                    }
                    if stopped {
                        port = Port::default();
                        break;
                    }
                }
            }
            Either4::Third(event) => dispatcher.note(event),
            Either4::Fourth(answer) => out.send(&answer).await,
        }
    }
}

/// Does one thing; true when a stop came meanwhile, which drops what was received before it.
async fn take<F: NorFlash, C: Clock, K: Clock, W: Write>(
    inbox: &Inbox,
    dispatcher: &mut Dispatcher<'_, '_, F, C>,
    item: Item<'_>,
    out: &Out<'_, W, K>,
) -> bool {
    let shared = dispatcher.shared;
    match item {
        Item::Frame(encoded) => {
            let (answer, stopped) = watch(inbox, shared, out, dispatcher.answer(encoded)).await;
            if let Some(answer) = answer {
                out.send(&answer).await;
            }
            stopped
        }
        Item::Line(line) => watch(inbox, shared, out, dispatcher.execute(line, &mut &*out)).await.1,
        Item::Dropped => {
            dispatcher.note_bad();
            false
        }
    }
}

/// Waits for the end of a piece of work, and meanwhile answers stops; whether one came.
async fn watch<T, K: Clock, W: Write>(
    inbox: &Inbox,
    shared: &Shared<'_>,
    out: &Out<'_, W, K>,
    work: impl Future<Output = T>,
) -> (T, bool) {
    let mut work = pin!(work);
    let mut stopped = false;
    let done = loop {
        let stop = match select(&mut work, inbox.stopped(shared)).await {
            Either::First(done) => break done,
            Either::Second(stop) => stop,
        };
        stopped = true;
        out.is_cut.set(true);
        out.cut.signal(());
        let Some(stop) = stop else { continue };
        let mut confirmed = pin!(out.confirm(stop, shared));
        if let Either::First(done) = select(&mut work, &mut confirmed).await {
            confirmed.await;
            break done;
        }
    };
    out.is_cut.set(false);
    out.cut.reset();
    (done, stopped)
}

/// The way out, which a stop takes from the work that prints.
struct Out<'w, W, K> {
    writer: Mutex<NoopRawMutex, &'w mut W>,
    clock: K,
    /// What the work still has to print is dropped.
    is_cut: Cell<bool>,
    cut: Signal<NoopRawMutex, ()>,
}

impl<W: Write, K: Clock> Out<'_, W, K> {
    /// Waits until the outputs are off and the servos have their orders, then says so.
    async fn confirm(&self, stop: Stop, shared: &Shared<'_>) {
        let confirmation = scan::obeyed(stop, shared, || self.clock.now()).await;
        self.send(&confirmation).await;
    }

    /// A writer that fails has no reader, so there is nowhere to report it.
    async fn send(&self, bytes: &[u8]) {
        let _ = self.writer.lock().await.write_all(bytes).await;
    }
}

impl<W: Write, K> ErrorType for &Out<'_, W, K> {
    type Error = W::Error;
}

impl<W: Write, K> Write for &Out<'_, W, K> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, W::Error> {
        if self.is_cut.get() {
            return Ok(bytes.len());
        }
        let write = async { self.writer.lock().await.write(bytes).await };
        match select(self.cut.wait(), write).await {
            Either::First(()) => Ok(bytes.len()),
            Either::Second(written) => written,
        }
    }

    async fn flush(&mut self) -> Result<(), W::Error> {
        Ok(())
    }
}
