//! What happens to the board's flash and supply at rest, and what the judges conclude from it.

use std::f32::consts::TAU;

use darm_core::output::SERVO_STEPS_PER_TURN;
use darm_core::profile::MAX_CHIPS;
use darm_core::units::{Digest, ModelHash};
use darm_core::wire::message::{Calibration, Image, ImageKind, Request};
use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;

use super::{GOOD_SUPPLY_MV, LOW_SUPPLY_MV, Opened, World};
use crate::hostile::{self, Sent};
use crate::judge::wear::Borne;

/// Bytes of an image that is only begun.
const STUB: [u8; 8] = [0; 8];

/// Where the angle of a servo is 0, steps.
const CENTRE: f32 = 2048.0;
/// A hand stays at a servo for this time, ns: longer than the board takes to see where the shaft is.
const HAND_NS: u64 = 300_000_000;
/// A servo that a load has pushed away turns back within this time after the load is taken off, at 0.1 rad/s or more, ms.
pub const BACK_MS: u64 = 2_500;

impl World {
    /// Whether the script has disturbances that have not begun.
    pub fn has_acts_ahead(&self) -> bool {
        !self.acts.is_empty()
    }

    /// The board may have no table from now on, whatever an upload that began before says at its end.
    pub(super) fn on_store_damaged(&mut self) {
        self.store_damaged_ns = Some(self.now_ns());
        self.reports.on_store_damaged();
    }

    /// Another profile may be in force from now on: no table of the script is for it.
    pub fn on_profile_replaced(&mut self) {
        self.on_store_damaged();
        self.servos.on_other_range();
        self.has_own_table = false;
    }

    /// A bit of each copy of the newest record of the profile turns, and the firmware starts again; whether there was a copy.
    pub fn lose_profile(&mut self, digest: Digest, bit: u64) -> bool {
        let count = self.bench.flash().damage_records_at(&digest.0, bit as usize);
        self.say("world", || format!("{count} copies of the newest profile are damaged"));
        if count > 0 {
            self.person.on_lost(self.now_ns());
        }
        self.start_damaged();
        count > 0
    }

    /// The same of zero offsets.
    pub fn lose_offsets(&mut self, offsets: &Calibration, bit: u64) -> bool {
        let bytes = postcard::to_allocvec(offsets).unwrap_or_default();
        let count = self.bench.flash().damage_records_at(&bytes, bit as usize);
        self.say("world", || format!("{count} copies of the newest offsets are damaged"));
        self.start_damaged();
        count > 0
    }

    /// A bit of one of the two copies of the record that the last start has written turns, and the firmware starts again; whether
    /// there was one.
    pub fn damage_last_start(&mut self, seed: u64) -> bool {
        let (back, bit) = ((seed & 1) as usize, (seed >> 1) as usize);
        let is_damaged = self.bench.flash().damage_last_record(back, bit);
        self.say("world", || format!("a copy of the number of the start is damaged: {is_damaged}"));
        self.start_damaged();
        is_damaged
    }

    fn start_damaged(&mut self) {
        self.on_profile_replaced();
        self.restart();
    }

    /// The firmware starts again, as by the reset button.
    pub fn restart(&mut self) {
        self.disturbed_ns = self.now_ns();
        self.bench.reset();
        self.observe();
    }

    /// The first connection of this start, if this is one that was opened since.
    pub fn first_link(&self) -> Option<Opened> {
        self.links.iter().find(|opened| opened.at_ns >= self.pins.started_ns()).copied()
    }

    /// The supply of the board is low, or good, from now on.
    pub fn set_supply(&mut self, is_low: bool) {
        self.set_supply_mv(if is_low { LOW_SUPPLY_MV } else { GOOD_SUPPLY_MV });
    }

    /// The converter gives this from now on, mV: 0 where it gives nothing.
    pub fn set_supply_mv(&mut self, mv: u16) {
        self.is_supply_low = mv < GOOD_SUPPLY_MV;
        self.disturbed_ns = self.now_ns();
        self.bench.set_supply(mv);
    }

    /// A load pushes this servo this number of steps away from where its own bends it, until it is taken away; then it may turn back for a while.
    pub fn push_servo(&mut self, index: usize, steps: f32) {
        let is_taken_away = steps == 0.0;
        self.pushed_ns = if is_taken_away { self.now_ns() + BACK_MS * 1_000_000 } else { u64::MAX };
        self.disturbed_ns = self.now_ns();
        let own = self.arm.servos.iter().map(|servo| servo.bend_steps).enumerate();
        let bends: Vec<f32> = own.map(|(own, bend)| if own == index { bend + steps } else { bend }).collect();
        self.bench.plant_mut().bend_servos(&bends);
    }

    /// This servo lowers its torque limit by itself.
    pub fn weaken_servo(&mut self, index: usize) {
        self.say("world", || format!("servo {index} lowers its torque limit"));
        self.disturbed_ns = self.now_ns();
        self.bench.plant_mut().weaken_servo(index);
        self.servos.on_weakened(index);
    }

    /// Somebody turns this servo by this number of steps where it has no torque: what is left to the edge of its range on that side, steps, negative
    /// beyond it. `None` where it has torque.
    pub fn turn_by_hand(&mut self, index: usize, steps: f32) -> Option<f32> {
        let now_ns = self.now_ns();
        let turned = self.bench.plant_mut().turn_by_hand(index, steps);
        let lasts_ns = if turned.is_some() { HAND_NS } else { 0 };
        (self.pushed_ns, self.disturbed_ns) = (now_ns + lasts_ns, now_ns);
        let step = turned?;
        let edge = self.arm.servos.get(index)?.range_rad * SERVO_STEPS_PER_TURN / TAU;
        Some(edge - (step - CENTRE).abs())
    }

    /// The firmware starts again with a chain of this length, where the profile in force says [`MAX_CHIPS`].
    pub fn start_with_chips(&mut self, chips: u8) {
        self.say("world", || format!("a chain of {chips} chips"));
        self.bench.set_chips(chips);
        self.is_chain_short = chips < MAX_CHIPS;
        self.restart();
    }

    /// Shows the judge what the flash has borne.
    pub fn judge_wear(&mut self) {
        let wear = self.bench.flash().wear();
        let borne = Borne { table_erasures: wear.table_erasures.into(), record_bytes: wear.record_bytes as u64 };
        self.wear.look(self.bench.now_ns(), borne);
    }

    /// What the flash has borne: while it is written, this changes.
    pub fn borne(&self) -> (u32, usize) {
        let wear = self.bench.flash().wear();
        (wear.table_erasures, wear.record_bytes)
    }

    /// Somebody opens a connection of this number.
    pub fn open_hostile(&mut self, link: u32) {
        self.call(link, 0, Vec::new());
    }

    /// On that connection somebody begins a table with its first bytes, or sets zero offsets; with the next two numbers.
    pub fn write_flash(&mut self, tables: bool, link: u32, number: u16, rng: &mut ChaCha8Rng) {
        let now_ns = self.now_ns();
        (self.hostile_ns, self.disturbed_ns, self.quiet_ns) = (Some(now_ns), now_ns, None);
        let bytes = if tables {
            let (kind, len, model) = (ImageKind::Table, STUB.len() as u32, ModelHash(1));
            let image = Image { kind, len, digest: Digest(rng.random()), model };
            let asked = [Request::Begin(image), Request::Chunk { offset: 0, bytes: &STUB }];
            [(number, &asked[0]), (number + 1, &asked[1])]
                .map(|(number, asked)| hostile::request(link, number, asked))
                .concat()
        } else {
            let asked = Calibration::try_from([rng.random_range(-0.05..0.05); 4]).map(Request::Calibrate);
            asked.map(|asked| hostile::request(link, number, &asked)).unwrap_or_default()
        };
        self.send_hostile(vec![Sent { bytes, what: "a write of the flash".into() }]);
    }
}
