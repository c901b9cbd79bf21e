//! Upload of a table: a few chunks under way at a time, resumed where the board says.
//!
//! The board takes only the chunk that it waits for and answers every chunk with the offset that it wants next. So the
//! host needs no account of single chunks: it sends ahead up to [`WINDOW`], and when an answer shows a gap, or no answer
//! comes, it goes back to the wanted offset.

use std::collections::VecDeque;

use darm_arm::image::UploadImage;
use darm_core::wire::message::{Answer, CHUNK, Refusal, Request};

use super::exchange::PATIENCE_S;
use super::{AnswerError, Client, ClientError};

/// Chunks under way: together they fit the board's receive buffer of 1 KiB.
const WINDOW: usize = 3;
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

/// A chunk under way.
struct Sent {
    number: u16,
    offset: u32,
    at_s: f64,
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
            Err(ClientError::Refused(Refusal::NotConnected)) if restarts < RESTARTS => drop(client.say_hello()?),
            Err(ClientError::Refused(Refusal::NoUpload | Refusal::Damaged)) if restarts < RESTARTS => {}
            end => return end,
        }
        restarts += 1;
    }
}

fn attempt(client: &mut Client, image: &UploadImage, progress: &mut dyn FnMut(Progress)) -> Result<u16, ClientError> {
    let next = wanted(&client.exchange.ask("begin", &Request::Begin(image.image()))?)?;
    send_chunks(client, image, next, progress)?;
    match client.exchange.ask("commit", &Request::Commit(image.image()))? {
        Answer::Committed { rows } => Ok(rows),
        // A profile has none.
        Answer::Done => Ok(0),
        _ => Err(AnswerError::Payload { request: "commit" }.into()),
    }
}

/// Sends from offset `next` on until the board has all.
fn send_chunks(
    client: &mut Client,
    image: &UploadImage,
    mut next: u32,
    progress: &mut dyn FnMut(Progress),
) -> Result<(), ClientError> {
    let total = image.image().len;
    let damaged_before = client.counts().damaged;
    let mut ahead = next;
    let mut under_way: VecDeque<Sent> = VecDeque::new();
    let (mut heard_s, mut attempts) = (client.now_s(), 0);
    progress(Progress { done: next, total });
    while next < total {
        while under_way.len() < WINDOW && ahead < total {
            under_way.push_back(send_chunk(client, image, ahead, attempts > 0)?);
            ahead = (ahead + CHUNK as u32).min(total);
        }
        match next_answer(client, &mut under_way)? {
            Some(answer) => {
                (attempts, heard_s) = (0, client.now_s());
                if answer.wanted > next {
                    progress(Progress { done: answer.wanted, total });
                }
                next = answer.wanted;
                if answer.gap {
                    under_way.clear();
                    ahead = next;
                }
                ahead = ahead.max(next);
            }
            None => {
                attempts += 1;
                let waited_s = client.now_s() - heard_s;
                if waited_s > PATIENCE_S {
                    return Err(client.exchange.silence(attempts, waited_s, damaged_before));
                }
                under_way.clear();
                ahead = next;
            }
        }
    }
    Ok(())
}

fn send_chunk(client: &mut Client, image: &UploadImage, offset: u32, again: bool) -> Result<Sent, ClientError> {
    let rest = &image.bytes()[offset as usize..];
    let bytes = &rest[..rest.len().min(CHUNK)];
    let (header, frame) = client.exchange.prepare(&Request::Chunk { offset, bytes })?;
    let at_s = client.now_s();
    client.exchange.send(&frame, again)?;
    Ok(Sent { number: header.number, offset, at_s })
}

/// An answer to a chunk.
struct Wanted {
    /// The offset that the board wants next.
    wanted: u32,
    /// The chunk came ahead of the wanted one and was not taken: the ones between are lost, and so are those behind.
    gap: bool,
}

/// The next answer to a chunk, if one comes in time. Chunks that were sent before it and have no answer have lost theirs.
fn next_answer(client: &mut Client, under_way: &mut VecDeque<Sent>) -> Result<Option<Wanted>, ClientError> {
    let end_s = client.now_s() + client.exchange.retry_timer().wait_s();
    while let Some(arrival) = client.exchange.next_reply(end_s)? {
        let Some(at) = under_way.iter().position(|sent| sent.number == arrival.number) else {
            continue;
        };
        if let Some(sent) = under_way.drain(..=at).next_back() {
            let wanted = wanted(&client.exchange.open("chunk", &arrival, sent.at_s)?)?;
            client.exchange.retry_timer().on_answer(arrival.received_s - sent.at_s);
            return Ok(Some(Wanted { wanted, gap: sent.offset > wanted }));
        }
    }
    client.exchange.retry_timer().on_silence();
    Ok(None)
}

fn wanted(answer: &Answer) -> Result<u32, ClientError> {
    match answer {
        Answer::Upload { next } => Ok(*next),
        _ => Err(AnswerError::Payload { request: "upload" }.into()),
    }
}
