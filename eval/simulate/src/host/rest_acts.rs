//! The host's acts on a board whose flash, supply or servo bus fails or wears, after everything else.

use std::f32::consts::TAU;

use darm_arm::board_profile::BoardProfile;
use darm_core::output::{SERVO_STEPS_PER_TURN, Wiring};
use darm_core::profile::MAX_CHIPS;
use darm_core::sequencer::Command;
use darm_core::wire::bootstrap::RebootTarget;
use darm_sim::plant::servo_bus::ServoFaults;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::Host;
use super::acts::offsets;
use crate::answers::{PULSE_MS, SETTLE_MS};
use crate::arm::{ServoPlan, Table, TablePlan};
use crate::judge::reports::Ending;
use crate::script::SupplyForm;
use crate::words;
use crate::world::{self, BACK_MS, Party};

/// Zero offsets that are replaced, and their opposite, which replaces them, rad: farther apart than any two goals count as one.
const OFFSET_RAD: f32 = 0.05;
/// Servos that may be misled turn this far, rad: no damaged request takes them out of their range before it is read back.
const TURN_RAD: f32 = 0.25;
/// A servo has turned as far as that at a quarter of the slowest speed, and rests, ms.
const TURNED_MS: u64 = 3_000;
/// Turns of a servo, some of whose requests are damaged, and the time of each, ms.
const TURNS: u64 = 4;
const TURN_MS: u64 = 90;
/// A load pushes a servo as far as this, a step each 2 ms: 0.2 rad.
const SAG_STEPS: u16 = 130;
/// Somebody stops each time it has pushed it this number of steps: before the servo has settled.
const STOPPED_STEPS: u16 = 5;
/// A person turns a shaft as far as this in 1 ms, steps: 0.46 rad/s, below the slowest servo of a script. A coil is on from the one number of
/// steps before the edge of the range to the other beyond it.
const HAND_STEPS: f32 = 0.3;
const EDGE_STEPS: f32 = 20.0;
const OUT_STEPS: f32 = 40.0;
/// A hand that is too fast: this share of the speed of the servo, and this much more, steps/s, for this time, ms.
const FAST_SHARE: f32 = 1.6;
const FAST_STEPS_S: f32 = 1_200.0;
const FAST_TICKS: u32 = 120;
/// Rows of a table for one try.
const ROWS: usize = 8;
/// What is driven while the supply fails is on for this time, ms: below the shortest limit of on-time.
const DRIVEN_MS: u32 = 700;
/// A dip of the supply, and the time from one to the next, ms.
const DIP_MS: u64 = 38;
const DIP_PERIOD_MS: u64 = 1_000;
/// A supply that switches itself off at overload, ms, and how often.
const COLLAPSE_MS: u64 = 40;
const COLLAPSES: u64 = 8;
/// Starts in which somebody begins this number of tables each, together more than the board takes; and sets zero offsets.
const TABLE_STARTS: u32 = 4;
const TABLES: u16 = 75;
const OFFSET_STARTS: u32 = 12;
const OFFSETS: u16 = 8;
/// This number of writes in a row that the board refuses is enough.
const MAX_REFUSALS: u32 = 2;
/// A write begins within this time, ms, and has ended when nothing changes for that.
const WRITE_MS: u64 = 80;
const REST_MS: u64 = 4;
/// A board has started, or opened a connection, within this time, ms.
const START_MS: u64 = 60;

impl Host<'_> {
    /// Whether the board is at rest with a table of the script; one is uploaded where there is none.
    pub(super) fn is_ready(&mut self) -> bool {
        if self.is_own_table_at_rest() {
            return true;
        }
        self.command("clear", Command::Clear);
        self.upload(0);
        self.is_own_table_at_rest()
    }

    /// Everything that would move something, one after the other.
    fn try_all(&mut self, seed: u64) {
        let coil = self.script.arm.steady_coil().unwrap_or(0);
        let commands = [
            Command::Coil { coil, on_ms: PULSE_MS },
            Command::Word(words::word(&self.script.arm, seed)),
            Command::Servo { servo: 0, angle_rad: self.far_angle_rad(0, 0.4) },
            Command::Play,
        ];
        for command in commands {
            self.command("try", command);
            world::pass(30);
        }
        world::pass(SETTLE_MS);
    }

    /// A person at the button replaces the profile; whether the board says that this one is in force.
    pub(super) fn put_profile(&mut self, profile: &BoardProfile) -> bool {
        if !self.halt() || !world::with(|world| world.attend(true)) {
            return false;
        }
        world::pass(50);
        world::with(|world| world.on_profile_replaced());
        if let Some(client) = self.client() {
            let result = client.upload(&profile.image(), &mut |_| {});
            self.note("profile", result);
        }
        world::pass(SETTLE_MS);
        world::with(|world| world.attend(false));
        self.renew_under(profile)
    }

    /// Opens the connection again; whether the board says that this profile is in force.
    pub(super) fn renew_under(&mut self, profile: &BoardProfile) -> bool {
        let is_open = self.renew();
        let hello = self.client.as_ref().and_then(|(client, _)| client.hello());
        is_open && hello.is_some_and(|hello| hello.profile == profile.profile.digest)
    }

    /// Whether the profile may be replaced: the board is ready, and nothing that comes later may damage the arm's own profile.
    fn may_replace_profile(&mut self) -> bool {
        !self.script.has_jumper && !world::with(|world| world.has_acts_ahead()) && self.is_ready()
    }

    /// The profile is replaced by a tighter one, whose record is damaged at rest: the arm does not move by the one before.
    pub(super) fn lose_profile(&mut self, seed: u64) {
        if !self.may_replace_profile() {
            return;
        }
        let tighter = self.script.arm.tighter_profile();
        let is_replaced = self.put_profile(&tighter);
        if is_replaced && world::with(|world| world.lose_profile(tighter.profile.digest, seed)) {
            world::pass(2 * SETTLE_MS);
            self.renew();
            self.try_all(seed >> 16);
            self.halt();
        }
        self.put_profile(&self.script.arm.profile());
    }

    /// A person replaces the profile, and the board is given a table for it; whether both came into force.
    fn put_table_under(&mut self, profile: &BoardProfile, wiring: &Wiring, seed: u64) -> bool {
        let (digest, model) = (profile.profile.digest, seed | 1);
        let plan = TablePlan { wiring, profile: digest, model, rows: ROWS, ends_under_way: false, device: None };
        let Some(table) = Table::draw(&mut ChaCha8Rng::seed_from_u64(seed), &plan) else { return false };
        if !self.put_profile(profile) {
            return false;
        }
        world::with(|world| world.know(&table));
        self.upload_once(&table).0 == Ending::Done
    }

    /// What an output has used up counts under another profile too, in which it has another number.
    pub(super) fn exhaust_over_profiles(&mut self, coil: u8, seed: u64) {
        let Some(line) = self.script.arm.pulsed_line(coil).filter(|_| self.may_replace_profile()) else { return };
        let other = self.script.arm.reversed();
        self.use_up(coil);
        if self.put_table_under(&other.profile(), &other.wiring(), seed)
            && let Some(same) = (0..other.coils.len() as u8).find(|&coil| other.pulsed_line(coil) == Some(line))
        {
            self.use_up(same);
        }
        self.put_profile(&self.script.arm.profile());
    }

    /// A table for a profile that names the length of the chain; then the board starts with a shorter one, as where a plug is not in.
    pub(super) fn shorten_chain(&mut self, seed: u64) {
        if !self.may_replace_profile() {
            return;
        }
        let counted = self.script.arm.counted_profile();
        if self.put_table_under(&counted, &self.script.arm.wiring(), seed) {
            world::with(|world| world.start_with_chips(1 + (seed >> 8) as u8 % (MAX_CHIPS - 1)));
            world::pass(2 * SETTLE_MS);
            self.renew();
            self.try_all(seed >> 16);
            self.command("clear", Command::Clear);
            self.try_all(seed >> 24);
            world::with(|world| world.start_with_chips(MAX_CHIPS));
            world::pass(SETTLE_MS);
        }
        self.put_profile(&self.script.arm.profile());
    }

    /// Somebody turns a servo that has had no torque since the start, to the edge of its range and, while a coil is on, out of it; or fast from
    /// there to the other edge.
    pub(super) fn turn_by_hand(&mut self, seed: u64, is_fast: bool) {
        let Some(coil) = self.script.arm.steady_coil().filter(|_| self.is_ready()) else { return };
        let released = |(index, servo): (usize, &ServoPlan)| servo.is_released.then_some(index);
        let Some(index) = self.script.arm.servos.iter().enumerate().find_map(released) else { return };
        world::with(|world| world.restart());
        world::pass(2 * SETTLE_MS);
        self.renew();
        let side = if seed & 1 == 0 { 1.0 } else { -1.0 };
        turn_while(index, HAND_STEPS * side, |left| left > EDGE_STEPS);
        self.command("drive", Command::Coil { coil, on_ms: DRIVEN_MS });
        if is_fast {
            // Across the middle both edges are farther away: it turns as far as half of the range and its time allow.
            let steps = self.script.arm.servos.get(index).map_or(0.0, fast_steps);
            let mut ticks = 0;
            turn_while(index, -steps * side, |left| {
                ticks += 1;
                ticks < FAST_TICKS && (ticks < FAST_TICKS / 2 || left > 2.0 * EDGE_STEPS)
            });
        } else {
            turn_while(index, HAND_STEPS * side, |left| left > -OUT_STEPS);
        }
        world::pass(SETTLE_MS);
        self.events();
        turn_while(index, -HAND_STEPS * side, |left| left < EDGE_STEPS);
        world::pass(SETTLE_MS);
        self.command("clear", Command::Clear);
    }

    /// Zero offsets are replaced by others, whose record is damaged at rest: no joint turns by those before.
    pub(super) fn lose_offsets(&mut self, seed: u64) {
        if !self.is_ready() {
            return;
        }
        let began_ns = world::with(|world| world.now_ns());
        let newest_rad = if seed & 1 == 0 { OFFSET_RAD } else { -OFFSET_RAD };
        if !self.set_offsets(-newest_rad) || !self.set_offsets(newest_rad) {
            return;
        }
        let Some(newest) = offsets(newest_rad) else { return };
        let is_lost = world::with(|world| {
            if !world.has_other_acted_since(Party::First, began_ns) {
                world.servos.on_offsets_confirmed(newest.offsets_rad());
            }
            world.lose_offsets(&newest, seed >> 1)
        });
        if is_lost {
            world::pass(2 * SETTLE_MS);
            self.renew();
            self.try_all(seed >> 16);
            self.halt();
        }
        self.set_offsets(0.0);
    }

    /// What opened the first connection of a start comes again in the next start, before which a copy of the number was damaged.
    pub(super) fn repeat_start(&mut self, seed: u64) {
        if !self.is_ready() || self.ask("reboot", |client| client.reboot(RebootTarget::Application)).is_none() {
            return;
        }
        world::pass(SETTLE_MS);
        if !self.renew() {
            return;
        }
        let Some(first) = world::with(|world| world.first_link()) else { return };
        let rest_ns = world::with(|world| world.now_ns());
        if !world::with(|world| world.damage_last_start(seed)) {
            return;
        }
        world::pass(SETTLE_MS);
        world::with(|world| world.send_commands_of_before(first, seed, rest_ns));
        world::pass(SETTLE_MS);
    }

    /// Servos turn, and some of what is written to one of them arrives as something else.
    pub(super) fn mislead(&mut self, seed: u64) {
        let count = self.script.arm.servos.len();
        if count == 0 || !self.is_ready() {
            return;
        }
        let index = seed as usize % count;
        world::with(|world| world.break_servos(ServoFaults { misled: 1 << index, ..ServoFaults::default() }));
        for turn in 0..TURNS {
            for servo in 0..count {
                let angle_rad = self.far_angle_rad(servo, TURN_RAD);
                self.command("turn", Command::Servo { servo: servo as u8, angle_rad });
            }
            world::pass(TURN_MS + (seed >> (8 + 8 * turn)) % TURN_MS);
        }
        world::with(|world| world.break_servos(ServoFaults::default()));
        world::pass(SETTLE_MS);
        self.events();
        self.command("clear", Command::Clear);
    }

    /// Something is driven while the supply of the board fails.
    pub(super) fn supply(&mut self, form: SupplyForm, seed: u64) {
        if !self.is_ready() {
            return;
        }
        // What runs is not to end by itself.
        world::pass(2 * SETTLE_MS);
        self.drive();
        world::pass(10 + seed % 60);
        match form {
            SupplyForm::Falls => {
                world::with(|world| if seed & 1 == 0 { world.set_supply(true) } else { world.set_supply_mv(0) });
                world::pass(150);
                self.command("clear", Command::Clear);
                self.drive();
                world::pass(100);
            }
            SupplyForm::Dips => {
                for _ in 0..2 {
                    self.dip(DIP_MS);
                    world::pass(DIP_PERIOD_MS - DIP_MS);
                }
            }
            SupplyForm::Collapses => {
                for _ in 0..COLLAPSES {
                    self.dip(COLLAPSE_MS);
                    world::pass(COLLAPSE_MS);
                }
            }
        }
        self.events();
        world::with(|world| world.set_supply(false));
        world::pass(SETTLE_MS);
        self.command("clear", Command::Clear);
    }

    /// A servo holds, or is at its target, and a coil is on; then a load pushes the servo away, and is taken off again.
    pub(super) fn sag(&mut self, seed: u64, at_target: bool) {
        let Some(coil) = self.script.arm.steady_coil().filter(|_| self.is_ready()) else { return };
        let index = seed as usize % self.script.arm.servos.len();
        // Stops that are repeated let no servo sink.
        let is_stopped = !at_target && seed >> 8 & 1 == 1;
        let angle_rad = self.far_angle_rad(index, TURN_RAD);
        self.command("turn", Command::Servo { servo: index as u8, angle_rad });
        if at_target {
            world::pass(TURNED_MS);
        } else {
            world::pass(TURN_MS);
            if !self.halt() {
                return;
            }
            world::pass(2 * SETTLE_MS);
        }
        self.command("drive", Command::Coil { coil, on_ms: DRIVEN_MS });
        for step in 1..=SAG_STEPS {
            world::with(|world| world.push_servo(index, step as f32));
            if is_stopped && step % STOPPED_STEPS == 0 {
                world::with(|world| {
                    let now_ns = world.now_ns();
                    world.type_stop(seed);
                    world.on_stop(now_ns);
                });
            }
            world::pass(2);
        }
        // To its target it turns at a quarter of its speed, and the load takes it away from there as slowly.
        world::pass(if at_target { u64::from(DRIVEN_MS) } else { SETTLE_MS / 2 });
        self.events();
        world::with(|world| world.push_servo(index, 0.0));
        world::pass(BACK_MS);
        self.command("clear", Command::Clear);
    }

    /// The supply is low for this time.
    fn dip(&self, ms: u64) {
        world::with(|world| world.set_supply(true));
        world::pass(ms);
        world::with(|world| world.set_supply(false));
    }

    /// A coil and a servo.
    fn drive(&mut self) {
        if let Some(coil) = self.script.arm.steady_coil() {
            self.command("drive", Command::Coil { coil, on_ms: DRIVEN_MS });
        }
        if !self.script.arm.servos.is_empty() {
            let angle_rad = self.far_angle_rad(0, 0.45);
            self.command("drive", Command::Servo { servo: 0, angle_rad });
        }
    }

    /// Somebody has the flash written as fast as the board does it, and starts the board again in between.
    pub(super) fn wear_out(&mut self, tables: bool, seed: u64) {
        if !self.is_ready() {
            return;
        }
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (starts, count) = if tables { (TABLE_STARTS, TABLES) } else { (OFFSET_STARTS, OFFSETS) };
        for _ in 0..starts {
            let link = rng.random();
            world::with(|world| world.open_hostile(link));
            world::pass(START_MS);
            let (mut number, mut refusals) = (0, 0);
            while number < 2 * count && refusals < MAX_REFUSALS {
                let before = world::with(|world| world.borne());
                world::with(|world| world.write_flash(tables, link, number + 1, &mut rng));
                number += 2;
                refusals = if is_written(before) { 0 } else { refusals + 1 };
            }
            let borne = world::with(|world| world.borne());
            world::with(|world| {
                world.say("flash", || format!("erasures of a page of tables, bytes of records: {borne:?}"))
            });
            world::with(|world| world.restart());
            world::pass(START_MS);
        }
        world::with(|world| world.judge_wear());
    }
}

/// What a hand turns a servo in 1 ms that is faster than the board allows, steps.
fn fast_steps(servo: &ServoPlan) -> f32 {
    1e-3 * (FAST_SHARE * servo.max_speed_rad_s * SERVO_STEPS_PER_TURN / TAU + FAST_STEPS_S)
}

/// Somebody turns a servo without torque by this number of steps each ms, as long as that holds of what is left to the edge of its range,
/// steps.
fn turn_while(index: usize, steps: f32, mut is_on: impl FnMut(f32) -> bool) {
    while world::with(|world| world.turn_by_hand(index, steps)).is_some_and(&mut is_on) {
        world::pass(1);
    }
}

/// Lets time pass until the flash has borne more than that, and is at rest again; whether it has.
fn is_written(mut before: (u32, usize)) -> bool {
    let mut is_written = false;
    let mut still_ms = 0;
    while still_ms < if is_written { REST_MS } else { WRITE_MS } {
        world::pass(REST_MS);
        let borne = world::with(|world| world.borne());
        still_ms = if borne == before { still_ms + REST_MS } else { 0 };
        is_written |= borne != before;
        before = borne;
    }
    is_written
}
