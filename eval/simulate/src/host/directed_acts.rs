//! The host's acts for one rule each that nothing else leads to.

use darm_core::sequencer::Command;
use darm_core::units::Word;
use darm_device::client::Client;

use super::Host;
use crate::answers::SETTLE_MS;
use crate::world::{self, Party};

/// A coil that is on while another one is commanded, ms: below the shortest limit of on-time, longer than what comes in between.
const USE_MS: u32 = 700;
/// The pulse of a latch is over, ms.
const PULSED_MS: u64 = 50;
/// A latch has moved its actuator, and the board has compared its switch, ms: the longest time of travel, and two questions.
const ARRIVED_MS: u64 = 180;
/// Tries in which a latch moves and its switch does not follow.
const LATCHED: u32 = 3;
/// A servo turns this far, rad.
const TURN_RAD: f32 = 0.25;
/// Stops while one is in force, and the time in which each has reached the servos, ms. The board looks again by itself each half second.
const STOPS: u64 = 4;
const STOPPED_MS: u64 = 150;
/// Pulses that a stop ends, together for this time, ms: most of the longest window.
const PULSES_MS: u32 = 9_000;
/// Such a pulse is commanded for this time, ms; the stop ends it.
const PULSE_MS: u32 = 25;
/// A coil is on for this time while another one switches on each so often, ms: sooner than the board shifts unchanged lines again.
const TOGGLED_MS: u32 = 20;
const TOGGLE_MS: u64 = 45;
const TOGGLES: u32 = 12;

impl Host<'_> {
    /// Both coils of an actuator that has no state with both. The first one is on; or it is a latch that a stop has left set.
    pub(super) fn no_such_state(&mut self, seed: u64) {
        let arm = &self.script.arm;
        let Some((actuator, low, is_latch)) = arm.three_states(seed) else { return };
        let zeros = Word::zeros(arm.actuators.len() as u8).unwrap_or_default();
        if !self.is_ready() {
            return;
        }
        // Latches of unknown state are reset.
        self.command("reset", Command::Word(zeros));
        world::pass(SETTLE_MS);
        if !self.halt() || world::with(|world| world.valves.digit(actuator)) != Some(0) {
            return;
        }
        let began_ns = world::with(|world| world.now_ns());
        let entries = world::with(|world| world.valves.entries(actuator));
        let (first, second) = if seed >> 8 & 1 == 1 { (low, low + 1) } else { (low + 1, low) };
        self.command("first", Command::Coil { coil: first, on_ms: USE_MS });
        world::pass(PULSED_MS);
        if is_latch && seed >> 9 & 1 == 1 {
            self.halt();
        }
        let ending = self.command("second", Command::Coil { coil: second, on_ms: USE_MS });
        world::pass(SETTLE_MS);
        world::with(|world| {
            let is_alone = world.has_supply_alone(Party::First, began_ns) && world.pins.started_ns() < began_ns;
            if is_alone && world.valves.entries(actuator) > entries {
                world.reports.on_no_such_state(world.now_ns(), actuator, ending);
            }
        });
        self.halt();
    }

    /// Latches move while nothing else is on, and a switch says the same in every state: the board compares it all the same.
    pub(super) fn latch_contradicted(&mut self, is_closed: bool, seed: u64) {
        let Some((input, coils)) = self.script.arm.watched_latch(seed) else { return };
        for attempt in 0..LATCHED {
            if !self.is_ready() {
                return;
            }
            let is_closed = is_closed != (attempt % 2 == 1);
            world::with(|world| world.stick_switches(Some((1 << input, is_closed))));
            for coil in coils.clone().skip((seed >> 8) as usize & 1).chain(coils.clone()).take(coils.len()) {
                self.command("latch", Command::Coil { coil, on_ms: USE_MS });
                world::pass(ARRIVED_MS);
                self.ask("status", Client::status);
            }
            world::with(|world| world.stick_switches(None));
            self.events();
            self.command("clear", Command::Clear);
        }
    }

    /// A servo that holds bears less than it should, and a stop comes while the one before is in force: it starts the hold again.
    pub(super) fn stop_again(&mut self, seed: u64) {
        let count = self.script.arm.servos.len();
        if count == 0 || !self.is_ready() {
            return;
        }
        let index = seed as usize % count;
        let angle_rad = self.far_angle_rad(index, TURN_RAD);
        self.command("turn", Command::Servo { servo: index as u8, angle_rad });
        world::pass(SETTLE_MS);
        if !self.halt() {
            return;
        }
        world::pass(2 * SETTLE_MS);
        for stop in 0..STOPS {
            world::with(|world| world.weaken_servo(index));
            world::pass(20 + (seed >> (8 + 8 * stop)) % 80);
            world::with(|world| {
                let now_ns = world.now_ns();
                world.type_stop(seed >> stop);
                world.on_stop(now_ns);
                world.servos.on_repeated_stop();
            });
            world::pass(STOPPED_MS);
        }
        self.renew();
    }

    /// A coil on for a moment, then a stop, again and again: what flowed before each stop counts, so that the output is refused in time.
    pub(super) fn stop_pulses(&mut self) {
        let Some((coil, period_ms)) = self.script.arm.often().filter(|_| self.is_ready()) else { return };
        for _ in 0..PULSES_MS / period_ms {
            world::with(|world| world.type_line(&format!("coil {coil} on {PULSE_MS}")));
            world::pass(u64::from(period_ms) - 2);
            world::with(|world| {
                world.type_line("stop");
                world.on_stop(world.now_ns());
            });
            world::pass(2);
        }
        self.renew();
        self.events();
        self.command("clear", Command::Clear);
    }

    /// The chain returns nothing any more, and lines change sooner than unchanged ones are shifted again: the board notices it all the same.
    pub(super) fn cut_under_change(&mut self) {
        let Some((steady, toggled)) = self.script.arm.steady_and_toggled().filter(|_| self.is_ready()) else { return };
        self.command("steady", Command::Coil { coil: steady, on_ms: USE_MS });
        world::with(|world| world.cut_return(true));
        for _ in 0..TOGGLES {
            world::with(|world| world.type_line(&format!("coil {toggled} on {TOGGLED_MS}")));
            world::pass(TOGGLE_MS);
        }
        world::with(|world| world.cut_return(false));
        world::pass(SETTLE_MS);
        self.events();
        self.command("clear", Command::Clear);
    }
}
