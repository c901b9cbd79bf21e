//! The protocol between host and board.
//!
//! # Frames
//!
//! A frame on the line is `00 COBS(body) 00`; what is outside frames is text. A body is
//!
//! | bytes     | field     | meaning                                                                  |
//! |-----------|-----------|--------------------------------------------------------------------------|
//! | 1         | `tag`     | what the payload is, see below                                           |
//! | 4, LE     | `link`    | random number of the host's connection; 0 in the bootstrap set           |
//! | 2, LE     | `number`  | counts the requests of a connection; an answer repeats it                |
//! | 0 to 300  | `payload` |                                                                          |
//! | 4, LE     | `crc`     | CRC-32 (ISO HDLC) of all bytes before it                                 |
//!
//! A body that is damaged, too long or of unknown tag is dropped and counted: the board never answers what it cannot read.
//!
//! # Tags
//!
//! | request | answer | set                                        | payload                              |
//! |---------|--------|--------------------------------------------|--------------------------------------|
//! | 01..05  | 81..85 | bootstrap: never changes, [`bootstrap`]    | fixed bytes                          |
//! | 10      | 90     | protocol version [`PROTOCOL`], [`message`] | postcard of [`message::Request`], [`message::Reply`] |
//!
//! # Exactly once
//!
//! A host opens a connection with `Hello` under a new random `link`, with the board's last challenge: a `Hello` without it is refused
//! with the challenge. A request that changes something runs once: when its
//! `number` comes again the board repeats the answer; an older one is dropped. Requests that only ask, and the chunks of
//! an upload, which carry their offset, run as often as they come.
//!
//! After a stop (of the bootstrap set, or typed) the board takes no command on a connection from before it: its first copy
//! may have been lost, and the next one must not undo the stop. The host says `Hello` under a new `link`.
#![cfg_attr(not(test), deny(clippy::indexing_slicing, clippy::arithmetic_side_effects, clippy::unwrap_used))]

pub mod bootstrap;
pub mod caps;
pub mod frame;
pub mod health;
pub mod inputs;
pub mod message;
pub mod scan;

/// Version of the messages under tag 10. A host of another version can still use the bootstrap set.
///
/// Whatever changes the bytes of a message raises it, a new variant of a fault too: a host that does not know one cannot read the
/// status of the board.
pub const PROTOCOL: u16 = 5;
