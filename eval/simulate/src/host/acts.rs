//! The host's acts that need more than one request, each with what the judges learn from it.

use darm_core::output::MAX_SERVOS;
use darm_core::sequencer::{Command, Phase};
use darm_core::wire::bootstrap::RebootTarget;
use darm_core::wire::message::Calibration;
use darm_device::client::{Client, ClientError};
use darm_sim::plant::servo_bus::ServoFaults;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::{FirstUpload, Host, TRIES};
use crate::answers::{self, PULSE_MS, SETTLE_MS};
use crate::arm::{ALL_SWITCHES, Table};
use crate::judge::reports::Ending;
use crate::script::{StopForm, Timed, TurnFault, WorldAct};
use crate::words;
use crate::world::{self, BACK_MS, Opened, Party, World};

/// No program of a script lasts longer, s.
const LONGEST_PROGRAM_S: u32 = 25;
/// One use of an output that is to be used up, ms: below the shortest limit of on-time.
const USE_MS: u32 = 400;
/// After one use and this time every output may have its next peak, ms.
const PEAK_WAIT_MS: u64 = 200;
/// No output of a script waits longer for its next peak, ms.
const PEAK_PAUSE_MS: u64 = 600;
/// The table whose peaks are half as long.
const HASTY: usize = 2;
/// A start takes this time until the board answers, ms.
const START_MS: u64 = 30;
/// Tries of a peak after a start, each 20 ms.
const PEAK_TRIES: u32 = 40;
/// Cycles of a latch that use up the longest window.
const CYCLES: u32 = 120;
/// Stops of a servo that rests: each must leave it where it is.
const STOPS: u32 = 6;
/// Times in which a servo that rests answers nothing, and the time of each and between them, ms: each must leave it where it is.
const SILENCES: u32 = 8;
const SILENCE_MS: u64 = 100;
/// Questions whether a program has begun, each 50 ms: no approach lasts longer.
const APPROACH_POLLS: u32 = 120;
/// A servo that takes no order is noticed within this time: four tries, and its time-out, ms.
const STUBBORN_MS: u64 = 800;
/// A coil that is on while servos turn, ms: longer than the time-out of a servo.
const LONG_MS: u32 = 700;
/// Commands by hand while switches are stuck, and the longest pause between two, ms: about the time of travel.
const MOVES: u32 = 6;
const MOVE_PAUSE_MS: u64 = 120;
/// Stops that leave latches set, one after the other.
const LEFT_LATCHES: u32 = 4;
/// This number of uses fills the longest window.
const USES: u32 = 30;
/// After the last byte of a stop, or after the emergency stop is pressed, all outputs are off within this time, ms.
const STOP_MS: u64 = 6;
/// Two visits of the servos, and their answers.
const VISITS_MS: u64 = 30;

/// Zero offsets by that of the first servo, each another one: none is taken for another's unseen.
pub(super) fn offsets(first_rad: f32) -> Option<Calibration> {
    Calibration::try_from([1.0, -0.5, 0.25, -1.0].map(|share| share * first_rad)).ok()
}

impl Host<'_> {
    /// Turns a servo that has not answered since the board started: whatever the board says, it is not driven.
    pub(super) fn turn_unseen(&mut self, servo: u8) {
        if !self.is_own_table_at_rest() {
            return;
        }
        // They would do what they are sent, and none of their answers arrives.
        world::with(|world| world.break_servos(ServoFaults { mute: u8::MAX, ..ServoFaults::default() }));
        self.ask("reboot", |client| client.reboot(RebootTarget::Application));
        world::pass(SETTLE_MS);
        for _ in 0..2 {
            self.command("turn", Command::Servo { servo, angle_rad: 0.0 });
        }
        world::pass(SETTLE_MS);
        world::with(|world| world.break_servos(ServoFaults::default()));
    }

    /// Uses one output up to its limit, then changes the table, then restarts the board: its limit stays what it is.
    pub(super) fn exhaust(&mut self, coil: u8, table: usize) {
        if self.script.arm.pulsed_line(coil).is_none() || !self.is_own_table_at_rest() {
            return;
        }
        self.use_up(coil);
        self.halt();
        self.upload(table);
        self.use_up(coil);
        self.halt();
        self.ask("reboot", |client| client.reboot(RebootTarget::Application));
        world::pass(SETTLE_MS);
        self.use_up(coil);
    }

    /// After one refusal it tries again: the output may have to wait for its next peak. After two it is used up.
    pub(super) fn use_up(&mut self, coil: u8) {
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
    pub(super) fn calibrate(&mut self, offset_rad: f32) {
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
        // The last row's target reaches a servo with the next visit.
        world::pass(VISITS_MS);
        let (began_ns, before) = world::with(|world| (world.now_ns(), world.servos.places()));
        let is_done = self.set_offsets(offset_rad);
        world::pass(SETTLE_MS);
        world::with(|world| {
            let is_alone = !world.has_other_acted_since(Party::First, began_ns);
            if is_done && is_alone && world.is_undisturbed_since(began_ns) {
                world.servos.on_calibrated(world.now_ns(), &before);
            }
        });
    }

    /// Sets the zero offsets of all servos; whether that was confirmed.
    pub(super) fn set_offsets(&mut self, first_rad: f32) -> bool {
        let (Some(calibration), Some(client)) = (offsets(first_rad), self.client()) else {
            return false;
        };
        let result = client.calibrate(calibration);
        let is_done = result.is_ok();
        self.note("calibrate", result);
        is_done
    }

    /// A command that no state of the arm obeys: whatever happens, the board must not confirm it.
    pub(super) fn wrong_word(&mut self, seed: u64) {
        if !self.is_own_table_at_rest() {
            return;
        }
        let began_ns = world::with(|world| world.now_ns());
        let command = Command::Word(words::wrong_word(&self.script.arm, seed));
        let ending = self.command("wrong word", command);
        world::with(|world| {
            if ending == Ending::Done && !world.is_hostile_since(began_ns) {
                world.reports.on_impossible_confirmed(world.now_ns(), &format!("{command:?}"));
            }
        });
    }

    /// The first upload is repeated as a person would, for nothing but the line disturbs it.
    pub(super) fn upload(&mut self, index: usize) {
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

    pub(super) fn upload_once(&mut self, table: &Table) -> (Ending, String) {
        let Some(client) = self.client() else { return (Ending::Unknown, "no connection".into()) };
        let began_ns = world::with(|world| world.now_ns());
        let result = client.upload(&table.image, &mut |_| {});
        let ending = answers::upload_ending(&result);
        let text = self.note("upload", result);
        world::with(|world| world.on_upload(Party::First, table.model, ending, began_ns));
        (ending, text)
    }

    /// Stops, and sees whether the board has stopped.
    pub(super) fn stop(&mut self, name: &'static str, stop: impl Fn(&mut Client) -> Result<(), ClientError>) {
        let began_ns = world::with(|world| world.now_ns());
        if self.ask(name, &stop).is_none() {
            return;
        }
        world::with(|world| world.on_stop(began_ns));
        // The answer leaves before the next tick.
        world::pass(2);
        world::with(|world| world.judge_stopped(Party::First, began_ns, true));
        world::pass(SETTLE_MS);
        world::with(|world| world.judge_stopped(Party::First, began_ns, false));
    }

    /// A command on the connection of before the stop, as if it had been sent before it.
    pub(super) fn act_after_stop(&mut self) {
        let Some((client, _)) = &mut self.client else { return };
        let result = client.command(Command::Coil { coil: 0, on_ms: PULSE_MS });
        let calibration = Calibration::try_from([0.0; MAX_SERVOS]).ok();
        let calibrated = calibration.map(|calibration| client.calibrate(calibration));
        if result.is_ok() || calibrated.as_ref().is_some_and(Result::is_ok) {
            world::with(|world| world.reports.on_command_after_stop(world.now_ns()));
        }
        self.note("command after a stop", result);
        if let Some(calibrated) = calibrated {
            self.note("calibration after a stop", calibrated);
        }
    }

    /// Stops, then switches one coil on for a moment: the line is switched on once if that was confirmed. One with a peak again before its
    /// pause is over.
    pub(super) fn pulse(&mut self, coil: u8) {
        let began_ns = world::with(|world| world.now_ns());
        if !self.is_own_table_at_rest() {
            return;
        }
        for _ in 0..if self.script.arm.has_peak(coil) { 2 } else { 1 } {
            let Some(pulsed) = world::with(|world| world.begin_pulse(coil, began_ns)) else { return };
            let ending = self.command("pulse", Command::Coil { coil, on_ms: PULSE_MS });
            world::pass(SETTLE_MS);
            world::with(|world| world.judge_pulse(Party::First, pulsed, ending));
            if pulsed.may_come_late(ending) {
                // The next command would give it another time.
                return;
            }
        }
    }

    /// Stops, then switches one coil on, and off before its time is over.
    pub(super) fn off(&mut self, coil: u8) {
        let began_ns = world::with(|world| world.now_ns());
        if !self.is_own_table_at_rest() {
            return;
        }
        let Some(pulsed) = world::with(|world| world.begin_pulse(coil, began_ns)) else { return };
        for on_ms in [USE_MS, 0] {
            if self.command("off", Command::Coil { coil, on_ms }) != Ending::Done {
                return;
            }
            world::pass(10);
        }
        world::with(|world| world.judge_off(Party::First, pulsed));
    }

    /// Two coils at once, the second for a shorter time.
    pub(super) fn two_pulses(&mut self, first: u8, second: u8) {
        let began_ns = world::with(|world| world.now_ns());
        if !self.is_own_table_at_rest() {
            return;
        }
        if first == second {
            return self.pulse_again(first, began_ns);
        }
        // What resets a latch at the end of its time waits for the supply too.
        let loads = |coil| if self.script.arm.pulsed_line(coil).is_some() { 1 } else { 2 };
        let loads = loads(first) + loads(second);
        if !world::with(|world| world.pins.has_supply(world.now_ns(), loads)) {
            return;
        }
        let sent_ns = world::with(|world| world.now_ns());
        let pulses = [(first, 2 * PULSE_MS), (second, PULSE_MS)];
        for (coil, on_ms) in pulses {
            if self.command("pulse", Command::Coil { coil, on_ms }) == Ending::Unknown {
                // The line may hold a copy back that acts later.
                return;
            }
            world::pass(PULSE_MS.into());
        }
        world::pass(SETTLE_MS);
        world::with(|world| {
            if world.is_undisturbed_since(began_ns) && world.has_supply_alone(Party::First, began_ns) {
                world.reports.on_pulses_over(world.now_ns(), world.pins.high());
                for (coil, on_ms) in pulses {
                    world.judge_length(coil, sent_ns, on_ms);
                }
            }
        });
    }

    /// A coil that is on is commanded for another time, which counts from then on.
    fn pulse_again(&mut self, coil: u8, began_ns: u64) {
        let sent_ns = world::with(|world| world.now_ns());
        for on_ms in [USE_MS, PULSE_MS] {
            if self.command("pulse", Command::Coil { coil, on_ms }) != Ending::Done {
                return;
            }
        }
        let again_ms = world::with(|world| world.now_ns() - sent_ns).div_ceil(1_000_000) as u32;
        world::pass(u64::from(USE_MS));
        world::with(|world| {
            if world.is_undisturbed_since(began_ns) && world.has_supply_alone(Party::First, began_ns) {
                world.judge_length(coil, sent_ns, again_ms + PULSE_MS);
            }
        });
    }

    /// Something runs, and somebody asks for a restart: the board continues.
    pub(super) fn restart_under_way(&mut self, seed: u64) {
        let Some(coil) = self.script.arm.steady_coil().filter(|_| self.is_own_table_at_rest()) else { return };
        if self.command("run", Command::Coil { coil, on_ms: USE_MS }) != Ending::Done {
            return;
        }
        world::pass(10 + seed % 50);
        let asked_ns = world::with(|world| world.now_ns());
        let is_accepted = self.ask("reboot", |client| client.reboot(RebootTarget::Application)).is_some();
        world::pass(SETTLE_MS);
        world::with(|world| {
            // The request may have come when a fault had switched the coil off.
            let lines = if world.reset_ns > asked_ns { world.reset_lines } else { 0 };
            if is_accepted && lines != 0 && !world.has_other_acted_since(Party::First, asked_ns) {
                world.reports.on_restart_under_way(world.now_ns(), lines);
            }
        });
        self.renew();
    }

    /// Stops the board; true when it has stopped, all lines are off, and the loaded table is one of the script.
    pub(super) fn is_own_table_at_rest(&mut self) -> bool {
        if !self.halt() {
            return false;
        }
        world::pass(SETTLE_MS);
        let model = self.ask("status", Client::status).and_then(|status| status.model);
        let own = self.script.tables.iter().any(|table| model.is_some_and(|model| model.0 == table.model));
        own && world::with(|world| world.pins.high()) == 0
    }

    /// Stops by the request that never changes, and opens the connection again, which a stop ends; whether that was confirmed.
    pub(super) fn halt(&mut self) -> bool {
        let began_ns = world::with(|world| world.now_ns());
        if self.ask("stop", Client::stop).is_none() {
            return false;
        }
        world::with(|world| world.on_stop(began_ns));
        self.renew()
    }

    /// Opens the connection again.
    pub(super) fn renew(&mut self) -> bool {
        let Some(client) = self.client() else { return false };
        let result = client.say_hello();
        let is_open = result.is_ok();
        if is_open {
            self.look_at_profile();
        }
        self.note("hello", result);
        is_open
    }

    /// Something runs, then it is stopped, then all commands come again on the connection of before.
    pub(super) fn stop_then(&mut self, form: StopForm, seed: u64) {
        if !self.is_own_table_at_rest() {
            return;
        }
        let coil = (seed >> 8) as usize % self.script.arm.coils.len().max(1);
        let command = match seed % 3 {
            0 => Command::Coil { coil: coil as u8, on_ms: USE_MS },
            1 => Command::Servo { servo: 0, angle_rad: self.far_angle_rad(0, 0.4) },
            _ => Command::Play,
        };
        self.command("run", command);
        world::pass(10 + seed % 150);
        let link = world::with(|world| world.host_link());
        let began_ns = world::with(|world| world.now_ns());
        let is_stopped = match form {
            StopForm::Typed | StopForm::Bootstrap | StopForm::Message if seed >> 24 & 1 == 1 => {
                world::with(|world| world.stop_behind_help(form, seed));
                true
            }
            StopForm::Typed => {
                world::with(|world| world.type_stop(seed));
                true
            }
            // Who opens a connection while somebody presses it already may leave the safe state by it.
            StopForm::Input if world::with(|world| world.is_stop_pressed()) => false,
            StopForm::Input => {
                if seed >> 24 & 1 == 1 {
                    world::with(|world| world.type_behind_help(coil as u8));
                    world::pass(STOP_MS);
                }
                world::with(|world| world.press_emergency_stop(true));
                true
            }
            StopForm::Bootstrap => self.ask("stop", Client::stop_at_once).is_some(),
            StopForm::Message => self.ask("stop", |client| client.command(Command::Stop)).is_some(),
        };
        if !is_stopped {
            return;
        }
        world::pass(STOP_MS);
        if form != StopForm::Input {
            world::with(|world| {
                world.hurry();
                world.on_stop(began_ns);
                world.judge_stopped(Party::First, began_ns, true);
            });
        }
        if let Some(link) = link {
            world::with(|world| world.send_commands_of_before(link, seed, began_ns));
        }
        world::pass(SETTLE_MS);
        if form == StopForm::Input {
            world::with(|world| world.press_emergency_stop(false));
            world::pass(STOP_MS);
            if let Some(link) = link {
                // Under other numbers: those of the first time would be copies.
                world::with(|world| world.send_commands_of_before(link, !seed, began_ns));
            }
            world::with(World::hurry);
            world::pass(SETTLE_MS);
            self.events();
            self.command("clear", Command::Clear);
        } else {
            world::with(|world| world.judge_stopped(Party::First, began_ns, false));
            self.renew();
        }
        world::pass(2 * SETTLE_MS);
    }

    /// Commands on a connection that a stop has ended, behind a copy of what had opened it.
    pub(super) fn late_hello(&mut self, seed: u64) {
        let rest_ns = world::with(|world| world.now_ns());
        if !self.is_own_table_at_rest() {
            return;
        }
        let link = (seed >> 32) as u32 | 1;
        let asked = if seed >> 2 & 1 == 1 {
            world::with(|world| world.ask_challenge(link));
            world::pass(5);
            world::with(|world| world.heard_challenge())
        } else {
            None
        };
        // Half of them on the connection in use, after one more stop.
        if seed & 1 == 1 {
            let began_ns = world::with(|world| world.now_ns());
            if self.ask("stop", Client::stop_at_once).is_none() {
                return;
            }
            world::with(|world| world.on_stop(began_ns));
        }
        world::with(|world| {
            // A challenge of before the stop opens nothing after it.
            let late = |challenge| Opened { link, challenge, at_ns: rest_ns };
            let opened = asked.filter(|_| seed & 1 == 1).map(late).or_else(|| world.ended_link(seed >> 1));
            if let Some(opened) = opened {
                world.send_commands_of_before(opened, seed, rest_ns);
            }
        });
        world::pass(SETTLE_MS);
    }

    /// An angle on the other side of the middle, rad.
    pub(super) fn far_angle_rad(&self, servo: usize, angle_rad: f32) -> f32 {
        let step = world::with(|world| world.servos.places().get(servo).copied()).map_or(2048.0, |(step, _)| step);
        if step > 2048.0 { -angle_rad } else { angle_rad }
    }

    /// A servo turns far, with all others and under current or alone, and meanwhile something happens to it.
    pub(super) fn turn_under(&mut self, fault: TurnFault, angle_rad: f32, seed: u64, together: bool) {
        let count = self.script.arm.servos.len();
        if count == 0 || !self.is_own_table_at_rest() {
            return;
        }
        let index = seed as usize % count;
        if together {
            self.command("coil", Command::Coil { coil: 0, on_ms: LONG_MS });
            for other in (0..count).filter(|other| *other != index) {
                let angle_rad = self.far_angle_rad(other, angle_rad.abs());
                self.command("turn", Command::Servo { servo: other as u8, angle_rad });
            }
        }
        let far_rad = self.far_angle_rad(index, angle_rad.abs());
        let turn = Command::Servo { servo: index as u8, angle_rad: far_rad };
        if self.command("turn", turn) != Ending::Done {
            return;
        }
        world::pass(60 + (seed >> 8) % 150);
        let (mask, none) = (1 << index, ServoFaults::default());
        let stop = Client::stop_at_once;
        match fault {
            TurnFault::StopWithDamage => {
                world::with(|world| world.break_servos(ServoFaults { damaged: mask, ..none }));
                world::pass(20);
                self.stop("stop", stop);
            }
            TurnFault::StopUnconfirmed => {
                world::with(|world| world.break_servos(ServoFaults { unconfirmed: mask, ..none }));
                self.stop("stop", stop);
                world::pass(2_000);
            }
            TurnFault::Stop => {
                for _ in 0..STOPS {
                    self.stop("stop", stop);
                    world::pass(500);
                }
            }
            TurnFault::StopDeaf => {
                world::with(|world| world.break_servos(ServoFaults { deaf: mask, ..none }));
                let began_ns = world::with(|world| world.now_ns());
                if self.ask("stop", stop).is_some() {
                    world::with(|world| world.on_stop(began_ns));
                }
                world::pass(10);
            }
            TurnFault::Overload | TurnFault::Strained => {
                let faults = if fault == TurnFault::Strained {
                    ServoFaults { strained: mask, ..none }
                } else {
                    ServoFaults { overloaded: mask, ..none }
                };
                world::with(|world| world.break_servos(faults));
                world::pass(2 * SETTLE_MS);
                self.events();
            }
            TurnFault::Input => {
                world::with(|world| world.press_emergency_stop(true));
                world::pass(2 * SETTLE_MS);
                world::with(|world| world.press_emergency_stop(false));
                self.events();
            }
            TurnFault::Silent => {
                world::with(|world| world.break_servos(ServoFaults { mute: mask, ..none }));
                world::pass(2 * SETTLE_MS);
                self.command("clear", Command::Clear);
                self.command("coil", Command::Coil { coil: 0, on_ms: PULSE_MS });
                self.command("turn", turn);
                self.command("play", Command::Play);
            }
            TurnFault::Stubborn => {
                // On its way it would leave its next target, which is noticed before.
                world::pass(BACK_MS);
                world::with(|world| world.break_servos(ServoFaults { stubborn: mask, ..none }));
                self.command_while_stubborn(Command::Servo { servo: index as u8, angle_rad: -far_rad }, seed);
            }
            TurnFault::Silences => {
                self.stop("stop", stop);
                for _ in 0..SILENCES {
                    world::pass(SILENCE_MS);
                    world::with(|world| world.break_servos(ServoFaults { mute: mask, ..none }));
                    world::pass(SILENCE_MS);
                    world::with(|world| world.break_servos(none));
                }
            }
            TurnFault::StopAndStore => {
                let others = ServoFaults { mute: !mask, ..none };
                world::with(|world| world.break_servos(if seed >> 16 & 1 == 1 { others } else { none }));
                world::pass((seed >> 17) % 25);
                let table = &self.script.tables[(seed >> 24) as usize % self.script.tables.len()];
                world::with(|world| world.store_behind_stop(table, seed));
                world::pass(SETTLE_MS);
            }
        }
        if fault != TurnFault::StopDeaf {
            world::pass(SETTLE_MS);
        }
        world::with(|world| world.break_servos(none));
        world::pass(SETTLE_MS);
        self.events();
        self.command("clear", Command::Clear);
    }

    /// What a servo that takes no order is to do; once that had to be noticed nothing else is driven.
    fn command_while_stubborn(&mut self, order: Command, seed: u64) {
        let began_ns = world::with(|world| world.now_ns());
        if self.command("turn", order) != Ending::Done {
            return;
        }
        world::pass(STUBBORN_MS);
        let coil = Command::Coil { coil: self.script.arm.steady_coil().unwrap_or(0), on_ms: PULSE_MS };
        for command in [coil, Command::Word(words::word(&self.script.arm, seed))] {
            let is_accepted = self.command("while stubborn", command) == Ending::Done;
            world::with(|world| {
                let is_other = world.has_other_acted_since(Party::First, began_ns) || world.is_hostile_since(began_ns);
                if is_accepted && !is_other && world.pins.started_ns() < began_ns {
                    let (order, command) = (format!("{order:?}"), format!("{command:?}"));
                    world.reports.on_accepted_while_stubborn(world.now_ns(), &order, &command);
                }
            });
        }
    }

    /// The input of one of the arm's limit switches.
    fn one_switch(&self, seed: u64) -> u32 {
        let switches = self.script.arm.switches();
        switches.get(seed as usize % switches.len().max(1)).map_or(0, |switch| 1 << switch.input)
    }

    /// Runs the table while all limit switches, or one of them, say the same in every state.
    pub(super) fn play_contradicted(&mut self, is_closed: bool, seed: u64) {
        if !self.is_own_table_at_rest() {
            return;
        }
        let inputs = if seed & 1 == 0 { ALL_SWITCHES } else { self.one_switch(seed >> 1) };
        world::with(|world| world.stick_switches(Some((inputs, is_closed))));
        self.command("play", Command::Play);
        for _ in 0..APPROACH_POLLS {
            match self.ask("status", Client::status).map(|status| status.phase) {
                Some(Phase::Approaching { .. }) => world::pass(50),
                _ => break,
            }
        }
        world::pass(4 * SETTLE_MS);
        self.events();
        world::with(|world| world.stick_switches(None));
        world::pass(SETTLE_MS);
        self.command("clear", Command::Clear);
    }

    /// Moves actuators by hand, by words and coils that overlap, while all limit switches or one of them say the same in every state.
    pub(super) fn move_contradicted(&mut self, is_closed: bool, seed: u64) {
        if !self.is_own_table_at_rest() {
            return;
        }
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        if rng.random() {
            self.switch_left_latches(is_closed, &mut rng);
        }
        let inputs = if rng.random() { ALL_SWITCHES } else { self.one_switch(rng.random()) };
        world::with(|world| world.stick_switches(Some((inputs, is_closed))));
        for _ in 0..MOVES {
            let coil = rng.random_range(0..self.script.arm.coils.len().max(1)) as u8;
            let command = if rng.random() {
                Command::Word(words::word(&self.script.arm, rng.random()))
            } else {
                Command::Coil { coil, on_ms: USE_MS }
            };
            self.command("move", command);
            world::pass(rng.random_range(0..MOVE_PAUSE_MS));
        }
        world::pass(SETTLE_MS);
        self.events();
        world::with(|world| world.stick_switches(None));
        world::pass(SETTLE_MS);
        self.command("clear", Command::Clear);
    }

    /// Again and again a stop leaves what a word has set; then one coil of an actuator with a latch is switched while its limit switch says
    /// the same in every state.
    fn switch_left_latches(&mut self, is_closed: bool, rng: &mut ChaCha8Rng) {
        let Some((input, coils)) = self.script.arm.watched_latch(rng.random()) else { return };
        for _ in 0..LEFT_LATCHES {
            self.command("move", Command::Word(words::word(&self.script.arm, rng.random())));
            world::pass(USE_MS.into());
            self.stop("stop", Client::stop_at_once);
            self.renew();
            world::with(|world| world.stick_switches(Some((1 << input, is_closed))));
            // The judge expects nothing of a switch while the board drives nothing, as after the pulse of a latch.
            if let Some(coil) = self.script.arm.steady_coil() {
                self.command("move", Command::Coil { coil, on_ms: USE_MS });
            }
            let on_ms = if rng.random() { USE_MS } else { 0 };
            self.command("move", Command::Coil { coil: rng.random_range(coils.clone()), on_ms });
            world::pass(SETTLE_MS);
            self.events();
            world::with(|world| world.stick_switches(None));
            world::pass(SETTLE_MS);
            self.command("clear", Command::Clear);
        }
    }

    /// Runs the table whose program ends while its servos are on their way. Then something is to be stored at once, or one of them
    /// reports an overload.
    pub(super) fn end_under_way(&mut self, seed: u64) {
        let Some(table) = self.script.tables.last().filter(|_| !self.script.arm.servos.is_empty()) else { return };
        if !self.is_own_table_at_rest() || self.upload_once(table).0 != Ending::Done {
            return;
        }
        if self.command("play", Command::Play) != Ending::Done {
            return;
        }
        for _ in 0..LONGEST_PROGRAM_S * 50 {
            match self.ask("status", Client::status).map(|status| status.phase) {
                Some(Phase::Approaching { .. } | Phase::Playing { .. }) => world::pass(20),
                Some(Phase::Idle) => break,
                _ => return,
            }
        }
        match seed % 3 {
            0 => self.upload(0),
            1 => drop(self.set_offsets(0.01 * (1 + seed % 7) as f32)),
            _ => {
                let overloaded = 1 << ((seed >> 8) as usize % self.script.arm.servos.len());
                world::with(|world| world.break_servos(ServoFaults { overloaded, ..ServoFaults::default() }));
                world::pass(2 * SETTLE_MS);
                world::with(|world| world.break_servos(ServoFaults::default()));
                self.events();
                self.command("clear", Command::Clear);
            }
        }
    }

    /// A stop of any form leaves no safe state, and nothing is driven in it.
    pub(super) fn act_while_safe(&mut self, form: StopForm, seed: u64) {
        if !self.is_own_table_at_rest() {
            return;
        }
        world::with(|world| world.press_emergency_stop(true));
        world::pass(SETTLE_MS);
        if seed >> 40 & 1 == 1 {
            // Refused, and forgotten: it leaves no safe state later.
            self.command("clear", Command::Clear);
        }
        world::with(|world| world.press_emergency_stop(false));
        world::pass(20);
        self.events();
        match form {
            StopForm::Typed => world::with(|world| world.type_stop(seed)),
            StopForm::Bootstrap => drop(self.ask("stop", Client::stop_at_once)),
            StopForm::Message => drop(self.ask("stop", |client| client.command(Command::Stop))),
            // No stop: the contact that has opened is none either.
            StopForm::Input => {}
        }
        world::pass(STOP_MS);
        self.renew();
        let coil = (seed >> 8) as usize % self.script.arm.coils.len().max(1);
        let mut commands = [
            Command::Coil { coil: coil as u8, on_ms: PULSE_MS },
            Command::Word(words::word(&self.script.arm, seed)),
            Command::Servo { servo: 0, angle_rad: self.far_angle_rad(0, 0.4) },
            Command::Play,
        ];
        commands.rotate_left((seed >> 16) as usize % 4);
        for command in commands {
            self.command("while safe", command);
            world::pass(20);
        }
        world::pass(SETTLE_MS);
        self.command("clear", Command::Clear);
    }

    /// Sets one latch for a moment that is shorter than its pulse, until the board refuses: each pulse is cut by the opposite one, and
    /// together they use up the output.
    pub(super) fn quick_latch(&mut self, seed: u64) {
        let Some((coil, pulse_ms)) = self.script.arm.latch(seed) else { return };
        if !self.is_own_table_at_rest() {
            return;
        }
        for _ in 0..CYCLES {
            if self.command("latch", Command::Coil { coil, on_ms: u32::from(pulse_ms) / 3 }) != Ending::Done {
                return;
            }
            world::pass(u64::from(pulse_ms) * 4 / 3 + 2);
        }
    }

    /// Uses one output, restarts the board and uses it again as soon as the board allows: what flowed before the start counts. Half
    /// of the time a table with shorter peaks comes between.
    pub(super) fn peak_over_reset(&mut self, seed: u64) {
        let (coil, is_hastier) = (self.script.arm.peaking(seed), seed >> 8 & 1 == 1);
        if !self.is_own_table_at_rest() {
            return;
        }
        if is_hastier {
            self.upload(0);
        }
        world::pass(PEAK_PAUSE_MS);
        if self.command("peak", Command::Coil { coil, on_ms: 2 * PULSE_MS }) != Ending::Done {
            return;
        }
        world::pass(PULSE_MS.into());
        self.halt();
        if is_hastier {
            self.upload(HASTY);
        }
        self.ask("reboot", |client| client.reboot(RebootTarget::Application));
        // A command on the connection of before would be lost, and its repetitions take longer than most peaks have to wait.
        world::pass(START_MS);
        self.renew();
        for _ in 0..PEAK_TRIES {
            if self.command("peak", Command::Coil { coil, on_ms: PULSE_MS }) == Ending::Done {
                return;
            }
            world::pass(20);
        }
    }

    /// The same profile again, with a person at the button or without; or another one, and the person lets go once it is on its way.
    pub(super) fn write_profile(&mut self, is_attended: bool, seed: u64) {
        if !self.halt() {
            return;
        }
        let is_attended = world::with(|world| world.attend(is_attended));
        // Where the script has the button pressed too, the profile may come into force.
        let is_pressed = |entry: &Timed<WorldAct>| matches!(entry.act, WorldAct::Press(_));
        let lets_go = is_attended && seed & 1 == 1 && !self.script.world.iter().any(is_pressed);
        world::pass(50);
        let own = self.script.arm.profile();
        let profile = if lets_go { &self.script.arm.tighter_profile() } else { &own };
        if let Some(client) = self.client() {
            let result = client.upload(&profile.image(), &mut |_| {
                if lets_go {
                    world::with(|world| world.attend(false));
                }
            });
            self.note("profile", result);
        }
        world::pass(SETTLE_MS);
        world::with(|world| world.attend(false));
        if !self.renew_under(&own) && lets_go {
            // It may have come into force.
            world::with(World::on_profile_replaced);
            self.put_profile(&own);
        }
    }
}
