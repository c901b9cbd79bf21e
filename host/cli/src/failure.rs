//! Exit codes and error messages.
//!
//! | code | meaning                                                                   |
//! |------|---------------------------------------------------------------------------|
//! | 0    | done                                                                      |
//! | 1    | failed: a file cannot be read, a synthesis has no solution, …             |
//! | 2    | invalid command line                                                      |
//! | 3    | the board refused the request, or its safe state is latched               |
//! | 4    | no connection to a board, or it was lost before the answer: it is unknown |
//! |      | whether the board has acted; for a stop: it could not be sent; or the     |
//! |      | camera ended within a program                                             |
//! | 5    | the board did not confirm a stop within 1 s, or for its outputs alone     |
//! | 6    | interrupted by Ctrl-C or SIGTERM; the board confirmed the stop            |
//! | 7    | incomplete: another program stopped the arm before the end of its program, |
//! |      | or a bring-up was ended early                                             |

use std::error::Error;
use std::fmt;
use std::path::Path;

use darm_core::sequencer::{CommandError, Phase};
use darm_core::wire::message::Refusal;
use darm_device::client::stop::Confirmation;
use darm_device::client::{Client, ClientError};
use darm_device::link::LinkError;
use serde_json::json;

use crate::interrupted::Interrupted;
use crate::port::PortError;

/// Any failure without a separate exit code.
const FAILED: u8 = 1;
/// Invalid command line; clap uses the same number.
const USAGE: u8 = 2;
/// The board refused the request.
const REFUSED: u8 = 3;
/// The board was not reached.
const NO_CONNECTION: u8 = 4;
/// A stop was not confirmed.
const UNCONFIRMED: u8 = 5;
/// Interrupted, and stopped.
const INTERRUPTED: u8 = 6;
/// Stopped by another program before its end.
const UNFINISHED: u8 = 7;

/// An invalid word, number or combination of options.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct Usage(pub(crate) String);

/// The board has latched its safe state.
#[derive(Debug, thiserror::Error)]
#[error("the board is in its safe state: {0}; remove the cause, then run `darm stop --clear`")]
pub(crate) struct SafeState(pub(crate) String);

/// What a board does while it refuses a request, and what ends it.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Occupied {
    /// A person moves it.
    #[error("the board refused: it is under manual control; `darm stop` ends it")]
    Manual,
    /// A program runs.
    #[error("the board refused: a program runs; `darm stop` ends it")]
    Program,
}

impl Occupied {
    /// The error of a request, with what the board does where its status says so.
    pub(crate) fn explain(client: &mut Client, error: ClientError) -> anyhow::Error {
        let phase = match error {
            ClientError::Refused(Refusal::Busy | Refusal::Command(CommandError::Playing)) => {
                client.status().ok().map(|status| status.phase)
            }
            _ => None,
        };
        match phase {
            Some(Phase::Manual) => Self::Manual.into(),
            Some(Phase::Playing { .. } | Phase::Approaching { .. }) => Self::Program.into(),
            _ => error.into(),
        }
    }
}

/// The camera ended within a program.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
#[error("the camera {camera} ended or fell silent at visit {visit} of {all}; {then}")]
pub(crate) struct LostCamera {
    /// As the user named it.
    pub(crate) camera: String,
    /// The first visit that it may have missed.
    pub(crate) visit: usize,
    /// All of the program.
    pub(crate) all: usize,
    /// What became of the arm, and what to do.
    pub(crate) then: &'static str,
}

/// Number of lines of a script that the board refused.
#[derive(Debug, thiserror::Error)]
#[error("the board refused {0} of the lines; see the answers that begin with `?`")]
pub(crate) struct Refused(pub(crate) usize);

/// The board did not answer a line.
#[derive(Debug, thiserror::Error)]
#[error("no answer; check that this is the port of a running board: `darm doctor`")]
pub(crate) struct NoAnswer;

/// Some checks of `darm doctor` failed; the number of them.
#[derive(Debug, thiserror::Error)]
#[error("{0} of the checks failed; apply the fixes listed above")]
pub(crate) struct FailedChecks(pub(crate) usize);

/// A bring-up found something; how many.
#[derive(Debug, thiserror::Error)]
#[error("the bring-up found mistakes: {0}; apply what the findings above say, then run it again")]
pub(crate) struct Findings(pub(crate) usize);

/// A program or recording that is not complete although nothing failed.
#[derive(Clone, Debug, thiserror::Error)]
pub(crate) enum Unfinished {
    /// Another program stopped the arm.
    #[error(
        "another program stopped the arm before the end of its program: {done} of {all} {what}; find out which one, then \
         run the program again"
    )]
    Stopped {
        /// How many rows or visits were done.
        done: usize,
        /// How many there are.
        all: usize,
        /// What is counted.
        what: &'static str,
    },
    /// A bring-up was ended early.
    #[error(
        "the bring-up was ended after {done} of {all} outputs; run it again, for single actuators with --actuator N"
    )]
    Bringup {
        /// Outputs that were switched.
        done: usize,
        /// All of those that were wanted.
        all: usize,
    },
    /// A recording was resumed after the end of its program.
    #[error(
        "the program ended before the recording was resumed: {done} of {all} visits measured; record again into another \
         file"
    )]
    Over {
        /// How many visits were measured.
        done: usize,
        /// How many there are.
        all: usize,
    },
}

/// The board has confirmed a stop for its outputs alone.
#[derive(Debug, thiserror::Error)]
#[error("{}", Confirmation::OutputsAlone.text())]
pub(crate) struct ServosUncontrolled;

/// The board did not confirm a stop: it is unknown whether the stop arrived.
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
                "the board did not confirm the stop at {port} within 1 s; switch off the arm's supply. A socket serves one \
                 connection: a program other than `darm` that holds it blocks the stop; end that program"
            );
        }
        write!(
            f,
            "the stop was sent to {port}, but the board did not confirm it within 1 s; switch off the arm's supply, then \
             check the cable, the board and whether another program reads the port"
        )
    }
}

impl Error for Unconfirmed {}

/// Whether a port is a socket, which accepts bytes that nobody reads while it serves another connection.
fn is_socket(port: &str) -> bool {
    port.starts_with("unix:") || port.starts_with("tcp:")
}

/// The exit code of an error: that of the first cause that defines one.
pub(crate) fn code(error: &anyhow::Error) -> u8 {
    error.chain().find_map(code_of_cause).unwrap_or(FAILED)
}

/// Whether the command has already printed what failed, as JSON.
pub(crate) fn is_reported(error: &anyhow::Error) -> bool {
    error.is::<SafeState>() || error.is::<FailedChecks>() || error.is::<Findings>()
}

fn code_of_cause(cause: &(dyn Error + 'static)) -> Option<u8> {
    if let Some(error) = cause.downcast_ref::<ClientError>() {
        return Some(match error {
            ClientError::Refused(_) | ClientError::Denied(_) | ClientError::NoReboot(_) => REFUSED,
            ClientError::Transport(_) => NO_CONNECTION,
            ClientError::Frame(_) => FAILED,
        });
    }
    if let Some(Interrupted { stopped, .. }) = cause.downcast_ref::<Interrupted>() {
        return Some(match stopped {
            Ok(Confirmation::Confirmed) => INTERRUPTED,
            Ok(Confirmation::OutputsAlone | Confirmation::Missing) => UNCONFIRMED,
            Err(_) => NO_CONNECTION,
        });
    }
    if cause.is::<Unconfirmed>() || cause.is::<ServosUncontrolled>() {
        Some(UNCONFIRMED)
    } else if cause.is::<Unfinished>() {
        Some(UNFINISHED)
    } else if cause.is::<Usage>() {
        Some(USAGE)
    } else if cause.is::<SafeState>() || cause.is::<Refused>() || cause.is::<Occupied>() {
        Some(REFUSED)
    } else if cause.is::<LinkError>() || cause.is::<LostCamera>() || cause.is::<PortError>() || cause.is::<NoAnswer>() {
        Some(NO_CONNECTION)
    } else {
        None
    }
}

/// The error of a table, with its file, and with the line where the error is in one row.
pub(crate) fn in_table(path: &Path, line: Option<usize>, error: impl Into<anyhow::Error>) -> anyhow::Error {
    let file = path.display();
    error.into().context(line.map_or(file.to_string(), |line| format!("{file}:{line}")))
}

/// One sentence without a full stop: what failed, where, what to do.
pub(crate) fn sentence(error: &anyhow::Error) -> String {
    darm_diagnose::error::sentence(&**error)
}

/// The error as JSON.
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
        assert_eq!((code(&super::Refused(2).into()), code(&super::NoAnswer.into())), (3, 4));
        assert_eq!(code(&anyhow::anyhow!("else")), 1);
    }

    #[test]
    fn causes_make_one_sentence() {
        let error = Err::<(), _>(std::io::Error::other("disk is full.")).context("writing a.toml").unwrap_err();
        assert_eq!(sentence(&error), "writing a.toml: disk is full");
    }
}
