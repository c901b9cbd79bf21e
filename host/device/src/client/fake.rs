//! A scripted board for the client's tests: keeps the rules of the wire and nothing else. Its time is virtual and passes
//! while the client waits.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use darm_core::sequencer::{Command, Phase};
use darm_core::units::{DeviceId, Digest, Micros, Word};
use darm_core::wire::bootstrap::{ANSWER, Identity, Request as Bootstrap, Version};
use darm_core::wire::caps::{BuildId, Caps};
use darm_core::wire::frame::{Header, MAX_FRAME, encode};
use darm_core::wire::message::{Answer, Hello, Image, REPLY, REQUEST, Refusal, Reply, Request, Status};

use sha2::{Digest as _, Sha256};

use super::reader::{Piece, Reader};
use crate::link::{Link, LinkError};

/// Waits in real time until something is so.
pub(super) fn until(wanted: impl Fn() -> bool) {
    let since = Instant::now();
    while !wanted() {
        assert!(since.elapsed() < Duration::from_secs(30), "it did not come");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// What a fake board remembers and a test may look at.
#[derive(Default)]
pub(super) struct Memory {
    pub(super) now_s: f64,
    pub(super) protocol: u16,
    /// Says nothing more, and takes nothing.
    pub(super) mute: bool,
    /// What came meanwhile.
    pub(super) unheard: Vec<Header>,
    /// Damages every answer.
    pub(super) garble: bool,
    /// Restarts after the next command has acted and before its answer leaves.
    pub(super) restart_after_command: bool,
    connection: Option<u32>,
    /// Connections and resets so far.
    challenge: u64,
    /// Number and frame of the last answer to a request that runs once.
    last: Option<(u16, Vec<u8>)>,
    upload: Option<(Image, Vec<u8>)>,
    /// Keeps chunks that come ahead of the wanted one, as firmware does since it writes them to their place.
    pub(super) keeps_ahead: bool,
    ahead: BTreeMap<u32, Vec<u8>>,
    /// Images that were committed.
    pub(super) committed: Vec<Vec<u8>>,
    /// Stops that came.
    pub(super) stops: usize,
    /// Text outside frames that came.
    pub(super) typed: Vec<u8>,
    /// Commands that ran.
    pub(super) commands: Vec<Command>,
    /// Largest offset that a host has begun to upload from after the first time.
    pub(super) resumed_at: u32,
    out: VecDeque<u8>,
}

impl Memory {
    /// Loses what is in RAM, as by a reset.
    pub(super) fn reset(&mut self) {
        (self.connection, self.last, self.upload) = (None, None, None);
        self.challenge += 1;
        self.ahead.clear();
    }

    /// Takes nothing more from the connection that is open, as after a stop.
    pub(super) fn end_connection(&mut self) {
        self.connection = None;
        self.challenge += 1;
    }

    pub(super) fn say(&mut self, text: &str) {
        self.out.extend(text.bytes());
    }

    fn answer(&mut self, header: Header, payload: &[u8]) -> Vec<u8> {
        let mut frame = [0; MAX_FRAME];
        let len = encode(header, payload, &mut frame).unwrap();
        frame[2] ^= u8::from(self.garble);
        self.out.extend(&frame[..len]);
        frame[..len].to_vec()
    }

    fn take(&mut self, header: Header, payload: &[u8]) {
        let answered = Header { tag: header.tag | ANSWER, ..header };
        match Bootstrap::decode(header.tag, payload) {
            Some(Bootstrap::Identify) => {
                let board = "fake".parse().unwrap();
                self.answer(answered, &Identity { device: DeviceId([7; 12]), board }.encode());
            }
            Some(Bootstrap::Version) => {
                self.answer(answered, &Version { protocol: self.protocol, firmware: [0, 1, 0] }.encode());
            }
            Some(request) => {
                self.stops += usize::from(request == Bootstrap::Stop);
                self.answer(answered, &[0]);
            }
            None if header.tag == REQUEST => self.take_request(header, payload),
            None => {}
        }
    }

    fn take_request(&mut self, header: Header, payload: &[u8]) {
        let request: Request = postcard::from_bytes(payload).unwrap();
        let once = !request.is_repeatable();
        if let (true, Some((number, frame))) = (once, &self.last) {
            let ahead = header.number.wrapping_sub(*number);
            if ahead == 0 {
                self.out.extend(frame.clone());
            }
            if ahead == 0 || ahead > u16::MAX / 2 {
                return;
            }
        }
        let result = self.execute(header.link, &request);
        if result.is_ok() && matches!(request, Request::Command(_)) && std::mem::take(&mut self.restart_after_command) {
            return self.reset();
        }
        let reply = Reply { at: Micros((self.now_s * 1e6) as u64), result };
        let mut buffer = [0; 300];
        let payload = postcard::to_slice(&reply, &mut buffer).unwrap();
        let frame = self.answer(Header { tag: REPLY, ..header }, payload);
        if once {
            self.last = Some((header.number, frame));
        }
    }

    fn execute(&mut self, link: u32, request: &Request) -> Result<Answer, Refusal> {
        if let Request::Hello { protocol, challenge } = request {
            if self.connection != Some(link) {
                if *challenge != self.challenge + 1 {
                    return Err(Refusal::Challenge { challenge: self.challenge + 1 });
                }
                self.challenge += 1;
                self.last = None;
            }
            self.connection = Some(link);
            let device = DeviceId([7; 12]);
            return Ok(Answer::Hello(Hello {
                protocol: *protocol,
                device,
                model: None,
                table: None,
                profile: Digest::default(),
                boots: 1,
                next_event: 0,
                caps: Caps::largest("fake", 65_536, BuildId::default()),
            }));
        }
        if self.connection != Some(link) {
            return Err(Refusal::NotConnected);
        }
        match request {
            Request::Status => Ok(Answer::Status(idle())),
            Request::Begin(image) => Ok(Answer::Upload { next: self.begin(image) }),
            Request::Chunk { offset, bytes } => {
                let (_, have) = self.upload.as_mut().ok_or(Refusal::NoUpload)?;
                if self.keeps_ahead {
                    self.ahead.insert(*offset, bytes.to_vec());
                } else if *offset as usize == have.len() {
                    have.extend(*bytes);
                }
                while let Some(bytes) = self.ahead.remove(&(have.len() as u32)) {
                    have.extend(bytes);
                }
                Ok(Answer::Upload { next: have.len() as u32 })
            }
            Request::Commit(image) => match &self.upload {
                Some((begun, have)) if begun == image && Sha256::digest(have)[..] == image.digest.0 => {
                    self.committed.push(have.clone());
                    Ok(Answer::Committed { rows: 3 })
                }
                _ => Err(Refusal::Damaged),
            },
            Request::Command(command) => {
                self.commands.push(*command);
                Ok(Answer::Done)
            }
            _ => Err(Refusal::Unknown),
        }
    }

    fn begin(&mut self, image: &Image) -> u32 {
        if self.upload.as_ref().is_none_or(|(begun, _)| begun != image) {
            self.upload = Some((*image, Vec::new()));
            self.ahead.clear();
        }
        let have = self.upload.as_ref().map_or(0, |(_, bytes)| bytes.len()) as u32;
        self.resumed_at = self.resumed_at.max(have);
        have
    }
}

fn idle() -> Status {
    Status {
        phase: Phase::Idle,
        word: Word::default(),
        rows: 0,
        model: None,
        switches: 0,
        servos: Default::default(),
        bad_frames: 0,
        worst_lateness_us: 0,
    }
}

/// A plug of the board; the board remembers when it is pulled.
pub(super) struct FakeBoard {
    memory: Arc<Mutex<Memory>>,
    reader: Reader,
    now_s: f64,
    /// The cable is pulled after this many bytes from the host.
    cut_after: Option<usize>,
}

impl FakeBoard {
    pub(super) fn new() -> (Self, Arc<Mutex<Memory>>) {
        let memory = Arc::new(Mutex::new(Memory { protocol: darm_core::wire::PROTOCOL, ..Memory::default() }));
        (Self::plug(&memory, None), memory)
    }

    pub(super) fn plug(memory: &Arc<Mutex<Memory>>, cut_after: Option<usize>) -> Self {
        let now_s = memory.lock().unwrap().now_s;
        memory.lock().unwrap().out.clear();
        Self { memory: memory.clone(), reader: Reader::default(), now_s, cut_after }
    }
}

impl Link for FakeBoard {
    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        if let Some(left) = &mut self.cut_after {
            *left = left.checked_sub(bytes.len()).ok_or(LinkError::Closed { port: "fake".into() })?;
        }
        let mut memory = self.memory.lock().unwrap();
        for piece in self.reader.read(self.now_s, bytes) {
            match piece {
                Piece::Frame(header, _) if memory.mute => memory.unheard.push(header),
                Piece::Frame(header, payload) => memory.take(header, &payload),
                Piece::Text(text) => memory.typed.extend(text),
                Piece::Damaged(_) => {}
            }
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, LinkError> {
        let mut memory = self.memory.lock().unwrap();
        let count = buffer.len().min(memory.out.len());
        buffer.iter_mut().zip(memory.out.drain(..count)).for_each(|(to, from)| *to = from);
        self.now_s += if count > 0 { 1e-3 } else { timeout.as_secs_f64() };
        memory.now_s = self.now_s;
        Ok(count)
    }

    fn now_s(&self) -> f64 {
        self.now_s
    }

    fn name(&self) -> &str {
        "fake"
    }
}
