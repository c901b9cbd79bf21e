//! What an answer of the board, or its absence, means for a host.

use darm_core::sequencer::CommandError;
use darm_core::table::TableError;
use darm_core::wire::message::Refusal;
use darm_device::client::ClientError;

use crate::judge::reports::Ending;

/// A pulse by command, ms.
pub const PULSE_MS: u32 = 30;
/// What was sent before has acted, or never will, ms.
pub const SETTLE_MS: u64 = 300;

/// Whether the board asks for a new connection.
pub fn asks_for_hello(refusal: &Refusal) -> bool {
    matches!(refusal, Refusal::NotConnected | Refusal::Challenge { .. } | Refusal::Command(CommandError::Stopped))
}

/// How a command ended for the host.
pub fn ending<T>(result: &Result<T, ClientError>) -> Ending {
    match result {
        Ok(_) => Ending::Done,
        Err(ClientError::Refused(_) | ClientError::Denied(_) | ClientError::NoReboot(_)) => Ending::Refused,
        Err(_) => Ending::Unknown,
    }
}

/// How an upload ended for the host. What was refused may have been the repetition of what was done, unless the table
/// itself is the reason.
pub fn upload_ending<T>(result: &Result<T, ClientError>) -> Ending {
    match result {
        Ok(_) => Ending::Done,
        Err(ClientError::Refused(Refusal::Table(TableError::Row { .. } | TableError::Wiring(_)))) => Ending::Refused,
        Err(_) => Ending::Unknown,
    }
}
