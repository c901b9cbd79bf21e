//! The dispatcher: takes frames, runs what they ask for, and gives the frame that answers.
//!
//! An order that changes something runs once: the answer to the last one is kept, and a repeated number gets it again.
//! What cannot be read is counted and never answered. Text commands ([`crate::text`]) go through the same dispatcher.
mod calibration;
mod encode;
mod nearest;
mod rehearsal;
mod start;
mod status;
mod tables;
mod uploads;
mod writes;

use darm_core::profile::{BUILT_IN, Profile};
use darm_core::sequencer::{Command, Phase};
use darm_core::table::Table;
use darm_core::table::nearest_search::NearestSearch;
use darm_core::units::{DeviceId, Micros};
use darm_core::wire::PROTOCOL;
use darm_core::wire::bootstrap::{self, ANSWER, CrashRecord, Identity, Version};
use darm_core::wire::caps::{BuildId, Caps};
use darm_core::wire::frame::{self, Header, MAX_FRAME, MAX_PAYLOAD};
use darm_core::wire::health::Health;
use darm_core::wire::message::{self, Answer, Calibration, Hello, Image, ImageKind, REQUEST, Refusal, Reply, Request};
use darm_core::wire::scan::Stop;
use embedded_storage_async::nor_flash::NorFlash;

use crate::clock::Clock;
use crate::control::{Numbered, Shared, Snapshot};
use crate::kept::{Kept, past};
use crate::log::{EventLog, LogMemory};
use crate::scan::{self, Confirmation};
use crate::servo::CYCLE;
use crate::store::Store;
use crate::wear::{Bucket, CALIBRATIONS, TABLES};
pub(crate) use encode::encode;
use writes::Write;

/// Version of this firmware: major, minor, patch.
pub const FIRMWARE: [u8; 3] = [
    decimal(env!("CARGO_PKG_VERSION_MAJOR")),
    decimal(env!("CARGO_PKG_VERSION_MINOR")),
    decimal(env!("CARGO_PKG_VERSION_PATCH")),
];

/// Which source this firmware was built from: eight bytes, written by the build script.
pub const BUILD: BuildId = BuildId(*include_bytes!(concat!(env!("OUT_DIR"), "/build-id")));

#[expect(clippy::indexing_slicing, clippy::arithmetic_side_effects, reason = "evaluated by the compiler")]
const fn decimal(text: &str) -> u8 {
    let (digits, mut value, mut i) = (text.as_bytes(), 0, 0);
    while i < digits.len() {
        value = value * 10 + (digits[i] - b'0');
        i += 1;
    }
    value
}

/// For this time copies of a change may still be on the line: a change whose number is older than the last one's is refused.
const COPIES: Micros = Micros::from_millis(60_000);

/// What the dispatcher knows of the board when it opens.
pub struct Board<'k> {
    /// Number and name.
    pub identity: Identity,
    /// How the start before ended.
    pub crash: Option<CrashRecord>,
    /// What it can do.
    pub caps: Caps,
    /// The chip's loader is entered only while a person holds the button.
    pub guards_loader: bool,
    /// What it reports of itself.
    pub health: fn() -> Health,
    /// Memory with its earlier crashes, where it has some.
    pub kept: Option<&'k Kept>,
}

/// Answers to the host.
pub struct Dispatcher<'s, 't, F: NorFlash, C> {
    pub(crate) board: Board<'s>,
    pub(crate) clock: C,
    pub(crate) shared: &'s Shared<'t>,
    pub(crate) log: EventLog<'s>,
    /// Set when the board is to restart, once the answer has left.
    reboot: Option<bootstrap::RebootTarget>,
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
    /// How often the flash may be written still.
    table_writes: Bucket,
    calibration_writes: Bucket,
    boots: u32,
    bad_frames: u32,
    /// The connection that may ask for more than the bootstrap set.
    link: Option<u32>,
    /// How many stops there were when it was opened.
    link_stops: u32,
    /// Connections that were opened since the start.
    openings: u32,
    last: Option<Answered>,
    /// Where the nearest word is sought.
    room: &'s mut NearestSearch,
    /// The request that waits for it.
    pub(crate) pending_search: Option<Header>,
}

/// The last request that changed something, and its answer.
struct Answered {
    number: u16,
    /// Checksum of the request: a host that begins again may use the number for another one.
    checksum: u32,
    at: Micros,
    reply: Payload,
}

type Payload = heapless::Vec<u8, MAX_PAYLOAD>;
/// A complete frame on the line.
pub type Frame = heapless::Vec<u8, MAX_FRAME>;

impl<'s, 't, F: NorFlash, C: Clock> Dispatcher<'s, 't, F, C> {
    /// A dispatcher that knows nothing yet; [`Dispatcher::open`] it before it answers.
    /// `log` is what memory has kept of the last events.
    pub fn new(
        board: Board<'s>,
        clock: C,
        shared: &'s Shared<'t>,
        room: &'s mut NearestSearch,
        log: &'s mut LogMemory,
    ) -> Self {
        Self {
            board,
            clock,
            shared,
            log: EventLog::new(log),
            reboot: None,
            is_profile_new: false,
            store: None,
            table: None,
            profile: &BUILT_IN,
            rejected: None,
            calibration: Ok(None),
            stops: 0,
            table_writes: Bucket::full(TABLES),
            calibration_writes: Bucket::full(CALIBRATIONS),
            boots: 0,
            bad_frames: 0,
            link: None,
            link_stops: 0,
            openings: 0,
            last: None,
            room,
            pending_search: None,
        }
    }

    /// Why the stored table or profile is not in force, if it is not.
    pub fn rejected(&self) -> Option<Refusal> {
        self.rejected
    }

    /// The profile in force.
    pub fn profile(&self) -> &'t Profile {
        self.profile
    }

    #[cfg(test)]
    pub(crate) fn put_in_force(&mut self, profile: &'t Profile) {
        self.profile = profile;
    }

    /// Whether the board has verifiably never had a profile, and the limits that are built in are in force.
    pub fn is_built_in(&self) -> bool {
        core::ptr::eq(self.profile, &BUILT_IN)
    }

    /// Whether there was a profile of which no record is left: see [`Store::is_profile_lost`].
    pub fn is_profile_lost(&self) -> bool {
        self.store.as_ref().is_none_or(Store::is_profile_lost)
    }

    /// Whether the records of the store can be read.
    pub fn is_store_readable(&self) -> bool {
        self.store.as_ref().is_some_and(Store::is_readable)
    }

    /// Whether the flash answers: without it no table can be stored.
    pub fn has_store(&self) -> bool {
        self.store.is_some()
    }

    /// From here on a stop refuses what is done next. Before every frame and line.
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

    /// Answers what stood between two zero bytes. `None`: it was no frame, or its answer is still [sought](Self::seek).
    pub async fn answer(&mut self, encoded: &mut [u8]) -> Option<Frame> {
        let Ok((header, payload)) = frame::decode(encoded) else {
            self.note_bad();
            return None;
        };
        // Of any connection and number.
        if let Some(stop) = Stop::of(header, payload) {
            return Frame::from_slice(&self.stop(stop).await).ok();
        }
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

    /// Takes a stop that [`crate::app::scan`] has not found, because nobody scans what comes here: the same event. What confirms it.
    pub(crate) async fn stop(&self, stop: Stop) -> Confirmation {
        self.shared.stop();
        scan::obeyed(stop, self.shared, || self.clock.now()).await
    }

    async fn bootstrap(&mut self, request: bootstrap::Request) -> Payload {
        match request {
            bootstrap::Request::Identify => payload(&self.board.identity.encode()),
            bootstrap::Request::Version => payload(&Version { protocol: PROTOCOL, firmware: FIRMWARE }.encode()),
            // Confirmed before.
            bootstrap::Request::Stop => Payload::new(),
            bootstrap::Request::ReadFault => payload(&CrashRecord::encode(self.board.crash.as_ref())),
            bootstrap::Request::Reboot(into) => match self.restart(into).await {
                Ok(()) => payload(&[0]),
                Err(_) => payload(&[1]),
            },
        }
    }

    /// Repeats, refuses or runs a request of the versioned set.
    async fn request(&mut self, header: Header, bytes: &[u8]) -> Option<Payload> {
        let request = match postcard::take_from_bytes::<Request>(bytes) {
            Ok((request, [])) => request,
            _ => {
                let other = message::hello_protocol(bytes).filter(|protocol| *protocol != PROTOCOL);
                let refusal = other.map_or(Refusal::Unknown, |_| Refusal::Protocol { board: PROTOCOL });
                return Some(self.reply(Err(refusal)));
            }
        };
        if let Request::Hello { protocol, challenge } = request {
            let result = self.hello(header.link, protocol, challenge).await;
            return Some(self.reply(result));
        }
        if self.link != Some(header.link) {
            return Some(self.reply(Err(Refusal::NotConnected)));
        }
        if let Request::Nearest(target) = request {
            if self.pending_search != Some(header) {
                self.pending_search = None;
                match self.begin_nearest(&target).await {
                    Ok(()) => self.pending_search = Some(header),
                    Err(refusal) => return Some(self.reply(Err(refusal))),
                }
            }
            return None;
        }
        if request.is_repeatable() {
            let result = self.run(request).await;
            return Some(self.reply(result));
        }
        let checksum = frame::CRC.checksum(bytes);
        // Numbers count around: a change that is kept for ever would make a new one look old.
        if let Some(last) = self.last.as_ref().filter(|last| self.clock.now() - last.at < COPIES) {
            match header.number.wrapping_sub(last.number) as i16 {
                0 if last.checksum == checksum => return Some(last.reply.clone()),
                // A late copy; or a host that begins again or has gone half round: each learns that nothing was done.
                ..=0 => return Some(self.reply(Err(Refusal::NotConnected))),
                _ => {}
            }
        }
        let result = self.run(request).await;
        let reply = self.reply(result);
        self.last = Some(Answered { number: header.number, checksum, at: self.clock.now(), reply: reply.clone() });
        Some(reply)
    }

    /// Restarts the board where nothing runs.
    pub(crate) async fn restart(&mut self, into: bootstrap::RebootTarget) -> Result<(), Refusal> {
        self.require_idle().await?;
        if into == bootstrap::RebootTarget::Loader && self.board.guards_loader && !self.shared.snapshot().await.button {
            return Err(Refusal::NobodyPresent);
        }
        self.reboot = Some(into);
        Ok(())
    }

    /// Whether a restart was requested.
    pub fn has_restart(&self) -> bool {
        self.reboot.is_some()
    }

    /// What the board is to restart into now. A restart that was requested before a stop is dropped, as all that came
    /// before it.
    pub fn restart_due(&mut self, stopped: bool) -> Option<bootstrap::RebootTarget> {
        self.reboot.take().filter(|_| !stopped || self.is_profile_new)
    }

    /// What a `Hello` has to carry to open a connection: the number of the start, which the flash counts, and of the connections
    /// and stops since. Each of these events makes another one, and no two ever have the same.
    fn challenge(&self) -> u64 {
        u64::from(self.boots) << 32 | u64::from(self.openings.wrapping_add(self.shared.stops()))
    }

    /// A repeated `Hello` changes nothing: what its connection has done stays done once.
    async fn hello(&mut self, link: u32, protocol: u16, challenge: u64) -> Result<Answer, Refusal> {
        if protocol != PROTOCOL {
            return Err(Refusal::Protocol { board: PROTOCOL });
        }
        if self.link != Some(link) {
            let last = self.challenge();
            if challenge != last {
                return Err(Refusal::Challenge { challenge: last });
            }
            self.openings = self.openings.wrapping_add(1);
            self.link = Some(link);
            self.link_stops = self.stops;
            self.last = None;
        }
        self.catch_up();
        let model = self.shared.snapshot().await.model;
        Ok(Answer::Hello(Hello {
            protocol: PROTOCOL,
            device: self.device(),
            model,
            table: model.and_then(|_| self.table_digest()),
            profile: self.profile.digest,
            boots: self.boots,
            next_event: self.log.next(),
            caps: self.board.caps.clone(),
        }))
    }

    async fn run(&mut self, request: Request<'_>) -> Result<Answer, Refusal> {
        // A command may have been requested before a stop and come, or come again, after it.
        if let Request::Command(_) = request {
            self.check_connection()?;
        }
        match request {
            // A start that could not be counted has the challenges of an earlier start, so a late copy of a `Hello` from then may have opened
            // this connection: it may read, and nothing else but write a profile, for which a person holds the button.
            Request::Command(_)
            | Request::Calibrate(_)
            | Request::Begin(Image { kind: ImageKind::Table, .. })
            | Request::Commit(Image { kind: ImageKind::Table, .. })
                if self.boots == 0 =>
            {
                Err(Refusal::Storage)
            }
            Request::Hello { .. } | Request::Nearest(_) => Err(Refusal::Unknown),
            Request::Status => Ok(Answer::Status(self.status().await)),
            Request::Events { from } => {
                self.catch_up();
                Ok(Answer::Events(self.log.from(from)))
            }
            Request::Begin(image) => self.begin(image).await,
            Request::Chunk { offset, bytes } => self.chunk(offset, bytes).await,
            Request::Commit(image) => self.commit(image).await,
            Request::Command(command) => self.command(command).await.map(|()| Answer::Done),
            Request::Calibrate(calibration) => self.calibrate(calibration).await,
            Request::Calibration => Ok(Answer::Calibration(self.calibration?)),
            Request::Outputs { from } => Ok(Answer::Outputs(self.outputs(from).await)),
            Request::Health => Ok(Answer::Health(self.health())),
            Request::PastEvents { skip } => Ok(Answer::PastEvents(self.log.before(skip))),
            Request::PastCrash { back } => Ok(Answer::PastCrash(self.past_crash(back))),
            Request::Inputs { from } => Ok(Answer::Inputs(self.shared.inputs.from(from))),
        }
    }

    /// Refuses what comes on a connection that was opened before the last stop.
    fn check_connection(&self) -> Result<(), Refusal> {
        self.shared.check_stops(self.link_stops).map_err(Refusal::Command)
    }

    /// Does what a person or a host asks for, or says why not.
    pub(crate) async fn command(&mut self, command: Command) -> Result<(), Refusal> {
        if command == Command::Play {
            self.rehearse().await?;
        }
        self.shared.command(command, self.stops).await.map_err(Refusal::Command)
    }

    /// Waits until the servos that a stop, or a start, is to hold have their orders.
    async fn wait_until_stopped(&self) -> Snapshot {
        let mut now = self.shared.snapshot().await;
        while now.is_stopping {
            self.clock.wait_until(self.clock.now() + CYCLE).await;
            now = self.shared.snapshot().await;
        }
        now
    }

    /// Nothing runs and no servo moves: while a flash is written or the board restarts nobody looks after a servo.
    async fn require_idle(&self) -> Result<(), Refusal> {
        let now = self.wait_until_stopped().await;
        match now.phase {
            Phase::Idle | Phase::Safe(_) if now.is_moving => Err(Refusal::Busy),
            Phase::Idle | Phase::Safe(_) => Ok(()),
            Phase::Manual | Phase::Approaching { .. } | Phase::Playing { .. } => Err(Refusal::Busy),
        }
    }

    /// An earlier crash, 0 the last one.
    pub(crate) fn past_crash(&self, back: u8) -> Option<CrashRecord> {
        self.board.kept.and_then(|kept| past(kept, back))
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

fn payload(bytes: &[u8]) -> Payload {
    bytes.iter().copied().take(MAX_PAYLOAD).collect()
}
