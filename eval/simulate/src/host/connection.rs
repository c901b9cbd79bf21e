//! The host's connection: opens it again when it was lost, and shows the judges every answer.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use darm_core::sequencer::Command;
use darm_core::wire::message::Status;
use darm_device::client::stop::Confirmation;
use darm_device::client::{Client, ClientError, TimedEvent, TransportError};
use darm_device::link::faulty::{Faults, Faulty};
use darm_device::link::{Link, LinkError};
use rand::RngExt as _;

use super::{Host, TRIES};
use crate::answers::{asks_for_hello, ending};
use crate::judge::reports::Ending;
use crate::world::{self, Party, Plug, World};

/// A link whose counts can be read while a client has it.
#[derive(Clone)]
pub(super) struct Counted(Arc<Mutex<Faulty<Plug>>>);

impl Counted {
    fn with<T>(&self, act: impl FnOnce(&mut Faulty<Plug>) -> T) -> T {
        act(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Link for Counted {
    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        self.with(|link| link.send(bytes))
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, LinkError> {
        self.with(|link| link.receive(buffer, timeout))
    }

    fn now_s(&self) -> f64 {
        self.with(|link| link.now_s())
    }

    fn name(&self) -> &str {
        "simulation"
    }
}

impl Host<'_> {
    pub(super) fn command(&mut self, name: &'static str, command: Command) -> Ending {
        let Some(client) = self.client() else { return Ending::Unknown };
        let before = |world: &mut World| {
            let (now_ns, started_ns) = (world.now_ns(), world.pins.started_ns());
            (now_ns, world.servos.silent(now_ns, started_ns), started_ns)
        };
        let (began_ns, silent, started_ns) = world::with(before);
        let latched_ns = world::with(|world| world.servos.latched_ns());
        let result = client.command(command);
        let ending = ending(&result);
        let drives = !matches!(command, Command::Stop | Command::Clear | Command::Coil { on_ms: 0, .. });
        if let Some((servo, since_ns)) = silent.filter(|_| drives && ending == Ending::Done) {
            world::with(|world| {
                let now_ns = world.now_ns();
                // It may have answered in between.
                let is_silent = world.servos.silent(now_ns, started_ns) == Some((servo, since_ns));
                if is_silent && world.pins.started_ns() == started_ns {
                    world.reports.on_accepted_while_silent(now_ns, servo, &format!("{command:?}"));
                }
            });
        }
        if command == Command::Clear && ending == Ending::Refused {
            world::with(|world| {
                if !world.has_other_acted_since(Party::First, began_ns) && world.pins.started_ns() == started_ns {
                    world.servos.on_clear_refused(latched_ns);
                }
            });
        }
        self.judge_silence(name, began_ns, &result);
        self.note(name, result);
        ending
    }

    /// Asks something that may be repeated, again after the connection was opened again.
    pub(super) fn ask<T: Observed>(
        &mut self,
        name: &'static str,
        ask: impl Fn(&mut Client) -> Result<T, ClientError>,
    ) -> Option<T> {
        for _ in 0..2 {
            let began_ns = world::with(|world| world.now_ns());
            let result = ask(self.client()?);
            self.judge_silence(name, began_ns, &result);
            if let Ok(answer) = result {
                world::with(World::on_host_answer);
                answer.observe(began_ns);
                return Some(answer);
            }
            self.note(name, result.map(drop));
        }
        None
    }

    fn judge_silence<T>(&self, name: &'static str, began_ns: u64, result: &Result<T, ClientError>) {
        // A host that was killed has closed its own end.
        let Err(error @ ClientError::Transport(TransportError::Silent { .. })) = result else { return };
        let before_ns = began_ns.saturating_sub(2_000_000_000);
        world::with(|world| {
            if self.loss_percent == 0 && world.is_undisturbed_since(before_ns) {
                world.reports.on_unanswered(world.now_ns(), name, &error.to_string());
            }
        });
    }

    /// Notes an ending; opens the connection again, or drops it, where that helps. The text of the error.
    pub(super) fn note<T>(&mut self, name: &'static str, result: Result<T, ClientError>) -> String {
        let Err(error) = result else {
            world::with(World::on_host_answer);
            return String::new();
        };
        let text = error.to_string();
        world::with(|world| world.say("host", || format!("{name}: {text}")));
        match (&error, &mut self.client) {
            (ClientError::Refused(refusal), Some((client, _))) if asks_for_hello(refusal) => {
                drop(client.say_hello());
                self.look_at_profile();
            }
            (ClientError::Transport(_), _) => self.disconnect(),
            _ => {}
        }
        text
    }

    pub(super) fn client(&mut self) -> Option<&mut Client> {
        world::with(World::on_host_try);
        for _ in 0..TRIES {
            if self.client.is_some() {
                break;
            }
            self.connect();
        }
        self.client.as_mut().map(|(client, _)| client)
    }

    fn connect(&mut self) {
        const EDGES: [u32; 6] = [0, 1, 0x7fff, 0x8000, 0xfffe, 0xffff];
        // Requests are numbered from the lower half on. A real host draws both: no two connections have one number.
        self.connections += 1;
        let edge = self.connections << 16 | EDGES[self.rng.random_range(0..EDGES.len())];
        let number = if self.rng.random() { edge } else { self.rng.random() };
        let loss = 0.01 * f64::from(self.loss_percent);
        let (drop, share) = (loss, loss / 3.0);
        let faults =
            Faults { drop, corrupt: share, duplicate: share, reorder: share, delay: share, longest_delay_s: 0.05 };
        let link = Counted(Arc::new(Mutex::new(Faulty::new(Plug::new(), faults, self.rng.random()))));
        match Client::connect_as(Box::new(link.clone()), number) {
            Ok(client) => {
                self.client = Some((client, link));
                self.look_at_profile();
            }
            Err(error) => world::with(|world| world.say("host", || format!("connect: {error}"))),
        }
    }

    /// What the board has said of the profile in force since its last start, once.
    pub(super) fn look_at_profile(&mut self) {
        let hello = self.client.as_ref().and_then(|(client, _)| client.hello());
        let Some((boots, profile)) = hello.map(|hello| (hello.boots, hello.profile)) else { return };
        if self.in_force.replace((boots, profile)) != Some((boots, profile)) {
            world::with(|world| world.person.on_in_force(world.now_ns(), profile.0));
        }
    }

    pub(super) fn disconnect(&mut self) {
        let Some((_, link)) = self.client.take() else { return };
        let counts = link.with(|link| link.counts());
        self.struck.dropped += counts.dropped;
        self.struck.corrupted += counts.corrupted;
        self.struck.duplicated += counts.duplicated;
        self.struck.reordered += counts.reordered;
        self.struck.delayed += counts.delayed;
    }
}

/// An answer that the judges want to see.
pub(super) trait Observed {
    fn observe(&self, _asked_ns: u64) {}
}

impl Observed for () {}

impl Observed for Vec<TimedEvent> {}

impl Observed for Confirmation {
    fn observe(&self, asked_ns: u64) {
        if *self == Self::Confirmed {
            world::with(|world| world.person.on_servos_confirmed(world.now_ns(), asked_ns));
        }
    }
}

impl Observed for Status {
    fn observe(&self, asked_ns: u64) {
        world::with(|world| {
            world.judge_loaded(asked_ns, self.model.map(|model| model.0), self.rows);
            world.judge_running(asked_ns, &self.phase);
        });
    }
}
