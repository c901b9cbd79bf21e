//! The error of a command that was interrupted, with the result of the stop.

use std::fmt;
use std::sync::Arc;

use darm_device::client::stop::Confirmation;
use darm_device::link::LinkError;

/// The command was interrupted.
#[derive(Debug)]
pub(crate) struct Interrupted {
    /// Result of the stop.
    pub(crate) stopped: Result<Confirmation, Arc<LinkError>>,
    /// How the command continues; empty where it does not.
    pub(crate) next: &'static str,
}

impl fmt::Display for Interrupted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.stopped {
            Ok(Confirmation::Confirmed) => f.write_str("interrupted; the board confirmed that all coils are off")?,
            Ok(other) => write!(f, "interrupted; {}", other.text())?,
            Err(error) => write!(
                f,
                "interrupted, and the stop could not be sent: {error}; the program continues, switch off the arm's supply"
            )?,
        }
        f.write_str(self.next)
    }
}

impl std::error::Error for Interrupted {}
