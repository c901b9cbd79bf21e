//! How the server reaches the board.

use darm_device::client::stop::{Confirmation, StopHandle};
use darm_device::link::{Link, LinkError};

/// How the board is reached.
pub struct BoardPort {
    /// Opens the port, and makes it one that can be stopped past its user: `darm_device::client::stop::hold`.
    pub open: Opener,
    /// Stops the board while this server does not have the port: `darm_device::client::stop::stop_at`.
    pub stop: Stopper,
}

/// Opens the port of the board.
pub type Opener = Box<dyn FnMut() -> Result<(Box<dyn Link>, StopHandle), LinkError> + Send>;
/// Stops the board at its port.
pub type Stopper = Box<dyn Fn() -> Result<Confirmation, LinkError> + Send + Sync>;
