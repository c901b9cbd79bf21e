//! A process that holds a port and is suspended: it serves no stop until it is continued.

use std::path::Path;
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};

use super::{Confirmation, socket};
use crate::link::LinkError;

/// A process in the background that reads its terminal is suspended again at once: it is continued so often, until it has answered.
const CONTINUED_EVERY: Duration = Duration::from_millis(5);
/// Longest wait for one answer while it is continued.
const ANSWER: Duration = Duration::from_millis(380);

/// The suspended process that holds a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Suspended {
    process: u32,
}

impl Suspended {
    /// The process that serves stops at this socket, if it is suspended.
    pub(super) fn holder_of(socket: &Path) -> Option<Self> {
        let process = socket::served_by(socket)?;
        is_suspended(process).then_some(Self { process })
    }

    /// Continues it, and asks it for the stop. What serves a stop socket is a `darm` of this user, whose commands from before the
    /// stop the board refuses after it.
    pub(super) fn ask(self, socket: &Path, within: Duration) -> Option<Confirmation> {
        let until = Instant::now() + within;
        std::thread::scope(|scope| {
            let asked = scope.spawn(|| socket::ask(socket, ANSWER.min(within)));
            while !asked.is_finished() && Instant::now() < until {
                self.wake();
                std::thread::sleep(CONTINUED_EVERY);
            }
            asked.join().ok().flatten()
        })
    }

    /// Where it may not be continued, nothing happens.
    fn wake(self) {
        if is_suspended(self.process)
            && let Some(process) = i32::try_from(self.process).ok().and_then(Pid::from_raw)
        {
            let _ = kill_process(process, Signal::CONT);
        }
    }

    /// Why the stop could not be sent.
    pub(super) fn error(self, port: &str) -> LinkError {
        LinkError::Suspended { port: port.to_owned(), process: self.process }
    }
}

/// Whether the system says that a process is stopped; on systems without `/proc` nothing is.
fn is_suspended(process: u32) -> bool {
    std::fs::read_to_string(format!("/proc/{process}/stat")).is_ok_and(|stat| is_stopped(&stat))
}

/// The state follows the name, which may itself have parentheses and spaces.
fn is_stopped(stat: &str) -> bool {
    let state = stat.rsplit_once(')').and_then(|(_, rest)| rest.trim_start().chars().next());
    matches!(state, Some('T' | 't'))
}

#[cfg(test)]
mod tests {
    use std::process::{Child, Command};

    use super::{Suspended, is_stopped, is_suspended};
    use crate::client::fake::until;

    fn signal(child: &Child, name: &str) {
        let process = child.id().to_string();
        assert!(Command::new("kill").args([name, &process]).status().unwrap().success());
    }

    #[test]
    fn a_name_with_parentheses_does_not_hide_the_state() {
        assert!(is_stopped("12 (darm) T 1 2") && is_stopped("12 (a) S (b) t 1"));
        assert!(!is_stopped("12 (darm) S 1 2") && !is_stopped("12 (T) R 1") && !is_stopped(""));
    }

    #[test]
    fn a_suspended_process_is_seen_and_continued() {
        let mut child = Command::new("sleep").arg("60").spawn().unwrap();
        assert!(!is_suspended(child.id()));
        signal(&child, "-STOP");
        until(|| is_suspended(child.id()));
        let suspended = Suspended { process: child.id() };
        suspended.wake();
        until(|| !is_suspended(child.id()));
        let text = suspended.error("unix:board").to_string();
        assert!(text.contains(&format!("kill -CONT {}", child.id())) && text.contains("unix:board"), "{text}");
        child.kill().unwrap();
        child.wait().unwrap();
    }
}
