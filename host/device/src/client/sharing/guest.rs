//! A guest's end: the holder's socket as a link to the board.

use std::io::Write as _;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;

use super::MAX_GUESTS;
use crate::client::stop::{StopHandle, socket};
use crate::link::socket::Socket;
use crate::link::{Link, LinkError};

/// The holder answers at once, or is suspended.
const ANSWER: Duration = Duration::from_millis(400);

/// The link of a guest, and the stop of its port.
type Attached = (Box<dyn Link>, StopHandle);

/// Attaches to the process that has `port`, through its socket, as `name`; `None` where there is no such process, or it does not
/// share.
///
/// # Errors
///
/// [`MAX_GUESTS`] programs use the port already.
pub fn attach(port: &str, socket: &Path, name: &str) -> Result<Option<Attached>, LinkError> {
    let Some((stream, answer)) = ask(socket, &format!("attach {name}")) else { return Ok(None) };
    match answer.as_str() {
        "attached" => {
            let link = Socket::of_holder(stream, port);
            Ok(Some((Box::new(link), StopHandle::of_guest(port, socket))))
        }
        "full" => Err(LinkError::Full { port: port.to_owned(), programs: MAX_GUESTS }),
        _ => Ok(None),
    }
}

/// Whether the process that serves at `socket` shares its port.
pub fn is_shared(socket: &Path) -> bool {
    ask(socket, "shared?").is_some_and(|(_, answer)| answer == "shared")
}

/// Sends a line and reads the holder's; what follows it is not touched.
fn ask(holder: &Path, line: &str) -> Option<(UnixStream, String)> {
    let mut stream = UnixStream::connect(holder).ok()?;
    stream.set_write_timeout(Some(ANSWER)).ok()?;
    stream.write_all(format!("{line}\n").as_bytes()).ok()?;
    let answer = socket::line(&mut stream, ANSWER).ok()?;
    Some((stream, answer))
}
