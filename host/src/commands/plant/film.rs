//! Shows what the plant's camera takes to whoever connects to its socket.

use std::io::{ErrorKind, Write as _};
use std::os::unix::net::{UnixListener, UnixStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use darm::arm::{Arm, ArmScratch};
use darm::plant::camera::{Film, Frame};

use crate::commands::camera::{Picture, header, unix_less_host_s};

/// How often the film is looked at.
const LOOK: Duration = Duration::from_millis(10);
/// A client that takes nothing for so long is let go.
const SLOW: Duration = Duration::from_millis(200);

/// The running thread.
pub(crate) struct Projector {
    end: Arc<AtomicBool>,
    thread: JoinHandle<()>,
}

impl Projector {
    /// Starts to show.
    pub(crate) fn start(listener: UnixListener, arm: Arm, film: Film) -> std::io::Result<Self> {
        listener.set_nonblocking(true)?;
        let end = Arc::new(AtomicBool::new(false));
        let seen = Arc::clone(&end);
        let mut eye = Eye { planar: arm.model.chain.is_planar(), arm, scratch: ArmScratch::default() };
        let thread = thread::Builder::new().name("camera".into()).spawn(move || {
            let mut clients = Vec::new();
            while !seen.load(Ordering::Relaxed) {
                clients.extend(accept(&listener, eye.planar));
                let lines: String = film.take().iter().filter_map(|frame| eye.line(frame)).collect();
                clients.retain_mut(|client: &mut UnixStream| client.write_all(lines.as_bytes()).is_ok());
                thread::sleep(LOOK);
            }
        })?;
        Ok(Self { end, thread })
    }

    /// Ends the show.
    pub(crate) fn stop(self) {
        self.end.store(true, Ordering::Relaxed);
        // A panic of the thread has been printed already.
        let _ = self.thread.join();
    }
}

/// Clients that have come, each with the header already sent.
fn accept(listener: &UnixListener, planar: bool) -> Vec<UnixStream> {
    let mut clients = Vec::new();
    loop {
        match listener.accept() {
            Ok((mut client, _)) => {
                let greeted = client
                    .set_nonblocking(false)
                    .and_then(|()| client.set_write_timeout(Some(SLOW)))
                    .and_then(|()| client.write_all(format!("{}\n", header(planar)).as_bytes()));
                clients.extend(greeted.is_ok().then_some(client));
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(_) => return clients,
        }
    }
}

/// Turns where the actuators are into where the tool is.
struct Eye {
    arm: Arm,
    planar: bool,
    scratch: ArmScratch,
}

impl Eye {
    /// The line of a frame; none where the arm cannot be assembled.
    fn line(&mut self, frame: &Frame) -> Option<String> {
        let servos: Vec<f64> = frame.state.servos_rad.iter().map(|&angle| angle.into()).collect();
        let mut condition = self.arm.model.nominal(frame.state.reached, &servos);
        condition.previous = Some(frame.state.previous);
        let pose = self.arm.model.predict(&condition, &mut self.scratch).ok()?;
        let time_s = frame.at_s + unix_less_host_s();
        let picture = Picture { time_s, pose, supply: None, temperature_c: None };
        Some(picture.line(self.planar) + "\n")
    }
}
