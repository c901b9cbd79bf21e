//! The dispatcher: takes frames, runs what they ask for, and gives the frame that answers.
//!
//! An order that changes something runs once: the answer to the last one is kept, and a repeated number gets it again.
//! What cannot be read is counted and never answered. Text commands ([`crate::text`]) go through the same dispatcher.
mod uploads;

use core::future::pending;

use darm_core::nearest::{Coordinates, Found};
use darm_core::output::MAX_COILS;
use darm_core::profile::{BUILT_IN, Profile};
use darm_core::sequencer::{Command, CommandError, Phase, ServoSeen};
use darm_core::table::{self, RowError, Table, TableError};
use darm_core::units::{DeviceId, Digest, Micros};
use darm_core::wire::PROTOCOL;
use darm_core::wire::bootstrap::{self, ANSWER, CrashRecord, Identity, Version};
use darm_core::wire::frame::{self, Header, MAX_FRAME, MAX_PAYLOAD};
use darm_core::wire::message::{
    Answer, Calibration, Hello, ImageKind, OUTPUTS, OutputState, REQUEST, Refusal, Reply, Request, Status,
};
use embassy_futures::yield_now;
use embedded_storage_async::nor_flash::NorFlash;

use crate::clock::Clock;
use crate::control::{Numbered, Order, Outcome, Shared, Snapshot, Unloaded};
use crate::log::EventLog;
use crate::nearest::{self, Room};
use crate::store::Store;

/// Version of this firmware: major, minor, patch.
pub const FIRMWARE: [u8; 3] = [
    decimal(env!("CARGO_PKG_VERSION_MAJOR")),
    decimal(env!("CARGO_PKG_VERSION_MINOR")),
    decimal(env!("CARGO_PKG_VERSION_PATCH")),
];

#[expect(clippy::indexing_slicing, clippy::arithmetic_side_effects, reason = "evaluated by the compiler")]
const fn decimal(text: &str) -> u8 {
    let (digits, mut value, mut i) = (text.as_bytes(), 0, 0);
    while i < digits.len() {
        value = value * 10 + (digits[i] - b'0');
        i += 1;
    }
    value
}

/// So long copies of a change may still be on the line. In less time nobody asks half the circle of request numbers: a
/// request and its answer take 5 ms on the wire.
const COPIES: Micros = Micros::from_millis(60_000);
/// Connections whose `Hello` may still be on the line.
const OLD_LINKS: usize = 8;
/// Rows that are rehearsed at once: the console is heard in between.
const REHEARSED: usize = 16;

/// What the dispatcher knows of the board when it opens.
pub struct Board {
    /// Number and name.
    pub identity: Identity,
    /// How the start before ended.
    pub crash: Option<CrashRecord>,
}

/// Answers to the host.
pub struct Dispatcher<'s, 't, F: NorFlash, C> {
    pub(crate) board: Board,
    pub(crate) clock: C,
    pub(crate) shared: &'s Shared<'t>,
    pub(crate) log: EventLog,
    /// Set when the board is to restart, once the answer has left.
    reboot: Option<bootstrap::Into>,
    /// A new profile is stored: no stop puts off the restart that brings it into force.
    is_profile_new: bool,
    /// `None` when the flash does not answer.
    store: Option<Store<F>>,
    /// The table while the control tick does not have it.
    table: Option<&'t mut Table>,
    /// The profile in force.
    profile: &'t Profile,
    /// Why the stored table or profile is not in force.
    rejected: Option<Refusal>,
    /// The servos' zero offsets, `None` where none were ever stored; or why they are not known.
    calibration: Result<Option<Calibration>, Refusal>,
    /// How many stops there were when what is being done was begun.
    stops: u32,
    boots: u32,
    bad_frames: u32,
    /// The connection that may ask for more than the bootstrap set.
    link: Option<u32>,
    /// How many stops there were when it was opened.
    link_stops: u32,
    /// Connections before it: a late copy of their `Hello` opens none of them again.
    old_links: [Option<u32>; OLD_LINKS],
    last: Option<Answered>,
    /// Where the nearest word is sought.
    room: &'s mut Room,
    /// The request that waits for it.
    pub(crate) sought: Option<Header>,
}

/// The last request that changed something, and its answer.
struct Answered {
    number: u16,
    at: Micros,
    reply: Payload,
}

type Payload = heapless::Vec<u8, MAX_PAYLOAD>;
/// A whole frame on the line.
pub type Frame = heapless::Vec<u8, MAX_FRAME>;

impl<'s, 't, F: NorFlash, C: Clock> Dispatcher<'s, 't, F, C> {
    /// A dispatcher that knows nothing yet; [`Dispatcher::open`] it before it answers.
    pub fn new(board: Board, clock: C, shared: &'s Shared<'t>, room: &'s mut Room) -> Self {
        Self {
            board,
            clock,
            shared,
            log: EventLog::default(),
            reboot: None,
            is_profile_new: false,
            store: None,
            table: None,
            profile: &BUILT_IN,
            rejected: None,
            calibration: Ok(None),
            stops: 0,
            boots: 0,
            bad_frames: 0,
            link: None,
            link_stops: 0,
            old_links: [None; OLD_LINKS],
            last: None,
            room,
            sought: None,
        }
    }

    /// Opens the store, puts the stored profile in force, loads the valid table and hands it to the control tick, which
    /// must be running. Without a profile the one that is built in is in force; with one that cannot be read nothing is driven.
    pub async fn open(&mut self, flash: Option<F>, table: &'t mut Table, profile: &'t mut Profile) {
        if let Some(flash) = flash {
            let mut store = Store::open(flash).await;
            self.boots = store.count_boot().await.unwrap_or(0);
            match store.load_valid_profile(profile).await {
                Ok(true) => self.profile = profile,
                // The built-in limits are for a board without a stored profile, not for one whose profile is damaged.
                Ok(false) if store.is_readable() => {}
                Ok(false) => self.drive_nothing(profile, Refusal::Storage),
                Err(error) => self.drive_nothing(profile, error.into()),
            }
            self.calibration = store.calibration().await.map_err(|_| Refusal::NoCalibration);
            self.store = Some(store);
        }
        self.shared.ask(Order::Configure(self.profile)).await;
        if !self.apply_calibration().await {
            self.calibration = Err(Refusal::NoCalibration);
        }
        self.restore(table).await;
    }

    fn drive_nothing(&mut self, profile: &'t mut Profile, reason: Refusal) {
        *profile = Profile::empty();
        self.profile = profile;
        self.rejected = Some(reason);
    }

    /// Why the stored table or profile is not in force, if it is not.
    pub fn rejected(&self) -> Option<Refusal> {
        self.rejected
    }

    /// The profile in force.
    pub fn profile(&self) -> &'t Profile {
        self.profile
    }

    /// Whether the records of the store can be read.
    pub fn is_store_readable(&self) -> bool {
        self.store.as_ref().is_some_and(Store::is_readable)
    }

    /// Whether the flash answers: without it no table can be stored.
    pub fn has_store(&self) -> bool {
        self.store.is_some()
    }

    /// From here on a stop refuses what is asked.
    pub(crate) fn begin_item(&mut self) {
        self.stops = self.shared.stops();
    }

    /// Something came that is neither frame nor text.
    pub fn note_bad(&mut self) {
        self.bad_frames = self.bad_frames.saturating_add(1);
    }

    /// Keeps an event for the host.
    pub fn note(&mut self, event: Numbered) {
        self.log.push(event);
    }

    /// Answers what stood between two zero bytes. `None`: it was no frame, or a late copy of an old one, or its answer is
    /// still [sought](Self::seek).
    pub async fn answer(&mut self, encoded: &mut [u8]) -> Option<Frame> {
        self.begin_item();
        let Ok((header, payload)) = frame::decode(encoded) else {
            self.note_bad();
            return None;
        };
        let reply = if header.tag == REQUEST {
            self.request(header, payload).await?
        } else if let Some(request) = bootstrap::Request::decode(header.tag, payload) {
            self.bootstrap(request).await
        } else {
            self.note_bad();
            return None;
        };
        let tag = header.tag | ANSWER;
        encode(Header { tag, ..header }, &reply)
    }

    async fn bootstrap(&mut self, request: bootstrap::Request) -> Payload {
        match request {
            bootstrap::Request::Identify => payload(&self.board.identity.encode()),
            bootstrap::Request::Version => payload(&Version { protocol: PROTOCOL, firmware: FIRMWARE }.encode()),
            bootstrap::Request::Stop => {
                let stop = Order::Command { command: Command::Stop, stops: self.stops };
                self.shared.ask(stop).await;
                payload(&[0])
            }
            bootstrap::Request::ReadFault => payload(&CrashRecord::encode(self.board.crash.as_ref())),
            bootstrap::Request::Reboot(into) => match self.restart(into).await {
                Ok(()) => payload(&[0]),
                Err(_) => payload(&[1]),
            },
        }
    }

    /// Repeats, drops or runs a request of the versioned set.
    async fn request(&mut self, header: Header, bytes: &[u8]) -> Option<Payload> {
        let request = match postcard::take_from_bytes::<Request>(bytes) {
            Ok((request, [])) => request,
            _ => return Some(self.reply(Err(Refusal::Unknown))),
        };
        if let Request::Hello { protocol } = request {
            let result = self.hello(header.link, protocol).await;
            return Some(self.reply(result));
        }
        if self.link != Some(header.link) {
            return Some(self.reply(Err(Refusal::NotConnected)));
        }
        if let Request::Nearest(target) = request {
            if self.sought != Some(header) {
                self.sought = None;
                match self.begin_nearest(&target).await {
                    Ok(()) => self.sought = Some(header),
                    Err(refusal) => return Some(self.reply(Err(refusal))),
                }
            }
            return None;
        }
        if request.is_repeatable() {
            let result = self.run(request).await;
            return Some(self.reply(result));
        }
        // Numbers count around: a change that is kept for ever would make a new one look old.
        if let Some(last) = self.last.as_ref().filter(|last| self.clock.now() - last.at < COPIES) {
            match header.number.wrapping_sub(last.number) as i16 {
                0 => return Some(last.reply.clone()),
                ..0 => return None,
                1.. => {}
            }
        }
        let result = self.run(request).await;
        let reply = self.reply(result);
        self.last = Some(Answered { number: header.number, at: self.clock.now(), reply: reply.clone() });
        Some(reply)
    }

    /// Restarts the board where nothing runs.
    pub(crate) async fn restart(&mut self, into: bootstrap::Into) -> Result<(), Refusal> {
        self.require_idle().await?;
        self.reboot = Some(into);
        Ok(())
    }

    /// What the board is to restart into now. A restart that somebody asked for before a stop is dropped, as all that came
    /// before it.
    pub fn restart_due(&mut self, stopped: bool) -> Option<bootstrap::Into> {
        self.reboot.take().filter(|_| !stopped || self.is_profile_new)
    }

    /// A repeated `Hello` changes nothing: what its connection has done stays done once.
    async fn hello(&mut self, link: u32, protocol: u16) -> Result<Answer, Refusal> {
        if protocol != PROTOCOL {
            return Err(Refusal::Protocol { board: PROTOCOL });
        }
        if self.link != Some(link) {
            if self.old_links.contains(&Some(link)) {
                return Err(Refusal::NotConnected);
            }
            self.old_links.rotate_right(1);
            self.old_links[0] = self.link;
            self.link = Some(link);
            self.link_stops = self.stops;
            self.last = None;
        }
        self.catch_up();
        let model = self.snapshot().await?.model;
        Ok(Answer::Hello(Hello {
            protocol: PROTOCOL,
            device: self.device(),
            model,
            table: model.and_then(|_| self.table_digest()),
            profile: self.profile.digest,
            boots: self.boots,
            next_event: self.log.next(),
        }))
    }

    async fn run(&mut self, request: Request<'_>) -> Result<Answer, Refusal> {
        match request {
            Request::Hello { .. } | Request::Nearest(_) => Err(Refusal::Unknown),
            Request::Status => self.status().await.map(Answer::Status),
            Request::Events { from } => {
                self.catch_up();
                Ok(Answer::Events(self.log.from(from)))
            }
            Request::Begin(image) => self.begin(image).await,
            Request::Chunk { offset, bytes } => self.chunk(offset, bytes).await,
            Request::Commit(image) => self.commit(image).await,
            // A command may have been asked for before a stop and come, or come again, after it.
            Request::Command(command) if command != Command::Stop && self.is_stopped() => {
                Err(Refusal::Command(CommandError::Stopped))
            }
            Request::Calibrate(_) if self.is_stopped() => Err(Refusal::Command(CommandError::Stopped)),
            Request::Command(command) => self.command(command).await.map(|()| Answer::Done),
            Request::Calibrate(calibration) => self.calibrate(calibration).await,
            Request::Calibration => Ok(Answer::Calibration(self.calibration?)),
            Request::Outputs { from } => Ok(Answer::Outputs(self.outputs(from).await)),
        }
    }

    /// Whether somebody has stopped the arm since the connection was opened.
    fn is_stopped(&self) -> bool {
        self.link_stops != self.shared.stops()
    }

    async fn outputs(&self, from: u8) -> heapless::Vec<OutputState, OUTPUTS> {
        let mut outputs = heapless::Vec::new();
        for number in from..MAX_COILS as u8 {
            if outputs.is_full() {
                break;
            }
            if let Outcome::Output(Some(output)) = self.shared.ask(Order::Output(number)).await {
                let _ = outputs.push(output);
            }
        }
        outputs
    }

    /// Digest of the table that was loaded.
    pub(crate) fn table_digest(&self) -> Option<Digest> {
        self.store.as_ref().and_then(|store| store.digest(ImageKind::Table))
    }

    /// A word that brings the tool near a pose in the base, by the frames in the stored table.
    pub(crate) async fn nearest(&mut self, target: &Coordinates) -> Result<Found<f32>, Refusal> {
        self.sought = None;
        self.begin_nearest(target).await?;
        while self.room.step() {
            yield_now().await;
        }
        self.room.found().ok_or(Refusal::NoFrames)
    }

    /// Reads the frames.
    async fn begin_nearest(&mut self, target: &Coordinates) -> Result<(), Refusal> {
        if !target.is_sound() {
            return Err(Refusal::NoPose);
        }
        let Outcome::Summary(Some(table)) = self.shared.ask(Order::Summary).await else {
            return Err(Refusal::NoFrames);
        };
        let store = self.store.as_mut().ok_or(Refusal::Storage)?;
        self.room.begin(&target.pose(), table.actuators.into());
        store.records(|record| nearest::take(self.room, record)).await?;
        self.room.found().map(|_| ()).ok_or(Refusal::NoFrames)
    }

    /// Searches on for the nearest word that was last asked for; the frame that answers, once it is found. Waits for ever
    /// where there is nothing to seek. It may be dropped at any time, and goes on where it was.
    pub async fn seek(&mut self) -> Frame {
        while let Some(header) = self.sought {
            if !self.room.step() {
                self.sought = None;
                let reply = self.reply(self.room.found().map(Answer::Nearest).ok_or(Refusal::NoFrames));
                if let Some(frame) = encode(Header { tag: header.tag | ANSWER, ..header }, &reply) {
                    return frame;
                }
            }
            yield_now().await;
        }
        pending().await
    }

    /// Does what a person or a host asks for, or says why not.
    pub(crate) async fn command(&mut self, command: Command) -> Result<(), Refusal> {
        if command == Command::Play {
            self.rehearse().await?;
        }
        match self.shared.ask(Order::Command { command, stops: self.stops }).await {
            Outcome::Command(result) => result.map_err(Refusal::Command),
            _ => Err(Refusal::Unknown),
        }
    }

    /// Refuses a program that would exceed the limit of an output because of what has flowed before.
    async fn rehearse(&mut self) -> Result<(), Refusal> {
        match self.snapshot().await?.phase {
            Phase::Idle => {}
            Phase::Manual => {
                self.shared.ask(Order::Command { command: Command::Stop, stops: self.stops }).await;
            }
            // The control tick refuses, and says why.
            Phase::Approaching { .. } | Phase::Playing { .. } | Phase::Safe(_) => return Ok(()),
        }
        let Outcome::Unload(Unloaded::Table(table)) = self.shared.ask(Order::Rehearse).await else {
            return Ok(());
        };
        let rehearsed = rehearse(table).await;
        self.hand_over(table).await;
        match rehearsed {
            Err(TableError::Row { row, error: RowError::OnTooLong { output } | RowError::Duty { output } }) => {
                let state = self.shared.ask(Order::Output(output)).await;
                let wait_ms = if let Outcome::Output(Some(state)) = state { state.recovery_ms } else { 0 };
                Err(Refusal::Recovering { row, output, wait_ms })
            }
            rehearsed => rehearsed.map_err(Refusal::Table),
        }
    }

    pub(crate) async fn snapshot(&self) -> Result<Snapshot, Refusal> {
        match self.shared.ask(Order::Status).await {
            Outcome::Status(snapshot) => Ok(snapshot),
            _ => Err(Refusal::Unknown),
        }
    }

    async fn status(&mut self) -> Result<Status, Refusal> {
        let now = self.snapshot().await?;
        let mut servos = heapless::Vec::new();
        for index in 0..now.n_servos.into() {
            // There is room for every servo of a table.
            let _ = servos.push(self.joint_seen(index));
        }
        Ok(Status {
            phase: now.phase,
            word: now.word,
            rows: now.rows,
            model: now.model,
            switches: now.switches,
            servos,
            bad_frames: self.bad_frames,
            worst_lateness_us: u32::try_from(now.worst_lateness.0).unwrap_or(u32::MAX),
        })
    }

    /// What a servo answered last, with the angle of its joint.
    pub(crate) fn joint_seen(&self, index: usize) -> ServoSeen {
        let seen = self.shared.servo_seen(index);
        let offset_rad = self.offsets().offsets_rad().get(index).copied().unwrap_or(0.0);
        ServoSeen { angle_rad: seen.angle_rad - offset_rad, ..seen }
    }

    fn offsets(&self) -> Calibration {
        self.calibration.ok().flatten().unwrap_or_default()
    }

    async fn calibrate(&mut self, calibration: Calibration) -> Result<Answer, Refusal> {
        self.require_idle().await?;
        self.store()?.set_calibration(calibration).await.map_err(|_| Refusal::Storage)?;
        self.calibration = Ok(Some(calibration));
        if self.apply_calibration().await { Ok(Answer::Done) } else { Err(Refusal::Busy) }
    }

    /// Gives the offsets to the control tick, which refuses them only while a program runs.
    async fn apply_calibration(&self) -> bool {
        matches!(self.shared.ask(Order::Calibrate(self.offsets())).await, Outcome::Command(Ok(())))
    }

    /// Offsets that are lost are not zero: no table that has servos is loaded with them.
    fn check_calibration(&self, table: &Table) -> Result<(), Refusal> {
        if table.wiring().servos.is_empty() { Ok(()) } else { self.calibration.map(|_| ()) }
    }

    /// Takes the table out of the control tick's hands.
    async fn take_table(&mut self) -> Result<&'t mut Table, Refusal> {
        if let Some(table) = self.table.take() {
            return Ok(table);
        }
        match self.shared.ask(Order::Unload).await {
            Outcome::Unload(Unloaded::Table(table)) => Ok(table),
            _ => Err(Refusal::Busy),
        }
    }

    /// Loads the valid table, if there is one, and hands it over; else keeps the empty table.
    async fn restore(&mut self, table: &'t mut Table) {
        let board = self.board_of_tables();
        let loaded = match &mut self.store {
            Some(store) if self.rejected != Some(Refusal::Storage) => store.load_valid(table, &board).await,
            _ => Ok(false),
        };
        let checked = match loaded {
            Ok(is_loaded) => self.check_calibration(table).map(|()| is_loaded),
            Err(error) => Err(error.into()),
        };
        match checked {
            Ok(true) => return self.hand_over(table).await,
            Ok(false) => {}
            Err(refusal) => {
                self.rejected.get_or_insert(refusal);
                table.clear();
            }
        }
        self.table = Some(table);
    }

    fn board_of_tables(&self) -> table::Board<'t> {
        table::Board { device: Some(self.device()), profile: self.profile }
    }

    /// Gives the table to the control tick.
    async fn hand_over(&mut self, table: &'t mut Table) {
        if let Outcome::Load(back) = self.shared.ask(Order::Load(table)).await {
            self.table = back;
        }
    }

    async fn require_idle(&self) -> Result<(), Refusal> {
        match self.snapshot().await?.phase {
            Phase::Idle | Phase::Safe(_) => Ok(()),
            Phase::Manual | Phase::Approaching { .. } | Phase::Playing { .. } => Err(Refusal::Busy),
        }
    }

    fn store(&mut self) -> Result<&mut Store<F>, Refusal> {
        self.store.as_mut().ok_or(Refusal::Storage)
    }

    /// Fetches the events that wait.
    pub(crate) fn catch_up(&mut self) {
        while let Some(event) = self.shared.events.take() {
            self.log.push(event);
        }
    }

    pub(crate) fn device(&self) -> DeviceId {
        self.board.identity.device
    }

    fn reply(&self, result: Result<Answer, Refusal>) -> Payload {
        let mut bytes = [0; MAX_PAYLOAD];
        let reply = Reply { at: self.clock.now(), result };
        postcard::to_slice(&reply, &mut bytes).map_or_else(|_| Payload::new(), |used| payload(used))
    }
}

/// Lets the limits of all outputs judge the rows, a few at a time.
async fn rehearse(table: &mut Table) -> Result<(), TableError> {
    let n_rows = table.rows().len();
    for first in (0..n_rows.max(1)).step_by(REHEARSED) {
        table.rehearse(first..first.saturating_add(REHEARSED).min(n_rows))?;
        yield_now().await;
    }
    Ok(())
}

fn payload(bytes: &[u8]) -> Payload {
    bytes.iter().copied().take(MAX_PAYLOAD).collect()
}

pub(crate) fn encode(header: Header, payload: &[u8]) -> Option<Frame> {
    let mut frame = Frame::new();
    frame.resize_default(MAX_FRAME).ok()?;
    let len = frame::encode(header, payload, &mut frame).ok()?;
    frame.truncate(len);
    Some(frame)
}
