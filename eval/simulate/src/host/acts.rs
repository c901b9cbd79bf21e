//! The host's acts that need more than one request, each with what the judges learn from it.

use darm_core::sequencer::{Command, Phase};
use darm_core::wire::bootstrap::RebootTarget;
use darm_core::wire::message::Calibration;
use darm_device::client::{Client, ClientError};

use super::{FirstUpload, Host, TRIES};
use crate::answers::{self, PULSE_MS, SETTLE_MS};
use crate::arm::Table;
use crate::judge::reports::{Ending, Pulse};
use crate::words;
use crate::world::{self, Party};

/// No program of a script lasts longer, s.
const LONGEST_PROGRAM_S: u32 = 25;
/// One use of an output that is to be used up, ms: below the shortest limit of on-time.
const USE_MS: u32 = 400;
/// After one use and this time every output may have its next peak, ms.
const PEAK_WAIT_MS: u64 = 200;
/// This number of uses fills the longest window.
const USES: u32 = 30;

impl Host<'_> {
    /// Turns a servo that has not answered since the board started: whatever the board says, it is not driven.
    pub(super) fn turn_unseen(&mut self, servo: u8) {
        if !self.is_own_table_at_rest() {
            return;
        }
        world::with(|world| {
            // Where the restart is refused the servo has answered, and turns.
            world.servos.on_asked(0.0);
            world.silence_servos(u8::MAX);
        });
        self.ask("reboot", |client| client.reboot(RebootTarget::Application));
        world::pass(SETTLE_MS);
        for _ in 0..2 {
            self.command("turn", Command::Servo { servo, angle_rad: 0.0 });
        }
        world::pass(SETTLE_MS);
        world::with(|world| world.silence_servos(0));
    }

    /// Uses one output up to its limit, then changes the table, then restarts the board: its limit stays what it is.
    pub(super) fn exhaust(&mut self, coil: u8, table: usize) {
        if self.script.arm.pulsed_line(coil).is_none() || !self.is_own_table_at_rest() {
            return;
        }
        self.use_up(coil);
        self.ask("stop", |client| client.command(Command::Stop));
        self.upload(table);
        self.use_up(coil);
        self.ask("stop", |client| client.command(Command::Stop));
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
        if result.is_ok() {
            world::with(|world| world.reports.on_command_after_stop(world.now_ns()));
        }
        self.note("command after a stop", result);
    }

    /// Stops, then switches one coil on for a moment: the line is switched on once if that was confirmed.
    pub(super) fn pulse(&mut self, coil: u8) {
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
    pub(super) fn two_pulses(&mut self, first: u8, second: u8) {
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
    pub(super) fn is_own_table_at_rest(&mut self) -> bool {
        if self.ask("stop", |client| client.command(Command::Stop)).is_none() {
            return false;
        }
        world::pass(SETTLE_MS);
        let model = self.ask("status", Client::status).and_then(|status| status.model);
        let own = self.script.tables.iter().any(|table| model.is_some_and(|model| model.0 == table.model));
        own && world::with(|world| world.pins.high()) == 0
    }
}
