//! What the second host does: the real client with its own numbering, judged by the same rules as the first.

use darm_core::sequencer::Command;
use darm_core::wire::message::Status;
use darm_device::client::{Client, ClientError, TransportError};
use darm_device::link::faulty::{Faults, Faulty};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use crate::answers::{self, PULSE_MS, SETTLE_MS};
use crate::judge::reports::Ending;
use crate::panics::caught;
use crate::script::{HostAct, Script};
use crate::second_host::{self, SecondHost};
use crate::words;
use crate::world::{Party, World};

/// How often it tries to connect for one act.
const TRIES: u32 = 2;

/// The second host's end of the console.
type Console = second_host::Console<World>;

/// The second host.
struct Second<'s> {
    script: &'s Script,
    console: &'s Console,
    rng: ChaCha8Rng,
    client: Option<Client>,
}

/// The second host of a script; `None` where the script has none.
pub fn start(script: &Script, from_ns: u64) -> Option<SecondHost<World>> {
    if script.second.is_empty() {
        return None;
    }
    let script = script.clone();
    Some(SecondHost::start(from_ns, move |console| {
        if let Err(message) = caught(|| run(&script, console)) {
            console.look(move |world| world.reports.on_host_panic(world.now_ns(), &message));
        }
    }))
}

/// Does all that the script says for the second host, until its line is closed.
fn run(script: &Script, console: &Console) {
    let rng = ChaCha8Rng::seed_from_u64(script.seed ^ 0x7365_636f_6e64);
    let mut second = Second { script, console, rng, client: None };
    let from_ns = console.now_ns();
    for entry in &script.second {
        let passed_ms = (console.now_ns() - from_ns) / 1_000_000;
        console.pass(entry.at_ms.saturating_sub(passed_ms));
        if console.is_closed() {
            return;
        }
        let said = format!("{:?}", entry.act);
        console.look(move |world| world.say("second", || said));
        second.act(&entry.act, entry.seed);
    }
}

impl Second<'_> {
    fn act(&mut self, act: &HostAct, seed: u64) {
        match *act {
            HostAct::Play => drop(self.command(Command::Play)),
            HostAct::Clear => drop(self.command(Command::Clear)),
            HostAct::Coil(coil, on_ms) => drop(self.command(Command::Coil { coil, on_ms })),
            HostAct::Word(_) => drop(self.command(Command::Word(words::word(&self.script.arm, seed)))),
            HostAct::Upload(index) => self.upload(index),
            HostAct::Stop => self.stop(|client| client.command(Command::Stop)),
            HostAct::BootstrapStop => self.stop(Client::stop_at_once),
            HostAct::Pulse(coil) => self.pulse(coil),
            HostAct::Poll(count) => (0..count).for_each(|_| drop(self.status())),
            // The script draws no other acts for the second host.
            _ => {}
        }
    }

    fn client(&mut self) -> Option<&mut Client> {
        for _ in 0..TRIES {
            if self.client.is_none() && !self.console.is_closed() {
                self.connect();
            }
        }
        self.client.as_mut()
    }

    /// Connects under a number whose upper half no other host draws.
    fn connect(&mut self) {
        const EDGES: [u16; 4] = [0, 0x7fff, 0x8000, 0xffff];
        let low = if self.rng.random() { EDGES[self.rng.random_range(0..EDGES.len())] } else { self.rng.random() };
        let number = 0x5ec0_0000 | self.rng.random::<u32>() & 0xf_0000 | u32::from(low);
        let loss = 0.01 * f64::from(self.script.loss_percent);
        let (drop, share) = (loss, loss / 3.0);
        let faults =
            Faults { drop, corrupt: share, duplicate: share, reorder: share, delay: share, longest_delay_s: 0.05 };
        let link = Faulty::new(self.console.clone(), faults, self.rng.random());
        match Client::connect_as(Box::new(link), number) {
            Ok(client) => self.client = Some(client),
            Err(error) => self.say("connect", &error),
        }
    }

    fn say(&self, name: &'static str, error: &ClientError) {
        let text = format!("{name}: {error}");
        self.console.look(move |world| world.say("second", || text));
    }

    /// Asks something; opens the connection again where the first host has taken it, and asks a second time.
    fn ask<T>(&mut self, name: &'static str, ask: impl Fn(&mut Client) -> Result<T, ClientError>) -> Option<(T, u64)> {
        for _ in 0..2 {
            let began_ns = self.console.now_ns();
            let result = ask(self.client()?);
            match result {
                Ok(answer) => return Some((answer, began_ns)),
                Err(error) => self.note(name, began_ns, &error),
            }
        }
        None
    }

    fn note(&mut self, name: &'static str, began_ns: u64, error: &ClientError) {
        self.say(name, error);
        if matches!(error, ClientError::Transport(TransportError::Silent { .. })) && self.script.loss_percent == 0 {
            let text = error.to_string();
            self.console.look(move |world| {
                if world.is_undisturbed_since(began_ns.saturating_sub(2_000_000_000)) {
                    world.reports.on_unanswered(world.now_ns(), name, &text);
                }
            });
        }
        match (error, &mut self.client) {
            (ClientError::Refused(refusal), Some(client)) if answers::asks_for_hello(refusal) => {
                drop(client.say_hello());
            }
            (ClientError::Transport(_), _) => self.client = None,
            _ => {}
        }
    }

    fn status(&mut self) -> Option<Status> {
        let (status, began_ns) = self.ask("status", Client::status)?;
        let (model, rows) = (status.model.map(|model| model.0), status.rows);
        self.console.look(move |world| world.judge_loaded(began_ns, model, rows));
        Some(status)
    }

    fn command(&mut self, command: Command) -> Ending {
        let began_ns = self.console.now_ns();
        let Some(client) = self.client() else { return Ending::Unknown };
        let result = client.command(command);
        let ending = answers::ending(&result);
        if let Err(error) = result {
            self.note("command", began_ns, &error);
        }
        ending
    }

    fn upload(&mut self, index: usize) {
        let began_ns = self.console.now_ns();
        let (Some(table), Some(client)) = (self.script.tables.get(index), self.client()) else { return };
        let result = client.upload(&table.image, &mut |_| {});
        let ending = answers::upload_ending(&result);
        if let Err(error) = &result {
            self.note("upload", began_ns, error);
        }
        let model = table.model;
        self.console.look(move |world| world.on_upload(Party::Second, model, ending, began_ns));
    }

    /// Stops, and sees whether the board has stopped, if the first host did nothing meanwhile.
    fn stop(&mut self, stop: impl Fn(&mut Client) -> Result<(), ClientError>) {
        let began_ns = self.console.now_ns();
        if self.ask("stop", stop).is_none() {
            return;
        }
        self.console.look(move |world| world.on_stop(began_ns));
        self.console.pass(2);
        self.console.look(move |world| world.judge_stopped(Party::Second, began_ns, true));
        self.console.pass(SETTLE_MS);
        self.console.look(move |world| world.judge_stopped(Party::Second, began_ns, false));
    }

    /// Stops, then switches one coil on for a moment: the line is switched on once if that was confirmed.
    fn pulse(&mut self, coil: u8) {
        let began_ns = self.console.now_ns();
        if self.ask("stop", Client::stop_at_once).is_none() {
            return;
        }
        self.console.look(move |world| world.on_stop(began_ns));
        if let Some(client) = self.client() {
            drop(client.say_hello());
        }
        self.console.pass(SETTLE_MS);
        let model = self.status().and_then(|status| status.model);
        let is_own = self.script.tables.iter().any(|table| model.is_some_and(|model| model.0 == table.model));
        if !is_own {
            return;
        }
        let Some(pulsed) = self.console.look(move |world| world.begin_pulse(coil, began_ns)).flatten() else { return };
        let ending = self.command(Command::Coil { coil, on_ms: PULSE_MS });
        self.console.pass(SETTLE_MS);
        self.console.look(move |world| world.judge_pulse(Party::Second, pulsed, ending));
    }
}
