//! The console task: bytes in, answers out, events kept. The same code runs on the chip and in a process on the PC.
//!
//! A board in a process is built from the same parts as the image: a [`Shared`](crate::control::Shared), a
//! [`Control`](crate::control::Control) that is ticked once a millisecond, [`serve`] on two byte pipes, and
//! [`crate::servo::Bus`] on two more. All futures are polled by hand while a [`Clock`] is moved.
use darm_core::wire::bootstrap;
use embassy_futures::select::{Either3, select3};
use embedded_io_async::{Read, Write};
use embedded_storage_async::nor_flash::NorFlash;

use crate::clock::Clock;
use crate::dispatch::Desk;
use crate::port::{Item, Port};

/// Serves the console until somebody asks for a restart; what the board is to start into.
pub async fn serve<F: NorFlash, C: Clock>(
    desk: &mut Desk<'_, '_, F, C>,
    reader: &mut impl Read,
    writer: &mut impl Write,
) -> bootstrap::Into {
    let mut port = Port::default();
    let mut bytes = [0; 64];
    loop {
        // All futures may be dropped half-way: none takes anything before it is ready.
        let shared = desk.shared;
        let received = match select3(reader.read(&mut bytes), shared.events.next(), desk.seek()).await {
            Either3::First(Ok(n)) => bytes.get(..n).unwrap_or_default(),
            Either3::First(Err(_)) => &[],
            Either3::Second(event) => {
                desk.note(event);
                &[]
            }
            Either3::Third(answer) => {
                let _ = writer.write_all(&answer).await;
                &[]
            }
        };
        for &byte in received {
            let now = desk.clock.now();
            if let Some(item) = port.push(byte, now) {
                take(desk, item, writer).await;
            }
            if let Some(into) = desk.reboot.take() {
                // Whether the answer leaves or not, the board starts anew.
                let _ = writer.flush().await;
                return into;
            }
        }
    }
}

/// A writer that fails has nobody behind it: there is nobody to tell.
async fn take<F: NorFlash, C: Clock>(desk: &mut Desk<'_, '_, F, C>, item: Item<'_>, writer: &mut impl Write) {
    match item {
        Item::Frame(encoded) => {
            if let Some(answer) = desk.answer(encoded).await {
                let _ = writer.write_all(&answer).await;
            }
        }
        Item::Line(line) => {
            let _ = desk.obey(line, writer).await;
        }
        Item::Dropped => desk.note_bad(),
    }
}
