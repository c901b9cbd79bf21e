//! The host of a run: does what the script says with the real client, reports what it got, reconnects when it was killed.

mod acts;
mod connection;
mod directed_acts;
mod rest_acts;

use darm_core::sequencer::{Command, Event, Fault, FaultKind};
use darm_core::units::Digest;
use darm_device::client::Client;
use darm_device::link::faulty::FaultCounts;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use crate::answers::SETTLE_MS;
use crate::script::{HostAct, Script, Timed};
use crate::second_acts;
use crate::words;
use crate::world::{self, World};
use connection::Counted;

/// How often a host tries to connect, or to upload over a bad line.
const TRIES: u32 = 5;

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
    /// The start of the board, and the profile that it said then to be in force.
    in_force: Option<(u32, Digest)>,
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
            in_force: None,
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
                world::with(|world| world.begin_acts(second_acts::start(self.script, world.now_ns())));
                from_ms = world::with(|world| world.now_ns()) / 1_000_000;
            }
        }
    }

    /// Looks at a board that nothing disturbs any more, before and after a power cut.
    pub fn look_back(&mut self) {
        self.disconnect();
        world::with(World::calm_down);
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
            HostAct::Word(_) => Command::Word(words::word(&self.script.arm, seed)),
            HostAct::WrongWord(_) => return self.wrong_word(seed),
            HostAct::Servo(servo, _) if seed.is_multiple_of(2) => return self.turn_unseen(servo),
            HostAct::Servo(servo, mrad) => Command::Servo { servo, angle_rad: 1e-3 * mrad as f32 },
            HostAct::Upload(index) => return self.upload(index),
            HostAct::Stop => {
                self.stop("stop", |client| client.command(Command::Stop));
                self.renew();
                return;
            }
            HostAct::BootstrapStop => {
                self.stop("bootstrap stop", Client::stop_at_once);
                return self.act_after_stop();
            }
            HostAct::Pulse(coil) => return self.pulse(coil),
            HostAct::TwoPulses(first, second) => return self.two_pulses(first, second),
            HostAct::Exhaust(coil, table) => return self.exhaust(coil, table),
            HostAct::ExhaustOverProfiles(coil) => return self.exhaust_over_profiles(coil, seed),
            HostAct::RestartUnderWay => return self.restart_under_way(seed),
            HostAct::Calibrate(mrad) => return self.calibrate(1e-3 * mrad as f32),
            HostAct::Poll(count) => return self.poll(count),
            HostAct::Events => return self.events(),
            HostAct::StopThen(form) => return self.stop_then(form, seed),
            HostAct::TurnUnder(fault, mrad) => return self.turn_under(fault, 1e-3 * mrad as f32, seed, false),
            HostAct::TurnTogether(fault, mrad) => return self.turn_under(fault, 1e-3 * mrad as f32, seed, true),
            HostAct::MoveContradicted(is_closed) => return self.move_contradicted(is_closed, seed),
            HostAct::EndUnderWay => return self.end_under_way(seed),
            HostAct::ActWhileSafe(form) => return self.act_while_safe(form, seed),
            HostAct::LoseProfile => return self.lose_profile(seed),
            HostAct::LoseOffsets => return self.lose_offsets(seed),
            HostAct::RepeatStart => return self.repeat_start(seed),
            HostAct::Mislead => return self.mislead(seed),
            HostAct::Sag => return self.sag(seed, false),
            HostAct::SagAtTarget => return self.sag(seed, true),
            HostAct::ShortenChain => return self.shorten_chain(seed),
            HostAct::TurnByHand => return self.turn_by_hand(seed, false),
            HostAct::TurnFast => return self.turn_by_hand(seed, true),
            HostAct::Off(coil) => return self.off(coil),
            HostAct::Supply(form) => return self.supply(form, seed),
            HostAct::WearOut(tables) => return self.wear_out(tables, seed),
            HostAct::NoSuchState => return self.no_such_state(seed),
            HostAct::LatchContradicted(is_closed) => return self.latch_contradicted(is_closed, seed),
            HostAct::StopAgain => return self.stop_again(seed),
            HostAct::StopPulses => return self.stop_pulses(),
            HostAct::CutUnderChange => return self.cut_under_change(),
            HostAct::LateHello => return self.late_hello(seed),
            HostAct::WriteProfile(is_attended) => return self.write_profile(is_attended, seed),
            HostAct::PlayContradicted(is_closed) => return self.play_contradicted(is_closed, seed),
            HostAct::QuickLatch => return self.quick_latch(seed),
            HostAct::PeakOverReset => return self.peak_over_reset(seed),
        };
        self.command("command", command);
    }

    fn poll(&mut self, count: u32) {
        for _ in 0..count {
            if self.ask("status", Client::status).is_none() {
                return;
            }
        }
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
            for timed in &events {
                world::with(|world| match timed.event {
                    Event::Fault(fault) => {
                        world.pins.on_fault_report(world.now_ns(), fault.at.0);
                        world.judge_fault_at(&fault, started_ns);
                        judge_fault_in_program(world, &fault, started_ns);
                    }
                    Event::Started => world.judge_program(started_ns, timed.at),
                    Event::Finished => world.judge_end(started_ns, timed.at),
                    Event::Row { row, word } => world.reports.on_row(world.now_ns(), row, &word.to_string()),
                    _ => {}
                });
            }
        }
    }
}

/// A program that the host started must not end by a limit: it was rehearsed. What somebody else did since the start of
/// the board is not known.
fn judge_fault_in_program(world: &mut World, fault: &Fault, started_ns: u64) {
    let by_limit = matches!(fault.kind, FaultKind::OnTooLong { .. } | FaultKind::Duty { .. });
    if let Some(row) = fault.row.filter(|_| by_limit && !world.is_hostile_since(started_ns)) {
        world.reports.on_limit_in_program(world.now_ns(), row, &format!("{:?}", fault.kind));
    }
}
