//! Everything outside the host, on one virtual clock: board, plant, disturbances, hostile sender, judges.
//!
//! The client is synchronous: it asks its link ([`Plug`]) for bytes and waits. That link steps the world of its thread, one
//! tick of the board at a time, until bytes arrive or the wait is over. The [second host](crate::second_host) has a thread,
//! but runs only while the world waits for it, so the seed decides everything.

mod disturbances;
mod plug;
mod senders;
mod store;

use std::collections::{BTreeMap, VecDeque};

use darm_core::output::Wiring;
use darm_core::units::Digest;
use darm_sim::in_process::{Bench, Chip, MemoryFlash, Physical};
use darm_sim::plant::Plant;
use darm_sim::plant::servo_bus::{ServoFaults, ServoState};

use crate::arm::{ArmPlan, EMERGENCY_STOP, Table};
use crate::judge::board_supply::BoardSupply;
use crate::judge::person::Person;
use crate::judge::pins::Pins;
use crate::judge::reports::Reports;
use crate::judge::servos::{Joint, Servos};
use crate::judge::switches::Switches;
use crate::judge::valves::Valves;
use crate::judge::wear::Wear;
use crate::panics;
use crate::script::{Script, Timed, WorldAct};
use crate::second_host::{self, SecondHost};
use crate::trace::Trace;

use disturbances::Active;
pub use plug::{Plug, enter, leave, pass, with};
use senders::Caller;
pub use senders::{Opened, Party};
pub use store::BACK_MS;

/// No run lasts longer: whoever still waits finds the line closed.
const MAX_NS: u64 = 600_000_000_000;
/// A servo on the bus that no profile has.
const STRANGER: u8 = 77;
/// The board has seen the emergency stop after this number of ticks in which it ran.
const PRESSED_TICKS: u32 = 4;
/// The board has seen an output enable that does not follow after this number of ticks: docs/safety.md, and two more.
const ENABLE_TICKS: u32 = 5;
/// This number of ticks after a start its profile is in force at the latest.
const START_TICKS: u32 = 800;

/// Supply of the board: good, and low for every threshold of a script, mV.
const GOOD_SUPPLY_MV: u16 = 3_300;
const LOW_SUPPLY_MV: u16 = 2_400;

/// A loose jumper opens for this time, shorter than a press needs, ms.
const LOOSE_MS: u64 = 12;
/// From one time to the next, ms.
const LOOSE_PERIOD_MS: u64 = 45;

/// The world of one run.
pub struct World {
    bench: Bench,
    arm: ArmPlan,
    wiring: Wiring,
    /// Digest of the profile that the board has.
    profile: Digest,
    /// Judge 1, the lines.
    pub pins: Pins,
    /// Judge 1, the servos.
    pub servos: Servos,
    /// Judge 1, the limit switches.
    pub switches: Switches,
    /// Judge 1, the valves.
    pub valves: Valves,
    /// Judge 1, the supply of the board.
    pub board_supply: BoardSupply,
    /// Judge 1, the flash.
    pub wear: Wear,
    /// Judge 2, the button and the profile.
    pub person: Person,
    /// Judge 2.
    pub reports: Reports,
    acts: VecDeque<Timed<WorldAct>>,
    /// Time from which the acts count, ns; before, nothing but the line disturbs.
    acts_from_ns: Option<u64>,
    active: Vec<Active>,
    /// The host that is alive: an older one finds the line closed.
    session: u32,
    inbox: VecDeque<u8>,
    /// Number of the connection that a host used last.
    host_link: u32,
    /// When a record of the store was damaged last.
    store_damaged_ns: Option<u64>,
    /// When the firmware was started again last while the supply was on, and the lines that were on until then.
    pub reset_ns: u64,
    /// See [`reset_ns`](Self::reset_ns).
    pub reset_lines: u64,
    disturbed_ns: u64,
    hostile_ns: Option<u64>,
    /// When the first and the second host sent something last that acts, ns.
    acted_ns: [Option<u64>; 2],
    /// Who sent a commit of which table when, ns.
    commits: Vec<(Party, u64, u64)>,
    second: Option<SecondHost<Self>>,
    /// When a stop came behind a command, or commands of before a stop after it, and until when nothing may act, ns, while
    /// nobody has sent anything since.
    quiet_ns: Option<(u64, u64)>,
    /// Connections that were opened.
    links: Vec<Opened>,
    /// Callers that wait for a challenge, and the bytes of the board since its last zero.
    callers: Vec<Caller>,
    reply: Vec<u8>,
    /// Connections that were opened before this time have ended by a stop or a start.
    ended_ns: u64,
    /// When somebody asked last for the safe state to be left.
    cleared_ns: u64,
    /// The loaded table is one of the script: it names the arm's switches.
    has_own_table: bool,
    /// Numbers of the tables of the script.
    own_models: Vec<u64>,
    /// When a profile or a table of somebody else was sent last, ns.
    foreign_ns: Option<u64>,
    /// Ticks of the board since it started.
    ran_ticks: u32,
    /// Of these, with its profile in force, ticks since the emergency stop was pressed.
    pressed_ticks: u32,
    /// Ticks in a row in which output enable read another level than the board drove.
    enable_ticks: u32,
    has_jumper: bool,
    /// The host has a person press the button.
    is_attended: bool,
    happened: Vec<Physical>,
    /// Since when the emergency stop is pressed.
    pressed_ns: Option<u64>,
    /// What the host's act does to the servos.
    act_faults: ServoFaults,
    /// The host's act has the switches of these inputs stuck, closed if `true`.
    stuck: Option<(u32, bool)>,
    /// The host's act has cut the wire by which the chain returns what is shifted into it.
    is_return_cut: bool,
    /// The supply of the board is low.
    is_supply_low: bool,
    /// The chain is shorter than the profile in force says.
    is_chain_short: bool,
    /// Until then a servo may be moved by something stronger than it.
    pushed_ns: u64,
    /// The kind of the disturbance that ended last, and when, until the host gets through again.
    recovering: Option<(&'static str, u64)>,
    /// The challenge that the board has answered last.
    heard_challenge: Option<u64>,
    /// Since when the host tries to get through.
    tried_ns: Option<u64>,
    /// How long the host needed after each disturbance, from its first try on, ms.
    pub recoveries: Vec<(&'static str, u64)>,
    /// Disturbances by kind.
    pub injected: BTreeMap<&'static str, u32>,
    /// What happened, for people.
    pub trace: Trace,
}

impl World {
    /// The world of a script. With `readable`, the trace is kept for people.
    pub fn new(script: &Script, readable: bool) -> Self {
        let (wiring, profile) = (script.arm.wiring(), script.arm.profile());
        let mut plant = Plant::new(&wiring, &[]);
        plant.bend_servos(&script.arm.servos.iter().map(|servo| servo.bend_steps).collect::<Vec<_>>());
        plant.set_travel_share(script.arm.travel_share);
        plant.add_servo(STRANGER);
        let mut bench = Bench::new(plant, MemoryFlash::with_profile_on(script.chip, &profile.image()));
        bench.set_clock_error(script.clock_ppm);
        bench.set_polls(2);
        bench.set_supply(GOOD_SUPPLY_MV);
        let ceilings = script.arm.ceilings(script.clock_ppm);
        bench.hold_button(script.has_jumper);
        bench.invert_switches(u32::from(script.arm.stop_opens) << EMERGENCY_STOP);
        let mut world = Self {
            bench,
            arm: script.arm.clone(),
            wiring,
            profile: profile.profile.digest,
            pins: Pins::new(ceilings.clone()),
            servos: Servos::new(ceilings.clone()),
            switches: Switches::new(ceilings.clone(), script.arm.switches()),
            valves: Valves::new(script.arm.valves()),
            board_supply: BoardSupply::new(ceilings.clone()),
            wear: Wear::default(),
            person: Person::new(ceilings, profile.profile.digest.0),
            reports: Reports::new(),
            acts: script.world.iter().cloned().collect(),
            acts_from_ns: None,
            active: Vec::new(),
            session: 0,
            inbox: VecDeque::new(),
            host_link: 0,
            store_damaged_ns: None,
            reset_ns: 0,
            reset_lines: 0,
            disturbed_ns: 0,
            hostile_ns: None,
            acted_ns: [None; 2],
            commits: Vec::new(),
            second: None,
            quiet_ns: None,
            links: Vec::new(),
            callers: Vec::new(),
            reply: Vec::new(),
            ended_ns: 0,
            cleared_ns: 0,
            has_own_table: false,
            own_models: script.tables.iter().map(|table| table.model).collect(),
            foreign_ns: None,
            ran_ticks: 0,
            pressed_ticks: 0,
            enable_ticks: 0,
            has_jumper: script.has_jumper,
            is_attended: false,
            happened: Vec::new(),
            pressed_ns: None,
            act_faults: ServoFaults::default(),
            stuck: None,
            is_return_cut: false,
            is_supply_low: false,
            is_chain_short: false,
            pushed_ns: 0,
            recovering: None,
            heard_challenge: None,
            tried_ns: None,
            recoveries: Vec::new(),
            injected: BTreeMap::new(),
            trace: Trace::new(readable),
        };
        script.tables.iter().for_each(|table| world.know(table));
        world
    }

    /// A table that somebody may upload.
    pub fn know(&mut self, table: &Table) {
        self.reports.know(table.known());
        table.angles_rad.iter().for_each(|&(servo, angle_rad)| self.servos.on_tabled(servo, angle_rad));
    }

    /// True time, ns.
    pub fn now_ns(&self) -> u64 {
        self.bench.now_ns()
    }

    /// Notes what somebody does.
    pub fn say(&mut self, who: &'static str, what: impl FnOnce() -> String) {
        let now_ns = self.now_ns();
        self.trace.say(now_ns, who, what);
    }

    /// The script's disturbances and its second host count from now on.
    pub fn begin_acts(&mut self, second: Option<SecondHost<Self>>) {
        self.acts_from_ns = self.acts_from_ns.or(Some(self.now_ns()));
        if second.is_some() {
            *self.injected.entry("second host").or_default() += 1;
            self.second = second;
        }
    }

    /// Ends all disturbances: the second host leaves, the power comes back, everything is repaired.
    pub fn calm_down(&mut self) {
        if let Some(mut second) = self.second.take() {
            second.close(self);
        }
        self.acts.clear();
        self.bench.flash().restore();
        let now_ns = self.now_ns();
        self.active.iter_mut().for_each(|active| active.end_ns = now_ns);
        self.end_acts(now_ns);
    }

    /// True if nothing has disturbed the board since then. A servo that hears nothing, or whose answers nobody hears, cannot be
    /// stopped by either host, whichever has broken it.
    pub fn is_undisturbed_since(&self, since_ns: u64) -> bool {
        let ServoFaults { silent, mute, deaf, stubborn, .. } = self.act_faults;
        if silent | mute | deaf | stubborn != 0 {
            return false;
        }
        let armed = |active: &Active| matches!(active.act, WorldAct::FlashCut(..)) && active.end_ns == u64::MAX;
        self.active.iter().all(armed) && self.disturbed_ns < since_ns
    }

    /// The host wants something.
    pub fn on_host_try(&mut self) {
        self.tried_ns = self.tried_ns.or(Some(self.now_ns()));
    }

    /// The host got an answer.
    pub fn on_host_answer(&mut self) {
        let tried_ns = self.tried_ns.take().unwrap_or(self.now_ns());
        if let Some((kind, ended_ns)) = self.recovering.take() {
            self.recoveries.push((kind, (self.now_ns() - ended_ns.max(tried_ns)) / 1_000_000));
        }
    }

    /// Cuts the power for a moment.
    pub fn power_cycle(&mut self, noise: u64) {
        self.bench.power_off();
        self.bench.power_on(noise);
        self.observe();
    }

    /// A new host; the older one's line is closed.
    pub fn plug_in(&mut self) -> u32 {
        self.session += 1;
        self.inbox.clear();
        self.session
    }

    fn is_closed(&self, session: u32) -> bool {
        session != self.session || self.now_ns() > MAX_NS
    }

    /// One tick.
    pub fn step(&mut self) {
        let now_ns = self.now_ns();
        if let Some(from_ns) = self.acts_from_ns {
            while self.acts.front().is_some_and(|next| from_ns + next.at_ms * 1_000_000 <= now_ns) {
                self.acts.pop_front().into_iter().for_each(|entry| self.begin(entry));
            }
        }
        if !self.active.is_empty() {
            self.end_acts(now_ns);
            self.act_on();
        }
        let was_powered = self.bench.is_powered();
        if self.bench.is_paused() {
            self.pins.on_pause(now_ns);
            self.servos.on_pause(now_ns, self.bench.tick_ns());
        }
        let bench = &mut self.bench;
        if let Err(message) = panics::caught(|| bench.step()) {
            self.pins.on_panic(now_ns, &message);
            self.bench.reset();
        }
        if was_powered && !self.bench.is_powered() {
            self.on_flash_cut();
        }
        self.observe();
        self.pins.on_tick_end(self.bench.now_ns());
        self.look_at_chain();
        self.look_at_arm();
        if self.pins.high() != 0 {
            self.servos.on_lines_on(self.bench.now_ns());
            self.judge_quiet();
        }
        let received = self.bench.received();
        if !received.is_empty() {
            self.trace.mix(received.make_contiguous());
            if let Some(second) = &mut self.second {
                second.hear(received.iter().copied());
            }
            let received: Vec<u8> = self.bench.received().drain(..).collect();
            self.inbox.extend(&received);
            self.hear_challenges(&received);
        }
        if let Some(mut second) = self.second.take() {
            second.step(self);
            self.second = Some(second);
        }
    }

    /// Shows the judges what is wrong with the chain. An output enable that reads another level than the board drives latches the safe state.
    fn look_at_chain(&mut self) {
        let (now_ns, faults) = (self.bench.now_ns(), self.bench.chain_faults());
        self.pins.on_return(now_ns, !faults.return_cut);
        let is_seen = faults.enable.is_some_and(|is_high| is_high == self.pins.is_driven());
        self.enable_ticks = if is_seen { self.enable_ticks + u32::from(self.is_in_force()) } else { 0 };
        if self.enable_ticks >= ENABLE_TICKS {
            self.servos.on_latched(now_ns);
        }
    }

    /// Shows the judges the mechanism, the person and the inputs at the end of a tick.
    fn look_at_arm(&mut self) {
        let now_ns = self.bench.now_ns();
        self.ran_ticks += u32::from(self.is_running());
        self.hold_button();
        self.person.look(now_ns, self.bench.is_button_closed());
        if let Some(since_ns) = self.pressed_ns {
            self.pins.on_emergency_stop(now_ns, since_ns);
            self.pressed_ticks += u32::from(self.is_in_force());
            if self.pressed_ticks >= PRESSED_TICKS {
                self.servos.on_latched(now_ns);
            }
        }
        if self.arm.min_supply_mv.is_some() && self.is_running() {
            self.look_at_supply(now_ns);
        }
        let broken = self.bench.plant().broken();
        let ServoFaults { silent, mute, deaf, stubborn, unconfirmed, damaged, .. } = broken.servos;
        // A board that has lost its profile knows no servo: it can stop none, and no order gives one another goal.
        if self.person.may_be_lost() {
            self.servos.on_uncontrolled(now_ns, self.person.is_lost());
        }
        let is_noisy = self.is_bus_noisy() || self.person.may_be_lost();
        let garbled = deaf | stubborn | unconfirmed | damaged;
        let unheard = silent | mute | garbled;
        let overloaded = broken.servos.overloaded | broken.servos.strained;
        let is_bus_clear = unheard == 0 && !is_noisy;
        let joint = |(index, state): (usize, ServoState)| {
            let has = |mask: u8| mask >> index & 1 == 1;
            Joint {
                id: state.id,
                step: state.step,
                has_torque: state.has_torque,
                goal: state.goal_step.into(),
                torque_limit: state.torque_limit,
                answers: state.answers,
                is_blocked: state.is_blocked,
                is_overloaded: has(overloaded),
                is_heard: !is_noisy && !has(unheard),
                is_silent: !is_noisy && has(silent | mute) && !has(garbled),
                misled: state.misled,
                is_bus_clear,
                is_pushed: now_ns < self.pushed_ns,
            }
        };
        let is_powered = self.bench.is_powered();
        self.servos.look(now_ns, is_powered, self.bench.plant().servos().enumerate().map(joint));
        if self.has_broken_switches() {
            self.switches.on_disturbed(now_ns);
        }
        self.valves.look(self.pins.high());
        self.switches.look(now_ns, self.pins.high(), self.bench.inputs(), self.has_own_table);
        if self.servos.is_latched() {
            self.pins.on_forbidden(now_ns, "safe-latched", "in the safe state, which nobody asked to be left");
        }
        if self.is_chain_short {
            self.pins.on_forbidden(now_ns, "chain-length", "on a chain that is shorter than the profile says");
        }
        if self.person.is_lost() {
            self.pins.on_forbidden(now_ns, "lost-profile", "on a board whose profile is damaged");
        }
    }

    /// Under a low supply nothing is driven: the board has latched the safe state.
    fn look_at_supply(&mut self, now_ns: u64) {
        if self.board_supply.look(now_ns, self.is_supply_low, self.is_in_force()) {
            self.servos.on_latched(now_ns);
            self.pins.on_forbidden(now_ns, "low-supply", "while the supply of the board is low");
        }
    }

    /// Whether the board takes its ticks.
    fn is_running(&self) -> bool {
        self.bench.is_powered() && !self.bench.is_paused()
    }

    /// Whether it does so under its profile.
    fn is_in_force(&self) -> bool {
        self.is_running() && self.ran_ticks > START_TICKS
    }

    /// The contact of the button as the script and the host have it.
    fn hold_button(&mut self) {
        let is_pressed = self.active.iter().any(|active| matches!(active.act, WorldAct::Press(_)));
        let is_loose = self.active.iter().any(|active| matches!(active.act, WorldAct::LooseJumper(_)));
        let is_open = is_loose && self.now_ns() / 1_000_000 % LOOSE_PERIOD_MS < LOOSE_MS;
        self.bench.hold_button(self.has_jumper && !is_open || self.is_attended || is_pressed);
    }

    /// The board starts.
    fn on_start(&mut self, power_was_off: bool) {
        let now_ns = self.bench.now_ns();
        self.pins.on_start(now_ns, power_was_off);
        self.servos.on_start(now_ns);
        self.person.on_start(now_ns);
        self.board_supply.on_start();
        self.switches.on_latches_unknown();
        if power_was_off {
            self.bench.flash().forget_wear();
        }
        self.wear.on_start(now_ns, power_was_off);
        self.ended_ns = self.ended_ns.max(now_ns);
        (self.ran_ticks, self.pressed_ticks, self.enable_ticks) = (0, 0, 0);
        self.pins.on_first_return(!self.bench.chain_faults().return_cut);
    }

    /// Shows the judges what happened at the pins.
    fn observe(&mut self) {
        let (now_ns, before) = (self.bench.now_ns(), self.pins.high());
        self.happened.extend(self.bench.take_happened());
        let mut happened = std::mem::take(&mut self.happened);
        for happened in happened.drain(..) {
            let mut is_started = None;
            match happened {
                Physical::Edge(pin, high) => {
                    self.trace.mix(&[pin as u8, u8::from(high)]);
                    self.pins.on_edge(now_ns, pin as u8, high);
                }
                Physical::Bus { bytes, .. } => self.trace.mix(&bytes),
                Physical::Reset => {
                    (self.reset_ns, self.reset_lines) = (now_ns, before);
                    is_started = Some(false);
                }
                Physical::Power(true) => is_started = Some(true),
                Physical::Loader if self.bench.flash().chip() == Chip::Rp2040 => self.person.on_loader(now_ns),
                Physical::Loader => {}
                Physical::Power(false) => {
                    self.pins.on_power_off(now_ns);
                    self.judge_wear();
                }
            }
            if let Some(power_was_off) = is_started {
                self.on_start(power_was_off);
            }
        }
        self.happened = happened;
        let after = self.pins.high();
        if before != after {
            self.trace.mix(&now_ns.to_le_bytes());
            self.trace.say(now_ns, "lines", || format!("{after:#018x}"));
        }
    }
}

impl second_host::Surroundings for World {
    fn now_ns(&self) -> u64 {
        self.now_ns()
    }

    fn on_second_sent(&mut self, bytes: &[u8]) {
        self.on_sent(Party::Second, bytes);
    }
}
