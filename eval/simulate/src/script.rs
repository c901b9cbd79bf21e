//! The script of one seed: an arm, tables, what the host does and what happens to it. A value, so that it can be shrunk.
//!
//! Times are true time in milliseconds. Every entry carries the seed of what it draws, so that leaving one out does not
//! change the others.

use darm_sim::in_process::Chip;
use rand::seq::SliceRandom as _;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use crate::arm::{ALL_SWITCHES, ArmPlan, Table, TablePlan};

/// Loss rates of the line, percent.
pub const LOSSES: [u32; 6] = [0, 1, 5, 10, 20, 30];
/// A run lasts at least this time.
pub const MIN_MS: u64 = 60_000;

/// This time after the last disturbance has begun most of them have ended, ms.
const CALM_MS: u64 = 1_500;

/// Directed scenes of one script.
const DIRECTED: usize = 3;

/// What the host does, one after the other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HostAct {
    /// Uploads a table of the script.
    Upload(usize),
    /// Runs the table.
    Play,
    /// Stops by the versioned request.
    Stop,
    /// Stops by the request that never changes.
    BootstrapStop,
    /// Leaves the safe state.
    Clear,
    /// Stops, then one short pulse of a coil, which must act once.
    Pulse(u8),
    /// Stops, then two coils, the second for a shorter time: each must go off at its own time. The same coil twice: at that of the second.
    TwoPulses(u8, u8),
    /// One coil on for this time, ms.
    Coil(u8, u32),
    /// One coil on as often as the board allows, then under another table as often as it allows, then after a restart.
    Exhaust(u8, usize),
    /// All actuators to digits drawn from this seed.
    Word(u64),
    /// A word that the arm does not have: a digit beyond the states of an actuator, or one digit too many.
    WrongWord(u64),
    /// A servo to an angle, mrad.
    Servo(u8, i32),
    /// Asks for the status so often.
    Poll(u32),
    /// Runs the table to its end, then sets the zero offsets of all servos, mrad: none may move.
    Calibrate(i32),
    /// Reads all events.
    Events,
    /// Something runs, then it is stopped in this way, then every command of before comes again.
    StopThen(StopForm),
    /// A servo turns, and meanwhile this happens to it.
    TurnUnder(TurnFault, i32),
    /// Copies of what opened an earlier connection, and commands on it, while the board is at rest.
    LateHello,
    /// A person presses the button, or does not, and the profile is written again.
    WriteProfile(bool),
    /// Runs the table while all limit switches are stuck, closed if `true`.
    PlayContradicted(bool),
    /// One latch set and reset as fast and as often as the board allows, each pulse cut by the next.
    QuickLatch,
    /// One output on, a restart at once, and the same output on as soon as the board allows.
    PeakOverReset,
    /// All servos turn, and meanwhile this happens to one of them.
    TurnTogether(TurnFault, i32),
    /// Words and coils by hand, one after the other, while some switches are stuck, closed if `true`.
    MoveContradicted(bool),
    /// Runs the table whose program ends while its servos are on their way; then something is to be stored, or a servo reports an
    /// overload.
    EndUnderWay,
    /// The emergency stop was pressed; then a stop of this form and commands come, and nobody leaves the safe state.
    ActWhileSafe(StopForm),
    /// A person replaces the profile, a bit of each copy of the newest record turns, and the board starts again.
    LoseProfile,
    /// The same of zero offsets.
    LoseOffsets,
    /// A person puts a profile in force that names the length of the chain, and the board starts again with a shorter one.
    ShortenChain,
    /// A bit of one copy of the number of the start turns, the board starts again, and what opened a connection before comes again.
    RepeatStart,
    /// Servos turn, and some of what is written to one of them is damaged with a sum that is right.
    Mislead,
    /// Something is driven, and the supply of the board does this.
    Supply(SupplyForm),
    /// A load that a servo does not bear pushes it away from what it holds, while a coil is on.
    Sag,
    /// Somebody turns a servo without torque out of its range, slowly, while a coil is on.
    TurnByHand,
    /// A coil by hand, and off again before its time is over.
    Off(u8),
    /// One coil on as often as the board allows, under the profile and then under another in which its output has another number.
    ExhaustOverProfiles(u8),
    /// Somebody asks for a restart while something runs.
    RestartUnderWay,
    /// Somebody has tables stored, or zero offsets (`false`), as fast as the board takes them, over starts too.
    WearOut(bool),
    /// Both coils of an actuator that has no state with both, one after the other, by hand; in between a stop may leave the first one set.
    NoSuchState,
    /// A latch of an actuator with a switch by hand, no other line on, while that switch is stuck, closed if `true`.
    LatchContradicted(bool),
    /// A servo that holds lowers its torque limit by itself, and a stop comes while the one before is in force.
    StopAgain,
    /// A coil on for a moment, then a stop, as often as the supply feeds it: what flowed before each stop counts.
    StopPulses,
    /// A load that a servo does not bear pushes it away from the target at which it is, while a coil is on.
    SagAtTarget,
    /// Somebody turns a servo without torque within its range, faster than the profile says, while a coil is on.
    TurnFast,
    /// The chain returns nothing while a coil is on and another one switches again and again.
    CutUnderChange,
}

/// What the supply of the board does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SupplyForm {
    /// It falls for good.
    Falls,
    /// It dips for 38 ms each second: a motor that starts.
    Dips,
    /// It is low for 40 ms and good for 40 ms, again and again: it switches itself off at overload.
    Collapses,
}

impl SupplyForm {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Falls, Self::Dips, Self::Collapses];
}

/// In which way somebody stops the arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopForm {
    /// A line of text.
    Typed,
    /// The request that never changes.
    Bootstrap,
    /// The versioned request.
    Message,
    /// The input of the emergency stop.
    Input,
}

impl StopForm {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Typed, Self::Bootstrap, Self::Message, Self::Input];
}

/// What happens to a servo that turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TurnFault {
    /// A stop, while some of its answers are damaged.
    StopWithDamage,
    /// A stop, while its answers to what is written are lost.
    StopUnconfirmed,
    /// A stop, and the same again and again while it rests.
    Stop,
    /// A stop, and what is written to it at first is lost.
    StopDeaf,
    /// It reports an overload.
    Overload,
    /// The emergency stop.
    Input,
    /// It falls silent; then commands come.
    Silent,
    /// A stop, and a table to store right behind it, while the others may answer nothing.
    StopAndStore,
    /// It takes no order any more and answers each; then commands come.
    Stubborn,
    /// A stop; then it is silent again and again for a moment while it rests.
    Silences,
    /// It reports a load above the torque that the profile allows it, and no overload. Not among [`TurnFault::ALL`]: drawn apart from them.
    Strained,
}

impl TurnFault {
    /// All of them that are drawn at any time.
    pub const ALL: [Self; 10] = [
        Self::StopWithDamage,
        Self::StopUnconfirmed,
        Self::Stop,
        Self::Overload,
        Self::Input,
        Self::Silent,
        Self::StopDeaf,
        Self::StopAndStore,
        Self::Stubborn,
        Self::Silences,
    ];
}

/// What a table of somebody else is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Foreign {
    /// A board without a profile.
    NoProfile,
    /// A board with another profile.
    OtherProfile,
    /// Another board with the same profile.
    OtherDevice,
    /// A board whose outputs count their duty over another window.
    OtherWindow,
    /// A board whose limit switches are at other inputs.
    OtherInputs,
}

impl Foreign {
    /// All of them.
    pub const ALL: [Self; 5] =
        [Self::NoProfile, Self::OtherProfile, Self::OtherDevice, Self::OtherWindow, Self::OtherInputs];
}

/// What happens to the board, at its time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WorldAct {
    /// The power is off for this time, ms.
    PowerCut(u32),
    /// The power fails at the n-th word of flash from now on, for this time, ms.
    FlashCut(u32, u32),
    /// The firmware starts again.
    Reset,
    /// The host is killed, whatever it waits for.
    KillHost,
    /// These switches are stuck (closed if `true`) for this time, ms.
    StuckSwitches(u32, bool, u32),
    /// These switches bounce at random for this time, ms.
    BouncingSwitches(u32, u32),
    /// Again and again these switches bounce for two ticks, for this time, ms: the board takes that for no contradiction.
    BriefBounces(u32, u32),
    /// These servos do not answer for this time, ms.
    SilentServos(u8, u32),
    /// These servos cannot turn for this time, ms.
    BlockedServos(u8, u32),
    /// Some answers of these servos are damaged for this time, ms; their sums are right.
    DamagedServos(u8, u32),
    /// What is written to these servos is lost for this time, ms.
    DeafServos(u8, u32),
    /// What these servos answer to what is written is lost for this time, ms.
    UnconfirmedServos(u8, u32),
    /// These servos report an overload for this time, ms.
    OverloadedServos(u8, u32),
    /// The valve at a line of the arm gets no current for this time, ms.
    DeadValve(u32),
    /// A person presses the button for this time, ms.
    Press(u32),
    /// The stored profile is damaged, records (`true`) or image, and the firmware starts again.
    DamagedProfile(bool),
    /// A table of somebody else, uploaded completely and played.
    ForeignTable(Foreign),
    /// A profile beyond the limits of the arm, uploaded completely.
    WiderProfile,
    /// The wire by which the chain returns what is shifted into it is cut for this time, ms.
    CutReturn(u32),
    /// Output enable reads high (`true`) or low for this time, ms, whatever the board drives.
    StuckEnable(bool, u32),
    /// A table that differs from the arm in one kind of limit or line, uploaded completely and played.
    RecombinedTable,
    /// The jumper that somebody left opens again and again for a moment, for this time, ms.
    LooseJumper(u32),
    /// Somebody holds the emergency stop for this time, ms.
    EmergencyStop(u32),
    /// Something sends random bytes on the servo bus for this time, ms.
    BabblingBus(u32),
    /// Valid frames with arbitrary values: how many, and whether under the link of the host.
    Frames(u32, bool),
    /// A line of text.
    Text,
    /// A command and a stop in one piece, as from a host that does not wait for answers.
    Burst,
    /// A table beyond the limits of the arm, uploaded completely and played.
    Table,
}

impl WorldAct {
    /// Name of its kind in the results.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::PowerCut(_) => "power cut",
            Self::FlashCut(..) => "power cut in a flash operation",
            Self::Reset => "reset",
            Self::KillHost => "host killed",
            Self::StuckSwitches(..) => "stuck switches",
            Self::BouncingSwitches(..) => "bouncing switches",
            Self::BriefBounces(..) => "briefly bouncing switches",
            Self::SilentServos(..) => "silent servos",
            Self::BlockedServos(..) => "blocked servos",
            Self::DamagedServos(..) => "damaged answers of servos",
            Self::DeafServos(..) => "deaf servos",
            Self::UnconfirmedServos(..) => "unconfirmed servos",
            Self::OverloadedServos(..) => "overloaded servos",
            Self::DeadValve(_) => "dead valve",
            Self::Press(_) => "button pressed",
            Self::DamagedProfile(_) => "damaged profile",
            Self::ForeignTable(_) => "table of somebody else",
            Self::WiderProfile => "wider profile",
            Self::CutReturn(_) => "chain not returned",
            Self::StuckEnable(..) => "stuck output enable",
            Self::RecombinedTable => "table changed in one respect",
            Self::LooseJumper(_) => "loose jumper",
            Self::EmergencyStop(_) => "emergency stop",
            Self::BabblingBus(_) => "babbling servo bus",
            Self::Frames(..) => "hostile frames",
            Self::Text => "hostile text",
            Self::Burst => "command and stop in one piece",
            Self::Table => "hostile table",
        }
    }

    /// Whether somebody but the host acts.
    pub fn is_hostile(&self) -> bool {
        matches!(
            self,
            Self::Frames(..)
                | Self::Text
                | Self::Burst
                | Self::Table
                | Self::ForeignTable(_)
                | Self::WiderProfile
                | Self::RecombinedTable
                | Self::DamagedProfile(_)
        )
    }

    /// How long it lasts, ms.
    pub fn lasts_ms(&self) -> u32 {
        match *self {
            Self::PowerCut(ms) | Self::FlashCut(_, ms) | Self::BabblingBus(ms) | Self::EmergencyStop(ms) => ms,
            Self::StuckSwitches(.., ms) | Self::BouncingSwitches(_, ms) | Self::BriefBounces(_, ms) => ms,
            Self::SilentServos(_, ms) | Self::BlockedServos(_, ms) | Self::DamagedServos(_, ms) => ms,
            Self::DeafServos(_, ms) | Self::UnconfirmedServos(_, ms) | Self::OverloadedServos(_, ms) => ms,
            Self::DeadValve(ms) | Self::Press(ms) | Self::LooseJumper(ms) => ms,
            Self::CutReturn(ms) | Self::StuckEnable(_, ms) => ms,
            Self::Reset | Self::KillHost | Self::Frames(..) | Self::Text | Self::Burst | Self::Table => 0,
            Self::DamagedProfile(_) | Self::ForeignTable(_) | Self::WiderProfile | Self::RecombinedTable => 0,
        }
    }
}

/// One entry with its time and the seed of what it draws.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Timed<A> {
    /// Not before, ms.
    pub at_ms: u64,
    /// What.
    pub act: A,
    /// Seed of what it draws.
    pub seed: u64,
}

/// A run.
#[derive(Clone, Debug)]
pub struct Script {
    /// Where it comes from.
    pub seed: u64,
    /// The chip of the board.
    pub chip: Chip,
    /// The arm.
    pub arm: ArmPlan,
    /// Tables that the host uploads.
    pub tables: Vec<Table>,
    /// Error of the board's clock, parts per million.
    pub clock_ppm: i32,
    /// Loss of the line in percent; damage, duplication, reordering and delay have a share of it.
    pub loss_percent: u32,
    /// What the host does.
    pub host: Vec<Timed<HostAct>>,
    /// What the second host does, in one seed of three.
    pub second: Vec<Timed<HostAct>>,
    /// What happens to the board.
    pub world: Vec<Timed<WorldAct>>,
    /// The contact of the button is closed from the beginning, as a jumper that somebody left.
    pub has_jumper: bool,
    /// The run lasts at least this time, ms.
    pub min_ms: u64,
}

impl Script {
    /// The script of a seed, on the first board.
    pub fn of(seed: u64) -> Self {
        Self::on(Chip::default(), seed)
    }

    /// The same on a board with this chip.
    pub fn on(chip: Chip, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (arm, tables) = draw_arm(&mut rng, seed);
        let loss_percent = LOSSES[rng.random_range(0..LOSSES.len())];
        let clock_ppm = rng.random_range(-20_000..=20_000);
        let (host, second, world) = (Vec::new(), Vec::new(), Vec::new());
        let (has_jumper, min_ms) = (seed % 8 == 5, MIN_MS);
        let mut script =
            Self { seed, chip, arm, tables, clock_ppm, loss_percent, host, second, world, has_jumper, min_ms };
        if seed % 50 == 49 {
            script.poll_for_long(&mut rng);
        } else {
            script.draw_host(&mut rng);
            script.draw_world(&mut rng);
            if seed % 3 == 1 {
                script.draw_second(&mut rng);
            }
            script.draw_rare();
            script.draw_last();
            script.draw_at_rest();
            script.draw_directed();
        }
        script
    }

    /// A host that only polls, longer than half the range of its counter, then commands.
    fn poll_for_long(&mut self, rng: &mut ChaCha8Rng) {
        self.loss_percent = 0;
        let acts = [
            HostAct::Upload(0),
            HostAct::Pulse(0),
            HostAct::Poll(33_000),
            HostAct::Stop,
            HostAct::Pulse(0),
            HostAct::Play,
            HostAct::Stop,
        ];
        self.host = acts.into_iter().map(|act| Timed { at_ms: 0, act, seed: rng.random() }).collect();
    }

    fn draw_host(&mut self, rng: &mut ChaCha8Rng) {
        let mut at_ms = 0;
        let opening = [HostAct::Upload(0), HostAct::Play, HostAct::Poll(3), HostAct::Stop];
        for index in 0..rng.random_range(14..26usize) {
            let act = opening.get(index).cloned().unwrap_or_else(|| self.draw_host_act(rng));
            let pause_ms = if act == HostAct::Stop { 1_500 } else { 200 };
            at_ms += rng.random_range(pause_ms / 4..pause_ms * 4);
            self.host.push(Timed { at_ms, act, seed: rng.random() });
        }
    }

    /// What would hardly ever happen by chance, drawn apart from the rest.
    fn draw_rare(&mut self) {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed ^ 0x7261_7265);
        let mut at_ms = self.host.last().map_or(0, |entry| entry.at_ms);
        let turn = HostAct::TurnUnder(TurnFault::StopDeaf, rng.random_range(250..490));
        let last = [
            HostAct::QuickLatch,
            HostAct::TurnUnder(TurnFault::Stop, 400),
            HostAct::PlayContradicted(rng.random()),
            HostAct::PeakOverReset,
            turn,
        ];
        let picked = rng.random_range(0..last.len());
        let next = (picked + 1) % last.len();
        let upload = HostAct::Upload(rng.random_range(0..2));
        for act in [upload, HostAct::Clear, last[picked].clone(), HostAct::Clear, last[next].clone()] {
            at_ms += rng.random_range(50..500);
            self.host.push(Timed { at_ms, act, seed: rng.random() });
        }
        let at_ms = rng.random_range(20_000..48_000);
        let mut acts = Vec::new();
        if rng.random_ratio(2, 3) {
            acts.extend([(0, WorldAct::RecombinedTable), (600, WorldAct::SilentServos(3, 1_500))]);
        }
        match rng.random_range(0..4u8) {
            0 => acts.push((rng.random_range(0..2_000), WorldAct::CutReturn(2_500))),
            1 => acts
                .push((rng.random_range(0..2_000), WorldAct::StuckEnable(rng.random(), rng.random_range(50..1_500)))),
            _ => {}
        }
        if rng.random() {
            acts.push((rng.random_range(0..2_000), WorldAct::BriefBounces(ALL_SWITCHES, 8_000)));
        }
        if self.has_jumper {
            acts.extend([(3_000, WorldAct::LooseJumper(200)), (3_300, WorldAct::WiderProfile)]);
        }
        for (after_ms, act) in acts {
            self.world.push(Timed { at_ms: at_ms + after_ms, act, seed: rng.random() });
        }
        self.world.sort_by_key(|entry| entry.at_ms);
    }

    /// What has to be set up for: two of these at the end, drawn apart from the rest.
    fn draw_last(&mut self) {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed ^ 0x6c61_7374);
        let mut at_ms = self.host.last().map_or(0, |entry| entry.at_ms);
        let fault = TurnFault::ALL[rng.random_range(0..TurnFault::ALL.len())];
        let form = StopForm::ALL[rng.random_range(0..StopForm::ALL.len())];
        let acts = [
            HostAct::TurnTogether(fault, rng.random_range(250..490)),
            HostAct::MoveContradicted(rng.random()),
            HostAct::PlayContradicted(rng.random()),
            HostAct::EndUnderWay,
            HostAct::RestartUnderWay,
            HostAct::ActWhileSafe(form),
        ];
        let picked = rng.random_range(0..acts.len());
        let next = (picked + rng.random_range(1..acts.len())) % acts.len();
        for act in [HostAct::Clear, acts[picked].clone(), HostAct::Clear, acts[next].clone()] {
            at_ms += rng.random_range(50..500);
            self.host.push(Timed { at_ms, act, seed: rng.random() });
        }
    }

    /// What damages or wears the store, the supply and requests on the servo bus: one of these behind everything, in most
    /// seeds, drawn apart from the rest.
    fn draw_at_rest(&mut self) {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed ^ 0x7265_7374);
        let supply = HostAct::Supply(SupplyForm::ALL[rng.random_range(0..SupplyForm::ALL.len())]);
        let has_servos = !self.arm.servos.is_empty();
        let has_released = self.arm.servos.iter().any(|servo| servo.is_released);
        let coil = rng.random_range(0..self.arm.coils.len().max(1)) as u8;
        let act = match rng.random_range(0..20u8) {
            18 | 19 => HostAct::ExhaustOverProfiles(coil),
            12 | 13 if has_servos => HostAct::Sag,
            14 | 15 => HostAct::ShortenChain,
            16 | 17 if has_released => HostAct::TurnByHand,
            0 | 1 | 11 => HostAct::LoseProfile,
            2 | 3 if has_servos => HostAct::LoseOffsets,
            4 | 5 => HostAct::RepeatStart,
            2 | 3 | 6 | 7 if self.arm.min_supply_mv.is_some() => supply,
            8 | 9 if has_servos => HostAct::Mislead,
            8 | 10 => HostAct::WearOut(rng.random()),
            _ => return,
        };
        // Nothing else of the script is to come: the board is at rest, and the run lasts as long anyway.
        let [host_ms, world_ms] = [
            self.host.last().map_or(0, |entry| entry.at_ms),
            self.world.last().map_or(0, |entry| entry.at_ms + CALM_MS),
        ];
        self.host.push(Timed { at_ms: host_ms.max(world_ms), act, seed: rng.random() });
    }

    /// Scenes for one rule each that nothing else leads to: some of those that the arm can show, behind everything, drawn apart from the rest.
    fn draw_directed(&mut self) {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed ^ 0x6469_7263);
        let mut acts = self.directed_acts(&mut rng);
        acts.shuffle(&mut rng);
        let [host_ms, world_ms] = [
            self.host.last().map_or(0, |entry| entry.at_ms),
            self.world.last().map_or(0, |entry| entry.at_ms + CALM_MS),
        ];
        for act in acts.into_iter().take(DIRECTED) {
            self.host.push(Timed { at_ms: host_ms.max(world_ms), act, seed: rng.random() });
        }
    }

    fn directed_acts(&self, rng: &mut ChaCha8Rng) -> Vec<HostAct> {
        let mut acts = Vec::new();
        if self.arm.three_states(0).is_some() {
            acts.push(HostAct::NoSuchState);
        }
        if self.arm.servos.iter().any(|servo| servo.is_released) {
            acts.push(HostAct::TurnFast);
        }
        if self.arm.steady_and_toggled().is_some() {
            acts.push(HostAct::CutUnderChange);
        }
        if self.arm.often().is_some() {
            acts.push(HostAct::StopPulses);
        }
        if !self.arm.servos.is_empty() {
            acts.extend([HostAct::StopAgain, HostAct::SagAtTarget]);
            acts.push(HostAct::TurnUnder(TurnFault::Strained, rng.random_range(250..490)));
        }
        if self.arm.watched_latch(0).is_some() {
            acts.push(HostAct::LatchContradicted(rng.random()));
        }
        acts
    }

    /// It connects in the midst of what the first host does.
    fn draw_second(&mut self, rng: &mut ChaCha8Rng) {
        let mut at_ms = rng.random_range(1_000..20_000);
        for _ in 0..rng.random_range(4..14u8) {
            let act = self.draw_second_act(rng);
            self.second.push(Timed { at_ms, act, seed: rng.random() });
            at_ms += rng.random_range(50..5_000);
        }
    }

    fn draw_second_act(&self, rng: &mut ChaCha8Rng) -> HostAct {
        let coil = rng.random_range(0..self.arm.coils.len().max(1)) as u8;
        match rng.random_range(0..12u8) {
            0 | 1 => HostAct::Upload(rng.random_range(0..self.tables.len())),
            2 => HostAct::Play,
            3 => HostAct::Stop,
            4 => HostAct::BootstrapStop,
            5 => HostAct::Clear,
            6 | 7 => HostAct::Pulse(coil),
            8 => HostAct::Coil(coil, rng.random_range(40..900)),
            9 => HostAct::Word(rng.random()),
            _ => HostAct::Poll(rng.random_range(1..20)),
        }
    }

    fn draw_host_act(&self, rng: &mut ChaCha8Rng) -> HostAct {
        let coil = rng.random_range(0..self.arm.coils.len().max(1)) as u8;
        match rng.random_range(0..34u8) {
            23..=25 => HostAct::StopThen(StopForm::ALL[rng.random_range(0..StopForm::ALL.len())]),
            26..=29 => {
                let fault = TurnFault::ALL[rng.random_range(0..TurnFault::ALL.len())];
                HostAct::TurnUnder(fault, rng.random_range(250..490) * if rng.random() { 1 } else { -1 })
            }
            30 | 31 => HostAct::LateHello,
            32 => HostAct::WriteProfile(rng.random_ratio(2, 3)),
            0 => HostAct::Upload(rng.random_range(0..self.tables.len())),
            1..=3 => HostAct::Play,
            4 | 5 => HostAct::Stop,
            6 | 7 => HostAct::BootstrapStop,
            8 | 9 => HostAct::Clear,
            10 | 11 => HostAct::Pulse(coil),
            12 => {
                let other = rng.random_range(0..self.arm.coils.len().max(1)) as u8;
                HostAct::TwoPulses(coil, if rng.random_ratio(1, 3) { coil } else { other })
            }
            13 | 14 => HostAct::Coil(coil, *[40, 300, 900, 3_000].get(rng.random_range(0..4usize)).unwrap_or(&40)),
            15 | 16 => HostAct::Word(rng.random()),
            17 => HostAct::Servo(rng.random_range(0..2), rng.random_range(-500..500)),
            18 => HostAct::Poll(rng.random_range(1..20)),
            19 => HostAct::Calibrate(rng.random_range(-80..80)),
            20 => HostAct::Exhaust(coil, rng.random_range(0..self.tables.len())),
            21 => HostAct::WrongWord(rng.random()),
            22 => HostAct::Off(coil),
            _ => HostAct::Events,
        }
    }

    fn draw_world(&mut self, rng: &mut ChaCha8Rng) {
        // The first upload has the line's faults only: its completion is measured.
        for _ in 0..rng.random_range(5..16usize) {
            let at_ms = rng.random_range(2_000..50_000);
            let act = draw_world_act(rng);
            self.world.push(Timed { at_ms, act, seed: rng.random() });
        }
        if self.seed % 7 == 3 {
            // What comes after it can do little: late in the run.
            let (at_ms, act) = (rng.random_range(40_000..50_000), WorldAct::DamagedProfile(rng.random()));
            self.world.push(Timed { at_ms, act, seed: rng.random() });
            // Under the limits that are built in all outputs count as used up for 10 s.
            for after_ms in [200, 11_500] {
                let act = WorldAct::ForeignTable(Foreign::NoProfile);
                self.world.push(Timed { at_ms: at_ms + after_ms, act, seed: rng.random() });
            }
            self.min_ms = 66_000;
        }
        if self.seed % 40 == 11 {
            // A button that is held for more than a minute counts as open.
            self.world.push(Timed { at_ms: 3_000, act: WorldAct::Press(64_000), seed: rng.random() });
            self.world.push(Timed { at_ms: 64_500, act: WorldAct::WiderProfile, seed: rng.random() });
            self.min_ms = 70_000;
        }
        self.world.sort_by_key(|entry| entry.at_ms);
    }
}

fn draw_arm(rng: &mut ChaCha8Rng, seed: u64) -> (ArmPlan, Vec<Table>) {
    loop {
        // A Pico and an STM32L475 measure this one both.
        let min_supply_mv = (seed % 3 != 2).then_some(3_000);
        let arm = ArmPlan { stop_opens: seed % 4 == 2, min_supply_mv, ..ArmPlan::draw(rng) };
        let mut second = arm.reversed_wiring();
        if seed.is_multiple_of(3) {
            // A table may leave out what the arm hangs on.
            second.servos.clear();
        }
        let (wirings, profile) = ([arm.wiring(), second, arm.hasty_wiring()], arm.profile().profile.digest);
        let mut table = |index: u64| {
            let wiring = &wirings[index as usize - 1];
            let rows = rng.random_range(4..60);
            let model = (seed << 8 | index).wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
            let ends_under_way = index == 3;
            Table::draw(rng, &TablePlan { wiring, profile, model, rows, ends_under_way, device: None })
        };
        if let (Some(first), Some(second), Some(third)) = (table(1), table(2), table(3)) {
            return (arm, vec![first, second, third]);
        }
    }
}

fn draw_world_act(rng: &mut ChaCha8Rng) -> WorldAct {
    let lasts_ms = rng.random_range(20..2_500);
    match rng.random_range(0..34u8) {
        23 | 24 => WorldAct::DamagedServos(rng.random_range(1..4), lasts_ms),
        25 => WorldAct::DeafServos(rng.random_range(1..4), lasts_ms),
        26 => WorldAct::UnconfirmedServos(rng.random_range(1..4), lasts_ms),
        27 | 28 => WorldAct::OverloadedServos(rng.random_range(1..4), lasts_ms),
        29 => WorldAct::DeadValve(lasts_ms),
        30 | 31 => WorldAct::Press(lasts_ms),
        32 => WorldAct::ForeignTable(Foreign::ALL[rng.random_range(0..Foreign::ALL.len())]),
        33 => WorldAct::WiderProfile,
        0 | 1 => WorldAct::PowerCut(lasts_ms),
        2..=4 => WorldAct::FlashCut(rng.random_range(1..1_500), lasts_ms),
        5 => WorldAct::Reset,
        6 | 7 => WorldAct::KillHost,
        8 => WorldAct::StuckSwitches(rng.random_range(1..=ALL_SWITCHES), rng.random(), lasts_ms),
        9 => WorldAct::BouncingSwitches(rng.random_range(1..=ALL_SWITCHES), lasts_ms),
        10 | 11 => WorldAct::SilentServos(rng.random_range(1..4), lasts_ms),
        12 => WorldAct::BlockedServos(rng.random_range(1..4), lasts_ms),
        13 => WorldAct::BabblingBus(lasts_ms),
        14..=16 => WorldAct::Frames(rng.random_range(1..120), rng.random_bool(0.7)),
        17 => WorldAct::Text,
        18 | 19 => WorldAct::Table,
        20 | 21 => WorldAct::Burst,
        _ => WorldAct::EmergencyStop(lasts_ms),
    }
}
