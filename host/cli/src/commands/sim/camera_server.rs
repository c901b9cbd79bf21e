//! Serves the simulated camera's measurements on a socket.

use std::io::{ErrorKind, Write as _};
use std::os::unix::net::{UnixListener, UnixStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use darm_device::clock::host_now_s;
use darm_diagnose::truth::{TrueState, Truth};
use darm_sim::plant::camera::Frame;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

use super::board::Frames;
use crate::commands::camera_lines::{BAR, Picture, header, unix_less_host_s};

/// Interval at which new frames are polled.
const POLL: Duration = Duration::from_millis(10);
/// A client that reads nothing for this long is disconnected.
const SLOW: Duration = Duration::from_millis(200);

/// The running thread.
pub(crate) struct CameraServer {
    end: Arc<AtomicBool>,
    thread: JoinHandle<()>,
}

impl CameraServer {
    /// Starts to serve the arm's frames.
    pub(crate) fn start(
        listener: UnixListener,
        truth: Truth,
        planar: bool,
        mut frames: Frames,
    ) -> std::io::Result<Self> {
        listener.set_nonblocking(true)?;
        let end = Arc::new(AtomicBool::new(false));
        let seen = Arc::clone(&end);
        let rng = ChaCha8Rng::seed_from_u64(truth.unseal().seed);
        let mut camera = SimulatedCamera { truth, planar, started_s: host_now_s(), rng };
        let thread = thread::Builder::new().name("camera".into()).spawn(move || {
            let mut clients = Vec::new();
            while !seen.load(Ordering::Relaxed) {
                clients.extend(accept(&listener, camera.planar));
                let lines: String = frames().iter().filter_map(|frame| camera.line(frame)).collect();
                clients.retain_mut(|client: &mut UnixStream| client.write_all(lines.as_bytes()).is_ok());
                thread::sleep(POLL);
            }
        })?;
        Ok(Self { end, thread })
    }

    /// Ends the thread.
    pub(crate) fn stop(self) {
        self.end.store(true, Ordering::Relaxed);
        // A panic of the thread has been printed already.
        let _ = self.thread.join();
    }
}

/// New clients, each with the header already sent.
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

/// Turns the state of the actuators into the camera's measurement of the tool.
struct SimulatedCamera {
    truth: Truth,
    planar: bool,
    /// Host time at which the arm was switched on.
    started_s: f64,
    rng: ChaCha8Rng,
}

impl SimulatedCamera {
    /// The line of a frame; `None` while something moves, since that is blurred, or where the arm has no pose.
    fn line(&mut self, frame: &Frame) -> Option<String> {
        if frame.state.moving {
            return None;
        }
        let servos_rad: Vec<f64> = frame.state.servos_rad.iter().map(|&angle| angle.into()).collect();
        let state = TrueState {
            word: frame.state.reached,
            previous: Some(frame.state.previous),
            servos_rad: &servos_rad,
            time_s: (frame.at_s - self.started_s).max(0.0),
            load_kg: 0.0,
            history: None,
        };
        let seen = self.truth.observe(&state, &mut self.rng).ok()?;
        let picture = Picture {
            time_s: frame.at_s + unix_less_host_s(),
            pose: seen.pose,
            supply_bar: Some(seen.supply / BAR),
            temperature_c: Some(seen.temperature_c),
        };
        Some(picture.line(self.planar) + "\n")
    }
}
