//! The disturbances of a script: how each begins, acts in every tick, and ends.

use darm_arm::image::UploadImage;
use darm_device::plant::Broken;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::{Party, World};
use crate::arm::EMERGENCY_STOP;
use crate::hostile::{self, Sent};
use crate::judge::reports::Ending;
use crate::script::{Timed, WorldAct};

/// A disturbance that lasts, with its end and what it draws from.
pub(super) struct Active {
    pub(super) act: WorldAct,
    pub(super) end_ns: u64,
    pub(super) rng: ChaCha8Rng,
}

impl World {
    pub(super) fn begin(&mut self, Timed { act, seed, .. }: Timed<WorldAct>) {
        let now_ns = self.now_ns();
        self.say("world", || format!("{act:?}"));
        *self.injected.entry(act.kind()).or_default() += 1;
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        self.disturbed_ns = now_ns;
        if act.is_hostile() {
            self.hostile_ns = Some(now_ns);
            self.burst_ns = None;
        }
        match act {
            WorldAct::PowerCut(_) => self.bench.power_off(),
            WorldAct::FlashCut(words, _) => self.bench.flash().fail_after(words, seed),
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
                if !as_host {
                    let hello = darm_core::wire::message::Request::Hello { protocol: darm_core::wire::PROTOCOL };
                    self.bench.send(&hostile::request(link, rng.random(), &hello));
                }
                let likely = [self.wiring.actuators.len() as u64, self.wiring.coils.len() as u64];
                (0..count).for_each(|_| self.send_hostile(hostile::any_frame(&mut rng, link, &likely)));
            }
            WorldAct::EmergencyStop(_) => {
                self.pressed_ns = Some(now_ns);
                self.invert_switches(0);
            }
            WorldAct::Text => self.send_hostile(hostile::any_line(&mut rng)),
            WorldAct::Table => self.send_table(&mut rng),
            WorldAct::Burst => {
                let sent = hostile::command_and_stop(&mut rng, self.wiring.coils.len() as u8);
                self.send_hostile(sent);
                self.burst_ns = Some(now_ns);
            }
            _ => {}
        }
        let endless = matches!(act, WorldAct::FlashCut(..));
        let end_ns = if endless { u64::MAX } else { now_ns + u64::from(act.lasts_ms()) * 1_000_000 };
        if end_ns > now_ns {
            self.active.push(Active { act, end_ns, rng });
            self.break_plant();
        }
        self.observe();
    }

    fn send_hostile(&mut self, sent: Sent) {
        sent.angles_rad.iter().for_each(|&angle| self.servos.on_asked(angle));
        sent.offsets_rad.iter().for_each(|&offset| self.servos.on_offset(offset));
        self.say("hostile", || sent.what);
        self.bench.send(&sent.bytes);
    }

    fn send_table(&mut self, rng: &mut ChaCha8Rng) {
        if rng.random_ratio(1, 4) {
            let wider = hostile::tables::wider_profile(rng, &self.wiring);
            self.say("hostile", || "a wider profile".into());
            self.send_frames(&wider, rng);
            return;
        }
        let Some(table) = hostile::tables::beyond(rng, &self.wiring, self.profile) else { return };
        self.reports.know(table.known());
        self.reports.on_upload(self.now_ns(), table.model, Ending::Unknown, &[]);
        self.commits.push((Party::Hostile, table.model, self.now_ns()));
        table.angles_rad.iter().for_each(|&angle| self.servos.on_asked(angle));
        self.send_frames(&table.image, rng);
    }

    fn send_frames(&mut self, upload: &UploadImage, rng: &mut ChaCha8Rng) {
        for frame in hostile::tables::frames(upload, rng.random(), rng.random()) {
            self.bench.send(&frame);
        }
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
                WorldAct::BouncingSwitches(..) => self.invert_switches(0),
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

    /// The emergency stop's input while it is pressed.
    fn emergency_input(&self) -> u32 {
        u32::from(self.pressed_ns.is_some()) << EMERGENCY_STOP
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

    /// These servos answer nothing from now on, beside those that the script silences.
    pub fn silence_servos(&mut self, servos: u8) {
        self.silenced = servos;
        self.disturbed_ns = self.now_ns();
        self.break_plant();
    }

    fn break_plant(&mut self) {
        let mut broken = Broken { servos_silent: self.silenced, ..Broken::default() };
        for active in &self.active {
            match active.act {
                WorldAct::StuckSwitches(inputs, true, _) => broken.switches_closed |= inputs,
                WorldAct::StuckSwitches(inputs, false, _) => broken.switches_open |= inputs,
                WorldAct::SilentServos(servos, _) => broken.servos_silent |= servos,
                WorldAct::BlockedServos(servos, _) => broken.servos_blocked |= servos,
                _ => {}
            }
        }
        let now_s = self.bench.now_s();
        self.bench.plant_mut().set_broken(now_s, broken);
    }
}
