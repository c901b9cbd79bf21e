//! The disturbances of a script: how each begins, acts in every tick, and ends.

use darm_arm::image::UploadImage;
use darm_sim::in_process::ChainFaults;
use darm_sim::plant::Broken;
use darm_sim::plant::servo_bus::ServoFaults;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::{Party, World};
use crate::arm::{EMERGENCY_STOP, Table};
use crate::hostile::{self, Sent};
use crate::judge::reports::Ending;
use crate::script::{Foreign, Timed, WorldAct};

/// A disturbance that lasts, with its end and what it draws from.
pub(super) struct Active {
    pub(super) act: WorldAct,
    pub(super) end_ns: u64,
    pub(super) rng: ChaCha8Rng,
    /// Which of several things it concerns, or the number of the tick.
    pub(super) index: u32,
}

/// In the first ticks of each period a switch that bounces briefly shows the opposite.
const BOUNCE_TICKS: u32 = 2;
const BOUNCE_PERIOD: u32 = 12;
/// For this time what somebody else has sent may still be put in force, ns.
const FOREIGN_NS: u64 = 3_000_000_000;

impl World {
    pub(super) fn begin(&mut self, Timed { act, seed, .. }: Timed<WorldAct>) {
        let now_ns = self.now_ns();
        let is_foreign = self.foreign_ns.is_some_and(|at_ns| at_ns + FOREIGN_NS > now_ns);
        if matches!(act, WorldAct::Press(_)) && (is_foreign || self.has_jumper) {
            return;
        }
        self.say("world", || format!("{act:?}"));
        *self.injected.entry(act.kind()).or_default() += 1;
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        self.disturbed_ns = now_ns;
        if act.is_hostile() {
            self.hostile_ns = Some(now_ns);
            self.quiet_ns = None;
        }
        match act {
            WorldAct::PowerCut(_) => self.bench.power_off(),
            WorldAct::FlashCut(words, _) => self.bench.flash().fail_after(words, seed),
            // Without power there is nothing to reset.
            WorldAct::Reset if !self.bench.is_powered() => {}
            WorldAct::Reset => {
                self.bench.reset();
                self.recovering = Some((act.kind(), now_ns));
            }
            WorldAct::KillHost => {
                self.session += 1;
                self.recovering = Some((act.kind(), now_ns));
            }
            WorldAct::Frames(count, as_host) => {
                let link = if as_host { self.host_link } else { rng.random() };
                let likely = [self.wiring.actuators.len() as u64, self.wiring.coils.len() as u64];
                let frames = (0..count).map(|_| hostile::any_frame(&mut rng, link, &likely)).collect();
                if as_host {
                    self.send_hostile(frames);
                } else {
                    self.call(link, rng.random(), frames);
                }
            }
            WorldAct::EmergencyStop(_) => {
                self.pressed_ns = Some(now_ns);
                self.pressed_ticks = 0;
                self.invert_switches(0);
            }
            WorldAct::Text => self.send_hostile(vec![hostile::any_line(&mut rng)]),
            WorldAct::Table => self.send_table(&mut rng),
            WorldAct::Burst => {
                let sent = hostile::command_and_stop(&mut rng, self.wiring.coils.len() as u8);
                self.send_hostile(vec![sent]);
                self.begin_quiet();
            }
            WorldAct::ForeignTable(of) => {
                let table = match of {
                    Foreign::NoProfile => hostile::tables::of_no_profile(&mut rng),
                    Foreign::OtherProfile => hostile::tables::of_another_profile(&mut rng, &self.wiring),
                    Foreign::OtherDevice => hostile::tables::of_another_device(&mut rng, &self.wiring, self.profile),
                    Foreign::OtherWindow => hostile::tables::of_another_window(&mut rng, &self.wiring, self.profile),
                    Foreign::OtherInputs => hostile::tables::of_other_inputs(&mut rng, &self.wiring, self.profile),
                };
                // Nobody may ever see it loaded: the judge does not know it.
                if let Some(table) = table {
                    self.send_frames(&table.image, &mut rng);
                }
            }
            WorldAct::WiderProfile => self.send_profile(&mut rng),
            WorldAct::RecombinedTable => {
                if let Some(table) = hostile::tables::recombined(&mut rng, &self.wiring, self.profile) {
                    self.send_known(&table, &mut rng);
                }
            }
            WorldAct::DamagedProfile(records) => self.damage_profile(records),
            _ => {}
        }
        let endless = matches!(act, WorldAct::FlashCut(..));
        let end_ns = if endless { u64::MAX } else { now_ns + u64::from(act.lasts_ms()) * 1_000_000 };
        if end_ns > now_ns {
            let index = rng.random();
            self.active.push(Active { act, end_ns, rng, index });
            self.break_plant();
        }
        self.observe();
    }

    /// One bit of each copy of the record that names the profile, or of its image, turns; then the firmware starts again.
    fn damage_profile(&mut self, records: bool) {
        let (flash, profile) = (self.bench.flash().clone(), self.arm.profile());
        let count = if records {
            flash.damage_records(&self.profile.0)
        } else {
            flash.damage_profiles(profile.image().bytes())
        };
        self.say("world", || format!("{count} copies are damaged"));
        if count > 0 {
            self.person.on_lost(self.bench.now_ns());
            self.on_store_damaged();
            self.has_own_table = false;
        }
        self.bench.reset();
    }

    /// A profile beyond the limits of the arm. With somebody at the button it would be taken.
    fn send_profile(&mut self, rng: &mut ChaCha8Rng) {
        let now_ns = self.now_ns();
        // A press that began in this tick is not seen by the judge yet.
        let begins = |active: &Active| {
            let is_press = matches!(active.act, WorldAct::Press(_) | WorldAct::LooseJumper(_));
            is_press && active.end_ns - u64::from(active.act.lasts_ms()) * 1_000_000 == now_ns
        };
        if self.is_attended || self.person.is_present(now_ns) || self.active.iter().any(begins) {
            return;
        }
        let wider = hostile::tables::wider_profile(rng, &self.wiring);
        self.say("hostile", || "a wider profile".into());
        self.send_frames(&wider, rng);
    }

    fn send_table(&mut self, rng: &mut ChaCha8Rng) {
        if rng.random_ratio(1, 4) {
            self.send_profile(rng);
            return;
        }
        if let Some(table) = hostile::tables::beyond(rng, &self.wiring, self.profile) {
            self.send_known(&table, rng);
        }
    }

    /// A table that the board may take, of somebody else.
    fn send_known(&mut self, table: &Table, rng: &mut ChaCha8Rng) {
        self.know(table);
        self.reports.on_upload(self.now_ns(), table.model, Ending::Unknown, &[]);
        self.commits.push((Party::Hostile, table.model, self.now_ns()));
        self.send_frames(&table.image, rng);
    }

    /// Somebody stops the arm and uploads one of the script's tables right behind it.
    pub fn store_behind_stop(&mut self, table: &Table, seed: u64) {
        let now_ns = self.now_ns();
        (self.hostile_ns, self.disturbed_ns, self.quiet_ns) = (Some(now_ns), now_ns, None);
        self.send_known(table, &mut ChaCha8Rng::seed_from_u64(seed));
    }

    fn send_frames(&mut self, upload: &UploadImage, rng: &mut ChaCha8Rng) {
        (self.foreign_ns, self.has_own_table) = (Some(self.now_ns()), false);
        let stop = hostile::stop(rng.random());
        self.send_hostile(vec![stop]);
        let (link, number) = (rng.random(), rng.random());
        let frames = hostile::tables::frames(upload, link, number);
        let frames = frames.into_iter().map(|bytes| Sent { bytes, what: "a piece of an image".into() });
        self.call(link, number, frames.collect());
    }

    pub(super) fn end_acts(&mut self, now_ns: u64) {
        let (ended, active): (Vec<_>, Vec<_>) = self.active.drain(..).partition(|active| active.end_ns <= now_ns);
        self.active = active;
        for Active { act, mut rng, .. } in ended {
            self.disturbed_ns = now_ns;
            self.recovering = Some((act.kind(), now_ns));
            self.say("world", || format!("{act:?} ends"));
            match act {
                WorldAct::PowerCut(_) | WorldAct::FlashCut(..) if !self.bench.is_powered() => {
                    self.bench.power_on(rng.random());
                    self.observe();
                }
                WorldAct::BouncingSwitches(..) | WorldAct::BriefBounces(..) => self.invert_switches(0),
                WorldAct::EmergencyStop(_) if !self.is_pressed() => {
                    self.pressed_ns = None;
                    self.invert_switches(0);
                }
                _ => self.break_plant(),
            }
        }
    }

    /// What disturbances do in each tick.
    pub(super) fn act_on(&mut self) {
        let stop = self.emergency_input();
        for active in &mut self.active {
            match active.act {
                WorldAct::BouncingSwitches(inputs, _) => {
                    let bounce = if active.rng.random_bool(0.7) { active.rng.random::<u32>() } else { 0 };
                    self.bench.invert_switches(inputs & bounce | stop);
                }
                WorldAct::BriefBounces(inputs, _) => {
                    active.index = active.index.wrapping_add(1);
                    let is_bouncing = active.index % BOUNCE_PERIOD < BOUNCE_TICKS;
                    self.bench.invert_switches(if is_bouncing { inputs } else { 0 } | stop);
                }
                WorldAct::BabblingBus(_) if active.rng.random_bool(0.3) => {
                    let noise: [u8; 6] = active.rng.random();
                    let start = usize::from(active.rng.random_bool(0.5)) * 4;
                    self.bench.send_bus(&[&[0xff, 0xff, 1, 4][..start], &noise].concat());
                }
                _ => {}
            }
        }
    }

    fn is_pressed(&self) -> bool {
        self.active.iter().any(|active| matches!(active.act, WorldAct::EmergencyStop(_)))
    }

    /// Whether somebody presses the emergency stop.
    pub fn is_stop_pressed(&self) -> bool {
        self.pressed_ns.is_some()
    }

    /// The emergency stop's input as its contact has it.
    fn emergency_input(&self) -> u32 {
        u32::from(self.pressed_ns.is_some() != self.arm.stop_opens) << EMERGENCY_STOP
    }

    fn invert_switches(&mut self, inputs: u32) {
        let stop = self.emergency_input();
        self.bench.invert_switches(inputs | stop);
    }

    /// The power went in a flash operation.
    pub(super) fn on_flash_cut(&mut self) {
        let now_ns = self.now_ns();
        self.say("world", || "the power fails in a flash operation".into());
        self.disturbed_ns = now_ns;
        for active in &mut self.active {
            if let WorldAct::FlashCut(_, lasts_ms) = active.act {
                active.end_ns = now_ns + u64::from(lasts_ms) * 1_000_000;
            }
        }
    }

    /// The servos have these faults from now on, beside those of the script.
    pub fn break_servos(&mut self, faults: ServoFaults) {
        self.act_faults = faults;
        self.disturbed_ns = self.now_ns();
        self.break_plant();
    }

    /// The switches of these inputs are stuck from now on, closed if `true`, beside what the script does; or they work again.
    pub fn stick_switches(&mut self, stuck: Option<(u32, bool)>) {
        self.stuck = stuck;
        self.disturbed_ns = self.now_ns();
        self.break_plant();
    }

    /// The wire by which the chain returns what is shifted into it is cut from now on, beside what the script does; or it is repaired.
    pub fn cut_return(&mut self, is_cut: bool) {
        self.is_return_cut = is_cut;
        self.disturbed_ns = self.now_ns();
        self.break_plant();
    }

    /// The host has somebody press the emergency stop, or release it.
    pub fn press_emergency_stop(&mut self, is_pressed: bool) {
        let now_ns = self.now_ns();
        self.disturbed_ns = now_ns;
        if is_pressed {
            self.pressed_ns = self.pressed_ns.or(Some(now_ns));
            self.pressed_ticks = 0;
        } else if !self.is_pressed() {
            self.pressed_ns = None;
        }
        self.invert_switches(0);
    }

    /// The host has a person press the button, or release it. True when somebody does: not while a profile of somebody
    /// else may still be on its way.
    pub fn attend(&mut self, is_attended: bool) -> bool {
        let is_free = self.foreign_ns.is_none_or(|at_ns| at_ns + FOREIGN_NS < self.now_ns());
        self.is_attended = is_attended && is_free && !self.has_jumper;
        self.is_attended
    }

    /// Whether something but the servos sends on their bus.
    pub(super) fn is_bus_noisy(&self) -> bool {
        self.active.iter().any(|active| matches!(active.act, WorldAct::BabblingBus(_)))
    }

    /// Whether a switch, an input or a valve is not what the arm says.
    pub(super) fn has_broken_switches(&self) -> bool {
        self.stuck.is_some()
            || self.active.iter().any(|active| {
                matches!(
                    active.act,
                    WorldAct::StuckSwitches(..) | WorldAct::BouncingSwitches(..) | WorldAct::DeadValve(_)
                )
            })
    }

    fn break_plant(&mut self) {
        let mut broken = Broken { servos: self.act_faults, ..Broken::default() };
        let mut chain = ChainFaults { return_cut: self.is_return_cut, ..ChainFaults::default() };
        match self.stuck {
            Some((inputs, true)) => broken.switches_closed = inputs,
            Some((inputs, false)) => broken.switches_open = inputs,
            None => {}
        }
        for active in &self.active {
            match active.act {
                WorldAct::StuckSwitches(inputs, true, _) => broken.switches_closed |= inputs,
                WorldAct::StuckSwitches(inputs, false, _) => broken.switches_open |= inputs,
                WorldAct::SilentServos(servos, _) => broken.servos.silent |= servos,
                WorldAct::BlockedServos(servos, _) => broken.servos.blocked |= servos,
                WorldAct::DamagedServos(servos, _) => broken.servos.damaged |= servos,
                WorldAct::DeafServos(servos, _) => broken.servos.deaf |= servos,
                WorldAct::UnconfirmedServos(servos, _) => broken.servos.unconfirmed |= servos,
                WorldAct::OverloadedServos(servos, _) => broken.servos.overloaded |= servos,
                WorldAct::CutReturn(_) => chain.return_cut = true,
                WorldAct::StuckEnable(is_high, _) => chain.enable = Some(is_high),
                WorldAct::DeadValve(_) => {
                    let wired = self.wiring.coils.get(active.index as usize % self.wiring.coils.len().max(1));
                    let lines = wired.map_or((0, None), |coil| coil.drive.lines());
                    broken.lines_low |= 1 << lines.0 | lines.1.map_or(0, |line| 1 << line);
                }
                _ => {}
            }
        }
        let now_s = self.bench.now_s();
        self.bench.plant_mut().set_broken(now_s, broken);
        self.bench.break_chain(chain);
    }
}
