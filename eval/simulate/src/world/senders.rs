//! Who has sent what to the board, and what the judges conclude from it.

use darm_core::sequencer::{Command, Fault, FaultKind, Phase};
use darm_core::units::Micros;
use darm_core::wire::message::{ImageKind, REPLY, REQUEST, Refusal, Reply, Request};
use darm_core::wire::{bootstrap, frame};
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

use super::World;
use crate::answers::PULSE_MS;
use crate::hostile::{self, Sent};
use crate::judge::reports::{Ending, Pulse};
use crate::judge::servos::Wish;
use crate::script::StopForm;

/// After a stop that came behind a command the lines are off within this time, ms of the board's clock.
const STOP_MS: u64 = 3;
/// For this time nothing that came before that stop may act, ms.
const QUIET_MS: u64 = 60;

/// Bytes of 115 200 baud in a tick, and the texts that are more than the line takes at once.
const BYTES_A_TICK: usize = 12;
const HELPS: usize = 3;
/// Texts that last longer than the emergency stop is pressed.
const LONG_HELPS: usize = 12;
/// A pulse ends this much late, ms of the board's clock: two late ticks, and the one in which it begins.
const PULSE_LATE_MS: u64 = 3;
/// A request to leave the safe state acts within this time, ns: three ticks.
const CLEAR_NS: u64 = 3_000_000;
/// The board answers a caller within this time, ns, or not at all.
const CALL_NS: u64 = 300_000_000;

/// A connection that somebody opened.
#[derive(Clone, Copy, Debug)]
pub struct Opened {
    /// Its number.
    pub link: u32,
    /// The challenge that its `Hello` carried.
    pub challenge: u64,
    /// When that arrived first.
    pub at_ns: u64,
}

/// Somebody who waits for the challenge to send something.
pub(super) struct Caller {
    link: u32,
    number: u16,
    until_ns: u64,
    frames: Vec<Sent>,
}

/// Who sends to the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Party {
    /// The host of the script.
    First,
    /// The second host.
    Second,
    /// The hostile sender.
    Hostile,
}

/// A command that switches one coil on for [`PULSE_MS`].
#[derive(Clone, Copy, Debug)]
pub struct Pulsed {
    coil: u8,
    /// The line that gets current first.
    line: u8,
    /// When the host began to bring the board to rest.
    began_ns: u64,
    sent_ns: u64,
    rises: u32,
    /// Of all lines that are not the coil's.
    rises_of_others: u32,
    has_supply: bool,
}

impl Pulsed {
    /// The coil may still be switched on once the pulse is over: it waits for the supply, or the line holds a copy back.
    pub fn may_come_late(&self, ending: Ending) -> bool {
        !self.has_supply || ending == Ending::Unknown
    }
}

/// After the end of a program its lines go off within this time, ns: two ticks.
const END_NS: u64 = 3_000_000;

impl World {
    /// True if the hostile sender has sent something since then.
    pub fn is_hostile_since(&self, since_ns: u64) -> bool {
        self.hostile_ns.is_some_and(|at| at >= since_ns)
    }

    /// True if anybody but this host has sent something since then that acts.
    pub fn has_other_acted_since(&self, party: Party, since_ns: u64) -> bool {
        let other = self.acted_ns[usize::from(party == Party::First)];
        self.is_hostile_since(since_ns) || other.is_some_and(|at| at >= since_ns)
    }

    /// Whether no load of somebody else's command takes the supply from what this party commands from then on.
    pub fn has_supply_alone(&self, party: Party, began_ns: u64) -> bool {
        !self.has_other_acted_since(party, began_ns.saturating_sub(self.arm.supplied_ns()))
    }

    /// An upload of this host ended.
    pub fn on_upload(&mut self, party: Party, model: u64, ending: Ending, began_ns: u64) {
        let of_others = self.commits.iter().filter(|&&(by, _, at_ns)| by != party && at_ns >= began_ns);
        let concurrent: Vec<u64> = of_others.map(|commit| commit.1).collect();
        self.reports.on_upload(self.now_ns(), model, ending, &concurrent);
        if self.store_damaged_ns.is_some_and(|at_ns| at_ns >= began_ns) {
            self.reports.on_store_damaged();
        }
    }

    /// This host had a stop confirmed that it began then: what still moves, if nobody else has acted since.
    pub fn judge_stopped(&mut self, party: Party, began_ns: u64, at_once: bool) {
        if self.has_other_acted_since(party, began_ns) {
            return;
        }
        self.on_stop(began_ns);
        let (now_ns, lines) = (self.now_ns(), self.pins.high());
        let reachable = !at_once && !self.person.may_be_lost() && self.is_undisturbed_since(began_ns);
        let moving = if reachable { self.servos.moving() } else { None };
        self.reports.on_stopped(now_ns, lines, moving);
    }

    /// A host is about to send a pulse of a coil to the board, which it has brought to rest since `began_ns`. `None` where something is on,
    /// or the coil is a latch's.
    pub fn begin_pulse(&self, coil: u8, began_ns: u64) -> Option<Pulsed> {
        let sent_ns = self.now_ns();
        let line = self.arm.pulsed_line(coil).filter(|_| self.pins.high() == 0)?;
        let (rises, has_supply) = (self.pins.rises(line), self.pins.has_supply(sent_ns, 1));
        let rises_of_others = self.pins.rises_of_others(self.lines_of(coil));
        Some(Pulsed { coil, line, began_ns, sent_ns, rises, rises_of_others, has_supply })
    }

    fn lines_of(&self, coil: u8) -> u64 {
        self.arm.coil_lines(coil).fold(0, |lines, line| lines | 1 << line)
    }

    /// The pulse is over, whatever came of it: what its lines did, if nobody else has acted since.
    pub fn judge_pulse(&mut self, party: Party, pulsed: Pulsed, ending: Ending) {
        let Pulsed { coil, line, began_ns, sent_ns, rises, rises_of_others, has_supply } = pulsed;
        if self.has_other_acted_since(party, began_ns) {
            return;
        }
        let now_ns = self.now_ns();
        let [on_ns, allowed_ns] = self.on_and_allowed_ns(coil, sent_ns, PULSE_MS);
        let has_supply = has_supply && self.has_supply_alone(party, began_ns);
        let undisturbed = has_supply && self.is_undisturbed_since(began_ns);
        let rises = self.pins.rises(line) - rises;
        let others = self.pins.rises_of_others(self.lines_of(coil)) - rises_of_others;
        self.reports.on_pulse(now_ns, Pulse { ending, rises, others, on_ns, allowed_ns, undisturbed });
    }

    /// A coil was commanded for this time, once since then, and nothing else acted. The pulse of a latch has the length of the table.
    pub fn judge_length(&mut self, coil: u8, sent_ns: u64, on_ms: u32) {
        if self.arm.pulsed_line(coil).is_none() {
            return;
        }
        let [on_ns, allowed_ns] = self.on_and_allowed_ns(coil, sent_ns, on_ms);
        self.reports.on_pulse_length(self.now_ns(), on_ns, allowed_ns);
    }

    /// The longest time that a line of a coil was on since then, and that for which a command of this length may have one on.
    fn on_and_allowed_ns(&self, coil: u8, sent_ns: u64, on_ms: u32) -> [u64; 2] {
        let now_ns = self.now_ns();
        let on_ns = self.arm.coil_lines(coil).map(|line| self.pins.longest_on_ns(now_ns, line, sent_ns)).max();
        [on_ns.unwrap_or(0), self.pins.true_us_ns(1_000 * (u64::from(on_ms) + PULSE_LATE_MS))]
    }

    /// A coil was switched off by hand before its time was over, which was confirmed a few ticks ago.
    pub fn judge_off(&mut self, party: Party, pulsed: Pulsed) {
        let lines = self.lines_of(pulsed.coil) & self.pins.high();
        if !self.has_other_acted_since(party, pulsed.began_ns) {
            self.reports.on_pulses_over(self.now_ns(), lines);
        }
    }

    /// What flash holds, for judge 2.
    pub fn judge_loaded(&mut self, asked_ns: u64, model: Option<u64>, rows: u16) {
        if self.foreign_ns.is_none_or(|foreign_ns| foreign_ns < asked_ns) {
            self.has_own_table = model.is_some_and(|model| self.own_models.contains(&model));
        }
        let (now_ns, flash) = (self.now_ns(), self.bench.flash().clone());
        self.reports.on_loaded(now_ns, asked_ns, model, rows, |image| flash.holds(image));
        self.reports.on_overwrites(now_ns, flash.overwrites());
    }

    /// A stop acts that was sent at this time at the latest: what came before it explains nothing any more.
    pub fn on_stop(&mut self, sent_ns: u64) {
        self.servos.end_orders(sent_ns);
        self.ended_ns = self.ended_ns.max(sent_ns);
    }

    /// A host sends bytes.
    pub(crate) fn on_sent(&mut self, party: Party, bytes: &[u8]) {
        self.trace.mix(bytes);
        self.quiet_ns = None;
        self.arrive(party, bytes);
        self.bench.send(bytes);
    }

    /// A host sends commands on a connection that a stop has ended: nothing may come of them. Where somebody else has sent since
    /// `rest_ns`, that program may be on its way to a row; lines that are on already are somebody else's.
    pub fn send_commands_of_before(&mut self, opened: Opened, seed: u64, rest_ns: u64) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let Sent { bytes, what } = hostile::commands_of_before(&mut rng, opened.link, opened.challenge, &self.arm);
        let (at_ms, challenge) = (opened.at_ns / 1_000_000, opened.challenge);
        self.say("world", || format!("{what}, opened at {at_ms} ms with challenge {challenge:x}"));
        self.arrive(Party::Hostile, &bytes);
        self.bench.send(&bytes);
        if !self.has_other_acted_since(Party::First, rest_ns) && self.pins.high() == 0 {
            let now_ns = self.now_ns();
            self.quiet_ns = Some((now_ns, now_ns + 300_000_000));
        }
    }

    /// A person types a stop, behind whatever is on the line.
    pub fn type_stop(&mut self, seed: u64) {
        const BEFORE: [&[u8]; 4] = [b"", b"\xff\x01", b"sto", b"garbage "];
        let before = BEFORE[(seed >> 16) as usize % BEFORE.len()];
        self.say("world", || format!("{before:?} stop"));
        self.switches.on_interrupted(self.now_ns());
        self.bench.send(&[before, hostile::TYPED_STOP].concat());
    }

    /// Somebody types a line.
    pub fn type_line(&mut self, line: &str) {
        let now_ns = self.now_ns();
        (self.hostile_ns, self.disturbed_ns, self.quiet_ns) = (Some(now_ns), now_ns, None);
        self.send_hostile(vec![Sent { bytes: format!("{line}\r").into_bytes(), what: line.to_owned() }]);
    }

    /// Somebody asks for long texts, which leave at 115 200 baud, and stops in this form right behind that.
    pub fn stop_behind_help(&mut self, form: StopForm, seed: u64) {
        let number = (seed >> 32) as u16;
        let stop = match form {
            StopForm::Typed | StopForm::Input => hostile::TYPED_STOP.to_vec(),
            StopForm::Bootstrap => hostile::stop(number).bytes,
            StopForm::Message => hostile::stop_message((seed >> 16) as u32, number),
        };
        self.say("world", || format!("help, {form:?} stop"));
        self.switches.on_texts();
        self.bench.set_pace(BYTES_A_TICK);
        self.bench.send(&[b"help\r".repeat(HELPS).as_slice(), &stop].concat());
    }

    /// Somebody asks for long texts, which leave at 115 200 baud, and types behind that what would leave the safe state and drive.
    pub fn type_behind_help(&mut self, coil: u8) {
        self.say("world", || format!("help, clear, coil {coil} on"));
        self.switches.on_texts();
        self.bench.set_pace(BYTES_A_TICK);
        self.bench.send(format!("{}clear\rcoil {coil} on 400\r", "help\r".repeat(LONG_HELPS)).as_bytes());
    }

    /// The line of the board is as fast as any again.
    pub fn hurry(&mut self) {
        self.bench.set_pace(usize::MAX);
    }

    /// A connection that a stop or a start has ended: any of the run, half of them one of the last.
    pub fn ended_link(&self, seed: u64) -> Option<Opened> {
        // A host may have opened a connection of the same number again, after a reset for example.
        let is_open = |link: u32| self.links.iter().any(|opened| opened.link == link && opened.at_ns >= self.ended_ns);
        let ended = || self.links.iter().filter(|opened| opened.at_ns < self.ended_ns && !is_open(opened.link));
        let (count, back) = (ended().count(), (seed >> 1) as usize);
        let back = if seed & 1 == 0 { back % 6 } else { back };
        ended().rev().nth(back % count.max(1)).copied()
    }

    /// How the connection that a host used last was opened; `None` where that is still to come.
    pub fn host_link(&self) -> Option<Opened> {
        self.links.iter().rev().find(|opened| opened.link == self.host_link).copied()
    }

    /// The hostile sender sends.
    pub(super) fn send_hostile(&mut self, frames: Vec<Sent>) {
        for sent in frames {
            self.say("hostile", || sent.what);
            self.arrive(Party::Hostile, &sent.bytes);
            self.bench.send(&sent.bytes);
        }
    }

    /// The hostile sender asks for the challenge, and sends these on a separate connection when it comes.
    pub(super) fn call(&mut self, link: u32, number: u16, frames: Vec<Sent>) {
        self.hostile_ns = Some(self.now_ns());
        self.bench.send(&hostile::hello(link, number, 0));
        self.callers.push(Caller { link, number, until_ns: self.now_ns() + CALL_NS, frames });
    }

    /// Somebody asks for the challenge, and opens no connection yet.
    pub fn ask_challenge(&mut self, link: u32) {
        self.heard_challenge = None;
        self.bench.send(&hostile::hello(link, 0, 0));
    }

    /// What was answered to that.
    pub fn heard_challenge(&self) -> Option<u64> {
        self.heard_challenge
    }

    /// Bytes of the board: challenges that callers wait for.
    pub(super) fn hear_challenges(&mut self, received: &[u8]) {
        for byte in received {
            if *byte != 0 {
                self.reply.push(*byte);
                continue;
            }
            let mut reply = std::mem::take(&mut self.reply);
            let Ok((header, payload)) = frame::decode(&mut reply) else { continue };
            let result = postcard::from_bytes::<Reply>(payload).map(|reply| reply.result);
            if let (REPLY, Ok(Err(Refusal::Challenge { challenge }))) = (header.tag, result) {
                self.heard_challenge = Some(challenge);
                self.on_challenge(header.link, challenge);
            }
        }
        let now_ns = self.now_ns();
        self.callers.retain(|caller| caller.until_ns > now_ns);
    }

    fn on_challenge(&mut self, link: u32, challenge: u64) {
        let Some(index) = self.callers.iter().position(|caller| caller.link == link) else { return };
        let Caller { number, frames, .. } = self.callers.swap_remove(index);
        let now_ns = self.now_ns();
        (self.hostile_ns, self.quiet_ns, self.disturbed_ns) = (Some(now_ns), None, now_ns);
        if self.foreign_ns.is_some() {
            self.foreign_ns = Some(now_ns);
        }
        let hello = Sent { bytes: hostile::hello(link, number, challenge), what: format!("opens {link:x}") };
        self.send_hostile(vec![hello]);
        self.send_hostile(frames);
    }

    /// Bytes come to the board: what they ask for.
    pub(super) fn arrive(&mut self, party: Party, bytes: &[u8]) {
        for piece in bytes.split(|byte| *byte == 0).filter(|piece| !piece.is_empty()) {
            let mut body = piece.to_vec();
            match frame::decode(&mut body) {
                Ok((header, payload)) => self.on_frame(party, header, payload),
                Err(_) => {
                    self.switches.on_interrupted(self.now_ns());
                    String::from_utf8_lossy(piece).split(['\r', '\n']).for_each(|line| self.on_line(line));
                }
            }
        }
    }

    /// Text needs no connection.
    fn on_line(&mut self, line: &str) {
        let now_ns = self.now_ns();
        let words: Vec<&str> = line.split_whitespace().collect();
        match words.as_slice() {
            ["play"] => {
                self.servos.on_order(now_ns, Wish::Table);
                self.switches.on_latches_unknown();
            }
            ["clear"] => self.on_cleared(),
            ["servo", servo, angle_deg] => {
                if let (Ok(servo), Ok(angle_deg)) = (servo.parse(), angle_deg.parse::<f32>()) {
                    self.servos.on_order(now_ns, Wish::Angle(servo, angle_deg.to_radians()));
                }
            }
            _ => {}
        }
    }

    fn on_cleared(&mut self) {
        self.cleared_ns = self.now_ns();
        self.board_supply.on_cleared();
        self.servos.on_cleared();
    }

    fn on_frame(&mut self, party: Party, header: frame::Header, payload: &[u8]) {
        let now_ns = self.now_ns();
        let request = (header.tag == REQUEST).then(|| postcard::from_bytes::<Request<'_>>(payload).ok()).flatten();
        let is_by_hand =
            |command: &Command| matches!(command, Command::Coil { .. } | Command::Word(_) | Command::Servo { .. });
        let leaves_running = |request: &Request<'_>| match request {
            Request::Command(command) => is_by_hand(command),
            request => request.is_repeatable(),
        };
        if !request.as_ref().is_some_and(leaves_running) {
            self.switches.on_interrupted(now_ns);
        }
        if let Some(request) = &request {
            self.on_request(header.link, request);
        }
        if party == Party::Hostile {
            return;
        }
        if header.link != 0 && party == Party::First {
            self.host_link = header.link;
        }
        if let Some(Request::Commit(image)) = request
            && image.kind == ImageKind::Table
        {
            self.commits.push((party, image.model.0, now_ns));
            self.reports.on_upload(now_ns, image.model.0, Ending::Unknown, &[]);
        }
        let stops_or_restarts = matches!(
            bootstrap::Request::decode(header.tag, payload),
            Some(bootstrap::Request::Stop | bootstrap::Request::Reboot(_))
        );
        if stops_or_restarts || request.is_some_and(|request| !request.is_repeatable()) {
            self.acted_ns[usize::from(party == Party::Second)] = Some(now_ns);
        }
    }

    /// What a request asks for, on a connection that may have ended.
    fn on_request(&mut self, link: u32, request: &Request<'_>) {
        let now_ns = self.now_ns();
        let is_open = self.links.iter().any(|opened| opened.link == link && opened.at_ns >= self.ended_ns);
        match *request {
            // A copy opens nothing again.
            Request::Hello { challenge, .. } if challenge != 0 => {
                let is_copy = |opened: &Opened| (opened.link, opened.challenge) == (link, challenge);
                if !self.links.iter().any(is_copy) {
                    self.links.push(Opened { link, challenge, at_ns: now_ns });
                }
            }
            Request::Command(Command::Clear) => self.on_cleared(),
            Request::Command(Command::Play) if is_open => {
                self.servos.on_order(now_ns, Wish::Table);
                self.switches.on_play();
            }
            Request::Command(Command::Servo { servo, angle_rad }) if is_open => {
                self.servos.on_order(now_ns, Wish::Angle(servo, angle_rad));
            }
            Request::Calibrate(calibration) => {
                self.servos.on_offsets(calibration.offsets_rad());
            }
            Request::Commit(image) => {
                self.wear.on_commit();
                self.switches.on_latches_unknown();
                if image.kind == ImageKind::Profile {
                    self.person.on_commit(now_ns, image.digest.0);
                }
            }
            _ => {}
        }
    }

    /// The board says what it does, to somebody who asked at `asked_ns`.
    pub fn judge_running(&mut self, asked_ns: u64, phase: &Phase) {
        let begun_ns = self.pins.started_ns();
        if !self.has_own_table || begun_ns >= asked_ns {
            return;
        }
        let now_ns = self.now_ns();
        match phase {
            Phase::Manual => self.switches.on_running(now_ns, asked_ns, None),
            Phase::Playing { started, .. } => {
                let started_ns = begun_ns + self.pins.true_us_ns(started.0);
                self.switches.on_running(now_ns, asked_ns, Some(started_ns));
            }
            Phase::Idle | Phase::Approaching { .. } | Phase::Safe(_) => {}
        }
    }

    /// The board reports that a program of its start has begun at that time.
    pub fn judge_program(&mut self, started_ns: u64, at: Micros) {
        let begun_ns = started_ns + self.pins.true_us_ns(at.0);
        if self.has_own_table && !self.has_other_acted_since(Party::First, begun_ns) {
            self.switches.on_started(self.now_ns(), begun_ns);
        }
    }

    /// The board reports that a program of its start has ended at that time.
    pub fn judge_end(&mut self, started_ns: u64, at: Micros) {
        let ended_ns = started_ns + self.pins.true_us_ns(at.0);
        let lines = self.pins.on_over(ended_ns, ended_ns + END_NS);
        if lines != 0 {
            self.reports.on_lines_after_end(self.now_ns(), lines);
        }
    }

    /// The board reports a fault of its start at that time.
    pub fn judge_fault_at(&mut self, fault: &Fault, started_ns: u64) {
        let now_ns = self.now_ns();
        let fault_ns = started_ns + self.pins.true_us_ns(fault.at.0);
        if matches!(fault.kind, FaultKind::Switch { .. }) && self.has_own_table {
            self.switches.on_fault(now_ns, fault_ns);
        }
        if matches!(fault.kind, FaultKind::Supply { .. }) {
            self.board_supply.on_fault(now_ns, fault_ns);
        }
        // It is cleared a tick or two after that was requested.
        if self.cleared_ns + CLEAR_NS < fault_ns {
            self.servos.on_fault(now_ns, fault_ns);
            self.servos.on_latched(now_ns);
        }
    }

    /// Lines are on: none may be because of a command that a stop followed at once, or that came after a stop on a connection
    /// from before it.
    pub(super) fn judge_quiet(&mut self) {
        let Some((from_ns, until_ns)) = self.quiet_ns else { return };
        let now_ns = self.bench.now_ns();
        let after_ns = now_ns - from_ns;
        if now_ns > until_ns {
            self.quiet_ns = None;
        } else if after_ns > STOP_MS * 1_020_000 {
            self.reports.on_lines_after_burst(now_ns, after_ns, self.pins.high());
            self.quiet_ns = None;
        }
    }

    /// A command and a stop have come in one piece.
    pub(super) fn begin_quiet(&mut self) {
        let now_ns = self.now_ns();
        self.on_stop(now_ns + 1);
        self.quiet_ns = Some((now_ns, now_ns + QUIET_MS * 1_000_000));
    }
}
