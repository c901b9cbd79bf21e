//! Why a request came to nothing. Three failures, three types: the bytes did not arrive; a frame is not valid; the board
//! understood and refused.

use darm_core::wire::bootstrap::RebootTarget;
use darm_core::wire::frame::FrameError;
use darm_core::wire::message::Refusal;

use crate::link::LinkError;

/// Why a request came to nothing.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// The bytes did not arrive.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// Bytes arrived that are no valid answer.
    #[error(transparent)]
    Frame(#[from] AnswerError),
    /// The board understood and refused.
    #[error("the board refused: {0}")]
    Refused(Refusal),
    /// The port is shared, and another program or page controls the arm; the board was not asked.
    #[error("nothing was sent: {0}")]
    Denied(String),
    /// The board understood and does not restart; the answer of the bootstrap set has no reason.
    #[error("the board refused to restart{}", no_reboot(.0))]
    NoReboot(RebootTarget),
}

/// Why a board may refuse a restart, and what to do.
fn no_reboot(into: &RebootTarget) -> &'static str {
    match into {
        RebootTarget::Application => ": a program runs; stop it first",
        RebootTarget::Loader => {
            " into its loader: a program runs, or nobody is at the board; stop the program, hold the button or close the jumper"
        }
    }
}

impl ClientError {
    /// The board's reason, if it refused.
    pub fn refusal(&self) -> Option<Refusal> {
        match self {
            ClientError::Refused(refusal) => Some(*refusal),
            ClientError::Transport(_) | ClientError::Frame(_) | ClientError::Denied(_) | ClientError::NoReboot(_) => {
                None
            }
        }
    }
}

impl From<LinkError> for ClientError {
    fn from(error: LinkError) -> Self {
        ClientError::Transport(TransportError::Link(error))
    }
}

/// The bytes did not arrive.
#[derive(Debug, thiserror::Error)]
pub enum TransportError {
    /// The port failed.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// No answer, however often asked.
    #[error(
        "{port}: no answer to {attempts} requests in {waited_s:.1} s; is this the board's port, does the board run, does \
         another program hold the port?"
    )]
    Silent {
        /// The port.
        port: String,
        /// How often the request was sent.
        attempts: u32,
        /// How long the client waited.
        waited_s: f64,
    },
    /// A request that acts was repeated, and meanwhile its connection ended: the first copy may have acted or not.
    #[error(
        "{port}: the answer to `{request}` was lost and the board has ended the connection, so it may have acted or not; \
         see `darm status` before it is repeated"
    )]
    OutcomeUnknown {
        /// The port.
        port: String,
        /// The request.
        request: &'static str,
    },
}

/// Bytes arrived that are no valid answer.
#[derive(Debug, thiserror::Error)]
pub enum AnswerError {
    /// Only damaged frames came.
    #[error("{port}: {count} damaged frames and no answer, the last: {last}; check cable and line speed")]
    Damaged {
        /// The port.
        port: String,
        /// How many damaged frames came.
        count: u32,
        /// What was wrong with the last.
        last: FrameError,
    },
    /// The frame is complete, but its payload is not what this version of the protocol says.
    #[error(
        "the answer to `{request}` cannot be read; host and firmware may speak different versions: see `darm doctor`"
    )]
    Payload {
        /// The request.
        request: &'static str,
    },
    /// The request does not fit a frame.
    #[error("the request does not fit a frame: {0}")]
    Request(FrameError),
}
