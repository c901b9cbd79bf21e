//! Exit codes, and the one sentence that a failed command prints.
//!
//! | code | meaning                                                                   |
//! |------|---------------------------------------------------------------------------|
//! | 0    | done                                                                      |
//! | 1    | failed: a file cannot be read, a synthesis has no solution, …             |
//! | 2    | the command line makes no sense                                           |
//! | 3    | the board understood and refused, or its safe state is latched            |
//! | 4    | no connection to a board, or it was lost before the answer: nobody knows  |
//! |      | whether the board has acted; of a stop: it could not be sent              |
//! | 5    | the board did not confirm a stop within 1 s                               |
//! | 6    | interrupted by Ctrl-C or SIGTERM; the board confirmed the stop            |
//! | 7    | unfinished: another program stopped the arm before the end of its program |

use std::error::Error;
use std::fmt;

use darm_device::client::ClientError;
use darm_device::client::stop::Confirmation;
use darm_device::link::LinkError;
use serde_json::json;

use crate::interrupt::Interrupted;
use crate::port::PortError;

/// Something failed that is not one of the other kinds.
const FAILED: u8 = 1;
/// The command line makes no sense; clap uses the same number.
const USAGE: u8 = 2;
/// The board said no.
const REFUSED: u8 = 3;
/// The board was not reached.
const NO_CONNECTION: u8 = 4;
/// A stop was not confirmed.
const UNCONFIRMED: u8 = 5;
/// Interrupted, and stopped.
const INTERRUPTED: u8 = 6;
/// Stopped by another program before its end.
const UNFINISHED: u8 = 7;

/// A word, a number or a combination of options that makes no sense.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct Usage(pub(crate) String);

/// The board has latched its safe state.
#[derive(Debug, thiserror::Error)]
#[error("the board is in its safe state: {0}; mend the cause, then `darm stop --clear`")]
pub(crate) struct Safe(pub(crate) String);

/// A program or recording that is not complete although nothing failed.
#[derive(Clone, Debug, thiserror::Error)]
pub(crate) enum Unfinished {
    /// The arm was stopped meanwhile.
    #[error(
        "the program was stopped by another program before its end: {done} of {all} {what}; find out who stopped the arm, \
         then run it again"
    )]
    Stopped {
        /// How many rows or visits were done.
        done: usize,
        /// How many there are.
        all: usize,
        /// What is counted.
        what: &'static str,
    },
    /// A recording was resumed when its program was over.
    #[error(
        "the program was over before the recording was resumed: {done} of {all} visits measured; record it again into \
         another file"
    )]
    Over {
        /// How many visits were measured.
        done: usize,
        /// How many there are.
        all: usize,
    },
}

/// The board did not confirm a stop: nobody knows whether it arrived.
#[derive(Debug)]
pub(crate) struct Unconfirmed {
    /// The port.
    pub(crate) port: String,
}

impl fmt::Display for Unconfirmed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let port = &self.port;
        if is_socket(port) {
            return write!(
                f,
                "the board did not confirm the stop at {port} within 1 s; switch the arm's supply off. A socket serves one \
                 connection: another program that holds it, and is not `darm`, keeps the stop from the board; end it"
            );
        }
        write!(
            f,
            "the stop was sent to {port}, but the board did not confirm it within 1 s; switch the arm's supply off, then \
             check cable, board and whether another program reads the port"
        )
    }
}

impl Error for Unconfirmed {}

/// Whether a port is a socket, which takes bytes that nobody reads while it serves another connection.
fn is_socket(port: &str) -> bool {
    port.starts_with("unix:") || port.starts_with("tcp:")
}

/// The exit code of an error: that of the first cause that has one of its own.
pub(crate) fn code(error: &anyhow::Error) -> u8 {
    error.chain().find_map(code_of_cause).unwrap_or(FAILED)
}

fn code_of_cause(cause: &(dyn Error + 'static)) -> Option<u8> {
    if let Some(error) = cause.downcast_ref::<ClientError>() {
        return Some(match error {
            ClientError::Refused(_) => REFUSED,
            ClientError::Transport(_) => NO_CONNECTION,
            ClientError::Frame(_) => FAILED,
        });
    }
    if let Some(Interrupted(stopped)) = cause.downcast_ref::<Interrupted>() {
        return Some(match stopped {
            Ok(Confirmation::Confirmed) => INTERRUPTED,
            Ok(Confirmation::Missing) => UNCONFIRMED,
            Err(_) => NO_CONNECTION,
        });
    }
    if cause.is::<Unconfirmed>() {
        Some(UNCONFIRMED)
    } else if cause.is::<Unfinished>() {
        Some(UNFINISHED)
    } else if cause.is::<Usage>() {
        Some(USAGE)
    } else if cause.is::<Safe>() {
        Some(REFUSED)
    } else if cause.is::<LinkError>() || cause.is::<PortError>() {
        Some(NO_CONNECTION)
    } else {
        None
    }
}

/// One sentence without full stop: what, where, what to do.
pub(crate) fn sentence(error: &anyhow::Error) -> String {
    let mut sentence = String::new();
    for part in error.chain().map(ToString::to_string) {
        // Many an error tells its source's words within its own, or begins with the file that the context names.
        if part.starts_with(&sentence) {
            sentence.clear();
        }
        if !sentence.contains(&part) {
            sentence.push_str(if sentence.is_empty() { "" } else { ": " });
            sentence.push_str(part.trim_end_matches('.'));
        }
    }
    sentence
}

/// The same for programs.
pub(crate) fn json(error: &anyhow::Error) -> serde_json::Value {
    json!({ "error": { "message": sentence(error), "exit": code(error) } })
}

#[cfg(test)]
mod tests {
    use anyhow::Context as _;

    use super::{Usage, code, sentence};
    use darm_device::link::LinkError;

    #[test]
    fn the_first_cause_with_a_code_decides() {
        let lost: anyhow::Error = LinkError::Name { port: "x".into() }.into();
        assert_eq!(code(&lost.context("uploading")), 4);
        assert_eq!(code(&Usage("no".into()).into()), 2);
        assert_eq!(code(&anyhow::anyhow!("else")), 1);
    }

    #[test]
    fn causes_make_one_sentence() {
        let error = Err::<(), _>(std::io::Error::other("disk is full.")).context("writing a.toml").unwrap_err();
        assert_eq!(sentence(&error), "writing a.toml: disk is full");
    }
}
