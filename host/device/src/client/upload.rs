//! Upload of a table: a few chunks under way at a time, resumed where the board says.
//!
//! The board answers every chunk with the offset that it wants next; [`Window`] decides from the answers what is sent.

mod window;

use std::sync::Arc;

use darm_arm::image::UploadImage;
use darm_core::sequencer::CommandError;
use darm_core::wire::message::Refusal;

use super::exchange::{Exchange, PATIENCE_S};
use super::{Client, ClientError, question};
use window::{Piece, Window};

/// An upload that the board has forgotten or found damaged starts again this many times.
const RESTARTS: u32 = 8;

/// How far an upload is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Bytes that the board has.
    pub done: u32,
    /// Bytes of the table.
    pub total: u32,
}

/// See [`Client::upload`].
pub(super) fn upload(
    client: &mut Client,
    image: &UploadImage,
    progress: &mut dyn FnMut(Progress),
) -> Result<u16, ClientError> {
    let mut restarts = 0;
    loop {
        match attempt(client, image, progress) {
            // What follows the upload would act after the stop.
            Err(ClientError::Refused(Refusal::NotConnected)) if client.exchange().is_stopped() => {
                return Err(ClientError::Refused(Refusal::Command(CommandError::Stopped)));
            }
            Err(ClientError::Refused(Refusal::NotConnected)) if restarts < RESTARTS => drop(client.say_hello()?),
            Err(ClientError::Refused(Refusal::NoUpload | Refusal::Damaged)) if restarts < RESTARTS => {}
            end => return end,
        }
        restarts += 1;
    }
}

fn attempt(client: &mut Client, image: &UploadImage, progress: &mut dyn FnMut(Progress)) -> Result<u16, ClientError> {
    let next = client.ask(&question::begin(image.image()))?;
    send_chunks(client, image, next, progress)?;
    client.ask(&question::commit(image.image()))
}

/// Sends from offset `next` on until the board has all. The line is this client's in between: an answer to a chunk may come at any
/// time.
fn send_chunks(
    client: &mut Client,
    image: &UploadImage,
    next: u32,
    progress: &mut dyn FnMut(Progress),
) -> Result<(), ClientError> {
    let line = Arc::clone(&client.line);
    let mut exchange = line.take();
    let total = image.image().len;
    let damaged_before = exchange.counts().damaged;
    let mut window = Window::new(next, total);
    let (mut heard_s, mut attempts) = (exchange.link().now_s(), 0);
    progress(Progress { done: next, total });
    while !window.is_complete() {
        while let Some(piece) = window.next() {
            send_piece(&mut exchange, image, &mut window, piece)?;
        }
        let before = window.wanted();
        if hear_answer(client, &mut exchange, &mut window)? {
            (attempts, heard_s) = (0, exchange.link().now_s());
        } else {
            attempts += 1;
            let waited_s = exchange.link().now_s() - heard_s;
            if waited_s > PATIENCE_S {
                return Err(exchange.silence(attempts, waited_s, damaged_before));
            }
        }
        if window.wanted() > before {
            progress(Progress { done: window.wanted(), total });
        }
    }
    Ok(())
}

fn send_piece(
    exchange: &mut Exchange,
    image: &UploadImage,
    window: &mut Window,
    piece: Piece,
) -> Result<(), ClientError> {
    let Piece { offset, len, again } = piece;
    let bytes = &image.bytes()[offset as usize..(offset + len) as usize];
    let (header, frame) = exchange.prepare(&question::chunk(offset, bytes).request)?;
    window.on_sent(piece, header.number, exchange.link().now_s());
    exchange.send(&frame, again)
}

/// Waits for the next answer to a piece; whether one came in time.
fn hear_answer(client: &mut Client, exchange: &mut Exchange, window: &mut Window) -> Result<bool, ClientError> {
    let end_s = exchange.link().now_s() + exchange.retry_timer().wait_s();
    while let Some(arrival) = exchange.next_reply(end_s)? {
        let Some(sent_s) = window.sent_s(arrival.number) else { continue };
        let wanted = client.read(&question::chunk(0, &[]), &arrival, sent_s)?;
        exchange.retry_timer().on_answer(arrival.received_s - sent_s);
        window.on_answer(arrival.number, wanted);
        return Ok(true);
    }
    exchange.retry_timer().on_silence();
    window.on_silence();
    Ok(false)
}
