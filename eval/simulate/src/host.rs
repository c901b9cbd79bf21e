//! The host of a run: does what the script says with the real client, reports what it got, reconnects when it was killed.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use darm_core::sequencer::{Command, CommandError, Event, Fault, FaultKind, Phase};
use darm_core::table::TableError;
use darm_core::units::Word;
use darm_core::wire::bootstrap::Into as RebootInto;
use darm_core::wire::message::{Calibration, Refusal};
use darm_device::client::{Client, ClientError, TransportError};
use darm_device::link::faulty::{FaultCounts, Faults, Faulty};
use darm_device::link::{Link, LinkError};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use crate::arm::{ArmPlan, Table};
use crate::judge::reports::{Ending, Pulse};
use crate::script::{HostAct, Script, Timed};
use crate::world::{self, Party, Plug, World};

/// How often a host tries to connect, or to upload over a bad line.
const TRIES: u32 = 5;
/// A pulse by command, ms.
pub(crate) const PULSE_MS: u32 = 30;
/// No program of a script lasts longer, s.
const LONGEST_PROGRAM_S: u32 = 25;
/// One use of an output that is to be used up, ms: below the shortest limit of on-time.
const USE_MS: u32 = 400;
/// After one use and so long every output may have its next peak, ms.
const PEAK_WAIT_MS: u64 = 200;
/// So many uses fill the longest window.
const USES: u32 = 30;
/// What was sent before has acted, or never will, ms.
pub(crate) const SETTLE_MS: u64 = 300;

/// How the first upload went.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FirstUpload {
    /// It completed.
    pub completed: bool,
    /// Calls that it took.
    pub calls: u32,
    /// Virtual time, ms.
    pub took_ms: u64,
}

/// A link whose counts can be read while a client has it.
#[derive(Clone)]
struct Counted(Arc<Mutex<Faulty<Plug>>>);

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

/// The host.
pub struct Host<'s> {
    script: &'s Script,
    rng: ChaCha8Rng,
    loss_percent: u32,
    client: Option<(Client, Counted)>,
    /// How often it has tried to connect.
    connections: u32,
    /// Number of the next event, and the start of the board that it belongs to.
    next_event: (u32, u64),
    /// Pieces that the line struck.
    pub struck: FaultCounts,
    /// How the first upload went.
    pub first_upload: Option<FirstUpload>,
}

impl<'s> Host<'s> {
    /// A host that has not connected.
    pub fn new(script: &'s Script) -> Self {
        let rng = ChaCha8Rng::seed_from_u64(script.seed ^ 0x686f_7374);
        let (loss_percent, next_event) = (script.loss_percent, (0, 0));
        Self {
            script,
            rng,
            loss_percent,
            client: None,
            connections: 0,
            next_event,
            struck: FaultCounts::default(),
            first_upload: None,
        }
    }

    /// Does all that the script says.
    pub fn run(&mut self) {
        let mut from_ms = 0;
        for (index, Timed { at_ms, act, seed }) in self.script.host.iter().enumerate() {
            let now_ms = world::with(|world| world.now_ns()) / 1_000_000;
            world::pass((from_ms + at_ms).saturating_sub(now_ms));
            world::with(|world| world.say("host", || format!("{act:?}")));
            self.act(act, *seed);
            if index == 0 {
                world::with(|world| world.begin_acts(self.script));
                from_ms = world::with(|world| world.now_ns()) / 1_000_000;
            }
        }
    }

    /// Looks at a board that nothing disturbs any more, before and after a power cut.
    pub fn look_back(&mut self) {
        self.disconnect();
        world::with(world::World::calm_down);
        self.loss_percent = 0;
        self.look();
        world::pass(SETTLE_MS);
        let noise = self.rng.random();
        world::with(|world| world.power_cycle(noise));
        world::pass(SETTLE_MS);
        self.disconnect();
        self.look();
        self.stop("stop", |client| client.stop_at_once());
    }

    fn look(&mut self) {
        self.ask("status", Client::status);
        self.events();
    }

    fn act(&mut self, act: &HostAct, seed: u64) {
        let command = match *act {
            HostAct::Play => Command::Play,
            HostAct::Clear => Command::Clear,
            HostAct::Coil(coil, on_ms) => Command::Coil { coil, on_ms },
            HostAct::Word(_) => Command::Word(word(&self.script.arm, seed)),
            HostAct::WrongWord(_) => return self.wrong_word(seed),
            HostAct::Servo(servo, _) if seed.is_multiple_of(2) => return self.turn_unseen(servo),
            HostAct::Servo(servo, mrad) => Command::Servo { servo, angle_rad: 1e-3 * mrad as f32 },
            HostAct::Upload(index) => return self.upload(index),
            HostAct::Stop => return self.stop("stop", |client| client.command(Command::Stop)),
            HostAct::BootstrapStop => {
                self.stop("bootstrap stop", Client::stop_at_once);
                return self.act_after_stop();
            }
            HostAct::Pulse(coil) => return self.pulse(coil),
            HostAct::TwoPulses(first, second) => return self.two_pulses(first, second),
            HostAct::Exhaust(coil, table) => return self.exhaust(coil, table),
            HostAct::Calibrate(mrad) => return self.calibrate(1e-3 * mrad as f32),
            HostAct::Poll(count) => return self.poll(count),
            HostAct::Events => return self.events(),
        };
        if let Command::Servo { angle_rad, .. } = command {
            world::with(|world| world.servos.on_asked(angle_rad));
        }
        self.command("command", command);
    }

    fn poll(&mut self, count: u32) {
        for _ in 0..count {
            if self.ask("status", Client::status).is_none() {
                return;
            }
        }
    }

    /// Turns a servo that has not answered since the board started: whatever the board says, it is not driven.
    fn turn_unseen(&mut self, servo: u8) {
        if !self.is_own_table_at_rest() {
            return;
        }
        world::with(|world| {
            // Where the restart is refused the servo has answered, and turns.
            world.servos.on_asked(0.0);
            world.silence_servos(u8::MAX);
        });
        self.ask("reboot", |client| client.reboot(RebootInto::Application));
        world::pass(SETTLE_MS);
        for _ in 0..2 {
            self.command("turn", Command::Servo { servo, angle_rad: 0.0 });
        }
        world::pass(SETTLE_MS);
        world::with(|world| world.silence_servos(0));
    }

    /// Uses one output up to its limit, then changes the table, then restarts the board: its limit stays what it is.
    fn exhaust(&mut self, coil: u8, table: usize) {
        if self.script.arm.pulsed_line(coil).is_none() || !self.is_own_table_at_rest() {
            return;
        }
        self.use_up(coil);
        self.ask("stop", |client| client.command(Command::Stop));
        self.upload(table);
        self.use_up(coil);
        self.ask("stop", |client| client.command(Command::Stop));
        self.ask("reboot", |client| client.reboot(RebootInto::Application));
        world::pass(SETTLE_MS);
        self.use_up(coil);
    }

    /// After one refusal it tries again: the output may have to wait for its next peak. After two it is used up.
    fn use_up(&mut self, coil: u8) {
        let mut refusals = 0;
        for _ in 0..USES {
            if self.command("use", Command::Coil { coil, on_ms: USE_MS }) == Ending::Done {
                refusals = 0;
                world::pass(u64::from(USE_MS) + 20);
            } else if refusals == 0 {
                refusals = 1;
                world::pass(PEAK_WAIT_MS);
            } else {
                return;
            }
        }
    }

    /// Runs the table to its end, so that the servos still have their targets, then sets zero offsets.
    fn calibrate(&mut self, offset_rad: f32) {
        if !self.is_own_table_at_rest() || self.command("play", Command::Play) != Ending::Done {
            return;
        }
        for _ in 0..LONGEST_PROGRAM_S {
            match self.ask("status", Client::status).map(|status| status.phase) {
                Some(Phase::Approaching { .. } | Phase::Playing { .. }) => world::pass(1_000),
                Some(_) => break,
                None => return,
            }
        }
        let Ok(calibration) = Calibration::try_from([offset_rad; 4]) else { return };
        let (began_ns, before) = world::with(|world| {
            world.servos.on_offset(offset_rad);
            (world.now_ns(), world.servos.goals())
        });
        let Some(client) = self.client() else { return };
        let result = client.calibrate(calibration);
        let done = result.is_ok();
        self.note("calibrate", result);
        world::pass(SETTLE_MS);
        world::with(|world| {
            let is_alone = !world.has_other_acted_since(Party::First, began_ns);
            if done && is_alone && world.is_undisturbed_since(began_ns) {
                world.servos.on_calibrated(world.now_ns(), &before);
            }
        });
    }

    /// A command that no state of the arm obeys: whatever happens, the board must not confirm it.
    fn wrong_word(&mut self, seed: u64) {
        if !self.is_own_table_at_rest() {
            return;
        }
        let began_ns = world::with(|world| world.now_ns());
        let command = Command::Word(wrong_word(&self.script.arm, seed));
        let ending = self.command("wrong word", command);
        world::with(|world| {
            if ending == Ending::Done && !world.is_hostile_since(began_ns) {
                world.reports.on_impossible_confirmed(world.now_ns(), &format!("{command:?}"));
            }
        });
    }

    /// The first upload is repeated as a person would, for nothing but the line disturbs it.
    fn upload(&mut self, index: usize) {
        let Some(table) = self.script.tables.get(index) else { return };
        let began_ns = world::with(|world| world.now_ns());
        let tries = if self.first_upload.is_none() { TRIES } else { 1 };
        let mut ended = (Ending::Unknown, String::new());
        let mut calls = 0;
        while calls < tries && ended.0 != Ending::Done {
            calls += 1;
            ended = self.upload_once(table);
        }
        if self.first_upload.is_none() {
            let completed = ended.0 == Ending::Done;
            let now_ns = world::with(|world| world.now_ns());
            self.first_upload = Some(FirstUpload { completed, calls, took_ms: (now_ns - began_ns) / 1_000_000 });
            if !completed {
                world::with(|world| world.reports.on_incomplete(now_ns, self.script.loss_percent, &ended.1));
            }
        }
    }

    fn upload_once(&mut self, table: &Table) -> (Ending, String) {
        let Some(client) = self.client() else { return (Ending::Unknown, "no connection".into()) };
        let began_ns = world::with(|world| world.now_ns());
        let result = client.upload(&table.image, &mut |_| {});
        let ending = upload_ending(&result);
        let text = self.note("upload", result);
        world::with(|world| world.on_upload(Party::First, table.model, ending, began_ns));
        (ending, text)
    }

    /// Stops, and sees whether the board has stopped.
    fn stop(&mut self, name: &'static str, stop: impl Fn(&mut Client) -> Result<(), ClientError>) {
        let began_ns = world::with(|world| world.now_ns());
        if self.ask(name, &stop).is_none() {
            return;
        }
        // The answer leaves before the next tick.
        world::pass(2);
        world::with(|world| world.judge_stopped(Party::First, began_ns, true));
        world::pass(SETTLE_MS);
        world::with(|world| world.judge_stopped(Party::First, began_ns, false));
    }

    /// A command on the connection of before the stop, as if it had been sent before it.
    fn act_after_stop(&mut self) {
        let Some((client, _)) = &mut self.client else { return };
        let result = client.command(Command::Coil { coil: 0, on_ms: PULSE_MS });
        if result.is_ok() {
            world::with(|world| world.reports.on_command_after_stop(world.now_ns()));
        }
        self.note("command after a stop", result);
    }

    /// Stops, then switches one coil on for a moment: the line goes on once if that was confirmed.
    fn pulse(&mut self, coil: u8) {
        let began_ns = world::with(|world| world.now_ns());
        let Some(line) = self.script.arm.pulsed_line(coil) else { return };
        if !self.is_own_table_at_rest() {
            return;
        }
        let before = world::with(|world| world.pins.rises(line));
        let ending = self.command("pulse", Command::Coil { coil, on_ms: PULSE_MS });
        world::pass(SETTLE_MS);
        world::with(|world| {
            let rises = world.pins.rises(line) - before;
            let pulse = Pulse { ending, rises, undisturbed: world.is_undisturbed_since(began_ns) };
            if !world.has_other_acted_since(Party::First, began_ns) {
                world.reports.on_pulse(world.now_ns(), pulse);
            }
        });
    }

    /// Two coils at once, the second for a shorter time.
    fn two_pulses(&mut self, first: u8, second: u8) {
        let began_ns = world::with(|world| world.now_ns());
        if first == second || !self.is_own_table_at_rest() {
            return;
        }
        for (coil, on_ms) in [(first, 2 * PULSE_MS), (second, PULSE_MS)] {
            self.command("pulse", Command::Coil { coil, on_ms });
        }
        world::pass(SETTLE_MS);
        world::with(|world| {
            if world.is_undisturbed_since(began_ns) && !world.has_other_acted_since(Party::First, began_ns) {
                world.reports.on_pulses_over(world.now_ns(), world.pins.high());
            }
        });
    }

    /// Stops the board; true when it has stopped, all lines are off, and the loaded table is one of the script.
    fn is_own_table_at_rest(&mut self) -> bool {
        if self.ask("stop", |client| client.command(Command::Stop)).is_none() {
            return false;
        }
        world::pass(SETTLE_MS);
        let model = self.ask("status", Client::status).and_then(|status| status.model);
        let own = self.script.tables.iter().any(|table| model.is_some_and(|model| model.0 == table.model));
        own && world::with(|world| world.pins.high()) == 0
    }

    fn command(&mut self, name: &'static str, command: Command) -> Ending {
        let Some(client) = self.client() else { return Ending::Unknown };
        let began_ns = world::with(|world| world.now_ns());
        let result = client.command(command);
        let ending = ending(&result);
        self.judge_silence(name, began_ns, &result);
        self.note(name, result);
        ending
    }

    /// Asks something that may be repeated, again after the connection was opened again.
    fn ask<T: Observed>(
        &mut self,
        name: &'static str,
        ask: impl Fn(&mut Client) -> Result<T, ClientError>,
    ) -> Option<T> {
        for _ in 0..2 {
            let began_ns = world::with(|world| world.now_ns());
            let result = ask(self.client()?);
            self.judge_silence(name, began_ns, &result);
            if let Ok(answer) = result {
                world::with(world::World::on_host_answer);
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
    fn note<T>(&mut self, name: &'static str, result: Result<T, ClientError>) -> String {
        let Err(error) = result else {
            world::with(world::World::on_host_answer);
            return String::new();
        };
        let text = error.to_string();
        world::with(|world| world.say("host", || format!("{name}: {text}")));
        match (&error, &mut self.client) {
            (ClientError::Refused(refusal), Some((client, _))) if asks_for_hello(refusal) => drop(client.say_hello()),
            (ClientError::Transport(_), _) => self.disconnect(),
            _ => {}
        }
        text
    }

    fn events(&mut self) {
        for _ in 0..20 {
            let started_ns = world::with(|world| world.pins.started_ns());
            if self.next_event.1 != started_ns {
                self.next_event = (0, started_ns);
            }
            let from = self.next_event.0;
            let Some(events) = self.ask("events", |client| client.events(from)) else { return };
            if world::with(|world| world.pins.started_ns()) != started_ns {
                return;
            }
            let Some(last) = events.last() else { return };
            self.next_event.0 = last.number + 1;
            for happening in &events {
                world::with(|world| match happening.event {
                    Event::Fault(fault) => {
                        world.pins.on_fault_report(world.now_ns(), fault.at.0);
                        judge_fault_in_program(world, &fault, started_ns);
                    }
                    Event::Row { row, word } => world.reports.on_row(world.now_ns(), row, &word.to_string()),
                    _ => {}
                });
            }
        }
    }

    fn client(&mut self) -> Option<&mut Client> {
        world::with(world::World::on_host_try);
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
            Ok(client) => self.client = Some((client, link)),
            Err(error) => world::with(|world| world.say("host", || format!("connect: {error}"))),
        }
    }

    fn disconnect(&mut self) {
        let Some((_, link)) = self.client.take() else { return };
        let counts = link.with(|link| link.counts());
        self.struck.dropped += counts.dropped;
        self.struck.corrupted += counts.corrupted;
        self.struck.duplicated += counts.duplicated;
        self.struck.reordered += counts.reordered;
        self.struck.delayed += counts.delayed;
    }
}

/// Whether the board asks for a new connection.
pub(crate) fn asks_for_hello(refusal: &Refusal) -> bool {
    matches!(refusal, Refusal::NotConnected | Refusal::Command(CommandError::Stopped))
}

/// How a command ended for the host.
pub(crate) fn ending<T>(result: &Result<T, ClientError>) -> Ending {
    match result {
        Ok(_) => Ending::Done,
        Err(ClientError::Refused(_)) => Ending::Refused,
        Err(_) => Ending::Unknown,
    }
}

/// How an upload ended for the host. What was refused may have been the repetition of what was done, unless the table
/// itself is the reason.
pub(crate) fn upload_ending<T>(result: &Result<T, ClientError>) -> Ending {
    match result {
        Ok(_) => Ending::Done,
        Err(ClientError::Refused(Refusal::Table(TableError::Row { .. } | TableError::Wiring(_)))) => Ending::Refused,
        Err(_) => Ending::Unknown,
    }
}

/// A word of the arm.
pub(crate) fn word(arm: &ArmPlan, seed: u64) -> Word {
    Word::new(&digits(arm, seed)).expect("a few actuators of at most four states")
}

/// A word that the arm does not have, in whichever order a table wires its actuators.
fn wrong_word(arm: &ArmPlan, seed: u64) -> Word {
    let mut digits = digits(arm, seed);
    let states = arm.actuators.iter().map(|actuator| actuator.states).max().unwrap_or(0);
    match digits.first_mut() {
        Some(first) if seed & 1 == 0 && states <= Word::MAX_DIGIT => *first = states,
        _ => digits.push(0),
    }
    Word::new(&digits).expect("a few digits of at most 3")
}

fn digits(arm: &ArmPlan, seed: u64) -> Vec<u8> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    arm.actuators.iter().map(|actuator| rng.random_range(0..actuator.states)).collect()
}

/// A program that the host started must not end by a limit: it was rehearsed. What somebody else did since the start of
/// the board is not known.
fn judge_fault_in_program(world: &mut World, fault: &Fault, started_ns: u64) {
    let by_limit = matches!(fault.kind, FaultKind::OnTooLong { .. } | FaultKind::Duty { .. });
    if let Some(row) = fault.row.filter(|_| by_limit && !world.is_hostile_since(started_ns)) {
        world.reports.on_limit_in_program(world.now_ns(), row, &format!("{:?}", fault.kind));
    }
}

/// An answer that the judges want to see.
trait Observed {
    fn observe(&self, _asked_ns: u64) {}
}

impl Observed for () {}
impl Observed for Vec<darm_device::client::Happening> {}

impl Observed for darm_core::wire::message::Status {
    fn observe(&self, asked_ns: u64) {
        world::with(|world| world.judge_loaded(asked_ns, self.model.map(|model| model.0), self.rows));
    }
}
